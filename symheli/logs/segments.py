"""Segments of a log: on the ground and in the air, one mode after the other, the logs of one file,
between holes, and after a crash.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.logs.column import RESTART, Column, forward, without_holes
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

AFTER_A_CRASH = 20.0
"""s: a vehicle that turned too fast and stops, or whose log ends, within this time has crashed."""

IMPACT = 30.0
"""rad/s: what only an impact does to a vehicle made for aerobatics; its gyros end at 35."""

ACROBATS = ("gyroADC", "gyroRAW")
"""Columns of firmware for aerobatics, where 12 rad/s is flown."""

CRASH_CHECK = 12.0
"""Subsystem of ArduPilot's ERR messages."""


@dataclass(frozen=True)
class Segment:
    """Segment from `start` to `stop`, s on the log's clock: its state by the log, such as "armed,
    mode 4", whether it is flight, and why it `ends`.
    """

    start: float
    stop: float
    what: str
    flown: bool
    ends: str

    @property
    def duration(self) -> float:
        """s"""
        return self.stop - self.start


class _State(NamedTuple):
    """State from each instant (n,) on, NaN where it is unknown."""

    time: Array
    values: Array

    def at(self, t: float) -> float:
        k = int(np.searchsorted(self.time, t, side="right")) - 1
        return float(self.values[k]) if k >= 0 else float("nan")


def segments(columns: Mapping[str, Column], guesses: Mapping[str, Guess]) -> tuple[Segment, ...]:
    """Return the segments by the autopilot's messages, where the log has them, and by the rates: a
    vehicle whose rates do not move is at rest, one that turns faster than any helicopter and stops
    within `AFTER_A_CRASH` has crashed. Between segments lie holes, in which no rate (of a log
    without rates, no column) has a sample. Empty where no column has a clock.
    """
    rates = [
        Column(c.time, to_si(guesses[s].unit)[0] * c.values)
        for s in RATES
        if s in guesses and (c := columns[guesses[s].column]).time is not None
    ]
    acrobat = any(guesses[s].column.startswith(ACROBATS) for s in RATES if s in guesses)
    times = [
        t
        for c in (rates or columns.values())
        if c.time is not None and len(t := c.time[forward(c.time)]) > 1
    ]
    if not times:
        return ()
    first, last = min(t[0] for t in times), max(t[-1] for t in times)
    covered = without_holes(times, first, last)
    marked, rest = _from_messages(columns), _at_rest(rates)
    starts = {*covered[:, 0].tolist(), *(marked["log"].time.tolist() if "log" in marked else ())}
    stops = {*covered[:, 1].tolist(), *starts, *rest.time[rest.values == 1.0].tolist()}
    wild = _faster(rates, IMPACT if acrobat else MAX_RATE)
    states = {"rest": rest, "crashed": _crashed(wild, sorted(starts), sorted(stops)), **marked}
    edges = {*covered.ravel().tolist()}
    for state in states.values():
        edges |= {float(t) for t in state.time if first < t < last}
    found: list[Segment] = []
    before: Mapping[str, float] = {}
    for start, stop in pairwise(sorted(edges)):
        middle = 0.5 * (start + stop)
        if not np.any((covered[:, 0] < middle) & (middle < covered[:, 1])):
            hole = covered[np.searchsorted(covered[:, 0], middle), 0] - found[-1].stop
            found[-1] = replace(found[-1], ends=f"a hole of {hole:.3g} s")
            continue
        now = {name: state.at(middle) for name, state in states.items()}
        what, flown = _words(now)
        if found and found[-1].what == what and found[-1].stop == start:
            start = found.pop().start
        elif found and found[-1].stop == start:
            found[-1] = replace(found[-1], ends=_change(before, now))
        found.append(Segment(start, stop, what, flown, "the log ends"))
        before = now
    restarted = max((_behind_restarts(c.time) for c in rates if c.time is not None), default=0)
    if found and restarted:
        ends = f"the clock begins again, {restarted} samples are left out"
        found[-1] = replace(found[-1], ends=ends)
    return tuple(found)


def serving(found: Sequence[Segment]) -> tuple[Segment, ...]:
    """Segments to identify from: flight, and no shorter than `MIN_DURATION` with the flight that
    they adjoin.
    """
    out: list[Segment] = []
    for flight in flights(found):
        if flight[-1].stop - flight[0].start >= MIN_DURATION:
            out += flight
    return tuple(out)


def flights(found: Sequence[Segment]) -> list[list[Segment]]:
    """Segments of flight, those that adjoin each other together."""
    out: list[list[Segment]] = []
    for one in found:
        if one.flown and out and out[-1][-1].stop == one.start:
            out[-1].append(one)
        elif one.flown:
            out.append([one])
    return out


