"""Enclosures of functions and of their Jacobians over sets, implicit variables included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np

from symheli.codegen.program import Operation, ScalarProgram
from symheli.codegen.translation import operations
from symheli.enclosure.domain import Domain
from symheli.enclosure.form import EPS, MARGIN, AffineForm, hull, pick
from symheli.enclosure.interval import Interval
from symheli.errors import InputError

Array = np.ndarray

TRIALS = 8
"""Radii tried, each four times the last, until Newton's operator maps an interval into itself."""
NEWTON_STEPS = 20
"""At most, towards the root at the centre of a set."""
GROWTH = 4.0
FIRST_RADIUS = 1.5
"""First radius tried, in units of the remainder divided by the slope."""


@dataclass(frozen=True)
class Enclosure:
    """Guaranteed bounds of a function over N sets, or over one (without the axis N).

    value : AffineForm (N, n_out)
        The outputs, stacked in their order.
    jacobian : AffineForm (N, n_out, n_in), or None
        Derivatives by the inputs asked for, stacked; where the function has a kink, the hull of its
        slopes.
    roots : AffineForm (N, n_roots)
        The implicit variables: each is unique within its interval, for every point of the set.
    symbols : int
        Number of symbols of the domains. Those after them, each within [-1, 1] by itself, say where
        between the slopes of its two sides a kink of the function is.

    Where a set is too large, or a function not defined on all of it, bounds are infinite.
    """

    value: AffineForm
    jacobian: AffineForm | None
    roots: AffineForm
    symbols: int

    @property
    def finite(self) -> Array:
        """Whether all bounds of a set are finite, (N,) or a bool."""
        forms = [self.value, *([] if self.jacobian is None else [self.jacobian])]
        leading = self.value.shape[:-1]
        checks = [np.isfinite(f.rest).reshape(*leading, -1).all(axis=-1) for f in forms]
        return np.logical_and.reduce(checks)


def enclose(
    function: casadi.Function,
    *domains: Domain,
    start: casadi.Function | None = None,
    by: Sequence[int] = (),
    continuous: bool = False,
) -> Enclosure:
    """Guaranteed bounds of a function and of its Jacobian over sets of its inputs.

    Parameters
    ----------
    function : casadi.Function
        SX, of dense column vectors: + - * / sqrt | |, sin, cos, tan, asin, atan2, exp, fmin, fmax,
        comparisons and selections. With implicit variables: (inputs, lam) -> (outputs, balance),
        lam the zero of the balance, equation i without the variables after lam_i
        (`Helicopter.implicit`).
    *domains : Domain
        One for each input but lam; those of N sets at once all have the same N, the others are
        shared.
    start : casadi.Function
        (inputs) -> lam, a floating-point zero of the balance (`Helicopter.inflow`). The root that
        continues it over the set is enclosed. None: no implicit variables.
    by : sequence of int
        Positions of the inputs by which derivatives are bounded too, in this order; those through
        the implicit variables are included.
    continuous : bool
        The caller knows that the function is continuous where a selection may take either side:
        derivatives are then bounded by those of both sides. Otherwise they are infinite there,
        since the function might jump; `fabs`, `fmin` and `fmax` never jump.

    Returns
    -------
    Enclosure
        First order in the symbols of the domains, in the order given, rounding included. The
        bounds hold for real arithmetic on the constants of the function as they are stored.

    Raises
    ------
    InputError
        Domains that do not fit the inputs, an operation that has no bounds here.

    References
    ----------
    de Figueiredo & Stolfi (2004), Affine arithmetic; Neumaier (1990), Interval Methods for Systems
    of Equations, section 5.1 (Newton's operator).

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x", 2)
    >>> f = casadi.Function("f", [x], [x[0] * x[1]])
    >>> unit_disk = Domain.ellipsoid([0, 0], [[1, 0], [0, 1]])
    >>> bounds = enclose(f, unit_disk).value.interval
    >>> print(bounds.lower.round(6), bounds.upper.round(6))
    [-0.5] [0.5]
    """
    implicit = 0 if start is None else start.numel_out(0)
    program = operations(function)
    kinks = [k for k, o in enumerate(program.operations) if o.name in KINKS]
    kinks = kinks if by or implicit else []
    symbols = _Symbols.of(function, domains, implicit, len(kinks))
    seeds = sum(domains[i].size for i in by)
    inputs = symbols.inputs(by, implicit)
    over = _Over(
        program, {k: symbols.own + i for i, k in enumerate(kinks)}, continuous, seeds + implicit
    )
    outputs = list(program.outputs)
    values: list[Value] = [None] * len(program.operations)
    found: list[_Dual] = []
    if start is not None:
        guesses = _at_centres(start, symbols)
        inputs.append(found)
        for i, position in enumerate(outputs.pop()):
            found.append(_solve(over, position, inputs, guesses[:, i], seeds, values))
    flat = over.evaluate([a for output in outputs for a in output], inputs, values)
    like = inputs[0][0].value
    value = _stacked([d.value for d in flat], like)
    roots = _stacked([d.value for d in found], like)
    slopes = None
    if by:
        rows = [d.derivative(over.seeds)[:, :seeds] for d in flat]
        slopes = _stacked(rows, like, (seeds,))
    return Enclosure(*symbols.finished(value, slopes, roots), symbols.own)


