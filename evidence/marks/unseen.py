"""What a flight of less than 20 s tells of a vehicle that has changed since it was identified."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import symheli
from evidence.tables import markdown
from identification import fit
from identification.judge import validate
from identification.methods import FilterError
from identification.model import KinematicModel
from studies.known_kinematics.conditions import CONDITIONS, Instruments
from studies.known_kinematics.flights import aggressive, transition
from studies.known_kinematics.models import PAIRS, identified
from studies.setup.bounds import PERIOD
from studies.setup.flights import ACTUATION, TOP, autopilot_for
from symheli import FlightPlan, Helicopter, Wind
from symheli.errors import DataWarning
from symheli.flight import XCELL_SERVOS, Autopilot, SimulatedFlight, gain_scheduled_lqr

SAME = {True: 20, False: 4}
"""Flights of the same vehicle for each model, with multisines and without."""

ANOTHER = 100
"""What is added to the seed for each of them."""

Change = Callable[[Helicopter, FlightPlan], tuple[Helicopter, FlightPlan]]


def times(heli: Helicopter, plan: FlightPlan, **factors: float) -> tuple[Helicopter, FlightPlan]:
    """Another vehicle: parameters, "." written "__", times factors."""
    names = {name.replace("__", "."): factor for name, factor in factors.items()}
    return heli.with_parameters({n: f * float(heli.parameters[n]) for n, f in names.items()}), plan


def flown(heli: Helicopter, plan: FlightPlan, **options: Any) -> tuple[Helicopter, FlightPlan]:
    """The same vehicle flown with other options of the plan."""
    return heli, replace(plan, **options)


def governed(heli: Helicopter, plan: FlightPlan) -> tuple[Helicopter, FlightPlan]:
    """An engine whose governor does not hold the rotor."""
    return replace(heli, governor="pi"), plan


def sticking(heli: Helicopter, plan: FlightPlan, name: str, steps: int) -> Any:
    """A servo that moves in so many jumps from stop to stop."""
    servos = plan.actuation.servos or {}
    return heli, replace(plan, servos={**servos, name: replace(servos[name], steps=steps)})


def wind(speed: float) -> Change:
    """Steady head wind, m/s."""
    return partial(flown, wind=Wind((-speed, 0.0, 0.0)))


HEAVIER, LIGHTER = partial(times, body__mass=1.2), partial(times, body__mass=0.8)
DEFLECTIONS: Mapping[str, Change] = {
    "head wind of 5 m/s": wind(5.0),
    "head wind of 2 m/s": wind(2.0),
    "head wind of 1 m/s": wind(1.0),
    "20 % heavier": HEAVIER,
    "20 % lighter": LIGHTER,
    "5 % heavier": partial(times, body__mass=1.05),
    "governor that does not hold the rotor": governed,
}
"""What a model with deflections as inputs, of an ideally governed vehicle, is held against."""

SERVO_STEPS = (20, 10)
COMMANDS: Mapping[str, Change] = {
    "head wind of 5 m/s": wind(5.0),
    "head wind of 2 m/s": wind(2.0),
    "20 % heavier": HEAVIER,
    "20 % lighter": LIGHTER,
    "governor of twice the gains": partial(
        times, drivetrain__governor_kp=2.0, drivetrain__governor_ki=2.0
    ),
    "governor of half the gains": partial(
        times, drivetrain__governor_kp=0.5, drivetrain__governor_ki=0.5
    ),
    "commands 20 ms later": partial(flown, delay=0.04),
} | {
    f"servo of {name} in {n} jumps from stop to stop": partial(sticking, name=name, steps=n)
    for n in SERVO_STEPS
    for name in XCELL_SERVOS
}
"""And a model with commands as inputs, servos, delay and governor in the structure."""

KINDS = {"deflections": DEFLECTIONS, "commands": COMMANDS}
SAME_VEHICLE = "the same vehicle"


@dataclass(frozen=True)
class Judged:
    """Of one seed: whether each flight was explained, by kind of model, with multisines or not, and
    what had changed.
    """

    seed: int
    explained: dict[tuple[str, bool, str], list[bool]]


def of_seed(seed: int, truth: str = "xcell60") -> Judged:
    """Identify both models, and hold them against flights of the same and of changed vehicles."""
    found: dict[tuple[str, bool, str], list[bool]] = {}
    for kind, changes in KINDS.items():
        heli, autopilot, model = _identified(kind, seed, truth)
        for excited in (True, False):
            for i in range(SAME[excited]):
                plan = _plan(kind, seed + i * ANOTHER, autopilot, excited)
                own = found.setdefault((kind, excited, SAME_VEHICLE), [])
                own.append(validate(model, symheli.fly(heli, plan)).explained)
            for name, change in changes.items():
                record = symheli.fly(*change(heli, _plan(kind, seed, autopilot, excited)))
                found[kind, excited, name] = [validate(model, record).explained]
    return Judged(seed, found)


def _identified(kind: str, seed: int, truth: str) -> tuple[Helicopter, Autopilot, KinematicModel]:
    """Vehicle, autopilot and the model of an aggressive flight."""
    if kind == "deflections":
        heli, other = (Helicopter.load(v, governor="ideal") for v in (truth, PAIRS[truth]))
        autopilot = autopilot_for(heli)
        return heli, autopilot, identified(symheli.fly(heli, aggressive(seed, autopilot)), other)
    condition = CONDITIONS["servos"]
    heli, other = (condition.helicopter(v) for v in (truth, PAIRS[truth]))
    records = condition.flights(heli, seed)
    method = FilterError(Instruments(SimulatedFlight(other)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        model = fit(condition.structure(records[0]), records, method=method)
    return heli, gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, servos=XCELL_SERVOS), model


def _plan(kind: str, seed: int, autopilot: Autopilot, excited: bool) -> FlightPlan:
    plan = transition(seed, autopilot, servos=ACTUATION if kind == "commands" else None)
    return plan if excited else replace(plan, excitation=None)


def table(truth: str, found: Sequence[Judged]) -> str:
    """How many flights were refused, by what had changed."""
    rows = []
    for kind, changes in KINDS.items():
        for name in (SAME_VEHICLE, *changes):
            refused = [
                np.logical_not([ok for one in found for ok in one.explained[kind, excited, name]])
                for excited in (True, False)
            ]
            asked = "at most 5 %" if name == SAME_VEHICLE else "all"
            counts = [f"{int(np.sum(r))} of {len(r)}" for r in refused]
            rows.append((kind, name, asked, *counts))
    head = ("model from", "flown", "to be refused", "with multisines", "without")
    return "\n".join(
        [
            f"Truth {truth}, {len(found)} seeds from {found[0].seed} to {found[-1].seed}; one"
            " aggressive flight identified, others of 18.7 s from hover to 13 m/s and back judged.",
            "",
            markdown(head, rows),
        ]
    )
