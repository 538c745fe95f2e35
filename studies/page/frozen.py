"""From sizes to numbers of frozen loops: point designs at a handful of airspeeds, computed side by
side while sizes are moved. They are no proof.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from studies.controllers.design_choices import SERVO_RATE, DesignChoices
from studies.controllers.judged import NAME, controlled, sheet_of, travel_of
from studies.controllers.plant import design_plant
from studies.controllers.synthesized import Given, model_of, smooth
from studies.processes import Processes
from symheli import LinearModel
from symheli.errors import SymheliError
from symheli.lpv.tools import Actuation
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from synthesis.design.loops.loop_measures import LoopMeasures
from synthesis.design.loops.margins import Margins, margins, open_loop
from synthesis.design.lti.h2 import h2
from synthesis.design.lti.hinf import hinf
from synthesis.sheet.evaluation import SpecificationTable, axis_loops, driven_plant
from synthesis.sheet.measures import MEASURES, AxisLoop
from synthesis.sheet.sheet import Sheet

AIRSPEEDS = 4
UNSTABLE = "sampled behind its servos the loop is unstable"
STEP_WINDOW, GUST_WINDOW = 4.0, 6.0
"""Lengths of the responses to a command and to a disturbance, s."""


class Response(NamedTuple):
    """Times (n,) s and values (n, k)."""

    time: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Point:
    """The models at one airspeed (m/s), which do not move with the sizes: the design plant in the
    sizes of `choices`, and what is controlled, with the actuation before it.
    """

    airspeed: float
    choices: DesignChoices
    design: LinearModel
    bare: LinearModel
    actuation: Actuation
    sheet: Sheet
    travel: Mapping[str, float]

    def sized(self, choices: DesignChoices) -> LinearModel:
        """Return the design plant in other sizes: rows and columns are scaled, nothing else."""
        old, new = scales(self.choices), scales(choices)
        w = len(new.inputs)
        z = len(new.outputs)
        into, out = new.inputs / old.inputs, old.outputs / new.outputs
        B, C, D = (np.array(M) for M in (self.design.B, self.design.C, self.design.D))
        B[:, :w] *= into
        D[:, :w] *= into
        C[:z] *= out[:, None]
        D[:z] *= out[:, None]
        return replace(self.design, B=B, C=C, D=D)

    def loops(self, K: LinearModel) -> dict[str, AxisLoop]:
        """Return the loop of each axis of the sheet with a sampled controller."""
        plant = driven_plant(self.bare, K, self.actuation)
        rates = dict.fromkeys(self.choices.controls, SERVO_RATE)
        return axis_loops(plant, K, self.sheet, self.travel, rates)


@dataclass(frozen=True, eq=False)
class Frozen:
    """A point design at one airspeed (m/s), and what its loop does.

    `method` of the design; `controller`: sampled; None where there is none or its loop is not
    stable, for `failure`. `measures` by axis; `steps`: response and control after a command of 1 by
    axis; `gusts`: size of all deviations and of all commands after a step of each disturbance of
    its size.
    """

    airspeed: float
    method: str = ""
    controller: LinearModel | None = None
    failure: str = ""
    measures: Mapping[str, LoopMeasures] = field(default_factory=dict)
    steps: Mapping[str, Response] = field(default_factory=dict)
    gusts: Mapping[str, Response] = field(default_factory=dict)


class Scales(NamedTuple):
    """Sizes of inputs (w,) and outputs (z,) of a design plant."""

    inputs: Array
    outputs: Array


def scales(choices: DesignChoices) -> Scales:
    """Sizes of the inputs and outputs of the design plant, in its order: disturbances and noise;
    measurements and controls.
    """
    noise = [choices.noise[y] for y in choices.measurements]
    return Scales(
        np.array([*choices.sizes_of_disturbances.values(), *noise]),
        np.array(list(choices.sizes_of_performance.values())),
    )


def points(choices: DesignChoices, given: Given | None = None) -> list[Point]:
    """Return what the sizes act on, at `AIRSPEEDS` over the range; `given` as of `synthesized`.

    Raises `InputError` and `TrimError` as the synthesis does.
    """
    model = model_of(choices, given)
    held = choices.period / 2 if model.dt is None else 0.0
    plant = design_plant(smooth(model), held, choices)
    channels = [*plant.performance, *plant.measurements]
    whole = plant.nominal.select(
        inputs=[*plant.disturbances, *plant.controls], outputs=list(dict.fromkeys(channels))
    )
    low, high = choices.airspeeds
    speeds = np.linspace(low, high, AIRSPEEDS).tolist()
    driven, actuation = controlled(model, choices, speeds, exact=given is None)
    sheet, travel = sheet_of(choices), travel_of(choices)
    return [Point(v, choices, whole.at(v), driven.at(v), actuation, sheet, travel) for v in speeds]


def frozen(point: Point, choices: DesignChoices) -> Frozen:
    """Return the least-variance design (LQG) at one airspeed in these sizes, its margins and
    responses; where that has no solution, the H-infinity design.
    """
    plant = point.sized(choices)
    w, z = map(len, scales(choices))
    names = choices.controls, [choices.error(y) for y in choices.measurements]
    channels: Any = {"disturbances": plant.inputs[:w], "performance": plant.outputs[:z]}
    method, found = "LQG", h2(plant, *names, **channels)
    if found.controller is None:
        method = "H-infinity"
        found = hinf(plant, *names, **channels, back_off=choices.back_off[0])
    if found.controller is None or found.loop is None:
        return Frozen(point.airspeed, failure="; ".join(found.reasons) or found.status.value)
    K = _measuring(found.controller.discretize(choices.period), choices)
    loops = point.loops(K)
    broken = open_loop(driven_plant(point.bare, K, point.actuation), K, choices.controls[0])
    if not margins(broken, disk=False).stable:
        return Frozen(point.airspeed, method, failure=UNSTABLE)
    return Frozen(
        point.airspeed,
        method,
        K,
        measures={name: LoopMeasures.of(_margins(loop)) for name, loop in loops.items()},
        steps={name: _step(loop) for name, loop in loops.items()},
        gusts=_gusts(found.loop, choices),
    )


def _measuring(K: LinearModel, choices: DesignChoices) -> LinearModel:
    """Return a controller of errors (reference - y) as one of measurements y."""
    signs = np.array([-1.0 if y in choices.references else 1.0 for y in choices.measurements])
    names = tuple(Signal(y) for y in choices.measurements)
    return replace(K, B=K.B * signs, D=K.D * signs, inputs=names)


def _margins(loop: AxisLoop) -> Margins:
    """Margins without the disk, which takes longer than all the rest and is in the sheet."""
    return margins(loop.broken, disk=False)


def _step(loop: AxisLoop) -> Response:
    made = loop.closed.step_response(STEP_WINDOW)
    return Response(made.time, made.values[:, :2, 0])


def _gusts(loop: LinearModel, choices: DesignChoices) -> dict[str, Response]:
    """Sizes of all deviations and of all commands together after a step of each disturbance."""
    names = list(choices.sizes_of_disturbances)
    made = loop.select(inputs=names).step_response(GUST_WINDOW)
    n = len(choices.measurements)
    parts = made.values[:, :n], made.values[:, n:]
    both = np.stack([np.linalg.norm(part, axis=1) for part in parts], axis=1)
    return {name: Response(made.time, both[:, :, k]) for k, name in enumerate(names)}


def entries(point: Point, K: LinearModel, axis: str) -> dict[str, float]:
    """Return the frozen entries of the sheet for one axis, by name."""
    loop = point.loops(K)[axis]
    return {
        spec.name: MEASURES[spec.measure](loop, spec)
        for spec in point.sheet.specifications
        if spec.kind == "frozen" and spec.axis == axis
    }


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers of the sizes `choices`, request `number`: designs by airspeed, entries of the
    sheet by (airspeed, axis), seconds from the request to all designs and to the whole sheet.
    """

    number: int
    choices: DesignChoices
    designs: Mapping[float, Frozen] = field(default_factory=dict)
    entries: Mapping[tuple[float, str], Mapping[str, float]] = field(default_factory=dict)
    designed: float = math.nan
    judged: float = math.nan

    def table(self, points: Sequence[Point]) -> SpecificationTable | None:
        """Return the sheet, where it is whole."""
        if math.isnan(self.judged):
            return None
        sheet = points[0].sheet
        specs = [s for s in sheet.specifications if s.kind == "frozen"]
        at = np.array([point.airspeed for point in points])
        rows = [
            [self.entries.get((v, s.axis), {}).get(s.name, math.nan) for v in at] for s in specs
        ]
        stable = [self.designs[v].controller is not None for v in at]
        return SpecificationTable(
            sheet=sheet,
            parameter=Signal("airspeed", "m/s"),
            at=at,
            values={NAME: np.array(rows)},
            stable={NAME: np.array(stable)},
        )


