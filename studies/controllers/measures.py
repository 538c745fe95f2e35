"""Measures of a flight: errors, limits, and the energy ratio that a proven gain bounds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from studies.controllers.covered import uncovered
from studies.controllers.design_choices import CONTROLS, GUSTS, MEASUREMENTS, DesignChoices
from studies.controllers.plant import STUDY
from studies.controllers.stepped import STEP_AT
from symheli.flight import FlightPlan
from symheli.flight.disturbance import Disturbances
from symheli.flight.equipment import Readings
from symheli.flight.flight_data import WIND, FlightData
from symheli.steady.validity import Validity
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from synthesis.tubes import Tube

STEP_FOR, STEP_SHARE = 2.0, 0.5
"""How long a reference is stepped in flight, s, and by which share of its size."""

AT_THE_STOP = 0.999
"""Share of the travel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measures:
    """One flight, until it was lost where it was.

    `speed`: rms of forward airspeed minus the commanded one, m/s; `deviation`: rms of the
    performance signals, 1 as large as its size, all together, and of each in `deviations`;
    `attitude`: largest bank or pitch, rad; `stops`: share of the time with a command at a stop;
    `ratio`: see `energy_ratio`; `outside`, `faster`: share of the time with a forward airspeed
    outside the range and with a change of it above the permitted rate; `beyond`: share of the time
    with an airspeed that the equations of the helicopter are not known to hold for; `left`: each
    hypothesis of the certificate that the flight left, and when.
    """

    lost: bool
    speed: float
    deviation: float
    deviations: dict[str, float]
    attitude: float
    stops: float
    ratio: float
    outside: float
    faster: float
    beyond: float
    wind: float
    uncovered: str
    left: tuple[str, ...] = ()


def measured(
    flights: Iterable[FlightData], choices: DesignChoices = STUDY, tubes: Sequence[Tube] = ()
) -> list[Measures]:
    """Return the measures of every flight."""
    return [of_flight(flown, choices, tubes) for flown in flights]


def of_flight(
    flown: FlightData, choices: DesignChoices = STUDY, tubes: Sequence[Tube] = ()
) -> Measures:
    """Return the measures of one flight, for the performance and the disturbances of the
    controller's specification, and whether one of the tubes covers it.
    """
    column, travel = flown.columns(), flown.heli.travel
    noise = noise_of(flown)
    true = {y: column[y] - noise[:, i] for i, y in enumerate(MEASUREMENTS)}
    gusts, forward = air(column, true, flown.plan)
    z = performance(column, true, choices)
    time = np.arange(flown.kept) * flown.plan.dt
    steps = {y: commanded(choices, y, time) for y in choices.references}
    for y, step in steps.items():
        z[:, choices.measurements.index(y)] -= step / choices.sizes[y]
    references = [step / choices.size_of_reference(y) for y, step in steps.items()]
    winds = [
        gusts[:, GUSTS.index(g)] / choices.sizes[g] for g in choices.disturbances if g in GUSTS
    ]
    noises = [noise[:, MEASUREMENTS.index(y)] / choices.noise[y] for y in choices.measurements]
    w = np.column_stack([*winds, *references, *noises])
    commands = np.column_stack([column[f"{u}_command"] for u in CONTROLS])
    low, high = choices.airspeeds
    change = np.gradient(forward, flown.plan.dt) if len(forward) > 1 else np.zeros(len(forward))
    return Measures(
        lost=flown.lost >= 0,
        speed=rms(forward - column["airspeed_command"]),
        deviation=rms(np.linalg.norm(z, axis=1)),
        deviations={name: rms(z[:, i]) for i, name in enumerate(choices.sizes_of_performance)},
        attitude=float(max(np.abs(true["phi"]).max(), np.abs(true["theta"]).max())),
        stops=float(np.any(np.abs(commands) >= AT_THE_STOP * travel, axis=1).mean()),
        ratio=energy_ratio(z, w),
        outside=float(np.mean((forward < low) | (forward > high))),
        faster=float(np.mean(np.abs(change) > choices.acceleration)),
        beyond=float(np.mean(column["airspeed"] > Validity.of(flown.heli).harmless[0])),
        wind=float(np.linalg.norm(np.column_stack([column[n] for n in WIND]), axis=1).max()),
        uncovered=uncovered(flown, tubes),
        left=tuple(_left(time, forward, change, commands, travel, choices)),
    )


