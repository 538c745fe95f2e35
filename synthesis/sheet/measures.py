"""Measures of a specification sheet for one axis of one frozen loop: a function for each, all
on the same `AxisLoop`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eig
from scipy.optimize import least_squares

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv import connect
from symheli.values.arrays import Array
from symheli.values.signal import indices, signals
from synthesis.design.loops.handling_qualities import Bandwidth, attitude_bandwidth
from synthesis.design.loops.margins import Margins, decibels, margins, open_loop
from synthesis.numerics.linear.norm import crossings, norm, to_continuous
from synthesis.sheet.sheet import ControlAxis, Specification

SHARE = 0.05
"""A mode belongs to an axis if it is this much of the response to a step of its command."""

SAMPLES = 400
"""Of a step response of a continuous loop, and of the frequencies between which an onset is."""

FASTEST = 200.0
"""Frequency, rad/s, up to which the onset of a rate limit is looked for in continuous time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisLoop:
    """One axis of u = K (y - reference) around a plant P, both frozen and of one sample period.

    `travel`: of the control to either side, in its unit; `rate_limit`: fastest change of it, per
    second; NaN where they are not known. Raises `InputError` where a measured output has
    feedthrough, `UnknownNameError` for a signal that is not there.
    """

    plant: LinearModel
    controller: LinearModel
    axis: ControlAxis
    travel: float = math.nan
    rate_limit: float = math.nan

    @cached_property
    def broken(self) -> LinearModel:
        """L of 1 + L, broken at the control, the other loops closed."""
        return open_loop(self.plant, self.controller, self.axis.control)

    @cached_property
    def margins(self) -> Margins:
        """Stability margins of the broken loop."""
        return margins(self.broken)

    @property
    def stable(self) -> bool:
        """Whether the whole loop is stable."""
        return self.closed.is_stable()

    @cached_property
    def closed(self) -> LinearModel:
        """From the command of the response to the response, the control (the command to the servo),
        and the coupled signal if the plant has it.
        """
        P, K, axis = self.plant, self.controller, self.axis
        indices([axis.response], K.inputs, "measurement of the controller")
        indices([axis.control], K.outputs, "control")
        seen = P.select(inputs=K.outputs, outputs=K.inputs)
        if np.any(seen.D):
            raise InputError(
                "an output that is fed back depends on an input directly; put an actuator or a"
                " delay between"
            )
        coupled = [axis.coupled] if axis.coupled in P.outputs else []
        shown = P.select(inputs=K.outputs, outputs=[*dict.fromkeys((*K.inputs, *coupled))])
        if np.any(shown.D):
            raise InputError(f"{axis.coupled}: an input acts on it directly, without a state")
        found = connect(
            shown,
            K,
            inputs=["command"],
            outputs=[axis.response, axis.control, *coupled],
            sums={axis.response: {axis.response: 1.0, "command": -1.0}},
        )
        names = ("response", "control", *("coupled" for _ in coupled))
        return replace(found, outputs=signals(names))

    @property
    def answers(self) -> bool:
        """Whether the controller moves its control for the response at all."""
        K = self.controller.select(inputs=[self.axis.response], outputs=[self.axis.control])
        return bool(np.any(K.D) or (np.any(K.B) and np.any(K.C)))

    @cached_property
    def rejection(self) -> LinearModel:
        """From a disturbance added to the response to their sum: the sensitivity at the output."""
        T = self.closed.select(outputs=["response"])
        return replace(T, C=-T.C, D=1.0 - T.D)

    @cached_property
    def sensitivity(self) -> LinearModel:
        """1 / (1 + L) at the control."""
        L = self.broken
        return replace(L, A=L.A - L.B @ L.C, C=-L.C, D=np.ones((1, 1)))

    def stepped(self, window: float) -> tuple[Array, Array]:
        """Return outputs (n, ..) of `closed` after a step of the axis's size, and times (n,)."""
        if ("step", window) not in self._kept:
            found = self.closed.step_response(window, SAMPLES + 1)
            self._kept["step", window] = found.values[:, :, 0] * self.axis.step, found.time
        return self._kept["step", window]

    def attitude(self, band: tuple[float, float]) -> Bandwidth:
        """Bandwidth of the attitude, which is the response or its integral, to its command."""
        if ("bandwidth", band) not in self._kept:
            T = self.closed.select(outputs=["response"])
            rate = self.axis.type == "rate"
            self._kept["bandwidth", band] = (
                attitude_bandwidth(integral(T) if rate else T, band, command=True)
                if self.answers
                else Bandwidth(*(math.nan,) * 4)
            )
        return self._kept["bandwidth", band]

    def first_order(self, window: float) -> tuple[float, float]:
        """Inverse time constant (1/s) and delay (s) of the response; see `first_order_fit`."""
        if ("fit", window) not in self._kept:
            y, t = self.stepped(window)
            self._kept["fit", window] = first_order_fit(y[:, 0], t)
        return self._kept["fit", window]

    @cached_property
    def _kept(self) -> dict[tuple[str, object], Any]:
        return {}

    @cached_property
    def onset(self) -> float:
        """Lowest frequency, rad/s, at which a sinusoidal command of the axis's size asks for the
        servo's rate limit; NaN where none does.
        """
        if math.isnan(self.rate_limit):
            return math.nan
        top = FASTEST if self.closed.dt is None else 0.999 * math.pi / self.closed.dt
        omega = np.geomspace(1e-3 * top, top, SAMPLES)
        commanded = np.abs(
            self.closed.select(outputs=["control"]).frequency_response(omega)[:, 0, 0]
        )
        excess = np.log(commanded * omega * self.axis.step / self.rate_limit)
        above = np.flatnonzero(excess >= 0)
        if not len(above):
            return math.nan
        k = int(above[0])
        if k == 0:
            return float(omega[0])
        share = -excess[k - 1] / (excess[k] - excess[k - 1])
        return float(omega[k - 1] * (omega[k] / omega[k - 1]) ** share)


