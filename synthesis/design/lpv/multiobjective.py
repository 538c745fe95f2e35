"""Output feedback for several objectives at once, in the variables of Scherer, Gahinet and Chilali.

One X and one Y serve all objectives, which is what makes the problem convex and each bound larger
than it need be. Every inequality is written as in the paper and imposed by Bernstein coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.rates import Rate, limits
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.fitted import fitted, in_plant_units
from synthesis.design.lpv.objectives import H2, L2, EnergyToPeak, Objective, PoleRegion
from synthesis.design.lpv.recovery import Transformed, controller
from synthesis.design.lpv.scaled_plant import degrees_of, scaled_plant_of
from synthesis.design.lpv.search import ACCURACY
from synthesis.design.lpv.search import BACK_OFF as BACK_OFFS
from synthesis.design.lpv.variance import least_variance, separable
from synthesis.design.plant.generalized import Generalized, blocks
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import failed, levels_above, require_channels
from synthesis.numerics.program.affine_program import (
    AffineProgram,
    BernsteinCell,
    MatrixVariable,
    cells,
    from_lower,
)
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.bases import Dependence, functions, limited, used
from synthesis.numerics.program.cone_program import Solver, general_solver

BACK_OFF = 1.02
"""Factor by which every bound is relaxed before X and Y are fixed."""
UNIT_RATIO = 3.0
"""Ratio of a gain to its unit in the program beyond which the program is solved again in other
units.
"""
MAX_UNIT_CHANGES = 3
"""Largest number of changes of units."""
MATRIX_BOUND, SETTLED_BOUND = 1e5, 1e3
"""X and Y are kept below this multiple of the identity, in scaled coordinates: while gains are
minimised, and once they are fixed.
"""
ONE = np.eye(1)


@with_one_thread
def multiobjective(
    plant: Plant,
    objectives: Objective | Sequence[Objective],
    rate: Rate = None,
    *,
    region: PoleRegion | None = None,
    X: Dependence | None = None,
    Y: Dependence | None = None,
    gains: Dependence | None = None,
    direct: bool = True,
    back_off: float = BACK_OFF,
    solver: Solver | str = "CLARABEL",
) -> Controller:
    """Design a dynamic controller that minimises a weighted sum of squared gains within hard
    bounds.

    `H2()` alone, of a continuous plant in which every control costs, every measurement is disturbed
    and no disturbance is felt directly, separates into a state feedback and a filter: X and Y may
    both depend on p, and what is promised is the mean power in white noise, see
    `synthesis.h2_gain`.

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
    X, Y : int, tuple or FunctionSpace, optional
        Degrees in the parameters, 0 by default; only one of them may depend on a parameter that
        moves. Of `H2()` alone both may; by default their degree rises while that lowers gamma.
    gains : int, tuple or FunctionSpace, optional
        Of the controller's own variables; by default the degree of the plant plus that of X and Y.
    direct : bool
        Whether the controller may have feedthrough.
    back_off : float
        By which every gain is loosened before X and Y are settled.
    solver : Solver or str
        For the programs.

    Returns
    -------
    Controller
        `gamma` is the root of the weighted sum of the gains as they are settled, `back_off` in
        them, and `optimum` the least without it; one by one they are in `attempts`.

    Raises
    ------
    InputError, SynthesisError
        As `output_feedback`; also where the bounds contradict each other.

    See Also
    --------
    synthesis.objectives.L2 : a gain as an objective
    synthesis.objectives.H2 : a variance as an objective
    synthesis.output_feedback : a controller of the order of the plant

    References
    ----------
    Scherer, Gahinet and Chilali, IEEE Trans. Automatic Control 42 (1997); with X(p) or Y(p):
    Apkarian and Adams (1998). `H2()` alone: Wu, Ph.D. thesis, Berkeley (1995).

    Examples
    --------
    >>> from synthesis.objectives import H2, L2, PoleRegion
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
    (factor,) = levels_above(float(back_off))
    alone = every == (H2(weight=every[0].weight),) and region is None and gains is None
    if alone and every[0].soft > 0 and separable(plant):
        return least_variance(plant, X, Y, (factor, *BACK_OFFS))
    X, Y = X or 0, Y or 0
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
    solver = general_solver(solver)
    problem = _Problem(plant, bases[0], bases[1], gains, every, region, direct)
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
    made = in_plant_units(plant, problem.scaled, fit, total, f"output feedback for {words}")
    return replace(made, optimum=least, attempts=tuple(attempts))


