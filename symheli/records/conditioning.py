"""Preprocessing of a record before a fit; the original record is not changed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from symheli.errors import InputError
from symheli.records.flight_record import GAP, FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import finite
from symheli.values.sample_period import JITTER


def with_norm(record: FlightRecord, parts: Sequence[str], name: str = "speed") -> FlightRecord:
    """A record with one more signal: the Euclidean length of others.

    Parameters
    ----------
    record : FlightRecord
        Any.
    parts : sequence of str
        Signals of one unit.
    name : str
        Of the new one.

    Returns
    -------
    FlightRecord
        A new one.

    Raises
    ------
    InputError
        Parts of different units.

    Examples
    --------
    >>> round(float(records.with_norm(record, ["u", "v"])["speed"][0]), 3)
    5.0
    """
    found = {record.signals[record.signals.index(part)].unit for part in parts}  # type: ignore[arg-type]
    if len(found) > 1:
        raise InputError(
            f"a length needs one unit, {', '.join(parts)} come in {', '.join(sorted(found))}"
        )
    return record.with_signals(
        {name: found.pop()}, **{name: np.linalg.norm(record.columns(parts), axis=1)}
    )


def smooth(record: FlightRecord, name: str, seconds: float) -> FlightRecord:
    """Return one signal after a causal first-order low-pass, restarted in each segment and after
    missing samples.

    Parameters
    ----------
    record : FlightRecord
        Any.
    name : str
        Of the signal.
    seconds : float
        Time constant.

    Returns
    -------
    FlightRecord
        A new one.

    Raises
    ------
    InputError
        A time constant that is not positive.

    Examples
    --------
    >>> bool(np.std(records.smooth(record, "v", 0.5)["v"][250:]) < 0.1)
    True
    """
    if not 0 < seconds < math.inf:
        raise InputError(f"seconds: expected a positive time constant, got {seconds}")
    signal, out = record[name], np.full(len(record), np.nan)
    for part in record.segments():
        state = math.nan
        for k in range(part.start, part.stop):
            step = record.time[k] - record.time[k - 1] if k > part.start else 0.0
            state = (
                signal[k]
                if not math.isfinite(state)
                else state + (1 - math.exp(-step / seconds)) * (signal[k] - state)
            )
            out[k] = state
    unit = record.signals[record.signals.index(name)].unit  # type: ignore[arg-type]
    return record.with_signals({name: unit}, **{name: out})


def low_pass(
    record: FlightRecord,
    cutoff: float,
    order: int = 4,
    *,
    zero_phase: bool = False,
    leave: Sequence[str] = (),
) -> FlightRecord:
    """Signals through one Butterworth filter.

    One filter for all keeps a linear relation between inputs and outputs; coefficients that move
    with p keep it while p moves slowly against the filter, so the scheduling signal is best left as
    it is. Causal, settled at the first sample of each stretch. Each unbroken stretch between
    missing samples is filtered by itself, signal by signal.

    Parameters
    ----------
    record : FlightRecord
        Uniformly sampled.
    cutoff : float
        The corner, Hz.
    order : int
        Of the filter.
    zero_phase : bool
        Run it forwards and backwards (not for real time).
    leave : sequence of str
        Signals that stay as they are.

    Returns
    -------
    FlightRecord
        A new one.

    Raises
    ------
    InputError
        A corner beyond half the sampling frequency.

    References
    ----------
    Oppenheim and Schafer (2010), Discrete-Time Signal Processing, ch. 7.

    Examples
    --------
    >>> smooth = records.low_pass(record, 2.0, leave=["u"])
    >>> bool(np.abs(smooth["v"][100:] - 4.0).max() < 0.01)
    True
    """
    rate = 1 / record.dt
    if not 0 < cutoff < rate / 2 or order < 1:
        raise InputError(
            f"cutoff: expected a frequency between 0 and {rate / 2:.4g} Hz (half the sampling"
            f" frequency), got {cutoff}"
        )
    if not isinstance(order, int | np.integer):
        raise InputError(f"order: expected a whole number >= 1, got {order!r}")
    for name in leave:
        record.columns([name])  # raises UnknownNameError with the nearest names
    sos, out = np.asarray(butter(order, cutoff, fs=rate, output="sos")), record.values.copy()
    for i, signal in enumerate(record.signals):
        if signal in leave:
            continue
        for part in record.segments():
            for stretch in unbroken(record.values[part, i]):
                rows = slice(part.start + stretch.start, part.start + stretch.stop)
                out[rows, i] = _filtered(sos, record.values[rows, i], zero_phase)
    return replace(record, values=out)


def unbroken(column: Array) -> list[slice]:
    """Stretches of finite values."""
    known = np.concatenate([[False], np.isfinite(column), [False]])
    edges = np.flatnonzero(np.diff(known.astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _filtered(sos: Array, x: Array, zero_phase: bool) -> Array:
    if zero_phase:
        return sosfiltfilt(sos, x, padlen=min(6 * len(sos), len(x) - 1)) if len(x) > 1 else x
    return sosfilt(sos, x, zi=x[0] * sosfilt_zi(sos))[0]


def decimate(record: FlightRecord, n: int) -> FlightRecord:
    """Return means of several samples in a row, all signals alike: a linear relation between them
    is kept, noise and dt change.

    Within a mean the output has heard the input already: y(k) depends on u(k), whatever it did
    before. Identify with delay 0; the record remembers (`resampled`), and `fit` warns. No other
    filter avoids it: between slow samples what is band-limited is known from both sides. No mean
    reaches across a gap; what a part leaves over at its ends is left out.

    Parameters
    ----------
    record : FlightRecord
        Any.
    n : int
        Samples a mean.

    Returns
    -------
    FlightRecord
        A new one.

    Raises
    ------
    InputError
        Another n, or one that leaves no two means in a row.

    Examples
    --------
    >>> slow = records.decimate(record, 5)
    >>> len(slow), round(slow.dt, 3), slow.resampled
    (100, 0.1, 'means of 5 samples')
    """
    if not isinstance(n, int | np.integer) or n < 1:
        raise InputError(f"expected a whole number of samples >= 1 to take together, got {n!r}")
    if n == 1:
        return record
    step = float(np.median(np.diff(record.time)))
    clear, middle = GAP * (1 + JITTER) * n * step, 0.5 * (n - 1) * step
    times: list[Array] = []
    values: list[Array] = []
    for part in record.segments():
        time = record.time[part]
        # means beside a gap stand so far apart that they show it
        first = int(np.searchsorted(time + middle, times[-1][-1] + clear)) if times else 0
        rows = (len(time) - first) // n
        if rows > 0:
            keep = slice(part.start + first, part.start + first + rows * n)
            times.append(record.time[keep].reshape(rows, n).mean(axis=1))
            values.append(record.values[keep].reshape(rows, n, -1).mean(axis=1))
    made = np.concatenate(times) if times else np.zeros(0)
    if len(made) < 2 or np.median(np.diff(made)) > GAP * n * step:
        longest = max(part.stop - part.start for part in record.segments())
        raise InputError(
            f"taking {n} samples together leaves fewer than two in a row: {len(made)} in all, the"
            f" longest part without a gap has {longest} of the {len(record)} samples; take fewer"
            " together (--decimate)"
        )
    return replace(
        record,
        time=made,
        values=np.concatenate(values),
        resampled=f"means of {n} samples",
    )


def _without_gaps(steps: Array) -> Array:
    """The steps, those over a gap as long as the median."""
    usual = np.median(steps)
    return np.where(steps > GAP * usual, usual, steps)


def split(record: FlightRecord, fraction: float) -> tuple[FlightRecord, FlightRecord | None]:
    """The first part of a record to fit, and the rest held out.

    Parameters
    ----------
    record : FlightRecord
        Any.
    fraction : float
        Of its time, without gaps.

    Returns
    -------
    FlightRecord
        To fit.
    FlightRecord or None
        To score on; None where nothing rests.

    Raises
    ------
    InputError
        A part of fewer than two samples.

    Examples
    --------
    >>> training, test = records.split(record, 0.7)
    >>> len(training), len(test)
    (350, 150)
    """
    if not 0 < finite(fraction, "fraction") <= 1:
        raise InputError(f"fraction: expected a part of the time in (0, 1], got {fraction!r:.80}")
    steps = np.diff(record.time)
    flown = record.time[0] + np.concatenate([[0.0], np.cumsum(_without_gaps(steps))])
    elapsed = flown if np.any(steps > GAP * np.median(steps)) else record.time
    early = elapsed <= elapsed[0] + fraction * (elapsed[-1] - elapsed[0])
    if fraction >= 1 or early.all():
        return record, None
    if early.sum() < 2 or (~early).sum() < 2:
        raise InputError(
            f"a fraction of {fraction:g} leaves {int(early.sum())} samples to fit and"
            f" {int((~early).sum())} to judge; record longer"
        )
    return record.rows(early), record.rows(~early)
