"""Has the vehicle changed? Cumulative sums of how far 1 s predictions miss."""

from __future__ import annotations

import math

import numpy as np

from identification.model import KinematicModel
from studies.live.identifier import STATES
from symheli import FlightRecord
from symheli.values.arrays import Array

HORIZON = 1.0
"""Seconds ahead, and between two looks, so that each looks at other samples."""
ALLOWED = 1.5
"""Miss, in standard deviations over the flight that was identified, that is taken for chance."""
THRESHOLD = 10.0
"""Sum of what is beyond, in standard deviations, at which the vehicle has changed."""


def errors(model: KinematicModel, record: FlightRecord) -> Array:
    """Return the errors (n, 8) of 1 s predictions; NaN where one is not known."""
    found = record.columns(STATES) - model.predict(record, round(HORIZON / record.dt))
    return np.where(np.isfinite(found), found, math.nan)


def deviations(model: KinematicModel, record: FlightRecord) -> Array:
    """Return the standard deviations (8,) of these errors over a record."""
    return np.sqrt(np.nanmean(errors(model, record) ** 2, axis=0))


class VehicleAlarm:
    """Two-sided cumulative sums (Page, 1954) of the 1 s prediction errors of every state, each in
    its standard deviation.

    Parameters
    ----------
    model : KinematicModel
        What the vehicle was.
    deviations : array (8,)
        Standard deviations over the record that it was identified from.
    threshold : float
        Sum at which the vehicle has changed: in still air 10; gusts reach that without a change.
    """

    def __init__(self, model: KinematicModel, deviations: Array, threshold: float = THRESHOLD):
        self.model, self.deviations, self.threshold = model, deviations, threshold
        self.sums = np.zeros((2, len(STATES)))
        self.unknown = 0
        """Looks since the last one at a second that was known."""

    def take(self, record: FlightRecord, seconds: int = 1) -> str | None:
        """Look at the last seconds of a flight, one after the other; return what has changed, None
        while nothing has. Unknown samples say nothing.
        """
        every = round(HORIZON / record.dt)
        looks = errors(self.model, record)[::-every][:seconds][::-1]
        return next(filter(None, map(self.look, looks)), None)

    def look(self, error: Array) -> str | None:
        """Take in the errors (8,) of a prediction; return what has changed, None while nothing
        has.
        """
        self.unknown += 1
        if np.isfinite(error).all():
            self.unknown = 0
            z = error / self.deviations
            self.sums = np.maximum(self.sums + np.array([z, -z]) - ALLOWED, 0.0)
        if self.sums.max() < self.threshold:
            return None
        side, state = divmod(int(self.sums.argmax()), len(STATES))
        more = "more" if side == 0 else "less"
        return f"{STATES[state]} is {more} than the model predicts, second after second"
