"""Design of a structured controller: the least largest gain over flight conditions and
specifications.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from symheli import LFT, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError, SynthesisError
from symheli.lpv.bases.polynomials import lobatto_points
from symheli.progress import task
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.objectives import L2
from synthesis.design.lpv.point_schedule import hinf_at
from synthesis.design.lpv.search import check_points
from synthesis.design.lpv.worst_optimum import worst_optimum
from synthesis.design.plant.diagnosis import modes_out_of_reach, unpriced
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import conditions, require_channels
from synthesis.design.tuning.descent import (
    STANDSTILL,
    Point,
    Stationarity,
    bfgs,
    sampled_descent,
)
from synthesis.design.tuning.peaks import Active, Value
from synthesis.numerics.linear.norm import norm
from synthesis.structures.loops import StructureLoops
from synthesis.structures.structure import TunableController

POINTS = {1: 9, 2: 4}
"""Conditions of each parameter at first (more parameters: 3)."""
MOST_CORNERS = 16
"""Corners of constant parameters that are all taken at first."""
STABILISING, SHORT, LONG = 300, 100, 1500
"""Steps of BFGS at most: on the pole, on the gain from every start, and from the best of those."""
SCHEDULED_STANDSTILL = 1e-6
"""`STANDSTILL` of BFGS over several conditions. Where one of them decides, a finer search only
moves the gains at the others, and the gain while p moves with them.
"""
ROOM = 2e-3
"""Fraction of the least largest gain that is given for the gains at the other conditions."""
ASIDE = 1e-4
"""Share of the way to gains well within their bounds at which it begins."""
SETTLING, SETTLED = 200, 1e-5
"""Steps of BFGS at most on the mean gain, and its standstill."""
KEPT = 3
"""So many of the starts are continued."""
ROUNDS = 5
"""How often conditions are added where the gain between is larger."""
BETWEEN = 1e-3
"""Relative excess of a gain between the conditions that counts as none."""
SPREAD = 1.0
"""Standard deviation of a start around the first, in units of the gains."""
SMALL_NOISE = 1e-4
"""Noise on a measurement that has none, in the optimum of all controllers: without, the Riccati
equations cannot be written.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuredController(Controller):
    """A controller of a given structure, with its gains.

    `promised` is the largest gain of the frozen loops over all channels, at values of the
    parameters as dense as those at which the search was checked; `optimum` the worst optimum of
    frozen models over controllers of every order, which none of a structure undercuts.

    Attributes
    ----------
    structure : Structure
        The gains that were free.
    gains : mapping of str to (n,) array
        Coefficients of every gain in the basis of the structure.
    specifications : tuple of L2
        The requirements.
    reached : tuple of float
        The largest frozen gain of each, as a ratio to its bound.
    stationarity : Stationarity
        How nearly the largest gain was at a local minimum, before the mean gain was lowered.
    starts : tuple of float
        Largest ratio reached from every start in its first steps; inf where none stabilised.

    Examples
    --------
    >>> pi = synthesis.structures.TunableController.pid(
    ...     plant, {("u", "y"): "PI"}, bounds={"": (-20.0, 0.0)})
    >>> made = synthesis.structured(plant, pi, starts=2)
    >>> print(made.structure.numbers, made.order, made.certify(search=None).verified)
    2 1 True
    >>> print(made.gain("u_y_P", 0.5).shape)
    ()
    """

    structure: TunableController
    gains: Mapping[str, Array]
    specifications: tuple[L2, ...]
    reached: tuple[float, ...]
    stationarity: Stationarity
    starts: tuple[float, ...] = field(default=())

    __repr__ = summarized

    def gain(self, name: str, p: Any) -> Array:
        """Return a gain at p: (K,) values, or one, of the one parameter; of m parameters (K, m),
        or one point (m,).
        """
        own = self.structure.coefficients(self.gains)[name]
        basis, m = self.structure.basis, len(self.plant.parameters)
        points = np.asarray(p, float)
        if basis is None or len(own) < basis.size:
            return np.full(np.shape(points)[: np.ndim(points) - (m > 1)], own[0])
        return np.asarray(basis(points) @ own)

    def on(self, specification: int) -> Controller:
        """Return the controller on the plant with the channels of one specification alone, to
        certify that.
        """
        one = self.specifications[specification]
        z, w = one.performance, one.disturbances
        of = self.plant
        plant = replace(
            of,
            performance=of.performance if z is None else tuple(z),
            disturbances=of.disturbances if w is None else tuple(w),
        )
        return Controller(
            model=self.model,
            plant=plant,
            promised=self.reached[specification] * (one.bound or 1.0),
            method=self.method,
        )

    def __str__(self) -> str:
        lines = [super().__str__()]
        if self.optimum:
            more = 100 * (self.promised / self.optimum - 1)
            lines.append(
                f"  {more:.3g} % above the optimum of controllers of every order at frozen p"
            )
        worst = ", ".join(f"{r:.6g}" for r in self.reached)
        measure, radius = self.stationarity
        lines.append(f"  largest gains of the specifications, over their bounds: {worst}")
        each = ", ".join(f"{v:.5g}" for v in self.starts)
        lines.append(f"  stationary to {measure:.1e} within {radius:.0e}; starts reached {each}")
        lines.append(f"  {self.structure.numbers} numbers are the gains:")
        box = self.plant.box
        p = [low for low, _ in box], [0.5 * sum(ends) for ends in box], [high for _, high in box]
        for gain in self.structure.gains:
            one = self.structure.numbers_of(gain) == 1
            each = [float(self.gain(gain.name, q[0] if len(q) == 1 else q)) for q in p]
            values = f"{each[0]:.5g}" if one else " ".join(f"{v:.5g}" for v in each)
            lines.append(f"    {gain.name} {values}" + ("" if one else " (low, middle, high)"))
        return "\n".join(lines)


