"""Data compatibility of a record: do its attitude, rates, velocities and specific forces agree with
the kinematics, which are known?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi

import numpy as np
from scipy.stats import t as student

from symheli.errors import InputError
from symheli.records.flight_path import WINDOW
from symheli.records.flight_record import FlightRecord
from symheli.records.kinematics import ANGLES, FORCES, RATES, VELOCITIES, comparable
from symheli.records.sensor_faults import (
    DEGREES,
    FORCE_BIAS,
    MIN_EXPLAINED,
    MIN_WINDOWS,
    RATE_BIAS,
    SCALE,
    TILT,
    Faults,
    ScalarEstimate,
    sensor_faults,
)
from symheli.records.shifted import shifted
from symheli.values.kinematics import GRAVITY
from symheli.values.signal import Signal

TAIL_PROBABILITY = 5e-4
"""Probability in each tail that a number of a compatible record appears significant."""

MIN_MOTION = {"rad": pi / 180, "m/s": 0.1}
"""Root mean square in a window above which a signal counts as moving, by its unit."""

DRIVER: dict[str, str] = dict(zip((*ANGLES, *VELOCITIES), (*RATES, *FORCES), strict=True))
DRIVEN = {driver: driven for driven, driver in DRIVER.items()}
UNITS = {"rad/s": ("deg/s", DEGREES), "rad": ("deg", DEGREES), "m/s^2": ("g", 1 / GRAVITY)}
"""Other units in which signals are logged, by unit, with the conversion factor."""

SCALE_RATIO = 1.05
"""Factor within which a scale is attributed to another unit."""


@dataclass(frozen=True)
class SensorCheck:
    """Sensor error of one signal, from the other signals: measured(t) = scale * true(t - delay) +
    bias.

    Parameters
    ----------
    signal : Signal
        Which one, with its unit.
    bias, scale, delay : ScalarEstimate or None
        In its unit, 1, and s; None where it is what the others are held against, or cannot show.
    verdict : str
        "consistent", "inconsistent: ..." with what to do, or "not known: ..." with the reason.
    """

    signal: Signal
    bias: ScalarEstimate | None
    scale: ScalarEstimate | None
    delay: ScalarEstimate | None
    verdict: str


@dataclass(frozen=True)
class KinematicCheck:
    """The data compatibility of a record, one row a sensor.

    Parameters
    ----------
    rows : tuple of SensorCheck
        Rates, angles, and velocities and specific forces as far as recorded.
    windows : int
        Number of stretches of flight compared, each with a free initial state.
    limit : float
        Number of standard errors above which a difference counts as significant.

    Examples
    --------
    >>> time = 0.02 * np.arange(2000)
    >>> pitching = records.FlightRecord.from_arrays(
    ...     time, {"p": "rad/s", "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad"},
    ...     p=0 * time, q=np.cos(2 * time) + 0.05, r=0 * time, phi=0 * time,
    ...     theta=0.5 * np.sin(2 * time),
    ... )
    >>> found = pitching.check_kinematics()
    >>> print(round(found["q"].bias.value, 4), found["theta"].verdict)
    0.05 consistent
    """

    rows: tuple[SensorCheck, ...]
    windows: int
    limit: float

    def __getitem__(self, name: str) -> SensorCheck:
        """The row of a signal; raises `InputError` for one that was not checked."""
        for row in self.rows:
            if row.signal == name:
                return row
        known = ", ".join(row.signal for row in self.rows)
        raise InputError(f"{name!r} was not checked; there are {known}")

    @property
    def inconsistent(self) -> tuple[SensorCheck, ...]:
        """The rows that contradict the others."""
        return tuple(row for row in self.rows if row.verdict.startswith("inconsistent"))

    def require(self) -> None:
        """Raises `InputError`, with what to do, where a sensor contradicts the others."""
        if self.inconsistent:
            raise InputError(
                "the record contradicts the kinematics: "
                + "; ".join(
                    f"{row.signal}: {row.verdict.removeprefix('inconsistent: ')}"
                    for row in self.inconsistent
                )
            )

    def corrected(self, record: FlightRecord) -> FlightRecord:
        """The record with the sensors that contradict the others as these say they are: biases
        taken off, scales divided by and delays taken back, those beyond `limit` standard errors.

        Wrong columns, and signs of which one of two is turned, are not told apart: read the
        verdicts.
        """
        columns, late = {}, {}
        for row in self.inconsistent:
            bias, scale, delay = (
                estimate.value
                if estimate and abs(estimate.value - none) > self.limit * estimate.standard_error
                else none
                for estimate, none in ((row.bias, 0.0), (row.scale, 1.0), (row.delay, 0.0))
            )
            columns[str(row.signal)] = (record[str(row.signal)] - bias) / scale
            late[str(row.signal)] = delay
        units = {str(row.signal): row.signal.unit for row in self.inconsistent}
        return shifted(record.with_signals(units, **columns), late) if columns else record

    def __str__(self) -> str:
        heads = ("sensor", "bias", "scale", "delay, s")
        cells = [
            (f"{row.signal} ({row.signal.unit})", *map(_cell, (row.bias, row.scale, row.delay)))
            for row in self.rows
        ]
        widths = [max(map(len, column)) for column in zip(heads, *cells, strict=True)]
        verdicts = ("verdict", *(row.verdict for row in self.rows))
        lines = [
            "  " + "  ".join([*map(str.ljust, line, widths), verdict])
            for line, verdict in zip((heads, *cells), verdicts, strict=True)
        ]
        return "\n".join([f"kinematics: {self.windows} windows with free starts", *lines])


def check_kinematics(record: FlightRecord) -> KinematicCheck:
    """Whether attitude, rates, velocities and specific forces of a record agree.

    phi' = p + tan theta (q sin phi + r cos phi), theta' = q cos phi - r sin phi,
    psi' = (q sin phi + r cos phi) / cos theta are exact, whatever the air does. Rates are
    integrated over windows from free starts and compared with the angles; what they are multiplied
    by, biased by and late by is estimated with standard errors. Small angles show only the ratio of
    a rate to its angle: scales are those of the rates where the angles are right (but for degrees
    and signs), delays those of the angles where the rates come at once. A bias of phi or theta
    shows where the flight turns. A number that the record does not tell within what an
    identification bears is not known, and taken as 1 or 0 for the others.

    Velocities are compared only where specific forces ax ay az (m/s^2, at the centre of gravity;
    -g in az at rest) are recorded: without them what a velocity does cannot be told from
    aerodynamics. A bias of ax or ay is also what a tilted attitude looks like.

    Parameters
    ----------
    record : FlightRecord
        With p q r (rad/s), phi theta (rad), and psi, u v w, ax ay az where there are.

    Returns
    -------
    KinematicCheck
        One row a sensor; its text is a table.

    Raises
    ------
    InputError
        A signal is missing, or fewer than 20 samples stand between gaps.

    References
    ----------
    Klein and Morelli (2006), Aircraft System Identification, ch. 10 (data compatibility).

    Examples
    --------
    >>> time = 0.02 * np.arange(2000)
    >>> units = {"p": "rad/s", "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad"}
    >>> nothing = dict.fromkeys(("p", "r", "phi"), 0.0 * time)
    >>> degrees = records.FlightRecord.from_arrays(
    ...     time, units, q=np.degrees(np.cos(2 * time)), theta=0.5 * np.sin(2 * time), **nothing
    ... )
    >>> print(records.check_kinematics(degrees)["q"].verdict)
    inconsistent: its scale is 57.3: it is in deg/s, declare that unit
    """
    found = sensor_faults(record)
    limit = float(student.isf(TAIL_PROBABILITY, max(found.windows - 1, 1)))
    step = float(np.median(np.diff(record.time)))
    rows = tuple(
        _row(record.signals[record.signals.index(name)], found, limit, step, record.signals)
        for name in comparable(record.signals)
    )
    return KinematicCheck(rows, found.windows, limit)


def _row(
    signal: Signal, found: Faults, limit: float, step: float, names: Sequence[str]
) -> SensorCheck:
    bias, scale, delay = (part.get(signal) for part in (found.bias, found.scale, found.delay))
    wrong = [
        *_follows(signal, found),
        *_scale(signal, found, limit),
        *_bias(signal, found, limit),
        *_delay(signal, delay, limit, step),
    ]
    known = [e for e in (bias, scale, delay) if e is not None and 0 < e.standard_error < inf]
    if wrong:
        verdict = "inconsistent: " + "; ".join(wrong)
    elif known:
        verdict = "consistent"
    else:
        verdict = f"not known: {_reason(signal, found, names)}"
    return SensorCheck(signal, bias, scale, delay, verdict)


def _follows(signal: Signal, found: Faults) -> list[str]:
    explained, driver = found.explained.get(signal, 1.0), DRIVER.get(signal, "")
    if explained >= MIN_EXPLAINED or found.moves[signal] < MIN_MOTION[signal.unit]:
        return []
    return [
        f"what is known of it, {driver} first, explains {max(100 * explained, 0):.0f} % of how it"
        f" moves: check which columns {signal} and {driver} are, and their clocks"
    ]


def _scale(signal: Signal, found: Faults, limit: float) -> list[str]:
    scale = found.scale.get(signal)
    if scale is None or abs(scale.value - 1) <= max(SCALE, limit * scale.standard_error):
        return []
    other, many = UNITS[signal.unit]
    size, advice = abs(scale.value), []
    if scale.value < 0:
        advice.append(f"its sign is turned, or that of {_partner(signal, found)}: change it")
    if 1 / SCALE_RATIO < size / many < SCALE_RATIO:
        twice = f" (or {DRIVER[signal]} was converted twice)" if signal in DRIVER else ""
        advice.append(f"its scale is {size:.4g}: it is in {other}, declare that unit{twice}")
    elif abs(size - 1) > max(SCALE, limit * scale.standard_error):
        advice.append(
            f"it reads {size:.4g} of what {_partner(signal, found)} moves by: divide by it"
        )
    return advice


def _partner(signal: str, found: Faults) -> str:
    """Return the signal with which this one is compared first."""
    other = DRIVER.get(signal) or DRIVEN[signal]
    return other if other in (*found.scale, *found.delay) else "attitude"


def _bias(signal: Signal, found: Faults, limit: float) -> list[str]:
    bias = found.bias.get(signal)
    if bias is None:
        return []
    bears = {"rad/s": RATE_BIAS, "rad": TILT, "m/s^2": FORCE_BIAS}[signal.unit]
    bears *= abs(found.scale[signal].value)
    if abs(bias.value) <= max(bears, limit * bias.standard_error):
        return []
    return [f"it reads {bias.value:.3g} {signal.unit} too much: subtract it"]


def _delay(signal: Signal, delay: ScalarEstimate | None, limit: float, step: float) -> list[str]:
    if delay is None or abs(delay.value) <= max(step, limit * delay.standard_error):
        return []
    drivers = "the rates" if signal in ANGLES else "the specific forces"
    late = "after" if delay.value > 0 else "before"
    return [
        f"it comes {abs(delay.value):.3f} s ({abs(delay.value) / step:.1f} samples) {late}"
        f" {drivers}: shift one of them"
    ]


def _reason(signal: Signal, found: Faults, names: Sequence[str]) -> str:
    if found.windows < MIN_WINDOWS:
        return f"{found.windows} windows of {WINDOW:g} s without a gap, {MIN_WINDOWS} are needed"
    if signal in (*VELOCITIES, *FORCES) and signal not in (*found.delay, *found.scale):
        lacking = [name for name in (*VELOCITIES, *FORCES) if name not in names]
        return f"velocities are held against specific forces; there is no {', '.join(lacking)}"
    return "the flight does not show it"


def _cell(estimate: ScalarEstimate | None) -> str:
    if estimate is None:
        return "-"
    if estimate.standard_error == inf:
        return "not known"
    if estimate.standard_error == 0:
        return f"{estimate.value:.4g}"
    return f"{estimate.value:.4g} +- {estimate.standard_error:.1g}"