class Computing:
    """Numbers of the newest sizes: a request drops what an older one has not answered yet.

    Parameters
    ----------
    points : sequence of Point
        Of `points`.
    processes : Processes
        Where they are computed, an airspeed at a time.
    """

    def __init__(self, points: Sequence[Point], processes: Processes):
        self.points, self._processes = list(points), processes
        self._lock = threading.RLock()  # a future that is done already calls at once
        self._begun, self._waiting = 0.0, list[Future]()
        self.latest = Numbers(0, points[0].choices)
        self.shown = self.latest
        """The newest numbers with all designs."""

    def request(self, choices: DesignChoices) -> int:
        """Ask for other sizes; return the number of the request."""
        with self._lock:
            for future in self._waiting:
                future.cancel()
            self._begun, self._waiting = time.monotonic(), []
            number = self.latest.number + 1
            self.latest = Numbers(number, choices)
            for point in self.points:
                self._submit(number, partial(self._designed, point), frozen, point, choices)
        return number

    def _submit(
        self, number: int, take: Callable[..., None], function: Callable, *arguments: object
    ) -> None:
        """Compute in a process; `take` has the result where it is still wanted."""
        future = self._processes.submit(function, *arguments)
        self._waiting.append(future)

        def done(future: Future) -> None:
            if future.cancelled():
                return
            error = future.exception()
            with self._lock:
                if number == self.latest.number:  # else it was overtaken
                    take(None if error else future.result(), error)

        future.add_done_callback(done)

    def _designed(self, point: Point, found: Frozen | None, error: BaseException | None) -> None:
        if found is None:
            found = Frozen(point.airspeed, failure=_sentence(error))
        designs = {**self.latest.designs, point.airspeed: found}
        self.latest = replace(self.latest, designs=designs)
        if len(designs) < len(self.points):
            return
        self.latest = replace(self.latest, designed=time.monotonic() - self._begun)
        self.shown = self.latest
        for one in self.points:
            K = designs[one.airspeed].controller
            for axis in designs[one.airspeed].measures if K is not None else ():
                take = partial(self._judged, one.airspeed, axis)
                self._submit(self.latest.number, take, entries, one, K, axis)
        self._whole()

    def _judged(
        self,
        airspeed: float,
        axis: str,
        found: Mapping[str, float] | None,
        error: BaseException | None,
    ) -> None:
        own = {**self.latest.entries, (airspeed, axis): found or {}}
        self.latest = self.shown = replace(self.latest, entries=own)
        self._whole()

    def _whole(self) -> None:
        wanted = sum(len(one.measures) for one in self.latest.designs.values())
        if len(self.latest.entries) == wanted:
            spent = time.monotonic() - self._begun
            self.latest = self.shown = replace(self.latest, judged=spent)


def _sentence(error: BaseException | None) -> str:
    return str(error) if isinstance(error, SymheliError) else repr(error)
