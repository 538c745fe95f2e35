"""Sets of states that no motion leaves, within limits, with u = K(p) x.

x' Q(p)^-1 x <= 1, disturbances |w_i| <= 1 (W has their amplitudes), Y = K Q, at every corner of
dQ/dt:

    [dQ/dt - alpha Q - (AQ + BY) - (AQ + BY)'   -W; .   diag(tau)] > 0,  tau >= 0,  sum tau <= alpha

sampled, Q constant in time:

    [(1 - alpha) Q   0   (AQ + BY)'; .   diag(tau)   W'; .   .   Q] > 0

so that V = x' Q^-1 x falls where V > 1. A limit |c x + d u| <= b holds in it where [Q   (cQ + dY)';
.   b^2] > 0. Or the set |V^-1 x|_inf <= 1, sampled: every row of [V^-1 (A + BK) V   V^-1 W] has an
absolute sum of at most 1, and |c x| <= b where that of c V is at most b.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from . import words
from .cells import Cell, cells
from .demands import Claim, Demand
from .functions import solved
from .polynomials import (
    Polynomial,
    bernstein_coefficients,
    block,
    diagonal,
    matrix,
    scalar,
    symmetric,
    zero,
)
from .reading import Model, Unreadable, array, number


class Loop(NamedTuple):
    """A model with its feedback (None: Y is part of the set), disturbances, controls, and limits of
    (x, y or u, which of them).
    """

    model: Model
    feedback: Model | None
    disturbance: Mapping[str, Fraction]
    controls: tuple[str, ...]
    limits: Sequence[tuple[str, int, Fraction]]

    @classmethod
    def read(cls, content: Any) -> Loop:
        """Return the loop that a file holds."""
        own, K = Model.read(content["model"]), content["feedback"]
        K, controls, sizes = K and Model.read(K), tuple(content["controls"]), []
        for name in ("disturbance", "state_bounds", "input_bounds"):
            sizes.append({str(key): number(value, name) for key, value in content[name]})
            if len(sizes[-1]) < len(content[name]) or any(v <= 0 for v in sizes[-1].values()):
                raise Unreadable(f"the file is damaged: {name} of one name, or not above zero")
        if sorted([*sizes[0], *controls]) != sorted(own.inputs):
            raise Unreadable("the file is damaged: an input is no disturbance or control, or both")
        fit = ((), own.states, controls, own.ranges)
        if K and (K.states, K.inputs, K.outputs, K.ranges) != fit:
            raise Unreadable("the file is damaged: the feedback is not one of states to controls")
        limits = []
        for name, size in sizes[1].items():
            of_state = name in own.states
            among = own.states if of_state else own.outputs
            limits.append(("x" if of_state else "y", among.index(name), size))
        limits += [("u", controls.index(name), size) for name, size in sizes[2].items()]
        y, w = [i for what, i, _ in limits if what == "y"], [own.inputs.index(n) for n in sizes[0]]
        if any(M.part(y, w).reduced().terms for M in own.matrices["D"]):
            raise Unreadable("disturbances reach a limited output directly, which is not covered")
        return cls(own, K, sizes[0], controls, limits)

    @property
    def cells(self) -> list[Cell]:
        """Boxes on which model and feedback are polynomials."""
        knots = []
        for i, p in enumerate(self.model.parameters):
            breaks = self.feedback.factors[i].breaks if self.feedback else ()
            knots.append([p.low, *(b for b in breaks if p.low < b < p.high), p.high])
        return list(cells(self.model, self.model.parameters, knots, [False] * len(knots)))

    def on(self, cell: Cell) -> tuple[Polynomial, ...]:
        """Return A, B of the controls, W of disturbances of size 1, C, D of the controls, and K."""
        A, B, C, D = self.model.on(cell.middle, cell.here)
        u, w = (
            [self.model.inputs.index(n) for n in own] for own in (self.controls, self.disturbance)
        )
        x, y = range(A.shape[0]), range(C.shape[0])
        K = self.feedback.on(cell.middle, cell.here)[3] if self.feedback else zero(len(u), len(x))
        sizes = diagonal([*self.disturbance.values()])
        return A, B.part(x, u), B.part(x, w) @ sizes, C, D.part(y, u), K

    def limited(self, **rows: Polynomial) -> Iterator[tuple[str, Polynomial, Fraction]]:
        """Yield (what is limited, its row of x, y or u, the limit)."""
        for what, i, limit in self.limits:
            yield f"{what}{i + 1}", rows[what].part([i]), limit

    @property
    def said(self) -> tuple[str, ...]:
        """The hypotheses and limits in words."""
        sizes = [f"|w{i + 1}| <= {float(v)!r}" for i, v in enumerate(self.disturbance.values())]
        limits = [f"|{what}{i + 1}| <= {float(v)!r}" for what, i, v in self.limits]
        return (
            *words.model(*self.model.sizes, self.model.parameters),
            f"disturbances {', '.join(sizes) or 'w = 0'} with any history",
            f"limits {', '.join(limits)}",
        )


def ellipsoid(content: Any) -> Claim:
    """Return what a file of an ellipsoid claims."""
    loop = Loop.read(content)
    own, shape = loop.model, Model.read(content["shape"])
    alpha = number(content["alpha"], "alpha")
    tau = array(content["shares"], "shares", len(loop.disturbance))
    outputs = 0 if loop.feedback else len(loop.controls)
    n, motion, every = len(own.states), own.parameters, loop.cells
    if (len(shape.states), len(shape.outputs)) != (n, outputs) or shape.ranges != own.ranges:
        raise Unreadable("the file is damaged: the set is not one of these states and this range")
    refused = ""
    if any(t < 0 for t in tau) or alpha < 0 or sum(tau) > alpha:
        refused = "the multipliers of the disturbances are below zero, or more than alpha together"
    if any(p.low < b < p.high for i, p in enumerate(motion) for b in shape.factors[i].breaks):
        refused = "Q(p) is not one polynomial"
    Q = shape.on(every[0].middle, every[0].here)[0].reduced()
    varies = [any(len(k) > i and k[i] for k in Q.terms) for i in range(len(motion))]
    for p, moves in zip(motion, varies, strict=True):
        if moves and (p.rate is None and p.tie is None if own.dt is None else p.rate != 0):
            refused = "Q depends on a parameter that may jump, or sampled on one that moves"

    def demands() -> Iterator[Demand]:
        shares, nw = diagonal(tau), len(tau)
        for cell in every:
            A, B, W, C, D, K = loop.on(cell)
            Q, _, Y, _ = shape.on(cell.middle, cell.here)
            Q = (Q + Q.T) * Fraction(1, 2)
            Y = K @ Q if loop.feedback else Y
            change = A @ Q + B @ Y
            if own.dt is not None:
                lower = [[Q * (1 - alpha)], [zero(nw, n), shares], [change, W, Q]]
                yield Demand("V falls", symmetric(lower), cell)
            for said, drift in cell.drifts(Q, varies) if own.dt is None else ():
                top = drift - Q * alpha - change - change.T
                yield Demand(f"V falls{said}", symmetric([[top], [-W.T, shares]]), cell)
            for what, row, limit in loop.limited(x=Q, y=C @ Q + D @ Y, u=Y):
                square = scalar(limit * limit)
                yield Demand(f"the limit of {what}", symmetric([[Q], [row, square]]), cell)

    said = "no motion that starts in an ellipsoid x' Q(p)^-1 x <= 1 leaves it, or exceeds a limit"
    return Claim(said, loop.said, demands(), refused=refused)


def parallelepiped(content: Any) -> Claim:
    """Return what a file of a parallelepiped claims."""
    loop = Loop.read(content)
    own, n = loop.model, len(loop.model.states)
    V = array(content["V"], "V", n, n)
    said = "no motion that starts in a parallelepiped |V^-1 x| <= 1 leaves it, or exceeds a limit"
    refused = ""
    if own.dt is None or (loop.controls and loop.feedback is None):
        raise Unreadable("a parallelepiped is known for sampled loops with a feedback only")
    columns, eye = matrix(V, n), diagonal([1] * n)
    try:
        back = matrix(solved(V, [[Fraction(i == j) for j in range(n)] for i in range(n)]), n)
    except ZeroDivisionError:
        return Claim(said, loop.said, (), refused="the parallelepiped is flat")
    for cell in loop.cells:
        A, B, W, C, D, K = loop.on(cell)
        moved, nw = [back @ (A + B @ K) @ columns, back @ W], W.shape[1]
        rows = [[*moved, matrix([[1]] * n, 1)]] + [
            [row @ columns, zero(1, nw), scalar(limit)]
            for _, row, limit in loop.limited(x=eye, y=C + D @ K, u=K)
        ]
        for values in bernstein_coefficients(block(rows), cell.variables).values():
            for *row, most in values:
                if sum(map(abs, row)) > most:
                    excess = sum(map(abs, row)) / most - 1
                    where = cell.place([Fraction(1, 2)] * cell.variables)
                    refused = f"an absolute sum is {excess:.3g} above its limit near {where}"
    return Claim(said, loop.said, (), refused=refused)
