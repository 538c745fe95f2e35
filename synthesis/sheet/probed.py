"""The linear model of a controller of which only the commands are known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.controllers import PureController, StatefulController, begun
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, signals

PULSE = 1e-3
"""Size of the pulses, in the unit of each measurement: within the limits of a controller."""

SAMPLES = 60
"""Rows of the Hankel matrix: twice as many responses are asked for, and as many again to judge."""

RANK = 1e-9
"""Singular values below this fraction of the largest are rounding."""

TOLERANCE = 1e-6
"""Largest error of a predicted response, of the largest one."""


def is_asked(given: object) -> bool:
    """Whether this is a controller that is asked for its commands sample by sample."""
    return isinstance(given, StatefulController | PureController)


def probed(
    controller: Any,
    measurements: Sequence[Signal],
    controls: Sequence[Signal],
    p: Signal,
    at: float,
) -> LinearModel:
    """Return u = K (measured - reference) of a controller with `dt`, `reset` or `init`, and `step`,
    around rest with its scheduling parameter held: the realization of its responses to a pulse of
    each measurement, by Ho and Kalman.

    Raises `InputError` where the responses are not proportional to the pulse, or not those of a
    linear model of at most `SAMPLES` states an output.
    """
    count = 3 * SAMPLES
    h = _responses(controller, measurements, controls, p, at, PULSE, count)
    half = _responses(controller, measurements, controls, p, at, 0.5 * PULSE, count)
    size = np.abs(h).max(initial=0.0)
    if size == 0:
        return LinearModel.gain(np.zeros(h.shape[1:]), measurements, controls)
    if not np.abs(h - half).max() <= TOLERANCE * size:
        raise InputError(
            "the controller is not linear around rest: its response to a pulse of half the size is"
            " not half as large (a limit, a dead band?); give its linear model"
        )
    rows = np.arange(SAMPLES)
    hankel = h[1 + rows[:, None] + rows[None, :]]  # (SAMPLES, SAMPLES, nu, ny)
    shifted = h[2 + rows[:, None] + rows[None, :]]
    nu, ny = h.shape[1:]
    flat = [m.transpose(0, 2, 1, 3).reshape(SAMPLES * nu, SAMPLES * ny) for m in (hankel, shifted)]
    U, s, Vt = np.linalg.svd(flat[0], full_matrices=False)
    order = int(np.sum(s > RANK * max(s[0], size)))
    root = np.sqrt(s[:order])
    left, right = U[:, :order] / root, Vt[:order].T / root
    found = LinearModel(
        left.T @ flat[1] @ right,
        root[:, None] * Vt[:order, :ny],
        U[:nu, :order] * root,
        h[0],
        signals([f"k{i}" for i in range(order)]),
        tuple(measurements),
        tuple(controls),
        float(controller.dt),
    )
    x, missed = found.B, 0.0
    for k in range(1, count):
        missed = max(missed, float(np.abs(found.C @ x - h[k]).max(initial=0.0)))
        x = found.A @ x
    if not missed <= TOLERANCE * size:
        raise InputError(
            f"the controller is no linear model of a few states: its responses are missed by"
            f" {missed / size:.1e} of the largest; give its linear model"
        )
    return found


def _responses(
    controller: Any,
    measurements: Sequence[Signal],
    controls: Sequence[Signal],
    p: Signal,
    at: float,
    size: float,
    count: int,
) -> Array:
    """Return commands per unit of the pulse (count, controls, measurements)."""
    names = signals((*measurements, *(u for u in controls if u not in measurements)))
    rest = NamedVector(names, np.zeros(len(names)))
    scheduled = NamedVector(signals((p, Signal("acceleration", "m/s^2"))), np.array([at, 0.0]))

    def commands(j: int | None) -> Array:
        answer, out = begun(controller), np.empty((count, len(controls)))
        for k in range(count):
            y = np.zeros(len(measurements))
            if j is not None and k == 0:
                y[j] = size
            seen = NamedVector(signals((*measurements, p)), np.append(y, at))
            out[k] = np.asarray(answer(seen, rest, scheduled), dtype=float)
        return out

    zero = commands(None)
    return np.stack([(commands(j) - zero) / size for j in range(len(measurements))], axis=2)
