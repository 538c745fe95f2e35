"""Sticks to deflections: gains, mixing and lags of the controls, from the record of a flight."""

from __future__ import annotations

import numpy as np

from evidence.ah1s.simulator import DEFLECTIONS, STICKS
from symheli.errors import AccuracyError
from symheli.lpv import LinearModel
from symheli.records import FlightRecord
from symheli.values import Signal

LEFT = 1e-6
"""rad; what the deflections may leave unexplained, recorded without noise as they are."""


def servos(record: FlightRecord) -> LinearModel:
    """Deflections (4) from sticks (4), sampled: r(k+1) = a r(k) + b s(k) + c s(k-1) + offset by
    least squares. Raises `AccuracyError` where the record is not explained so.
    """
    r, s = (record.columns(map(str, names)) for names in (DEFLECTIONS, STICKS))
    rows = np.hstack([r[1:-1], s[1:-1], s[:-2], np.ones((len(r) - 2, 1))])
    found = np.linalg.lstsq(rows, r[2:], rcond=None)[0]
    left = float(np.abs(rows @ found - r[2:]).max())
    if left > LEFT:
        raise AccuracyError(
            f"deflections do not follow the sticks by one lag each: {left:.2g} rad is left"
        )
    a, b, c = (found[4 * i : 4 * i + 4].T for i in range(3))
    none, one = np.zeros((4, 4)), np.eye(4)
    earlier = tuple(Signal(f"{stick}_earlier", "1") for stick in STICKS)
    return LinearModel(
        np.block([[a, c], [none, none]]),
        np.vstack([b, one]),
        np.hstack([one, none]),
        none,
        (*DEFLECTIONS, *earlier),
        STICKS,
        DEFLECTIONS,
        dt=record.dt,
    )
