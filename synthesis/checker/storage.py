"""Functions V = x' P(p) x that fall along every motion, and what they prove of a model.

Continuous time, dP/dt at every corner of the box of rates:

    gain             -[A'P + PA + dP/dt + C'C   PB + C'D; .   D'D - g^2 I] > 0
    stability        -(A'P + PA + dP/dt) > 0
    decay rate a     -(A'P + PA + dP/dt + 2 a P) > 0
    energy to peak   -[A'P + PA + dP/dt   PB; .   -I] > 0  and  [P   C'; .   g^2 I] > 0,  D = 0
    H2               the first  and  [diag(P, .., P)   (c_1, .., c_ny)'; .   g^2] > 0,  D = 0

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

from . import words
from .cells import Cell, cells
from .demands import Claim, Demand, exponential
from .polynomials import (
    Polynomial,
    bernstein_functions,
    block,
    combined,
    diagonal,
    even,
    matrix,
    scalar,
    symmetric,
    variable,
    zero,
)
from .reading import (
    Model,
    Parameter,
    Unreadable,
    array,
    ascending,
    bound_of,
    field,
    items,
    kind_of,
    limit,
    number,
    whole,
)

KINDS = ("l2 gain", "stability", "decay rate", "energy-to-peak gain", "h2 gain")


@dataclass(frozen=True)
class Spline:
    """P(p), continuous: on every segment between the knots of each parameter a polynomial of a
    degree in it, by Bernstein coefficients; neighbours share those at their knot.
    """

    knots: tuple[tuple[Fraction, ...], ...]
    degrees: tuple[int, ...]
    values: Mapping[tuple[int, ...], Polynomial]
    size: int

    def on(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        """Return the polynomial of a segment of each parameter, at the polynomials p."""
        each = []
        for knots, d, j, q in zip(self.knots, self.degrees, segments, p, strict=True):
            left, right = knots[j], knots[j + 1]
            u = (q - scalar(left)) * (1 / (right - left))
            each.append(bernstein_functions(d, u.reduced()))
        functions, matrices = [], []
        for k in combinations(*(range(d + 1) for d in self.degrees)):
            weight = each[0][k[0]]
            for own, i in zip(each[1:], k[1:], strict=True):
                weight = weight @ own[i]
            place = tuple(j * d + i for j, d, i in zip(segments, self.degrees, k, strict=True))
            functions.append(weight)
            matrices.append(self.values[place])
        return combined(functions, matrices)


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
    coordinates: Polynomial | None = None
    order: int = 1
    slack: Sequence[Sequence[Fraction]] = ()
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
        covered = zip(self.P.knots, self.motion, strict=True)
        if any(k[0] != p.low or k[-1] != p.high for k, p in covered):
            return "V is not known on the whole range of p"
        jumps = (p.tie is None and p.rate is None for p in self.motion)
        if not self.sampled and any(map(all, zip(self.moving, jumps, strict=True))):
            return "V depends on a parameter that may jump, so that V may jump too"
        passed = any(M.reduced().terms for M in self.model.matrices["D"])
        if self.of_peaks and not self.sampled and passed:
            return "inputs reach the outputs directly, so that their peaks have no bound"
        return ""

    def level(self, bound: Fraction) -> Fraction:
        """Return what stands in the inequalities for a bound."""
        if self.kind != "decay rate":
            return bound * bound
        dt = self.model.dt
        return 2 * bound if dt is None else exponential(2 * bound * dt)[1]

    def demands(self) -> Iterator[Demand]:
        """Yield everything that must be positive definite."""
        every = list(cells(self.model, self.motion, self.P.knots, self.moving))
        slack = self._slack(every)
        for cell in every:
            P, after = self._P(cell.segments, cell.here), self._P(cell.following, cell.there)
            yield Demand("V > 0", P, cell)
            system = self.model.on(cell.middle, cell.here)
            drifts = [("", P * 0)] if self.sampled else cell.drifts(P, self.moving)
            for said, drift in drifts:
                falling = self._falling(cell, system, P, after, drift)
                form, paid = falling if not self.slack else (falling[0] - next(slack), None)
                yield Demand(f"V falls{said}", form, cell, paid)
            if self.of_peaks:
                form, paid = self._seen(P, system[2], system[3])
                yield Demand("V bounds the outputs", form, cell, paid)

    def _P(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        P = self.P.on(segments, p)
        if self.coordinates is None:
            return P
        return (self.coordinates.T @ P @ self.coordinates).reduced()

    def _falling(
        self,
        cell: Cell,
        system: Sequence[Polynomial],
        P: Polynomial,
        after: Polynomial,
        drift: Polynomial,
    ) -> tuple[Polynomial, Polynomial | None]:
        """Return the form that is positive definite in (x, d, u), and what is paid for the bound:
        |u|^2 of a gain. |y|^2 is left out where V bounds the outputs or there is no bound.
        """
        A, B, C, D = system
        A = of_monomials(A, self.order) if self.order > 1 else A
        if self.sampled:
            moved = A.T @ after @ A
            top, side, corner = moved - P, A.T @ after @ B, B.T @ after @ B
        else:
            moved, PA = P, P @ A
            top, side, corner = PA + PA.T + drift, P @ B, B.T @ B * 0
        if self.kind == "decay rate":
            return (P if self.sampled else -top), -moved
        d, seen = (self.block.inputs, C.shape[0] - self.block.outputs) if self.block else (0, 0)
        if self.kind == "stability" and not d:
            return -top, None
        form = symmetric([[top], [side.T, corner]])
        size, n = form.shape[0], A.shape[0]
        y = block([[C, D]])
        if self.block:
            form = form + self._supply(self.block, cell, y.part(range(seen, C.shape[0])), n)
            y = y.part(range(seen))
        energy = diagonal(range(n + d, size), size)
        if self.of_peaks:
            return energy - form, None
        if self.kind == "stability":
            return (-form).part(range(n + d), range(n + d)), None
        return -(form + y.T @ y), energy

    def _supply(self, own: Block, cell: Cell, v: Polynomial, row: int) -> Polynomial:
        """Return the sum over the parts of lambda (bound^2 v'v - d'd); d begins at `row`."""
        size, first = v.shape[1], 0
        total = zero(size, size)
        for (nd, nv, _), multiplier in zip(own.parts, own.multipliers, strict=True):
            rows = v.part(range(first, first + nv))
            of_d = diagonal(range(row, row + nd), size)
            form = rows.T @ rows * own.bound**2 - of_d
            factor = multiplier.on(cell.segments, cell.here)
            total = total + combined([factor], [form])
            row, first = row + nd, first + nv
        return total

    def _seen(self, P: Polynomial, C: Polynomial, D: Polynomial) -> tuple[Polynomial, Polynomial]:
        """Return the form by which V (sampled: and the input) bounds the outputs, and what is paid
        for the bound.
        """
        (ny, nu), n = D.shape, P.shape[0]
        if self.sampled:
            eye = diagonal(range(nu), nu)
            P = symmetric([[P], [zero(nu, n), eye]])
            C, n = block([[C, D]]), n + nu
        if self.kind == "h2 gain":
            none, rows = zero(n, n), [C.part([i]) for i in range(ny)]
            P = symmetric([[none] * i + [P] for i in range(ny)])
            C, n, ny = block([rows]), n * ny, 1
        size = n + ny
        paid = diagonal(range(n, size), size)
        return symmetric([[P], [C, zero(ny, ny)]]), paid

    def _slack(self, every: Sequence[Cell]) -> Iterator[Polynomial]:
        """Yield L(p) with z' L z = 0 of each inequality in the order of the cells."""
        if not self.slack:
            return
        each, rest = divmod(len(self.slack), len(every) * (2 if self.moving[0] else 1))
        if rest or not each:
            raise Unreadable("the file is damaged: rows of slack that fit no degree")
        functions = bernstein_functions(each - 1, variable(0))
        forms = null_forms(self.slack, len(self.model.states), self.order)
        for k in range(0, len(forms), each):
            yield combined(functions, forms[k : k + each])


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
    return Polynomial((len(z), len(z)), terms, A.below)