def segment_averages(
    function: casadi.Function,
    *domains: Domain,
    along: Sequence[int],
    start: casadi.Function | None = None,
    continuous: bool = False,
    pieces: int = 4,
) -> tuple[AffineForm, int]:
    """Averages of the Jacobian over segments from the centre of a set to each of its points.

    f(x(z)) - f(x(0)) = J [x(z) - x(0)] with J (n_out, n_in) in the form returned, by the mean value
    theorem. What is linear in z is averaged over [0, z], and halves. The equations are enclosed
    over `pieces` sets of 1/pieces, 2/pieces, ... of the size, one for each part of a segment: a
    remainder of second order falls to a third, one of first order to a half.

    Parameters
    ----------
    function, domains, start, continuous
        As for `enclose`.
    along : sequence of int
        Positions of the inputs that move along the segment; J has their derivatives. The others are
        the same all along it, any ones of their domains.
    pieces : int
        Parts of a segment.

    Returns
    -------
    average : AffineForm (N, n_out, n_in), or without the axis N
        In the symbols of the domains, and of kinks.
    symbols : int
        Number of those of the domains.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x", 1)
    >>> f = casadi.Function("f", [x], [x**2])
    >>> average, _ = segment_averages(f, Domain.box([-1.0], [1.0]), along=[0])
    >>> print(average.centre.round(6), average.slopes.round(6))
    [[0.]] [[[1.]]]
    """
    counts = [
        len(m) for d in domains for m, axes in ((d.centre, 1), (d.generators, 2)) if m.ndim > axes
    ]
    count, sizes = max(counts, default=1), np.arange(1, pieces + 1) / pieces
    over = [
        _pieces(d, count, sizes if i in along else np.ones(pieces)) for i, d in enumerate(domains)
    ]
    found = enclose(function, *over, start=start, by=along, continuous=continuous)
    j = found.jacobian
    if j is None:
        raise InputError("averages along segments need along=[0, ...]: inputs that move")
    moving = np.concatenate([np.full(sum(d.groups), i in along) for i, d in enumerate(domains)])
    groups, own = j.groups, found.symbols

    def parts(values: Array) -> Array:
        return values.reshape(-1, pieces, *values.shape[1:])

    # on part k of the segment, s z is at (k + 1/2) / (k + 1) of the set's size on average
    share = (np.arange(pieces) + 0.5) / np.arange(1, pieces + 1)
    slopes, rest = parts(j.slopes), parts(j.rest).mean(axis=1)
    linear = slopes[..., :own] * np.where(moving, share[:, None], 1.0)[:, None, None]
    kinks, more = _common(slopes[..., own:])
    size = np.abs(parts(j.centre)).mean(axis=1) + np.abs(slopes).sum(axis=-1).mean(axis=1)
    rest = (rest + more + 4 * pieces * EPS * size) * MARGIN
    average = AffineForm(
        parts(j.centre).mean(axis=1),
        np.concatenate([linear.mean(axis=1), kinks], axis=-1),
        rest,
        groups,
    )
    return (average if counts else average[0]), own


