"""Handling qualities in the small: bandwidth and phase delay of the attitude response."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from symheli import LinearModel
from symheli.errors import InputError
from symheli.values.numbers import whole


class Bandwidth(NamedTuple):
    """phase_bandwidth: where 45 deg of phase are left; gain_bandwidth: where 6 dB of gain are left
    before omega_180, at which the response lags 180 deg (rad/s, inf where the band ends before);
    phase_delay (s): how fast the phase falls beyond omega_180; NaN where the response lags 180 deg
    nowhere in the band, or half the sampling frequency comes before 2 omega_180.
    """

    phase_bandwidth: float
    gain_bandwidth: float
    omega_180: float
    phase_delay: float

    @property
    def rate_response(self) -> float:
        """Bandwidth of a rate response type, rad/s: the smaller one."""
        return min(self.phase_bandwidth, self.gain_bandwidth)

    @property
    def attitude_response(self) -> float:
        """Bandwidth of an attitude response type, rad/s: that of the phase."""
        return self.phase_bandwidth


def attitude_bandwidth(
    model: LinearModel,
    band: tuple[float, float] = (1.0, 60.0),
    points: int = 2000,
    *,
    command: bool = False,
) -> Bandwidth:
    """Compute the ADS-33 bandwidth and phase delay of an attitude response.

    Parameters
    ----------
    model : LinearModel
        One input, one output: rad per rad of stick. Put servos and delays into it first; a response
        of opposite sign is turned round, unless it is that to a `command`.
    band : (float, float)
        Searched, rad/s; its lower end lies above the phugoid, where attitude already integrates
        rate (phase near -90 deg).
    points : int
        Of the frequency grid.
    command : bool
        The input is the commanded attitude, which the response follows: in phase with it, or up to
        half a turn away, at the lower end of the band.

    Returns
    -------
    Bandwidth
        In rad/s, and the phase delay in s.

    Raises
    ------
    InputError
        For several channels, an empty band or no response.

    References
    ----------
    ADS-33E-PRF (2000), figure 5.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> A, B = [[-4.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]]  # 1/(s (s + 4)): 45 deg left at 4 rad/s
    >>> roll = LinearModel(A, B, [[0.0, 1.0]], [[0.0]], ["p", "phi"], ["d_lat"], ["phi"])
    >>> print(f"{attitude_bandwidth(roll).attitude_response:.2f} rad/s")
    4.00 rad/s
    """
    if len(model.inputs) != 1 or len(model.outputs) != 1:
        raise InputError(
            f"bandwidth is that of one attitude to one stick, got {len(model.inputs)} inputs and"
            f" {len(model.outputs)} outputs"
        )
    if len(band) != 2:
        raise InputError(f"band: expected (low, high) in rad/s, got {band!r:.80}")
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band: expected 0 < low < high rad/s, got {band}")
    top = 2 * high if model.dt is None else min(2 * high, 0.999 * math.pi / model.dt)
    grid = np.geomspace(low, top, whole(points, "points", 2))
    values = model.frequency_response(grid)[:, 0, 0]
    if np.any(values == 0):
        raise InputError(f"{model.outputs[0]} does not respond to {model.inputs[0]}")
    phase = np.unwrap(np.angle(values))
    # within half a turn of the -90 deg of an integrated rate; the sign of the stick is a convention
    if not command:
        phase += np.pi * np.round((-np.pi / 2 - phase[0]) / np.pi)

    def lag(omega: float) -> float:
        value = complex(model.frequency_response([omega])[0, 0, 0])
        near = float(np.interp(omega, grid, phase))
        angle = math.atan2(value.imag, value.real)
        return angle + math.pi * round((near - angle) / math.pi)

    def gain(omega: float) -> float:
        return abs(complex(model.frequency_response([omega])[0, 0, 0]))

    def first(values: np.ndarray, function, level: float, end: float) -> float:
        below = np.flatnonzero(
            (values[1:] <= level) & (values[:-1] > level) & (grid[1:] <= end * (1 + 1e-9))
        )
        if not len(below):
            return math.inf
        k = int(below[0])
        return float(brentq(lambda w: function(w) - level, grid[k], grid[k + 1], xtol=1e-10))  # type: ignore[arg-type]

    omega_180 = first(phase, lag, -math.pi, high)
    phase_bandwidth = first(phase, lag, -0.75 * math.pi, high)
    if math.isinf(omega_180):
        return Bandwidth(phase_bandwidth, math.inf, math.inf, math.nan)
    gain_bandwidth = first(np.abs(values), gain, 2 * gain(omega_180), omega_180)
    twice = 2 * omega_180
    delay = (-math.pi - lag(twice)) / twice if twice <= top else math.nan
    return Bandwidth(phase_bandwidth, gain_bandwidth, omega_180, delay)
