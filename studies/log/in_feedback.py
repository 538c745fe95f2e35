"""Whether an identified model is fit for a loop, as text and as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from identification import fit_for_control
from identification.judge.against_constant import AgainstConstant
from identification.judge.fit_for_control import FitForControl
from symheli.errors import InputError
from symheli.values.signal import indices

Gains = Sequence[tuple[tuple[str, str], float]]


def judged(result: AgainstConstant, gains: Gains) -> FitForControl:
    """The scheduled model in the loop of these gains, on the part it was fitted to; a standard
    deviation of a signal there counts as 1.

    Raises `UnknownNameError` for a signal the model does not have, `InputError` for one that does
    not move.
    """
    model, record = result.scheduled, result.training
    signals = [*model.outputs, *model.inputs]
    named = {name for pair, _ in gains for name in pair}
    indices(named, signals, "signal of --loop")
    scales = {str(s): float(np.nanstd(record[s])) for s in signals if s in named}
    for name, size in scales.items():
        if not size > 0:
            raise InputError(f"--loop: {name} does not move in the part that is fitted")
    return fit_for_control(model, record, dict(gains), scales=scales)


def text(found: FitForControl) -> str:
    """Return the table, under a heading."""
    return f"fit for control in this loop:\n{found}"


def data(found: FitForControl) -> Mapping[str, Any]:
    """Verdict, rows, margins by value of the scheduling."""
    return {
        "verdict": found.verdict,
        "criteria": [asdict(row) for row in found.criteria],
        "scheduling": list(found.points),
        "margin": found.margin,
    }
