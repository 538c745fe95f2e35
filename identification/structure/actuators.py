"""Deflections of the controls from recorded commands: a delay, and servos behind it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from symheli import LinearModel
from symheli.errors import InputError
from symheli.flight import Servo
from symheli.flight.servo import one_each
from symheli.lpv.tools import Actuation
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS

CONTROLS = tuple(map(str, INPUTS))

SETTLING = 0.5
"""Time that servos need to forget where a record began, s."""


@dataclass(frozen=True)
class Actuators:
    """Actuators stand between command and deflection: a delay (s), then a servo for each control.

    Parameters
    ----------
    servos : mapping of str to Servo, or Actuation, optional
        By control, as d_lon, d_lat, d_col, d_ped: from the bench, or the maker. None: the delay
        alone. An Actuation has delay and period too.
    delay : float
        From command to servo, s, of any part of a sample.
    bandwidth_deviation : float
        Relative standard deviation of the servos' bandwidth, common to all; 0: known.
    delay_deviation : float
        Standard deviation of the delay, s; 0: known.
    period : float, optional
        Time between two commands, s, where the log has only every second or third of them; those
        between are interpolated. Default: the record's sample period.

    Raises
    ------
    InputError
        A number out of range.

    See Also
    --------
    identification.KinematicARX : a structure with known kinematics
    symheli.Servo : lag, travel and rate of an actuator

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

    servos: Mapping[str, Servo] | None = None
    delay: float = 0.0
    bandwidth_deviation: float = 0.0
    delay_deviation: float = 0.0
    period: float | None = None

    def __post_init__(self) -> None:
        actuation = Actuation.of(self.servos, self.delay, self.period)
        for name in ("servos", "delay", "period"):
            object.__setattr__(self, name, getattr(actuation, name))
        for name in ("bandwidth_deviation", "delay_deviation"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name}: expected a finite number >= 0, got {value!r}")
        if self.bandwidth_deviation and not self.servos:
            raise InputError("bandwidth_deviation: there are no servos whose bandwidth it could be")

    @property
    def unknown(self) -> tuple[str, ...]:
        """Unknowns that are estimated: "bandwidth", a factor of it, and "delay" (s)."""
        given = {"bandwidth": self.bandwidth_deviation, "delay": self.delay_deviation}
        return tuple(name for name, deviation in given.items() if deviation)

    def point(self, z: Sequence[float]) -> dict[str, float]:
        """Factor of the bandwidth, and delay (s), at `z` in their prior deviations."""
        moved = dict(zip(self.unknown, z, strict=True))
        return {
            "bandwidth": math.exp(self.bandwidth_deviation * moved.get("bandwidth", 0.0)),
            "delay": max(self.delay + self.delay_deviation * moved.get("delay", 0.0), 0.0),
        }

    def moved(self, z: Sequence[float]) -> Actuators:
        """Return these at `z` in their prior deviations from the given values."""
        point = self.point(z)
        servos = self.servos and {u: faster(s, point["bandwidth"]) for u, s in self.servos.items()}
        return replace(self, servos=servos, delay=point["delay"])

    def found(self, z: Sequence[float], deviations: Sequence[float]) -> Estimates:
        """Value and standard deviation of what is estimated, at `z` with `deviations`, both in
        prior deviations.
        """
        point = self.point(z)
        size = {
            "bandwidth": self.bandwidth_deviation * point["bandwidth"],
            "delay": self.delay_deviation,
        }
        return {
            name: (point[name], size[name] * float(deviation))
            for name, deviation in zip(self.unknown, deviations, strict=True)
        }

    def settled(self, estimates: Estimates) -> Actuators:
        """Return these with estimated values in place of the prior's, as known ones."""
        factor, _ = estimates.get("bandwidth", (1.0, 0.0))
        delay, _ = estimates.get("delay", (self.delay, 0.0))
        servos = self.servos and {u: faster(s, factor) for u, s in self.servos.items()}
        known = {"bandwidth_deviation": 0.0, "delay_deviation": 0.0}
        return replace(self, servos=servos, delay=delay, **known)

    def require(self, controls: Sequence[str]) -> None:
        """Raises `InputError` where a control has no servo."""
        if self.servos is not None:
            one_each({u: s for u, s in self.servos.items() if u in controls}, controls)

    # --- along a record --------------------------------------------------------------------------

    def deflections(
        self,
        commands: Array,
        dt: float,
        bandwidth: float = 1.0,
        delay: float | None = None,
        controls: Sequence[str] = CONTROLS,
    ) -> Array:
        """Mean deflection (n, nu) over each sample, rad, of commands (n, nu) that are held for `dt`
        seconds each, from rest at the first ones; bandwidths times a factor, another delay (s).

        Raises `InputError` for a control without servo, or a `period` that does not divide `dt`.
        """
        self.require(controls)
        late, ratio = self.delay if delay is None else delay, self._ratio(dt)
        fine = dt / ratio
        held = _between(commands, ratio)
        moved, whole, part = held - held[0], *_parts(late, fine)
        late_by = [
            np.vstack([np.zeros((n, moved.shape[1])), moved])[: len(moved)]
            for n in (whole + 1, whole)
        ]
        out = np.empty_like(held)
        for j, u in enumerate(controls):
            system = self._over_a_sample(u, fine, part, bandwidth)
            out[:, j] = held[0, j]
            for i, command in enumerate(late_by):
                out[:, j] += _response(system, i, command[:, j])
        return out.reshape(len(commands), ratio, -1).mean(axis=1)

    def along(
        self, record: FlightRecord, commands: Sequence[str], controls: Sequence[str]
    ) -> Array:
        """Mean deflections (n, nu) of a record's `commands`; NaN where one is missing and until
        servos have forgotten how a piece began.
        """
        u = record.columns(commands)
        out = np.full_like(u, np.nan)
        settled = round(SETTLING / record.dt)
        for piece in pieces(record, u):
            part = slice(piece.start, piece.stop)
            out[part] = self.deflections(u[part], record.dt, controls=controls)
            out[piece.start : piece.start + settled] = np.nan
        return out

    # --- for design ------------------------------------------------------------------------------

    def sampled(self, controls: Mapping[str, Signal], dt: float) -> dict[str, LinearModel]:
        """From each held command to the mean deflection of its control over the sample, at `dt`
        seconds, by name of the input; see `LinearModel.driven_by`.
        """
        self.require(tuple(controls))
        return {str(u): self._chain(control, u, dt) for control, u in controls.items()}

    def _chain(self, control: str, u: Signal, dt: float) -> LinearModel:
        whole, part = _parts(self.delay, dt)
        F, G, c, d = self._over_a_sample(control, dt, part, 1.0)
        n, kept = len(F), whole + (part > 0)
        A, B = np.zeros((n + kept, n + kept)), np.zeros((n + kept, 1))
        C, D = np.zeros((1, n + kept)), np.zeros((1, 1))
        A[:n, :n], C[:, :n] = F, c
        for age, i in ((whole + 1, 0), (whole, 1)):  # the older command, and the newer
            if age > kept:
                continue
            if age == 0:
                B[:n, 0], D[:, 0] = B[:n, 0] + G[:, i], D[:, 0] + d[:, i]
            else:
                A[:n, n + age - 1] += G[:, i]
                C[:, n + age - 1] += d[:, i]
        if kept:
            B[n, 0] = 1.0
            A[n + 1 :, n : n + kept - 1] = np.eye(kept - 1)
        servo = [s.unit for s in self.servos[control].linear(control).states] if self.servos else []
        states = (
            *(Signal(f"{control}_servo{i + 1}", unit) for i, unit in enumerate(servo)),
            *(Signal(f"{u}_late{age + 1}", u.unit) for age in range(kept)),
        )
        mean = Signal(behind(u), u.unit)
        return LinearModel(A, B, C, D, states, (u,), (mean,), dt=dt)

    def _over_a_sample(self, control: str, dt: float, part: float, bandwidth: float) -> System:
        """State after a sample, and mean deflection in it, from the state before and two commands:
        the older one acts until the newer one arrives, a `part` (s) of the sample later.
        """
        if self.servos is None:
            A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
        else:
            m = self.servos[control].linear(control)
            A, B, C, D = m.A * bandwidth, m.B * bandwidth, m.C, m.D
        F, G, c, d = _held(A, B, C, D, part)
        F_, G_, c_, d_ = _held(A, B, C, D, dt - part)
        return (
            F_ @ F,
            np.hstack([F_ @ G, G_]),
            (c + c_ @ F) / dt,
            np.hstack([d + c_ @ G, d_]) / dt,
        )

    def _ratio(self, dt: float) -> int:
        """Number of commands in a sample."""
        if self.period is None:
            return 1
        ratio = round(dt / self.period)
        if ratio < 1 or not math.isclose(ratio * self.period, dt, rel_tol=1e-3):
            raise InputError(
                f"period: {self.period:g} s does not divide the sample period of the record,"
                f" {dt:g} s"
            )
        return ratio