def integral(model: LinearModel) -> LinearModel:
    """Return the integral of a model's one output: exact in continuous time, by the trapezoidal
    rule in discrete time, whose phase is -90 deg too.
    """
    n = len(model.A)
    dt = 1.0 if model.dt is None else model.dt
    corner = 0.0 if model.dt is None else 1.0
    A = np.block([[model.A, np.zeros((n, 1))], [dt * model.C, np.full((1, 1), corner)]])
    half = 0.0 if model.dt is None else 0.5 * model.dt
    return replace(
        model,
        A=A,
        B=np.vstack([model.B, dt * model.D]),
        C=np.hstack([half * model.C, np.ones((1, 1))]),
        D=half * model.D,
        states=(*model.states, "integral"),
    )


def rejection_bandwidth(S: LinearModel, level: float = 10 ** (-3 / 20)) -> float:
    """Return the lowest frequency, rad/s, at which the gain of a sensitivity rises through `level`;
    0 where it is nowhere below.

    Without a frequency grid: the crossings are eigenvalues of a Hamiltonian matrix.
    """
    A, B, C, D = S.A, S.B, S.C, S.D
    if S.dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
    omega = crossings(A, B, C, D, level)
    if S.dt is not None:
        omega = 2 * np.arctan(omega) / S.dt

    def gain(at: Array) -> Array:
        return np.abs(S.frequency_response(at)[:, 0, 0])

    omega = omega[omega > 0]
    if not len(omega):
        return 0.0
    omega = omega[np.abs(gain(omega) / level - 1) < 1e-4]  # eigenvalues near the axis go
    ends = np.concatenate([[1e-3 * omega[0]], omega, [2 * omega[-1]]]) if len(omega) else omega
    if S.dt is not None:
        ends = np.minimum(ends, math.pi / S.dt)
    below = gain(np.sqrt(ends[:-1] * ends[1:])) < level if len(ends) else np.zeros(0, bool)
    rising = np.flatnonzero(below[:-1] & ~below[1:])
    return float(omega[rising[0]]) if len(rising) else 0.0


def mode_damping(T: LinearModel, band: tuple[float, float]) -> float:
    """Return the least damping of the modes with a natural frequency within `band`, rad/s, that are
    at least `SHARE` of the response of one output to a unit step; 1 where there is none.
    """
    poles, left, right = (np.asarray(part) for part in eig(T.A, left=True, right=True))
    if T.dt is None:
        s, steady = poles, -poles
    else:
        with np.errstate(divide="ignore"):
            s, steady = np.log(poles.astype(complex)) / T.dt, 1.0 - poles
    size = np.abs(s)
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.sum(left.conj() * right, axis=0)
        share = (T.C @ right)[0] * (left.conj().T @ T.B)[:, 0] / (weight * steady)
    seen = np.abs(share) * np.where(np.abs(np.imag(poles)) > 0, 2.0, 1.0) >= SHARE
    kept = seen & (size >= band[0]) & (size <= band[1]) & (size > 0)
    return float((-np.real(s[kept]) / size[kept]).min(initial=1.0))


def rate_over_change(y: Array, dt: float) -> float:
    """Return the peak rate over the peak change, 1/s, of a signal (n,) sampled every `dt` s; NaN of
    one at rest.
    """
    change = float(np.abs(y - y[0]).max())
    return float(np.abs(np.diff(y)).max()) / dt / change if change else math.nan


