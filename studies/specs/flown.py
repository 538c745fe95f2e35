"""Flown entries of the specification sheet: transitions of the nonlinear helicopter in light
turbulence, steps of attitude, and entries of a controller in flight.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.controllers.design_choices import CONTROLS, LIMITED, PERIOD
from studies.controllers.flown import HIGH, LOW, WINDS, plan
from studies.controllers.measures import AT_THE_STOP, heading, noise_of, of_flight, rms, to_body
from studies.controllers.measures import MEASUREMENTS as MEASURED
from studies.controllers.stepped import STEP_AT, Stepped
from studies.setup.flights import autopilot_for
from studies.specs.of_vehicle import FLIGHTS_FROM, OfVehicle, digest_of, share_met
from symheli import AirspeedSchedule, FlightPlan, Helicopter, LPVStateSpace
from symheli.errors import CompilerWarning, ValidityWarning
from symheli.flight import ScheduledController, fly_batch
from symheli.flight.flight_data import FlightData
from symheli.progress import tracked
from symheli.values.arrays import Array
from symheli.values.kinematics import GRAVITY
from symheli.values.named_vector import NamedVector
from synthesis.sheet.measures import rate_over_change
from synthesis.sheet.sheet import ControlAxis, Sheet

ACCELERATIONS = (1.0, 3.0)
"""Accelerations of the transitions, gentle and aggressive, m/s^2."""

SHARE = 0.95
"""Share of the flights that meet a value: the value shown is the one they do not exceed."""

STEP_FOR = 4.0
"""How long a flight goes on after an attitude is commanded, s."""

PULSE = 0.2
"""How long a yaw rate is commanded, s, so that the heading changes by what a second of the axis's
size gives.
"""

SWITCH_AT, SWITCH_FOR = 1.5, 2.0
"""When a controller takes over, and how long the flight is watched, s."""

OF_A_FLIGHT = ("speed", "track", "altitude", "heading", "attitude", "rotor_speed")
OF_A_CONTROL = ("effort", "stops")
"""Measures of a transition."""

OF_A_SWITCH = ("switch_attitude", "switch_acceleration")
"""Measures where a controller takes over in flight."""

HELD_AT = (0.0, 6.5, 13.0)
"""Airspeeds of the steps, m/s."""


def flown(
    vehicle: OfVehicle, controllers: Mapping[str, LPVStateSpace], seeds: int
) -> dict[str, dict[tuple[str, str], float]]:
    """Return {controller: {(axis, name): value}} of every flown entry that is flown: the value that
    `SHARE` of the transitions do not exceed, lost ones infinite; and the least quickness.
    """
    out = {}
    for name in tracked("flying", list(controllers), len(controllers)):
        K = controllers[name]
        out[name] = vehicle.kept(
            "flown", f"{name}, {seeds} seeds, {digest_of(K)}", lambda K=K: _of(vehicle, K, seeds)
        )
    return out


def _of(vehicle: OfVehicle, K: LPVStateSpace, seeds: int) -> dict[tuple[str, str], float]:
    heli = Helicopter.load(vehicle.name, governor="pi")
    plans = [
        replace(
            plan(K, WINDS[0]),
            schedule=AirspeedSchedule.transition(LOW, HIGH, acceleration=a, hold=3.0),
        )
        for a in ACCELERATIONS
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        data = fly_batch(
            heli, plans, seeds=range(FLIGHTS_FROM, FLIGHTS_FROM + seeds), workers=1
        ).data
    each = [measured(one) for one in data]
    by_measure = {key: share_met(np.array([m[key] for m in each]), SHARE) for key in each[0]}
    axes = vehicle.scaled.axes
    found = in_still_air(heli, K, vehicle.scaled)
    for spec in vehicle.scaled.specifications:
        control = axes[spec.axis].control if spec.axis in axes else ""
        if spec.kind == "flown" and (spec.measure, control) in by_measure:
            found[spec.axis, spec.name] = by_measure[spec.measure, control]
    return found


def in_still_air(heli: Helicopter, K: LPVStateSpace, sheet: Sheet) -> dict[tuple[str, str], float]:
    """Return {(axis, name): value} of the flown entries that need no turbulence: quickness, and
    what changes where the controller takes over.
    """
    found, switched = {}, at_a_switch(heli, K)
    for spec in sheet.specifications:
        if spec.kind == "flown" and spec.measure in switched:
            found[spec.axis, spec.name] = switched[spec.measure]
        if spec.kind == "flown" and spec.measure == "quickness":
            found[spec.axis, spec.name] = quickness(heli, K, sheet.axes[spec.axis])
    return found


def measured(one: FlightData) -> dict[tuple[str, str], float]:
    """Return {(measure, control or ""): value} of one transition; inf of a lost one.

    Altitude and track are how far the velocity has carried it from the reference, relative to the
    air of the steady wind: no controller of the study knows a position or a heading.
    """
    if one.lost >= 0:
        keys = [(m, "") for m in OF_A_FLIGHT]
        keys += [(m, str(u)) for u in one.heli.inputs for m in OF_A_CONTROL]
        return dict.fromkeys(keys, math.inf)
    column, dt = one.columns(), one.plan.dt
    noise = noise_of(one)
    true = {y: column[y] - noise[:, i] for i, y in enumerate(MEASURED)}
    psi = heading(true, dt)
    axes = to_body(true["phi"], true["theta"], psi)
    body = np.column_stack([true[s] for s in ("u", "v", "w")])
    level = np.einsum("nij,ni->nj", axes, body) - np.array(one.plan.wind.steady)
    rest = np.zeros(len(psi))
    held = to_body(column["phi_reference"], column["theta_reference"], rest)
    reference = np.column_stack([column[f"{s}_reference"] for s in ("u", "v", "w")])
    commanded = np.einsum("nij,ni->nj", held, reference) - np.array(one.plan.wind.steady)
    gone = np.cumsum(level - commanded, axis=0) * dt
    whole = of_flight(one)
    out = {
        ("speed", ""): whole.speed,
        ("track", ""): float(np.abs(gone[:, 1]).max()),
        ("altitude", ""): float(np.abs(gone[:, 2]).max()),
        ("heading", ""): math.degrees(float(np.abs(psi).max())),
        ("attitude", ""): math.degrees(whole.attitude),
        ("rotor_speed", ""): 100 * float(np.abs(column["Om"] / column["Om_reference"] - 1).max()),
    }
    for u, travel in zip(map(str, one.heli.inputs), one.heli.travel, strict=True):
        command = column[f"{u}_command"]
        out["effort", u] = 100 * rms(command - column[f"{u}_reference"]) / float(travel)
        out["stops", u] = 100 * float(np.mean(np.abs(command) >= AT_THE_STOP * travel))
    return out


@dataclass(frozen=True, eq=False)
class Handover:
    """Two controllers: the second takes over from the commands in force after `SWITCH_AT` s."""

    before: ScheduledController
    after: ScheduledController

    @property
    def dt(self) -> float:
        """Sample period, s."""
        return self.after.dt

    def init(self) -> tuple[int, Array, Any]:
        """Samples so far, the commands in force (4,), rad, and the state of who flies."""
        return 0, np.zeros(len(CONTROLS)), self.before.init()

    def step(
        self,
        state: tuple[int, Array, Any],
        measured: NamedVector,
        reference: NamedVector,
        p: NamedVector,
    ) -> tuple[Array, tuple[int, Array, Any]]:
        """Commands (4,), rad, and the state at the next sample."""
        k, command, inner = state
        switch = round(SWITCH_AT / self.dt)
        if k == switch:
            inner = self.after.init(command[self.after.rows])
        flying = self.after if k >= switch else self.before
        u, inner = flying.step(inner, measured, reference, p)
        return u, (k + 1, u, inner)


def quickness(heli: Helicopter, K: LPVStateSpace, axis: ControlAxis) -> float:
    """Return peak rate over peak change of an attitude, 1/s, after a step of its command in still
    air: the least over `HELD_AT` and both signs; NaN where a flight is lost.

    Of an axis whose response is a rate, of its integral after a pulse of `PULSE` s.
    """
    pulse = axis.type == "rate"
    size, until = (axis.step / PULSE, STEP_AT + PULSE) if pulse else (axis.step, math.inf)
    least = math.inf
    for airspeed in _held(K):
        still = AirspeedSchedule((airspeed,), (1.0,), (STEP_AT + STEP_FOR,), airspeed, lead=0.0)
        for signed in (size, -size):
            stepped = Stepped(ScheduledController(K), axis.response, signed, until)
            flight = _calm(heli, still, stepped)
            if flight.lost >= 0:
                return math.nan
            y = flight.column(axis.response)[round(STEP_AT / PERIOD) :]
            change = np.cumsum(y) * PERIOD if pulse else y
            least = min(least, rate_over_change(change, PERIOD))
    return least


def at_a_switch(heli: Helicopter, K: LPVStateSpace) -> dict[str, float]:
    """Return {measure: value} of what taking over from the scheduled LQR changes: attitude,
    deg, and load factor, g, beside the flight in which the LQR goes on, within `SWITCH_FOR` s.

    The airspeed rises from each of `HELD_AT`, or falls from the highest, at the gentle
    acceleration in still air: the largest of all; inf where a flight is lost.
    """
    pilot, taking = autopilot_for(heli).scheduled_controller, ScheduledController(K)
    attitude, load = [], []
    for start in _held(K):
        end = start + 4.0 if start + 4.0 <= K.box[0][1] else start - 4.0
        course = AirspeedSchedule((end,), ACCELERATIONS[:1], (0.0,), start, lead=0.5)
        usual, switched = (
            _calm(heli, course, flying) for flying in (pilot, Handover(pilot, taking))
        )
        if usual.lost >= 0 or switched.lost >= 0:
            return dict.fromkeys(OF_A_SWITCH, math.inf)
        after = slice(round(SWITCH_AT / PERIOD), round((SWITCH_AT + SWITCH_FOR) / PERIOD))
        for angle in ("phi", "theta"):
            gone = switched.column(angle) - usual.column(angle)
            attitude.append(math.degrees(np.abs(gone[after]).max()))
        load.append(float(np.abs(_load_factor(switched) - _load_factor(usual))[after].max()))
    return dict(zip(OF_A_SWITCH, (max(attitude), max(load)), strict=True))


def _load_factor(flight: FlightData) -> Array:
    """Acceleration along the body axis that gravity does not give, g."""
    column = flight.columns()
    w = np.gradient(column["w"], PERIOD) + column["p"] * column["v"] - column["q"] * column["u"]
    return w / GRAVITY - np.cos(column["phi"]) * np.cos(column["theta"])


def _held(K: LPVStateSpace) -> list[float]:
    low, high = K.box[0]
    return [v for v in HELD_AT if low <= v <= high]


def _calm(heli: Helicopter, schedule: AirspeedSchedule, controller: Any) -> FlightData:
    """Return a flight in still air without noise."""
    plan_ = FlightPlan(
        schedule,
        dt=PERIOD,
        controller=controller,
        servos=LIMITED,
        sensors={},
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        warnings.simplefilter("ignore", CompilerWarning)  # flights are few, and made in Python
        (one,) = fly_batch(heli, [plan_], seeds=[0], workers=1).data
    return one
