"""Functions V = x' P(p) x that fall along every motion, and what they prove of a model.

Continuous time, dP/dt at every corner of the box of rates:

    gain             -[A'P + PA + dP/dt + C'C   PB + C'D; .   D'D - g^2 I] > 0
    stability        -(A'P + PA + dP/dt) > 0
    decay rate a     -(A'P + PA + dP/dt + 2 a P) > 0
    energy to peak   -[A'P + PA + dP/dt   PB; .   -I] > 0  and  [P   C'; .   g^2 I] > 0,  D = 0
    H2               the first  and  [diag(P, .., P)   (c_1, .., c_ny)'; .   g^2] > 0,  D = 0

sampled, P+ = P(p(k+1)): A'P+A - P for A'P + PA + dP/dt, A'P+B for PB, B'P+B - I for -I, and
P - exp(2 a dt) A'P+A > 0; the outputs then see [P 0; 0 I] by [C D]. Always P > 0.

Around a block d = Delta v (the first inputs, the last outputs) of parts of gain <= b each, lambda
(b^2 v'v - d'd) of each part is added to the form of dV/dt; lambda >= 0, constant for dynamics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product as combinations
from math import comb
from typing import Any

from . import monomials, words
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
    zero,
)
from .reading import Model, Parameter, Unreadable, array, ascending, bound_of, limit, whole

PEAKS = ("energy-to-peak gain", "h2 gain")
KINDS = ("l2 gain", "stability", "decay rate", *PEAKS)


@dataclass(frozen=True)
class Spline:
    """P(p), continuous: on every segment between the knots of each parameter a polynomial of a
    degree in it, by Bernstein coefficients; neighbours share those at their knot.
    """

    knots: tuple[tuple[Fraction, ...], ...]
    degrees: tuple[int, ...]
    values: Mapping[tuple[int, ...], Polynomial]

    @classmethod
    def read(cls, knots: Sequence[Any], degrees: Sequence[int], value: Any, size: int) -> Spline:
        """Return a spline of symmetric matrices that a file holds."""
        own, values = tuple(ascending(each, "knots") for each in knots), {}
        counts = [(len(k) - 1) * d + 1 for k, d in zip(own, degrees, strict=True)]
        nested = array(value, "P", *counts, size, size)
        for place in combinations(*map(range, counts)):
            M = nested
            for i in place:
                M = M[i]
            values[place] = even(M)
        return cls(own, tuple(degrees), values)

    def on(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        """Return the polynomial of a segment of each parameter, at the polynomials p."""
        weights: list[tuple[tuple[int, ...], Polynomial]] = [((), scalar(1))]
        for knots, d, j, q in zip(self.knots, self.degrees, segments, p, strict=True):
            u = (q - scalar(knots[j])) * (1 / (knots[j + 1] - knots[j]))
            own = list(enumerate(bernstein_functions(d, u.reduced())))
            weights = [((*k, j * d + i), f @ g) for k, f in weights for i, g in own]
        return combined([f for _, f in weights], [self.values[k] for k, _ in weights])


@dataclass(frozen=True)
class Proof:
    """A model with V, and how its parameters move; `slack`: rows of weights of forms that are zero,
    one for each Bernstein coefficient of dV/dt of a V of higher degree; `parts` of a block: numbers
    of d and v, whether it is dynamics, and lambda, with the `bound` of their gains.
    """

    kind: str
    model: Model
    motion: tuple[Parameter, ...]
    P: Spline
    coordinates: Polynomial | None = None
    order: int = 1
    slack: Sequence[Sequence[Fraction]] = ()
    bound: Fraction = Fraction(0)
    parts: Sequence[tuple[int, int, bool, Spline]] = ()

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
        if self.model.dt is None and any(map(all, zip(self.moving, jumps, strict=True))):
            return "V depends on a parameter that may jump, so that V may jump too"
        passed = any(M.reduced().terms for M in self.model.matrices["D"])
        if self.kind in PEAKS and self.model.dt is None and passed:
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
        count = len(every) * (2 if self.moving[0] else 1)
        slack = monomials.zeros(self.slack, len(self.model.states), self.order, count)
        for cell in every:
            P, after = self._P(cell.segments, cell.here), self._P(cell.following, cell.there)
            yield Demand("V > 0", P, cell)
            system = self.model.on(cell.middle, cell.here)
            drifts = [("", P * 0)] if self.model.dt else cell.drifts(P, self.moving)
            for said, drift in drifts:
                form, paid = self.falling(cell, system, P, after, drift)
                form = form - next(slack) if self.slack else form
                yield Demand(f"V falls{said}", form, cell, paid)
            if self.kind in PEAKS:
                yield Demand("V bounds the outputs", *self._seen(P, cell, *system[2:]))

    def _P(self, segments: Sequence[int], p: Sequence[Polynomial]) -> Polynomial:
        P, T = self.P.on(segments, p), self.coordinates
        return P if T is None else (T.T @ P @ T).reduced()

    def falling(
        self, cell: Cell, system: Sequence[Polynomial], *V: Polynomial
    ) -> tuple[Polynomial, Polynomial | None]:
        """Return the form that is positive definite in (x, d, u), and what is paid for the bound:
        |u|^2 of a gain; V: P, P at the next sample, dP/dt. |y|^2 is left out where V bounds the
        outputs or there is no bound.
        """
        (A, B, C, D), (P, after, drift) = system, V
        A = monomials.generator(A, self.order)
        if self.model.dt:
            moved = A.T @ after @ A
            top, side, corner = moved - P, A.T @ after @ B, B.T @ after @ B
        else:
            moved, PA = P, P @ A
            top, side, corner = PA + PA.T + drift, P @ B, zero(B.shape[1], B.shape[1])
        if self.kind == "decay rate":
            return (P if self.model.dt else -top), -moved
        d, v = sum(part[0] for part in self.parts), sum(part[1] for part in self.parts)
        if self.kind == "stability" and not d:
            return -top, None
        form, y = symmetric([[top], [side.T, corner]]), block([[C, D]])
        n, size, seen = A.shape[0], form.shape[0], C.shape[0] - v
        form = form + self._supply(cell, y.part(range(seen, seen + v)), n)
        if self.kind == "stability":
            return -form.part(range(n + d), range(n + d)), None
        energy = diagonal([int(i >= n + d) for i in range(size)])
        if self.kind in PEAKS:
            return energy - form, None
        y = y.part(range(seen))
        return -(form + y.T @ y), energy

    def _supply(self, cell: Cell, v: Polynomial, row: int) -> Polynomial:
        """Return the sum over the parts of lambda (bound^2 v'v - d'd); d begins at `row`."""
        size, first = v.shape[1], 0
        total = zero(size, size)
        for nd, nv, _, multiplier in self.parts:
            rows = v.part(range(first, first + nv))
            of_d = diagonal([int(row <= i < row + nd) for i in range(size)])
            factor = multiplier.on(cell.segments, cell.here)
            total = total + combined([factor], [rows.T @ rows * self.bound**2 - of_d])
            row, first = row + nd, first + nv
        return total

    def _seen(
        self, P: Polynomial, cell: Cell, C: Polynomial, D: Polynomial
    ) -> tuple[Polynomial, Cell, Polynomial]:
        """Return the form by which V (sampled: and the input) bounds the outputs, and what is paid
        for the bound.
        """
        ny, nu = D.shape
        if self.model.dt:
            P = symmetric([[P], [zero(nu, P.shape[0]), diagonal([1] * nu)]])
            C = block([[C, D]])
        if self.kind == "h2 gain":
            none, rows = P * 0, [C.part([i]) for i in range(ny)]
            P = symmetric([[none] * i + [P] for i in range(ny)])
            C, ny = block([rows]), 1
        paid = diagonal([0] * P.shape[0] + [1] * ny)
        return symmetric([[P], [C, zero(ny, ny)]]), cell, paid


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate of these kinds claims, by the routes "one parameter" and "box"."""
    proof, bound = content["proof"], bound_of(kind, content)
    model = Model.read(proof["source" if proof["route"] == "box" else "lpv"])
    motion, V = _motion(model, content["rates"], proof), proof["lyapunov"]
    if V["type"] == "BoxLyapunov":
        degrees = [whole(d, "a degree", 0) for d in V["degrees"]]
        P = Spline.read(V["knots"], degrees, V["coefficients"], len(model.states))
        own = Proof(kind, model, motion, P)
    elif V["type"] == "SplineLyapunov":
        own = _of_one_parameter(kind, model, motion, proof)
    else:
        raise Unreadable("V is of a form that is not known")
    said = words.model(*model.sizes, motion)
    for d, v, dynamic, _ in own.parts:
        how = "dynamics at rest at the start" if dynamic else "constant or moving in any way"
        size = float(own.bound)
        said.append(
            f"{d} of the inputs = Delta times {v} of the outputs, |Delta| <= {size!r}, {how}"
        )
    lower, claim = kind == "decay rate", words.gain(kind, bound)
    return Claim(claim, said, own.demands(), bound, own.level, lower, own.refused)


