"""Many flights as one dataset on disk, in the Zarr format (version 2, not compressed)."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.whole_files import write_bytes, write_text

FORMAT = 2


@dataclass(frozen=True, eq=False)
class FlightDataset:
    """Flights in a folder: `values` (flight, time, signal) in SI, `time` (s), `signal`, `unit`,
    `duration` (flight; s flown, NaN where not yet flown), `lost` (flight) and `seed` (flight).

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
    >>> flights = symheli.fly_campaign(heli, climb, folder, seeds=range(5), noise_db=30.0)
    >>> again = symheli.FlightDataset(folder)
    >>> len(again), bool(again.finished.all()), again["phi"].shape == (5, len(again.time))
    (5, True, True)
    """

    path: Path

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        try:
            attributes = json.loads((self.path / ".zattrs").read_text(encoding="utf-8"))
            self._read(".zgroup")
            chunk = self._described("values")["chunks"][0]
            object.__setattr__(self, "_chunk", int(chunk))
            object.__setattr__(self, "_attributes", attributes)
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(f"{self.path}: no dataset of flights ({error})") from error

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
        folder, n, m = Path(path), len(time), len(signals)
        names, units = (np.array(list(map(str, s))) for s in (signals, [s.unit for s in signals]))
        arrays: dict[str, tuple[tuple[str, ...], tuple[int, ...], tuple[int, ...], Any, Any]] = {
            "values": (("flight", "time", "signal"), (flights, n, m), (chunk, n, m), "<f8", "NaN"),
            "duration": (("flight",), (flights,), (chunk,), "<f8", "NaN"),
            "lost": (("flight",), (flights,), (chunk,), "|b1", None),
        }
        metadata: dict[str, Any] = {".zgroup": {"zarr_format": FORMAT}, ".zattrs": dict(attributes)}
        whole = {
            "time": ("time", np.asarray(time, "<f8")),
            "signal": ("signal", names),
            "unit": ("signal", units),
            "seed": ("flight", np.asarray(seeds, "<i8")),
        }
        for name, (dimension, values) in whole.items():
            shape = values.shape
            arrays[name] = ((dimension,), shape, shape, values.dtype.str, None)
            write_bytes(folder / name / "0", values.tobytes())
        for name, (dimensions, shape, chunks, dtype, fill) in arrays.items():
            metadata[f"{name}/.zarray"] = {
                "zarr_format": FORMAT,
                "shape": shape,
                "chunks": chunks,
                "dtype": dtype,
                "compressor": None,
                "fill_value": fill,
                "order": "C",
                "filters": None,
            }
            metadata[f"{name}/.zattrs"] = {"_ARRAY_DIMENSIONS": dimensions}
        for name, content in metadata.items():
            if name != ".zattrs":
                write_text(folder / name, json.dumps(content))
        consolidated = {"zarr_consolidated_format": 1, "metadata": metadata}
        write_text(folder / ".zmetadata", json.dumps(consolidated))
        write_text(folder / ".zattrs", json.dumps(attributes))  # last: now it is a dataset
        return cls(folder)

    def write(self, chunk: int, values: Array, duration: Array, lost: Array) -> None:
        """One chunk of flights, `duration` last: it says that they are there."""
        size = self._chunk_size
        for name, content, dtype, fill, tail in (
            ("values", values, "<f8", np.nan, ".0.0"),
            ("lost", lost, "|b1", False, ""),
            ("duration", duration, "<f8", np.nan, ""),
        ):
            whole = np.full((size, *content.shape[1:]), fill, dtype)
            whole[: len(content)] = content
            write_bytes(self.path / name / f"{chunk}{tail}", whole.tobytes())

    # --- reading ---------------------------------------------------------------------------------

    def __len__(self) -> int:
        return int(self._described("values")["shape"][0])

    @property
    def attributes(self) -> Mapping[str, Any]:
        """What is said of all flights: vehicle, plans, fingerprint."""
        return vars(self)["_attributes"]

    @property
    def time(self) -> Array:
        """Of the samples (n,), s."""
        return self._array("time")

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What is kept of every flight."""
        names, units = self._array("signal").tolist(), self._array("unit").tolist()
        return tuple(Signal(str(n), str(u)) for n, u in zip(names, units, strict=True))

    @property
    def duration(self) -> Array:
        """What was flown of each flight (N,), s; NaN where it is still to be."""
        return self._array("duration")

    @property
    def finished(self) -> Array:
        """Which flights (N,) are there."""
        return np.isfinite(self.duration)

    @property
    def lost(self) -> Array:
        """Which flights (N,) were lost."""
        return self._array("lost")

    @property
    def missing_chunks(self) -> list[int]:
        """Chunks still to be flown."""
        count = -(-len(self) // self._chunk_size)
        return [k for k in range(count) if not (self.path / "duration" / str(k)).is_file()]

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
            block = self._chunk_of("values", chunk)
            if block is not None:
                out[rows.start : rows.stop] = block[: len(rows), :, at]
        return out

    def record(self, i: int) -> FlightRecord:
        """One flight; `InputError` where it is not flown yet or lasted less than two samples."""
        block = self._chunk_of("values", i // self._chunk_size) if 0 <= i < len(self) else None
        flown = float(self.duration[i]) if block is not None else np.nan
        if block is None or not np.isfinite(flown):
            raise InputError(f"{self.path}: flight {i} of {len(self)} is not there")
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
        return vars(self)["_chunk"]

    def _read(self, name: str) -> Any:
        return json.loads((self.path / name).read_text(encoding="utf-8"))

    def _described(self, name: str) -> Any:
        return self._read(f"{name}/.zarray")

    def _chunk_of(self, name: str, chunk: int) -> Array | None:
        about = self._described(name)
        key = ".".join([str(chunk), *["0"] * (len(about["shape"]) - 1)])
        path = self.path / name / key
        if not path.is_file():
            return None
        content, dtype = path.read_bytes(), np.dtype(about["dtype"])
        wanted = int(np.prod(about["chunks"])) * dtype.itemsize
        if len(content) != wanted:
            raise InputError(
                f"{path}: {len(content)} bytes, expected {wanted}; remove it and resume"
            )
        return np.frombuffer(content, dtype).reshape(about["chunks"])

    def _array(self, name: str) -> Array:
        about = self._described(name)
        shape, chunks = about["shape"], about["chunks"]
        fill = float("nan") if about["fill_value"] == "NaN" else about["fill_value"]
        out = np.full(shape, 0 if fill is None else fill, np.dtype(about["dtype"]))
        for chunk in range(-(-shape[0] // max(chunks[0], 1))):
            block = self._chunk_of(name, chunk)
            if block is not None:
                rows = slice(chunk * chunks[0], (chunk + 1) * chunks[0])
                out[rows] = block[: len(out[rows])]
        return out
