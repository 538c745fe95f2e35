"""Invariant ellipsoids of LPV models within limits of states and controls."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LinearModel, LPVStateSpace
from symheli.progress import task
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.signal import indices
from symheli.values.summary import summarized
from synthesis.lpv.bases import dependence
from synthesis.program.cone_program import Solver, general_solver
from synthesis.sets.proof import holds
from synthesis.sets.search import SPARE, Found, Search
from synthesis.sets.statement import Statement, feedback_of
from synthesis.worst.rates import Rate, limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEGREE = 1
"""Degree of Q and Y in every parameter, by default."""
FIRST_DECAY, STEP, FINER = 0.25, 2.0, 2.0**0.5
"""alpha at first, in terms of the model's typical pole (sampled: of 1), and the factors by which it
is changed, coarse and fine.
"""
MOST_STEPS = 8
"""Changes of alpha in either direction."""
MORE_SPARE = 10.0
"""Factor on the spare of the inequalities where the exact check fails, and how often."""
TRIES = 5


@dataclass(frozen=True, eq=False)
class InvariantSet:
    """The states x' Q(p)^-1 x <= 1 that no motion of an LPV model leaves, within its limits.

    Made by `invariant_set`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    statement : Statement
        Model, disturbances, controls, limits, and the feedback where it was given.
    shape : LPVStateSpace
        Q(p) as its A, and Y(p) = K(p) Q(p), where the feedback was designed, as its C.
    alpha : float
        V = x' Q^-1 x falls at least with dV/dt = alpha (1 - V) outside, 1/s (sampled: the part of
        V lost in a sample); 0 without disturbances.
    shares : array (nw,)
        Multipliers of the disturbances, which add up to alpha at most.
    proven : bool
        The inequalities hold in exact arithmetic for every p.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a set without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import numpy as np
    >>> plant = symheli.lpv.LinearModel([[1.0]], [[2.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["x_m"])
    >>> found = synthesis.invariant_set(plant, input_bounds={"u": 1.0})
    >>> found.proven, bool(1.999 < found.half_widths(0.0)[0] < 2)  # b / a
    (True, True)
    """

    statement: Statement
    shape: LPVStateSpace
    alpha: float
    shares: Array
    proven: bool
    why: str = ""

    __repr__ = summarized

    def gramian(self, *p: float) -> Array:
        """Q (n, n) at p, one value a parameter; x' Q^-1 x <= 1 is the set there."""
        Q = self.shape.at(*p).A
        return 0.5 * (Q + Q.T)

    def gain(self, *p: float) -> Array:
        """K (nu, n) at p, u = K x."""
        if self.statement.feedback is not None:
            return self.statement.feedback.at(*p).D
        return np.linalg.solve(self.gramian(*p), self.shape.at(*p).C.T).T

    def level(self, x: Any, *p: float) -> Array:
        """x' Q^-1 x of states (..., n) at p: at most 1 in the set."""
        x = frozen(x, "x")
        n = len(self.shape.states)
        if x.shape[-1:] != (n,):
            raise InputError(f"x: expected {n} states along the last axis, got shape {x.shape}")
        root = np.linalg.cholesky(self.gramian(*p))
        z = np.linalg.solve(root, x.reshape(-1, n).T)
        return (z**2).sum(axis=0).reshape(x.shape[:-1])

    def contains(self, x: Any, *p: float) -> bool:
        """Whether the state (n,) lies in the set at p; of states (..., n), whether all do."""
        return bool(np.all(self.level(x, *p) <= 1))

    def volume(self, *p: float) -> float:
        """Volume of the set at p, in the product of the states' units."""
        n = len(self.shape.states)
        ball = math.pi ** (n / 2) / math.gamma(n / 2 + 1)
        return ball * math.sqrt(float(np.linalg.det(self.gramian(*p))))

    def half_widths(self, *p: float) -> Array:
        """Largest size of each state in the set at p, (n,), in its unit."""
        return np.sqrt(np.diag(self.gramian(*p)))

    def used(self, *p: float) -> dict[str, float]:
        """Part of each limit that the set at p reaches, at most 1; the largest one binds."""
        Q, K, at = self.gramian(*p), self.gain(*p), self.statement.model.at(*p)
        out = {}
        for limit in self.statement.limits:
            row = self._row(limit.where, limit.index, K, at)
            out[str(limit.signal)] = float(np.sqrt(row @ Q @ row)) / limit.bound
        return out

    def _row(self, where: int, index: int, K: Array, at: LinearModel) -> Array:
        """The row c + d K of a limit, (n,)."""
        seen = (np.eye(len(at.A)), at.C + at.D[:, self.statement.moved] @ K, K)
        return seen[where][index]

    def cut(self, first: str, second: str, *p: float, ax: Axes | None = None) -> Axes:
        """Draw the set at p where all other states are 0, over two of the states, and the limits
        there; the one that the set comes closest to is drawn strong.
        """
        from synthesis.sets.cut import plot_cut

        return plot_cut(self, first, second, p, ax)

    @cached_property
    def hypotheses(self) -> tuple[str, ...]:
        """What the statement rests on, in sentences."""
        return (*self.statement.hypotheses, "the state lies in the set at the start")

    def __str__(self) -> str:
        if not self.proven:
            return f"no invariant set: {self.why}"
        limited = ", ".join(f"|{s}| <= {b:g}" for s, b, *_ in self.statement.limits)
        return "\n".join(
            [
                "invariant ellipsoid, proven for every p",
                f"within {limited}",
                *(f"- {line}" for line in self.hypotheses),
            ]
        )

    def verify(self, rigorous: bool = True) -> bool:
        """Check every inequality again: in rational arithmetic between the scheduling points, or
        with `rigorous` False in floating point.
        """
        return holds(self.statement, self.shape, self.alpha, self.shares, rigorous=rigorous)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the set as JSON, sufficient to prove it again: `symheli verify FILE`."""
        from synthesis.sets.set_file import written

        return written(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> InvariantSet:
        """Read a set and prove it again; `proven` says whether that succeeded."""
        from synthesis.sets.set_file import read

        return read(path)


@with_one_thread
def invariant_set(
    model: LPVStateSpace | LinearModel,
    *,
    controller: Any = None,
    state_bounds: Mapping[str, float] | None = None,
    input_bounds: Mapping[str, float] | None = None,
    disturbance: Mapping[str, float] | None = None,
    directions: Sequence[Mapping[str, float]] = (),
    rate: Rate = None,
    degree: int | tuple[int, ...] | None = None,
    alpha: float | None = None,
    solver: Solver | str = "CLARABEL",
) -> InvariantSet:
    """The largest proven ellipsoid x' Q(p)^-1 x <= 1 that an LPV model does not leave, within
    limits.

    Parameters
    ----------
    model : LPVStateSpace or LinearModel
        Each input is a disturbance or a control.
    controller : gains, or an LPVStateSpace without states, optional
        u = K(p) x, as `Plant.close` takes it: an array (nu, n), {(control, state): gain}, ...; by
        default it is designed with the set, K(p) = Y(p) Q(p)^-1.
    state_bounds : dict, optional
        {state or output: largest size}.
    input_bounds : dict, optional
        {control: largest size}; with a controller, controls without a limit may be left out.
    disturbance : dict, optional
        {input: amplitude}, |w| <= amplitude with any history.
    directions : sequence of dict, optional
        {state: size}: make the factor largest by which all of these lie in the set at every p;
        by default the volume (its geometric mean over p).
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the model's own.
    degree : int or tuple of int, optional
        Of Q and Y in every parameter, or one each; by default 1 in those that may not jump. In discrete time Q depends only on constant parameters.
    alpha : float, optional
        See `InvariantSet`; by default several are tried, and the best taken.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    InvariantSet
        `proven` says whether there is one, `why` why not; a larger set may exist.

    Raises
    ------
    InputError
        Bounds, inputs, a controller or rates that do not fit, with what to do.

    References
    ----------
    Boyd, El Ghaoui, Feron and Balakrishnan (1994), sections 5.2, 6.1 and 7.2; Blanchini, Automatica
    35 (1999).

    Examples
    --------
    >>> held = synthesis.invariant_set(
    ...     lag.select(inputs=["w", "u"]), state_bounds={"x": 2.0}, input_bounds={"u": 3.0},
    ...     disturbance={"w": 0.5})
    >>> held.proven, held.contains([1.9], 0.3), max(held.used(0.5), key=held.used(0.5).get)
    (True, True, 'x')
    """
    solver = general_solver(solver)
    if isinstance(model, LinearModel):
        model = LPVStateSpace.constant(model)
    if not isinstance(model, LPVStateSpace):
        raise InputError(
            f"model: expected an LPVStateSpace or a LinearModel, got {type(model).__name__}"
        )
    own = limits(model.parameters, rate)
    model = replace(model, parameters=own, residuals=None)
    outside = dict(disturbance or {})
    controls = tuple(u for u in model.inputs if u not in outside)
    feedback = None if controller is None else feedback_of(controller, model, controls)
    statement = Statement(
        model, outside, controls, state_bounds or {}, input_bounds or {}, feedback
    )
    matters = [True] * len(own)
    basis = dependence(degree, own, "Q", matters, DEGREE, still=model.dt is not None)
    search = Search(statement, basis, _directions(directions, model), solver)
    return _Climb(search, None if alpha is None else positive(alpha, "alpha")).best()


def _directions(given: Sequence[Mapping[str, float]], model: LPVStateSpace) -> Array:
    out = np.zeros((len(given), len(model.states)))
    for d, each in zip(out, given, strict=True):
        if not isinstance(each, Mapping) or not each:
            raise InputError(f"directions: expected {{state: size}}, got {each!r:.60}")
        d[indices(each, model.states, "state")] = list(each.values())
    if not (np.all(np.isfinite(out)) and np.all(np.any(out, axis=1))):
        raise InputError("directions: expected finite sizes, not all of them 0")
    return out


class _Climb:
    """The search over alpha, and the coordinates of the programs: those of the last set found."""

    def __init__(self, search: Search, alpha: float | None):
        self.search, self.alpha = search, alpha
        own = search.statement
        sizes = [own.state_bounds.get(x, 1.0) for x in own.model.states]
        self.T = np.diag(sizes)

    def best(self) -> InvariantSet:
        """The largest set found, with its proof."""
        own = self.search.statement
        if self.alpha is None and len(own.disturbance):
            alpha = self._best_alpha()
        else:
            alpha = 0.0 if not len(own.disturbance) else self.alpha
        if alpha is None:
            return self._none("the solver has no set within the limits, or none that is bounded")
        spare = SPARE
        for _ in range(TRIES):
            found = self._settled(alpha, spare)
            if found is None:
                break
            made = self._made(found, alpha)
            if made.verify():
                return replace(made, proven=True, why="")
            spare *= MORE_SPARE
        else:
            return self._none("no candidate passes the exact check")
        return self._none("the solver has no set within the limits, or none that is bounded")

    def _settled(self, alpha: float, spare: float) -> Found | None:
        """The candidate in coordinates in which it is nearly the unit ball."""
        found = self.search.largest(alpha, self.T, spare)
        if found is None:
            return None
        self._take(found)
        return self.search.largest(alpha, self.T, spare) or found

    def _take(self, found: Found) -> None:
        """Make the set found the unit ball of the coordinates."""
        search = self.search
        middle = search.basis(np.mean(search.points, axis=0)[None].squeeze())
        Q = np.tensordot(middle, found.Q, axes=1)
        try:
            self.T = np.linalg.cholesky(0.5 * (Q + Q.T))
        except np.linalg.LinAlgError:
            return

    def _best_alpha(self) -> float | None:
        """The alpha of the largest set, by steps of a factor up and down and then of a finer
        one.
        """
        sizes: dict[float, float] = {}
        first = FIRST_DECAY / self.search.unit

        def size(alpha: float) -> float:
            if alpha not in sizes:
                tried = self.search.largest(alpha, self.T)
                sizes[alpha] = -math.inf if tried is None else tried.size
                progress.step(f"alpha {alpha:.3g} 1/s: size {sizes[alpha]:.4g}")
            return sizes[alpha]

        with task("invariant set", 2 * MOST_STEPS) as progress:
            alpha = first
            for factor in (STEP, FINER):
                for direction in (factor, 1 / factor):
                    for _ in range(MOST_STEPS):
                        ahead = alpha * direction
                        if self.search.sampled and ahead >= 1:
                            break
                        if size(ahead) <= size(alpha) and math.isfinite(size(alpha)):
                            break
                        alpha = ahead
                if not math.isfinite(size(alpha)):
                    return None
        return alpha

    def _made(self, found: Found, alpha: float) -> InvariantSet:
        model = self.search.statement.model
        n, k = len(model.states), len(found.Q)
        names = tuple(model.inputs[i] for i in self.search.statement.moved)
        names = names if self.search.statement.feedback is None else ()
        shape = LPVStateSpace(
            self.search.basis, found.Q, np.zeros((k, n, 0)), found.Y, np.zeros((k, len(names), 0)),
            model.parameters, model.states, (), names, model.dt,
        )  # fmt: skip
        return InvariantSet(
            self.search.statement, shape, alpha, found.shares, False, "not verified"
        )

    def _none(self, why: str) -> InvariantSet:
        n, nu = len(self.T), len(self.search.statement.controls)
        k = self.search.basis.size
        nu = nu if self.search.statement.feedback is None else 0
        nothing = Found(np.zeros((k, n, n)), np.zeros((k, nu, n)), np.zeros(0), 0.0)
        return replace(self._made(nothing, 0.0), why=why)
