"""Bias, scale and delay of sensors, by flight-path reconstruction of a record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import degrees, inf, pi
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.records.conditioning import unbroken
from symheli.records.flight_path import (
    MAX_DELAY,
    ROUNDING,
    TINY,
    Kinematics,
    Reconstruction,
    Windows,
    reconstruct,
)
from symheli.records.flight_record import FlightRecord
from symheli.records.kinematics import (
    ANGLES,
    FORCES,
    RATES,
    VELOCITIES,
    attitude,
    axis,
    comparable,
    continuous,
    lacking,
    motion,
)
from symheli.values.arrays import Array

SCALE, RATE_BIAS, TILT, FORCE_BIAS = 0.02, 0.005, pi / 180, 0.3
"""What an identification bears: 2 %, 0.3 deg/s, 1 deg, and the specific force (m/s^2) of 1.8 deg of
tilt. What a record does not tell to a standard error of this is not known.
"""

OF_ATTITUDE = np.repeat([SCALE, RATE_BIAS, TILT], [3, 3, 2])
WITHOUT_TILT = np.arange(8) < 6
OF_MOTION = np.repeat([SCALE, FORCE_BIAS], 3)

MIN_WINDOWS = 8
"""Least number of windows of a comparison."""

MIN_EXPLAINED = 0.5
"""Least explained fraction of a signal's variance for which the signal counts as following the
others.
"""

STARTS = np.linspace(-0.75 * MAX_DELAY, 0.75 * MAX_DELAY, 7)
"""Initial delays of the search, s."""

MAX_PITCH = 1.4
"""Pitch (rad) above which Euler angles are not compared: they change too fast there."""

DEGREES = degrees(1.0)
NEAR = 1.5
"""Factor within which a rate and an angle differ as radians and degrees do."""

SURELY = 4.0
"""Standard errors by which a misfit is larger, or a scale negative, for good."""


class ScalarEstimate(NamedTuple):
    """A number and its standard error (infinite: not known)."""

    value: float
    standard_error: float


@dataclass(frozen=True)
class Faults:
    """Sensor errors of each signal.

    Parameters
    ----------
    windows : int
        Stretches of flight that were compared.
    bias, scale, delay : dict of str to ScalarEstimate
        In the signal's unit, 1, and s; a signal is missing where others are held against it.
    explained, moves : dict of str to float
        Of an angle or velocity: the share of its variation inside the windows that the others
        explain, and the root mean square of that variation.
    """

    windows: int
    bias: dict[str, ScalarEstimate] = field(default_factory=dict)
    scale: dict[str, ScalarEstimate] = field(default_factory=dict)
    delay: dict[str, ScalarEstimate] = field(default_factory=dict)
    explained: dict[str, float] = field(default_factory=dict)
    moves: dict[str, float] = field(default_factory=dict)


def sensor_faults(record: FlightRecord) -> Faults:
    """Estimate the errors of p q r phi theta, psi where recorded, and u v w ax ay az where all are;
    see `check_kinematics`.
    """
    missing = lacking(record.signals)
    if missing:
        raise InputError(
            "the kinematics tie p q r (rad/s) to phi theta (rad); the record lacks"
            f" {', '.join(missing)}: add them by record.with_signals, with their unit"
        )
    names = comparable(record.signals)
    table = record.columns(names)
    whole = np.where(np.isfinite(table).all(axis=1), 0.0, np.nan)
    stretches = [
        slice(part.start + some.start, part.start + some.stop)
        for part in record.segments()
        for some in unbroken(whole[part])
    ]
    windows = Windows.of(record.time, stretches)
    if len(windows) < MIN_WINDOWS:
        return Faults(len(windows))
    signals = dict(zip(names, table.T, strict=True))
    angles = tuple(name for name in ANGLES if name in signals)
    signals |= {name: continuous(signals[name], stretches) for name in angles}
    units, delays = _units_and_delays(windows, signals, angles)
    windows = windows.where(np.abs(signals["theta"] / units["theta"][0]) < MAX_PITCH)
    if len(windows) < MIN_WINDOWS:
        return Faults(len(windows))
    fit, reads = _attitude_fit(windows, signals, units, delays)
    faults = Faults(len(windows))
    fit.report(faults)
    for i, angle in enumerate(angles):
        faults.scale[angle] = ScalarEstimate(reads[angle], 0.0)
        if i < 2:
            tilt = fit.estimate(6 + i)
            faults.bias[angle] = ScalarEstimate(
                reads[angle] * tilt.value, abs(reads[angle]) * tilt.standard_error
            )
    if all(name in signals for name in (*VELOCITIES, *FORCES)):
        true = signals | _true_attitude(windows, fit, signals, reads)
        rough = _best(windows, motion(windows, true), 3)
        _fit(windows, motion, true, OF_MOTION, rough).report(faults)
    return faults


def _units_and_delays(
    windows: Windows, signals: Mapping[str, Array], angles: Sequence[str]
) -> tuple[dict[str, tuple[float, ...]], Array]:
    """Return the factor by which each angle may have to be divided to be in radians, and its delay
    (s), from the one rate that it follows while angles are small.
    """
    units: dict[str, tuple[float, ...]] = {}
    delays = np.zeros(len(angles))
    steep = np.abs(signals["theta"][windows.index]).max() > 1.05 * pi / 2
    for i, (angle, rate) in enumerate(zip(angles, RATES, strict=False)):
        best = _best(windows, axis(signals, rate, angle), 1)
        follows = best.explained[0] >= MIN_EXPLAINED
        ratio = 1 / abs(best.theta[0]) if follows else inf
        delays[i] = best.delays[0] if follows else 0.0
        if 1 / NEAR < ratio * DEGREES < NEAR:
            units[angle] = (DEGREES,)
        elif not steep or 1 / NEAR < ratio / DEGREES < NEAR:
            units[angle] = (1.0,)
        else:  # no pitch is beyond 90 deg: it is in degrees, and heading may be
            units[angle] = (1.0, DEGREES) if angle == "psi" else (DEGREES,)
    return units, delays


def _best(windows: Windows, kinematics: Kinematics, count: int) -> Reconstruction:
    """Return, of the fits from several delays of `count` channels, the one that explains most."""
    free = np.ones(len(kinematics.nominal), bool)
    fits = [reconstruct(windows, kinematics, free, np.full(count, start)) for start in STARTS]
    return max(fits, key=lambda fit: float(fit.explained.sum()))


@dataclass(frozen=True)
class _Fit:
    """A reconstruction whose drivers were multiplied by `factors` (3,), and the mask of its `free`
    parameters; the others are unknown.
    """

    found: Reconstruction
    drivers: tuple[str, ...]
    factors: Array
    free: Array

    def estimate(self, i: int) -> ScalarEstimate:
        """Parameter `i` as it is."""
        error = self.found.errors[i] if self.free[i] else inf
        return ScalarEstimate(float(self.found.theta[i]), float(error))

    def report(self, faults: Faults) -> None:
        """Enter drivers and channels."""
        theta, errors = self.found.theta, self.found.errors
        for i, (name, f) in enumerate(zip(self.drivers, self.factors, strict=True)):
            inverse, offset = theta[i], theta[3 + i]
            faults.scale[name] = ScalarEstimate(
                float(1 / (f * inverse)),
                float(errors[i] / abs(f * inverse**2)) if self.free[i] else inf,
            )
            both = np.flatnonzero(self.free[[i, 3 + i]]) * 3 + i
            slopes = np.array([-offset / inverse**2, 1 / inverse])[(both - i) // 3] / f
            variance = slopes @ self.found.covariance[both][:, both] @ slopes
            faults.bias[name] = ScalarEstimate(
                float(offset / (f * inverse)), float(np.sqrt(variance)) if self.free[3 + i] else inf
            )
        for i, name in enumerate(self.found.names):
            faults.explained[name] = float(self.found.explained[i])
            faults.moves[name] = float(np.sqrt(self.found.moves[i]))
            error = errors[len(theta) + i] if faults.explained[name] >= MIN_EXPLAINED else inf
            faults.delay[name] = ScalarEstimate(float(self.found.delays[i]), float(error))


def _fit(
    windows: Windows,
    make: Callable[[Windows, Mapping[str, Array]], Kinematics],
    signals: Mapping[str, Array],
    tolerance: Array,
    rough: Reconstruction,
) -> _Fit:
    """Fit all parameters, starting from a fit with approximate scales of the drivers. Those that
    the record does not determine within `tolerance` (m,) are fixed: tilts first, then scales, then
    biases.
    """
    plain, count = make(windows, signals), len(rough.delays)
    scale, errors = rough.theta[:3], rough.errors[:3]
    factors = np.where(errors < 0.25 * np.abs(scale), scale, 1.0)
    factors[:count][rough.explained < MIN_EXPLAINED] = 1.0
    scaled = {name: f * signals[name] for name, f in zip(plain.drivers, factors, strict=True)}
    kinematics = make(windows, {**signals, **scaled})
    free, found = np.ones(len(tolerance), bool), rough
    for group in (slice(6, None), slice(3), slice(3, 6)):
        found = reconstruct(windows, kinematics, free, found.delays)
        free[group] &= found.errors[: len(tolerance)][group] <= tolerance[group]
        if group.start is None:
            free[:count] &= found.explained >= MIN_EXPLAINED
    return _Fit(reconstruct(windows, kinematics, free, found.delays), plain.drivers, factors, free)


def _attitude_fit(
    windows: Windows,
    signals: Mapping[str, Array],
    units: Mapping[str, Sequence[float]],
    delays: Array,
) -> tuple[_Fit, dict[str, float]]:
    """Return the fit of Euler's equations, and the divisors of the angles: of equally good fits,
    the one with the fewest signs changed.

    Turning phi, p, r and psi together changes nothing, nor theta, q, r and psi.
    """
    tried = []
    for reads in product(
        *([f * sign for f in many for sign in (1, -1)] for many in units.values())
    ):
        by = dict(zip(units, reads, strict=True))
        true = {**signals, **{name: signals[name] / f for name, f in by.items()}}
        rough = reconstruct(windows, attitude(windows, true), WITHOUT_TILT, delays)
        surely_negative = rough.theta[:3] < -SURELY * rough.errors[:3]
        turned = int(surely_negative.sum()) + sum(f < 0 for f in reads)
        tried.append((turned, rough, true, by))
    shares = [_unexplained(rough) for _, rough, _, _ in tried]
    best = min(shares, key=lambda share: float(np.log(share.mean(axis=0)).sum()))
    alike = []
    for (turned, rough, true, by), share in zip(tried, shares, strict=True):
        more = np.sum((share - best) / best.mean(axis=0), axis=1)
        if more.mean() <= SURELY * more.std() / np.sqrt(len(more)):
            alike.append((turned, rough, true, by))
    _, rough, true, by = min(alike, key=lambda one: one[0])
    return _fit(windows, attitude, true, OF_ATTITUDE, rough), by


def _unexplained(found: Reconstruction) -> Array:
    """Return the residual of each channel in each window (windows, c), over its motion."""
    return found.left / (found.moves + TINY) + ROUNDING


def _true_attitude(
    windows: Windows, fit: _Fit, signals: Mapping[str, Array], reads: Mapping[str, float]
) -> dict[str, Array]:
    """p q r phi theta as found."""
    theta = fit.found.theta
    out = {
        name: f * theta[i] * signals[name] - theta[3 + i]
        for i, (name, f) in enumerate(zip(RATES, fit.factors, strict=True))
    }
    for i, name in enumerate(ANGLES[:2]):
        true = signals[name] / reads[name] - theta[6 + i]
        out[name] = windows.advanced(true[:, None], fit.found.delays[i])[:, 0]
    return out
