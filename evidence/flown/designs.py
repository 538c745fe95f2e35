"""The controllers that fly: those of the study, a PD, the gain table, and the LQR and the LPV
controllers that `evidence.flown.tuning` found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import symheli
from evidence import gain_table
from studies.campaigns.trials.control import identified
from studies.controllers.asked import (
    CONTROLS,
    GUSTS,
    MEASUREMENTS,
    PERIOD,
    RATE,
    SIZES,
    TOP,
    Asked,
)
from studies.controllers.designs import AIRSPEEDS, SLOW, Design, design
from studies.controllers.identified_plant import identified_model
from studies.controllers.plant import STUDY, baseline, design_plant, disturbed, flown_plant
from studies.specs.of_vehicle import OfVehicle
from symheli import Helicopter, LPVStateSpace, ScheduledController
from symheli.flight import XCELL_SERVOS
from symheli.values.signal import Signal
from synthesis import Controller, Plant, output_feedback

VEHICLE = "xcell60"
PD, STRUCTURED = "PD", "structured"
RETUNED = "LQR schedule, retuned"
TOLD, TOLD_IDENTIFIED = "LPV, told of the transition", "the same, identified model"
OWN = (PD, STRUCTURED, RETUNED, TOLD, TOLD_IDENTIFIED)
"""Those that are not of the study."""

PD_GAINS = {
    ("d_lon", "u"): 0.005,
    ("d_lon", "theta"): -0.09,
    ("d_lon", "q"): -0.003,
    ("d_lat", "v"): -0.005,
    ("d_lat", "phi"): -0.08,
    ("d_lat", "p"): -0.002,
    ("d_col", "w"): 0.004,
    ("d_ped", "v"): 0.001,
    ("d_ped", "r"): -0.05,
}
"""Of velocity, attitude and rate, one value at every airspeed, by hand."""

DRIFT = "drift_airspeed"
"""Disturbance: d/dt of the commanded airspeed, m/s^2, by which the trim moves away."""

VELOCITIES, RATES, ATTITUDES = ("u", "v", "w"), ("p", "q", "r"), ("phi", "theta")

LQR_GROUPS = (VELOCITIES, RATES, ATTITUDES, CONTROLS)
"""Of the LQR, deviations whose sizes share a factor."""
LPV_GROUPS = (VELOCITIES, (*RATES, *ATTITUDES), GUSTS, (DRIFT,))
"""Of the LPV controllers: noise, noise, disturbances, the drift."""

FOUND_LQR = (0.0, 0.0, 0.0, 0.0)
FOUND_LPV = (0.0, 0.0, 0.0, 0.0)
"""Powers of 2 of the factors on each group, from `python -m evidence.flown.tuning`."""


def every(folder: Path | None = None) -> Iterator[Design]:
    """Every design, the study's first; those that are in the folder are not made again."""
    vehicle = OfVehicle(name=VEHICLE, folder=folder)
    yield from vehicle.designs()
    plant = flown_plant(baseline(vehicle.heli))
    for name in OWN:
        what = f"{name} {FOUND_LQR} {FOUND_LPV} {PD_GAINS}"
        (found,) = vehicle.kept("design", what, partial(_made, name, vehicle.heli, plant))
        yield found


def _made(name: str, heli: Helicopter, plant: Plant) -> list[Design]:
    ways = {
        PD: pd,
        STRUCTURED: lambda: gain_table.tuned(heli).model,
        RETUNED: lambda: retuned(heli),
        TOLD: lambda: told(heli),
        TOLD_IDENTIFIED: told_identified,
    }
    return design(name, ways[name], plant)


def pd() -> LPVStateSpace:
    """The PD, static and the same at every airspeed."""
    gains = np.zeros((len(CONTROLS), len(MEASUREMENTS)))
    for (u, y), gain in PD_GAINS.items():
        gains[CONTROLS.index(u), MEASUREMENTS.index(y)] = gain
    return symheli.LPVStateSpace.polynomial(
        A=[np.zeros((0, 0))],
        B=[np.zeros((0, len(MEASUREMENTS)))],
        C=[np.zeros((len(CONTROLS), 0))],
        D=[gains],
        scheduling=symheli.Scheduling("airspeed", "m/s", 0.0, TOP, rate=RATE),
        states=[],
        inputs=MEASUREMENTS,
        outputs=CONTROLS,
        dt=PERIOD,
    )


def retuned(heli: Helicopter, powers: tuple[float, ...] = FOUND_LQR) -> LPVStateSpace:
    """The LQR schedule for the sizes of the study, each group of them times 2 to a power."""
    sizes = _scaled(SIZES, LQR_GROUPS, powers)
    autopilot = symheli.gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, AIRSPEEDS, XCELL_SERVOS, sizes)
    return autopilot.scheduled_controller.model


def asked(powers: tuple[float, ...] = FOUND_LPV) -> Asked:
    """The study's specification with the drift of the trim and, on every control, a disturbance
    of the size of a command; noise and disturbances times 2 to a power.
    """
    noise = _scaled(STUDY.noise, LPV_GROUPS[:2], powers[:2])
    sizes = _scaled({**STUDY.sizes, DRIFT: RATE}, LPV_GROUPS[2:], powers[2:])
    return replace(STUDY, disturbances=(*GUSTS, DRIFT, *CONTROLS), sizes=sizes, noise=noise)


def told(heli: Helicopter, powers: tuple[float, ...] = FOUND_LPV, **options: Any) -> Controller:
    """Output feedback on the baseline for `asked`."""
    wanted = asked(powers)
    model = disturbed(baseline(heli).with_trim_drift(), wanted)
    return output_feedback(design_plant(model, asked=wanted), RATE, **(SLOW | options))


def told_identified(powers: tuple[float, ...] = FOUND_LPV, seed: int = 0) -> Controller:
    """The same on the identified model of the study, whose drift is that of u alone: its trim in
    the other states moves little.
    """
    wanted = asked(powers)
    model = disturbed(with_drift_of_airspeed(identified_model(identified(VEHICLE, seed))), wanted)
    return output_feedback(design_plant(model, 0.0, wanted), RATE, **SLOW)


def with_drift_of_airspeed(model: LPVStateSpace) -> LPVStateSpace:
    """A model in continuous time with `DRIFT` as an input: u falls behind its command by it."""
    column = np.zeros((*model.B.shape[:2], 1))
    column[:, model.states.index("u"), 0] = -model.basis.constant()
    return replace(
        model,
        B=np.concatenate([model.B, column], axis=2),
        D=np.concatenate([model.D, np.zeros((*model.D.shape[:2], 1))], axis=2),
        inputs=(*model.inputs, Signal(DRIFT, "m/s^2")),
        trim=None,
        residuals=None,
    )


def scheduled(found: Design) -> ScheduledController:
    """What flies of a design that exists."""
    assert found.controller is not None  # noqa: S101
    return ScheduledController(found.controller)


def _scaled(
    values: Mapping[str, float], groups: tuple[tuple[str, ...], ...], powers: tuple[float, ...]
) -> dict[str, float]:
    factors = {n: 2.0**k for group, k in zip(groups, powers, strict=True) for n in group}
    return {name: value * factors.get(name, 1.0) for name, value in values.items()}
