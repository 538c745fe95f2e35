"""The specification sheet of a designed table over airspeed, and its responses to commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import symheli
from studies.controllers.design_choices import SERVO_RATE, DesignChoices
from studies.controllers.plant import behind_servos
from symheli import Helicopter, LinearFamily, LinearModel, LPVStateSpace, TableController
from symheli.lpv.tools import Actuation
from symheli.values.arrays import Array
from synthesis.sheet.evaluation import (
    SpecificationTable,
    axis_loops,
    driven_plant,
    frozen_controller,
    specifications,
)
from synthesis.sheet.sheet import Sheet

POINTS = 7
"""Airspeeds of the sheet."""
WINDOW = 4.0
"""Length of a response, s."""
NAME = "controller"


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """A sheet, and by axis and airspeed (m/s) the response to a step of its command: (times,
    response, control), for a command of 1.
    """

    table: SpecificationTable
    steps: dict[str, dict[float, tuple[Array, Array, Array]]]


def judged(
    table: TableController, model: LPVStateSpace, choices: DesignChoices, *, exact: bool
) -> Judged | None:
    """Return the sheet of a table; None where it has none of the axes.

    `exact`: the vehicle is linearized at every airspeed; otherwise the loop is that of the model.
    """
    low, high = choices.airspeeds
    speeds = np.linspace(low, high, POINTS).tolist()
    travel = travel_of(choices)
    sheet = sheet_of(choices)
    if not any(
        axis.control in table.outputs and axis.response in table.inputs
        for axis in sheet.axes.values()
    ):
        return None
    plant, actuation = controlled(model, choices, speeds, exact=exact)
    found = specifications(
        plant,
        {NAME: table.model},
        sheet,
        at=speeds,
        servos=actuation,
        travel=travel,
        rate_limit=dict.fromkeys(choices.controls, SERVO_RATE),
    )
    steps: dict[str, dict[float, tuple[Array, Array, Array]]] = {}
    for v in (speeds[0], speeds[POINTS // 2], speeds[-1]):
        bare: LinearModel = plant.at(v)
        K = frozen_controller(table.model, bare, found.parameter, v)
        behind = driven_plant(bare, K, actuation)
        for name, loop in axis_loops(behind, K, sheet).items():
            if loop.stable:
                made = loop.closed.step_response(WINDOW)
                steps.setdefault(name, {})[v] = made.time, *made.values[:, :2, 0].T
    return Judged(table=found, steps=steps)


def sheet_of(choices: DesignChoices) -> Sheet:
    """Return the specification sheet, at the size of the vehicle where there is one."""
    sheet = Sheet.load()
    if not choices.vehicle:
        return sheet
    heli = Helicopter.load(choices.vehicle, governor="ideal")
    return sheet.at_length(heli.vehicle.sections["main_rotor"]["radius"].value)


def controlled(
    model: LPVStateSpace, choices: DesignChoices, speeds: Sequence[float], *, exact: bool
) -> tuple[LinearFamily | LPVStateSpace, Actuation]:
    """Return what is controlled, from controls to measurements, and what stands before it: the
    linearizations of the vehicle at airspeeds (m/s), or the model behind its servos.
    """
    if exact:
        heli = Helicopter.load(choices.vehicle, governor="ideal")
        family = symheli.sweep(heli, list(speeds), inputs=choices.controls)
        return family.select(choices.states) if choices.states else family, choices.actuation
    plant = behind_servos(model, replace(choices, references=())).nominal
    return plant.select(inputs=choices.controls, outputs=choices.measurements), Actuation()


def travel_of(choices: DesignChoices) -> dict[str, float]:
    """Return the largest deflection of each control, rad; none without a vehicle."""
    if not choices.vehicle:
        return {}
    heli = Helicopter.load(choices.vehicle, governor="ideal")
    every = dict(zip(map(str, heli.inputs), map(float, heli.travel), strict=True))
    return {u: every[u] for u in choices.controls if u in every}
