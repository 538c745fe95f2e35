"""Synthesis of a specified controller: designed, reduced, sampled, tabulated, certified as
implemented, simulated.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

import symheli
import synthesis
from identification.model import KinematicModel, LPVARXModel
from studies.controllers.certified import FORM, SOLVER
from studies.controllers.design_choices import NOISE_SHARE, DesignChoices
from studies.controllers.designs import NEAR
from studies.controllers.flown import ALTITUDE, STEADY
from studies.controllers.identified_plant import (
    DEGREE,
    continuous,
    moving_with_commands,
    with_gusts,
)
from studies.controllers.in_airspeed import of_degree
from studies.controllers.judged import Judged, judged, travel_of
from studies.controllers.measures import STEP_FOR, STEP_SHARE, Measures, measured
from studies.controllers.plant import (
    baseline,
    closed,
    design_plant,
    disturbed,
    flown_plant,
    of_family,
)
from studies.controllers.reach import require_possible
from studies.controllers.stepped import STEP_AT, Stepped
from symheli import (
    AirspeedSchedule,
    FlightPlan,
    Helicopter,
    LinearFamily,
    LPVStateSpace,
    Scheduling,
    Sensor,
    TableController,
    Wind,
)
from symheli.environment import Dryden
from symheli.errors import CompilerWarning, InputError, SynthesisError, ValidityWarning
from symheli.flight import ScheduledController, TableState, fly_batch
from symheli.flight.controller import Entered
from symheli.flight.flight_data import FlightData
from symheli.progress import Progress, Task, task, watched
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.values.named_vector import NamedVector
from symheli.values.signal import indices
from symheli.values.units import ratio
from synthesis import Plant
from synthesis.design.loops.reduction import fewest
from synthesis.design.loops.sampled_loop import SampledLoop
from synthesis.numerics.linear.norm import norm

KNOTS = (2, 3, 5, 9, 17, 33)
"""Numbers of airspeeds of the table, tried in turn."""
LOOKED_AT = 9
"""Airspeeds at which the frozen gain of the loop is."""
MAX_STATES_OF_SPLINE = 12
"""Number of states of the loop above which P(p) is affine in airspeed."""
ALTERNATING = -0.5
"""Real part of a pole of a sampled model below which it alternates from sample to sample."""
PROGRAM = "digits of the least level"
"""Task that reports a semidefinite program."""
RANGE_MARGIN, RATE_SHARE = 0.2, 0.5
"""Fraction of the range, at either end, that the simulated transition leaves to gusts, and of the
permitted acceleration that it commands.
"""

Given = LinearFamily | LPVARXModel | KinematicModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Synthesized:
    """Results of a synthesis.

    `made`: the controller of the synthesis; `table`: what flies; `sampled`: the proof of its loop;
    `flights`, `measures`: each transition; none without a vehicle; `judged`: the specification
    sheet, None where the controller has none of its axes; `idle`: why the controller commands
    nothing, where it does; `seconds` of each step.
    """

    choices: DesignChoices
    made: synthesis.Controller
    table: TableController
    sampled: SampledLoop
    flights: tuple[FlightData, ...] = ()
    measures: tuple[Measures, ...] = ()
    judged: Judged | None = None
    idle: str = ""
    seconds: Mapping[str, float]

    @property
    def lost(self) -> int:
        """Number of flights that were lost."""
        return sum(one.lost for one in self.measures)

    @property
    def ratios(self) -> tuple[float, float]:
        """Median and largest energy ratio of the flights; NaN where none has one: no flight, or
        disturbances that no flight has.
        """
        gusts = set(self.choices.disturbances) - set(self.choices.controls)
        if not self.measures or not gusts:
            return math.nan, math.nan
        each = [one.ratio for one in self.measures]
        return float(np.median(each)), max(each)


@dataclass(frozen=True, eq=False)
class BesideAutopilot:
    """A controller of some controls, the others flown by the LQR schedule, which commands all four,
    as often.
    """

    own: TableController
    autopilot: ScheduledController

    @property
    def dt(self) -> float:
        """Sample period, s."""
        return self.own.dt

    def init(self) -> tuple[TableState, Array | Entered]:
        """The states of both."""
        return self.own.init(), self.autopilot.init()

    def step(
        self,
        state: tuple[TableState, Array | Entered],
        measured: NamedVector,
        reference: NamedVector,
        p: NamedVector,
    ) -> tuple[Array, tuple[TableState, Array | Entered]]:
        """Commands (4,), rad, and the states of both."""
        u, autopilot = self.autopilot.step(state[1], measured, reference, p)
        command, own = self.own.step(state[0], measured, reference, p)
        rows = indices(self.own.outputs, INPUTS, "helicopter input")
        u[rows] = command[rows]
        return u, (own, autopilot)


def synthesized(choices: DesignChoices, given: Given | None = None) -> Synthesized:
    """Everything, step by step; `given` in place of the linearizations of the vehicle, which then
    is only flown. Raises `SynthesisError` where there is no controller, with the reason.
    """
    seconds: dict[str, float] = {}
    with _timed("looking for what is possible", seconds):
        known = None if given is None else model_of(choices, given)
        held = _held(known, choices)
        require_possible(choices, None if known is None else smooth(known), held)
    with _timed("trimming and linearizing", seconds):
        model = model_of(choices, given) if known is None else known
        design, flying = plants(model, choices)
    with _timed("designing", seconds) as designing, watched(_programs(designing)):
        made = synthesis.output_feedback(
            design, back_off=choices.back_off, fastest=math.pi / choices.period
        )
    with _timed("reducing, sampling, tabulating", seconds):
        table = tabulated(made, flying, choices)
    with _timed("certifying", seconds):
        sampled = certified(table, flying, made.promised)
    with _timed("specification sheet", seconds):
        sheet = judged(table, model, choices, exact=given is None)
    flights: tuple[FlightData, ...] = ()
    if choices.vehicle:
        with _timed("flying", seconds):
            flights = flights_of(table, choices)
    return Synthesized(
        choices=choices,
        made=made,
        table=table,
        sampled=sampled,
        flights=flights,
        measures=tuple(measured(flights, choices)),
        judged=sheet,
        idle="" if np.any(table.matrices) else _idle(model),
        seconds=seconds,
    )


def model_of(choices: DesignChoices, given: Given | None = None) -> LPVStateSpace:
    """Return the model of the design over airspeed, with its disturbances; sampled where it was
    identified.

    Raises `InputError` for a model sampled otherwise than the controller, one that is not over
    airspeed or not over all that are asked for, and for what it does not have.
    """
    if given is None:
        return baseline(Helicopter.load(choices.vehicle, governor="ideal"), choices)
    if isinstance(given, LinearFamily):
        model = of_family(given, choices)
    elif choices.states:
        raise InputError("states: an identified model keeps its own; leave them out")
    elif isinstance(given, KinematicModel):
        model = with_gusts(given.to_state_space(held=moving_with_commands(given)))
    else:
        model = given.to_state_space()
    airspeed = _airspeed(model, choices)
    gusts = [name for name in choices.disturbances if name not in model.inputs]
    if gusts and isinstance(given, LPVARXModel):
        raise InputError(
            f"disturbances: the model has no {', '.join(gusts)}; give names of"
            f" {', '.join(model.inputs)} (added to that control), or a model with known kinematics"
        )
    if model.dt is not None and abs(model.dt - choices.period) > 1e-9:
        raise InputError(
            f"period: the model is sampled every {model.dt:g} s, the controller every"
            f" {choices.period:g} s; give the same"
        )
    return disturbed(model.with_scheduling(airspeed), choices)


def _airspeed(model: LPVStateSpace, choices: DesignChoices) -> Scheduling:
    """Return the requested range of airspeeds; raise `InputError` where the model is not
    over them.
    """
    low, high = choices.airspeeds
    over = ", ".join(f"{p.name} ({p.unit})" for p in model.parameters)
    size = ratio("m/s", model.parameters[0].unit)
    if len(model.parameters) != 1 or size is None:
        raise InputError(
            f"model: expected one over airspeed in m/s alone, got one over {over}; make it over"
            " airspeed"
        )
    least, most = (edge / size for edge in model.box[0])
    if low < least - 1e-9 or high > most + 1e-9:
        raise InputError(
            f"airspeeds: the model is known from {least:.6g} to {most:.6g} m/s; ask for no more"
        )
    return Scheduling("airspeed", "m/s", low, high, rate=choices.acceleration)


def plants(model: LPVStateSpace, choices: DesignChoices) -> tuple[Plant, Plant]:
    """Return the plant of the design, in continuous time, and that of the simulation, sampled."""
    return design_plant(smooth(model), _held(model, choices), choices), flown_plant(model, choices)


def smooth(model: LPVStateSpace) -> LPVStateSpace:
    """Return the model in continuous time; the half sample of the hold is in a sampled one."""
    return model if model.dt is None else of_degree(continuous(model), DEGREE)


def _held(model: LPVStateSpace | None, choices: DesignChoices) -> float:
    """Return the half sample, s, that a command is held for, where the model does not have it."""
    return choices.period / 2 if model is None or model.dt is None else 0.0


def tabulated(made: synthesis.Controller, plant: Plant, choices: DesignChoices) -> TableController:
    """The sampled controller of fewest states and then fewest airspeeds whose frozen gain on the
    plant is `NEAR` that of all states; as many as are asked for.

    Raises `SynthesisError` where the loop that flies is not stable at some frozen airspeed.
    """
    speeds = np.linspace(choices.airspeeds[0], choices.airspeeds[1], LOOKED_AT)

    def gain(controller: object) -> float:
        loop = closed(plant, controller)
        return max(norm(*loop.matrices(float(v)), loop.dt)[0] for v in speeds)

    limits = _limits(choices)
    whole = made.discretize(choices.period)
    most = NEAR * gain(whole.model)
    if not math.isfinite(most):
        raise SynthesisError(
            f"sampled every {choices.period:g} s, behind its servos and a delay of"
            f" {choices.delay:g} s, the loop of the controller is unstable at a frozen airspeed:"
            " ask for less (larger sizes of the deviations, smaller ones of the commands, more"
            " noise)"
        )
    sampled = whole
    if choices.order:
        sampled = made.reduce(choices.order).discretize(choices.period)
    else:
        fewer = fewest(made, lambda k: gain(k.discretize(choices.period).model), most)
        sampled = fewer.discretize(choices.period)
    for knots in (choices.knots,) if choices.knots else KNOTS:
        table = TableController.of(sampled.model, knots, limits=limits)
        if choices.knots or gain(table) <= most:
            break
    return table


def certified(table: TableController, plant: Plant, promised: float) -> SampledLoop:
    """The proven gain of the loop that flies, on the fit of its plant."""
    states = len(closed(plant, table).states)
    options: dict[str, Any] = (
        {"form": FORM, "solver": SOLVER} if states > MAX_STATES_OF_SPLINE else {}
    )
    return synthesis.certify_sampled(
        table, plant, promised=promised, cover=False, search=None, **options
    )


def flights_of(table: TableController, choices: DesignChoices) -> tuple[FlightData, ...]:
    """Transitions of the nonlinear helicopter, its engine governed, in turbulence, the table with
    its arithmetic and limits.
    """
    heli = Helicopter.load(choices.vehicle, governor="pi")
    low, high = choices.airspeeds
    ends = low + RANGE_MARGIN * (high - low), high - RANGE_MARGIN * (high - low)
    controller: object = table
    if len(table.outputs) < len(heli.inputs):
        ideal = Helicopter.load(choices.vehicle, governor="ideal")
        lqr = symheli.flight.gain_scheduled_lqr(ideal, low, high, choices.period)
        controller = BesideAutopilot(table, lqr.scheduled_controller)
    for y in choices.references:
        size, until = STEP_SHARE * choices.size_of_reference(y), STEP_AT + STEP_FOR
        controller = Stepped(controller, y, size, until)
    servos = choices.actuation.servos or {}
    acceleration = RATE_SHARE * choices.acceleration or 1.0
    plan = FlightPlan(
        AirspeedSchedule.transition(*ends, acceleration=acceleration, hold=3.0),
        dt=choices.period,
        controller=controller,
        wind=Wind(STEADY, turbulence=Dryden(choices.turbulence, ALTITUDE))
        if choices.turbulence
        else Wind(),
        servos=servos if servos.keys() == set(map(str, heli.inputs)) else None,
        sensors={y: Sensor(noise=NOISE_SHARE * choices.noise[y]) for y in choices.measurements},
        delay=choices.delay,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        warnings.simplefilter("ignore", CompilerWarning)
        return fly_batch(heli, [plan], seeds=range(choices.flights)).data


def _idle(model: LPVStateSpace) -> str:
    """Return why a controller commands nothing, and what to do."""
    said = "The controller commands nothing: with these sizes no command lowers the gain; give"
    said += " the commands larger sizes, or the deviations smaller ones."
    if model.dt is None:
        return said
    poles = np.linalg.eigvals(model.matrices(np.linspace(*model.box[0], LOOKED_AT)).A)
    worst = float(poles.real.min())
    if worst > ALTERNATING:
        return said
    return (
        f"The controller commands nothing: the model has a pole at z = {worst:.2f}, near half the"
        " sample frequency, where no servo follows and the fit knows noise alone: identify at a"
        " coarser step (--decimate 2), or with fewer lags."
    )


def _limits(choices: DesignChoices) -> dict[str, tuple[float, float]]:
    """The travel of the controls, where there is a vehicle."""
    return {u: (-most, most) for u, most in travel_of(choices).items()}


@contextmanager
def _timed(step: str, seconds: dict[str, float]) -> Iterator[Task]:
    begin = time.perf_counter()
    with task(step) as under_way:
        yield under_way
    seconds[step] = time.perf_counter() - begin


def _programs(designing: Task) -> Callable[[Progress], None]:
    """Return a listener that counts semidefinite programs: their digits begin again with each."""

    def listener(progress: Progress) -> None:
        if progress.over and progress.task == PROGRAM:
            designing.step("programs solved")

    return listener
