"""H-infinity norm of a linear model, and what its computation is made of."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.errors import AccuracyError
from symheli.values.arrays import Array


def norm(
    A: Array, B: Array, C: Array, D: Array, dt: float | None = None, tolerance: float = 1e-8
) -> tuple[float, float]:
    """Return the H-infinity norm and the frequency (rad/s) of its peak; (inf, nan) where a pole is
    not strictly stable.

    Level sets of the largest singular value (Boyd and Balakrishnan 1990; Bruinsma and Steinbuch
    1990), with two differences that light damping asks for. No eigenvalue of the Hamiltonian is
    trusted to lie on the axis or off it: the response itself is computed at the imaginary parts of
    all and between them. And a peak is climbed on the response, to the last digits: two eigenvalues
    that meet at its top are known to a root of the rounding only. The value is attained, up to the
    rounding of one response, and at the end no frequency that the level set 1 + `tolerance` higher
    names lies above it. Raises `AccuracyError` where a response exceeds the range of numbers.
    """
    if min(B.shape[1], C.shape[0]) == 0:
        return 0.0, 0.0
    if len(A) == 0:
        return float(np.linalg.norm(D, 2)), 0.0
    poles = np.linalg.eigvals(A)
    if not stable(poles, dt):
        return math.inf, math.nan
    balanced, (units, _) = linalg.matrix_balance(A, permute=False, separate=True)
    # continuous: time in units in which the fastest pole is about 1
    pace = pace_of(poles) if dt is None else 0
    balanced = np.ldexp(balanced, -pace)
    scaled = of_one_size(B / units[:, None], C * units, -pace)
    response = _Response(balanced, *scaled, D, dt is not None)
    A, B, C, D = (
        (balanced, response.B, response.C, D)
        if dt is None
        else to_continuous(balanced, response.B, response.C, D)
    )
    poles = np.linalg.eigvals(A)
    peak = _Peak(float(np.linalg.norm(D, 2)), math.inf).or_higher(response, _of_poles(poles))
    if peak.gain == 0.0:
        return 0.0, 0.0
    # the response in units in which it is about 1, whose squares are within the range of numbers
    size = round(math.log2(peak.gain))
    D, peak = np.ldexp(D, -size), _Peak(math.ldexp(peak.gain, -size), peak.omega)
    B, C = of_one_size(B, C, -size)
    response = response.scaled(-size)
    peak = peak.climbed(response, poles)
    for _ in range(50):
        named = np.unique(
            np.abs(np.imag(_hamiltonian_eigenvalues(A, B, C, D, peak.gain * (1 + tolerance))))
        )
        between = np.concatenate(
            [named, 0.5 * (named[1:] + named[:-1]), np.sqrt(named[1:] * named[:-1])]
        )
        higher = peak.or_higher(response, between)
        if higher.gain <= peak.gain * (1 + tolerance):
            peak = higher
            break
        peak = higher.climbed(response, poles)
    omega = math.ldexp(peak.omega, pace)
    if dt is not None:
        omega = 2.0 * math.atan(omega) / dt if math.isfinite(omega) else math.pi / dt
    return math.ldexp(peak.gain, size), omega


def gain_at_poles(A: Array, B: Array, C: Array, D: Array, dt: float | None = None) -> Array:
    """Return for each of K models the largest gain (K,) at rest, at infinite frequency and at the
    natural, damped and resonance frequencies of its poles, a lower bound of its norm; inf where it
    is not stable, and then 0 elsewhere.
    """
    poles = np.linalg.eigvals(A)
    good = stable(poles, dt)
    if not good.all():
        return np.where(good, 0.0, math.inf)
    if min(B.shape[-1], C.shape[-2]) == 0:
        return np.zeros(len(A))
    if dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
        poles = np.linalg.eigvals(A)
    omega = _of_poles(poles)
    parts = -(-omega.size * A[0].size // 1_000_000)  # of at most 16 MB each
    found = []
    for k in np.array_split(np.arange(len(A)), max(parts, 1)):
        pencil = 1j * omega[k, :, None, None] * np.eye(A.shape[-1]) - A[k, None]
        with np.errstate(over="ignore", invalid="ignore"):
            response = C[k, None] @ np.linalg.solve(pencil, B[k, None]) + D[k, None]
        found.append(np.linalg.norm(np.nan_to_num(response), 2, axis=(-2, -1)).max(axis=1))
    return np.maximum(np.concatenate(found), np.linalg.norm(D, 2, axis=(-2, -1)))


def _of_poles(poles: Array) -> Array:
    """Return 0, and the natural, damped and resonance frequencies of poles (.., n), (.., 3 n + 1),
    rad/s.
    """
    real, imaginary = np.abs(np.real(poles)), np.abs(np.imag(poles))
    resonance = np.sqrt(np.maximum(imaginary - real, 0.0)) * np.sqrt(imaginary + real)
    rest = np.zeros((*poles.shape[:-1], 1))
    return np.concatenate([rest, np.abs(poles), imaginary, resonance], axis=-1)


def stable(poles: Array, dt: float | None) -> Array:
    """Whether all poles (.., n) are strictly stable: left of the axis, of a sampled model within
    the unit circle.
    """
    return np.all(np.real(poles) < 0 if dt is None else np.abs(poles) < 1, axis=-1)


def below(A: Array, B: Array, C: Array, D: Array, level: float, dt: float | None = None) -> bool:
    """Whether every pole is strictly stable and the response below `level` at, and between, the
    frequencies where eigenvalues of the Hamiltonian of that level come near the axis: a fast check
    in double precision, no bound.
    """
    if min(B.shape[1], C.shape[0]) == 0:
        return True
    if not stable(np.linalg.eigvals(A), dt):
        return False
    if dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
    if not np.linalg.norm(D, 2) < level:
        return False
    named = np.unique(np.abs(np.imag(_hamiltonian_eigenvalues(A, B, C, D, level))))
    omega = np.concatenate([[0.0], named, 0.5 * (named[1:] + named[:-1])])
    pencil = 1j * omega[:, None, None] * np.eye(len(A)) - A
    found = C @ np.linalg.solve(pencil, np.broadcast_to(B, (len(omega), *B.shape))) + D
    return bool(np.linalg.norm(found, 2, axis=(1, 2)).max() < level)


class _Response(NamedTuple):
    """Largest singular value over frequency; for a discrete model over omega = tan(theta/2), theta
    the angle of z.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    discrete: bool

    def scaled(self, power: int) -> _Response:
        """Return 2^`power` times this one."""
        B, C = of_one_size(self.B, self.C, power)
        return self._replace(B=B, C=C, D=np.ldexp(self.D, power))

    def gain(self, omega: Array, refined: bool = True) -> Array:
        """Return the gain at each omega (k,), the highest `refined` once with residuals in extended
        precision: with light damping rounding is magnified by its inverse.
        """
        found = self._values(omega)
        if refined:
            highest = found >= NEAR_THE_TOP * found.max()
            found[highest] = self._values(omega[highest].astype(np.longdouble))
        return found

    def _values(self, omega: Array) -> Array:
        """Return the gain at each omega (k,), refined for those in extended precision."""
        points = (1 + 1j * omega) / (1 - 1j * omega) if self.discrete else 1j * omega
        exact = points[:, None, None] * np.eye(len(self.A)) - self.A
        pencil = exact.astype(complex)
        X = np.linalg.solve(pencil, np.broadcast_to(self.B, (len(omega), *self.B.shape)))
        with np.errstate(over="ignore", invalid="ignore"):
            if omega.dtype == np.longdouble:
                X = X + np.linalg.solve(pencil, (self.B - exact @ X).astype(complex))
            found = self.C @ X + self.D
        if not np.isfinite(found).all():
            raise AccuracyError(
                "a frozen response overflows: a pole is too near the stability limit, or the units"
                " of the channels are too different; choose other units"
            )
        return np.linalg.svd(found, compute_uv=False)[:, 0]