def _pieces(domain: Domain, count: int, sizes: Array) -> Domain:
    """The domain in each of these sizes, side by side, for each of `count` sets."""
    centre = np.broadcast_to(domain.centre, (count, domain.size))
    each = np.broadcast_to(domain.generators, (count, *domain.generators.shape[-2:]))
    generators = (sizes[:, None, None] * each[:, None]).reshape(count * len(sizes), *each.shape[1:])
    return Domain(np.repeat(centre, len(sizes), axis=0), generators, domain.groups)


def _common(slopes: Array) -> tuple[Array, Array]:
    """Factors of numbers in [-1, 1], another one on each part of a segment, (N, K, ..., k): those
    of their averages (N, ..., k), and what that leaves (N, ...).

    sum of M_i s_i / K = M s + ..., M_i = c_i M + ..., with s between the averages of -|c_i|, |c_i|.
    """
    mean = slopes.mean(axis=1)
    axes = tuple(range(2, slopes.ndim - 1))
    product = (slopes * mean[:, None]).sum(axis=axes, keepdims=True)
    square = (mean * mean).sum(axis=tuple(a - 1 for a in axes), keepdims=True)[:, None]
    share = np.divide(product, square, out=np.zeros(product.shape), where=square > 0)
    left = np.abs(slopes - share * mean[:, None]) + 4 * EPS * np.abs(slopes)
    return np.abs(share).mean(axis=1) * mean * MARGIN, left.mean(axis=1).sum(axis=-1) * MARGIN


# --- inputs and outputs --------------------------------------------------------------------------


@dataclass(frozen=True)
class _Symbols:
    """The domains of all inputs as one vector of symbols."""

    domains: tuple[Domain, ...]
    own: int
    groups: tuple[int, ...]
    count: int
    many: bool

    @classmethod
    def of(
        cls, function: casadi.Function, domains: Sequence[Domain], implicit: int, kinks: int
    ) -> _Symbols:
        sizes = [function.size1_in(i) for i in range(function.n_in())]
        expected = [d.size for d in domains] + [implicit] * (implicit > 0)
        if sizes != expected:
            raise InputError(
                f"{function.name()} takes inputs of sizes {sizes}; the domains and `start` have"
                f" {expected}"
            )
        counts = {d.centre.shape[0] for d in domains if d.centre.ndim == 2} | {
            d.generators.shape[0] for d in domains if d.generators.ndim == 3
        }
        if len(counts) > 1:
            raise InputError(f"domains of {sorted(counts)} sets: all need the same number")
        groups = tuple(g for d in domains for g in d.groups)
        own = sum(groups)
        return cls(tuple(domains), own, groups + (1,) * kinks, max(counts, default=1), bool(counts))

    @property
    def centres(self) -> list[Array]:
        return [np.broadcast_to(d.centre, (self.count, d.size)) for d in self.domains]

    def inputs(self, by: Sequence[int], implicit: int) -> list[list[_Dual]]:
        """The inputs as forms, with derivatives by those at the positions `by` and, after them, by
        the implicit variables.
        """
        sizes = [self.domains[i].size for i in by]
        column = dict(zip(by, np.cumsum([0, *sizes])[:-1].tolist(), strict=True))
        out: list[list[_Dual]] = []
        place = 0
        for position, (domain, centre) in enumerate(zip(self.domains, self.centres, strict=True)):
            width = sum(domain.groups)
            slopes = np.zeros((self.count, domain.size, sum(self.groups)))
            slopes[..., place : place + width] = domain.generators
            row = []
            for i in range(domain.size):
                value = AffineForm(centre[:, i], slopes[:, i], np.zeros(self.count), self.groups)
                seed = None
                if position in by:
                    seed = _seed(value, column[position] + i, sum(sizes) + implicit)
                row.append(_Dual(value, seed))
            out.append(row)
            place += width
        return out

    def finished(
        self, value: AffineForm, slopes: AffineForm | None, roots: AffineForm
    ) -> tuple[AffineForm, AffineForm | None, AffineForm]:
        """The results without symbols of kinks that lie in no set, of one set without the axis."""
        used = [] if slopes is None else np.any(slopes.slopes != 0, axis=(0, 1, 2))[self.own :]
        kept = [*range(self.own), *(self.own + np.flatnonzero(used)).tolist()]
        groups = self.groups[: len(self.groups) - len(used)] + (1,) * (len(kept) - self.own)

        def trimmed(form: AffineForm) -> AffineForm:
            form = AffineForm(form.centre, form.slopes[..., kept], form.rest, groups, form.interval)
            return form if self.many else form[0]

        return trimmed(value), None if slopes is None else trimmed(slopes), trimmed(roots)


