"""Weights in series with a model: one number, one system for every channel, or one for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model, is_control_system
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal

Weight = Any
"""A number, a system of one input and output (on every channel alike), a square system, or a
sequence of numbers and systems, one for each channel.
"""


def as_weight(
    weight: Weight, name: str, channels: Sequence[Signal], dt: float | None
) -> LinearModel:
    """Return the weight on these channels, from and to signals of their names.

    `InputError` where it has another number of channels or another sample period.
    """
    n = len(channels)
    if not n:
        raise InputError("G: expected a model from controls to measurements, one of each at least")
    if isinstance(weight, LinearModel) or is_control_system(weight):
        system = as_model(weight)
        parts = [system] * n if len(system.inputs) == len(system.outputs) == 1 else [system]
    elif np.ndim(weight) == 0:
        parts = [_gain(weight, name)] * n
    else:
        parts = [as_model(w) if not np.isscalar(w) else _gain(w, name) for w in weight]
    wide = sum(len(p.inputs) for p in parts)
    tall = sum(len(p.outputs) for p in parts)
    if wide != n or tall != n:
        raise InputError(
            f"{name}: expected a weight of {n} channels ({', '.join(channels)}), got one from"
            f" {wide} to {tall}"
        )
    for part in parts:
        if len(part.A) and not same_period(part.dt, dt):
            raise InputError(
                f"{name}: its sample period is {part.dt} s, the model's {dt} s; make them equal"
            )
    A, B, C, D = (np.asarray(block_diag(*(getattr(p, M) for p in parts))) for M in "ABCD")
    order = len(A)
    return LinearModel(
        A,
        B.reshape(order, n),
        C.reshape(n, order),
        D,
        tuple(Signal(f"{name}_{i + 1}") for i in range(order)),
        tuple(channels),
        tuple(channels),
        dt,
    )


def _gain(value: Any, name: str) -> LinearModel:
    try:
        return LinearModel.gain([[float(value)]], ["in"], ["out"])
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected a number or a system, got {value!r:.80}") from error
