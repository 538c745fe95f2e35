"""Modes far slower than the samples: what noise leaves of them, and the rate at which they would be
seen.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from identification.design.criterion import Criterion, judged, table
from identification.design.excitation import column_scale
from identification.judge.uncertainty import uncertainty
from identification.model.lpvarx_model import LPVARXModel
from identification.model.realization import held_value
from identification.structure.regressors import Regression, as_records, stacked
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole

SLOW = 0.1
"""A mode turns or decays by less than this (rad, or natural logarithm) from sample to sample."""

LOST = 0.25
"""Share of the rate of decay or growth, |Re s|: an error beyond leaves a mode unknown."""

SHARES = (0.5, 0.8, 0.9)
"""Parts of the noise that are taken off the information to see whether a pole stays. All of it
would leave directions that noise alone determines with nothing, and what stands there would be
chance.
"""


@dataclass(frozen=True)
class SlowMode:
    """A slow pole of a model and its uncertainty due to noise.

    Parameters
    ----------
    p : tuple of float
        The scheduling it is at, one number a parameter.
    s : complex
        The pole, 1/s.
    standard_error : float
        Of the pole, from that of the coefficients, 1/s.
    shift : float
        How far it moves when least squares takes the residuals as noise of the sensors,
        1/s.

    Examples
    --------
    >>> from identification.judge.slow_modes import SlowMode
    >>> mode = SlowMode(p=(5.0,), s=-0.2 + 0.5j, standard_error=0.02, shift=0.05)
    >>> mode.lost, round(mode.error, 3)
    (False, 0.05)
    """

    p: tuple[float, ...]
    s: complex
    standard_error: float
    shift: float

    @property
    def error(self) -> float:
        """1/s: two standard errors or the shift, the larger."""
        return max(2 * self.standard_error, self.shift)

    @property
    def criterion(self) -> Criterion:
        """The error, at most a quarter of the rate of decay or growth, 1/s."""
        at = ", ".join(f"{value:.3g}" for value in self.p)
        return judged(
            f"error of the pole {self.s:.2g} at p = {at}, 1/s",
            self.error,
            LOST * abs(self.s.real),
            "not known",
            where=f"two standard errors {2 * self.standard_error:.2g}, shift by noise of the"
            f" sensors {self.shift:.2g}",
        )

    @property
    def lost(self) -> bool:
        """Whether noise leaves open how fast the mode decays or grows, to a quarter."""
        return self.criterion.verdict == "not known"

    @property
    def period(self) -> float:
        """The sample period (s) at which the mode, as fast as it may be, would not be slow: 0.1 /
        max(|s|, error).
        """
        return SLOW / max(abs(self.s), self.error)


@dataclass(frozen=True)
class SlowModes:
    """The slow modes of a model.

    Parameters
    ----------
    modes : tuple of SlowMode
        Those with |log z| < 0.1.
    dt : float
        Sample period of the model, s.

    Examples
    --------
    >>> from identification.judge.slow_modes import SlowModes
    >>> print(SlowModes(modes=(), dt=0.02))
    slow modes: none
    """

    modes: tuple[SlowMode, ...]
    dt: float

    @property
    def lost(self) -> tuple[SlowMode, ...]:
        """Modes that noise leaves unknown."""
        return tuple(mode for mode in self.modes if mode.lost)

    @property
    def together(self) -> int:
        """Samples a mean at which the worst lost mode would not be slow."""
        return max(round(self._worst.period / self.dt), 2)

    @property
    def _worst(self) -> SlowMode:
        return max(self.lost, key=lambda m: m.error / abs(m.s))

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """The error of each mode."""
        return tuple(mode.criterion for mode in self.modes)

    @property
    def statement(self) -> str:
        """The text without advice."""
        if not self.modes:
            return "slow modes: none"
        known = "NOT known" if self.lost else "known"
        return f"slow modes: {known} at {1 / self.dt:.3g} Hz\n{table(self.criteria, '  ')}"

    def __str__(self) -> str:
        if not self.lost:
            return self.statement
        return (
            f"{self.statement}\n  for the pole {self._worst.s:.2g} 1/s identify at about"
            f" {1 / (self.dt * self.together):.2g} Hz (means of {self.together} samples, delay 0),"
            " or by instruments"
        )


def slow_modes(
    model: LPVARXModel, records: FlightRecord | Iterable[FlightRecord], points: int = 5
) -> SlowModes:
    """Return the poles with |log z| < 0.1 of a least-squares model at quantiles of p, with their
    uncertainty due to noise.

    Noise of variance s_j^2 on output j adds N, blocks s_j^2 sum f f' at its lags, to the
    information Phi' Phi, and draws slow poles away from 1 or the unit circle; s_j^2 is what leaves
    residuals of the size there are. The shift is the largest that (Phi' Phi - c N)^-1 Phi' y makes
    with c = 0.5, 0.8, 0.9. Standard errors follow the poles to first order. Where the residuals are
    gusts, not sensors, the shift is too large.

    Parameters
    ----------
    model : LPVARXModel
        Fitted by "ls" or "rls".
    records : FlightRecord or iterable of FlightRecord
        Those it was fitted to.
    points : int
        Quantiles of p.

    Returns
    -------
    SlowModes
        `str()` of it says what to do where one is lost.

    Raises
    ------
    InputError
        A model that is not of least squares.
    ExcitationError
        Records that do not determine its coefficients.

    References
    ----------
    Soderstrom (2007), Errors-in-variables methods in system identification, Automatica 43, sec. 5
    (bias compensation).

    Examples
    --------
    >>> print(idn.judge.slow_modes(model, record))
    slow modes: none
    """
    records = as_records(records)
    joint, data = uncertainty(model, records).covariance, stacked(model.structure, records)
    others = [model.with_theta(theta) for theta in _compensated(model, data)]
    p, points = data.p.reshape(len(data.p), -1), whole(points, "points", 1)
    found = []
    for row in np.unique(np.quantile(p, (np.arange(points) + 0.5) / points, axis=0), axis=0):
        moved = [_poles(other, row) for other in others]
        for z in _poles(model, row):
            if z.imag >= 0 and 0 < abs(np.log(z)) < SLOW:
                shift = max(float(np.min(np.abs(np.log(poles) - np.log(z)))) for poles in moved)
                error = _standard_error(model, joint, row, z)
                found.append(
                    SlowMode(
                        tuple(map(float, row)),
                        complex(np.log(z) / model.dt),
                        error,
                        shift / model.dt,
                    )
                )
    return SlowModes(tuple(found), model.dt)


def _compensated(model: LPVARXModel, data: Regression) -> list[Array]:
    """theta (n, ny) with each of `SHARES` of the noise taken off."""
    arx, theta, size = model.structure, model.theta, model.structure.basis.size
    f, phi = arx.basis(data.p), data.phi
    lagged = [
        (slice(i * size, (i + 1) * size), e.channel)
        for i, e in enumerate(arx.entries)
        if e.kind == "output"
    ]
    # white noise v on the outputs leaves residuals v(k) + sum A_i v(k-i)
    gain = np.eye(arx.ny)
    for block, channel in lagged:
        gain[:, channel] += np.mean((f @ theta[block]) ** 2, axis=0)
    variance = nnls(gain, np.mean(data.residuals(theta) ** 2, axis=0))[0]
    scale = column_scale(phi)
    P, Q, N = (
        phi.T @ phi / np.outer(scale, scale),
        phi.T @ data.y / scale[:, None],
        np.zeros((len(scale), len(scale))),
    )
    for block, channel in lagged:
        N[block, block] = variance[channel] * (f.T @ f) / np.outer(scale[block], scale[block])
    out = []
    for share in SHARES:
        new = np.zeros_like(theta)
        for group in arx.groups:
            rows, columns = arx.regressors(group), np.array(group.outputs)
            square = (P - share * N)[rows[:, None], rows]
            new[rows[:, None], columns] = (
                np.linalg.lstsq(square, Q[rows[:, None], columns], rcond=None)[0]
                / scale[rows, None]
            )
        out.append(new)
    return out


def _poles(model: LPVARXModel, p: Array) -> Array:
    """Poles of the model with the scheduling held at p, complex, those at zero left out."""
    A = model.coefficients.at(held_value(p, model.structure.basis)).A
    na, ny = A.shape[0], A.shape[1]
    companion = np.eye(na * ny, k=-ny)
    companion[:ny] = -A.transpose(1, 0, 2).reshape(ny, na * ny)
    z = np.linalg.eigvals(companion).astype(complex)
    return z[np.abs(z) > 1e-12]


def _standard_error(model: LPVARXModel, joint: Array, p: Array, z: complex) -> float:
    """Standard error of log z / dt. With M(z) = I + sum A_i z^-i, l' M = 0 and M r = 0: dz = -(l'
    sum dA_i z^-i r)/(l' M'(z) r).
    """
    arx, A, f = (
        model.structure,
        model.coefficients.at(held_value(p, model.structure.basis)).A,
        np.ravel(model.structure.basis(held_value(p, model.structure.basis))),
    )
    powers = [z ** -float(i) for i in range(1, len(A) + 1)]
    M = np.eye(arx.ny) + sum(a * w for a, w in zip(A, powers, strict=True))
    slope = sum(-i * a * w / z for i, (a, w) in enumerate(zip(A, powers, strict=True), start=1))
    U, _, Vh = np.linalg.svd(M)
    left, right = U[:, -1].conj(), Vh[-1].conj()
    gradient, size = np.zeros((arx.ny, arx.n_regressors), complex), arx.basis.size
    for i, e in enumerate(arx.entries):
        if e.kind == "output":
            gradient[:, i * size : (i + 1) * size] = -np.outer(
                left, right[e.channel] * powers[e.lag - 1] * f
            )
    gradient /= left @ slope @ right
    variance = np.einsum("yi,yizj,zj->", gradient, joint, gradient.conj()).real
    return float(np.sqrt(max(variance, 0.0)) / abs(z) / model.dt)
