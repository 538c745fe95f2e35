"""Functions V = x' P(p) x that fall along every motion, and what they prove of a model.

Continuous time, dP/dt at every corner of the box of rates:

    gain             -[A'P + PA + dP/dt + C'C   PB + C'D; .   D'D - g^2 I] > 0
    stability        -(A'P + PA + dP/dt) > 0
    decay rate a     -(A'P + PA + dP/dt + 2 a P) > 0
    energy to peak   -[A'P + PA + dP/dt   PB; .   -I] > 0  and  [P   C'; .   g^2 I] > 0,  D = 0
    H2               the first of these  and  [diag(P, .., P)   (c_1, .., c_ny)'; .   g^2] > 0,  D = 0

sampled, P+ = P(p(k+1)): A'P+A - P for A'P + PA + dP/dt, A'P+B for PB, B'P+B - I for -I, and
P - exp(2 a dt) A'P+A > 0; the outputs then see [P 0; 0 I] by [C D]. Always P > 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from itertools import product as combinations
from math import comb
from typing import Any, NamedTuple

from .cells import Cell, cells
from .demands import Claim, Demand, exponential_above
from .polynomials import (
    Polynomial,
    Whole,
    bernstein_functions,
    block,
    combined,
    symmetric,
)
from .reading import (
    Model,
    Parameter,
    Unreadable,
    array,
    ascending,
    even,
    field,
    items,
    kind_of,
    limit,
    number,
    whole,
)

KINDS = ("l2 gain", "stability", "decay rate", "energy-to-peak gain", "h2 gain")
SIGNS = (-1, 1)


@dataclass(frozen=True)
class Spline:
    """P(p), continuous: on every segment between the knots of each parameter a polynomial of a
    degree in it, by Bernstein coefficients; neighbours share those at their knot.
    """

    knots: tuple[tuple[Fraction, ...], ...]
    degrees: tuple[int, ...]
    values: Mapping[tuple[int, ...], Whole]
    size: int

    def on(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        """Return the polynomial of a segment of each parameter, at the polynomials p."""
        each = []
        for knots, d, j, q in zip(self.knots, self.degrees, segments, p, strict=True):
            left, right = knots[j], knots[j + 1]
            u = (q - Polynomial.number(left, q.variables)) * (1 / (right - left))
            each.append(bernstein_functions(d, u.reduced()))
        functions, matrices = [], []
        for k in combinations(*(range(d + 1) for d in self.degrees)):
            weight = each[0][k[0]]
            for own, i in zip(each[1:], k[1:], strict=True):
                weight = weight @ own[i]
            place = tuple(j * d + i for j, d, i in zip(segments, self.degrees, k, strict=True))
            functions.append(weight)
            matrices.append(Polynomial.constant(self.values[place], self.size, p[0].variables))
        return combined(functions, matrices)

    def covers(self, parameters: Sequence[Parameter]) -> bool:
        """Whether P is known for all p."""
        return len(self.knots) == len(parameters) and all(
            k[0] == p.low and k[-1] == p.high for k, p in zip(self.knots, parameters, strict=True)
        )


def spline(knots: Sequence[Any], degrees: Sequence[int], value: Any, size: int) -> Spline:
    """Return a spline of symmetric matrices that a file holds."""
    own = tuple(ascending(each, "knots") for each in knots)
    counts = [(len(k) - 1) * d + 1 for k, d in zip(own, degrees, strict=True)]
    nested = array(value, "P", *counts, size, size)
    values = {}
    for place in combinations(*map(range, counts)):
        M = nested
        for i in place:
            M = M[i]
        values[place] = even(M)
    return Spline(own, tuple(degrees), values, size)


class Block(NamedTuple):
    """d = Delta v, the first inputs and the last outputs of a model; Delta = diag of parts (d, v,
    whether it is dynamics) of gain at most `bound`, with lambda >= 0 of each: then lambda (bound^2
    v'v - d'd) is not negative, for dynamics over time from rest, where lambda is constant.
    """

    parts: tuple[tuple[int, int, bool], ...]
    bound: Fraction
    multipliers: tuple[Spline, ...]

    @property
    def inputs(self) -> int:
        """Number of d."""
        return sum(d for d, _, _ in self.parts)

    @property
    def outputs(self) -> int:
        """Number of v."""
        return sum(v for _, v, _ in self.parts)


@dataclass(frozen=True)
class Proof:
    """A model with V, and how its parameters move; `slack`: rows of weights of forms that are zero,
    one for each Bernstein coefficient of dV/dt of a V of higher degree.
    """

    kind: str
    model: Model
    motion: tuple[Parameter, ...]
    P: Spline
    coordinates: Whole | None = None
    order: int = 1
    slack: tuple[tuple[Fraction, ...], ...] = ()
    block: Block | None = None

    @property
    def sampled(self) -> bool:
        """Whether time is discrete."""
        return self.model.dt is not None

    @property
    def of_peaks(self) -> bool:
        """Whether V grows by no more than the energy of the inputs, and bounds the outputs."""
        return self.kind in ("energy-to-peak gain", "h2 gain")

    @property
    def moving(self) -> list[bool]:
        """Whether P changes as each parameter moves."""
        return [bool(d) and p.rate != 0 for d, p in zip(self.P.degrees, self.motion, strict=True)]

    @property
    def refused(self) -> str:
        """Say why V proves nothing, before any inequality is looked at."""
        if not self.P.covers(self.motion):
            return "V is not known on the whole range of p"
        jumps = (p.tie is None and p.rate is None for p in self.motion)
        if not self.sampled and any(map(all, zip(self.moving, jumps, strict=True))):
            return "V depends on a parameter that may jump, so that V may jump too"
        passed = any(any(map(any, M.rows)) for M in self.model.matrices["D"])
        if self.of_peaks and not self.sampled and passed:
            return "inputs reach the outputs directly, so that their peaks have no bound"
        return ""

    def demands(self, bound: Fraction | None) -> Iterator[Demand]:
        """Yield everything that must be positive definite."""
        every = list(cells(self.model, self.motion, self.P.knots, self.moving))
        slack = self._slack(every)
        for cell in every:
            P, after = self._P(cell.segments, cell.here), self._P(cell.following, cell.there)
            yield Demand("V > 0", P, cell.place, cell.reaches)
            yield from self._falling(cell, P, after, bound, slack)
            if self.of_peaks:
                yield _of_bound("the outputs seen by V", cell, bound, self._seen(cell, P))

    def _P(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        P = self.P.on(segments, p)
        if self.coordinates is None:
            return P
        T = Polynomial.constant(self.coordinates, self.P.size, P.variables)
        return (T.T @ P @ T).reduced()

    def _falling(
        self,
        cell: Cell,
        P: Polynomial,
        after: Polynomial,
        bound: Fraction | None,
        slack: Iterator[list[Whole]],
    ) -> Iterator[Demand]:
        A, B, C, D = self.model.on(cell.middle, cell.here)
        if self.order > 1:
            A = of_monomials(A, self.order)
        for rates, drift in self._drifts(cell, P):
            name = f"V falls{rates}"
            if self.kind == "decay rate":
                yield _of_bound(name, cell, bound, self._decaying(A, P, after, drift))
            elif self.kind == "stability" and self.block is None:
                left = -self._change(A, P, after, drift)
                for own in [next(slack)] if self.slack else []:
                    functions = bernstein_functions(len(own) - 1, Polynomial.variable(0, 1))
                    forms = [Polynomial.constant(M, P.shape[0], 1) for M in own]
                    left = left - combined(functions, forms)
                yield Demand(name, left, cell.place, cell.reaches)
            else:
                whole_form, paid = self._dissipation(cell, (A, B, C, D), P, after, drift)
                factor = Fraction(1) if self.of_peaks else None

                def supplied(
                    g: Fraction | None,
                    form: Polynomial = whole_form,
                    paid: Polynomial = paid,
                    factor: Fraction | None = factor,
                ) -> Polynomial:
                    return paid * (factor or (g or Fraction(0)) ** 2) - form

                yield _of_bound(name, cell, bound, supplied)

    def _drifts(self, cell: Cell, P: Polynomial) -> list[tuple[str, Polynomial]]:
        """Return (at which rates, dP/dt) at every corner of the box of rates."""
        found = [("", P * 0)]
        for i, (p, moves) in enumerate(zip(self.motion, self.moving, strict=True)):
            if self.sampled or not moves:
                continue
            slope = cell.slope(P, i)
            if p.tie is not None:
                found = [(said, F + slope.times(cell.here[p.tie])) for said, F in found]
                continue
            assert p.rate is not None  # noqa: S101 - see `refused`
            found = [
                (f"{said} with dp{i + 1}/dt = {float(sign * p.rate):.6g}", F + slope * sign * p.rate)
                for said, F in found
                for sign in SIGNS
            ]
        return found

    def _change(
        self, A: Polynomial, P: Polynomial, after: Polynomial, drift: Polynomial, by: Any = 1
    ) -> Polynomial:
        """Return the form of dV/dt; sampled of `by` V(k+1) - V(k)."""
        if self.sampled:
            return A.T @ after @ A * by - P
        PA = P @ A
        return PA + PA.T + drift

    def _decaying(
        self, A: Polynomial, P: Polynomial, after: Polynomial, drift: Polynomial
    ) -> Any:
        dt = self.model.dt
        if dt is None:
            return lambda a: -(self._change(A, P, after, drift) + P * (2 * a))
        return lambda a: -self._change(A, P, after, drift, exponential_above(2 * a * dt))

    def _dissipation(
        self,
        cell: Cell,
        system: Sequence[Polynomial],
        P: Polynomial,
        after: Polynomial,
        drift: Polynomial,
    ) -> tuple[Polynomial, Polynomial]:
        """Return the form of dV/dt + |y|^2 in (x, d, u), with the supply of the block, and |u|^2;
        |y|^2 left out where V bounds the outputs or nothing but stability is claimed.
        """
        A, B, C, D = system
        of_d = self.block.inputs if self.block else 0
        if self.kind == "stability":
            B, D = B.columns(range(of_d)), D.columns(range(of_d))
        (n, nu), seen = B.shape, C.shape[0] - (self.block.outputs if self.block else 0)
        top = self._change(A, P, after, drift)
        if self.sampled:
            side, corner = A.T @ after @ B, B.T @ after @ B
        else:
            side, corner = P @ B, Polynomial.zero(nu, nu, P.variables)
        form = symmetric([[top], [side.T, corner]])
        if self.kind == "l2 gain":
            y = block([[C.rows(range(seen)), D.rows(range(seen))]])
            form = form + y.T @ y
        if self.block:
            v = block([[C, D]]).rows(range(seen, C.shape[0]))
            form = form + self._supply(self.block, cell, v, n)
        paid = diagonal(range(n + of_d, n + nu), n + nu)
        return form, Polynomial.constant(paid, n + nu, P.variables)

    def _supply(self, own: Block, cell: Cell, v: Polynomial, row: int) -> Polynomial:
        """Return the sum over the parts of lambda (bound^2 v'v - d'd); d begins at `row`."""
        size, first = v.shape[1], 0
        total = Polynomial.zero(size, size, v.variables)
        for (nd, nv, _), multiplier in zip(own.parts, own.multipliers, strict=True):
            rows = v.rows(range(first, first + nv))
            of_d = Polynomial.constant(diagonal(range(row, row + nd), size), size, v.variables)
            form = rows.T @ rows * own.bound**2 - of_d
            total = total + form.times(multiplier.on(cell.segments, cell.here))
            row, first = row + nd, first + nv
        return total

    def _seen(self, cell: Cell, P: Polynomial) -> Any:
        """Return, of a bound, the matrix by which V (sampled: and the input) bounds the outputs."""
        _, _, C, D = self.model.on(cell.middle, cell.here)
        ny, nu = D.shape
        if self.sampled:
            eye = Polynomial.identity(nu, P.variables)
            P = symmetric([[P], [Polynomial.zero(nu, P.shape[0], P.variables), eye]])
            C = block([[C, D]])
        n = P.shape[0]
        if self.kind == "energy-to-peak gain":
            eye = Polynomial.identity(ny, P.variables)
            return lambda g: symmetric([[P], [C, eye * g**2]])
        none, rows = Polynomial.zero(n, n, P.variables), [C.rows([i]) for i in range(ny)]
        one = Polynomial.number(1, P.variables)
        copies = [[none] * i + [P] for i in range(ny)]
        return lambda g: symmetric([*copies, [*rows, one * g**2]])

    def _slack(self, every: Sequence[Cell]) -> Iterator[list[Whole]]:
        """Yield the weights of each inequality in the order of the cells, as matrices."""
        if not self.slack:
            return
        moves = self.moving[0]
        each, rest = divmod(len(self.slack), len(every) * (2 if moves else 1))
        if rest or not each:
            raise Unreadable("the file is damaged: rows of slack that fit no degree")
        zero = null_forms(len(self.model.states), self.order)
        for k in range(0, len(self.slack), each):
            yield [zero(row) for row in self.slack[k : k + each]]


def _of_bound(name: str, cell: Cell, bound: Fraction | None, made: Any) -> Demand:
    """Return a demand that rests on a bound."""
    return Demand(name, made(bound), cell.place, cell.reaches, made)


def diagonal(ones: Sequence[int], size: int) -> Whole:
    """Return the diagonal matrix with these ones."""
    return Whole([[int(i == j and i in ones) for j in range(size)] for i in range(size)], 1)


def monomials(n: int, order: int) -> list[tuple[int, ...]]:
    """Return the monomials of a degree in n states: the numbers of their factors, ascending."""
    return list(combinations_with_replacement(range(n), order))


def of_monomials(A: Polynomial, order: int) -> Polynomial:
    """Return G of dz/dt = G z, z the monomials, where dx/dt = A x."""
    n = A.shape[0]
    z = monomials(n, order)
    place = {factors: i for i, factors in enumerate(z)}
    terms = {}
    for k, rows in A.terms.items():
        own = [[0] * len(z) for _ in z]
        for i, factors in enumerate(z):
            for at, factor in enumerate(factors):
                for j in range(n):
                    other = (*factors[:at], j, *factors[at + 1 :])
                    own[i][place[tuple(sorted(other))]] += rows[factor][j]
        terms[k] = own
    return Polynomial((len(z), len(z)), A.variables, terms, A.below)


def null_forms(n: int, order: int) -> Any:
    """Return the function from weights to a symmetric L with z' L z = 0: each weight stands at a
    pair of monomials, and is taken away at the first pair with the same product.
    """
    z = monomials(n, order)
    first: dict[tuple[int, ...], tuple[int, int]] = {}
    pairs = []
    for b in range(len(z)):
        for a in range(b + 1):
            same = first.setdefault(tuple(sorted(z[a] + z[b])), (a, b))
            if same != (a, b):
                pairs.append(((a, b), same))

    def made(weights: Sequence[Fraction]) -> Whole:
        if len(weights) != len(pairs):
            raise Unreadable("the file is damaged: another number of weights of slack")
        rows = [[Fraction(0)] * len(z) for _ in z]
        for weight, entries in zip(weights, pairs, strict=True):
            for sign, (a, b) in zip((1, -1), entries, strict=True):
                rows[a][b] += sign * weight
                rows[b][a] += sign * weight
        return Whole.of(rows)

    return made


def read(kind: str, content: Any) -> Proof:
    """Return the proof that a certificate of one or several parameters holds, by the routes "one
    parameter" and "box".
    """
    proof, claimed = field(content, "proof"), items(field(content, "rates"), "rates")
    several = field(proof, "route") == "box"
    model = Model.read(field(proof, "source" if several else "lpv"))
    motion = _motion(model, claimed, proof, several)
    V, n = field(proof, "lyapunov"), len(model.states)
    if several:
        knots, degrees = (items(field(V, name), name) for name in ("knots", "degrees"))
        own = [whole(d, "a degree", 0) for d in degrees]
        if kind_of(V) != "BoxLyapunov" or not len(knots) == len(own) == len(motion):
            raise Unreadable("the file is damaged: V is of another number of parameters")
        return Proof(kind, model, motion, spline(knots, own, field(V, "coefficients"), n))
    if kind_of(V) != "SplineLyapunov":
        raise Unreadable("the file is damaged: V is of a kind that is not known")
    order, degree = (
        whole(field(V, name), name, least) for name, least in (("order", 1), ("degree", 0))
    )
    size = comb(n + order - 1, order) if n else 0
    P = spline([field(V, "knots")], [degree], field(V, "coefficients"), size)
    T, slack = field(V, "coordinates"), field(V, "slack")
    coordinates = None if T is None else Whole.of(array(T, "coordinates", n, n))
    rows = () if slack is None else tuple(map(tuple, array(slack, "slack", None, None)))
    if order > 1 and (model.dt is not None or kind != "stability" or model.inputs or T is not None):
        raise Unreadable("a V of higher degree is known for stability in continuous time only")
    own_block = _block(field(proof, "block"), field(V, "multiplier"), model, field(V, "knots"))
    if own_block and (order > 1 or kind not in ("l2 gain", "stability")):
        raise Unreadable("a norm-bounded block is known for gains and stability only")
    return Proof(kind, model, motion, P, coordinates, order, rows if order > 1 else (), own_block)


def _motion(
    model: Model, claimed: Sequence[Any], proof: Any, several: bool
) -> tuple[Parameter, ...]:
    """Return the parameters with the rates of the claim, which must be those of the proof."""
    motion = field(field(proof, "demand"), "motion") if several else None
    given = [field(proof, "rate")] if motion is None else items(field(motion, "rates"), "rates")
    if len(model.parameters) != len(claimed) or given != claimed:
        raise Unreadable("the rates of the claim are not those of the proof")
    out = []
    for own, rate in zip(model.parameters, claimed, strict=True):
        # of a parameter whose rate is another one, the limit is what that one may be
        out.append(own._replace(rate=limit(rate, "a rate") if own.tie is None else None))
    if motion is not None:
        ties = items(field(motion, "ties"), "ties")
        box = items(field(motion, "box"), "box")
        if ties != [p.tie for p in out] or box != [[float(p.low), float(p.high)] for p in out]:
            raise Unreadable("the parameters of the claim do not move as those of the proof")
    return tuple(out)


def _block(value: Any, multiplier: Any, model: Model, knots: Any) -> Block | None:
    """Return the norm-bounded block of a proof with its multipliers."""
    if value is None:
        if multiplier is not None:
            raise Unreadable("the file is damaged: a multiplier without a block")
        return None
    inputs, outputs = (whole(field(value, name), name, 1, 10**6) for name in ("inputs", "outputs"))
    parts = tuple(
        (whole(d, "a part", 1, 10**6), whole(v, "a part", 1, 10**6), dynamic is True)
        for d, v, dynamic in (
            items(part, "a part") for part in items(field(value, "parts"), "parts")
        )
    ) or ((inputs, outputs, False),)
    bound = number(field(value, "bound"), "the bound of the block")
    own = Block(parts, bound, ())
    if (own.inputs, own.outputs) != (inputs, outputs) or bound < 0:
        raise Unreadable("the file is damaged: the parts do not make the block")
    if inputs > len(model.inputs) or outputs > len(model.outputs):
        raise Unreadable("the file is damaged: the block does not fit the model")
    several = len(items(field(multiplier, "shape"), "the shape of the multiplier")) == 2
    values = array(multiplier, "the multiplier", None, *([len(parts)] if several else []))
    rows = values if several else [[v] for v in values]
    segments = len(ascending(knots, "knots")) - 1
    degree, rest = divmod(len(rows) - 1, segments)
    if rest or not rows or len(rows[0]) != len(parts):
        raise Unreadable("the file is damaged: the multiplier does not fit its knots")
    if any(v < 0 for row in rows for v in row):
        raise Unreadable("the file is damaged: a multiplier is below zero")
    multipliers = []
    for k, (_, _, dynamic) in enumerate(parts):
        column = [row[k] for row in rows]
        if dynamic and len(set(column)) > 1:
            raise Unreadable("the multiplier of dynamics depends on p")
        values = {(i,): Whole.of([[v]]) for i, v in enumerate(column)}
        multipliers.append(Spline((ascending(knots, "knots"),), (degree,), values, 1))
    return own._replace(multipliers=tuple(multipliers))


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate of these kinds claims."""
    bound = None
    if kind != "stability":
        bound = number(field(content, "alpha" if kind == "decay rate" else "gamma"), "the bound")
        if bound < 0:
            raise Unreadable("the file is damaged: the bound is below zero")
    proof = read(kind, content)
    return Claim(
        sentence(kind, bound, proof.order),
        hypotheses(proof.model, proof.motion, proof.block),
        proof.demands(bound),
        bound,
        kind != "decay rate",
        proof.refused,
    )


