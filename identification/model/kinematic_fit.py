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

    Least squares of the states on the functions of p, and on those times its rate. Where the first
    parameter is a speed, u is that and a constant, the headwind: a mean over few passes would
    rather tell how the controller lags behind.
    """
    aero, size = kin.aerodynamics, kin.basis.size
    rows, states, parameters = [], [], []
    for record in records:
        p = scheduling_values(aero, record).reshape(len(record), -1)
        f = basis_values(aero, p[:, 0] if p.shape[1] == 1 else p)
        rows.append(np.hstack([f, *(f * column[:, None] for column in record.slope(p).T)]))
        states.append(record.columns(STATES))
        parameters.append(p)
    F, y, p = np.vstack(rows), np.vstack(states), np.vstack(parameters)
    known = np.isfinite(F).all(axis=1) & np.isfinite(y).all(axis=1)
    F, y, p = F[known], y[known], p[known]
    scale = column_scale(F)
    found = np.linalg.lstsq(F / scale, y, rcond=NEGLIGIBLE)[0][:size] / scale[:size, None]
    if units_of(aero.parameters[:1], records)[0].unit == "m/s":
        along = np.linalg.lstsq(F[:, :size], p[:, 0] + np.mean(y[:, 0] - p[:, 0]), rcond=None)[0]
        found[:, 0] = along
    return found
