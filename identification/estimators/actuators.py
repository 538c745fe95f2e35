"""Deflections of the controls from recorded commands: a delay, and servos behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from symheli.errors import InputError
from symheli.flight import Servo
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Actuators:
    """What stands between command and deflection: a delay, then a servo for each control.

    Parameters
    ----------
    servos : mapping of str to Servo
        By control, d_lon, d_lat, d_col, d_ped: from the bench, or the maker.
    delay : float
        From command to servo, s, of any part of a sample.
    bandwidth_deviation : float
        Relative standard deviation of the servos' bandwidth, common to all; 0: known.
    delay_deviation : float
        Standard deviation of the delay, s; 0: known.

    Raises
    ------
    InputError
        A number out of range, or a control without servo.

    Examples
    --------
    >>> import symheli
    >>> servo = symheli.Servo(natural_frequency=33.0, damping=0.7)
    >>> controls = ("d_lon", "d_lat", "d_col", "d_ped")
    >>> made = idn.Actuators(dict.fromkeys(controls, servo), delay=0.02)
    >>> step = np.vstack([np.zeros((5, 4)), np.full((95, 4), 0.1)])
    >>> bool(abs(made.deflections(step, 0.02)[-1, 0] - 0.1) < 1e-6)
    True
    """

    servos: Mapping[str, Servo]
    delay: float = 0.0
    bandwidth_deviation: float = 0.0
    delay_deviation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("delay", "bandwidth_deviation", "delay_deviation"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name}: expected a finite number >= 0, got {value!r}")
        if missing := [u for u in CONTROLS if u not in self.servos]:
            raise InputError(f"servos: none given for {', '.join(missing)}")

    @property
    def unknown(self) -> tuple[str, ...]:
        """What is estimated: "bandwidth", a factor of it, and "delay" (s)."""
        given = {"bandwidth": self.bandwidth_deviation, "delay": self.delay_deviation}
        return tuple(name for name, deviation in given.items() if deviation)

    def point(self, z: Sequence[float]) -> dict[str, float]:
        """Factor of the bandwidth, and delay (s), at `z` in their prior deviations."""
        moved = dict(zip(self.unknown, z, strict=True))
        return {
            "bandwidth": math.exp(self.bandwidth_deviation * moved.get("bandwidth", 0.0)),
            "delay": max(self.delay + self.delay_deviation * moved.get("delay", 0.0), 0.0),
        }

    def deflections(
        self, commands: Array, dt: float, bandwidth: float = 1.0, delay: float | None = None
    ) -> Array:
        """Mean deflection (n, 4) over each sample, rad, of commands (n, 4) that are held for `dt`
        seconds each, from rest at the first ones; bandwidths times a factor, another delay (s).
        """
        late = self.delay if delay is None else delay
        whole = int(late / dt)
        part = late - whole * dt
        start, moved = commands[0], commands - commands[0]
        late_by = [np.vstack([np.zeros((n, 4)), moved])[: len(moved)] for n in (whole + 1, whole)]
        out = np.empty((len(commands), 4))
        for j, u in enumerate(CONTROLS):
            m = self.servos[u].linear(u)
            A, B = m.A * bandwidth, m.B * bandwidth
            # the older command acts until the newer one arrives, a `part` of the sample later
            F, G, c, d = _held(A, B, m.C, part)
            F_, G_, c_, d_ = _held(A, B, m.C, dt - part)
            system = (
                F_ @ F,
                np.hstack([F_ @ G, G_]),
                (c + c_ @ F) / dt,
                np.hstack([d + c_ @ G, d_]) / dt,
            )
            out[:, j] = start[j]
            for i, command in enumerate(late_by):
                numerator, denominator = ss2tf(*system, input=i)
                out[:, j] += lfilter(numerator[0], denominator, command[:, j])
        return out


CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")


def _held(A: Array, B: Array, C: Array, time: float) -> tuple[Array, Array, Array, Array]:
    """State after `time` seconds, and integral of the output, from state and held input."""
    n, m, p = len(A), B.shape[1], len(C)
    whole = np.zeros((n + p + m, n + p + m))
    whole[:n, :n], whole[:n, n + p :], whole[n : n + p, :n] = A, B, C
    E = expm(whole * time)
    return E[:n, :n], E[:n, n + p :], E[n : n + p, :n], E[n : n + p, n + p :]
