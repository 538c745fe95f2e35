"""Segments of a log: on the ground and in the air, one mode after the other, and after a crash."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.logs.column import Column, forward
from symheli.logs.meaning import MAX_RATE, RATES, Guess
from symheli.values.arrays import Array
from symheli.values.units import to_si

REST_RATE = 0.005
"""Variation of the angular rates over `WINDOW`, rad/s, below which the vehicle is at rest."""

WINDOW = 2.0
"""Length of the window, s."""

MIN_DURATION = 5.0
"""Least duration, s, of a flight that is worth identifying from."""

EVENTS = {"armed": ({10.0, 15.0}, {11.0}), "airborne": ({28.0}, {18.0})}
"""Numbers of ArduPilot's EV messages that begin and end a state."""

CRASH_CHECK = 12.0
"""Subsystem of ArduPilot's ERR messages."""


@dataclass(frozen=True)
class Stretch:
    """Segment from `start` to `stop`, s on the log's clock: its state by the log, such as "armed,
    mode 4", and whether it is flight.
    """

    start: float
    stop: float
    what: str
    flown: bool


class _State(NamedTuple):
    """State from each instant (n,) on, NaN where it is unknown."""

    time: Array
    values: Array

    def at(self, t: float) -> float:
        k = int(np.searchsorted(self.time, t, side="right")) - 1
        return float(self.values[k]) if k >= 0 else float("nan")


def stretches(columns: Mapping[str, Column], guesses: Mapping[str, Guess]) -> tuple[Stretch, ...]:
    """Told by the autopilot's messages where the log has them, and by the rates: a vehicle whose
    rates do not move is at rest, one that turns faster than any helicopter has crashed. Empty where
    no column has a clock.
    """
    rates = [
        Column(c.time, to_si(guesses[s].unit)[0] * c.values)
        for s in RATES
        if s in guesses and (c := columns[guesses[s].column]).time is not None
    ]
    spans = [
        (t[0], t[-1])
        for c in (rates or columns.values())
        if c.time is not None and len(t := c.time[forward(c.time)]) > 1
    ]
    if not spans:
        return ()
    first, last = min(a for a, _ in spans), max(b for _, b in spans)
    states = {**_from_messages(columns), **_from_rates(rates)}
    edges = {first, last}
    for state in states.values():
        edges |= {float(t) for t in state.time if first < t < last}
    found: list[Stretch] = []
    ordered = sorted(edges)
    for start, stop in pairwise(ordered):
        what, flown = _words({name: s.at(0.5 * (start + stop)) for name, s in states.items()})
        if found and found[-1].what == what:
            start = found.pop().start
        found.append(Stretch(start, stop, what, flown))
    return tuple(found)


def longest(found: Sequence[Stretch]) -> Stretch | None:
    """The longest stretch of flight; None where the whole log is one, or none is long enough."""
    flown = [s for s in found if s.flown and s.stop - s.start >= MIN_DURATION]
    return max(flown, key=lambda s: s.stop - s.start) if flown and len(found) > 1 else None


def _words(now: Mapping[str, float]) -> tuple[str, bool]:
    """Return the state at an instant in words, and whether it is flight."""
    parts, flown = [], True
    for name, other in (("armed", "disarmed"), ("airborne", "on the ground")):
        value = now.get(name, np.nan)
        if np.isfinite(value):
            parts.append(name if value else other)
            flown &= bool(value)
    if np.isfinite(now.get("mode", np.nan)):
        parts.append(f"mode {now['mode']:g}")
    if now.get("rest") == 1.0:
        parts, flown = [*parts, "at rest"], False
    if now.get("crashed") == 1.0:
        parts, flown = [*parts, "crashed"], False
    return ", ".join(parts) or "in motion", flown


def _from_messages(columns: Mapping[str, Column]) -> dict[str, _State]:
    """Return states from the messages of ArduPilot, of PX4, or of PX4's older logs."""
    out: dict[str, _State] = {}

    def take(name: str, column: str, of: Callable[[Array], Array]) -> None:
        held = columns.get(column)
        if name not in out and held is not None and held.time is not None and len(held.values):
            out[name] = _changes(held.time, of(held.values))

    take("armed", "vehicle_status.arming_state", lambda v: 1.0 * (v == 2))
    take("airborne", "vehicle_land_detected.landed", lambda v: 1.0 * (v == 0))
    take("mode", "vehicle_status.nav_state", lambda v: v)
    take("armed", "STAT.ArmState", lambda v: 1.0 * (v == 2))
    take("mode", "STAT.MainState", lambda v: v)
    take("armed", "ARM.ArmState", lambda v: 1.0 * (v != 0))
    take("airborne", "STAT.isFlying", lambda v: 1.0 * (v != 0))
    take("mode", "MODE.ModeNum", lambda v: v)
    take("crashed", "ERR.Subsys", lambda v: 1.0 * (np.maximum.accumulate(v == CRASH_CHECK)))
    events = columns.get("EV.Id")
    if events is not None and events.time is not None:
        for name, (begin, end) in EVENTS.items():
            told = np.isin(events.values, [*begin, *end])
            if name not in out and told.any():
                on = np.isin(events.values[told], list(begin)).astype(float)
                before = [1.0 - on[0]]  # an event ends what was not so before
                time = np.concatenate([[-np.inf], events.time[told]])
                out[name] = _State(time, np.concatenate([before, on]))
    return out


def _from_rates(rates: Sequence[Column]) -> dict[str, _State]:
    """Return the states "at rest" and "crashed" from the angular rates."""
    out: dict[str, _State] = {}
    if not rates:
        return out
    moving, wild = [], np.inf
    for rate in rates:
        assert rate.time is not None  # noqa: S101  those without were left out
        keep = forward(rate.time) & np.isfinite(rate.values)
        time, values = rate.time[keep], rate.values[keep]
        if len(time) < 3:
            continue
        fast = np.abs(values) > MAX_RATE
        wild = min(wild, float(time[fast.argmax()]) if fast.any() else np.inf)
        starts = np.arange(time[0], time[-1], WINDOW)
        part = np.searchsorted(starts, time, side="right") - 1
        count = np.bincount(part, minlength=len(starts))
        mean = np.bincount(part, values, len(starts)) / np.maximum(count, 1)
        spread = np.bincount(part, (values - mean[part]) ** 2, len(starts)) / np.maximum(count, 1)
        moving.append(_State(starts, 1.0 * (np.sqrt(spread) > REST_RATE)))
    if moving:
        starts = moving[0].time
        still = [all(m.at(t + 0.5 * WINDOW) == 0.0 for m in moving) for t in starts]
        out["rest"] = _changes(starts, np.array(still, float))
    if np.isfinite(wild):
        out["crashed"] = _State(np.array([wild]), np.ones(1))
    return out


def _changes(time: Array, values: Array) -> _State:
    """Return the state at its changes only."""
    keep = np.concatenate([[True], np.diff(values) != 0])
    return _State(time[keep], values[keep])
