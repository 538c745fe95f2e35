"""How far noise leaves a model open, as a distance that feedback feels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification import uncertainty
from identification.model import LPVARXModel
from symheli.errors import InputError
from symheli.lpv.tools import LinearModels, nu_gaps
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import Signal

DRAWS = 20
"""Models drawn from the covariance; the furthest of so many is about the 95 % quantile."""

OPEN = 0.15
"""nu-gap beyond which two models suit the same controllers no more, as a rule."""

POINTS = (0.1, 0.5, 0.9)
"""Shares of the range of the scheduling at which models are held."""


class OpenGap(NamedTuple):
    """The nu-gap within which 95 % of the models lie that the log allows, and the scheduling it is
    largest at; signals in their standard deviations.
    """

    gap: float
    p: float

    def __str__(self) -> str:
        return (
            f"noise leaves the model open to a nu-gap of {self.gap:.2g} at p = {self.p:.3g}:"
            " frozen models of the same log may differ by as much; record longer before closing a"
            " loop with it"
        )


def _sizes(signals: Sequence[Signal], record: FlightRecord) -> Array:
    """The standard deviations of signals, by which gaps are taken."""
    return np.array([float(np.nanstd(record[str(s)])) or 1.0 for s in signals])


def open_gap(model: LPVARXModel, record: FlightRecord) -> OpenGap | None:
    """How far a least-squares model of one scheduling parameter is open; None where no gap can be
    taken.
    """
    low, high = model.structure.basis.ranges[0]
    drawn = uncertainty(model, record).draws(DRAWS)
    inputs, outputs, found = _sizes(model.inputs, record), _sizes(model.outputs, record), []
    for p in {low + share * (high - low) for share in POINTS[: model.structure.basis.size * 2]}:
        try:
            others = LinearModels.of([one.at(p) for one in drawn])
            gaps = nu_gaps(model.at(p), others, input_scale=inputs, output_scale=outputs)
            found.append(OpenGap(float(gaps.max()), p))
        except InputError:
            return None
    return max(found)