def _seed(value: AffineForm, column: int, seeds: int) -> AffineForm:
    """The derivative of an input by all inputs."""
    centre = np.zeros((len(value.centre), seeds))
    centre[:, column] = 1.0
    slopes = np.zeros((*centre.shape, value.slopes.shape[-1]))
    return AffineForm(centre, slopes, np.zeros(centre.shape), value.groups)


def _at_centres(start: casadi.Function, symbols: _Symbols) -> Array:
    """A function of the inputs at the centres of the sets, in floating point."""
    columns = [casadi.DM(c.T) for c in symbols.centres]
    return np.asarray(start.map(symbols.count)(*columns)).T


def _stacked(
    forms: Sequence[AffineForm], like: AffineForm, tail: tuple[int, ...] = ()
) -> AffineForm:
    """Forms of one shape side by side on a new second axis."""
    m, count = like.slopes.shape[-1], len(like.centre)
    if not forms:
        empty = np.zeros((count, 0, *tail))
        return AffineForm(empty, np.zeros((*empty.shape, m)), empty, like.groups)
    bounds = [f.interval for f in forms]
    return AffineForm(
        np.stack([f.centre for f in forms], axis=1),
        np.stack([f.slopes for f in forms], axis=1),
        np.stack([f.rest for f in forms], axis=1),
        like.groups,
        Interval(
            np.stack([b.lower for b in bounds], axis=1), np.stack([b.upper for b in bounds], axis=1)
        ),
    )


# --- values with derivatives ---------------------------------------------------------------------


@dataclass(frozen=True)
class _Dual:
    """A number (N,) with its derivatives by the inputs (N, seeds); None: all are 0."""

    value: AffineForm
    slope: AffineForm | None = None

    def derivative(self, seeds: int) -> AffineForm:
        return _zero(self.value, seeds) if self.slope is None else self.slope

    def chain(self, value: AffineForm, outer: AffineForm | None) -> _Dual:
        """A function of this number with the derivative `outer`."""
        return _Dual(value, None if outer is None else _times(outer, self.slope))

    def __add__(self, other: _Dual) -> _Dual:
        return _Dual(self.value + other.value, _sum(self.slope, other.slope))

    def __neg__(self) -> _Dual:
        return _Dual(-self.value, None if self.slope is None else -self.slope)

    def __mul__(self, other: _Dual) -> _Dual:
        if self is other:
            return self.chain(self.value.square(), self.value.scaled(2.0))
        slope = _sum(_times(other.value, self.slope), _times(self.value, other.slope))
        return _Dual(self.value * other.value, slope)

    def scaled(self, factor: float) -> _Dual:
        return _Dual(
            self.value.scaled(factor), None if self.slope is None else self.slope.scaled(factor)
        )

    def inverse(self) -> _Dual:
        value = self.value.inverse()
        return self.chain(value, None if self.slope is None else -value.square())

    def absolute(self, kink: AffineForm | None) -> _Dual:
        """`kink`: the symbol in [-1, 1] of the slope where the sign is open."""
        x = self.value.interval
        if self.slope is None or kink is None:
            return _Dual(self.value.absolute())
        one = AffineForm.constant(1.0, self.value)
        sign = pick(x.lower >= 0, one, pick(x.upper <= 0, -one, kink))
        return self.chain(self.value.absolute(), sign)

    def signed_square(self, kink: AffineForm | None) -> _Dual:
        """x|x|, whose derivative is 2|x|. `kink`: the symbol in [-1, 1] that |x| has instead of
        its remainder, the same one for all derivatives.
        """
        size = self.value.absolute()
        value = self.value * size
        if self.slope is None:
            return _Dual(value)
        if kink is not None:
            free = replace(size, rest=np.zeros(size.shape))
            size = replace(free + kink.scaled(size.rest), bound=size.bound)
        return self.chain(value, size.scaled(2.0))

    def maximum(self, other: _Dual, kink: AffineForm | None) -> _Dual:
        a, b = self.value.interval, other.value.interval
        slope = _either(a.lower >= b.upper, b.lower >= a.upper, self.slope, other.slope, kink)
        return _Dual(self.value.maximum(other.value), slope)


