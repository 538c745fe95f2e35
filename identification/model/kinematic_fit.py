"""Trim of a `KinematicARX` about which its kinematics are linear."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.design.excitation import column_scale
from identification.structure.kinematic_arx import STATES, KinematicARX
from identification.structure.regressors import basis_values, scheduling_values, units_of
from symheli.records import FlightRecord
from symheli.values.arrays import Array

NEGLIGIBLE = 1e-6
"""Directions of the regressors weaker than this fraction of the strongest do not determine a trim.
"""


def mean_trim(kin: KinematicARX, records: Sequence[FlightRecord]) -> Array:
    """Return the trim coefficients (basis size, 8): the mean flight at constant p.

    Least squares of the states on the functions of p and, where p is one parameter, on those
    times its rate: trims depend on it. Where the first parameter is a speed, the velocity is that
    of level flight without sideslip at this airspeed and attitude: not that over ground, nor that
    at which a controller lags behind.
    """
    aero, size = kin.aerodynamics, kin.basis.size
    rows, states, parameters = [], [], []
    records = [aero.prepared(record) for record in records]
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
        found[:, :3] = np.linalg.lstsq(
            F[:, :size], _level(F[:, :size] @ found, p[:, 0]), rcond=None
        )[0]
    return found


def _level(trim: Array, airspeed: Array) -> Array:
    """Return u v w (n, 3) of level flight at an airspeed without sideslip, at roll and pitch of a
    trim (n, 8).
    """
    climb = np.arctan(np.tan(trim[:, 7]) / np.cos(trim[:, 6]))
    return np.column_stack([airspeed * np.cos(climb), 0 * airspeed, airspeed * np.sin(climb)])
