"""Flown entries of the specification sheet: transitions of the nonlinear helicopter in light
turbulence, and steps of attitude.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.controllers.asked import CONTROLS, DELAY, PERIOD, SERVO_RATE
from studies.controllers.flown import HIGH, LOW, WINDS, plan
from studies.controllers.measures import AT_THE_STOP, heading, noise_of, of_flight, rms, to_body
from studies.controllers.measures import MEASUREMENTS as MEASURED
from studies.specs.of_vehicle import FLIGHTS_FROM, OfVehicle, digest_of, share_met
from symheli import (
    AirspeedSchedule,
    FlightPlan,
    Helicopter,
    LPVStateSpace,
    ScheduledController,
    fly_batch,
)
from symheli.errors import CompilerWarning, ValidityWarning
from symheli.flight import XCELL_SERVOS
from symheli.flight.flight_data import FlightData
from symheli.progress import tracked
from symheli.values.arrays import Array
from symheli.values.named_vector import NamedVector
from synthesis.sheet.measures import rate_over_change
from synthesis.sheet.sheet import Axis

ACCELERATIONS = (1.0, 3.0)
"""Of the transitions, gentle and aggressive, m/s^2."""

SHARE = 0.95
"""Of the flights that meet a value: the value shown is the one they do not exceed."""

STEP_AT, STEP_FOR = 1.0, 3.0
"""When an attitude is commanded, and how long the flight goes on, s."""

OF_A_FLIGHT = ("speed", "track", "altitude", "heading", "attitude", "rotor_speed")
OF_A_CONTROL = ("effort", "stops")
"""What is measured of a transition."""

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
    quick = {a.name: quickness(heli, K, a) for a in axes.values() if a.type == "attitude"}
    found: dict[tuple[str, str], float] = {}
    for spec in vehicle.scaled.specifications:
        control = axes[spec.axis].control if spec.axis in axes else ""
        key = (spec.measure, control) if control else (spec.measure, "")
        if spec.kind == "flown" and key in by_measure:
            found[spec.axis, spec.name] = by_measure[key]
        if spec.kind == "flown" and spec.measure == "quickness" and spec.axis in quick:
            found[spec.axis, spec.name] = quick[spec.axis]
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
    asked = np.einsum("nij,ni->nj", held, reference) - np.array(one.plan.wind.steady)
    gone = np.cumsum(level - asked, axis=0) * dt
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
class Stepped:
    """A controller whose command of one signal steps by `size` after `STEP_AT` s."""

    controller: ScheduledController
    signal: str
    size: float

    @property
    def dt(self) -> float:
        """Sample period, s."""
        return self.controller.dt

    def init(self) -> tuple[int, Any]:
        """Samples so far, and the state of the controller."""
        return 0, self.controller.init()

    def step(
        self, state: tuple[int, Any], measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, tuple[int, Any]]:
        """Commands (4,), rad, and the state at the next sample."""
        k, inner = state
        if k * self.dt >= STEP_AT:
            values = np.array(measured.array)
            values[measured.signals.index(self.signal)] -= self.size
            measured = NamedVector(measured.signals, values)
        u, inner = self.controller.step(inner, measured, reference, p)
        return u, (k + 1, inner)


def quickness(heli: Helicopter, K: LPVStateSpace, axis: Axis) -> float:
    """Return peak rate over peak change of an attitude, 1/s, after a step of its command in still
    air: the least over `HELD_AT` and both signs; NaN where a flight is lost.
    """
    low, high = K.box[0]
    least = math.inf
    for plan_ in _steps(K, axis, [v for v in HELD_AT if low <= v <= high]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ValidityWarning)
            warnings.simplefilter("ignore", CompilerWarning)  # steps are few, and made in Python
            (one,) = fly_batch(heli, [plan_], seeds=[0], workers=1).data
        if one.lost >= 0:
            return math.nan
        y = one.column(axis.response)
        least = min(least, rate_over_change(y, PERIOD))
    return least


def _steps(K: LPVStateSpace, axis: Axis, airspeeds: Sequence[float]) -> Iterator[FlightPlan]:
    for airspeed in airspeeds:
        for sign in (1.0, -1.0):
            yield FlightPlan(
                AirspeedSchedule((airspeed,), (1.0,), (STEP_AT + STEP_FOR,), airspeed, lead=0.0),
                dt=PERIOD,
                controller=Stepped(ScheduledController(K), axis.response, sign * axis.step),
                servos={u: replace(XCELL_SERVOS[u], rate=SERVO_RATE) for u in CONTROLS},
                sensors={},
                delay=DELAY,
            )
