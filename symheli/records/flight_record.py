"""Record of a flight: one time axis, named signals with units."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.blackbox import read_blackbox
from symheli.logs.csv import read_csv, with_units
from symheli.logs.dataflash import read_dataflash
from symheli.logs.files import seconds_in, units_of
from symheli.logs.mat import read_mat
from symheli.logs.signal_map import SignalMap
from symheli.logs.ulog import read_ulog
from symheli.logs.xplane import read_xplane
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.sample_period import JITTER, period_of, warn_of_odd_steps
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized
from symheli.values.units import to_si
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    import pandas
    import xarray

    from symheli.records.kinematic_check import KinematicCheck

CONDITIONS = ("wind", "mass", "governor", "servos")
"""Conditions that `meta["flown"]` of a record may state."""

GAP = 1.5
"""Two samples further apart than this many median steps have a gap between them."""


MAX_UPSAMPLING = 1e4
"""Largest number of samples `resample` may produce, relative to the record."""


@dataclass(frozen=True, eq=False)
class FlightRecord:
    """A flight record holds samples of signals over time, in SI units and radians.

    NaN marks a missing sample. A time step longer than 1.5 median steps is a gap: `segments()`
    splits there, and no regressor reaches across.

    Parameters
    ----------
    time : array (n,)
        Increasing, s.
    values : array (n, m)
        A column a signal.
    signals : tuple of Signal
        m names with their unit.
    note : str
        Where the record comes from.
    meta : mapping
        Anything worth keeping; "flown": what it was flown with, {"wind", "mass", "governor",
        "servos"} in words, which statements on a model identified from it repeat.
    resampled : str
        How its samples were made of others ("means of 4 samples"; empty where each is what was
        measured at its instant): then y(k) may depend on u(k).

    Raises
    ------
    InputError
        Fewer than two samples, time that does not increase, an infinite value.

    See Also
    --------
    symheli.fly : one closed-loop flight
    identification.fit : coefficients from records

    Examples
    --------
    >>> record = symheli.FlightRecord.from_arrays(
    ...     0.1 * np.arange(5), {"q": "deg/s", "n": "1"}, q=np.full(5, 90.0), n=np.zeros(5)
    ... )
    >>> round(float(record["q"][0]), 3), record.dt, len(record.between(0.1, 0.35))
    (1.571, 0.1, 3)
    """

    time: Array
    values: Array
    signals: tuple[Signal, ...]
    _: KW_ONLY
    note: str = ""
    meta: Mapping[str, Any] = field(default_factory=dict)
    resampled: str = ""

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", signals(self.signals))
        object.__setattr__(self, "time", frozen(self.time, "time", (None,)))
        object.__setattr__(
            self,
            "values",
            frozen(self.values, "values", (len(self.time), len(self.signals)), finite=False),
        )
        if len(self.time) < 2:
            raise InputError(f"a record needs at least two samples, got {len(self.time)}")
        backwards = np.flatnonzero(np.diff(self.time) <= 0)
        if len(backwards):
            k = int(backwards[0])
            raise InputError(
                f"time must increase: sample {k + 1} is at {self.time[k + 1]:.6g} s after"
                f" {self.time[k]:.6g} s; sort or drop repeats"
            )
        if np.any(np.isinf(self.values)):
            row, column = (int(i) for i in np.argwhere(np.isinf(self.values))[0])
            raise InputError(
                f"{self.signals[column]} is infinite at {self.time[row]:.6g} s; mark missing"
                " samples as NaN"
            )

    # --- reading ---------------------------------------------------------------------------------

    @classmethod
    def from_arrays(
        cls, time: object, units: Mapping[str, str], note: str = "", **columns: Any
    ) -> FlightRecord:
        """Return a record of one array a signal, all as long as `time` (s); `units` declares the
        unit of each signal.

        Warns (`DataWarning`), as all readers do, where samples lie further apart than 1 s or closer
        than 0.1 ms. Raises `InputError` for a signal without a unit, units without a signal, and
        samples that are not as many as there are instants.
        """
        if not columns and units:
            named = ", ".join(f"{name}={name}" for name in units)
            example = ", ".join(
                f"{n!r}: {u if isinstance(u, str) else '...'!r}" for n, u in units.items()
            )
            raise InputError(
                "no signals: the second argument is their units, the arrays are given by name:"
                f" from_arrays(t, {{{example}}}, {named})"
            )
        record = cls._in_si(time, units, note, columns)
        warn_of_odd_steps(record.time)
        return record

    @classmethod
    def _in_si(
        cls, time: object, units: Mapping[str, str], note: str, columns: Mapping[str, Any]
    ) -> FlightRecord:
        values, names = [], []
        length = np.asarray(time).size
        for name, column in columns.items():
            if name not in units:
                raise InputError(
                    f"declare the unit of {name!r}: units={{{name!r}: ...}} ('1' where it has none)"
                )
            factor, unit = to_si(units[name])
            values.append(factor * frozen(column, name, (length,), finite=False))
            names.append(Signal(name, unit))
        table = np.column_stack(values) if values else np.zeros((length, 0))
        return cls(time, table, tuple(names), note=note)  # type: ignore[arg-type]

    @classmethod
    def from_frame(
        cls,
        frame: pandas.DataFrame,
        time: str,
        units: Mapping[str, str],
        time_unit: str = "s",
        note: str = "",
    ) -> FlightRecord:
        """Return a record of a pandas DataFrame: `time` names the time column; the columns in
        `units` are taken and converted to SI.

        Raises `UnknownNameError` for a column that is not there, `InputError` for one of dates or
        words.
        """
        for name in (time, *units):
            if name not in frame.columns:
                raise UnknownNameError("column", name, [str(c) for c in frame.columns])
        factor = seconds_in(time_unit)
        if frame[time].dtype.kind in "mM":
            raise InputError(
                f"{time!r} holds dates; give numbers: (frame[{time!r}] -"
                f" frame[{time!r}].iloc[0]).dt.total_seconds()"
            )
        columns = {}
        for name in dict.fromkeys((time, *units)):
            try:
                columns[name] = frame[name].to_numpy(float)
            except (TypeError, ValueError) as error:
                raise InputError(f"column {name!r}: expected numbers ({error})") from error
        return cls.from_arrays(
            factor * columns[time], units, note, **{str(n): columns[n] for n in units}
        )

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        time: str | None = "t",
        units: Mapping[str, str] | None = None,
        dt: float | None = None,
        time_unit: str | None = None,
    ) -> FlightRecord:
        """Read a table with a header line: commas, semicolons, tabs or blanks between cells,
        decimal points or commas, # comments.

        `time` names the time column, in `time_unit` (default that of its header "t [ms]", or s). A
        file without one (`time=None`) needs the sample period `dt` (s). Without `units` all columns
        are taken whose unit stands in the header ("q [deg/s]"), as `to_csv` writes them.
        """
        return cls._from_table(*read_csv(path, time, units, dt, time_unit), path)

    @classmethod
    def from_xplane(cls, path: str | os.PathLike[str], dt: float | None = None) -> FlightRecord:
        """Read an X-Plane Data.txt: body velocities, rates and attitude in SI, sticks in -1..1; see
        `symheli.logs.xplane`.
        """
        return cls._from_table(*read_xplane(path, dt), path)

    @classmethod
    def from_ulog(
        cls, path: str | os.PathLike[str], topics: Mapping[str, tuple[str, str, str]], dt: float
    ) -> FlightRecord:
        """From a PX4 ULog: {signal: (topic, field, unit)}, resampled to `dt` (s) as
        `symheli.logs.column` says; "topic.1" is another instance of a topic, and topics with a
        quaternion have phi, theta and psi. Needs pyulog (extra "logs").
        """
        return replace(
            cls._from_table(*read_ulog(path, topics, dt), path),
            resampled=f"topics interpolated to {dt:g} s",
        )

    @classmethod
    def from_dataflash(
        cls,
        path: str | os.PathLike[str],
        fields: Mapping[str, str],
        dt: float,
        units: Mapping[str, str] | None = None,
    ) -> FlightRecord:
        """Read an ArduPilot log (.bin or .log): {signal: "message.field"}, such as "IMU.GyrY" or
        "IMU[1].GyrY", resampled to `dt` (s) as in `symheli.logs.column`.

        Units are those that the log declares; `units` gives those it does not. Needs pymavlink
        (extra "logs").
        """
        return replace(
            cls._from_table(*read_dataflash(path, fields, dt, units), path),
            resampled=f"messages interpolated to {dt:g} s",
        )

    @classmethod
    def from_blackbox(
        cls,
        path: str | os.PathLike[str],
        fields: Mapping[str, str],
        dt: float,
        units: Mapping[str, str] | None = None,
    ) -> FlightRecord:
        """Read a Blackbox log of Betaflight, Rotorflight or INAV (.bbl, .bfl, .txt): {signal:
        column}, such as "gyroADC[0]", resampled to `dt` (s) as in `symheli.logs.column`; signs are
        the firmware's.

        Units are those that the log declares; `units` gives those it does not, "1" else.
        """
        units = units_of(fields, units)
        chosen = {name: (column, units.get(name, "")) for name, column in fields.items()}
        return replace(
            cls._from_table(*read_blackbox(path, chosen, dt), path),
            resampled=f"frames interpolated to {dt:g} s",
        )

    @classmethod
    def from_mat(
        cls, path: str | os.PathLike[str], time: str, units: Mapping[str, str], time_unit: str = "s"
    ) -> FlightRecord:
        """Read a MATLAB file with one vector a signal, `time` in `time_unit`; one saved with -v7.3
        needs h5py (extra "logs").
        """
        return cls._from_table(*read_mat(path, time, units, time_unit), path)

    @classmethod
    def from_map(
        cls, path: str | os.PathLike[str], signal_map: str | os.PathLike[str] | SignalMap
    ) -> FlightRecord:
        """Read any of these logs by a TOML file (or what was loaded of one) that assigns columns to
        signals; see `symheli.logs.signal_map`.
        """
        found = SignalMap.load(signal_map)
        record = replace(cls._from_table(*found.read(path), path), resampled=found.resampled(path))
        step = found.step(path)
        return record if step is None else record.resample(step)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> FlightRecord:
        """Load what `save` wrote, to the last bit; raise `InputError` for any other file. Pickles
        are never read.
        """
        from symheli.records.record_file import read_record

        return cls(**read_record(path)._asdict())

    @classmethod
    def _from_table(
        cls,
        time: Array,
        columns: Mapping[str, Array],
        units: Mapping[str, str],
        path: str | os.PathLike[str],
    ) -> FlightRecord:
        return cls.from_arrays(time, units, os.path.basename(os.fspath(path)), **columns)

    # --- looking ---------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, name: str) -> Array:
        return self.values[:, indices([name], self.signals, "signal")[0]]

    def columns(self, names: Iterable[str]) -> Array:
        """The named signals side by side, (n, len(names))."""
        return self.values[:, indices(names, self.signals, "signal")]

    @property
    def dt(self) -> float:
        """Sample period (s): the roundest number that the stamps allow (`sample_period.period_of`),
        so that 0.02 s is 0.02 s.

        Raises `InputError` where the steps inside a segment vary by more than 1 %.
        """
        steps = np.diff(self.time)
        dt = float(np.median(steps))
        inside = steps[steps <= GAP * dt]
        if np.ptp(inside) > JITTER * dt:
            raise InputError(
                f"sampling is irregular (steps {inside.min():.4g} to {inside.max():.4g} s);"
                f" resample first: record.resample({dt:.3g}); where only the"
                " stamps are uneven: record.mended()"
            )
        return period_of(inside, self.time[-1])

    def segments(self) -> tuple[slice, ...]:
        """Index ranges without a gap between them, in order."""
        steps = np.diff(self.time)
        cuts = [0, *(np.flatnonzero(steps > GAP * np.median(steps)) + 1).tolist(), len(self)]
        return tuple(slice(a, b) for a, b in pairwise(cuts))

    def derivative(self, name: str) -> Array:
        """Central-difference time derivative (n,) of a signal, one-sided at the ends of each
        segment.
        """
        return self.slope(self[name])

    def slope(self, values: Array) -> Array:
        """Return the slope of `values` (n, ...), one a sample; NaN in a segment of one sample."""
        out = np.full(values.shape, np.nan)
        for part in self.segments():
            if part.stop - part.start > 1:
                out[part] = np.gradient(values[part], self.time[part], axis=0)
        return out

    def check_kinematics(self) -> KinematicCheck:
        """Check whether attitude, rates, velocities and specific forces agree: bias, scale and
        delay of each sensor, with standard errors and a verdict; see
        `symheli.records.check_kinematics`.
        """
        from symheli.records.kinematic_check import check_kinematics

        return check_kinematics(self)

    def corrected(self) -> FlightRecord:
        """The record with the biases, scales and delays taken off that `check_kinematics` finds in
        sensors that contradict the others; see `symheli.records.KinematicCheck.corrected`.
        """
        return self.check_kinematics().corrected(self)

    def plot(self, names: Sequence[str] | None = None) -> Array:
        """Axes (signals,) of these signals against time; gaps stay empty. Default: all, of a flight
        with many what was commanded and flown on one screen. See `symheli.records.record_plot`.
        """
        from symheli.records.record_plot import plot_record

        return plot_record(self, names)

    # --- changing (a new record each time) -------------------------------------------------------

    def between(self, start: float | None, stop: float | None) -> FlightRecord:
        """The samples with start <= time < stop (s on the record's clock; None: from the first, to
        the last). Raises `InputError` where fewer than two are left.
        """
        low, high = -np.inf if start is None else start, np.inf if stop is None else stop
        keep = (self.time >= low) & (self.time < high)
        if keep.sum() < 2:
            raise InputError(
                f"no samples lie between start and stop; the record goes from {self.time[0]:g} to"
                f" {self.time[-1]:g} s"
            )
        return self.rows(keep)

    def rows(self, keep: object) -> FlightRecord:
        """The samples at these indices (slice, index array or mask)."""
        try:
            time, values = self.time[keep], self.values[keep]  # type: ignore[index]
        except IndexError as error:
            raise InputError(f"rows of a record of {len(self)} samples: {error}") from error
        return replace(self, time=time, values=values)

    def select(self, names: Sequence[str]) -> FlightRecord:
        """Return a record of these signals only."""
        index = indices(names, self.signals, "signal")
        return replace(
            self, values=self.values[:, index], signals=tuple(self.signals[i] for i in index)
        )

    def with_signals(self, units: Mapping[str, str], **columns: Any) -> FlightRecord:
        """Return the record with these signals added, or replaced where the name exists."""
        other = FlightRecord._in_si(self.time, units, self.note, columns)
        kept = [i for i, s in enumerate(self.signals) if s not in other.signals]
        return replace(
            self,
            values=np.column_stack([self.values[:, kept], other.values]),
            signals=(*(self.signals[i] for i in kept), *other.signals),
        )

    def resample(self, dt: float) -> FlightRecord:
        """Linear interpolation to a uniform step `dt` (s) inside each segment; nothing is invented
        across gaps.

        To a longer step: `low_pass` or `decimate` first, or what is faster folds back into what is
        slower. Between its neighbours an output has heard the input that stands beside it: identify
        with delay 0.
        """
        if not 0 < dt < np.inf:
            raise InputError(f"dt must be a positive number of seconds, got {dt}")
        parts = self.segments()
        samples = (
            sum(float(self.time[part.stop - 1] - self.time[part.start]) for part in parts) / dt
        )
        if samples > MAX_UPSAMPLING * len(self):
            raise InputError(
                f"dt of {dt:g} s makes {samples:.1e} samples of {len(self)}; dt is in seconds"
            )
        times, values, offset = [], [], None
        for part in parts:
            old = self.time[part]
            offset = old[0] if offset is None else offset
            new = offset + dt * np.arange(
                np.ceil((old[0] - offset) / dt - 1e-9), np.floor((old[-1] - offset) / dt + 1e-9) + 1
            )
            if len(new):
                times.append(new)
                values.append(
                    np.column_stack([np.interp(new, old, column) for column in self.values[part].T])
                )
        new, old = np.concatenate(times), float(np.median(np.diff(self.time)))
        kept = len(new) == len(self) and np.allclose(new, self.time, rtol=0, atol=1e-9 * dt)
        made = self.resampled if kept else f"interpolated to {dt:.4g} s from {old:.4g} s"
        return replace(self, time=new, values=np.concatenate(values), resampled=made)

    def low_pass(
        self, cutoff: float, order: int = 4, *, zero_phase: bool = False, leave: Sequence[str] = ()
    ) -> FlightRecord:
        """Filter all signals but those of `leave` by one Butterworth filter with its corner at
        `cutoff` (Hz); see `symheli.records.low_pass`.
        """
        from symheli.records.conditioning import low_pass

        return low_pass(self, cutoff, order, zero_phase=zero_phase, leave=leave)

    def decimate(self, n: int) -> FlightRecord:
        """Means of `n` samples in a row, all signals alike, to identify with delay 0; see
        `symheli.records.decimate`.
        """
        from symheli.records.conditioning import decimate

        return decimate(self, n)

    def mended(self, sensors: Sequence[str] | None = None) -> FlightRecord:
        """Put stamps on an even clock, and mark what `sensors` only repeat as missing (default:
        what the kinematics tie); see `symheli.records.mended`.
        """
        from symheli.records.mending import mended

        return mended(self, sensors)

    def split(self, fraction: float) -> tuple[FlightRecord, FlightRecord | None]:
        """Return the first `fraction` of the time for the fit, the rest for validation (None where
        nothing is left); see `symheli.records.split`.
        """
        from symheli.records.conditioning import split

        return split(self, fraction)

    def to_frame(self) -> pandas.DataFrame:
        """A pandas DataFrame with a "t" column (s) and one column a signal, units in
        attrs["units"]. Raises `InputError` without pandas.
        """
        with extra("labelled", "a data frame"):
            import pandas as pd

        made = pd.DataFrame(
            {"t": self.time, **{str(s): self.values[:, i] for i, s in enumerate(self.signals)}}
        )
        made.attrs["units"] = {"t": "s", **{str(s): s.unit for s in self.signals}}
        return made

    def to_xarray(self) -> xarray.Dataset:
        """An xarray Dataset over "time" (s), a variable a signal with its unit; the note is its
        title. Raises `InputError` without xarray.
        """
        from symheli.values.labelled import dataset

        variables = {
            str(s): (("time",), column, s.unit)
            for s, column in zip(self.signals, self.values.T, strict=True)
        }
        time = {"time": (Signal("time", "s"), self.time)}
        return dataset(time, variables, title=self.note or None)

    # --- writing ---------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> Path:
        """All of it as one compressed NumPy archive (.npz), written whole or not at all, for
        `load`: samples, names, units, note, what was resampled, and of `meta` the numbers, texts,
        arrays, lists, tuples and mappings of them.

        Anything else in `meta` (the plan of a flight) cannot be kept: its text comes back as
        `meta["described"]`.
        """
        from symheli.records.record_file import Content, write_record

        parts = {name: getattr(self, name) for name in Content._fields}
        return Path(write_record(path, Content(**parts)))

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """The samples as a table, units in its header ("t [s],q [rad/s]"), that `from_csv(path)`
        reads back to the last bit; written whole or not at all. Note and meta stay behind (`save`).
        """
        columns = [(signal, self.values[:, i]) for i, signal in enumerate(self.signals)]
        return write_text(path, with_units(self.time, columns))
