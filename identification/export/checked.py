"""Data of the check programs: records to compute with, what Python computes from them, and how far
other machines may be off.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np

from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from symheli.errors import InputError
from symheli.export.c_text import check_data
from symheli.records import FlightRecord
from symheli.values.arrays import Array

TOLERANCE = {"double": 1e-9, "single": 1e-3}
"""Largest difference of another compiler or processor, relative to max(1, size): it may contract
products and sums.
"""

ORDINARY = 0.1
"""Size of the states and inputs of a rigid vehicle in a check: angles and rates of a flight."""


def number_type(precision: Literal["double", "single"]) -> type[np.floating]:
    """The NumPy type of a precision; raises `InputError` for another word."""
    if precision not in TOLERANCE:
        raise InputError(f'precision: expected "double" or "single", got {precision!r}')
    return np.float32 if precision == "single" else np.float64


def samples(
    signals: int, ranges: Iterable[tuple[float, float]], count: int, size: float = 1.0
) -> Array:
    """Rows of `signals` normal numbers (standard deviation `size`) and a point of the ranges, the
    sample in the middle missing: numbers to compute with, no flight.
    """
    rng = np.random.default_rng(0)
    points = [low + (high - low) * rng.uniform(size=count) for low, high in ranges]
    rows = np.column_stack([rng.standard_normal((count, signals)), *points])
    rows[:, :signals] *= size
    rows[count // 2, 0] = np.nan
    return rows


def model_cases(
    model: LPVARXModel | KinematicModel, name: str, precision: Literal["double", "single"]
) -> str:
    """A record of a fixed seed, one sample missing, with one-step predictions, and the free run up
    to the missing sample.
    """
    dtype, outputs = number_type(precision), f"{name.upper()}_NY"
    memory, wide = model.structure.memory, len(model.outputs) + len(model.inputs)
    count, size = 2 * memory + 60, ORDINARY if isinstance(model, KinematicModel) else 1.0
    given = samples(wide, model.structure.basis.ranges, count, size).astype(dtype).astype(float)
    record = FlightRecord(
        model.dt * np.arange(count), given, (*model.outputs, *model.inputs, *model.parameters)
    )
    complete = np.logical_and.reduce(np.isfinite(given), axis=1)
    there = [k for k in range(memory, count) if complete[k - memory : k].all()]
    free = record.columns(map(str, model.outputs))[: count // 2].copy()
    free[memory:] = model.simulate(record)[memory : count // 2]
    return check_data(
        {
            "SAMPLES": count,
            "THERE": len(there),
            "HALF": count // 2,
            "TOLERANCE": TOLERANCE[precision],
        },
        f"{name}_real",
        dtype,
        samples=(str(given.shape[1]), given),
        predicted=(outputs, model.predict(record, 1)[there]),
        simulated=(outputs, free),
    )