def _motion(model: Model, rates: Sequence[Any], proof: Any) -> tuple[Parameter, ...]:
    """Return the parameters with the rates of the claim, which must be those of the proof."""
    box, ties = [[float(a), float(b)] for a, b in model.ranges], [p.tie for p in model.parameters]
    several = {"type": "Motion", "box": box, "rates": rates, "ties": ties}
    if proof["demand"]["motion"] != several if "demand" in proof else rates != [proof["rate"]]:
        raise Unreadable("the parameters of the claim do not move as those of the proof")
    return tuple(
        p._replace(rate=limit(rate, "a rate") if p.tie is None else None)
        for p, rate in zip(model.parameters, rates, strict=True)
    )


def _of_one_parameter(kind: str, model: Model, motion: tuple[Parameter, ...], proof: Any) -> Proof:
    """Return the proof by P(p) of one parameter."""
    V, n = proof["lyapunov"], len(model.states)
    order, degree = whole(V["order"], "the order", 1), whole(V["degree"], "a degree", 0)
    P = Spline.read([V["knots"]], [degree], V["coefficients"], comb(n + order - 1, order))
    T, slack = V["coordinates"], V["slack"]
    coordinates = None if T is None else matrix(array(T, "coordinates", n, n), n)
    rows = [] if slack is None or order == 1 else array(slack, "slack", None, None)
    own = Proof(kind, model, motion, P, coordinates, order, rows, *_block(proof, V, model))
    if kind not in ("l2 gain", "stability"):
        raise Unreadable("V of one parameter is known for gains and stability only")
    if order > 1 and (model.dt or model.inputs or T is not None or own.parts):
        raise Unreadable("a V of higher degree is known for stability in continuous time only")
    return own


