"""Criteria that compare frozen plants in feedback: loops, nu-gaps, static gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.judge.at_point import AtPoint, text, worst
from identification.judge.criterion import (
    HERE,
    NO_COVARIANCE,
    SET,
    VINNICOMBE,
    Criterion,
    Verdict,
    judged,
)
from symheli.lpv import LinearModel
from symheli.values.arrays import Array

SHARE_OF_MARGIN = 1 / 3
GAIN = 0.25


def stability(at: Sequence[AtPoint], true: Sequence[LinearModel | None]) -> Criterion:
    """The share of the draws whose loop is unstable; none may be, nor the estimate's own."""
    alone = [a.margin > 0 for a in at]
    lost, where = worst(np.array([a.lost for a in at]), at)
    verdict: Verdict = judged(lost, 0.0, "not known")
    if not all(alone):
        verdict, where = "not fit", f"p = {text(at[alone.index(False)].p)}: the estimate itself"
    known = [(a, t) for a, t in zip(at, true, strict=True) if t is not None]
    return Criterion(
        name="unstable loops",
        value=lost if all(alone) else 1.0,
        threshold=0.0,
        verdict=verdict,
        source=HERE,
        where=NO_COVARIANCE if np.isnan(lost) and all(alone) else where,
        truth=float(np.mean([not a.stable(t) for a, t in known])) if known else None,
    )


def feedback(
    at: Sequence[AtPoint], gap: Array, second_gap: Array, margin: Array, true_gap: Array | None
) -> Criterion:
    """The distance to the farthest draw or other estimate, as a share of the margin."""
    with np.errstate(divide="ignore"):
        value, where = worst(np.fmax(gap, second_gap) / margin, at)
        truth = None if true_gap is None else float((true_gap / margin).max())
        apart = np.any(second_gap / margin > SHARE_OF_MARGIN)
    verdict = judged(value, SHARE_OF_MARGIN, "not known")
    if np.isnan(gap).any():
        verdict, where = "not known", NO_COVARIANCE
    elif apart:
        where = f"{where}; another estimate is as far"
    return Criterion(
        name="nu-gap over margin",
        value=value,
        threshold=SHARE_OF_MARGIN,
        verdict=verdict,
        source=VINNICOMBE,
        where=where,
        truth=truth,
    )


def static_gain(
    at: Sequence[AtPoint], true: Sequence[LinearModel | None], in_loop: bool
) -> Criterion:
    """What 95 % of the draws stay within, of the plant alone or in the loop."""
    errors = [
        float("nan")
        if a.drawn is None
        else float(np.quantile(a.gain_errors(a.drawn, in_loop), SET))
        for a in at
    ]
    value, where = worst(np.array(errors), at)
    known = [a.gain_errors([t], in_loop)[0] for a, t in zip(at, true, strict=True) if t is not None]
    return Criterion(
        name="static gain in the loop" if in_loop else "static gain, open",
        value=value,
        threshold=GAIN,
        verdict=judged(value, GAIN, "not known"),
        source=HERE,
        where=NO_COVARIANCE if np.isnan(value) else where,
        truth=float(max(known)) if known else None,
        decides=in_loop,
    )