def _either(
    first: Array,
    second: Array,
    left: AffineForm | None,
    right: AffineForm | None,
    kink: AffineForm | None,
) -> AffineForm | None:
    """`left` where `first` holds, `right` where `second` does, else a mean of both: its weights are
    given by the symbol of the kink, the same ones for all derivatives.
    """
    some = right if left is None else left
    if some is None or kink is None:
        return None
    left, right = (_zero_like(some) if form is None else form for form in (left, right))
    if np.all(first | second):
        return pick(first[:, None], left, right)
    mean, half = (left + right).scaled(0.5), (left - right).scaled(0.5)
    both = mean + kink.broadcast(half.shape) * half
    return pick(first[:, None], left, pick(second[:, None], right, both))


def _zero(value: AffineForm, seeds: int) -> AffineForm:
    centre = np.zeros((len(value.centre), seeds))
    return AffineForm(
        centre, np.zeros((*centre.shape, value.slopes.shape[-1])), centre, value.groups
    )


def _zero_like(form: AffineForm) -> AffineForm:
    return AffineForm(
        np.zeros(form.shape), np.zeros(form.slopes.shape), np.zeros(form.shape), form.groups
    )


def _between(like: AffineForm, lower: float, upper: float) -> AffineForm:
    return AffineForm.between(
        Interval(np.full(like.shape, lower), np.full(like.shape, upper)), like
    )


def _sum(a: AffineForm | None, b: AffineForm | None) -> AffineForm | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _times(value: AffineForm, slope: AffineForm | None) -> AffineForm | None:
    """A number (N,) times derivatives (N, seeds)."""
    return None if slope is None else value.broadcast(slope.shape) * slope


# --- evaluation ----------------------------------------------------------------------------------

Value = Any
"""A float (constant), a `_Dual`, or the state of a condition: an array with 1 true, 0 false, -1
either.
"""


KINKS = ("fabs", "min", "max", "select", "number")
"""Operations whose derivative may jump."""


