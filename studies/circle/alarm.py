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


class VehicleAlarm:
    """Two-sided cumulative sums (Page, 1954) of the 1 s prediction errors of every state, each in
    its standard deviation over the record that the model was identified from.

    Parameters
    ----------
    model : KinematicModel
        What the vehicle was.
    record : FlightRecord
        What it was identified from.
    """

    def __init__(self, model: KinematicModel, record: FlightRecord):
        self.model, self._ahead = model, round(HORIZON / record.dt)
        errors = self._errors(record)
        self.deviations = np.sqrt(np.nanmean(errors**2, axis=0))
        self.sums = np.zeros((2, len(STATES)))

    def _errors(self, record: FlightRecord) -> Array:
        found = self.model.predict(record, self._ahead)
        errors = record.columns(STATES) - found
        return np.where(np.isfinite(errors), errors, math.nan)

    def take(self, record: FlightRecord) -> str | None:
        """Look at the last second of the last rows of a flight; return what has changed, None while
        nothing has. Unknown samples say nothing.
        """
        error = self._errors(record)[-1]
        if np.isfinite(error).all():
            z = error / self.deviations
            self.sums = np.maximum(self.sums + np.array([z, -z]) - ALLOWED, 0.0)
        if self.sums.max() < THRESHOLD:
            return None
        side, state = divmod(int(self.sums.argmax()), len(STATES))
        more = "more" if side == 0 else "less"
        return f"{STATES[state]} is {more} than the model predicts, second after second"
