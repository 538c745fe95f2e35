"""Units of signals that kinematics ties in pairs: a rate to its angle, airspeed to position or to
body velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.records.flight_record import FlightRecord
from symheli.records.kinematics import ANGLES, RATES, UNIT, VELOCITIES
from symheli.values.arrays import Array

PAIRS = (*zip(RATES[:2], ANGLES[:2], strict=True),)
"""Rates and the angles whose slopes they are while bank is small."""

POSITIONS = ("x_n", "x_e", "x_d")
"""Position, m."""

STRETCH = 0.5
"""s over which increments are compared: noise of the slope averages out, bank stays."""

AGREES = 0.7
"""Least correlation of signals that are tied."""

FEWEST = 10
"""Least number of stretches that decide."""

UNSURE = {"airspeed": 1.5, "p": 5.0, "q": 5.0}
"""Factor by which the ratio of one unit may miss 1: wind, bank and the noise of small motions make
no more, and no other unit of angles is that near.
"""


@dataclass(frozen=True)
class Tie:
    """How many times larger `signal` reads than `other` says it is, both in SI as declared."""

    signal: str
    other: str
    ratio: float

    @property
    def of_one_unit(self) -> bool:
        """Whether the ratio can be that of the units as declared."""
        return 1 / UNSURE[self.signal] < self.ratio < UNSURE[self.signal]


def tied_units(record: FlightRecord) -> tuple[Tie, ...]:
    """The pairs that a record shows, with the ratio of their sizes; pairs that do not move together
    are left out.
    """
    units = {**UNIT, "airspeed": "m/s", **dict.fromkeys(POSITIONS, "m")}
    there = {str(s) for s in record.signals if s.unit == units.get(str(s))}
    found = [_rate(record, *pair) for pair in PAIRS if there.issuperset(pair)]
    if "airspeed" in there:
        if there.issuperset(POSITIONS[:2]):
            found.append(_over_ground(record, [x for x in POSITIONS if x in there]))
        if there.issuperset(VELOCITIES[:1]):
            found.append(_in_body(record, [v for v in VELOCITIES if v in there]))
    return tuple(tie for tie in found if tie is not None)


def _stretches(record: FlightRecord, *signals: Array) -> Array:
    """Indices (k, length) of unbroken stretches in which all signals are known."""
    step = float(np.median(np.diff(record.time)))
    length = max(round(STRETCH / step), 2) + 1
    rows = [
        start + np.arange(length)
        for part in record.segments()
        for start in range(part.start, part.stop - length + 1, length - 1)
    ]
    index = np.array(rows, int).reshape(-1, length)
    known = np.asarray(np.isfinite(np.column_stack(signals)).all(axis=1))
    return index[known[index].all(axis=1)]


def _rate(record: FlightRecord, rate: str, angle: str) -> Tie | None:
    """Turned by the rate over turned by the angle."""
    w, a = record[rate], record[angle]
    index = _stretches(record, w, a)
    time = record.time[index]
    turned = np.sum(0.5 * (w[index][:, 1:] + w[index][:, :-1]) * np.diff(time), axis=1)
    moved = a[index[:, -1]] - a[index[:, 0]]
    return _tie(rate, angle, turned, moved)


def _over_ground(record: FlightRecord, positions: list[str]) -> Tie | None:
    """Airspeed over that of the path in a steady wind w: V^2 = s^2 (|g|^2 - 2 g'w + |w|^2)."""
    index = _stretches(record, record["airspeed"], record.columns(positions))
    if len(index) < FEWEST:
        return None
    ends = [index[:, -1], index[:, 0]]
    took = record.time[ends[0]] - record.time[ends[1]]
    x = record.columns(positions)
    ground = (x[ends[0]] - x[ends[1]]) / took[:, None]
    square = np.sum(ground**2, axis=1)
    speed = record["airspeed"][index].mean(axis=1)
    columns = np.column_stack([square, ground[:, :2], np.ones(len(square))])
    fit = np.linalg.lstsq(columns, speed**2, rcond=None)[0]
    if not fit[0] > 0 or np.corrcoef(columns @ fit, speed**2)[0, 1] < AGREES:
        return None
    return Tie("airspeed", positions[0], float(np.sqrt(fit[0])))


def _in_body(record: FlightRecord, velocities: list[str]) -> Tie | None:
    """Airspeed over the length of the body velocities."""
    speed, length = record["airspeed"], np.linalg.norm(record.columns(velocities), axis=1)
    index = _stretches(record, speed, length)
    if not len(index):
        return None
    one, two = (signal[index].mean(axis=1) for signal in (speed, length))
    return _tie("airspeed", velocities[0], one - one.mean(), two - two.mean())  # wind: an offset


def _tie(signal: str, other: str, one: Array, two: Array) -> Tie | None:
    if len(one) < FEWEST or not (one.any() and two.any()):
        return None
    sizes = one @ one, two @ two
    if abs(one @ two) < AGREES * np.sqrt(sizes[0] * sizes[1]):
        return None
    return Tie(signal, other, float(np.sqrt(sizes[0] / sizes[1])))
