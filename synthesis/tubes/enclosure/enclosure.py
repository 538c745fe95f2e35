"""Enclosures of functions and of their Jacobians over sets, implicit variables included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import casadi
import numpy as np

from symheli.codegen.program import Operation, ScalarProgram
from symheli.codegen.translation import operations
from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.tubes.enclosure.domain import Domain
from synthesis.tubes.enclosure.form import EPS, MARGIN, AffineForm, hull, pick
from synthesis.tubes.enclosure.interval import Interval

TRIALS = 8
"""Radii tried, each four times the last, until Newton's operator maps an interval into itself."""
NEWTON_STEPS = 20
"""At most, towards the root at the centre of a set."""
GROWTH = 4.0
BRANCHED = 2
"""Number of kinks both of whose sides are enclosed."""
WORTH = 0.2
"""Share of a row's remainder from which on a kink is one of these: the equations of one side, taken
at all points, may leave more than the hull of both sides.
"""
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
    symbols, _, *forms = _bounds(function, domains, start, by, continuous)
    return Enclosure(*symbols.finished(*forms), symbols.own)


class SegmentAverages(NamedTuple):
    """Averages of a Jacobian over segments: average(z) + mean over the pieces of the sums over
    kinks of k switched + k' turning z, for symbols z of the domains and numbers k, k' in [-1, 1],
    others of each kink and piece.

    average : AffineForm (N, n_out, n_in), or without the axis N
        In the symbols of the domains.
    switched : array (N, pieces, n_out, n_in, kinks), or without the axis N
        Half the jump of the Jacobian at a kink,
    turning : array (N, pieces, n_out, n_in, symbols, kinks), or without the axis N
        and its change with z.
    """

    average: AffineForm
    switched: Array
    turning: Array


