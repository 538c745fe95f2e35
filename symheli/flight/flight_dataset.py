"""Many flights as one dataset on disk, in the Zarr format (version 2, not compressed)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.zarr_folder import ZarrArray, ZarrFolder


@dataclass(frozen=True, eq=False)
class FlightDataset:
    """A dataset of flights in a folder: `values` (flight, time, signal) in SI, `time` (s),
    `signal`, `unit`, `duration` (flight; s flown, NaN if not yet flown), `lost` (flight) and `seed`
    (flight).

    Every chunk of flights is written whole or not at all, so that a reader may come at any time.
    Also read by zarr and xarray: `xarray.open_zarr(path)["values"].sel(signal="phi")`.

    Parameters
    ----------
    path : str or path
        The folder.

    Raises
    ------
    InputError
        No dataset of flights there, or one that is damaged.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp()) / "flights.zarr"
    >>> climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> flights = symheli.flight.fly_campaign(heli, climb, folder, seeds=range(5), noise_db=30.0)
    >>> again = symheli.flight.FlightDataset(folder)
    >>> len(again), bool(again.finished.all()), again["phi"].shape == (5, len(again.time))
    (5, True, True)
    """

    path: Path
    attributes: Mapping[str, Any] = field(init=False, repr=False)
    """Attributes of all flights: vehicle, plans, fingerprint."""
    _folder: ZarrFolder = field(init=False, repr=False)
    _values: ZarrArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        folder = ZarrFolder(self.path)
        try:
            object.__setattr__(self, "_folder", folder)
            object.__setattr__(self, "attributes", folder.attributes())
            object.__setattr__(self, "_values", folder.array("values"))
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(f"{self.path}: no dataset of flights ({error})") from error
        self._check()

    @classmethod
    def create(
        cls,
        path: str | os.PathLike[str],
        *,
        flights: int,
        chunk: int,
        time: Array,
        signals: Sequence[Signal],
        seeds: Sequence[int],
        attributes: Mapping[str, Any],
    ) -> FlightDataset:
        """An empty dataset, all flights yet to be flown."""
        folder, n, m = ZarrFolder(Path(path)), len(time), len(signals)
        names, units = (np.array(list(map(str, s))) for s in (signals, [s.unit for s in signals]))
        whole = {
            "time": ("time", np.asarray(time, "<f8")),
            "signal": ("signal", names),
            "unit": ("signal", units),
            "seed": ("flight", np.asarray(seeds, "<i8")),
        }
        for name, (_, values) in whole.items():
            folder.keep(name, values)
        each = {"dimensions": ("flight",), "shape": (flights,), "chunks": (chunk,)}
        folder.describe(
            {
                "values": ZarrArray(
                    dimensions=("flight", "time", "signal"),
                    shape=(flights, n, m),
                    chunks=(chunk, n, m),
                    dtype="<f8",
                    fill=np.nan,
                ),
                "duration": ZarrArray(**each, dtype="<f8", fill=np.nan),
                "lost": ZarrArray(**each, dtype="|b1"),
                **{name: ZarrArray.whole(*labels) for name, labels in whole.items()},
            }
        )
        folder.write_attributes(attributes)  # last: now it is a dataset
        return cls(Path(path))

    def write(self, chunk: int, values: Array, duration: Array, lost: Array) -> None:
        """Write one chunk of flights, `duration` last, which marks them as complete."""
        self._folder.write("values", chunk, values)
        self._folder.write("lost", chunk, lost)
        self._folder.write("duration", chunk, duration)

    def _check(self) -> None:
        """Raise `InputError` unless all arrays are declared with one size and kind."""
        values = self._values
        if len(values.shape) != 3:
            raise InputError(f"{self.path}: no dataset of flights (values {values.shape})")
        flights, samples, width = values.shape
        each, whole = values.chunks[:1], {"duration": "<f8", "lost": "|b1"}
        expected = {name: ((flights,), each, dtype) for name, dtype in whole.items()}
        for name, count, dtype in (
            ("seed", flights, "<i8"),
            ("time", samples, "<f8"),
            ("signal", width, None),
            ("unit", width, None),
        ):
            expected[name] = (count,), (count,), dtype or self._folder.array(name).dtype
        found = {name: self._folder.array(name) for name in expected}
        wrong = [n for n, a in found.items() if (a.shape, a.chunks, a.dtype) != expected[n]]
        if wrong or values.dtype != "<f8":
            raise InputError(
                f"{self.path}: the metadata of {', '.join(wrong or ['values'])} do not fit the"
                " rest, a file of the dataset is damaged; take an older copy"
            )

    # --- reading ---------------------------------------------------------------------------------

    def __len__(self) -> int:
        return self._values.shape[0]

    @property
    def time(self) -> Array:
        """Time of the samples (n,), s."""
        return self._folder.whole("time")

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Signals of every flight."""
        names, units = self._folder.whole("signal").tolist(), self._folder.whole("unit").tolist()
        return tuple(Signal(str(n), str(u)) for n, u in zip(names, units, strict=True))

    @property
    def duration(self) -> Array:
        """Duration of each flight (N,), s; NaN where it has not been flown."""
        return self._folder.whole("duration")

    @property
    def finished(self) -> Array:
        """Mask (N,) of the flights that are complete."""
        return np.isfinite(self.duration)

    @property
    def lost(self) -> Array:
        """Mask (N,) of the flights that were lost."""
        return self._folder.whole("lost")

    @property
    def missing_chunks(self) -> list[int]:
        """Chunks still to be flown."""
        return self._folder.missing("duration")

    def flights_of(self, chunk: int) -> range:
        """Positions of the flights of a chunk."""
        first = chunk * self._chunk_size
        return range(first, min(first + self._chunk_size, len(self)))

    def __getitem__(self, name: str) -> Array:
        """One signal of all flights (N, n), NaN where nothing was flown."""
        names = [str(s) for s in self.signals]
        if name not in names:
            raise UnknownNameError("signal", name, names)
        at, out = names.index(name), np.full((len(self), len(self.time)), np.nan)
        for chunk in range(-(-len(self) // self._chunk_size)):
            rows = self.flights_of(chunk)
            block = self._folder.chunk("values", chunk)
            if block is not None:
                out[rows.start : rows.stop] = block[: len(rows), :, at]
        return out

    def record(self, i: int) -> FlightRecord:
        """Return one flight; `InputError` where it has not been flown yet or lasted less than two
        samples.
        """
        block = self._folder.chunk("values", i // self._chunk_size) if 0 <= i < len(self) else None
        flown = float(self.duration[i]) if block is not None else np.nan
        if block is None or not np.isfinite(flown):
            raise InputError(f"{self.path}: flight {i} of {len(self)} does not exist")
        time = self.time
        count = int(np.sum(time <= flown + 1e-9))
        values = block[i % self._chunk_size, :count]
        kept = np.flatnonzero(np.isfinite(values).any(axis=0)).tolist()
        return FlightRecord(
            time[:count],
            values[:, kept],
            tuple(self.signals[i] for i in kept),
            note=f"{self.path.name}, flight {i}",
        )

    @property
    def _chunk_size(self) -> int:
        return self._values.chunks[0]
