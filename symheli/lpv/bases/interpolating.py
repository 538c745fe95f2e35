"""Bases whose coefficients are the values at the nodes: piecewise linear and cubic spline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline as _CubicSpline
from scipy.interpolate import PPoly

from symheli.errors import InputError
from symheli.lpv.bases.piecewise import PiecewisePolynomial
from symheli.values.arrays import frozen


@dataclass(frozen=True)
class Cardinal(PiecewisePolynomial):
    """Functions f_j with f_j(node_i) = 1 where i = j and 0 elsewhere; see `PiecewiseLinear` and
    `CubicSpline`.
    """

    nodes: tuple[float, ...]

    minimum_nodes = 2

    def __post_init__(self) -> None:
        nodes = frozen(self.nodes, "nodes", (None,))
        if len(nodes) < self.minimum_nodes or np.any(np.diff(nodes) <= 0):
            raise InputError(
                f"{type(self).__name__} needs at least {self.minimum_nodes} strictly increasing"
                f" nodes, got {self.nodes}"
            )
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
        """The number of nodes."""
        return self.size


@dataclass(frozen=True)
class PiecewiseLinear(Cardinal):
    """Hat functions interpolate through the nodes by straight lines.

    Parameters
    ----------
    nodes : tuple of float
        At least two, increasing, in the unit of p.

    Raises
    ------
    InputError
        Fewer nodes, or nodes that do not increase.

    See Also
    --------
    symheli.lpv.CubicSpline, symheli.lpv.BSpline

    Examples
    --------
    >>> from symheli.lpv import PiecewiseLinear
    >>> PiecewiseLinear((0.0, 5.0, 13.0))([2.5, 5.0])
    array([[0.5, 0.5, 0. ],
           [0. , 1. , 0. ]])
    """

    def _piecewise(self) -> PPoly:
        values = np.eye(self.size)
        slopes = np.diff(values, axis=0) / np.diff(self.nodes)[:, None]
        return PPoly(np.stack([slopes, values[:-1]]), np.array(self.nodes))


@dataclass(frozen=True)
class CubicSpline(Cardinal):
    """Cubic splines interpolate through the nodes, twice continuously differentiable, with
    not-a-knot ends.

    Parameters
    ----------
    nodes : tuple of float
        At least four, increasing, in the unit of p.

    Raises
    ------
    InputError
        Fewer nodes, or nodes that do not increase.

    See Also
    --------
    symheli.lpv.BSpline, symheli.lpv.PiecewiseLinear

    References
    ----------
    de Boor (2001), A Practical Guide to Splines, ch. 4.

    Examples
    --------
    >>> from symheli.lpv import CubicSpline
    >>> cubic = CubicSpline((0.0, 3.0, 8.0, 13.0))
    >>> print((cubic([5.0]) @ np.array([0.0, 3.0, 8.0, 13.0]) ** 3).round(6))
    [125.]
    """

    minimum_nodes = 4

    def _piecewise(self) -> PPoly:
        return _CubicSpline(np.array(self.nodes), np.eye(self.size))