class _Peak(NamedTuple):
    gain: float
    omega: float

    def or_higher(self, response: _Response, omega: Array) -> _Peak:
        """Return this or the highest of these frequencies."""
        gains = response.gain(omega)
        k = int(gains.argmax())
        return _Peak(float(gains[k]), float(omega[k])) if gains[k] > self.gain else self

    def climbed(self, response: _Response, poles: Array) -> _Peak:
        """Return the nearest maximum, by parabolas through ever narrower windows: the distance of
        the nearest pole is the width of a peak. Rounding moves a maximum, and its value by the
        square of that, so that only the value at its top is refined.
        """
        if not math.isfinite(self.omega):
            return self
        top, centre, reach = self, self.omega, float(np.abs(1j * self.omega - poles).min())
        end = 1e-6 * reach
        for _ in range(40):
            omega = np.abs(centre + reach * WINDOW)
            gains = response.gain(omega, refined=False)
            k = int(gains.argmax())
            if gains[k] > top.gain:
                top = _Peak(float(gains[k]), float(omega[k]))
            if k in (0, len(omega) - 1):  # still uphill
                centre = float(omega[k])
                continue
            left, middle, right = gains[k - 1 : k + 2]
            bend = left - 2 * middle + right
            spacing = reach * (WINDOW[1] - WINDOW[0])
            centre = float(omega[k]) + (
                0.5 * spacing * float((left - right) / bend) if bend < 0 else 0.0
            )
            reach = 0.25 * spacing
            if reach < end:
                break
        return self.or_higher(response, np.array([top.omega]))


