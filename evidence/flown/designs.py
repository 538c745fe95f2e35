"""The controllers that fly: those of the study, a PD, the gain table, and the LQR and the LPV
controllers that `evidence.flown.tuning` found.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import symheli
from evidence import gain_table
from evidence.tables import DOCS, marked
from studies.campaigns.trials.control import identified
from studies.controllers.design_choices import (
    CONTROLS,
    GUSTS,
    MEASUREMENTS,
    PERIOD,
    RATE,
    SIZES,
    TOP,
)
from studies.controllers.designs import AIRSPEEDS, Design, design
from studies.controllers.identified_plant import identified_model
from studies.controllers.plant import STUDY, baseline, design_plant, disturbed, flown_plant
from studies.specs.of_vehicle import OfVehicle
from symheli import Helicopter, LinearModel, LPVStateSpace
from symheli.flight import XCELL_SERVOS
from symheli.values.signal import Signal
from synthesis import Controller, Plant, lqg

VEHICLE = "xcell60"
PD, STRUCTURED = "PD", "structured"
RETUNED = "LQR schedule, retuned"
SLOW, SLOW_IDENTIFIED = "LPV, slow disturbances", "LPV, slow disturbances, identified model"
OWN = (PD, STRUCTURED, RETUNED, SLOW, SLOW_IDENTIFIED)
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

Powers = tuple[float, ...]

DRIFT = "drift_airspeed"
"""Disturbance: d/dt of the commanded airspeed, m/s^2, by which the trim moves away."""

VELOCITIES, RATES, ATTITUDES = ("u", "v", "w"), ("p", "q", "r"), ("phi", "theta")

GAINS = r"\| (\w+_[PI]) " + 3 * r"\| (\S+) "
"""A row of the gain table on its page: a name and its values at the ends and the middle."""

LQR_GROUPS = (VELOCITIES, RATES, ATTITUDES, CONTROLS)
"""Of the LQR, deviations whose sizes share a factor."""
LPV_GROUPS = (MEASUREMENTS, CONTROLS, GUSTS, (DRIFT,))
"""Of the LPV controllers: noise, and disturbances at the controls, gusts, drift."""

SLOW_FOR = {
    **dict.fromkeys(CONTROLS, 2.0),
    **dict(zip(GUSTS, (8.0, 8.0, 2.0), strict=True)),
    DRIFT: 1.0,
}
"""Time constants of the disturbances, s: of gusts about a scale of the turbulence at 20 m over the
airspeed, of the drift about a quarter of a transition.
"""

FOUND_LQR = (0.122, 0.2, -0.602, 0.315)
FOUND_LPV = (0.792, 0.313, 1.16, -3.758)
"""Powers of 2 of the factors on each group, from `python -m evidence.flown.tuning`."""

KNOTS = 7
"""Airspeeds of the LPV controllers."""


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
        STRUCTURED: lambda: structured(plant),
        RETUNED: lambda: retuned(heli),
        SLOW: lambda: lpv_for_slow(heli),
        SLOW_IDENTIFIED: lpv_for_slow_identified,
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


def structured(plant: Plant) -> LPVStateSpace:
    """The gain table of docs/appendix/structured.md: three values of a gain are its parabola."""
    free = gain_table.structure(plant)
    assert free.basis is not None
    _, text = marked(DOCS / "structured.md", "gain table")
    cells = {row[0]: row[1:] for row in re.findall(GAINS, text)}
    values = {gain.name: np.array(cells[gain.name], float) for gain in free.gains}
    V = np.linspace(0.0, TOP, gain_table.DEGREE + 1)
    gains = {name: free.basis.fit(V, of) for name, of in values.items()}
    return free.controller(gains, plant.parameters)


def retuned(heli: Helicopter, powers: Powers = FOUND_LQR) -> LPVStateSpace:
    """The LQR schedule for the sizes of the study, each group of them times 2 to a power."""
    sizes = _scaled(SIZES, powers, LQR_GROUPS)
    autopilot = symheli.flight.gain_scheduled_lqr(
        heli, 0.0, TOP, PERIOD, AIRSPEEDS, XCELL_SERVOS, sizes
    )
    return autopilot.scheduled_controller.model


def lpv_for_slow(heli: Helicopter, powers: Powers = FOUND_LPV) -> Controller:
    """LQG controllers of the baseline over airspeed, for what a transition in turbulence does."""
    model = baseline(heli).with_trim_drift()
    return lqg(plant_for_slow(model, powers), np.linspace(0.0, TOP, KNOTS))


def lpv_for_slow_identified(powers: Powers = FOUND_LPV, seed: int = 0) -> Controller:
    """The same of the identified model of the study, whose drift is that of u alone: the trim of
    the other states moves little.
    """
    model = with_drift_of_airspeed(identified_model(identified(VEHICLE, seed)))
    return lqg(plant_for_slow(model, powers, 0.0), np.linspace(0.0, TOP, KNOTS))


def plant_for_slow(
    model: LPVStateSpace, powers: Powers = FOUND_LPV, held: float = PERIOD / 2
) -> Plant:
    """The study's plant with the drift of the trim and a disturbance at every control, of the size
    of a command; all disturbances are slow (`SLOW_FOR`), of their size in root mean square, and
    times 2 to a power.
    """
    sampled = np.sqrt(PERIOD)  # of a sequence of variance 1, as white noise in continuous time
    asked = replace(
        STUDY,
        disturbances=(*GUSTS, DRIFT, *CONTROLS),
        sizes={**STUDY.sizes, DRIFT: RATE},
        noise={y: size * sampled for y, size in _scaled(STUDY.noise, powers).items()},
    )
    plant = design_plant(disturbed(model, asked), held, asked)
    factors = _scaled(dict.fromkeys(SLOW_FOR, 1.0), powers)
    colours = {n: slow(asked.disturbance(n), factors[n], SLOW_FOR[n]) for n in SLOW_FOR}
    return plant.weighted({asked.disturbance(n): one for n, one in colours.items()})


def slow(name: str, size: float, seconds: float) -> LinearModel:
    """White noise of intensity 1 to a signal of this root mean square and time constant."""
    a = 1 / seconds
    signal = (Signal(name, "1"),)
    state = (Signal(f"{name}_slow", "1"),)
    b = size * np.sqrt(2 * a)
    A, B, C, D = (np.array([[entry]]) for entry in (-a, b, 1.0, 0.0))
    return LinearModel(A, B, C, D, state, signal, signal)


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


def _scaled(
    values: Mapping[str, float], powers: Powers, groups: Sequence[Sequence[str]] = LPV_GROUPS
) -> dict[str, float]:
    factors = {n: 2.0**k for group, k in zip(groups, powers, strict=True) for n in group}
    return {name: value * factors.get(name, 1.0) for name, value in values.items()}
