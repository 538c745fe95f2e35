"""Predictions of a model one second ahead, compared with the states without noise."""

from __future__ import annotations

import symheli
from identification.judge import fit_percent
from studies.setup.axes import ALL
from symheli import FlightRecord, Helicopter
from symheli.values.arrays import Array

OUTPUTS = ALL.outputs
HORIZON = 50
"""Samples ahead: one second."""


def states_of(heli: Helicopter, record: FlightRecord) -> Array:
    """The states (n, 8) without noise, flown once more with the recorded inputs."""
    inputs = record.columns(heli.inputs)
    start = symheli.trim(heli, float(record["airspeed_command"][0]))
    flown = symheli.simulate(heli, start, inputs, dt=record.dt).to_record()
    return flown.columns(OUTPUTS)[: len(record)]


def fits_of(truth: Array, guess: Array) -> dict[str, float]:
    """Return the fits in percent, by output."""
    return dict(zip(OUTPUTS, fit_percent(truth, guess).tolist(), strict=True))
