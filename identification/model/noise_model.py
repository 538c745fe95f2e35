"""Noise of outputs or of equations as white noise through a filter, one for each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.signal import lfilter

from identification.design.excitation import column_scale
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized

LONG = 10
"""How many more lags the autoregression has that shows white noise first."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """v(k) + d_1 v(k-1) + .. = e(k) + c_1 e(k-1) + .., e white, for each output.

    Parameters
    ----------
    ar, ma : array (ny, any)
        d_1, d_2, .. and c_1, c_2, ..
    enters : {"output", "equation"}
        What v is: y less the free run (Box-Jenkins), or what the equation leaves (ARMAX).

    Raises
    ------
    InputError
        Other shapes, or another `enters`.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2; Box and Jenkins (1976), Time Series Analysis.

    Examples
    --------
    >>> noise = idn.methods.NoiseModel([[-0.9]], [[]])
    >>> noise.white(np.array([[1.0], [0.9], [0.81], [1.729]])).round(3).ravel()
    array([1., 0., 0., 1.])
    >>> noise.ahead(np.array([[1.0], [0.9], [0.81]]), 2).round(2).ravel()
    array([0.  , 0.  , 0.81])
    """

    ar: Array
    ma: Array
    enters: Literal["output", "equation"] = "output"

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "ar", frozen(self.ar, "ar", (None, None)))
        object.__setattr__(self, "ma", frozen(self.ma, "ma", (len(self.ar), None)))
        if self.enters not in ("output", "equation"):
            raise InputError(f'enters: expected "output" or "equation", got {self.enters!r}')

    @classmethod
    def of(
        cls,
        v: Sequence[Array],
        ar: int,
        ma: int,
        enters: Literal["output", "equation"] = "output",
    ) -> NoiseModel:
        """Of noise v (n, ny) in several stretches, by two regressions: a long autoregression shows
        e, then v on the past of v and e. Source: Hannan and Rissanen (1982), Biometrika 69.
        """
        d, c = np.zeros((v[0].shape[1], ar)), np.zeros((v[0].shape[1], ma))
        for y in range(len(d)):
            own = [part[:, y] for part in v]
            e = [np.zeros_like(part) for part in own]
            if ma:
                long = _regressed(own, e, ar + ma + LONG, 0)
                e = [np.asarray(lfilter(np.append(1.0, long), 1.0, part)) for part in own]
            found = _regressed(own, e, ar, ma)
            d[y], c[y] = found[:ar], _invertible(found[ar:])
        return cls(d, c, enters)

    @property
    def stable(self) -> bool:
        """Whether e can be told from v: no zero on or outside the unit circle."""
        return all(np.abs(np.roots([1.0, *c])).max(initial=0.0) < 1.0 for c in self.ma)

    def white(self, v: Array) -> Array:
        """e (n, ny) of noise v (n, ny), from rest; raises `InputError` for another shape or entries
        that are not finite.
        """
        return self.filtered(frozen(v, "v", (None, len(self.ar))))

    def filtered(self, v: Array) -> Array:
        """The same for v (n, ny, ..) as it is; without orders v itself, missing samples and all."""
        if not self.ar.shape[1] + self.ma.shape[1] or not len(v):
            return v
        return np.stack(
            [
                lfilter(np.append(1.0, d), np.append(1.0, c), v[:, y], axis=0)
                for y, (d, c) in enumerate(zip(self.ar, self.ma, strict=True))
            ],
            axis=1,
        )

    def by_coefficients(self, v: Array, e: Array) -> Array:
        """Derivatives (n, ny, ny (ar + ma)) of e by the coefficients, output by output."""
        (ny, ar), ma = self.ar.shape, self.ma.shape[1]
        out = np.zeros((len(v), ny, ny, ar + ma))
        for y, c in enumerate(self.ma):
            for i in range(ar + ma):
                lag, signal = (i + 1, v) if i < ar else (i - ar + 1, -e)
                out[lag:, y, y, i] = signal[: len(v) - lag, y]
            if ar + ma:
                out[:, y, y] = lfilter([1.0], np.append(1.0, c), out[:, y, y], axis=0)
        return out.reshape(len(v), ny, -1)

    def ahead(self, v: Array, horizon: int) -> Array:
        """(n, ny) what noise v (n, ny), known up to `horizon` samples before, makes expect, from
        rest; raises `InputError` as `white` does, or for a horizon below 1.
        """
        e, impulse = self.white(v), np.eye(1, whole(horizon, "horizon", 1))[0]
        if not len(e):
            return e
        recent = [
            lfilter(lfilter(np.append(1.0, c), np.append(1.0, d), impulse), 1.0, e[:, y])
            for y, (d, c) in enumerate(zip(self.ar, self.ma, strict=True))
        ]
        return np.asarray(v, float) - np.stack(recent, axis=1)

    def described(self) -> dict[str, Any]:
        """The model in plain values."""
        return {"ar": self.ar.tolist(), "ma": self.ma.tolist(), "enters": self.enters}


def _regressed(v: Sequence[Array], e: Sequence[Array], ar: int, ma: int) -> Array:
    """Coefficients (ar + ma,) of v on -v and e of before, 0 where they are not determined."""
    reach, rows, now = max(ar, ma), [np.zeros((0, ar + ma))], [np.zeros(0)]
    for part, white in zip(v, e, strict=True):
        n = len(part)
        if ar + ma and n > reach:
            past = [-part[reach - i : n - i] for i in range(1, ar + 1)]
            past += [white[reach - i : n - i] for i in range(1, ma + 1)]
            rows.append(np.column_stack(past))
            now.append(part[reach:])
    past, target = np.vstack(rows), np.concatenate(now)
    scale = column_scale(past)
    return np.linalg.lstsq(past / scale, target, rcond=None)[0] / scale


def _invertible(c: Array) -> Array:
    """The coefficients with zeros outside the unit circle mirrored into it: the same spectrum."""
    zeros = np.roots([1.0, *c]).astype(complex)
    size = np.abs(zeros)
    zeros = np.where(size >= 1.0, 0.99 * zeros / np.maximum(size, 1.0) ** 2, zeros)
    return np.real(np.poly(zeros))[1:] if len(zeros) == len(c) > 0 else c
