"""A vector whose entries have names and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from symheli.errors import UnknownNameError
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, signals


@dataclass(frozen=True, eq=False)
class NamedVector(Mapping[str, float]):
    """Values with a `Signal` each: `x["theta"]` is a float, `x.array` (or `np.asarray(x)`) the
    vector, `x.signals` names and units. In arithmetic it is its array: `2 * x` has no names.

    Parameters
    ----------
    signals : tuple of Signal
        n names.
    array : array (n,)
        In their units.

    Raises
    ------
    InputError
        Another number of values than names.

    Examples
    --------
    >>> x = symheli.trim(heli, airspeed=5.0).x
    >>> x["theta"] == float(x.array[7]), x.signals[7].unit
    (True, 'rad')
    >>> (2 * x)[7] == 2 * x["theta"]
    np.True_
    """

    signals: tuple[Signal, ...]
    array: Array
    short: ClassVar[bool] = True
    """A summary shows it as it is."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", signals(self.signals))
        object.__setattr__(
            self, "array", frozen(self.array, "values", (len(self.signals),), finite=False)
        )

    def __getitem__(self, name: str) -> float:
        if name not in self.signals:
            raise UnknownNameError("signal", name, self.signals)
        return float(self.array[self.signals.index(name)])  # type: ignore[arg-type]

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.array, dtype=dtype) if copy or dtype is not None else self.array

    def __add__(self, other: Any) -> Array:
        return self.array + np.asarray(other)

    def __sub__(self, other: Any) -> Array:
        return self.array - np.asarray(other)

    def __rsub__(self, other: Any) -> Array:
        return np.asarray(other) - self.array

    def __mul__(self, other: Any) -> Array:
        return self.array * np.asarray(other)

    def __truediv__(self, other: Any) -> Array:
        return self.array / np.asarray(other)

    def __neg__(self) -> Array:
        return -self.array

    __radd__, __rmul__ = __add__, __mul__

    def __repr__(self) -> str:
        return (
            "("
            + ", ".join(
                f"{n}={v:.5g} {n.unit}" for n, v in zip(self.signals, self.array, strict=True)
            )
            + ")"
        )
