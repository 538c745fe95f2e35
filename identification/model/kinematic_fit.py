"""What surrounds the regression of a `KinematicARX`: the trim its kinematics are linear about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.design.excitation import column_scale
from identification.structure.kinematic_arx import STATES, KinematicARX
from identification.structure.regressors import basis_values, scheduling_values, units_of
from symheli.records import FlightRecord
from symheli.values.arrays import Array

NEGLIGIBLE = 1e-6
"""Directions of the regressors weaker than this part of the strongest say nothing of a trim."""


def mean_trim(kin: KinematicARX, records: Sequence[FlightRecord]) -> Array:
    """(basis size, 8): what is flown where p stands still.

    Least squares of the states on the functions of p and, where p is one parameter, on those
    times its rate: trims depend on it. Where the first
    parameter is a speed, u makes the velocity up to that, less a constant headwind: a mean over few
    passes would rather tell how the controller lags behind.
    """
    aero, size = kin.aerodynamics, kin.basis.size
    rows, states, parameters = [], [], []
    for record in records:
        p = scheduling_values(aero, record).reshape(len(record), -1)
        f = basis_values(aero, p[:, 0] if p.shape[1] == 1 else p)
        rate = record.slope(p) if p.shape[1] == 1 else np.zeros((len(p), 0))
        rows.append(np.hstack([f, *(f * column[:, None] for column in rate.T)]))
        states.append(record.columns(STATES))
        parameters.append(p)
    F, y, p = np.vstack(rows), np.vstack(states), np.vstack(parameters)
    known = np.isfinite(F).all(axis=1) & np.isfinite(y).all(axis=1)
    F, y, p = F[known], y[known], p[known]
    scale = column_scale(F)
    found = np.linalg.lstsq(F / scale, y, rcond=NEGLIGIBLE)[0][:size] / scale[:size, None]
    if units_of(aero.parameters[:1], records)[0].unit == "m/s":
        found[:, 0] = _forward_speed(F[:, :size], y, p[:, 0], F[:, :size] @ found[:, 1:3])
    return found


def _forward_speed(f: Array, y: Array, airspeed: Array, across: Array) -> Array:
    """Coefficients (size,) of u where u^2 + `across`^2 is the airspeed less the headwind."""
    fast = airspeed >= np.median(airspeed)
    headwind = np.mean(airspeed[fast] - np.linalg.norm(y[fast, :3], axis=1))
    square = np.maximum(airspeed - headwind, 0.0) ** 2 - np.sum(across**2, axis=1)
    return np.linalg.lstsq(f, np.sqrt(np.maximum(square, 0.0)), rcond=None)[0]