@with_one_thread
def structured(
    plant: Plant,
    structure: TunableController,
    specifications: L2 | Sequence[L2] = (),
    *,
    start: Mapping[str, float | Array] | None = None,
    units: Mapping[str, float] | None = None,
    decay: float = 0.0,
    starts: int = 8,
    seed: int = 0,
) -> StructuredController:
    """Tune the gains of a structure: the largest H-infinity norm over conditions and specifications
    becomes as small as descent makes it.

    From every start the largest real part of a pole is lowered until every loop is stable, then the
    largest gain, by BFGS along the slope of the peak that decides; the best are continued, and the
    best of those by gradient sampling, whose measure says how nearly it is a local minimum. Where
    the gain between the conditions is larger, conditions are added. Of several conditions of a
    parameter that moves the mean gain is lowered at last, with the largest within .2 % of that
    minimum. A local minimum is not
    the least gain of the structure: more `starts` may find less.

    Ctrl-C ends the search; where some loop was stable by then the best is returned, and a note says
    so.

    Parameters
    ----------
    plant : Plant
        Continuous or sampled; of one that is sampled the structure is too. Of an LFT the parameters
        are constant: the gain is lowered over its corners, its middle and the worst values found.
    structure : Structure
        With the gains that are free.
    specifications : L2 or sequence of L2
        Channels, each with its bound (1 where there is none): the largest ratio of gain to bound is
        minimised. Default: all channels together.
    start : mapping of str to float or (n,) array, optional
        {gain: first value, or coefficients}, such as gains tuned by hand; default 0, or a value
        within the bounds.
    units : mapping of str to float, optional
        About how large a gain is; default half the width of its bounds, its first value, or 1.
    decay : float
        Every pole of a loop at a condition is to have a real part of at most minus this, 1/s (of
        sampled loops log|z| over the period): keeps modes that the channels hardly show, such as
        integrators, from the border of stability, where descent ends.
    starts : int
        The first, and so many less one random ones around it, one unit away.
    seed : int
        Of the random starts and samples: the same seed, the same gains.

    Returns
    -------
    StructuredController
        Nothing is proven of it: `certify` proves, between the conditions and while p moves; of an
        LFT where p may jump, and `synthesis.robust.worst_case_gain` of `closed()` where it is
        constant.

    Raises
    ------
    InputError
        A plant that is uncertain, a structure of another sample period or basis, a specification
        that is not an L2 gain with the default weight; a loop whose feedthrough depends on the
        parameters.
    UnknownNameError
        A signal or gain that is not there.
    SynthesisError
        No start leads to loops that are stable at all conditions; `reasons` say whether any
        controller does.

    See Also
    --------
    synthesis.structures.TunableController : a structure with free gains
    synthesis.hinf : least worst-case gain of one model

    References
    ----------
    Burke, Henrion, Lewis and Overton, IFAC Proceedings 39 (2006), for the problem; Lewis and
    Overton, Mathematical Programming 141 (2013), for BFGS; Burke, Lewis and Overton, SIAM J.
    Optimization 15 (2005), for gradient sampling.

    Examples
    --------
    x' = u + w, z = (x, u), u = k x: the gain from w is sqrt(1 + k^2)/|k|, 1 for infinite k, and
    with |k| <= 2 it is sqrt(5)/2.

    >>> import symheli
    >>> model = symheli.LinearModel(
    ...     [[0.0]], [[1.0, 1.0]], [[1.0], [0.0], [1.0]], [[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
    ...     ["x"], ["w", "u"], ["z_x", "z_u", "y"])
    >>> unstable = synthesis.Plant(model, ["w"], ["z_x", "z_u"], ["u"], ["y"])
    >>> k = synthesis.structures.TunableController.pid(unstable, bounds={"": (-2.0, 2.0)})
    >>> made = synthesis.structured(unstable, k, starts=1)
    >>> print(made.gains["u_y_P"].round(4), round(made.promised, 5))
    [-2.] 1.11803
    """
    count = whole(starts, "starts", 1)
    if not 0 <= decay < math.inf:
        raise InputError(f"decay: expected a finite number >= 0, got {decay!r}")
    search = _StructureSearch.of(plant, structure, specifications, start, units, decay, count)
    notes: list[str] = []
    rng = np.random.default_rng(whole(seed, "seed"))
    try:
        search.run(rng)
    except KeyboardInterrupt:
        if search.best is None:
            raise
        notes.append("the search was interrupted: the best so far")
    if search.best is None:
        raise search.failed()
    return search.result(notes)