def first_order_fit(y: Array, t: Array) -> tuple[float, float]:
    """Return a (1/s) and tau (s) of b (1 - exp(-a (t - tau))) / a from tau on, 0 before, that fits
    a step response (n,) best; a = 0 is a ramp.
    """

    def fitted(x: Array) -> Array:
        a, tau = x
        after = np.maximum(t - tau, 0.0)
        shape = -np.expm1(-a * after) / a if a > 1e-9 else after
        power = shape @ shape
        return shape * (shape @ y / power) - y if power > 0 else -y

    end = float(t[-1])
    high = (1e3 / end, 0.5 * end)
    starts = [(a / end, tau * end) for a in (0.3, 2.0, 8.0) for tau in (0.02, 0.1)]
    best = min(starts, key=lambda x: float(np.sum(fitted(np.array(x)) ** 2)))
    found = least_squares(fitted, best, bounds=((0.0, 0.0), high), x_scale=(1 / end, 0.1 * end))
    return float(found.x[0]), float(found.x[1])


def _inverse_time_constant(at: AxisLoop, spec: Specification) -> float:
    return at.first_order(spec.window)[0]


def _equivalent_delay(at: AxisLoop, spec: Specification) -> float:
    return 1e3 * at.first_order(spec.window)[1]


def _quickness(at: AxisLoop, spec: Specification) -> float:
    """Peak rate over peak change after a step of the attitude; of an axis whose response is a rate,
    of its impulse response, which is the same of the attitude.
    """
    y, t = at.stepped(spec.window)
    return rate_over_change(y[:, 0], t[1] - t[0])


def _coupling(at: AxisLoop, spec: Specification) -> float:
    if "coupled" not in at.closed.outputs:
        return math.nan
    return float(np.abs(at.stepped(spec.window)[0][:, 2]).max()) / at.axis.step


def _effort(at: AxisLoop, spec: Specification) -> float:
    return 100 * float(np.abs(at.stepped(spec.window)[0][:, 1]).max()) / at.travel


def _servo_rate(at: AxisLoop, spec: Specification) -> float:
    y, t = at.stepped(spec.window)
    change = np.abs(np.diff(y[:, 1], prepend=0.0)).max() / (t[1] - t[0])
    return 100 * float(change) / at.rate_limit


def _rate_at_the_stop(at: AxisLoop, spec: Specification) -> float:
    """Largest response, deg/s, with the control moved to its stop from the middle and its own loop
    open.
    """
    L, inputs = at.broken, at.controller.outputs
    C = at.plant.select(inputs=inputs, outputs=[at.axis.response]).C
    free = replace(
        L,
        C=np.hstack([C, np.zeros((1, len(L.A) - C.shape[1]))]),
        outputs=signals((at.axis.response,)),
    )
    y = free.step_response(spec.window, SAMPLES + 1).values
    return math.degrees(float(np.abs(y).max()) * at.travel)


def _olop(at: AxisLoop) -> complex:
    """L at the onset of the rate limit."""
    if math.isnan(at.onset):
        return complex(math.nan)
    return complex(at.broken.frequency_response([at.onset])[0, 0, 0])


def _peak(model: LinearModel) -> float:
    return decibels(norm(model.A, model.B, model.C, model.D, model.dt)[0])


def _bandwidth(at: AxisLoop, spec: Specification) -> float:
    """That of the phase; for an axis whose response is a rate, also within that of the gain."""
    found = at.attitude(spec.band)
    return found.attitude_response if at.axis.type == "attitude" else found.rate_response


MEASURES: dict[str, Callable[[AxisLoop, Specification], float]] = {
    "gain_margin": lambda at, _: at.margins.gain_margin,
    "phase_margin": lambda at, _: at.margins.phase_margin,
    "delay_margin": lambda at, _: 1e3 * at.margins.delay,
    "disk_gain": lambda at, _: decibels(at.margins.disk_gain[1]),
    "disk_phase": lambda at, _: math.degrees(at.margins.disk_phase),
    "input_peak": lambda at, _: _peak(at.sensitivity),
    "crossover": lambda at, _: at.margins.highest_crossover,
    "damping": lambda at, spec: mode_damping(at.closed.select(outputs=["response"]), spec.band),
    "bandwidth": _bandwidth,
    "gain_bandwidth": lambda at, spec: at.attitude(spec.band).gain_bandwidth,
    "phase_delay": lambda at, spec: 1e3 * at.attitude(spec.band).phase_delay,
    "inverse_time_constant": _inverse_time_constant,
    "equivalent_delay": _equivalent_delay,
    "response_peak": lambda at, _: _peak(at.closed.select(outputs=["response"])),
    "quickness": _quickness,
    "coupling": _coupling,
    "rate_at_the_stop": _rate_at_the_stop,
    "rejection_bandwidth": lambda at, _: rejection_bandwidth(at.rejection),
    "rejection_peak": lambda at, _: _peak(at.rejection),
    "effort": _effort,
    "servo_rate": _servo_rate,
    "olop_gain": lambda at, _: decibels(abs(_olop(at))) if _olop(at) == _olop(at) else math.nan,
    "olop_phase": lambda at, _: math.degrees(np.angle(_olop(at))),
}
"""By the name that a sheet uses, with the units of the packaged sheet: dB, deg, ms, rad/s, 1/s,
percent.
"""