NEAR_THE_TOP = 0.9
"""Fraction of the highest gain above which one is refined."""
WINDOW = np.linspace(-1.0, 1.0, 9)
"""Frequencies at which a response is evaluated, in units of the half-width of a window."""


def pace_of(poles: Array) -> int:
    """Return the power of two next to the fastest pole, 0 where all are zero."""
    fastest = np.abs(poles).max(initial=0.0)
    return round(math.log2(fastest)) if fastest > 0 else 0


def of_one_size(B: Array, C: Array, power: int = 0) -> tuple[Array, Array]:
    """Return B and C whose product is 2^`power` times the given one, their largest entries of equal
    size, so that their squares neither over- nor underflow. All factors are powers of two, no digit
    is lost.
    """
    b, c = np.abs(B).max(initial=0.0), np.abs(C).max(initial=0.0)
    if min(b, c) == 0:
        return B, C
    k = round(0.5 * (power + math.log2(c) - math.log2(b)))
    return np.ldexp(B, k), np.ldexp(C, power - k)


def _hamiltonian_eigenvalues(A: Array, B: Array, C: Array, D: Array, level: float) -> Array:
    """Return the eigenvalues of the Hamiltonian: those on the imaginary axis are the frequencies at
    which a singular value of the response equals `level`.
    """
    R = level**2 * np.eye(D.shape[1]) - D.T @ D
    RD, RB = np.linalg.solve(R, D.T @ C), np.linalg.solve(R, B.T)
    F = A + B @ RD
    return np.linalg.eigvals(np.block([[F, B @ RB], [-C.T @ (C + D @ RD), -F.T]]))


def crossings(A: Array, B: Array, C: Array, D: Array, level: float) -> Array:
    """Return frequencies >= 0 where a singular value of the response equals `level`: imaginary
    eigenvalues of the Hamiltonian.
    """
    values = _hamiltonian_eigenvalues(A, B, C, D, level)
    on_axis = np.abs(np.real(values)) <= 1e-7 * (1e-3 * np.abs(values).max() + np.abs(values))
    omega = np.unique(np.abs(np.imag(values[on_axis])))
    return np.concatenate([[0.0], omega]) if len(omega) and np.any(omega > 0) else omega


def to_continuous(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array, Array, Array]:
    """Return the continuous model, or stack of them, with the same norm: z = (1 + s)/(1 - s)."""
    unit, root = np.eye(A.shape[-1]), math.sqrt(2.0)
    inverse = np.linalg.inv(A + unit)
    return inverse @ (A - unit), root * inverse @ B, root * C @ inverse, D - C @ inverse @ B


def surely_unstable(A: Array, dt: float | None) -> bool:
    """Whether A (n, n), and every matrix within the backward error of the eigenvalues, has an
    unstable pole.

    That error is at most 10 n eps |A|, A balanced; no such change takes a pole across the border
    where the smallest singular value of s - A is larger all along it. dt None: continuous time.
    Source: Van Loan, "How near is a stable matrix to an unstable matrix?", Contemporary Mathematics
    47 (1985).
    """
    A = np.asarray(linalg.matrix_balance(A, permute=False)[0])
    poles = np.linalg.eigvals(A)
    if not np.any(poles.real > 0 if dt is None else np.abs(poles) > 1):
        return False
    if dt is None:
        size = np.abs(poles)
        border = 1j * np.concatenate(
            [[0.0], np.abs(poles.imag), size, np.linspace(0.0, 1.5 * size.max(), 50)]
        )
    else:
        border = np.exp(1j * np.concatenate([np.abs(np.angle(poles)), np.linspace(0.0, np.pi, 50)]))
    distance = np.linalg.svd(border[:, None, None] * np.eye(len(A)) - A, compute_uv=False)[
        :, -1
    ].min()
    return bool(distance > 10 * len(A) * np.finfo(float).eps * np.linalg.norm(A))
