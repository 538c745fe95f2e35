"""Output feedback for several objectives at once, in the variables of Scherer, Gahinet and Chilali.

One X and one Y serve all objectives, which is what makes the problem convex and each bound larger
than it need be. Every inequality is written as in the paper and imposed by Bernstein coefficients.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError, SolverError
from symheli.lpv import FunctionSpace
from symheli.threads import with_one_thread
from symheli.values.signal import indices
from synthesis.certificate import Attempt
from synthesis.design.back_off import levels_above
from synthesis.design.cells import Cell, cells, degrees_of
from synthesis.design.controller import Controller
from synthesis.design.coordinates import Coordinates, coordinates_of
from synthesis.design.fitted import fitted
from synthesis.design.generalized import Generalized
from synthesis.design.in_plant_units import in_plant_units, packed
from synthesis.design.motions import motions, used
from synthesis.design.objectives import H2, L2, EnergyToPeak, Objective, PoleRegion
from synthesis.design.plant import Plant, require_plant
from synthesis.design.recovery import Transformed, controller
from synthesis.design.refusals import failed, require_channels
from synthesis.design.search import ACCURACY, Dependence, functions, limited
from synthesis.program.cone_program import Solver
from synthesis.program.interruptible import no_panic
from synthesis.worst.rates import Rate
from synthesis.worst.rates import asked as limits

Array = np.ndarray

BACK_OFF = 1.02
"""Every bound is loosened by this factor before X and Y are settled."""
NEAR = 3.0
"""Gains so many times larger or smaller than the units of the program ask for other units."""
ROUNDS = 3
"""Most changes of units."""
MARGIN = 1e-8
LARGEST = 1e5
WIDE = 1e3


@with_one_thread
def multiobjective(
    plant: Plant,
    objectives: Objective | Sequence[Objective],
    rate: Rate = None,
    *,
    region: PoleRegion | None = None,
    X: Dependence = 0,
    Y: Dependence = 0,
    gains: Dependence | None = None,
    direct: bool = True,
    back_off: float = BACK_OFF,
    solver: Solver | str = "CLARABEL",
) -> Controller:
    """Design a dynamic controller that minimises a weighted sum of squared gains within hard
    bounds.

    Parameters
    ----------
    plant : Plant
        Of some ten states at most: the programs grow with the fourth power of their number.
    objectives : L2, H2, EnergyToPeak or sequence of them
        With their channels, hard bounds and weights.
    rate : float, sequence or mapping, optional
        Largest |dp/dt|; by default the plant's own.
    region : PoleRegion, optional
        For the poles of every frozen loop.
    X, Y : int, tuple or FunctionSpace
        Degrees in the parameters; only one of them may depend on a parameter that moves.
    gains : int, tuple or FunctionSpace, optional
        Of the controller's own variables; by default the degree of the plant plus that of X and Y.
    direct : bool
        Whether the controller may have feedthrough.
    back_off : float
        By which every gain is loosened before X and Y are settled.
    solver : Solver or str
        For the programs, by cvxpy.

    Returns
    -------
    Controller
        `gamma` is the root of the weighted sum of the gains as they are settled, `back_off` in
        them, and `optimum` the least without it; one by one they are in `attempts`.

    Raises
    ------
    InputError, SynthesisError
        As `output_feedback`; also where the bounds contradict each other.

    References
    ----------
    Scherer, Gahinet and Chilali, IEEE Trans. Automatic Control 42 (1997); with X(p) or Y(p):
    Apkarian and Adams (1998).

    Examples
    --------
    >>> from synthesis import H2, L2, PoleRegion
    >>> made = synthesis.multiobjective(
    ...     plant, [L2(bound=1.5), H2(performance=["z_x"], disturbances=["w"])],
    ...     region=PoleRegion(decay=1.2), gains=0)
    >>> bool(made.closed().at(0.5).poles().real.max() <= -1.2)
    True
    """
    require_plant(plant)
    require_channels(plant)
    parameters = limits(plant.parameters, rate)
    plant = plant.with_scheduling(parameters)
    every = (objectives,) if isinstance(objectives, L2 | H2 | EnergyToPeak) else tuple(objectives)
    if not every:
        raise InputError("objectives: expected one or more of L2, H2 and EnergyToPeak, got none")
    if region is not None and plant.dt is not None:
        raise InputError("a pole region is for continuous time: design there, then discretize")
    bases = [limited(functions(d, parameters, n), parameters, n) for d, n in ((X, "X"), (Y, "Y"))]
    for s, in_x, in_y in zip(parameters, *map(used, bases), strict=True):
        standing = s.rate == 0
        if (in_x and in_y and not standing) or (plant.dt and (in_x or in_y) and not standing):
            raise InputError(
                f"X and Y depend on {s.name}, and the controller would need its rate: let one of"
                " them be of degree 0 (in discrete time both)"
            )
    solver = solver if isinstance(solver, Solver) else Solver(solver)
    (factor,) = levels_above(float(back_off))
    problem = _Problem(
        plant, coordinates_of(plant, 1.0), bases[0], bases[1], gains, every, region, direct
    )
    attempts: list[Attempt] = []
    values = problem.best(solver, attempts)
    if values is None:
        raise failed(plant, attempts)
    levels = [factor * v for v in values]
    found = problem.settled(levels, solver, attempts)
    if found is None:
        raise failed(plant, attempts)
    total = math.sqrt(sum(o.soft * v * v for o, v in zip(every, levels, strict=True)))
    least = total / factor
    words = ", ".join(type(o).__name__ for o in every)
    fit = fitted(found, plant.parameters, ACCURACY)
    made = in_plant_units(plant, problem.coordinates, fit, total, f"output feedback for {words}")
    return replace(made, optimum=least, attempts=tuple(attempts))


class _Loop(NamedTuple):
    """The closed loop in the new variables at one p: expressions of cvxpy."""

    A: Any
    P: Any
    B: Any
    C: Any
    D: Any


class _Problem:
    """The inequalities, with their unknowns."""

    def __init__(
        self,
        plant: Plant,
        coordinates: Coordinates,
        X: FunctionSpace,
        Y: FunctionSpace,
        gains: Dependence | None,
        objectives: Sequence[Objective],
        region: PoleRegion | None,
        direct: bool,
    ):
        import cvxpy as cp

        self.plant, self.coordinates, self.objectives = plant, coordinates, objectives
        self.region = region and _in_time(region, coordinates.time)
        root = math.sqrt(coordinates.time)  # energies and variances are per unit of time
        self.pace = [1.0 if isinstance(o, L2) else root for o in objectives]
        self.sizes = [o.bound or 1.0 for o in objectives]
        """Of the gains in the scaled loop: outputs are measured in them."""
        m = len(plant.parameters)
        breaks = coordinates.breaks
        own = degrees_of(lambda p: list(coordinates.at(p)), breaks)
        most = np.maximum(*(np.array(b.degrees or (4,) * m) for b in (X, Y)))
        given = tuple(int(d) for d in np.array(own) + most) if gains is None else gains
        self.basis = {"X": X, "Y": Y, "K": functions(given, plant.parameters, "gains")}
        degrees = np.array(own) + np.maximum(most, self.basis["K"].degrees or (4,) * m)
        self.cells = cells(breaks, [int(d) for d in degrees])
        sample = coordinates.at(np.array([[s.middle for s in plant.parameters]]))
        self.n, self.nu, self.ny = sample.A.shape[-1], sample.B2.shape[-1], sample.C2.shape[-2]
        n = self.n
        self.X = [cp.Variable((n, n), symmetric=True) for _ in range(X.size)]
        self.Y = [cp.Variable((n, n), symmetric=True) for _ in range(Y.size)]
        count = self.basis["K"].size
        self.A = [cp.Variable((n, n)) for _ in range(count)]
        self.B = [cp.Variable((n, self.ny)) for _ in range(count)]
        self.C = [cp.Variable((self.nu, n)) for _ in range(count)]
        nothing = np.zeros((self.nu, self.ny))
        self.D = [cp.Variable((self.nu, self.ny)) if direct else nothing for _ in range(count)]
        self.channels = [
            (
                _places(o.disturbances, plant.disturbances, "disturbance"),
                _places(o.performance, plant.performance, "performance signal"),
            )
            for o in objectives
        ]

    @property
    def units(self) -> list[float]:
        """Of every gain of the plant: so much is 1 in the program."""
        return [pace / size for pace, size in zip(self.pace, self.sizes, strict=True)]

    def best(self, solver: Solver, attempts: list[Attempt]) -> list[float] | None:
        """`least`, again in units of the gains found while these are far from the first."""
        values = self.least(solver, attempts)
        for _ in range(ROUNDS):
            if values is None:
                break
            sizes = [max(v * pace, 1e-9) for v, pace in zip(values, self.pace, strict=True)]
            if all(1 / NEAR < a / b < NEAR for a, b in zip(sizes, self.sizes, strict=True)):
                break
            self.sizes = sizes
            values = self.least(solver, attempts) or values
        return values

    def least(self, solver: Solver, attempts: list[Attempt]) -> list[float] | None:
        """Gains that minimise the sum; None where there are none."""
        import cvxpy as cp

        squares = [cp.Variable(nonneg=True) for _ in self.objectives]
        constraints = list(self._constraints(squares, None))
        cost = 0.0
        for o, v, unit in zip(self.objectives, squares, self.units, strict=True):
            if o.bound is not None:
                constraints.append(v <= (o.bound * unit) ** 2)
            if o.soft > 0:
                cost = cost + o.soft / unit**2 * v
        word, value = _solve(cp.Problem(cp.Minimize(cost), constraints), solver)
        attempts.append(Attempt("least sum of gains", 0.0, word, value))
        if squares[0].value is None or not math.isfinite(value):
            return None
        return [
            math.sqrt(max(float(np.asarray(v.value)), 0.0)) / unit
            for v, unit in zip(squares, self.units, strict=True)
        ]

    def settled(self, values: Sequence[float], solver: Solver, attempts: list[Attempt]) -> Any:
        """For these gains the X and Y whose product stays farthest from one: their gains at p."""
        import cvxpy as cp

        fixed = [(v * unit) ** 2 for v, unit in zip(values, self.units, strict=True)]
        apart = cp.Variable()
        word, value = _solve(
            cp.Problem(cp.Maximize(apart), list(self._constraints(fixed, apart))), solver
        )
        attempts += [
            Attempt(f"{type(o).__name__} settled", 0.0, word, v)
            for o, v in zip(self.objectives, values, strict=True)
        ]
        if not math.isfinite(value) or value <= 1.0:
            return None

        def gains(p: Array) -> Any:
            at, q = self.coordinates.at(p), p[:, 0] if p.shape[1] == 1 else p
            X, Y = (_value(self.basis[k](q), v) for k, v in (("X", self.X), ("Y", self.Y)))
            K = Transformed(
                *(_value(self.basis["K"](q), v) for v in (self.A, self.B, self.C, self.D))
            )
            return packed(controller(at, X, Y, K, constant_x=not any(used(self.basis["X"]))))

        return gains

    def _constraints(self, bounds: Sequence[Any], apart: Any) -> Iterator[Any]:
        import cvxpy as cp

        one = np.eye(self.n)
        widest = LARGEST if apart is None else WIDE
        slacks: list[Any] = []
        for o, (_, rows) in zip(self.objectives, self.channels, strict=True):
            slacks.append(
                cp.Variable((len(rows), len(rows)), symmetric=True) if isinstance(o, H2) else None
            )
        for cell in self.cells:
            plants = self.coordinates.at(cell.nodes)
            each = [Generalized(*(M[k] for M in plants)) for k in range(len(cell.nodes))]
            loops = [self._loop(each[k], cell.nodes[k]) for k in range(len(each))]
            coupled = [self._coupled(q, 1.0 if apart is None else apart) for q in cell.nodes]
            yield from _positive(cell, coupled)
            for name, unknowns in (("X", self.X), ("Y", self.Y)):
                yield from _positive(
                    cell, [widest * one - self._sum(name, unknowns, q) for q in cell.nodes]
                )
            for o, (columns, rows), bound, slack, size in zip(
                self.objectives, self.channels, bounds, slacks, self.sizes, strict=True
            ):
                parts = [
                    loop._replace(
                        B=loop.B[:, columns],
                        C=loop.C[rows] / size,
                        D=loop.D[rows][:, columns] / size,
                    )
                    for loop in loops
                ]
                yield from self._objective(cell, o, parts, bound, slack)
            if self.region is not None:
                for F in _region(self.region, loops):
                    yield from _positive(cell, [-f for f in F])
        for slack, bound in zip(slacks, bounds, strict=True):
            if slack is not None:
                yield cp.trace(slack) <= bound

    def _objective(
        self, cell: Cell, o: Objective, loops: Sequence[_Loop], bound: Any, slack: Any
    ) -> Iterator[Any]:
        import cvxpy as cp

        w, z = loops[0].B.shape[1], loops[0].C.shape[0]
        if isinstance(o, L2):
            for drift in self._drifts(cell):
                yield from _positive(
                    cell,
                    [
                        -self._bounded_real(loop, d, np.eye(w), bound * np.eye(z))
                        for loop, d in zip(loops, drift, strict=True)
                    ],
                )
            return
        for drift in self._drifts(cell):
            yield from _positive(
                cell,
                [
                    -self._bounded_real(loop, d, np.eye(w), None)
                    for loop, d in zip(loops, drift, strict=True)
                ],
            )
        top = bound * np.eye(z) if slack is None else slack
        if self.coordinates.dt is None:
            yield from _positive(
                cell, [cp.bmat([[loop.P, loop.C.T], [loop.C, top]]) for loop in loops]
            )
            yield from (loop.D == 0 for loop in loops if not _is_zero(loop.D))
        else:
            yield from _positive(
                cell,
                [
                    cp.bmat(
                        [
                            [loop.P, np.zeros((2 * self.n, w)), loop.C.T],
                            [np.zeros((w, 2 * self.n)), np.eye(w), loop.D.T],
                            [loop.C, loop.D, top],
                        ]
                    )
                    for loop in loops
                ],
            )

    def _bounded_real(self, loop: _Loop, drift: Any, gw: Any, gz: Any) -> Any:
        import cvxpy as cp

        w, N = gw.shape[0], 2 * self.n
        if self.coordinates.dt is None:
            F = [[loop.A + loop.A.T + drift, loop.B], [loop.B.T, -gw]]
            if gz is not None:
                F = [[*F[0], loop.C.T], [*F[1], loop.D.T], [loop.C, loop.D, -gz]]
        else:
            F = [
                [-loop.P, loop.A, loop.B],
                [loop.A.T, -loop.P, np.zeros((N, w))],
                [loop.B.T, np.zeros((w, N)), -gw],
            ]
            if gz is not None:
                zero = np.zeros((gz.shape[0], N))
                F = [
                    [*F[0], zero.T],
                    [*F[1], loop.C.T],
                    [*F[2], loop.D.T],
                    [zero, loop.C, loop.D, -gz],
                ]
        return cp.bmat(F)

    def _drifts(self, cell: Cell) -> Iterator[list[Any]]:
        """What the motion of p adds to the block of the state, at every node."""
        import cvxpy as cp

        n, parameters = self.n, self.plant.parameters
        moving = [a or b for a, b in zip(used(self.basis["X"]), used(self.basis["Y"]), strict=True)]
        if self.coordinates.dt is not None or not any(moving):
            yield [np.zeros((2 * n, 2 * n))] * len(cell.nodes)
            return
        for motion in motions(parameters, cell.nodes, self.coordinates.time, moving):
            out = []
            for q, v in zip(cell.nodes, motion, strict=True):
                dX, dY = (self._slope(k, u, q, v) for k, u in (("X", self.X), ("Y", self.Y)))
                out.append(cp.bmat([[-dY, np.zeros((n, n))], [np.zeros((n, n)), dX]]))
            yield out

    def _loop(self, plant: Generalized, q: Array) -> _Loop:
        import cvxpy as cp

        A, B1, B2, C1, C2, D11, D12, D21, _ = plant
        X, Y = self._sum("X", self.X, q), self._sum("Y", self.Y, q)
        At, Bt, Ct, D = (self._sum("K", v, q) for v in (self.A, self.B, self.C, self.D))
        return _Loop(
            cp.bmat([[A @ Y + B2 @ Ct, A + B2 @ D @ C2], [At, X @ A + Bt @ C2]]),
            cp.bmat([[Y, np.eye(self.n)], [np.eye(self.n), X]]),
            cp.vstack([B1 + B2 @ D @ D21, X @ B1 + Bt @ D21]),
            cp.hstack([C1 @ Y + D12 @ Ct, C1 + D12 @ D @ C2]),
            D11 + D12 @ D @ D21,
        )

    def _coupled(self, q: Array, apart: Any) -> Any:
        import cvxpy as cp

        one = apart * np.eye(self.n)
        return cp.bmat([[self._sum("Y", self.Y, q), one], [one, self._sum("X", self.X, q)]])

    def _sum(self, name: str, unknowns: Sequence[Any], q: Array) -> Any:
        f = self.basis[name](q[0] if len(q) == 1 else q)
        return sum((float(w) * v for w, v in zip(f, unknowns, strict=True)), 0.0 * unknowns[0])

    def _slope(self, name: str, unknowns: Sequence[Any], q: Array, motion: Array) -> Any:
        if len(unknowns) == 1:
            return np.zeros((self.n, self.n))
        f = self.basis[name].gradient(q[0] if len(q) == 1 else q)
        along = motion @ f
        return sum((float(w) * v for w, v in zip(along, unknowns, strict=True)), 0.0 * unknowns[0])


def _region(region: PoleRegion, loops: Sequence[_Loop]) -> Iterator[list[Any]]:
    """The inequalities of a region (Chilali and Gahinet 1996), each at every node."""
    import cvxpy as cp

    if region.decay > 0:
        yield [loop.A + loop.A.T + 2 * region.decay * loop.P for loop in loops]
    if math.isfinite(region.radius):
        r = region.radius
        yield [cp.bmat([[-r * loop.P, loop.A], [loop.A.T, -r * loop.P]]) for loop in loops]
    if region.damping > 0:
        s, c = region.damping, math.sqrt(1 - region.damping**2)
        out = []
        for loop in loops:
            along, across = c * (loop.A + loop.A.T), s * (loop.A - loop.A.T)
            out.append(cp.bmat([[along, across], [across.T, along]]))
        yield out


def _positive(cell: Cell, F: Sequence[Any]) -> Iterator[Any]:
    """F(p) >= margin on the cell, by its Bernstein coefficients."""
    n = F[0].shape[0]
    for row in cell.to_bernstein:
        total: Any = sum((float(t) * f for t, f in zip(row, F, strict=True)), np.zeros((n, n)))
        yield 0.5 * (total + total.T) >> MARGIN * np.eye(n)


def _solve(problem: Any, solver: Solver) -> tuple[str, float]:
    from cvxpy.error import SolverError as CvxpyError

    try:
        with warnings.catch_warnings(), no_panic():
            warnings.simplefilter("ignore", UserWarning)  # the status says that it is inaccurate
            problem.solve(solver=solver.name, **solver.options)
    except (CvxpyError, SolverError) as error:
        return str(error), math.inf
    solved = problem.status in ("optimal", "optimal_inaccurate")
    return str(problem.status), float(problem.value) if solved else math.inf


def _value(weights: Array, unknowns: Sequence[Any]) -> Array:
    values = np.stack([u if isinstance(u, np.ndarray) else np.asarray(u.value) for u in unknowns])
    return np.tensordot(weights, values, axes=1)


def _in_time(region: PoleRegion, time: float) -> PoleRegion:
    return replace(region, decay=region.decay * time, radius=region.radius * time)


def _places(given: Sequence[str] | None, known: Sequence[str], kind: str) -> list[int]:
    return list(range(len(known))) if given is None else indices(given, known, kind)  # type: ignore[arg-type]


def _is_zero(D: Any) -> bool:
    return isinstance(D, np.ndarray) and not np.any(D)