def sentence(kind: str, bound: Fraction | None, order: int = 1) -> str:
    """Return the claim in words."""
    size = "" if bound is None else repr(float(bound))
    return {
        "l2 gain": f"the energy gain is below {size}: |y|_2 < {size} |u|_2 from rest",
        "stability": "the state tends to zero exponentially from every start without inputs",
        "decay rate": f"|x(t)| <= c exp(-a t) |x(0)| for some c, without inputs, a = {size} 1/s",
        "energy-to-peak gain": f"from rest |y(t)| < {size} |u|_2 at every t",
        "h2 gain": f"from rest, in white noise of unit intensity, E |y(t)|^2 < {size}^2 at every t",
    }[kind] + (f" (by a V of degree {2 * order} in x)" if order > 1 else "")


def hypotheses(
    model: Model, motion: Sequence[Parameter], own: Block | None = None
) -> tuple[str, ...]:
    """Return in words of which model a claim is, and how its parameters move."""
    d, v = (own.inputs, own.outputs) if own else (0, 0)
    sizes = f"{len(model.states)} states x, {len(model.inputs) - d} inputs u,"
    time = "continuous time" if model.dt is None else f"samples of {float(model.dt)!r} s"
    said = [f"a model of {sizes} {len(model.outputs) - v} outputs y, in {time}"]
    for i, p in enumerate(motion):
        how = (
            f"dp{i + 1}/dt = p{p.tie + 1}"
            if p.tie is not None
            else "arbitrarily fast"
            if p.rate is None
            else f"|dp{i + 1}/dt| <= {float(p.rate)!r} per second"
        )
        said.append(f"p{i + 1} stays in [{float(p.low)!r}, {float(p.high)!r}], {how}")
    for nd, nv, dynamic in own.parts if own else ():
        how = "dynamics at rest at the start" if dynamic else "constant or moving in any way"
        said.append(f"a Delta ({nd} x {nv}) of gain <= {float(own.bound)!r}, {how}, d = Delta v")
    return tuple(said)
