"""Flight-path reconstruction: integrals of measured rates and accelerations, fitted to the measured
states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from symheli.values.arrays import Array

WINDOW = 2.0
"""Seconds over which rates are integrated from one free start: noise of the rates walks away with
the square root of it, while what a bias turns grows in proportion.
"""

LEAST_SAMPLES = 20
"""A window of slow samples is as long as this many."""

MAX_WINDOWS, WINDOWS_PER_PIECE = 120, 10
"""Largest number of windows compared, and their number in an unbroken piece: they determine biases
to 0.01 deg/s.
"""

MAX_DELAY = 0.4
"""Largest delay that is searched for, s, either way."""

ITERATIONS = 25
DELAY_TOLERANCE = 1e-6
"""Change of the delays at which the iteration ends, s."""

SINGULAR = 1e-9
"""Directions of the scaled normal equations with singular values below this are not determined."""

ROUNDING, TINY = 1e-16, float(np.finfo(float).tiny)
"""No channel is known better than this part of its variation."""


@dataclass(frozen=True)
class Channel:
    """A signal with y'(t) = known(t) + columns(t) theta, measured as y(t - delay) plus noise.

    Parameters
    ----------
    name : str
        Of the signal.
    measured : array (n,)
        y, in its unit.
    known : array (n,)
        In that unit per second.
    columns : array (n, m)
        One a parameter.
    """

    name: str
    measured: Array
    known: Array
    columns: Array

    def holding(self, theta: Array, free: Array) -> Channel:
        """The parameters (m,) that are not `free` moved to what is known."""
        known = self.known + self.columns @ (theta * ~free)
        return replace(self, known=known, columns=self.columns * free)


@dataclass(frozen=True)
class Kinematics:
    """Channels that the same sensors drive.

    Parameters
    ----------
    drivers : tuple of str
        Signals that are integrated; the first parameters are theirs.
    nominal : array (m,)
        Parameters of sensors without fault.
    channels : callable
        At delays (c,) in s.
    """

    drivers: tuple[str, ...]
    nominal: Array
    channels: Callable[[Array], list[Channel]]


@dataclass(frozen=True)
class Windows:
    """Samples (windows, length) of `time` (n,) that belong together, inside `stretches` without a
    gap or a missing sample, away from their ends by the longest delay.
    """

    time: Array
    stretches: tuple[slice, ...]
    index: Array
    home: Array

    @classmethod
    def of(cls, time: Array, stretches: Sequence[slice]) -> Windows:
        """As many windows as fit; of a long record pieces spread over it."""
        step = float(np.median(np.diff(time)))
        length, rim = max(round(WINDOW / step), LEAST_SAMPLES), int(np.ceil(MAX_DELAY / step)) + 1
        piece = WINDOWS_PER_PIECE * length + 2 * rim
        if sum((part.stop - part.start) // length for part in stretches) > MAX_WINDOWS:
            stretches = [
                slice(start, start + piece)
                for part in stretches
                for start in range(part.start, part.stop - piece + 1, piece)
            ] or stretches
            stretches = stretches[:: -(-len(stretches) * WINDOWS_PER_PIECE // MAX_WINDOWS)]
        rows: list[Array] = []
        home: list[int] = []
        for i, part in enumerate(stretches):
            first, last = part.start + rim, part.stop - rim
            count = max(last - first, 0) // length
            rows += [first + length * k + np.arange(length) for k in range(count)]
            home += [i] * count
        index = np.array(rows, int).reshape(-1, length)
        return cls(time, tuple(stretches), index, np.array(home, int))

    def __len__(self) -> int:
        return len(self.index)

    def where(self, keep: Array) -> Windows:
        """The windows all of whose samples are in a mask (n,)."""
        inside = keep[self.index].all(axis=1)
        return replace(self, index=self.index[inside], home=self.home[inside])

    def integral(self, values: Array, delay: float) -> Array:
        """Integrals (windows, length, m) of columns (n, m) up to each sample's time less `delay`
        (s), less their mean over the window, which leaves its start free.
        """
        return self._evaluated(values, delay, -1)

    def centred(self, signal: Array) -> Array:
        """A signal (n,) less its mean over each window (windows, length)."""
        inside = signal[self.index]
        return inside - inside.mean(axis=1, keepdims=True)

    def late(self, values: Array, delay: float) -> Array:
        """Columns (n, m) as they were `delay` (s) earlier, less their mean over the window."""
        return self._evaluated(values, delay, 0)

    def _evaluated(self, values: Array, delay: float, order: int) -> Array:
        out = np.empty((*self.index.shape, values.shape[1]))
        for i in np.unique(self.home):
            part, here = self.stretches[i], self.home == i
            spline = CubicSpline(self.time[part], values[part])
            if order < 0:
                spline = spline.antiderivative()
            out[here] = spline(self.time[self.index[here]] - delay)
        return out - out.mean(axis=1, keepdims=True)

    def advanced(self, values: Array, delay: float) -> Array:
        """Columns (n, m) `delay` (s) later; the ends of a stretch stay where they are."""
        out = values.copy()
        for part in self.stretches:
            time = self.time[part]
            wanted = np.clip(time + delay, time[0], time[-1])
            out[part] = CubicSpline(time, values[part])(wanted)
        return out


@dataclass(frozen=True)
class Reconstruction:
    """Parameters (m,), delays (c,) in s, the covariance (m + c, m + c) of both (infinite variances
    where the data cannot tell); for each channel its name, the mean square of its variation inside
    the windows (c,), and of what is left of it in each (windows, c).
    """

    theta: Array
    delays: Array
    covariance: Array
    names: tuple[str, ...]
    moves: Array
    left: Array

    @property
    def explained(self) -> Array:
        """Share (c,) of the variation of each channel; 0 of one that does not move."""
        moves = np.where(self.moves > 0, self.moves, np.inf)
        return np.where(self.moves > 0, 1 - self.left.mean(axis=0) / moves, 0.0)

    @property
    def errors(self) -> Array:
        """Standard errors (m + c,) of parameters and delays."""
        return np.sqrt(np.diag(self.covariance))


def reconstruct(
    windows: Windows, kinematics: Kinematics, free: Array, delays: Array
) -> Reconstruction:
    """`free` parameters (a mask (m,), the others nominal) and delays, from `delays` (c,) on, by
    output error in windows with free starts.

    Channels weigh by what they leave unexplained. The covariance is the jackknife over windows:
    only these have to be independent, whatever the colour of what is left inside them, such as the
    noise of integrated rates.

    Source: Klein and Morelli, Aircraft System Identification (2006), ch. 10 (data compatibility by
    output error); Efron, The Jackknife, the Bootstrap and Other Resampling Plans (1982), ch. 3.
    """
    theta, delays, weights = kinematics.nominal, np.array(delays, float), np.ones(len(delays))
    for _ in range(ITERATIONS):
        found = [c.holding(kinematics.nominal, free) for c in kinematics.channels(delays)]
        rows = [
            _rows(windows, c, theta, d, i, len(found))
            for i, (c, d) in enumerate(zip(found, delays, strict=True))
        ]
        normal = sum(
            w * np.einsum("gki,gkj->gij", F, F) for w, (F, _) in zip(weights, rows, strict=True)
        )
        right = sum(
            w * np.einsum("gki,gk->gi", F, y) for w, (F, y) in zip(weights, rows, strict=True)
        )
        inverse, lost = _inverse(np.sum(normal, axis=0))
        solution = inverse @ np.sum(right, axis=0)
        left = np.stack([y - F @ solution for F, y in rows], axis=2)
        moves = np.array([np.mean(windows.centred(c.measured) ** 2) for c in found])
        weights = 1 / np.maximum(np.mean(left**2, axis=(0, 1)), ROUNDING * moves + TINY)
        theta, step = np.split(solution, [len(theta)])
        delays = np.clip(delays + step, -MAX_DELAY, MAX_DELAY)
        if np.abs(step).max() < DELAY_TOLERANCE:
            break
    covariance = _jackknife(np.asarray(normal), np.asarray(right), solution)
    covariance[lost, lost] = np.inf
    names = tuple(c.name for c in found)
    theta = np.where(free, theta, kinematics.nominal)
    return Reconstruction(theta, delays, covariance, names, moves, np.mean(left**2, axis=1))


def _rows(
    windows: Windows, channel: Channel, theta: Array, delay: float, i: int, count: int
) -> tuple[Array, Array]:
    """Regressors (windows, length, m + count) of channel `i` of `count`, and what they are to
    explain (windows, length).
    """
    integrals = windows.integral(np.column_stack([channel.columns, channel.known]), delay)
    rate = channel.known + channel.columns @ theta
    late = np.zeros((*windows.index.shape, count))
    late[..., i] = -windows.late(rate[:, None], delay)[..., 0]
    y = windows.centred(channel.measured) - integrals[..., -1]
    return np.concatenate([integrals[..., :-1], late], axis=2), y


def _inverse(normal: Array) -> tuple[Array, Array]:
    """Of the directions that are determined, and which parameters have part in another."""
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    known = values > SINGULAR
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T
    lost = np.abs(vectors[:, ~known]).max(axis=1, initial=0.0) > np.sqrt(SINGULAR)
    return inverse / np.outer(scale, scale), np.flatnonzero(lost)


def _jackknife(normal: Array, right: Array, solution: Array) -> Array:
    """Covariance of `solution` from the normal equations of each window (g, m, m), (g, m)."""
    count, whole, whole_right = len(normal), normal.sum(axis=0), right.sum(axis=0)
    without = np.array(
        [_inverse(whole - A)[0] @ (whole_right - b) for A, b in zip(normal, right, strict=True)]
    )
    change = without - solution
    return (count - 1) / count * change.T @ change
