"""Criteria on the stability and control derivatives that matter to a loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.judge.at_point import AtPoint, text
from identification.judge.criteria_in_feedback import SHARE_OF_MARGIN
from identification.judge.criterion import GUIDELINE, NO_COVARIANCE, Criterion, judged
from identification.judge.derivatives import Certainty, Derivatives
from symheli.lpv import nu_gaps

BOUND, INSENSITIVITY, CORRELATION = 0.2, 0.1, 0.9


def certainty(at: Sequence[AtPoint]) -> tuple[Criterion, ...]:
    """Three rows over the derivatives that matter to the loop."""
    none = NO_COVARIANCE if at[0].covariance is None else "none matters to this loop"
    value = float("nan") if at[0].covariance is None else 0.0
    worst = {
        "Cramer-Rao bound": (value, BOUND, none),
        "insensitivity": (value, INSENSITIVITY, none),
        "correlation": (value, CORRELATION, none),
    }
    for a in at:
        if a.covariance is None:
            continue
        all_ = Derivatives.of(a.plant, a.plant.model.theta, a.p)
        moved = nu_gaps(
            a.estimate,
            a.plant.of_each(a.plant.model.theta + all_.without, a.p),  # type: ignore[arg-type]
            **a.sizes,
        )
        matter = np.flatnonzero(moved > SHARE_OF_MARGIN * a.margin)
        if not len(matter):
            continue
        names = [all_.names[i] for i in matter]
        sure = Certainty.of(all_.value[matter], all_.covariance(a.covariance)[matter][:, matter])
        pair = np.unravel_index(np.argmax(np.abs(sure.correlation)), sure.correlation.shape)
        for name, values, which in (
            ("Cramer-Rao bound", sure.bound, names[int(np.argmax(sure.bound))]),
            ("insensitivity", sure.insensitivity, names[int(np.argmax(sure.insensitivity))]),
            ("correlation", np.abs(sure.correlation), f"{names[pair[0]]}, {names[pair[1]]}"),
        ):
            before, threshold, _ = worst[name]
            if values.max() >= before:
                worst[name] = float(values.max()), threshold, f"{which}, p = {text(a.p)}"
    return tuple(
        Criterion(
            name=name,
            value=value,
            threshold=threshold,
            verdict=judged(value, threshold, "not known"),
            source=GUIDELINE,
            where=where,
        )
        for name, (value, threshold, where) in worst.items()
    )