@dataclass(frozen=True)
class _Over:
    """A program evaluated over sets, with derivatives by `seeds` variables; `kinks`: the symbol of
    each operation that may have a kink.
    """

    program: ScalarProgram
    kinks: Mapping[int, int]
    continuous: bool
    seeds: int

    def evaluate(
        self, positions: Sequence[int], inputs: Sequence[Sequence[_Dual]], values: list[Value]
    ) -> list[_Dual]:
        """The numbers at these positions of the program; `values` holds those computed before, None
        for the others, and is filled.
        """
        with np.errstate(all="ignore"):
            for k in self.needed(positions):
                if values[k] is None:
                    values[k] = self._apply(k, values, inputs)
            return [_dual(values[k], inputs[0][0].value) for k in positions]

    def needed(self, positions: Sequence[int]) -> list[int]:
        """Positions of the operations that these need, in order."""
        used = set(positions)
        for k in range(max(used), -1, -1):
            if k in used:
                used.update(self.program.operations[k].arguments)
        return sorted(used)

    def _kink(self, position: int, like: AffineForm) -> AffineForm | None:
        if position not in self.kinks:
            return None
        slopes = np.zeros(like.slopes.shape)
        slopes[:, self.kinks[position]] = 1.0
        return AffineForm(np.zeros(like.shape), slopes, np.zeros(like.shape), like.groups)

    def _apply(self, k: int, values: list[Value], inputs: Sequence[Sequence[_Dual]]) -> Value:
        o = self.program.operations[k]
        if o.name == "input":
            return inputs[o.element[0]][o.element[1]]
        if o.name == "constant":
            return o.value
        a = [values[i] for i in o.arguments]
        like = inputs[0][0].value
        kink = self._kink(k, like) if self.seeds else None
        match o.name:
            case "lt" | "le" | "eq" | "ne":
                return _compared(o.name, *(_dual(v, like).value for v in a))
            case "not":
                return np.where(a[0] < 0, -1, 1 - a[0])
            case "and":
                false, true = (a[0] == 0) | (a[1] == 0), (a[0] == 1) & (a[1] == 1)
                return np.where(false, 0, np.where(true, 1, -1))
            case "or":
                false, true = (a[0] == 0) & (a[1] == 0), (a[0] == 1) | (a[1] == 1)
                return np.where(true, 1, np.where(false, 0, -1))
            case "number":
                return self._select(a[0], _dual(1.0, like), _dual(0.0, like), kink)
            case "select":
                yes, no = _dual(a[1], like), _dual(a[2], like)
                match _extreme(self.program, o):
                    case "min":
                        return -((-yes).maximum(-no, kink))
                    case "max":
                        return yes.maximum(no, kink)
                return self._select(a[0], yes, no, kink)
            case "mul" if isinstance(a[0], float) and isinstance(a[1], _Dual):
                return a[1].scaled(a[0])
            case "mul" if isinstance(a[1], float) and isinstance(a[0], _Dual):
                return a[0].scaled(a[1])
            case "div" if isinstance(a[1], float) and isinstance(a[0], _Dual):
                exact = np.frexp(a[1])[0] in (0.5, -0.5)
                return a[0].scaled(1 / a[1]) if exact else a[0] * _dual(a[1], like).inverse()
            case "sqrt":
                return _square_root(self.program, o, values, _dual(a[0], like))
        d = [_dual(v, like) for v in a]
        match o.name:
            case "mul" if (found := self._squared(o.arguments, values, like)) is not None:
                return found
            case "add":
                return d[0] + d[1]
            case "sub":
                return d[0] + -d[1]
            case "mul":
                return d[0] * d[1]
            case "div":
                return d[0] * d[1].inverse()
            case "neg":
                return -d[0]
            case "fabs":
                return d[0].absolute(kink)
            case "max":
                return d[0].maximum(d[1], kink)
            case "min":
                return -((-d[0]).maximum(-d[1], kink))
            case "atan2":
                return _angle(d[0], d[1])
            case "sin" | "cos" | "exp" | "asin":
                outer = None if d[0].slope is None else d[0].value.slope_of(o.name)
                return d[0].chain(d[0].value.elementary(o.name), outer)
        raise InputError(f"{self.program.name}: the operation {o.name} has no bounds")

    def _squared(
        self, factors: tuple[int, ...], values: list[Value], like: AffineForm
    ) -> _Dual | None:
        """The product x (a + b |x|) = a x + b x|x|, None where it is no such product."""
        for x, other in (factors, factors[::-1]):
            parts = self._with_absolute(other, x, values, like)
            if parts is not None:
                free, size, position = parts
                kink = self._kink(position, like) if self.seeds else None
                own = _dual(values[x], like)
                square = own.signed_square(kink) * size
                return square if free is None else square + free * own
        return None

    def _with_absolute(
        self, k: int, x: int, values: list[Value], like: AffineForm
    ) -> tuple[_Dual | None, _Dual, int] | None:
        """(a, b, position of |x|) of an operation that is a + b |x|; a None: 0."""
        o = self.program.operations[k]
        if o.name == "fabs" and o.arguments == (x,):
            return None, _dual(1.0, like), k
        if o.name not in ("add", "mul", "neg"):
            return None
        for one, rest in zip(o.arguments, (o.arguments[1:], o.arguments[:1]), strict=False):
            parts = self._with_absolute(one, x, values, like)
            if parts is None:
                continue
            free, size, position = parts
            other = [_dual(values[i], like) for i in rest]
            match o.name:
                case "add":
                    return (other[0] if free is None else free + other[0]), size, position
                case "mul":
                    return (None if free is None else free * other[0]), size * other[0], position
            return (None if free is None else -free), -size, position
        return None

    def _select(self, condition: Array, yes: _Dual, no: _Dual, kink: AffineForm | None) -> _Dual:
        """One of two numbers; both where the condition is open."""
        value = pick(condition == 0, no.value, hull(yes.value, no.value))
        value = pick(condition == 1, yes.value, value)
        if kink is None:
            return _Dual(value)
        slope = _either(condition == 1, condition == 0, yes.slope, no.slope, kink)
        if self.continuous or np.all(condition >= 0):
            return _Dual(value, slope)
        # the function may jump: no bound of its slope
        return _Dual(value, _endless(slope or _zero(kink, self.seeds), condition < 0))