def _left(
    time: Array, forward: Array, change: Array, commands: Array, travel: Array, a: DesignChoices
) -> Iterator[str]:
    """Yield each hypothesis of the certificate that a flight left: for how long, and when first."""
    low, high = a.airspeeds
    at_stop = np.abs(commands) >= AT_THE_STOP * travel
    checks = [
        (f"airspeed below {low:g} m/s", forward < low, np.maximum(low - forward, 0.0), "m/s"),
        (f"airspeed above {high:g} m/s", forward > high, np.maximum(forward - high, 0.0), "m/s"),
        (
            f"|dV/dt| above {a.acceleration:g} m/s^2",
            np.abs(change) > a.acceleration,
            np.maximum(np.abs(change) - a.acceleration, 0.0),
            "m/s^2",
        ),
    ]
    for what, outside, excess, unit in checks:
        if outside.any():
            yield (
                f"{what} at {time[outside][0]:.1f} s first, {100 * outside.mean():.1f} % of the"
                f" time, by {excess.max():.2g} {unit} at most"
            )
    for i, u in enumerate(CONTROLS):
        if at_stop[:, i].any():
            yield f"{u} at its stop at {time[at_stop[:, i]][0]:.1f} s first: no linear model"


def commanded(choices: DesignChoices, name: str, time: Array) -> Array:
    """Return the command (n,) of a measurement over time: half its size, from `STEP_AT` for
    `STEP_FOR` s.
    """
    on = (time >= STEP_AT - 1e-9) & (time < STEP_AT + STEP_FOR - 1e-9)
    return np.where(on, STEP_SHARE * choices.size_of_reference(name), 0.0)


def performance(
    column: dict[str, Array], true: dict[str, Array], choices: DesignChoices = STUDY
) -> Array:
    """Deviations from the reference (n, 12 of the study), each in its size: measured states, then
    commands.
    """
    size = choices.sizes
    parts = [(true[y] - column[f"{y}_reference"]) / size[y] for y in choices.measurements]
    parts += [
        (column[f"{u}_command"] - column[f"{u}_reference"]) / size[u] for u in choices.controls
    ]
    return np.column_stack(parts)


def noise_of(flown: FlightData) -> Array:
    """Return the sensor noise in the measured states (n, 8)."""
    readings = Readings.of(flown.plan.sensors or {}, flown.clock.dt)
    white = Disturbances.of([flown.plan], [flown.course], readings).white
    if white is None:
        return np.zeros((flown.kept, len(MEASUREMENTS)))
    return white[0, :: flown.clock.every][: flown.kept] * readings.noise[: len(MEASUREMENTS)]


def air(column: dict[str, Array], true: dict[str, Array], plan: FlightPlan) -> tuple[Array, Array]:
    """Gusts along the axes of the helicopter (n, 3), and its forward airspeed (n,) in the steady
    wind alone, m/s.

    A gust is the wind along the axes, less the steady one along those of the reference: a heading
    that drifts turns the steady wind into one.
    """
    wind, steady = np.column_stack([column[name] for name in WIND]), np.array(plan.wind.steady)
    own = to_body(true["phi"], true["theta"], heading(true, plan.dt))
    level = np.zeros(len(wind))
    held = to_body(column["phi_reference"], column["theta_reference"], level)
    gusts = np.einsum("nij,nj->ni", own, wind) - held @ steady
    through = np.column_stack([true[s] for s in ("u", "v", "w")]) - own @ steady
    forward = np.cos(true["theta"]) * through[:, 0] + np.sin(true["theta"]) * through[:, 2]
    return gusts, forward


def heading(true: dict[str, Array], dt: float) -> Array:
    """From north (n,), rad, by the trapezoidal rule from the rates: no flight measures it."""
    turn = (true["q"] * np.sin(true["phi"]) + true["r"] * np.cos(true["phi"])) / np.cos(
        true["theta"]
    )
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (turn[1:] + turn[:-1]))])


def to_body(phi: Array, theta: Array, psi: Array) -> Array:
    """Rotations (n, 3, 3) from north, east, down to the axes of the helicopter."""
    (cf, sf), (ct, st), (cp, sp) = ((np.cos(a), np.sin(a)) for a in (phi, theta, psi))
    rows = [
        [ct * cp, ct * sp, -st],
        [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
        [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def energy_ratio(z: Array, w: Array) -> float:
    """sqrt(sum |z|^2 / sum |w|^2): no flight that keeps to the hypotheses of a gain exceeds it."""
    return float(np.sqrt((z**2).sum() / (w**2).sum()))


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
