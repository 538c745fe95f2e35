"""How fast the airspeed of a recorded flight changes, and how fast that changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from symheli import FlightRecord
from symheli.errors import InputError

WINDOW = 1.0
"""Length (s) of the cubics fitted to the airspeed: longer than the periods of the excitation that
shake it, shorter than a ramp.
"""


class Fastest(NamedTuple):
    """Largest |dV/dt| (m/s^2) and |d2V/dt2| (m/s^3) of one flight."""

    acceleration: float
    jerk: float


def fastest(flight: FlightRecord, window: float = WINDOW, signal: str = "airspeed") -> Fastest:
    """Of cubics fitted to `signal` over `window` s about every sample.

    Raises `InputError` where the window holds fewer than 5 samples or more than the record.
    """
    samples = 2 * round(0.5 * window / flight.dt) + 1
    airspeed = flight[signal]
    if not 5 <= samples <= len(airspeed):
        raise InputError(
            f"a window of {window:g} s holds {samples} of {len(airspeed)} samples: expected 5 of"
            " them or more, and no more than there are"
        )
    first, second = (
        np.asarray(savgol_filter(airspeed, samples, 3, deriv=k, delta=flight.dt)) for k in (1, 2)
    )
    return Fastest(float(np.abs(first).max()), float(np.abs(second).max()))