System = tuple[Array, Array, Array, Array]
Estimates = dict[str, tuple[float, float]]


def faster(servo: Servo, factor: float) -> Servo:
    """Return the servo with all its frequencies times a factor."""
    pair = {n: v and v * factor for n, v in (("zero", servo.zero), ("pole", servo.pole))}
    return replace(servo, natural_frequency=servo.natural_frequency * factor, **pair)


def bare(command: str) -> str:
    """Return the control that a command is of."""
    return command.removesuffix("_command")


def behind(command: str) -> str:
    """Return the name of the mean deflection that follows a command."""
    return f"{bare(command)}_mean"


def pieces(record: FlightRecord, u: Array) -> Iterator[range]:
    """Pieces of a record without a gap in time or in the inputs `u` (n, nu)."""
    whole_rows: list[bool] = np.isfinite(u).all(axis=1).tolist()  # type: ignore[assignment]
    for part in record.segments():
        for known, group in groupby(range(part.start, part.stop), key=lambda k: whole_rows[k]):
            rows = list(group)
            if known:
                yield range(rows[0], rows[-1] + 1)


def _parts(late: float, dt: float) -> tuple[int, float]:
    """Whole samples of a delay, and what is left of it, s."""
    whole = int(late / dt + 1e-9)
    return whole, max(late - whole * dt, 0.0)


def _between(commands: Array, ratio: int) -> Array:
    """Commands (n ratio, nu) where only one in `ratio` is known: those between interpolated."""
    if ratio == 1:
        return commands
    known = np.arange(len(commands), dtype=float)
    wanted = np.arange(len(commands) * ratio) / ratio
    return np.column_stack([np.interp(wanted, known, u) for u in commands.T])


def _response(system: System, i: int, u: Array) -> Array:
    """Output of one input of a system from rest."""
    if not len(system[0]):
        return system[3][0, i] * u
    numerator, denominator = ss2tf(*system, input=i)
    return np.asarray(lfilter(numerator[0], denominator, u))


def _held(A: Array, B: Array, C: Array, D: Array, time: float) -> System:
    """State after `time` seconds, and integral of the output, from state and held input."""
    n, m, p = len(A), B.shape[1], len(C)
    whole = np.zeros((n + p + m, n + p + m))
    whole[:n, :n], whole[:n, n + p :] = A, B
    whole[n : n + p, :n], whole[n : n + p, n + p :] = C, D
    E = expm(whole * time)
    return E[:n, :n], E[:n, n + p :], E[n : n + p, :n], E[n : n + p, n + p :]
