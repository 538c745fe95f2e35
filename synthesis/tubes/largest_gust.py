"""The largest gust in which an invariant tube is proven."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import casadi
import numpy as np

from symheli import Helicopter
from symheli.errors import InputError
from symheli.lpv.riccati import lyapunov
from symheli.progress import Task, task
from symheli.values.arrays import Array
from symheli.values.numbers import by_name, positive, whole
from synthesis.numerics.program.cone_program import Solver
from synthesis.tubes.deviations import MOST_SEGMENTS, Deviations
from synthesis.tubes.proof import is_within
from synthesis.tubes.search import smallest
from synthesis.tubes.tube import (
    FIRST_SHARE,
    FIRST_SIZE,
    TOLERANCE,
    Growth,
    Tube,
    enclosed_cells,
    established,
    from_below,
    posed,
)

RATES = (1.0, 0.5, 0.25, 1.5, 2.0)
"""alpha of the first tube over the rate of the slowest mode of the linear loop, by turns."""
STEPS = (1.0, 1 / 1.2, 1.2, 1 / 1.44, 1.44)
"""Factors on the alpha of the last tube that are tried for the next gust."""
COARSE, FINE = (1.1, 1.02), (1.02, 1.005)
"""Factors on the half widths of the last tube, in the first round and from one to the next."""
FINELY = 3
"""How many of the alphas are tried with fine factors, where all failed with coarse ones."""
ROUNDS = 20
SPARE = 1e-3
"""Spare of the inequality, in terms of the rate of the slowest mode."""
FIRST = 0.05
"""First gust, in terms of the one in which a tube of the linear loop fills the sizes."""
SMALLER, TRIES = 8.0, 4
"""Factor by which the first gust is lowered while it has no tube, and how often."""
DOUBLED = 40
"""Most doublings of a gust."""


NONE = "the linear loop has no invariant ellipsoid"
BEYOND = "the tube is beyond a limit"


class LargestGust(NamedTuple):
    """The largest `gust` with a proven `tube`, and the least one, `refused`, where none was found:
    that there is none is not shown. 0 and a tube without proof where no gust has one.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> print(LargestGust(0.1, tube(heli, 3.0, gust=0.1), 0.2))
    a tube is proven for |w| <= 0.1; none was found at 0.2
    """

    gust: float
    tube: Tube
    refused: float

    def __str__(self) -> str:
        if not self.gust:
            return f"no tube at any gust: {self.tube.why}"
        return f"a tube is proven for |w| <= {self.gust:.4g}; none was found at {self.refused:.4g}"


def largest_gust(
    model: Helicopter | casadi.Function,
    reference: Any,
    *,
    limits: Mapping[str, float] | None = None,
    sizes: Any = None,
    accuracy: float = 0.01,
    segments: int = 16,
    solver: Solver | None = None,
    **flight: Any,
) -> LargestGust:
    """The largest gust for which an invariant tube within limits is proven.

    The gust is doubled from a small one, then halved in; each tube starts from the last one that
    was proven, with rates alpha near its own. The work is counted, not timed.

    Parameters
    ----------
    model, reference, sizes, solver
        As for `tube`; `sizes` are needed for another model than a helicopter.
    limits : mapping, optional
        {state or control: largest deviation}, SI; default: none, the tube may be as large as it
        comes.
    accuracy : float
        Relative distance of the largest gust with a tube from the least one without.
    segments : int
        Parts of the way to a deviation over which the Jacobian is averaged: more of them find
        larger gusts and take longer.
    **flight
        Other arguments of `tube`.

    Returns
    -------
    LargestGust
        Gust, its tube, and the least gust at which none was found.

    Raises
    ------
    InputError
        As `tube` does; a limit that is no number > 0, or of no state or control.

    Examples
    --------
    x' = -x + x^3 + w has an interval that no motion leaves up to |w| = 2/(3 sqrt 3) = 0.3849.

    >>> import casadi
    >>> x, u, w = (casadi.SX.sym(s) for s in ("x", "u", "w"))
    >>> f = casadi.Function("f", [x, u, w], [-x + x**3 + u + w])
    >>> at_rest = casadi.Function("rest", [casadi.SX.sym("c", 0)], [casadi.SX(1, 1)] * 2)
    >>> found = largest_gust(f, Motions(at_rest, [[0.0]]), sizes=[0.2], accuracy=0.05)
    >>> found.tube.verified, bool(0.35 < found.gust < 0.3849)
    (True, True)
    """
    if "gust" in flight:
        raise InputError("gust: it is what is sought; leave it out")
    accuracy = positive(accuracy, "accuracy")
    segments = whole(segments, "segments", 1)
    if segments > MOST_SEGMENTS:
        raise InputError(f"segments: expected at most {MOST_SEGMENTS}, got {segments}")
    loop, cells, own = posed(model, reference, gust=1.0, sizes=sizes, segments=segments, **flight)
    within = _Limits(loop, by_name(limits or {}, "limits", "{state or control: deviation}"))
    search = _GustSearch(loop, cells, own, within, solver or Solver(tolerance=TOLERANCE))
    with task("largest gust", None) as progress:
        return search.largest(accuracy, progress)


class _Limits:
    """Largest deviations of states and controls."""

    def __init__(self, loop: Deviations, limits: Mapping[str, float]):
        n = len(loop.states)
        K = loop.feedback[:, : len(loop.inputs)]
        nodes = len(loop.reference.nodes)
        K = np.broadcast_to(K, (nodes, *K.shape[1:]))
        self.rows: list[tuple[Array, float]] = []
        for name, bound in limits.items():
            size = positive(bound, f"the limit of {name}")
            if name in loop.states:
                row = np.eye(n)[loop.states.index(name)]
                self.rows.append((np.broadcast_to(row, (nodes, n)), size))
            elif name in loop.inputs:
                self.rows.append((K[:, loop.inputs.index(name)], size))
            else:
                known = ", ".join((*loop.states, *loop.inputs))
                raise InputError(f"limits: {name!r} is no state or control; known: {known}")

    def hold(self, tube: Tube) -> bool:
        """Whether the tube is within all of them, in rational arithmetic."""
        return all(is_within(tube.P, rows, bound) for rows, bound in self.rows)


class _GustSearch:
    """Tubes of one loop in gusts of several sizes."""

    def __init__(self, loop: Deviations, cells: Any, sizes: Array, within: _Limits, solver: Solver):
        self.loop, self.cells, self.sizes = loop, cells, sizes
        self.within, self.solver = within, solver
        self.last: Tube | None = None
        self.tried = Tube(loop, np.zeros((0, 0, 0)), cells, np.zeros((0, 0, 0)), (), False, NONE)
        self.rate = self.decay = 0.0

    def largest(self, accuracy: float, progress: Task) -> LargestGust:
        """Return the largest gust with a tube."""
        first = self._first(progress)
        if self.last is None:
            return first
        low, high = first.gust, math.inf
        for _ in range(DOUBLED):
            if self._reached(2 * low, self.last, progress):
                low *= 2
            else:
                high = 2 * low
                break
        while high > low * (1 + accuracy) and math.isfinite(high):
            middle = math.sqrt(low * high)
            if self._reached(middle, self.last, progress):
                low = middle
            else:
                high = middle
        return LargestGust(low, self.last, high)

    def _first(self, progress: Task) -> LargestGust:
        """Return the first gust with a tube; 0 where none has one."""
        gust, self.rate = self._scale()
        for _ in range(TRIES):
            self.decay = self.rate
            for share in RATES:
                P = self._linear(gust, share * self.rate)
                if P is not None and self._found(gust, share * self.rate, P, COARSE, progress):
                    return LargestGust(gust, self.tried, math.inf)
            gust /= SMALLER
        return LargestGust(0.0, self.tried, gust * SMALLER)

    def _scale(self) -> tuple[float, float]:
        """Return a small gust, and the rate of the slowest mode of the linear loop, 1/s."""
        n = len(self.loop.states)
        over = self._enclosed(self.loop)
        if over is None:
            return FIRST * float(self.sizes.min()), 1.0
        corners = over[0].over.corners
        F = corners.reshape(-1, *corners.shape[-2:])[0]
        A, B = F[:, :n], F[:, n:-1]
        modes = np.linalg.eigvals(A).real.max()
        if not modes < 0:
            return FIRST * float(self.sizes.min()), 1.0
        X = lyapunov(A, B @ B.T, None)
        width = np.sqrt(np.maximum(np.diag(X), 0.0) * -modes)
        reach = float((width / -modes / self.sizes).max())
        return FIRST / reach if reach > 0 else FIRST, float(-modes)

    def _enclosed(self, loop: Deviations) -> Any:
        factor = FIRST_SIZE * np.diag(self.sizes)
        factors = np.broadcast_to(factor, (len(self.cells), *factor.shape))
        return enclosed_cells(loop, self.cells, factors, loop.drifts(self.cells), FIRST_SHARE)

    def _linear(self, gust: float, decay: float) -> Array | None:
        """Return P of the smallest ellipsoids of the linear loop; None: there are none."""
        loop = replace(self.loop, gust=gust)
        linear = self._enclosed(loop)
        if linear is None or not loop.is_defined(self.cells):
            return None
        root = FIRST_SIZE * np.diag(self.sizes)
        roots = np.broadcast_to(root, (len(loop.reference.nodes), *root.shape))
        spare = SPARE * self.rate
        found = smallest(linear, roots, self.sizes, decay, spare, self.solver, loop.reference.jump)
        return None if found is None else found.P

    def _reached(self, gust: float, last: Tube, progress: Task) -> bool:
        """Whether a tube is proven in this gust, starting from the last one."""
        decay, P = self.decay, last.P
        tries = [(step, COARSE) for step in STEPS] + [(step, FINE) for step in STEPS[:FINELY]]
        return any(self._found(gust, step * decay, P, how, progress) for step, how in tries)

    def _found(
        self, gust: float, decay: float, P: Array, growth: tuple[float, float], progress: Task
    ) -> bool:
        """Whether a tube with this alpha is proven, starting from P."""
        loop = replace(self.loop, gust=gust)
        drifts = loop.drifts(self.cells)
        effort = Growth(decay, *growth, ROUNDS, SPARE * self.rate)
        grown = from_below(loop, self.cells, self.sizes, drifts, effort, P, self.solver)
        self.tried = established(loop, self.cells, grown)
        why = self.tried.why or ("" if self.within.hold(self.tried) else BEYOND)
        progress.step(f"|w| <= {gust:.4g}, rate {decay:.3g}: {why or 'proven'}")
        if not why:
            self.last, self.decay = self.tried, decay
        return not why
