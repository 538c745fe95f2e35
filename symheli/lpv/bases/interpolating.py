"""Bases whose coefficients are the values at the nodes: piecewise linear and cubic spline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from symheli.errors import InputError
from symheli.lpv.arrays import Array, frozen
from symheli.lpv.bases.basis import Basis, Piece


@dataclass(frozen=True)
class Cardinal(Basis):
    """Functions f_j with f_j(node_i) = 1 where i = j and 0 elsewhere; see `PiecewiseLinear` and `Spline`."""

    nodes: tuple[float, ...]

    minimum_nodes = 2

    def __post_init__(self) -> None:
        nodes = frozen(self.nodes, "nodes", (None,))
        if len(nodes) < self.minimum_nodes or np.any(np.diff(nodes) <= 0):
            raise InputError(f"{type(self).__name__} needs at least {self.minimum_nodes} strictly increasing nodes, got {self.nodes}")
        object.__setattr__(self, "nodes", tuple(float(n) for n in nodes))

    @property
    def low(self) -> float:  # type: ignore[override]
        """First node."""
        return self.nodes[0]

    @property
    def high(self) -> float:  # type: ignore[override]
        """Last node."""
        return self.nodes[-1]

    @property
    def size(self) -> int:
        """One function a node."""
        return len(self.nodes)

    @property
    def distinct_values(self) -> int:
        """As many as there are nodes."""
        return self.size

    def _piecewise(self) -> PPoly:
        raise NotImplementedError

    @cached_property
    def _functions(self) -> PPoly:
        return self._piecewise()

    def _values(self, p: Array, derivative: int) -> Array:
        return np.asarray(self._functions(np.clip(p, self.low, self.high), nu=derivative))

    def pieces(self) -> tuple[Piece, ...]:
        """One piece between every two nodes."""
        power = self._functions.c[::-1]  # (degree + 1, segments, functions), ascending powers of p - node
        d = power.shape[0] - 1
        out = []
        for s, (low, high) in enumerate(zip(self.nodes[:-1], self.nodes[1:], strict=True)):
            scaled = power[:, s, :] * ((high - low) ** np.arange(d + 1))[:, None]
            bernstein = np.array([sum(comb(k, i) / comb(d, i) * scaled[i] for i in range(k + 1)) for k in range(d + 1)])
            out.append(Piece(low, high, bernstein.T))
        return tuple(out)


@dataclass(frozen=True)
class PiecewiseLinear(Cardinal):
    """Hat functions: straight lines between the nodes."""

    def _piecewise(self) -> PPoly:
        values = np.eye(self.size)
        slopes = np.diff(values, axis=0) / np.diff(self.nodes)[:, None]
        return PPoly(np.stack([slopes, values[:-1]]), np.array(self.nodes))


@dataclass(frozen=True)
class Spline(Cardinal):
    """Cubic splines through the nodes with not-a-knot ends (twice continuously differentiable)."""

    minimum_nodes = 4

    def _piecewise(self) -> PPoly:
        return CubicSpline(np.array(self.nodes), np.eye(self.size))
