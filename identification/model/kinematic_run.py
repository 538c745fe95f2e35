"""A rigid vehicle with identified aerodynamics along a record: predicted, simulated, or in the
recorded loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.model.prediction import DIVERGED
from identification.structure.actuators import CONTROLS
from identification.structure.kinematic_arx import MOVING, STATES, KinematicARX
from identification.structure.regressors import basis_values, scheduling_values
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array
from symheli.values.controllers import begun
from symheli.values.kinematics import RIGID_BODY, kinematic_rates

CORRECTIONS = 2
"""Number of corrections of the trapezoidal rule a step: each leaves a tenth of the error at 50 Hz.
"""

STEEP = np.radians(89.0)
"""Pitch (rad) beyond which the Euler angles are singular."""

AIRSPEED = Signal("airspeed", "m/s")
COMMANDED = (AIRSPEED, Signal("acceleration", "m/s^2"))
MEASURED = (*RIGID_BODY, AIRSPEED)


@dataclass(frozen=True, eq=False)
class Run:
    """Along a record: y (n, 8), u (n, nu), coefficients C (n, lagged signals, 6) and all that p
    alone contributes, `known` (n, 6).

    `lags` (lagged signals,) and `columns`, of z and u side by side, say what C multiplies.
    """

    y: Array
    u: Array
    C: Array
    known: Array
    lags: Array
    columns: Array
    segments: tuple[slice, ...]
    memory: int
    dt: float

    @classmethod
    def along(cls, kin: KinematicARX, theta: Array, record: FlightRecord) -> Run:
        """Return the run with the p of a record; NaN where p is missing."""
        aero = kin.aerodynamics
        p = scheduling_values(aero, record)
        f = basis_values(aero, p)
        blocks = theta.reshape(-1, aero.basis.size, theta.shape[1])
        signals = [i for i, e in enumerate(aero.entries) if e.kind == "input"]
        entries = [aero.entries[i] for i in signals]
        known = np.einsum("kf,fo->ko", f, blocks[len(signals)])
        if kin.offset_rate:
            moving = np.diff(p.reshape(len(p), -1), axis=0, prepend=np.nan)
            known = known + np.einsum(
                "kd,kf,dfo->ko", moving, f, blocks[len(signals) + 1 :], optimize=True
            )
        columns = np.array([e.channel for e in entries])
        lags = np.array([e.lag for e in entries])
        C = np.einsum("kf,sfo->kso", f, blocks[signals], optimize=True)
        if kin.wind is not None:
            first = aero.inputs[: len(MOVING)]
            wind = record.columns(MOVING) - record.columns(first)
            for s, (column, lag) in enumerate(zip(columns, lags, strict=True)):
                if column < len(MOVING):
                    known[lag:] -= C[lag:, s] * wind[:-lag, column, None]
        return cls(
            record.columns(STATES),
            record.columns(aero.inputs[len(MOVING) :]),
            C,
            known,
            lags,
            columns,
            record.segments(),
            kin.memory,
            record.dt,
        )

    def step(self, k: Array | int, past: list[Array], inputs: list[Array]) -> Array:
        """y(k) (..., 8) from y(k-1), y(k-2), .. in `past` and u(k-1), .. in `inputs`."""
        rows = [np.concatenate([y[..., :6], u], -1) for y, u in zip(past, inputs, strict=True)]
        lagged = np.stack(rows, axis=-2)[..., self.lags - 1, self.columns]
        added = np.zeros(past[0].shape)
        added[..., :6] = np.einsum("...s,...so->...o", lagged, self.C[k]) + self.known[k]
        y = stepped(past[0], added, self.dt)
        lost = ~(np.abs(y).max(axis=-1) < DIVERGED) | ~(np.abs(y[..., 7]) < STEEP)
        known = np.isfinite(self.known[k]).all(axis=-1) & np.isfinite(lagged).all(axis=-1)
        return np.where(lost[..., None], np.where(known, np.inf, np.nan)[..., None], y)


def stepped(before: Array, added: Array, dt: float) -> Array:
    """States (..., 8) one sample after `before`: kinematics, and what is `added` (..., 8)."""
    rate, half = kinematic_rates(before), 0.5 * dt
    y = before + added + 2 * half * rate
    for _ in range(CORRECTIONS):
        y = before + added + half * (rate + kinematic_rates(y))
    return y


def predict(run: Run, horizon: int) -> Array:
    """Predictions (n, 8): every start advances together."""
    starts = np.concatenate(
        [np.arange(s.start + run.memory - 1, s.stop - horizon) for s in run.segments]
    ).astype(int)
    out = np.full_like(run.y, np.nan)
    if not len(starts):
        return out
    past = [run.y[starts - i] for i in range(run.memory)]
    bad = np.zeros(len(starts), bool)
    known = np.asarray(np.isfinite(past).all(axis=(0, 2)))
    with np.errstate(all="ignore"):
        for j in range(1, horizon + 1):
            inputs = [run.u[starts + j - 1 - i] for i in range(run.memory)]
            known &= np.isfinite(inputs).all(axis=(0, 2))
            new = run.step(starts + j, past, inputs)
            bad |= np.isinf(new).any(axis=1)
            past = [new, *past[:-1]]
    found = np.where(bad[:, None], np.inf, past[0])
    out[starts + horizon] = np.where(known[:, None], found, np.nan)
    return out


def simulate(run: Run) -> Array:
    """Return the free response (n, 8); a run that diverges is infinite to the end of its
    segment.
    """
    return _alone(run, lambda k, y: run.u[k])


def closed_loop(run: Run, inputs: Sequence[str], record: FlightRecord, controller: Any) -> Array:
    """The response (n, 8) where the controller answers the model instead of the vehicle."""
    given = (
        getattr(record.meta.get("plan"), "controller", None) if controller is None else controller
    )
    flown = getattr(given, "scheduled_controller", given)
    if not (hasattr(flown, "step") and (hasattr(flown, "reset") or hasattr(flown, "init"))):
        raise InputError(
            "closed_loop: name the controller of the flight, with reset() and step(measured,"
            " reference, p), or with init() and step(state, measured, reference, p); the record's"
            f" plan has {given!r:.80}"
        )
    names = [str(s) for s in record.signals]
    held = [s for s in record.signals if s.endswith("_reference")]
    bare = [name.removesuffix("_command") for name in inputs]
    if not held or not set(bare) <= set(CONTROLS):
        raise InputError(
            "closed_loop needs the trim that was followed (u_reference .. d_ped_reference, as fly()"
            f" records it) and inputs among {', '.join(CONTROLS)}, as such or as .._command"
        )
    reference = record.columns(map(str, held))
    trim = tuple(Signal(s.removesuffix("_reference"), s.unit) for s in held)
    order = [CONTROLS.index(name) for name in bare]
    added = np.column_stack(
        [record[f"e_{c}"] if f"e_{c}" in names else np.zeros(len(record)) for c in CONTROLS]
    )
    airspeed = record["airspeed_command"]
    p = np.column_stack([airspeed, record.slope(airspeed)])

    answer = begun(flown)

    def inputs_at(k: int, y: Array) -> Array:
        measured = NamedVector(MEASURED, np.append(y, np.linalg.norm(y[:3])))
        conditions = NamedVector(trim, reference[k])
        command = answer(measured, conditions, NamedVector(COMMANDED, p[k]))
        return (np.asarray(command, float) + added[k])[order]

    return _alone(run, inputs_at)


def _alone(run: Run, inputs_at: Callable[[int, Array], Array]) -> Array:
    out = np.full_like(run.y, np.nan)
    with np.errstate(all="ignore"):
        for part in run.segments:
            first = part.start + run.memory
            if part.stop <= first:
                continue
            past = [run.y[first - 1 - i] for i in range(run.memory)]
            inputs = [inputs_at(first - 1 - i, past[i]) for i in reversed(range(run.memory))][::-1]
            for k in range(first, part.stop):
                y = run.step(k, past, inputs)
                if np.isinf(y).any():
                    out[k : part.stop] = np.inf
                    break
                out[k] = y
                past = [y, *past[:-1]]
                inputs = [inputs_at(k, y), *inputs[:-1]]
    return out