def segment_averages(
    function: casadi.Function,
    *domains: Domain,
    along: Sequence[int],
    start: casadi.Function | None = None,
    continuous: bool = False,
    pieces: int = 4,
) -> SegmentAverages:
    """Averages of the Jacobian over segments from the centre of a set to each of its points.

    f(x(z)) - f(x(0)) = J [x(z) - x(0)] with J (n_out, n_in) in the form returned, by the mean value
    theorem. What is linear in z is averaged over [0, z], and halves. The equations are enclosed
    over `pieces` sets of 1/pieces, 2/pieces, ... of the size, one for each part of a segment: a
    remainder of second order falls to a third, one of first order to a half. Where the two largest
    kinks lie in a set, the Jacobian is that of one of their four pairs of sides at each point: each
    is enclosed, and J has the numbers k_1, k_2 and k_1 k_2.

    Parameters
    ----------
    function, domains, start, continuous
        As for `enclose`.
    along : sequence of int
        Positions of the inputs that move along the segment; J has their derivatives. The others are
        the same all along it, any ones of their domains.
    pieces : int
        Parts of a segment.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x", 1)
    >>> f = casadi.Function("f", [x], [x**2])
    >>> average, *_ = segment_averages(f, Domain.box([-1.0], [1.0]), along=[0])
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
    if not along:
        raise InputError("averages along segments need along=[0, ...]: inputs that move")
    moving = np.concatenate([np.full(sum(d.groups), i in along) for i, d in enumerate(domains)])
    centre, slopes, rest, own = _branches(function, over, pieces, start, along, continuous)

    def parts(values: Array) -> Array:
        return values.reshape(-1, pieces, *values.shape[1:])

    # on part k of the segment, s z is at (k + 1/2) / (k + 1) of the set's size on average
    share = (np.arange(pieces) + 0.5) / np.arange(1, pieces + 1)
    centre, slopes, rest = parts(centre), parts(slopes), parts(rest).mean(axis=1)
    size = (np.abs(centre).sum(axis=2) + np.abs(slopes).sum(axis=(2, -1))).mean(axis=1)
    linear = slopes[..., :own] * np.where(moving, share[:, None], 1.0)[:, None, None, None]
    switched, turning = (np.moveaxis(m[:, :, 1:], 2, -1) for m in (centre, linear))
    switched = np.concatenate([switched, slopes[:, :, 0, ..., own:]], axis=-1)
    more = np.zeros((*turning.shape[:-1], slopes.shape[-1] - own))
    turning = np.concatenate([turning, more], axis=-1)
    used = np.any(switched != 0, axis=(0, 1, 2, 3)) | np.any(turning != 0, axis=(0, 1, 2, 3, 4))
    average = AffineForm(
        centre[:, :, 0].mean(axis=1),
        linear[:, :, 0].mean(axis=1),
        (rest + 4 * pieces * EPS * size) * MARGIN,
        tuple(g for d in domains for g in d.groups),
    )
    switched, turning = switched[..., used], turning[..., used]
    if counts:
        return SegmentAverages(average, switched, turning)
    return SegmentAverages(average[0], switched[0], turning[0])


def _branches(
    function: casadi.Function,
    domains: Sequence[Domain],
    pieces: int,
    start: casadi.Function | None,
    along: Sequence[int],
    continuous: bool,
) -> tuple[Array, Array, Array, int]:
    """The Jacobian of N sets as sum over b of k_b (centre_b + slopes_b z) + [-rest, rest], k_0 = 1,
    the others -1 or 1 at each point, for the two largest kinks and their product: centre (N, b, n,
    m), slopes (N, b, n, m, .), rest (N, n, m), and the number of symbols of the domains. Of each
    `pieces` sets the last one holds the others.
    """
    whole = [_chosen(d, slice(pieces - 1, None, pieces)) for d in domains]
    symbols, first, _, j, _ = _bounds(function, whole, start, along, continuous)
    kinks = first.kinks
    own, count = symbols.own, len(domains[0].centre)
    reach = np.concatenate([np.abs(whole[i].generators).sum(axis=-1) for i in along], axis=-1)
    found = (np.abs(j.slopes[..., own:]) * reach[:, None, :, None]).sum(axis=2)
    for both, partner in first.partners:
        found[..., partner - own] += found[..., both - own]
    used = np.any(found > 0, axis=(0, 1))
    kept = sorted({k for k, any_ in zip(_numbers(function, kinks), used, strict=True) if any_})
    found = found[..., [kinks.index(k) for k in kept]]
    largest = np.argsort(-found.sum(axis=1).max(axis=0, initial=0.0))[:BRANCHED]
    left = (np.where(np.isfinite(j.rest), j.rest, 0.0) * reach[:, None]).sum(axis=2)
    worth = (found > 0) & (found >= WORTH * left[..., None])
    chosen = [int(k) for k in largest if np.any(worth[..., k])]
    pairs = list(product((1, -1), repeat=len(chosen)))
    signs = np.array(pairs, int).reshape(len(pairs), len(chosen))
    # J of each pair of sides by the products of their signs (Walsh's functions)
    walsh = np.array([np.prod(signs[:, row < 0], axis=1) for row in signs]) / len(signs)
    open_ = np.repeat(np.any(found[..., chosen] > 0, axis=(1, 2)), pieces)
    parts = []
    for sets, own_signs in ((~open_, signs[:1]), (open_, signs)):
        each = np.repeat(np.flatnonzero(sets), len(own_signs))
        if not len(each):
            continue
        sides = {kept[k]: np.tile(own_signs[:, i], sets.sum()) for i, k in enumerate(chosen)}
        sides = sides if len(own_signs) > 1 else {}
        some = [_chosen(d, each) for d in domains]
        *_, b, _ = _bounds(function, some, start, along, continuous, sides, kept)
        parts.append((np.flatnonzero(sets), b))
    m = parts[0][1].slopes.shape[-1]
    centre = np.zeros((count, len(signs), *j.shape[1:]))
    slopes, rest = np.zeros((*centre.shape, m)), np.zeros((count, *j.shape[1:]))
    for sets, b in parts:
        shape, branches = (len(sets), -1, *j.shape[1:]), len(b.centre) // len(sets)
        weights = walsh if branches == len(signs) else np.eye(len(signs), 1)
        size = np.abs(b.centre) + np.abs(b.slopes).sum(axis=-1)
        bound = np.where(np.isfinite(size), b.rest + 8 * EPS * size, np.inf)
        rest[sets] = bound.reshape(shape).max(axis=1)
        for out, values in ((centre, b.centre), (slopes, b.slopes)):
            own_values = np.nan_to_num(values).reshape(*shape, *values.shape[3:])
            out[sets] = np.moveaxis(np.tensordot(weights, own_values, axes=(1, 1)), 0, 1)
    rest += np.abs(slopes[:, 1:, ..., own:]).sum(axis=(1, -1))
    slopes[:, 1:, ..., own:] = 0.0
    return centre, slopes, rest * MARGIN, own


def _chosen(domain: Domain, sets: Any) -> Domain:
    """Some of the sets of a domain."""
    return Domain(domain.centre[sets], domain.generators[sets], domain.groups)


def _numbers(function: casadi.Function, kinks: Sequence[int]) -> list[int]:
    """The kink of each of their symbols: each has a number of its own and a product with another's;
    of |x| the size has one more.
    """
    names = [o.name for o in operations(function).operations]
    return [*kinks, *kinks, *(k for k in kinks if names[k] == "fabs")]


def _bounds(
    function: casadi.Function,
    domains: Sequence[Domain],
    start: casadi.Function | None,
    by: Sequence[int],
    continuous: bool,
    sides: Mapping[int, Array] | None = None,
    kept: Sequence[int] | None = None,
) -> tuple[_Symbols, _Over, AffineForm, Any, AffineForm]:
    """Symbols, the program with its kinks, values, Jacobian and roots; the bounds of the sides, 1
    or -1 in each set, of some kinks, at the points on these sides. `kept`: kinks that have symbols.
    """
    implicit = 0 if start is None else start.numel_out(0)
    program = operations(function)
    kinks = [k for k, o in enumerate(program.operations) if o.name in KINKS]
    kinks = (kinks if kept is None else list(kept)) if by or implicit else []
    numbers = _numbers(function, kinks)
    symbols = _Symbols.of(function, domains, implicit, len(numbers))
    seeds = sum(domains[i].size for i in by)
    inputs = symbols.inputs(by, implicit)
    over = _Over(
        program,
        tuple(kinks),
        tuple(numbers[2 * len(kinks) :]),
        symbols.own,
        continuous,
        seeds + implicit,
        sides or {},
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
    return symbols, over, value, slopes, roots


def _pieces(domain: Domain, count: int, sizes: Array) -> Domain:
    """The domain in each of these sizes, side by side, for each of `count` sets."""
    centre = np.broadcast_to(domain.centre, (count, domain.size))
    each = np.broadcast_to(domain.generators, (count, *domain.generators.shape[-2:]))
    generators = (sizes[:, None, None] * each[:, None]).reshape(count * len(sizes), *each.shape[1:])
    return Domain(np.repeat(centre, len(sizes), axis=0), generators, domain.groups)


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

    def absolute(self, kink: _Kink | None) -> _Dual:
        """`kink`: the number in [-1, 1] of the slope where the sign is open."""
        x = self.value.interval
        value = self.value.absolute()
        if self.slope is None or kink is None:
            return _Dual(value)
        return kink.either(x.lower >= 0, x.upper <= 0, self, -self, value)

    def signed_square(self, share: AffineForm | None) -> _Dual:
        """x|x|, whose derivative is 2|x|. `share`: the number in [-1, 1] that |x| has instead of
        its remainder, the same one for all derivatives.
        """
        size = self.value.absolute()
        value = self.value * size
        if self.slope is None:
            return _Dual(value)
        if share is not None:
            free = replace(size, rest=np.zeros(size.shape))
            size = replace(free + share.scaled(size.rest), bound=size.bound)
        return self.chain(value, size.scaled(2.0))

    def maximum(self, other: _Dual, kink: _Kink | None) -> _Dual:
        value = self.value.maximum(other.value)
        if kink is None:
            return _Dual(value)
        over = (self.value - other.value).interval
        return kink.either(over.lower >= 0, over.upper <= 0, self, other, value)


@dataclass(frozen=True)
class _Kink:
    """A number in [-1, 1], one of the symbols: where between the slopes of its two sides a kink is.

    Symbols from `first` on are those of kinks; the one at `product` is the product of this number
    with another of them, another one in each set; both join the `partners`. `side`: 1 or -1 in
    each set, where bounds are wanted of no other points than those on this side.
    """

    form: AffineForm
    first: int
    product: int
    side: Array | None
    partners: set[tuple[int, int]]

    def either(
        self, first: Array, second: Array, left: _Dual, right: _Dual, value: AffineForm
    ) -> _Dual:
        """`left` where `first` holds, `right` where `second` does, else, where no side is known,
        `value` with a mean of both slopes: its weights are given by the number, the same ones for
        all derivatives.
        """
        if self.side is not None:
            first, second = first | (~second & (self.side > 0)), second | (~first & (self.side < 0))
        value = pick(first, left.value, pick(second, right.value, value))
        some = right.slope if left.slope is None else left.slope
        if some is None:
            return _Dual(value)
        slopes = (_zero_like(some) if d.slope is None else d.slope for d in (left, right))
        one, other = slopes
        if np.all(first | second):
            return _Dual(value, pick(first[:, None], one, other))
        mean, half = (one + other).scaled(0.5), (one - other).scaled(0.5)
        both = mean + self.times(half)
        return _Dual(value, pick(first[:, None], one, pick(second[:, None], other, both)))

    def times(self, slope: AffineForm) -> AffineForm:
        """The number times derivatives (N, seeds). Where these hold another kink's number, the
        product of both is a number in [-1, 1] too, the same one for all derivatives.
        """
        number = self.form.broadcast(slope.shape)
        others = slope.slopes[..., self.first :]
        if not np.any(others):
            return number * slope
        sets = np.arange(len(others))
        largest = np.abs(others).sum(axis=1).argmax(axis=-1)
        self.partners.update((self.product, self.first + int(k)) for k in np.unique(largest))
        free, bilinear = slope.slopes.copy(), np.zeros(slope.slopes.shape)
        free[sets, :, self.first + largest] = 0.0
        bilinear[..., self.product] = others[sets, :, largest]
        rest, zero = AffineForm(slope.centre, free, slope.rest, slope.groups), 0 * slope.centre
        found = number * rest + AffineForm(zero, bilinear, zero, slope.groups)
        bound = found.interval.intersect(number.interval * slope.interval)
        return replace(found, bound=bound).settled()


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
    """A program evaluated over sets, with derivatives by `seeds` variables; positions of the
    operations that may have `kinks`, and of absolute values; the `first` symbol of kinks; the
    `sides`, 1 or -1 in each set, of some of them; the `partners`, symbols of products and of
    numbers in them, fill as it is evaluated.
    """

    program: ScalarProgram
    kinks: tuple[int, ...]
    absolutes: tuple[int, ...]
    first: int
    continuous: bool
    seeds: int
    sides: Mapping[int, Array]
    partners: set[tuple[int, int]] = field(default_factory=set)

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

    def _kink(self, position: int, like: AffineForm) -> _Kink | None:
        if self.program.operations[position].name not in KINKS:
            return None
        if position not in self.kinks:
            return _Kink(_between(like, -1.0, 1.0), like.slopes.shape[-1], 0, None, self.partners)
        i, count = self.kinks.index(position), len(self.kinks)
        side = self.sides.get(position)
        return _Kink(self._symbol(i, like), self.first, self.first + count + i, side, self.partners)

    def _size(self, position: int, like: AffineForm) -> AffineForm | None:
        """The symbol of |x| between its bounds."""
        if position not in self.absolutes:
            return None
        return self._symbol(2 * len(self.kinks) + self.absolutes.index(position), like)

    def _symbol(self, i: int, like: AffineForm) -> AffineForm:
        slopes = np.zeros(like.slopes.shape)
        slopes[:, self.first + i] = 1.0
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
                share = self._size(position, like) if self.seeds else None
                own = _dual(values[x], like)
                square = own.signed_square(share) * size
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

    def _select(self, condition: Array, yes: _Dual, no: _Dual, kink: _Kink | None) -> _Dual:
        """One of two numbers; both where the condition is open."""
        value = pick(condition == 0, no.value, hull(yes.value, no.value))
        value = pick(condition == 1, yes.value, value)
        if kink is None:
            return _Dual(value)
        found = kink.either(condition == 1, condition == 0, yes, no, value)
        if self.continuous or np.all(condition >= 0):
            return found
        # the function may jump: no bound of its slope
        return _Dual(found.value, _endless(found.derivative(self.seeds), condition < 0))


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

    # the root is that of both sides of every kink
    both = replace(over, sides={})

    def residual(guess: AffineForm, by: _Over = both) -> _Dual:
        """The residual with its derivatives, the implicit variable free."""
        free = [*inputs[:-1], [*inputs[-1], _Dual(guess, _seed(guess, own, over.seeds))]]
        return by.evaluate([position], free, list(values))[0]

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
        total = residual(value, over).derivative(over.seeds)
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
