"""Attitude and rate loops of ArduPilot's traditional helicopter, from their parameters: in flight,
and as a linear model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import butter

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.values.named_vector import NamedVector
from symheli.values.numbers import positive
from symheli.values.signal import signals

AXES = {"RLL": ("p", "phi", "d_lat"), "PIT": ("q", "theta", "d_lon"), "YAW": ("r", "", "d_ped")}
"""Rate, attitude and control of each axis; in yaw the rate is commanded."""

MEASURED = ("p", "q", "r", "phi", "theta")
"""Signals that the loops feed back: rates (rad/s) and attitudes (rad)."""

COMMANDS = {"phi_command": "rad", "theta_command": "rad", "r_command": "rad/s"}
"""Commands of the pilot, with units, in the order of `AXES`."""

LEAK = 0.02
"""Part of the integrator beyond its lower limit that leaks away at every step."""

FULL = math.pi / 4
"""Deflection (rad) that an output of 1 stands for, where nothing else is measured."""

UNSUPPORTED = ("NTF", "NEF", "SMAX", "PDMX", "D_FF")
"""Endings of parameters of a rate controller that are not modelled: refused where not 0."""


@dataclass(frozen=True)
class RateController:
    """One axis: P, I (1/s), D (s) and feedforward FF of the rate, in output per rad/s; IMAX and
    ILMI, the limit of the integrator and the level down to which it leaks; FLTT, FLTE, FLTD,
    corner frequencies (Hz) of the first-order filters of target, error and derivative, 0 for none;
    and the gain of the attitude (1/s).
    """

    P: float
    I: float
    D: float
    FF: float
    IMAX: float
    ILMI: float
    FLTT: float
    FLTE: float
    FLTD: float
    attitude: float = 0.0


NO_GAINS = dict.fromkeys(("P", "I", "D", "FF", "attitude"), 0.0)

RATE_ENTRIES = tuple(f.name for f in fields(RateController))[:-1]


@dataclass(frozen=True)
class Pilot:
    """What commands attitudes and collective in a simulated flight: attitude per error of the
    velocity (rad s/m), and collective per error of the vertical velocity (rad s/m).
    """

    speed: float = 0.03
    climb: float = 0.02


class _Memory(NamedTuple):
    gyro: Array
    target: Array
    error: Array
    derivative: Array
    integrator: Array


class _Terms(NamedTuple):
    """Of a rate controller's output, their sum before its limit: in parts of the full output."""

    P: Array
    I: Array
    D: Array
    FF: Array