class _StructureSearch:
    """The state of a search, kept so that an interrupted one has a result."""

    def __init__(
        self,
        plant: Plant,
        structure: TunableController,
        wanted: tuple[L2, ...],
        first: Array,
        units: Array,
        decay: float,
        starts: int,
    ):
        self.plant, self.structure, self.wanted, self.decay = plant, structure, wanted, decay
        self.first, self.units, self.starts = first, units, starts
        rational = isinstance(plant.model, LFT)
        varies = rational or plant.basis.size > 1 or structure.basis is not None
        self.points = _first_conditions(plant.box, varies, rational)
        self.standstill = SCHEDULED_STANDSTILL if varies else STANDSTILL
        self.between = check_points(plant.parameters) if varies else self.points
        inside = {gain.name: gain.inside for gain in structure.gains}
        self.inside = np.concatenate([*structure.coefficients(inside).values()]) / units
        self.loops = self._loops(self.points)
        self.known: Active | None = None
        self.best: Point | None = None
        self.poles: list[float] = []
        self.reached: list[float] = []
        self.stationarity = Stationarity(math.nan, math.nan)

    @classmethod
    def of(
        cls,
        plant: Plant,
        structure: TunableController,
        specifications: L2 | Sequence[L2],
        start: Mapping[str, float | Array] | None,
        units: Mapping[str, float] | None,
        decay: float,
        starts: int,
    ) -> _StructureSearch:
        """Check what was given."""
        require_plant(plant)
        require_channels(plant, states=False)
        if isinstance(plant.model, UncertainStateSpace):
            raise InputError(
                "structured: the plant is uncertain; tune for its nominal model, and certify the"
                " gain of the uncertain loop"
            )
        if not isinstance(structure, TunableController):
            raise InputError(
                "structure: expected a synthesis.structures.TunableController, such as"
                " synthesis.structures.TunableController.pid(plant), got"
                f" {type(structure).__name__}"
            )
        given = (specifications,) if isinstance(specifications, L2) else tuple(specifications)
        for one in given:
            if not isinstance(one, L2) or one.weight is not None:
                raise InputError(
                    "specifications: expected synthesis.objectives.L2(...) with a bound and without"
                    f" a weight, got {one!r:.80}"
                )
        if structure.order and structure.frame.dt != plant.dt:
            raise InputError(
                f"structure: its sample period is {structure.frame.dt} s, the plant's"
                f" {plant.dt} s; make it for this plant"
            )
        basis = structure.basis
        if basis is not None and isinstance(plant.model, LFT):
            raise InputError(
                "structure: the parameters of an LFT are constant and not known; its gains are"
                " numbers, leave out the basis"
            )
        if basis is not None and basis.ranges != plant.box:
            raise InputError(
                f"structure: its basis is over {basis.ranges}, the plant's parameters range over"
                f" {plant.box}; make them equal"
            )
        inside = {gain.name: gain.inside for gain in structure.gains}
        first = structure.coefficients(inside | dict(start or {}))
        each = []
        for gain in structure.gains:
            width = 0.5 * (gain.high - gain.low)
            size = float(np.abs(first[gain.name]).max()) or 1.0
            usual = width if math.isfinite(width) else size
            each += [float((units or {}).get(gain.name, usual))] * structure.numbers_of(gain)
        if not all(0 < unit < math.inf for unit in each):
            raise InputError(f"units: expected numbers > 0, got {dict(units or {})}")
        unit = np.array(each)
        x = np.concatenate([*first.values()]) / unit
        plant.close(_some(structure, plant))  # refused at once where no loop could be formed
        return cls(plant, structure, given or (L2(),), x, unit, float(decay), starts)

    def _loops(self, points: Array) -> StructureLoops:
        ends = np.cumsum([self.structure.numbers_of(gain) for gain in self.structure.gains])
        units = self.units[ends - 1]
        return StructureLoops.of(
            self.plant, self.structure, points, self.wanted, units, self.between, self.decay
        )

    def function(self, x: Array, limit: float = math.inf) -> Value:
        """The logarithm of the largest gain over its bound, at the conditions; see
        `StructureLoops.gain`.
        """
        value, active = self.loops.gain(x, self.known, limit)
        if math.isfinite(active.gain):
            self.known = active
            if value.value <= limit and (self.best is None or value.value < self.best.value):
                self.best = Point(x, value)
        return value

    def _pole(self, x: Array, _: float = 0.0) -> Value:
        return self.loops.pole(x)

    def run(self, rng: np.random.Generator) -> None:
        """Search from all starts, then between the conditions, then by gradient sampling."""
        found: list[Point] = []
        with task("tuning the gains", self.starts + KEPT + ROUNDS + 1) as progress:

            def said() -> str:
                return "" if self.best is None else f"{math.exp(self.best.value):.5g}"

            for k in range(self.starts):
                x = self.first + SPREAD * (k > 0) * rng.standard_normal(len(self.first))
                stable = self._stabilised(self.loops.within(x, self.inside))
                if stable is None:
                    self.reached.append(math.inf)
                else:
                    found.append(self._descended(stable, SHORT))
                    self.reached.append(math.exp(found[-1].value))
                progress.step(said())
            found.sort(key=lambda point: point.value)
            for point in found[:KEPT]:
                self._descended(point, LONG)
                progress.step(said())
            for _ in range(ROUNDS if self.best is not None else 0):
                if not self._with_worse_conditions():
                    break
                assert self.best is not None  # noqa: S101 - it was not
                self._descended(self.best, LONG)
                progress.step(said())
            if self.best is not None:
                end, self.stationarity = sampled_descent(self.function, self.best, rng)
                self.best = end if end.value <= self.best.value else self.best
                if len(self.points) > 1 and not isinstance(self.plant.model, LFT):
                    self._settle(self.best)

    def _settle(self, best: Point) -> None:
        """Lower the mean gain over the conditions while the largest stays within `ROOM` of the
        least.
        """
        level = best.value + math.log1p(ROOM)

        def mean(x: Array, _: float = 0.0) -> Value:
            return self.loops.mean(x, level)

        # from beside the bounds that it reached, where one slope says nothing
        start = best.x + ASIDE * (self.inside - best.x)
        end = bfgs(mean, Point(start, mean(start)), SETTLING, standstill=SETTLED)
        if end.value < mean(best.x).value:
            self.best = Point(end.x, self.loops.gain(end.x)[0])

    def _descended(self, start: Point, iterations: int) -> Point:
        """The gain after so many steps from a stable point at most."""
        return bfgs(self.function, start, iterations, standstill=self.standstill)

    def _stabilised(self, x: Array) -> Point | None:
        """Return numbers near these with which every loop is stable, None where none are found."""
        point = bfgs(self._pole, Point(x, self._pole(x)), STABILISING, -self.decay, self.standstill)
        value = self.function(point.x)
        self.poles.append(point.value)
        return Point(point.x, value) if math.isfinite(value.value) else None

    def _with_worse_conditions(self) -> bool:
        """Add the condition between the others where the best gains do worst; False where it does
        not do worse there.
        """
        assert self.best is not None  # noqa: S101 - called with one
        if len(self.between) == len(self.points):
            return False
        everywhere = self._loops(self.between)
        _, active = everywhere.gain(self.best.x)
        if active.gain <= math.exp(self.best.value) * (1 + BETWEEN):
            return False
        self.points = np.vstack([self.points, self.between[active.condition]])
        self.loops = self._loops(self.points)
        value, self.known = self.loops.gain(self.best.x)
        stable = Point(self.best.x, value)
        if not math.isfinite(value.value):
            self.known = self.best = None
            found = self._stabilised(stable.x)
            if found is None:
                return False
            stable = found
        self.best = stable
        return True

    def failed(self) -> SynthesisError:
        """The error where no start became stable."""
        p, reasons = conditions(self.plant)
        why = modes_out_of_reach(
            self.plant.matrices(p), self.plant.channels, dt=self.plant.dt, at=reasons
        )
        line = (
            "no start led to gains with which every loop is stable: the largest real part of a"
            f" pole is at best {min(self.poles):.3g} 1/s; give `start` gains that stabilise,"
            " `units` of their size, more `starts`, or a richer structure"
        )
        return SynthesisError("\n  ".join([line, *why]), (line, *why))

    def result(self, notes: list[str]) -> StructuredController:
        """The controller of the best gains, within their bounds."""
        assert self.best is not None  # noqa: S101 - called with one
        x = self.loops.within(self.best.x, self.inside) * self.units
        sizes = [self.structure.numbers_of(gain) for gain in self.structure.gains]
        parts = np.split(x, np.cumsum(sizes)[:-1])
        gains = {g.name: part for g, part in zip(self.structure.gains, parts, strict=True)}
        model = self.structure.controller(gains, self.plant.parameters)
        promised, *reached = _largest(self.plant.close(model), self.between, [L2(), *self.wanted])
        return StructuredController(
            model=model,
            plant=self.plant,
            promised=promised,
            method=f"structured, {self.structure.numbers} numbers",
            optimum=None if notes else self._optimum(notes),
            notes=tuple(notes),
            structure=self.structure,
            gains=gains,
            specifications=self.wanted,
            reached=tuple(reached),
            stationarity=self.stationarity,
            starts=tuple(self.reached),
        )

    def _optimum(self, notes: list[str]) -> float | None:
        """The worst optimum over controllers of every order, None where it is not known."""
        P = self.plant.matrices(conditions(self.plant)[0])
        plant = self.plant
        noiseless = unpriced(np.swapaxes(P.D21, 1, 2), plant.measurements, dual=True)
        if noiseless and isinstance(plant.model, LFT):
            notes.append("the least gain is not known: a measurement has no noise")
            return None
        if noiseless:
            plant = plant.with_noise(dict.fromkeys(plant.measurements, SMALL_NOISE))
            notes.append(f"the least gain is that with noise of {SMALL_NOISE:g} on measurements")
        if len(self.points) > 1:
            return worst_optimum(plant).level or None
        found = hinf_at(plant, self.points[0])
        return found.optimum if found.optimum > 0 else None


