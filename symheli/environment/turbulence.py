"""Continuous turbulence near the ground: Dryden's spectra, realized exactly at the samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError

FOOT = 0.3048
LOWEST, HIGHEST = 10 * FOOT, 1000 * FOOT  # m above ground, range of the low-altitude model


@dataclass(frozen=True)
class Dryden:
    """Dryden turbulence below 1000 ft.

    With h in feet and c = 0.177 + 0.000823 h: sigma_w = 0.1 wind, sigma_u = sigma_v =
    sigma_w/c^0.4; L_w = h/2, L_u = h/c^1.2, L_v = L_u/2. The field is frozen in the air: it changes
    with the distance flown through it, not with time.

    Parameters
    ----------
    wind : float
        Mean wind 20 ft above ground, m/s; 15, 30, 45 kt (7.7, 15.4, 23.2 m/s) are called light,
        moderate, severe.
    altitude : float
        Of flight above ground, m.

    Raises
    ------
    InputError
        An altitude outside 10 .. 1000 ft.

    References
    ----------
    MIL-HDBK-1797 (1997), appendix A, 4.9.2; MIL-F-8785C defines the same processes with lengths L_v
    and L_w twice as large and the factors 2 left out of its spectra.

    Examples
    --------
    >>> light = symheli.Dryden(wind=7.7, altitude=30.0)
    >>> light.intensities.round(2)
    array([1.32, 1.32, 0.77])
    >>> light.history(np.arange(0.0, 10.0, 0.02), airspeed=8.0, seed=1).shape
    (500, 3)
    """

    wind: float
    altitude: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.wind) and self.wind >= 0):
            raise InputError(f"wind: expected a mean wind >= 0 m/s at 20 ft, got {self.wind}")
        if not LOWEST - 1e-9 <= self.altitude <= HIGHEST + 1e-9:
            raise InputError(
                f"altitude: Dryden's low-altitude form holds for {LOWEST:.2f} .. {HIGHEST:.1f} m"
                f" above ground, got {self.altitude}"
            )

    @property
    def intensities(self) -> np.ndarray:
        """(sigma_u, sigma_v, sigma_w), m/s."""
        vertical = 0.1 * self.wind
        level = vertical / self._shear**0.4
        return np.array([level, level, vertical])

    @property
    def lengths(self) -> np.ndarray:
        """(L_u, L_v, L_w), m."""
        longitudinal = self.altitude / self._shear**1.2
        return np.array([longitudinal, longitudinal / 2, self.altitude / 2])

    @property
    def _shear(self) -> float:
        return 0.177 + 0.000823 * self.altitude / FOOT

    def spectrum(self, omega: object, airspeed: float) -> np.ndarray:
        """One-sided power spectral densities (3, n) of u_g, v_g, w_g, (m/s)^2/(rad/s), at `omega`
        (n,) rad/s.

        Their integrals are sigma^2.
        """
        if not airspeed > 0:
            raise InputError(
                f"airspeed: a spectrum over time needs an airspeed > 0 m/s, got {airspeed}"
            )
        reach = self.lengths[:, None] * np.asarray(omega, float) / airspeed
        size = self.intensities[:, None] ** 2 * 2 * self.lengths[:, None] / (np.pi * airspeed)
        shape = (1 + 12 * reach**2) / (1 + 4 * reach**2) ** 2
        shape[0] = 1 / (1 + reach[0] ** 2)
        return size * shape

    def history(self, time: object, airspeed: object, seed: int = 0) -> np.ndarray:
        """Turbulence velocities (n, 3) along, across (right) and down, m/s, met at `time` (n,) s.

        `airspeed` ((n,) or one, m/s) is that of the flight through the field. Stationary from the
        first sample; variance and correlation are exact at the samples whatever the step. The same
        `seed` gives the same field along the same path.
        """
        time = np.asarray(time, float)
        speed = np.broadcast_to(np.asarray(airspeed, float), time.shape)
        if (
            time.ndim != 1
            or len(time) == 0
            or not np.all(np.isfinite(time))
            or np.any(np.diff(time) <= 0)
        ):
            raise InputError("time: expected increasing finite seconds (n,)")
        if not np.all(np.isfinite(speed)) or np.any(speed < 0):
            raise InputError("airspeed: expected finite numbers >= 0 m/s")
        flown = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
        white = np.random.default_rng(seed).standard_normal((len(time), 5))
        sigma, length = self.intensities, self.lengths
        return np.column_stack(
            [
                sigma[0] * _first_order(flown / length[0], white[:, 0]),
                sigma[1] * _second_order(flown / (2 * length[1]), white[:, 1:3]),
                sigma[2] * _second_order(flown / (2 * length[2]), white[:, 3:]),
            ]
        )


def _first_order(steps: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Samples (n,) of unit variance of 1/(1 + s) driven by white noise, `steps` (n - 1,) apart."""
    out, keep = np.empty(len(white)), np.exp(-steps)
    fresh = np.sqrt(-np.expm1(-2 * steps))
    out[0] = white[0]
    for k in range(len(steps)):
        out[k + 1] = keep[k] * out[k] + fresh[k] * white[k + 1]
    return out


def _second_order(steps: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Samples (n,) of unit variance of (1 + sqrt(3) s)/(1 + s)^2 driven by white noise, `steps` (n
    - 1,) apart.

    States z1 = 1/(1+s), z2 = z1/(1+s) of white noise of intensity 2: stationary covariance [[1,
    1/2], [1/2, 1/2]], and the output sqrt(3) z1 + (1 - sqrt(3)) z2 has the variance 2.
    """
    stationary = np.array([[1.0, 0.5], [0.5, 0.5]])
    output = np.array([math.sqrt(3.0), 1 - math.sqrt(3.0)]) / math.sqrt(2.0)
    keep = np.exp(-steps)[:, None, None] * (
        np.eye(2) + steps[:, None, None] * np.array([[0.0, 0.0], [1.0, 0.0]])
    )
    fresh = stationary - keep @ stationary @ np.swapaxes(keep, 1, 2)
    z = np.empty((len(white), 2))
    z[0] = np.linalg.cholesky(stationary) @ white[0]
    for k in range(len(steps)):
        a = math.sqrt(max(fresh[k, 0, 0], 0.0))
        b = fresh[k, 1, 0] / a if a > 0 else 0.0
        c = math.sqrt(max(fresh[k, 1, 1] - b * b, 0.0))
        z[k + 1] = keep[k] @ z[k] + (a * white[k + 1, 0], b * white[k + 1, 0] + c * white[k + 1, 1])
    return z @ output