@dataclass(frozen=True)
class HelicopterLoops:
    """The loops of three axes, each sample: the gyro is filtered, the attitude error times a gain
    is the target of the rate, and a PID with feedforward and filters makes the output.

    Written after ArduPilot's documentation of its parameters and of its rate controller; what a log
    confirms of it shows `replay`. Left out: input shaping, the square root beyond small attitude
    errors, piro compensation, notches that follow the rotor speed.

    Parameters
    ----------
    axes : mapping of str to RateController
        By "RLL", "PIT", "YAW".
    dt : float
        Period of the loops, s.
    gyro : float
        Corner frequency of the second-order low-pass of the gyro, Hz; 0 for none.
    notch : tuple of float, optional
        Center and width (Hz) and attenuation (dB) of a static notch.
    throw : mapping of str to float
        Deflection (rad) of d_lat, d_lon and d_ped at an output of 1: measured on the bench.
    pilot : Pilot
        Of simulated flights.

    Raises
    ------
    InputError
        A number out of range, or an axis that is missing.

    Examples
    --------
    >>> gains = {"P": 0.05, "I": 0.1, "D": 0.001, "FF": 0.1, "IMAX": 0.3, "ILMI": 0.05}
    >>> axis = symheli.flight.RateController(**gains, FLTT=20, FLTE=0, FLTD=20, attitude=4.5)
    >>> loops = symheli.flight.HelicopterLoops(dict.fromkeys(("RLL", "PIT", "YAW"), axis), 0.01)
    >>> [str(u) for u in loops.linear.outputs]
    ['d_lat', 'd_lon', 'd_ped']
    """

    axes: Mapping[str, RateController]
    dt: float
    gyro: float = 0.0
    notch: tuple[float, float, float] | None = None
    throw: Mapping[str, float] | None = None
    pilot: Pilot = Pilot()

    def __post_init__(self) -> None:
        positive(self.dt, "dt")
        if set(self.axes) != set(AXES):
            raise InputError(f"expected the axes {', '.join(AXES)}, got {', '.join(self.axes)}")
        for name, axis in self.axes.items():
            for entry in fields(axis):
                value = getattr(axis, entry.name)
                if not math.isfinite(value) or value < 0:
                    raise InputError(f"{name} {entry.name}: expected a number >= 0, got {value!r}")
        for name in self.throw or {}:
            if name not in self._controls:
                raise UnknownNameError("control", name, self._controls)
        if not 0 <= self.gyro < 0.5 / self.dt:
            raise InputError(
                f"gyro: expected a corner frequency below {0.5 / self.dt:g} Hz, got {self.gyro!r}"
            )

    # --- from parameters -------------------------------------------------------------------------

    @classmethod
    def from_parameters(
        cls,
        parameters: Mapping[str, float],
        *,
        throw: Mapping[str, float] | None = None,
        pilot: Pilot | None = None,
    ) -> HelicopterLoops:
        """The loops of a `.param` file or log (`symheli.logs.parameters.read_parameters`).

        Raises `InputError` with the names of all parameters that are missing, or set to what is not
        modelled.
        """
        needed = {
            f"ATC_RAT_{axis}_{entry}": (axis, entry) for axis in AXES for entry in RATE_ENTRIES
        }
        angles = {f"ATC_ANG_{axis}_P": axis for axis in AXES}
        missing = [name for name in (*needed, *angles) if name not in parameters]
        if missing:
            raise InputError(
                f"parameters are missing: {', '.join(missing)}; a helicopter's log or .param file"
                " has them all"
            )
        set_anyway = [
            f"{name} = {parameters[name]:g}"
            for axis in AXES
            for ending in UNSUPPORTED
            if parameters.get(name := f"ATC_RAT_{axis}_{ending}")
        ]
        if parameters.get("INS_HNTCH_ENABLE") and parameters.get("INS_HNTCH_MODE"):
            set_anyway.append(f"INS_HNTCH_MODE = {parameters['INS_HNTCH_MODE']:g}")
        if set_anyway:
            raise InputError(f"parameters that are not modelled are set: {', '.join(set_anyway)}")
        notch = None
        if parameters.get("INS_HNTCH_ENABLE"):
            names = ("INS_HNTCH_FREQ", "INS_HNTCH_BW", "INS_HNTCH_ATT")
            if lacking := [name for name in names if name not in parameters]:
                raise InputError(f"parameters are missing: {', '.join(lacking)}")
            notch = (parameters[names[0]], parameters[names[1]], parameters[names[2]])
        axes = {
            axis: RateController(
                **{entry: parameters[f"ATC_RAT_{axis}_{entry}"] for entry in RATE_ENTRIES},
                attitude=parameters[f"ATC_ANG_{axis}_P"],
            )
            for axis in AXES
        }
        return cls(
            axes,
            1.0 / parameters.get("SCHED_LOOP_RATE", 400.0),
            parameters.get("INS_GYRO_FILTER", 20.0),
            notch,
            throw,
            pilot or Pilot(),
        )

    # --- one step --------------------------------------------------------------------------------

    @property
    def _controls(self) -> tuple[str, ...]:
        return tuple(control for _, _, control in AXES.values())

    @cached_property
    def _numbers(self) -> dict[str, Array]:
        """Every entry of the axes side by side, corner frequencies as gains of the filters."""
        out = {
            f.name: np.array([getattr(self.axes[axis], f.name) for axis in AXES])
            for f in fields(RateController)
        }
        for name in ("FLTT", "FLTE", "FLTD"):
            corner = 2 * np.pi * out[name] * self.dt
            out[name] = np.where(corner > 0, corner / (1.0 + corner), 1.0)
        out["throw"] = np.array([(self.throw or {}).get(u, FULL) for u in self._controls])
        return out

    @cached_property
    def _sections(self) -> Array:
        """Second-order sections (k, 6) of the gyro."""
        found = []
        if self.gyro:
            found.append(np.asarray(butter(2, self.gyro, fs=1 / self.dt, output="sos"))[0])
        if self.notch is not None:
            center, width, attenuation = self.notch
            A = 10.0 ** (-attenuation / 40.0)
            octaves = 2.0 * math.log2(center / (center - width / 2.0))
            Q = math.sqrt(2.0**octaves) / (2.0**octaves - 1.0)
            omega = 2 * math.pi * center * self.dt
            alpha, c = math.sin(omega) / (2 * Q), math.cos(omega)
            found.append([1 + alpha * A**2, -2 * c, 1 - alpha * A**2, 1 + alpha, -2 * c, 1 - alpha])
        sections = np.array(found, float).reshape(-1, 6)
        return sections / sections[:, [3]]

    def _advance(
        self, memory: _Memory, rate: Array, target: Array, *, limited: bool
    ) -> tuple[Array, _Memory]:
        """Output (3,) before the throw, and what is kept, from rates and their targets (3,)."""
        gyro = memory.gyro.copy()
        for k, (b0, b1, b2, _, a1, a2) in enumerate(self._sections):  # transposed direct form II
            passed = b0 * rate + gyro[k, 0]
            gyro[k] = b1 * rate - a1 * passed + gyro[k, 1], b2 * rate - a2 * passed
            rate = passed
        terms, memory = self._pid(memory._replace(gyro=gyro), rate, target, limited=limited)
        out = terms.P + terms.I + terms.D + terms.FF
        return (np.clip(out, -1.0, 1.0) if limited else out), memory

    def _pid(
        self, memory: _Memory, rate: Array, target: Array, *, limited: bool
    ) -> tuple[_Terms, _Memory]:
        """Terms (3,) of the three axes from filtered rates and targets (3,), and what is kept."""
        n = self._numbers
        filtered = memory.target + n["FLTT"] * (target - memory.target)
        error = memory.error + n["FLTE"] * (filtered - rate - memory.error)
        slope = (error - memory.error) / self.dt
        derivative = memory.derivative + n["FLTD"] * (slope - memory.derivative)
        integrator = memory.integrator + n["I"] * error * self.dt
        if limited:
            integrator = np.clip(integrator, -n["IMAX"], n["IMAX"])
            beyond = np.sign(integrator) * np.maximum(np.abs(integrator) - n["ILMI"], 0.0)
            integrator = integrator - LEAK * beyond
        terms = _Terms(n["P"] * error, integrator, n["D"] * derivative, n["FF"] * filtered)
        return terms, _Memory(memory.gyro, filtered, error, derivative, integrator)

    def replay(self, axis: str, target: Array, measured: Array) -> dict[str, Array]:
        """What the controller of one axis makes of logged targets and rates, to compare with the
        outputs that the autopilot logged.

        Parameters
        ----------
        axis : str
            "RLL", "PIT" or "YAW".
        target, measured : (n,) arrays
            Rates (rad/s) at the period of the loops from rest on: of a DataFlash log PIDR.Tar and
            PIDR.Act, where the gyro is filtered already. Of slower messages P and FF hold (without
            filters sample by sample), I nearly, D not.

        Returns
        -------
        dict of (n,) arrays
            P, I, D and FF in parts of the full output; their sum is the output before its limit.

        Raises
        ------
        InputError
            Where the arrays differ in length, or hold what is no number.

        Examples
        --------
        >>> gains = {"P": 0.05, "I": 0.1, "D": 0.0, "FF": 0.1, "IMAX": 0.3, "ILMI": 0.3}
        >>> axis = symheli.flight.RateController(**gains, FLTT=0, FLTE=0, FLTD=0)
        >>> loops = symheli.flight.HelicopterLoops(dict.fromkeys(("RLL", "PIT", "YAW"), axis), 0.01)
        >>> terms = loops.replay("RLL", np.full(100, 1.0), np.zeros(100))
        >>> ", ".join(f"{name} {term[-1]:.3f}" for name, term in terms.items())
        'P 0.050, I 0.100, D 0.000, FF 0.100'
        """
        if axis not in AXES:
            raise UnknownNameError("axis", axis, AXES)
        target, measured = (np.asarray(a, float) for a in (target, measured))
        if target.shape != measured.shape or target.ndim != 1:
            raise InputError(
                f"replay: expected targets and rates of one length, got {target.shape} and"
                f" {measured.shape}"
            )
        if not (np.isfinite(target).all() and np.isfinite(measured).all()):
            raise InputError("replay: targets or rates are missing; cut the log to where both are")
        k, memory, out = list(AXES).index(axis), self.init(), np.zeros((4, len(target)))
        for i, (wanted, rate) in enumerate(zip(target, measured, strict=True)):
            terms, memory = self._pid(memory, np.full(3, rate), np.full(3, wanted), limited=True)
            out[:, i] = [term[k] for term in terms]
        return dict(zip(_Terms._fields, out, strict=True))

    def init(self) -> _Memory:
        """Memory of loops at rest."""
        return _Memory(np.zeros((len(self._sections), 2, 3)), *(np.zeros(3) for _ in range(4)))

    def step(
        self, state: _Memory, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, _Memory]:
        """Blade pitch commands (4,), rad, as deviations from the reference, and the next state."""
        off = {x: measured[x] - reference[x] for x in ("u", "v", "w", "phi", "theta")}
        attitude = np.array(
            [
                -self.pilot.speed * off["v"] - off["phi"],
                self.pilot.speed * off["u"] - off["theta"],
                0.0,
            ]
        )
        target = self._numbers["attitude"] * attitude
        rate = np.array([measured[x] - reference[x] for x in ("p", "q", "r")])
        out, state = self._advance(state, rate, target, limited=True)
        moved = dict(zip(self._controls, self._numbers["throw"] * out, strict=True))
        moved["d_col"] = self.pilot.climb * off["w"]
        return np.array([reference[str(u)] + moved[str(u)] for u in INPUTS]), state

    # --- as a linear model -----------------------------------------------------------------------

    @property
    def gains(self) -> dict[str, float]:
        """P, I, D and FF of every axis and the gains of the attitudes, by their parameters."""
        of = {"RAT": ("P", "I", "D", "FF"), "ANG": ("attitude",)}
        return {
            f"ATC_{kind}_{axis}_{entry if kind == 'RAT' else 'P'}": getattr(controller, entry)
            for axis, controller in self.axes.items()
            for kind, entries in of.items()
            for entry in entries
            if kind == "RAT" or AXES[axis][1]
        }

    @property
    def opened(self) -> LinearModel:
        """The loops without their `gains`, within the limits of outputs and integrators and nothing
        leaking: discrete, from p, q, r (rad/s), phi, theta (rad) and the outputs of the gains to
        d_lat, d_lon, d_ped (rad) and the inputs of the gains.
        """
        return self._opened.select(inputs=(*MEASURED, *self.gains))

    @cached_property
    def _opened(self) -> LinearModel:
        """The model `opened` with `COMMANDS` as further inputs."""
        rest, names = self.init(), list(self.gains)
        sizes = [np.size(part) for part in rest]
        nx = sum(sizes)
        own = signals((*MEASURED, *COMMANDS, *names), COMMANDS)
        m = nx + len(own)
        # every signal is a row over (states, inputs); axes are last
        unit = np.eye(m)
        parts = np.split(unit[:nx].T, np.cumsum(sizes)[:-1], axis=1)
        gyro, *others = (a.reshape(m, *b.shape) for a, b in zip(parts, rest, strict=True))
        memory = _Memory(np.moveaxis(gyro, 0, 2), *others)
        row = dict(zip(map(str, own), unit[nx:], strict=True))
        rate = np.column_stack([row[rate] for rate, _, _ in AXES.values()])
        error = [row["phi_command"] - row["phi"], row["theta_command"] - row["theta"]]
        attitude = np.column_stack([*error, np.zeros(m)])

        def of(kind: str, entry: str) -> Array:
            nothing = np.zeros(m)
            return np.column_stack([row.get(f"ATC_{kind}_{a}_{entry}", nothing) for a in AXES])

        without = {name: RateController(**{**vars(c), **NO_GAINS}) for name, c in self.axes.items()}
        target = of("ANG", "P")
        target[:, 2] += row["r_command"]
        _, later = replace(self, axes=without)._advance(memory, rate, target, limited=False)
        later = later._replace(integrator=later.integrator + of("RAT", "I"))
        out = later.integrator + of("RAT", "P") + of("RAT", "D") + of("RAT", "FF")
        read = {
            "P": later.error,
            "I": self.dt * later.error,
            "D": later.derivative,
            "FF": later.target,
        }
        inputs = []
        for name in names:
            _, kind, axis, entry = name.split("_")
            signal = attitude if kind == "ANG" else read[entry]
            inputs.append(signal[:, list(AXES).index(axis)])
        kept = later._replace(gyro=np.moveaxis(later.gyro, 2, 0))
        A = np.concatenate([part.reshape(m, -1) for part in kept], axis=1).T
        C = np.vstack([(self._numbers["throw"] * out).T, np.reshape(inputs, (-1, m))])
        return LinearModel(
            A[:, :nx],
            A[:, nx:],
            C[:, :nx],
            C[:, nx:],
            signals([f"loops_{k}" for k in range(nx)]),
            own,
            signals((*self._controls, *names)),
            self.dt,
        )

    @cached_property
    def linear(self) -> LinearModel:
        """Deflections d_lat, d_lon, d_ped (rad) from p, q, r (rad/s), phi, theta (rad) within the
        limits of outputs and integrators, nothing leaking: discrete, at the period of the loops.
        """
        return self.commanded.select(inputs=MEASURED)

    @cached_property
    def commanded(self) -> LinearModel:
        """The model `linear` with the commands of the pilot as further inputs: phi_command,
        theta_command (rad) and r_command (rad/s).
        """
        closed = self._opened.feedback({(name, name): k for name, k in self.gains.items()})
        return closed.select(inputs=(*MEASURED, *COMMANDS), outputs=self._controls)

    def with_parameters(self, changes: Mapping[str, float]) -> HelicopterLoops:
        """The loops after a change of parameters, {"ATC_RAT_RLL_P": 0.15}.

        Raises `UnknownNameError` for a parameter that is no part of them.
        """
        axes: dict[str, dict[str, Any]] = {
            name: {f.name: getattr(axis, f.name) for f in fields(axis)}
            for name, axis in self.axes.items()
        }
        known = {f"ATC_RAT_{a}_{e}": (a, e) for a in AXES for e in RATE_ENTRIES}
        known |= {f"ATC_ANG_{a}_P": (a, "attitude") for a in AXES}
        gyro = self.gyro
        for name, value in changes.items():
            if name == "INS_GYRO_FILTER":
                gyro = value
            elif name in known:
                axis, entry = known[name]
                axes[axis][entry] = value
            else:
                raise UnknownNameError("parameter of the loops", name, [*known, "INS_GYRO_FILTER"])
        return HelicopterLoops(
            {name: RateController(**entries) for name, entries in axes.items()},
            self.dt,
            gyro,
            self.notch,
            self.throw,
            self.pilot,
        )