def _some(structure: TunableController, plant: Plant) -> LPVStateSpace:
    """Return the structure with gains that are no special ones."""
    numbers = iter(np.random.default_rng(0).uniform(0.1, 0.2, structure.numbers))
    gains = {
        g.name: [next(numbers) for _ in range(structure.numbers_of(g))] for g in structure.gains
    }
    return structure.controller(
        {name: np.array(values) for name, values in gains.items()}, plant.parameters
    )


def _first_conditions(box: Sequence[tuple[float, float]], varies: bool, rational: bool) -> Array:
    """Return the first conditions (K, m): the middle of what does not vary, the corners too of
    constant parameters, points all over the box of those that move.
    """
    m, middle = len(box), np.array([[0.5 * (low + high) for low, high in box]])
    if not varies or (rational and 2**m > MOST_CORNERS):
        return middle
    if rational:
        return np.vstack([middle, lobatto_points(2, box).reshape(-1, m)])
    return lobatto_points(POINTS.get(m, 3), box).reshape(-1, m)


def _largest(loop: Any, points: Array, wanted: Sequence[L2]) -> list[float]:
    """Return for each specification the largest ratio of a frozen gain to its bound, recomputed
    from the closed loop.
    """
    out = []
    for one in wanted:
        own = loop.select(inputs=one.disturbances, outputs=one.performance)
        each = (own.at(*p) for p in points)
        out.append(max(norm(m.A, m.B, m.C, m.D, m.dt)[0] for m in each) / (one.bound or 1.0))
    return out
