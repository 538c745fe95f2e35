"""Operating points of many linear models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from symheli.values.arrays import Array
from symheli.values.operating_point import OperatingPoint


class OperatingPoints(Sequence[OperatingPoint]):
    """K operating points in a row; whoever holds arrays answers from them."""

    @staticmethod
    def of(points: Sequence[OperatingPoint]) -> OperatingPoints:
        """These points, as they are or as a list."""
        return points if isinstance(points, OperatingPoints) else ListedPoints(tuple(points))

    def state(self, names: Sequence[str]) -> Array:
        """These states (K, n)."""
        return self._table([[point.x[name] for name in names] for point in self], names)

    def rate(self, names: Sequence[str]) -> Array:
        """Derivatives of these states (K, n)."""
        return self._table([[point.xdot[name] for name in names] for point in self], names)

    def input(self, names: Sequence[str]) -> Array:
        """These inputs (K, n), 0 where a point has none of that name (a gust)."""
        rows = [[point.u[n] if n in point.u else 0.0 for n in names] for point in self]
        return self._table(rows, names)

    def _table(self, rows: list[list[float]], names: Sequence[str]) -> Array:
        return np.array(rows).reshape(len(self), len(names))


@dataclass(frozen=True)
class ListedPoints(OperatingPoints):
    """One by one."""

    points: tuple[OperatingPoint, ...] = ()

    def __len__(self) -> int:
        return len(self.points)

    @overload
    def __getitem__(self, k: int) -> OperatingPoint: ...
    @overload
    def __getitem__(self, k: slice) -> tuple[OperatingPoint, ...]: ...
    def __getitem__(self, k: int | slice) -> OperatingPoint | tuple[OperatingPoint, ...]:
        return self.points[k]