def _endless(slope: AffineForm, where: Array) -> AffineForm:
    """Derivatives that are not bounded in some sets."""
    none = AffineForm(slope.centre, slope.slopes, np.full(slope.shape, np.inf), slope.groups)
    return pick(where[:, None], none, slope)


def _dual(value: Value, like: AffineForm) -> _Dual:
    return value if isinstance(value, _Dual) else _Dual(AffineForm.constant(value, like))


def _compared(name: str, a: AffineForm, b: AffineForm) -> Array:
    x = (a - b).interval
    y, z = a.interval, b.interval
    if name in ("eq", "ne"):
        apart = (x.lower > 0) | (x.upper < 0)
        same = (y.lower == y.upper) & (z.lower == z.upper) & (y.lower == z.lower)
        yes, no = (same, apart) if name == "eq" else (apart, same)
    elif name == "lt":
        yes, no = (x.upper < 0) | (y.upper < z.lower), (x.lower >= 0) | (y.lower >= z.upper)
    else:
        yes, no = (x.upper <= 0) | (y.upper <= z.lower), (x.lower > 0) | (y.lower > z.upper)
    return np.where(yes, 1, np.where(no, 0, -1))


def _extreme(program: ScalarProgram, selection: Operation) -> str:
    """ "min" or "max" where a selection takes the smaller or larger of the numbers compared."""
    condition, *sides = selection.arguments
    o = program.operations[condition]
    if o.name == "not":
        o, sides = program.operations[o.arguments[0]], sides[::-1]
    if o.name not in ("lt", "le"):
        return ""
    return {o.arguments: "min", o.arguments[::-1]: "max"}.get(tuple(sides), "")


def _square_root(
    program: ScalarProgram, o: Operation, values: list[Value], argument: _Dual
) -> _Dual:
    """A square root. Of a sum of squares, sqrt(x^2 + y^2 + c), the derivatives x/sqrt and y/sqrt
    are at most 1 in size, also where the root passes 0.
    """
    value = argument.value.sqrt()
    if argument.slope is None:
        return _Dual(value)
    terms = _squares(program, o.arguments[0])
    inverse = value.inverse()
    if terms is None:
        return argument.chain(value, inverse.scaled(0.5))
    slope: AffineForm | None = None
    for position in terms:
        x = values[position]
        if not isinstance(x, _Dual) or x.slope is None:
            continue
        ratio = x.value * inverse
        ratio = replace(
            ratio, bound=ratio.interval.intersect(_between(x.value, -1.0, 1.0).interval)
        )
        slope = _sum(slope, _times(ratio.settled(), x.slope))
    return _Dual(value, slope)


def _squares(program: ScalarProgram, position: int) -> list[int] | None:
    """Positions of the numbers whose squares are summed there, None where that is no such sum."""
    o = program.operations[position]
    if o.name == "constant" and o.value >= 0:
        return []
    if o.name == "mul" and o.arguments[0] == o.arguments[1]:
        return [o.arguments[0]]
    if o.name == "add":
        parts = [_squares(program, a) for a in o.arguments]
        return None if None in parts else [k for part in parts for k in part or ()]
    return None


def _angle(y: _Dual, x: _Dual) -> _Dual:
    """atan2(y, x): atan(y/x) where x > 0 for sure, else no more than its range."""
    ratio = y * x.inverse()
    outer = None if ratio.slope is None else ratio.value.slope_of("atan")
    right = ratio.chain(ratio.value.elementary("atan"), outer)
    sure = x.value.interval.lower > 0
    if np.all(sure):
        return right
    value = pick(sure, right.value, _between(y.value, -np.pi, float(np.nextafter(np.pi, 4))))
    slope = right.slope
    if slope is not None:
        slope = _endless(slope, ~sure)
    return _Dual(value, slope)


# --- implicit variables --------------------------------------------------------------------------