class _LoopInNewVariables(NamedTuple):
    """The closed loop in the new variables, as arrays of an `AffineProgram`."""

    A: Array
    P: Array
    B: Array
    C: Array
    D: Array


class _Unknowns(NamedTuple):
    """The variables: X, Y, those of the controller, and each squared gain or, where gains are
    given, the separation of X Y from I.
    """

    X: MatrixVariable
    Y: MatrixVariable
    K: tuple[MatrixVariable, ...]
    scalars: tuple[MatrixVariable, ...]


class _Problem:
    """The inequalities of a plant and its objectives."""

    def __init__(
        self,
        plant: Plant,
        X: FunctionSpace,
        Y: FunctionSpace,
        gains: Dependence | None,
        objectives: Sequence[Objective],
        region: PoleRegion | None,
        direct: bool,
    ):
        self.X, self.Y, self.objectives, self.direct = X, Y, objectives, direct
        self.scaled = scaled_plant_of(plant, 1.0)
        time = self.scaled.time
        self.region = region and replace(
            region, decay=region.decay * time, radius=region.radius * time
        )
        # energies and variances are per unit of time
        self.pace = [1.0 if isinstance(o, L2) else math.sqrt(time) for o in objectives]
        self.sizes = [o.bound or 1.0 for o in objectives]
        """Sizes of the gains in the scaled loop: outputs are measured in them."""
        m, breaks = len(plant.parameters), self.scaled.breaks
        own = degrees_of(lambda p: list(self.scaled.at(p)), breaks)
        most = np.maximum(*(np.array(b.degrees or (4,) * m) for b in (X, Y)))
        given = tuple(int(d) for d in np.array(own) + most) if gains is None else gains
        self.K = functions(given, plant.parameters, "gains")
        self.constant = functions(0, plant.parameters, "a number")
        degrees = np.array(own) + np.maximum(most, self.K.degrees or (4,) * m)
        self.cells = cells(breaks, [int(d) for d in degrees])
        self.moving = [a or b for a, b in zip(used(X), used(Y), strict=True)]
        self.channels = [
            (
                _places(o.disturbances, plant.disturbances, "disturbance"),
                _places(o.performance, plant.performance, "performance signal"),
            )
            for o in objectives
        ]

    @property
    def units(self) -> list[float]:
        """Units of all gains of the plant in the program."""
        return [pace / size for pace, size in zip(self.pace, self.sizes, strict=True)]

    def best(self, solver: Solver, attempts: list[Attempt]) -> list[float] | None:
        """Minimise the gains, again in units of the gains found while these are far from
        the first.
        """
        values = self.least(solver, attempts)
        for _ in range(MAX_UNIT_CHANGES):
            if values is None:
                break
            sizes = [max(v * pace, 1e-9) for v, pace in zip(values, self.pace, strict=True)]
            if all(
                1 / UNIT_RATIO < a / b < UNIT_RATIO for a, b in zip(sizes, self.sizes, strict=True)
            ):
                break
            self.sizes = sizes
            values = self.least(solver, attempts) or values
        return values

    def least(self, solver: Solver, attempts: list[Attempt]) -> list[float] | None:
        """Return the gains that minimise the sum; None where there are none."""
        program, unknowns = self._program(None)
        cost, cell = np.zeros(program.count), self.cells[0]
        squares = [int(v.columns.item()) for v in unknowns.scalars]
        for o, v, column, unit in zip(
            self.objectives, unknowns.scalars, squares, self.units, strict=True
        ):
            square = program.value(v)
            program.nonnegative(cell, square)
            if o.bound is not None:
                bound = program.known((o.bound * unit) ** 2 * ONE)
                program.nonnegative(cell, bound - square, f"the bound of {_words(o)}")
            cost[column] = o.soft / unit**2
        found = program.minimise(cost, solver)
        value = math.inf if found.x is None else float(cost @ found.x)
        attempts.append(Attempt("least sum of gains", 0.0, program.said(found), value))
        if found.x is None or found.answer is not Answer.SOLVED:
            return None
        values = np.sqrt(np.maximum(found.x[squares], 0.0)) / self.units
        return [float(v) for v in values]

    def settled(
        self, values: Sequence[float], solver: Solver, attempts: list[Attempt]
    ) -> Callable[[Array], Array] | None:
        """Return, for these gains, the X and Y whose product is farthest from the identity: their
        controller gains at p.
        """
        program, unknowns = self._program(
            [(v * unit) ** 2 for v, unit in zip(values, self.units, strict=True)]
        )
        cost, apart = np.zeros(program.count), int(unknowns.scalars[0].columns.item())
        cost[apart] = -1.0
        found = program.minimise(cost, solver)
        attempts += [
            Attempt(f"{type(o).__name__} settled", 0.0, found.message, v)
            for o, v in zip(self.objectives, values, strict=True)
        ]
        x = found.x
        if x is None or found.answer is not Answer.SOLVED or x[apart] <= 1.0:
            return None

        def gains(p: Array) -> Array:
            X, Y = unknowns.X.at(x, p), unknowns.Y.at(x, p)
            K = Transformed(*(v.at(x, p) for v in unknowns.K))
            return controller(self.scaled.at(p), X, Y, K, constant_x=self.X.size == 1).packed

        return gains

    def _program(self, squares: Sequence[float] | None) -> tuple[AffineProgram, _Unknowns]:
        """Return the inequalities for unknown gains, or for these, squared and in units of the
        program.
        """
        program = AffineProgram()
        plant = self.scaled.at(self.cells[0].nodes)
        n, nu, ny = plant.A.shape[-1], plant.B2.shape[-1], plant.C2.shape[-2]
        shapes = (n, n), (n, ny), (nu, n)
        K = [program.full(*shape, self.K) for shape in shapes]
        count = len(self.objectives) if squares is None else 1
        D = np.eye(nu * ny if self.direct else 0, nu * ny).reshape(-1, nu, ny)
        unknowns = _Unknowns(
            program.symmetric(n, self.X),
            program.symmetric(n, self.Y),
            (*K, program.variable(D, self.K)),
            tuple(program.full(1, 1, self.constant) for _ in range(count)),
        )
        slacks = [
            program.symmetric(len(rows), self.constant) if isinstance(o, H2) else None
            for o, (_, rows) in zip(self.objectives, self.channels, strict=True)
        ]
        each = [program.value(v) for v in unknowns.scalars]
        if squares is None:
            bounds, apart, widest = each, program.known(ONE), MATRIX_BOUND
        else:
            bounds = [program.known(s * ONE) for s in squares]
            (apart,), widest = each, SETTLED_BOUND
        X, Y = program.value(unknowns.X), program.value(unknowns.Y)
        one = np.eye(n)
        for cell in self.cells:
            loop = self._loop(program, self.scaled.at(cell.nodes), unknowns)
            program.positive(cell, from_lower([[Y], [apart * one, X]]), name="Y >= X^-1")
            for M in (X, Y):
                size = program.known(widest * one) - M
                program.positive(cell, size, name="largest X and Y")
            for o, (columns, rows), bound, slack, size in zip(
                self.objectives, self.channels, bounds, slacks, self.sizes, strict=True
            ):
                part = loop._replace(
                    B=loop.B[..., columns],
                    C=loop.C[..., rows, :] / size,
                    D=loop.D[..., rows, :][..., columns] / size,
                )
                top = bound * np.eye(len(rows)) if slack is None else program.value(slack)
                self._objective(program, cell, o, part, unknowns, top)
            for F in () if self.region is None else _region(self.region, loop):
                program.positive(cell, -F, name="the region of poles")
        for slack, bound in zip(slacks, bounds, strict=True):
            if slack is not None:
                trace = np.trace(program.value(slack), axis1=-2, axis2=-1)[..., None, None]
                program.nonnegative(self.cells[0], bound - trace, "the trace of a variance")
        return program, unknowns

    def _objective(
        self,
        program: AffineProgram,
        cell: BernsteinCell,
        o: Objective,
        loop: _LoopInNewVariables,
        unknowns: _Unknowns,
        top: Array,
    ) -> None:
        """Impose the inequalities of an objective: of a gain, or of a variance and its outputs."""
        one = program.known(np.eye(loop.B.shape[-1]))
        sampled = self.scaled.dt is not None
        gain = isinstance(o, L2)
        if sampled:
            F = [[-loop.P], [loop.A.mT, -loop.P], [loop.B.mT, None, -one]]
            rows = [*F, [None, loop.C, loop.D, -top]] if gain else F
            program.positive(cell, -from_lower(rows), name=_words(o))
        else:
            zero = np.zeros((program.values, 1, *unknowns.X.entries.shape[1:]))
            drift = from_lower([[-program.slope(unknowns.Y)], [zero, program.slope(unknowns.X)]])
            F = [[loop.A + loop.A.mT + drift], [loop.B.mT, -one]]
            rows = [*F, [loop.C, loop.D, -top]] if gain else F
            for motion in self.scaled.motions(cell.nodes, self.moving):
                program.positive(cell, -from_lower(rows), motion, _words(o))
        if not gain:
            seen = [[loop.P], [None, one], [loop.C, loop.D, top]]
            outputs = from_lower(seen if sampled else [[loop.P], [loop.C, top]])
            program.positive(cell, outputs, name=_words(o))
            if not sampled:
                program.zero(cell, loop.D)

    def _loop(
        self, program: AffineProgram, plant: Generalized, unknowns: _Unknowns
    ) -> _LoopInNewVariables:
        _, B1, B2, C1, C2, D11, D12, D21, _ = plant
        X, Y = program.value(unknowns.X), program.value(unknowns.Y)
        At, Bt, Ct, D = (program.value(v) for v in unknowns.K)
        A = program.known(plant.A)
        corner = program.known(np.eye(plant.A.shape[-1]))
        return _LoopInNewVariables(
            blocks([[plant.A @ Y + B2 @ Ct, A + B2 @ D @ C2], [At, X @ plant.A + Bt @ C2]]),
            from_lower([[Y], [corner, X]]),
            blocks([[program.known(B1) + B2 @ D @ D21], [X @ B1 + Bt @ D21]]),
            blocks([[C1 @ Y + D12 @ Ct, program.known(C1) + D12 @ D @ C2]]),
            program.known(D11) + D12 @ D @ D21,
        )


def _region(region: PoleRegion, loop: _LoopInNewVariables) -> Iterator[Array]:
    """Yield the inequalities of a pole region (Chilali and Gahinet 1996)."""
    A, P = loop.A, loop.P
    if region.decay > 0:
        yield A + A.mT + 2 * region.decay * P
    if math.isfinite(region.radius):
        yield from_lower([[-region.radius * P], [A.mT, -region.radius * P]])
    if region.damping > 0:
        s, c = region.damping, math.sqrt(1 - region.damping**2)
        along, across = c * (A + A.mT), s * (A - A.mT)
        yield from_lower([[along], [across.mT, along]])


def _words(o: Objective) -> str:
    """Name of an objective in messages."""
    between = f" of {', '.join(o.performance)}" if o.performance else ""
    return f"{type(o).__name__}{between}"


def _places(given: Sequence[str] | None, known: Sequence[str], kind: str) -> list[int]:
    return list(range(len(known))) if given is None else indices(given, known, kind)  # type: ignore[arg-type]