def _behind_restarts(time: Array) -> int:
    """Number of samples behind a clock that began again (`RESTART` earlier), which are unused."""
    return int(np.sum(np.maximum.accumulate(time) - time > RESTART))


def _change(before: Mapping[str, float], now: Mapping[str, float]) -> str:
    """Why a segment ends: what differs in the next."""
    ends = {
        "crashed": ("crash", "crash"),
        "log": ("log {0:g} of the file begins",) * 2,
        "armed": ("disarmed", "armed"),
        "airborne": ("landed", "took off"),
        "mode": ("mode {0:g} begins",) * 2,
        "rest": ("moves", "comes to rest"),
    }
    for name, words in ends.items():
        value = now.get(name, np.nan)
        if name == "crashed" and value == 0.0:
            continue  # what follows is another flight
        if np.isfinite(value) and value != before.get(name, np.nan):
            return words[bool(value)].format(value)
    return "what follows is unknown"


def _words(now: Mapping[str, float]) -> tuple[str, bool]:
    """Return the state at an instant in words, and whether it is flight."""
    parts, flown = [], True
    for name, other in (("armed", "disarmed"), ("airborne", "on the ground")):
        value = now.get(name, np.nan)
        if np.isfinite(value):
            parts.append(name if value else other)
            flown &= bool(value)
    if np.isfinite(now.get("log", np.nan)):
        parts.append(f"log {now['log']:g}")
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
    take("mode", "flightModeFlags", lambda v: v)
    if "log" in columns and np.ptp(columns["log"].values) > 0:
        take("log", "log", lambda v: v)
    take("crashed", "ERR.Subsys", lambda v: 1.0 * (np.maximum.accumulate(v == CRASH_CHECK)))
    events = columns.get("EV.Id")
    if events is not None and events.time is not None:
        for name, (begin, end) in EVENTS.items():
            marks = np.isin(events.values, [*begin, *end])
            if name not in out and marks.any():
                on = np.isin(events.values[marks], list(begin)).astype(float)
                before = [1.0 - on[0]]  # an event ends what was not so before
                time = np.concatenate([[-np.inf], events.time[marks]])
                out[name] = _State(time, np.concatenate([before, on]))
    return out


def _at_rest(rates: Sequence[Column]) -> _State:
    """Whether none of the angular rates moves; unknown without rates."""
    moving = []
    for time, values in map(_known, rates):
        if len(time) < 3:
            continue
        starts = np.arange(time[0], time[-1], WINDOW)
        part = np.searchsorted(starts, time, side="right") - 1
        count = np.bincount(part, minlength=len(starts))
        mean = np.bincount(part, values, len(starts)) / np.maximum(count, 1)
        spread = np.bincount(part, (values - mean[part]) ** 2, len(starts)) / np.maximum(count, 1)
        moving.append(_State(starts, 1.0 * (np.sqrt(spread) > REST_RATE)))
    if not moving:
        return _State(np.zeros(0), np.zeros(0))
    starts = moving[0].time
    still = [all(m.at(t + 0.5 * WINDOW) == 0.0 for m in moving) for t in starts]
    return _changes(starts, np.array(still, float))


def _faster(rates: Sequence[Column], limit: float) -> Array:
    """Instants (n,) at which a rate exceeds `limit`, rad/s."""
    known = [time[np.abs(values) > limit] for time, values in map(_known, rates)]
    return np.unique(np.concatenate([*known, np.zeros(0)]))


def _crashed(wild: Array, starts: Sequence[float], stops: Sequence[float]) -> _State:
    """From the first wild instant no more than `AFTER_A_CRASH` before a stop, to the next start."""
    after = np.asarray(stops)[np.minimum(np.searchsorted(stops, wild), len(stops) - 1)]
    crashes = wild[after - wild <= AFTER_A_CRASH]
    time = np.concatenate([starts, crashes])
    values = np.concatenate([np.zeros(len(starts)), np.ones(len(crashes))])
    order = np.argsort(time, kind="stable")
    return _changes(time[order], values[order])


def _known(rate: Column) -> tuple[Array, Array]:
    """Instants and values of the samples that count."""
    assert rate.time is not None  # noqa: S101  those without were left out
    keep = forward(rate.time) & np.isfinite(rate.values)
    return rate.time[keep], rate.values[keep]


def _changes(time: Array, values: Array) -> _State:
    """Return the state at its changes only."""
    keep = np.concatenate([[True], np.diff(values) != 0])
    return _State(time[keep], values[keep])