def null_forms(weights: Sequence[Sequence[Fraction]], n: int, order: int) -> list[Polynomial]:
    """Return symmetric L with z' L z = 0 of rows of weights: each weight stands at a pair of
    monomials, and is taken away at the first pair with the same product.
    """
    z, first, pairs = monomials(n, order), {}, []
    for b in range(len(z)):
        for a in range(b + 1):
            same = first.setdefault(tuple(sorted(z[a] + z[b])), (a, b))
            if same != (a, b):
                pairs.append(((a, b), same))
    found = []
    for row in weights:
        L = [[Fraction(0)] * len(z) for _ in z]
        for weight, entries in zip(row, pairs, strict=True):
            for sign, (a, b) in zip((1, -1), entries, strict=True):
                L[a][b] += sign * weight
                L[b][a] += sign * weight
        found.append(matrix(L, len(z)))
    return found


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
    coordinates = None if T is None else matrix(array(T, "coordinates", n, n), n)
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
        values = {(i,): scalar(v) for i, v in enumerate(column)}
        multipliers.append(Spline((ascending(knots, "knots"),), (degree,), values, 1))
    return own._replace(multipliers=tuple(multipliers))


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate of these kinds claims."""
    bound, proof = bound_of(kind, content), read(kind, content)
    said = words.model(proof.model, proof.motion)
    for d, v, dynamic in proof.block.parts if proof.block else ():
        how = "dynamics at rest at the start" if dynamic else "constant or moving in any way"
        size = float(proof.block.bound) if proof.block else 0.0
        said.append(
            f"the next {d} inputs, from the first, are Delta times {v} outputs ....{size}{how}"
        )
    return Claim(
        words.gain(kind, bound),
        said,
        proof.demands(),
        bound,
        proof.level,
        kind == "decay rate",
        proof.refused,
    )
