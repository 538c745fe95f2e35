"""Regressors that are linearly dependent by structure: no record can distinguish them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.structure.lpvarx import LPVARX, EquationGroup
from identification.structure.regressors import regression
from symheli.records import FlightRecord
from symheli.values import signals

SAMPLES = 4
"""Number of random samples for each regressor."""

STRUCTURAL_ZERO = 1e-9
"""Singular values of random regressors below this fraction of the largest are structurally zero."""


def never_determined(arx: LPVARX, group: EquationGroup) -> str:
    """Return why no record determines the coefficients of a group, in a sentence; empty where a
    rich record does.
    """
    twice = [name for name in (*arx.outputs, *arx.inputs) if name in arx.parameters]
    lost = _repeated(arx, group) if twice else 0
    if not lost:
        return ""
    bare = replace(arx, offset=False) if arx.offset and (arx.output_lags or arx.inputs) else arx
    cure = (
        ""
        if any(_repeated(bare, g) for g in bare.groups)
        else f"set offset=False (the functions of {twice[0]} it adds are there), or "
    )
    return (
        f"{' and '.join(twice)} schedules the coefficients and is multiplied by them: {lost} of"
        f" {len(arx.regressors(group))} regressors repeat others by algebra, so that more"
        f" excitation cannot help; {cure}schedule on another signal, such as a command or a slow"
        " filter"
    )


def _repeated(arx: LPVARX, group: EquationGroup) -> int:
    """Return the number of regressors of a group that are combinations of others for all signals.

    Every signal is replaced by independent random numbers, one draw a name, so that a signal that
    is both output and scheduling parameter stays one: what depends on each other even so does it by
    algebra.
    """
    rng, regressors = np.random.default_rng(0), arx.regressors(group)
    n = SAMPLES * len(regressors) + arx.memory
    columns = {name: rng.standard_normal(n) for name in (*arx.outputs, *arx.inputs)}
    columns |= {
        p: rng.uniform(low, high, n)
        for p, (low, high) in zip(arx.parameters, arx.basis.ranges, strict=True)
    }
    record = FlightRecord(
        0.1 * np.arange(n), np.column_stack(list(columns.values())), signals(columns)
    )
    phi = regression(arx, record).phi[:, regressors]
    values = np.linalg.svd(phi / np.linalg.norm(phi, axis=0), compute_uv=False)
    return int(np.sum(values <= STRUCTURAL_ZERO * values[0]))
