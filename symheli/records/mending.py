"""Records as loggers leave them: stamps that scatter, sensors that repeat themselves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from symheli.errors import DataWarning
from symheli.records.flight_record import FlightRecord
from symheli.records.kinematics import comparable
from symheli.values.arrays import Array
from symheli.values.runs import runs

SCATTER = 0.1
"""Part of a step by which stamps may be off an even clock and stand for it: the samples are even
then, not their stamps.
"""

FROZEN, FEWEST = 0.3, 5
"""Least time (s), and least number of values left out, that make a sensor a frozen one."""

AT_REST, TELLING = 0.9, 3.0
"""Share of its usual new values that every other sensor lacks in a spell: the vehicle is at rest;
number of them that it should have had there, or it does not tell.
"""

COARSE = 0.5
"""Share of repeats from which a sensor counts as coarsely rounded: repeats say nothing then."""

QUANTA = 2.5
"""Step after a spell, in the smallest steps of the sensor, up to which rounding made the spell."""

BY_CHANCE = 0.01
"""Number of spells in a record that rounding alone may make."""

REGULAR = 0.8
"""Share of the values that come equally many samples apart, of a sensor that is slower."""

SLOWEST = 50
"""Most samples from one value of a slower sensor to the next."""

BRIDGED = 0.1
"""Longest time between two values of a sensor that is bridged, s."""

NAMED = 4
"""Number of spells that a warning names."""


def even(record: FlightRecord) -> tuple[FlightRecord, float, float]:
    """Return the record with its stamps on the even clock nearest to them, its step, and by how
    much a stamp was off at most, s.

    One clock for all parts where the gaps between them are whole steps, else a phase for each part.
    """
    parts = [np.arange(part.start, part.stop) for part in record.segments()]
    counts = np.concatenate([part - part.mean() for part in parts])
    centres = np.concatenate([np.full(len(part), record.time[part].mean()) for part in parts])
    period = float(counts @ (record.time - centres) / (counts @ counts))
    grid = centres + period * counts
    steps = np.round(np.diff(record.time) / period)
    tick = np.concatenate([[0.0], np.cumsum(steps)])
    slope, first = np.polyfit(tick, record.time, 1)
    common = first + slope * tick
    if np.abs(record.time - common).max() <= SCATTER * period and steps.min() >= 1:
        grid, period = common, float(slope)
    return replace(record, time=grid), period, float(np.abs(record.time - grid).max())


@dataclass(frozen=True, eq=False)
class Repeats:
    """Samples of one sensor that are no new values: `mask` (n,), `same` (n,) as the one before,
    those that are `new` (n,), the steps from one value to the next (1: every sample is new), and
    the frozen `spells`, first and last rows.
    """

    mask: Array
    same: Array
    new: Array
    every: int
    spells: tuple[tuple[int, int], ...]

    def still(self, inside: slice) -> bool | None:
        """Whether it stands still there, as it does not elsewhere; None where it does not tell."""
        known = self.new | self.same
        usual = np.sum(self.new) / max(np.sum(known), 1)
        expected, fresh = usual * np.sum(known[inside]), np.sum(self.new[inside])
        if fresh > (1.0 - AT_REST) * expected:
            return False
        return True if expected >= TELLING else None


def repeats(record: FlightRecord, name: str) -> Repeats:
    """Return what a sensor repeats or leaves out; none of a coarsely rounded one, which repeats
    itself by chance, and none of one that never moves.
    """
    x = record[name]
    never = np.zeros(len(x), bool)
    values = x[np.isfinite(x)]
    if not len(values) or np.ptp(values) == 0.0:
        return Repeats(never, never, never, 1, ())
    starts = np.zeros(len(x), bool)
    starts[[part.start for part in record.segments()]] = True
    same = np.concatenate([[False], x[1:] == x[:-1]]) & ~starts
    new = np.isfinite(x) & ~same
    rows = np.flatnonzero(new)
    inside = np.searchsorted(np.flatnonzero(starts), rows, side="right")
    apart = np.diff(rows)[np.diff(inside) == 0]
    nothing = Repeats(never, same, new, 1, ())
    if not len(apart):
        return nothing
    every = int(np.median(apart))
    if not (every <= SLOWEST and np.mean(apart == every) >= REGULAR):
        every = 1
    least = max(FEWEST * every, int(FROZEN / np.median(np.diff(record.time))))
    alike = runs(same)
    chance = sum(b - a for a, b in alike if b - a < least) / len(x) if every == 1 else 0.0
    if chance > COARSE:
        return nothing
    if chance > 0:
        least = max(least, int(np.ceil(np.log(BY_CHANCE / len(x)) / np.log(chance))))
    steps = np.abs(np.diff(x))
    steps = steps[steps > 0]
    spells = tuple((a - 1, b - 1) for a, b in alike if b - a >= least and not _rounded(x, b, steps))
    mask = same.copy() if every > 1 else never.copy()
    for first, last in spells:
        mask[first + 1 : last + 1] = True
    return Repeats(mask, same, new, every, spells)


def _rounded(x: Array, end: int, steps: Array) -> bool:
    """Whether a spell that ends before row `end` is a slow signal between two steps of rounding: it
    goes on by one of the smallest of all `steps`, or these are alike and nothing follows.
    """
    if not len(steps):
        return False
    after = abs(x[end] - x[end - 1]) if end < len(x) else np.nan
    if not np.isfinite(after):
        after = float(np.median(steps))
    return bool(after <= QUANTA * steps.min())


def all_repeats(record: FlightRecord, sensors: Iterable[str]) -> dict[str, Repeats]:
    """Return what each sensor repeats. Where all that move at other times stand still together the
    vehicle is at rest, and none is frozen.
    """
    found = {name: repeats(record, name) for name in dict.fromkeys(sensors)}
    out = {}
    for name, one in found.items():
        others = [other for n, other in found.items() if n != name]
        mask, spells = one.mask.copy(), []
        for first, last in one.spells:
            inside = slice(first + 1, last + 1)
            said = {other.still(inside) for other in others}
            if True in said and False not in said:
                mask[inside] &= one.every > 1
            else:
                spells.append((first, last))
        out[name] = replace(one, mask=mask, spells=tuple(spells))
    return out


def mended(record: FlightRecord, sensors: Sequence[str] | None = None) -> FlightRecord:
    """Return the record on an even clock, what sensors only repeat marked as missing.

    Stamps that scatter by less than a tenth of a step are put on the even clock that they mean, the
    same before and behind a gap. A sensor that repeats its value for .3 s while others move is
    frozen; one that never moves is left as it is. One that has a new value every second or third
    sample is slower than the record. Their repeats become NaN, and each is said.

    Parameters
    ----------
    record : FlightRecord
        As it was logged.
    sensors : sequence of str, optional
        Signals that are measured, with noise: a command may stand still. Default: what the
        kinematics tie (u v w p q r phi theta psi ax ay az), of those that are there.

    Returns
    -------
    FlightRecord
        A new one.

    Raises
    ------
    UnknownNameError
        A sensor that the record lacks.

    Warns
    -----
    DataWarning
        Which sensor, when, and for how long; steps that stay uneven.

    Examples
    --------
    >>> import warnings
    >>> rng = np.random.default_rng(0)
    >>> q = rng.normal(size=500)
    >>> q[100:150] = q[100]
    >>> logged = records.FlightRecord.from_arrays(
    ...     0.02 * np.arange(500) + 1e-4 * rng.normal(size=500), {"q": "rad/s"}, q=q)
    >>> with warnings.catch_warnings(record=True) as told:
    ...     warnings.simplefilter("always")
    ...     found = logged.mended()
    >>> print(told[-1].message)
    q stands still from 2.00 to 2.98 s (0.98 s): frozen, these samples count as missing
    >>> round(found.dt, 5), int(np.isnan(found["q"]).sum())
    (0.02, 49)
    """
    sensors = comparable(record.signals) if sensors is None else sensors
    steps = np.diff(record.time)
    out, period, off = even(record)
    if off > SCATTER * period:
        out = record
        _say(
            f"the stamps are up to {off:.2g} s off an even clock of {period:.4g} s: resample,"
            f" record.resample({float(f'{period:.3g}')})"
        )
    elif np.ptp(steps) > 1e-6 * period and off > 1e-3 * period:
        _say(f"the stamps scatter by up to {off:.2g} s around steps of {period:.5g} s, now even")
    found = all_repeats(record, sensors)
    for sentence in (*frozen(out, found), *slower(out, found)):
        _say(sentence)
    return without(out, {name: one.mask for name, one in found.items()})


def without(record: FlightRecord, masks: Mapping[str, Array]) -> FlightRecord:
    """Return the record with samples of signals missing, where a mask (n,) says so."""
    units = {str(s): s.unit for s in record.signals if str(s) in masks}
    hidden = {name: np.where(mask, np.nan, record[name]) for name, mask in masks.items()}
    return record.with_signals(units, **hidden).select(list(map(str, record.signals)))


def frozen(record: FlightRecord, found: Mapping[str, Repeats]) -> list[str]:
    """Return a sentence on the frozen spells of all sensors; none where there are none."""
    spells = [(name, *spell) for name, one in found.items() for spell in one.spells]
    time = record.time
    words = [
        f"{name} stands still from {time[a]:.2f} to {time[b]:.2f} s ({time[b] - time[a]:.2g} s)"
        for name, a, b in sorted(spells, key=lambda spell: spell[1])
    ]
    more = f"; and {len(words) - NAMED} more spells" if len(words) > NAMED else ""
    named = "; ".join(words[:NAMED])
    return [f"{named}{more}: frozen, these samples count as missing"] if words else []


def slower(record: FlightRecord, found: Mapping[str, Repeats]) -> list[str]:
    """Return a sentence on the sensors of each slower rate."""
    rates: dict[int, list[str]] = {}
    for name, one in found.items():
        if one.every > 1:
            rates.setdefault(one.every, []).append(name)
    step = float(np.median(np.diff(record.time)))
    return [
        f"{', '.join(names)}: a new value every {every} samples ({every * step:.3g} s) only; those"
        " between count as missing"
        for every, names in rates.items()
    ]


def bridged(
    record: FlightRecord,
    names: Sequence[str],
    longest: float = BRIDGED,
    beside: Callable[[FlightRecord], FlightRecord] | None = None,
) -> FlightRecord:
    """Return the record with holes of these signals up to `longest` (s) filled by cubic splines;
    `meta["filled"]` has the mask (n,) of what was filled, by name.

    With `beside`, which gives a flight at the same instants without noise, rows that are missing
    altogether are there again, and every signal is that flight's plus what is interpolated of the
    difference between neighbours.
    """
    if beside is not None:
        record = _with_lost_rows(record, longest)
        names = [str(s) for s in record.signals]
    lacking = [name for name in names if not np.isfinite(record[name]).all()]
    if not lacking:
        return record
    other = record if beside is None else beside(record)
    filled: dict[str, Array] = {}
    columns: dict[str, Array] = {}
    for name in lacking:
        known = other[name] if beside is not None and name in other.signals else 0.0
        made, mask = _filled(record, record[name] - known, longest, smooth=beside is None)
        if mask.any():
            filled[name], columns[name] = mask, np.where(mask, made + known, record[name])
    if not filled:
        return record
    units = {str(s): s.unit for s in record.signals if str(s) in columns}
    out = record.with_signals(units, **columns)
    return replace(out, meta={**out.meta, "filled": filled})


def _with_lost_rows(record: FlightRecord, longest: float) -> FlightRecord:
    """The record with a row of NaN for each that is missing in gaps up to `longest` (s) of whole
    steps.
    """
    dt, steps = record.dt, np.diff(record.time)
    lost = np.round(steps / dt).astype(int) - 1
    short = steps <= longest + 0.5 * dt
    there = (lost > 0) & short & (np.abs(steps - (lost + 1) * dt) <= SCATTER * dt)
    if not there.any():
        return record
    counts = np.where(there, lost, 0)
    place = np.concatenate([[0], np.cumsum(counts + 1)])
    time = np.empty(int(place[-1]) + 1)
    values = np.full((len(time), record.values.shape[1]), np.nan)
    time[place], values[place] = record.time, record.values
    for k in np.flatnonzero(there):
        time[place[k] + 1 : place[k + 1]] = record.time[k] + dt * np.arange(1, lost[k] + 1)
    return replace(record, time=time, values=values)


def _filled(record: FlightRecord, x: Array, longest: float, *, smooth: bool) -> tuple[Array, Array]:
    """x (n,) with holes filled by splines or lines, and the mask of what was."""
    made, mask, known = x.copy(), np.zeros(len(x), bool), np.isfinite(x)
    time, slack = record.time, 0.5 * record.dt
    for part in record.segments():
        rows = part.start + np.flatnonzero(known[part])
        if len(rows) < 4:
            continue
        for k in np.flatnonzero(np.diff(rows) > 1):
            a, b = rows[k], rows[k + 1]
            mask[a + 1 : b] = time[b] - time[a] <= longest + slack
        here = part.start + np.flatnonzero(mask[part])
        made[here] = (
            CubicSpline(time[rows], x[rows])(time[here])
            if smooth
            else np.interp(time[here], time[rows], x[rows])
        )
    return made, mask


def _say(text: str) -> None:
    warnings.warn(text, DataWarning, stacklevel=4)
