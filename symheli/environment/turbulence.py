"""Continuous turbulence near the ground: Dryden's spectra, realized exactly at the samples."""

from __future__ import annotations

import ctypes
import functools
import math
from dataclasses import dataclass
from importlib import resources

import numpy as np

from symheli.codegen.compile import library
from symheli.errors import InputError
from symheli.values.numbers import whole

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
    >>> light = symheli.environment.Dryden(wind=7.7, altitude=30.0)
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
        with np.errstate(over="ignore"):
            flown = (0.5 * speed[1:] + 0.5 * speed[:-1]) * np.diff(time)
        white = np.random.default_rng(whole(seed, "seed")).standard_normal((len(time), 5))
        sigma, length = self.intensities, self.lengths
        return np.column_stack(
            [
                sigma[0] * _first_order(_steps(flown, length[0]), white[:, 0]),
                sigma[1] * _second_order(_steps(flown, 2 * length[1]), white[:, 1:3]),
                sigma[2] * _second_order(_steps(flown, 2 * length[2]), white[:, 3:]),
            ]
        )


STATIONARY = np.array([[1.0, 0.5], [0.5, 0.5]])
"""Covariance of the states z1 = 1/(1+s), z2 = z1/(1+s) of white noise of intensity 2."""
OUTPUT = np.array([math.sqrt(3.0), 1 - math.sqrt(3.0)]) / math.sqrt(2.0)
"""sqrt(3) z1 + (1 - sqrt(3)) z2 has the variance 2."""
MAX_LENGTHS = 1e3
"""Number of turbulence lengths after which a gust has decayed to zero: exp(-1000) is 0, and 1000
exp(-1000) too.
"""


@functools.cache
def _machine_code() -> ctypes.CDLL | None:
    source = (resources.files("symheli.environment") / "dryden.c").read_text(encoding="utf-8")
    path = library(source, "dryden")
    return None if path is None else ctypes.CDLL(str(path))


def _steps(flown: np.ndarray, length: float) -> np.ndarray:
    return np.minimum(flown / length, MAX_LENGTHS)


def _first_order(steps: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Samples (n,) of unit variance of 1/(1 + s) driven by white noise, `steps` (n - 1,) apart."""
    out, keep = np.empty(len(white)), np.exp(-steps)
    fresh, white = np.sqrt(-np.expm1(-2 * steps)), np.ascontiguousarray(white)
    if (code := _machine_code()) is not None:
        code.first_order(_long(len(out)), *map(_at, (keep, fresh, white)), _long(1), _at(out))
        return out
    x = out[0] = white[0]
    for k in range(len(steps)):
        x = out[k + 1] = keep[k] * x + fresh[k] * white[k + 1]
    return out


def _second_order(steps: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Samples (n,) of unit variance of (1 + sqrt(3) s)/(1 + s)^2 driven by white noise (n, 2),
    `steps` (n - 1,) apart.

    A step keeps exp(-d) [[1, 0], [d, 1]] of the states and adds noise of the covariance that is
    missing; both in closed form.
    """
    keep = np.exp(-steps)
    left = keep**2
    first, both = -np.expm1(-2 * steps), 0.5 - left * (steps + 0.5)
    second = 0.5 - left * (steps**2 + steps + 0.5)
    a = np.sqrt(first)
    b = np.divide(both, a, out=np.zeros_like(a), where=a > 0)
    fresh = np.column_stack([a, b, np.sqrt(np.maximum(second - b * b, 0.0))])
    out, white = np.empty(len(white)), np.ascontiguousarray(white)
    start = np.linalg.cholesky(STATIONARY) @ white[0]
    if (code := _machine_code()) is not None:
        given, then = map(_at, (keep, steps, fresh, white)), map(_at, (start, OUTPUT, out))
        code.second_order(_long(len(out)), *given, _long(2), *then)
        return out
    x, y = start
    out[0] = OUTPUT[0] * x + OUTPUT[1] * y
    for k, (d, e) in enumerate(zip(steps, keep, strict=True)):
        noise = fresh[k, 1] * white[k + 1, 0] + fresh[k, 2] * white[k + 1, 1]
        x, y = e * x + fresh[k, 0] * white[k + 1, 0], e * (d * x + y) + noise
        out[k + 1] = OUTPUT[0] * x + OUTPUT[1] * y
    return out


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


_long = ctypes.c_long