def _block(
    proof: Any, V: Any, model: Model
) -> tuple[Fraction, Sequence[tuple[int, int, bool, Spline]]]:
    """Return the norm-bounded block of a proof with its multipliers."""
    value, multiplier, knots = proof["block"], V["multiplier"], ascending(V["knots"], "knots")
    if value is None or multiplier is None:
        if value is not multiplier:
            raise Unreadable("the file is damaged: a block without multiplier, or the reverse")
        return Fraction(0), ()
    size = [
        whole(value[name], f"{name} of a block", 1, len(among))
        for name, among in (("inputs", model.inputs), ("outputs", model.outputs))
    ]
    parts, bound = value["parts"] or [[*size, False]], limit(value["bound"], "the bound of a block")
    each = [(whole(d, "a part", 1), whole(v, "a part", 1), kind is True) for d, v, kind in parts]
    several = len(multiplier["shape"]) == 2
    values = array(multiplier, "a multiplier", None, *([len(parts)] if several else []))
    columns = list(zip(*values, strict=True)) if several else [values]
    degree, rest = divmod(len(values) - 1, len(knots) - 1)
    if bound is None or size != [sum(part[i] for part in each) for i in (0, 1)]:
        raise Unreadable("the file is damaged: the parts do not make the block")
    if rest or len(columns) != len(each) or any(v < 0 for own in columns for v in own):
        raise Unreadable("the file is damaged: a multiplier is below zero or fits no knots")
    if any(part[2] and len(set(own)) > 1 for part, own in zip(each, columns, strict=True)):
        raise Unreadable("the multiplier of dynamics depends on p")
    splines = [
        Spline((knots,), (degree,), {(i,): scalar(v) for i, v in enumerate(own)}) for own in columns
    ]
    return bound, [(*part, own) for part, own in zip(each, splines, strict=True)]
