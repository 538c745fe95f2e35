"""Invariant ellipsoids of LPV models within limits of states and controls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.scheduling import UNSCHEDULED
from symheli.progress import task
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.signal import indices
from symheli.values.summary import summarized
from synthesis.certify.statement.rates import Rate
from synthesis.numerics.program.bases import dependence
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.sets.proof import holds
from synthesis.sets.proven_set import ProvenSet
from synthesis.sets.search import SPARE, SetSearch, SetSolution
from synthesis.sets.statement import Limit, SetStatement, stated

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
HUGE = 1e6
"""Size over that of the limits beyond which a set that has not settled counts as unbounded."""
ROUNDS, SETTLED = 6, 0.1
"""Most changes of coordinates, and the change of the volume's logarithm at which they end."""
MORE_SPARE = 10.0
"""Factor on the spare of the inequalities where the exact check fails."""
TRIES = 5
"""Candidates that are checked."""


@dataclass(frozen=True, eq=False)
class InvariantSet(ProvenSet):
    """The states x' Q(p)^-1 x <= 1 that no motion of an LPV model leaves, within its limits.

    Made by `invariant_set`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    statement : SetStatement
        Model, disturbances, controls, limits, and the feedback where it was given.
    shape : LPVStateSpace
        Q(p) as its A, and Y(p) = K(p) Q(p), where the feedback was designed, as its C.
    alpha : float
        V = x' Q^-1 x falls at least with dV/dt = alpha (1 - V) outside, 1/s (sampled: the part of
        V lost in a sample); 0 without disturbances.
    shares : array (nw,)
        Multipliers of the disturbances, which add up to alpha at most.
    verified : bool
        The inequalities hold in exact arithmetic for every p.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a set without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel([[1.0]], [[2.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["x_m"])
    >>> found = synthesis.sets.invariant_set(plant, input_bounds={"u": 1.0})
    >>> found.verified, bool(1.999 < found.half_widths()[0] < 2)  # b / a
    (True, True)
    """

    statement: SetStatement
    shape: LPVStateSpace
    alpha: float
    shares: Array
    verified: bool
    why: str = ""
    form: ClassVar[str] = "invariant ellipsoid"

    __repr__ = summarized

    @property
    def shape_stored(self) -> Mapping[str, Any]:
        """Values that a file holds of the set beside its statement."""
        return {"shape": self.shape, "alpha": self.alpha, "shares": self.shares}

    def gramian(self, *p: float) -> Array:
        """Q (n, n) at p, one value a parameter; x' Q^-1 x <= 1 is the set there."""
        Q = self.shape.at(*self._point(p)).A
        return 0.5 * (Q + Q.T)

    def gain(self, *p: float) -> Array:
        """K (nu, n) at p, u = K x."""
        p = self._point(p)
        if self.statement.feedback is not None:
            return self.statement.feedback.at(*p).D
        return np.linalg.solve(self.gramian(*p), self.shape.at(*p).C.T).T

    def _point(self, p: tuple[float, ...]) -> tuple[float, ...]:
        """p, which may be left out of a model without scheduling."""
        without = not p and self.shape.parameters == (UNSCHEDULED,)
        return (UNSCHEDULED.middle,) if without else p

    def levels(self, x: Array, p: Any) -> Array:
        """x' Q^-1 x of states (..., n), each at its own p (...), or (..., m)."""
        Q = self.shape.matrices(p).A
        z = np.linalg.solve(np.linalg.cholesky(0.5 * (Q + np.swapaxes(Q, -1, -2))), x[..., None])
        return (z[..., 0] ** 2).sum(axis=-1)

    def level(self, x: Any, *p: float) -> Array:
        """x' Q^-1 x of states (..., n) at p: at most 1 in the set."""
        x = frozen(x, "x")
        n = len(self.shape.states)
        if x.shape[-1:] != (n,):
            raise InputError(f"x: expected {n} states along the last axis, got shape {x.shape}")
        root = np.linalg.cholesky(self.gramian(*p))
        return (np.linalg.solve(root, x.reshape(-1, n).T) ** 2).sum(axis=0).reshape(x.shape[:-1])

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
        Q = self.gramian(*p)
        rows = ((limit, self.row(limit, *p)) for limit in self.statement.limits)
        return {str(at.signal): float(np.sqrt(row @ Q @ row)) / at.bound for at, row in rows}

    def row(self, limit: Limit, *p: float) -> Array:
        """The signal of a limit over the states at p, (n,)."""
        K, at = self.gain(*p), self.statement.model.at(*self._point(p))
        seen = (np.eye(len(at.A)), at.C + at.D[:, self.statement.moved] @ K, K)
        return seen[limit.where][limit.index]

    def cut(self, first: str, second: str, *p: float, ax: Axes | None = None) -> Axes:
        """Draw the set at p where all other states are 0, over two of the states, and the limits
        there; those that the cut comes closest to are red.
        """
        from synthesis.sets.cut import plot_cut

        return plot_cut(self, first, second, p, ax)

    def verify(self, rigorous: bool = True) -> bool:
        """Check every inequality again: in rational arithmetic between the scheduling points, or
        with `rigorous` False in floating point.
        """
        return holds(self.statement, self.shape, self.alpha, self.shares, rigorous=rigorous)


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
        Of Q and Y in every parameter, or one each; by default 1 in those that may not jump. In
        discrete time Q depends only on constant parameters.
    alpha : float, optional
        See `InvariantSet`; by default several are tried, and the best taken.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    InvariantSet
        `verified` says whether there is one, `why` why not; a larger set may exist.

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
    >>> held = synthesis.sets.invariant_set(
    ...     lag.select(inputs=["w", "u"]), state_bounds={"x": 2.0}, input_bounds={"u": 3.0},
    ...     disturbance={"w": 0.5})
    >>> held.verified, held.contains([1.9], 0.3), max(held.used(0.5), key=held.used(0.5).get)
    (True, True, 'x')
    """
    solver = general_solver(solver)
    statement = stated(model, controller, state_bounds, input_bounds, disturbance, rate)
    model = statement.model
    own = model.parameters
    matters = [True] * len(own)
    basis = dependence(degree, own, "Q", matters, DEGREE, still=model.dt is not None)
    search = SetSearch(statement, basis, _directions(directions, model), solver)
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


NO_SET = "the solver finds no set within the limits"
UNBOUNDED = "the set grows without a bound: limit more states"


class _Climb:
    """The search over alpha, and the coordinates of the programs: those of the last set found."""

    def __init__(self, search: SetSearch, alpha: float | None):
        self.search, self.alpha = search, alpha
        own = search.statement
        if not own.disturbance:
            self.alpha = 0.0
        self.T = np.diag([own.state_bounds.get(x, 1.0) for x in own.model.states])
        self.why = NO_SET

    def best(self) -> InvariantSet:
        """The largest set found, with its proof."""
        alpha, spare = self._best_alpha() if self.alpha is None else self.alpha, SPARE
        if alpha is None:
            return self._none(self.why)
        for _ in range(TRIES):
            found = self._settled(alpha, spare)
            if found is None:
                return self._none(self.why)
            made = self._made(found, alpha).established()
            if made.verified:
                return made
            spare *= MORE_SPARE
        return self._none("no candidate passes the exact check")

    def _settled(self, alpha: float, spare: float) -> SetSolution | None:
        """The candidate in coordinates in which it is nearly the unit ball; None: there is none,
        and `why` says why.
        """
        before = None
        for _ in range(ROUNDS):
            found = self.search.largest(alpha, self.T, spare)
            if found is None and before is not None and before.size > HUGE:
                break
            if found is None:
                return before
            middle = self._middle(found)
            if not np.linalg.eigvalsh(0.5 * (middle + middle.T))[0] > 0:
                self.why = "what the solver returned is no ellipsoid"
                return before
            log = 0.5 * np.linalg.slogdet(middle)[1]
            if before is not None and abs(log - self._log) < SETTLED:
                return found
            before, self._log = found, log
            self.T = np.linalg.cholesky(middle)
        self.why = UNBOUNDED
        return None

    def _middle(self, found: SetSolution) -> Array:
        """Q in the middle of the box."""
        search = self.search
        at = [0.5 * (a + b) for a, b in search.motion.box]
        functions = search.basis(np.array(at if len(at) > 1 else at[0]))
        return np.tensordot(functions, found.Q, axes=1)

    def _best_alpha(self) -> float | None:
        """The alpha of the largest set, by steps of a factor up and down and then of a finer
        one; None: there is none.
        """
        sizes: dict[float, float] = {}

        def size(alpha: float) -> float:
            if alpha not in sizes:
                tried = self.search.largest(alpha, self.T)
                sizes[alpha] = -math.inf if tried is None else tried.size
                progress.step(f"alpha {alpha:.3g}: size {sizes[alpha]:.4g}")
            return sizes[alpha]

        best = FIRST_DECAY / self.search.unit
        with task("invariant set", 2 * MOST_STEPS) as progress:
            for factor in (STEP, FINER):
                for direction in (factor, 1 / factor):
                    best = self._climbed(best, direction, size)
                if size(best) == -math.inf:
                    return None
        return best

    def _climbed(self, alpha: float, factor: float, size: Callable[[float], float]) -> float:
        """alpha after steps of this factor, as long as the set grows, or while none was found."""
        start = alpha
        for _ in range(MOST_STEPS):
            ahead = alpha * factor
            if self.search.sampled and ahead >= 1:
                break
            if size(ahead) <= size(alpha) and size(alpha) > -math.inf:
                break
            alpha = ahead
        return alpha if size(alpha) > -math.inf else start

    def _made(self, found: SetSolution, alpha: float) -> InvariantSet:
        own = self.search.statement
        model, k, rows = own.model, len(found.Q), found.Y.shape[1]
        names = tuple(model.inputs[i] for i in own.moved)[:rows]
        n = len(model.states)
        shape = LPVStateSpace(
            self.search.basis, found.Q, np.zeros((k, n, 0)), found.Y, np.zeros((k, rows, 0)),
            model.parameters, model.states, (), names, model.dt,
        )  # fmt: skip
        why = "the inequalities do not hold in exact arithmetic"
        return InvariantSet(own, shape, alpha, found.shares, False, why)

    def _none(self, why: str) -> InvariantSet:
        own, k, n = self.search.statement, self.search.basis.size, len(self.T)
        rows = len(own.controls) if own.feedback is None else 0
        nothing = SetSolution(np.zeros((k, n, n)), np.zeros((k, rows, n)), np.zeros(0), 0.0)
        return replace(self._made(nothing, 0.0), why=why)
