"""Labelled arrays in a folder, in the Zarr format (version 2, not compressed), whole chunk by whole
chunk: read by zarr and xarray, which need not be installed to write it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.whole_files import write_bytes

FORMAT = 2
LAST_CHARACTER = 0x10FFFF


@dataclass(frozen=True, kw_only=True)
class ZarrArray:
    """`shape` along named `dimensions` in chunks of `chunks`; `fill` is what is read where a chunk
    is not there (None: zero, or empty text); `coordinates` name the arrays that label it besides.
    """

    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: str
    fill: Any = None
    coordinates: tuple[str, ...] = ()

    @classmethod
    def whole(cls, dimension: str, values: Array) -> ZarrArray:
        """Description of one chunk that holds all values."""
        shape = values.shape
        return cls(dimensions=(dimension,), shape=shape, chunks=shape, dtype=values.dtype.str)

    def filled(self, shape: tuple[int, ...]) -> Array:
        """What is read where nothing was written."""
        return np.zeros(shape, self.dtype) if self.fill is None else np.full(shape, self.fill)

    @property
    def fault(self) -> str | None:
        """What cannot be of an array in chunks along its first dimension, None where nothing."""
        counts = [*self.shape, *self.chunks]
        if not all(type(n) is int and n >= 0 for n in counts) or not self.shape:
            return f"shape {self.shape}, chunks {self.chunks}"
        sizes = {len(self.dimensions), len(self.shape), len(self.chunks)}
        if len(sizes) > 1 or self.chunks[1:] != self.shape[1:]:
            return f"dimensions {self.dimensions}, shape {self.shape}, chunks {self.chunks}"
        if self.shape[0] and not self.chunks[0]:
            return "chunks of nothing"
        if np.dtype(self.dtype).kind not in "biufU" or not np.dtype(self.dtype).itemsize:
            return f"dtype {self.dtype}"
        if not isinstance(self.fill, bool | int | float | None):
            return f"fill_value {self.fill!r}"
        return None

    def along(self) -> range:
        """Chunks along the first dimension."""
        return range(-(-self.shape[0] // max(self.chunks[0], 1)))


@dataclass(frozen=True)
class ZarrFolder:
    """The folder `path`; each file in it is whole or absent. `remade`: the owner writes the
    metadata anew with every change, so that only chunks need to survive a power failure.
    """

    path: Path
    remade: bool = False

    def describe(self, arrays: Mapping[str, ZarrArray]) -> None:
        """Write the metadata of the arrays; existing chunks stay."""
        metadata: dict[str, Any] = {".zgroup": {"zarr_format": FORMAT}}
        for name, array in arrays.items():
            fill = "NaN" if isinstance(array.fill, float) and np.isnan(array.fill) else array.fill
            metadata[f"{name}/.zarray"] = {
                "zarr_format": FORMAT,
                "shape": array.shape,
                "chunks": array.chunks,
                "dtype": array.dtype,
                "compressor": None,
                "fill_value": fill,
                "order": "C",
                "filters": None,
            }
            labels = {"coordinates": " ".join(array.coordinates)} if array.coordinates else {}
            metadata[f"{name}/.zattrs"] = {"_ARRAY_DIMENSIONS": array.dimensions, **labels}
        for name, content in metadata.items():
            self._write_json(name, content)
        consolidated = {"zarr_consolidated_format": 1, "metadata": metadata}
        self._write_json(".zmetadata", consolidated)

    def write_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Write the attributes of the folder."""
        self._write_json(".zattrs", attributes)

    def keep(self, name: str, values: Array) -> None:
        """An array of one chunk."""
        write_bytes(self.path / name / "0", values.tobytes(), forced=not self.remade)

    def write(self, name: str, chunk: int, values: Array, array: ZarrArray | None = None) -> None:
        """Write the chunk along the first dimension, filled up where `values` has fewer rows."""
        array = array or self.array(name)
        whole = array.filled(array.chunks)
        whole[: len(values)] = values
        write_bytes(self._file(name, chunk, array), whole.tobytes())

    # --- reading ---------------------------------------------------------------------------------

    def attributes(self) -> Mapping[str, Any]:
        """The attributes of the whole; OSError or ValueError where there are none."""
        found = json.loads((self.path / ".zattrs").read_text(encoding="utf-8"))
        json.loads((self.path / ".zgroup").read_text(encoding="utf-8"))
        return found

    def array(self, name: str) -> ZarrArray:
        """Metadata of an array; raises `InputError` if they are damaged."""
        try:
            about = json.loads((self.path / name / ".zarray").read_text(encoding="utf-8"))
            along = json.loads((self.path / name / ".zattrs").read_text(encoding="utf-8"))
            found = ZarrArray(
                dimensions=tuple(along["_ARRAY_DIMENSIONS"]),
                shape=tuple(about["shape"]),
                chunks=tuple(about["chunks"]),
                dtype=np.dtype(about["dtype"]).str,
                fill=float("nan") if about["fill_value"] == "NaN" else about["fill_value"],
                coordinates=tuple(along.get("coordinates", "").split()),
            )
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            raise self._damaged(name, str(error)) from error
        if (why := found.fault) is not None:
            raise self._damaged(name, why)
        return found

    # What an owner knows of an array itself it gives as `array`; otherwise it is read.

    def missing(self, name: str, array: ZarrArray | None = None) -> list[int]:
        """Chunks along the first dimension that are not there."""
        array = array or self.array(name)
        return [k for k in array.along() if not self._file(name, k, array).is_file()]

    def chunk(self, name: str, chunk: int) -> Array | None:
        """A chunk along the first dimension; None where it is not there, `InputError` where it is
        damaged.
        """
        return self._read(name, chunk, self.array(name))

    def whole(self, name: str, array: ZarrArray | None = None) -> Array:
        """Return all of an array, with its fill value where chunks are missing; `InputError` where
        one is damaged.
        """
        array = array or self.array(name)
        out, step = array.filled(array.shape), array.chunks[0]
        for k in array.along():
            block = self._read(name, k, array)
            if block is not None:
                rows = slice(k * step, (k + 1) * step)
                out[rows] = block[: len(out[rows])]
        return out

    def _write_json(self, name: str, content: Any) -> None:
        write_bytes(self.path / name, json.dumps(content).encode(), forced=not self.remade)

    def _read(self, name: str, chunk: int, array: ZarrArray) -> Array | None:
        path, dtype = self._file(name, chunk, array), np.dtype(array.dtype)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        wanted = int(np.prod(array.chunks)) * dtype.itemsize
        if len(content) != wanted:
            raise InputError(
                f"{path}: {len(content)} bytes, expected {wanted}; remove it and resume"
            )
        if dtype.kind == "U" and np.any(np.frombuffer(content, "<u4") > LAST_CHARACTER):
            raise InputError(f"{path}: not a text file; remove it and resume")
        return np.frombuffer(content, dtype).reshape(array.chunks)

    def _damaged(self, name: str, why: str) -> InputError:
        return InputError(
            f"{self.path / name}: the metadata of the array are damaged ({why}); resume, which"
            " writes them again, or take an older copy"
        )

    def _file(self, name: str, chunk: int, array: ZarrArray) -> Path:
        return self.path / name / ".".join([str(chunk), *["0"] * (len(array.shape) - 1)])