def _solve(
    over: _Over,
    position: int,
    inputs: list[list[_Dual]],
    start: Array,
    seeds: int,
    values: list[Value],
) -> _Dual:
    """The zero of the equation at a position over each set, as a form, with its derivatives.

    The line l(z) = start + g z follows the root by the implicit function theorem; on l(z) +- radius
    the residual's slope F' keeps its sign, and -F(l)/F' lies within the radius: there is one root,
    and only one, for every z (Newton's operator).
    """
    like, known = inputs[0][0].value, len(inputs[-1])
    element, own = (len(inputs) - 1, known), seeds + known
    depends: set[int] = set()
    for k in over.needed([position]):
        o = over.program.operations[k]
        if o.name == "input" and o.element > element:
            raise InputError(
                f"{over.program.name}: equation {known} of the balance holds a later implicit"
                " variable; order the variables so that each equation brings one new variable"
            )
        if (o.name == "input" and o.element == element) or depends.intersection(o.arguments):
            depends.add(k)
    fixed = [a for k in depends for a in over.program.operations[k].arguments if a not in depends]
    if fixed:
        over.evaluate(fixed, inputs, values)

    def residual(guess: AffineForm) -> _Dual:
        """The residual with its derivatives, the implicit variable free."""
        free = [*inputs[:-1], [*inputs[-1], _Dual(guess, _seed(guess, own, over.seeds))]]
        return over.evaluate([position], free, list(values))[0]

    with np.errstate(all="ignore"):
        line = AffineForm.constant(start, like)
        for _ in range(NEWTON_STEPS):
            value, slope, before = *_with_slope(residual(line), own, over.seeds), line
            rate = np.where(slope.centre == 0, np.nan, slope.centre)
            line = AffineForm(
                np.nan_to_num(line.centre - value.centre / rate),
                np.nan_to_num(line.slopes - value.slopes / rate[:, None]),
                np.zeros(like.shape),
                like.groups,
            )
            moved = np.abs(line.centre - before.centre) + np.abs(line.slopes - before.slopes).sum(
                -1
            )
            if np.all(moved <= 1e-8 * (np.abs(line.centre) + np.abs(line.slopes).sum(-1))):
                break
        on_line, slope = _with_slope(residual(line), own, over.seeds)
        radius = np.nan_to_num(
            FIRST_RADIUS * on_line.interval.magnitude / np.abs(slope.centre), posinf=1e300
        )
        radius = radius + 4e-16 * np.abs(line.centre)
        proven = np.zeros(like.shape, bool)
        step = Interval(np.full(like.shape, -np.inf), np.full(like.shape, np.inf))
        for _ in range(TRIALS):
            _, slope = _with_slope(residual(replace(line, rest=radius)), own, over.seeds)
            trial = -on_line.interval * slope.interval.inverse()
            inside = (trial.lower > -radius) & (trial.upper < radius) & ~proven
            step = Interval(
                np.where(inside, trial.lower, step.lower), np.where(inside, trial.upper, step.upper)
            )
            proven |= inside
            if np.all(proven):
                break
            radius = np.where(proven, radius, np.minimum(radius * GROWTH, 1e300))
        middle = step.middle
        value = AffineForm(
            line.centre + middle,
            line.slopes,
            step.reach(middle) + np.spacing(np.abs(line.centre) + np.abs(middle)),
            like.groups,
        ).settled()
        # dx_root = -(dF/dinputs) / (dF/droot)
        total = residual(value).derivative(over.seeds)
        derivative = _times(-total[:, own].inverse(), total)
        return _Dual(value, None if derivative is None else _without(derivative, seeds))


def _with_slope(found: _Dual, column: int, seeds: int) -> tuple[AffineForm, AffineForm]:
    return found.value, found.derivative(seeds)[:, column]


def _without(slope: AffineForm, seeds: int) -> AffineForm:
    """Derivatives by the first variables only, those by the others set to 0."""
    kept = np.arange(slope.shape[-1]) < seeds
    bound = slope.interval
    return AffineForm(
        np.where(kept, slope.centre, 0.0),
        np.where(kept[:, None], slope.slopes, 0.0),
        np.where(kept, slope.rest, 0.0),
        slope.groups,
        Interval(np.where(kept, bound.lower, 0.0), np.where(kept, bound.upper, 0.0)),
    )
