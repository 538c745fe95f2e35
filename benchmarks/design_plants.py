"""Plants of the X-Cell for a gain-scheduled output feedback, of 7 to 22 states, and the sampled one
that the controller flies on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import symheli
from symheli import LinearModel
from symheli.flight import XCELL_SERVOS
from synthesis import Plant

LOW, HIGH, POINTS = 0.0, 13.0, 27
RATE = 3.0
"""Acceleration, m/s^2."""
DT = 0.02
BANDWIDTH = 15.0
"""Of the servos that a design is told of, rad/s."""

GUST = 2.0
SIZES = {
    "u": 2.0,
    "v": 2.0,
    "w": 2.0,
    "p": 2.0,
    "q": 2.0,
    "r": 0.3,
    "phi": 0.2,
    "theta": 0.2,
    "d_lat": 0.009,
    "d_ped": 0.03,
    "d_lon": 0.009,
    "d_col": 0.009,
}
"""What counts as 1, SI."""
NOISE = {"u": 0.9, "v": 0.9, "w": 0.9, "p": 0.09, "q": 0.09, "r": 0.09, "phi": 0.03, "theta": 0.03}


class Axes(NamedTuple):
    """Which states, inputs, gusts and measurements of the helicopter."""

    states: tuple[str, ...]
    controls: tuple[str, ...]
    gusts: tuple[str, ...]
    measured: tuple[str, ...]


LATERAL = Axes(("v", "p", "r", "phi", "b1"), ("d_lat", "d_ped"), ("v_w",), ("v", "p", "r", "phi"))
ALL = Axes(
    ("u", "v", "w", "p", "q", "r", "phi", "theta", "a1", "b1"),
    ("d_lon", "d_lat", "d_col", "d_ped"),
    ("u_w", "v_w", "w_w"),
    ("u", "v", "w", "p", "q", "r", "phi", "theta"),
)
DESIGNS = {7: (LATERAL, 0), 14: (ALL, 0), 18: (ALL, 1), 22: (ALL, 2)}
"""Axes and order of the delay at each control, by the number of states they lead to with a servo
of first order at each.
"""


def design_plant(states: int, degree: int = 3) -> Plant:
    """In continuous time, entries of `degree` in the airspeed."""
    axes, delay = DESIGNS[states]
    servos = {
        u: LinearModel(
            [[-BANDWIDTH]], [[BANDWIDTH]], [[1.0]], [[0.0]], (f"{u}_lag",), (f"{u}_command",), (u,)
        )
        for u in axes.controls
    }
    plant = _bare(axes, degree).with_servo(servos)
    return _weighted(plant.with_delay(DT, order=delay) if delay else plant, axes)


def flying_plant(axes: Axes) -> Plant:
    """True servos, sampled, every command one sample late."""
    servos = {u: XCELL_SERVOS[u] for u in axes.controls}
    plant = _bare(axes, 3).with_servo(servos).sampled(DT, degree=4).with_delay(DT)
    return _weighted(plant, axes)


def _bare(axes: Axes, degree: int) -> Plant:
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    inputs = (*axes.controls, *axes.gusts)
    family = symheli.sweep(heli, np.linspace(LOW, HIGH, POINTS), inputs=inputs)  # type: ignore[arg-type]
    model = family.select(axes.states, inputs).interpolate("polynomial", degree, rate=RATE)
    return Plant(
        model,
        disturbances=axes.gusts,
        performance=(*axes.measured, *axes.controls),
        controls=axes.controls,
        measurements=axes.measured,
    )


def _weighted(plant: Plant, axes: Axes) -> Plant:
    weights = dict.fromkeys(axes.gusts, GUST)
    weights |= {name: 1 / SIZES[name] for name in (*axes.measured, *axes.controls)}
    return plant.weighted(weights).with_noise({y: NOISE[y] for y in axes.measured})
