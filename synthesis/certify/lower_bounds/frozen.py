"""The largest H-infinity norm of the models frozen at each p, a lower bound on the gain of the LPV
model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from symheli import LFT, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv import UserFunctions
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from synthesis.certify.lower_bounds.paths import Scheduled
from synthesis.numerics.linear.norm import gain_at_poles, norm


class FrozenGain(NamedTuple):
    """The largest frozen `gain`, with the `p` (of several parameters their tuple) and frequency
    `omega` (rad/s) at which it occurs; inf and NaN if unstable.
    """

    gain: float
    p: Any
    omega: float


def frozen_gain(
    lpv: Scheduled | LPVStateSpace | LFT, *, points: int = 61, tolerance: float = 1e-8
) -> FrozenGain:
    """Return the largest H-infinity norm of the models frozen at each p, a lower bound on the gain
    of the LPV model.

    Parameters
    ----------
    lpv : LPVStateSpace or LFT
        The model.
    points : int
        Of the grid whose highest peaks are climbed, of one parameter: of two 15 each, of more 7 or
        3. The breaks of a spline are on it too.
    tolerance : float
        Relative accuracy of each norm, from below; less than 1.

    Returns
    -------
    FrozenGain
        `gain` (inf where a frozen model is unstable), `p` and `omega` (rad/s; then NaN) where it
        occurs.

    See Also
    --------
    synthesis.lower_bound : the worst trajectory of p found
    synthesis.l2_gain : worst-case gain while p moves

    References
    ----------
    Boyd and Balakrishnan, Systems and Control Letters 15 (1990); Bruinsma and Steinbuch, Systems
    and Control Letters 14 (1990): the level-set method on a Hamiltonian matrix.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> frozen_gain(lag)  # 1/(1 + p), at p = 0
    FrozenGain(gain=1.0, p=0.0, omega=0.0)
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance: expected a number between 0 and 1, got {tolerance!r:.60}")
    if isinstance(lpv, LFT) and len(lpv.parameters) > 1:
        from synthesis.certify.lower_bounds.lines import frozen_box_gain

        return FrozenGain(*frozen_box_gain(lpv, tolerance=tolerance))
    if isinstance(lpv, LPVStateSpace) and len(lpv.parameters) > 1:
        return _over_a_box(lpv, tolerance)
    low, high = lpv.scheduling.low, lpv.scheduling.high
    grid = np.linspace(low, high, whole(points, "points", 2))
    if isinstance(lpv, LPVStateSpace) and not isinstance(lpv.basis, UserFunctions):
        ends = [p for piece in lpv.basis.pieces() for p in (piece.low, piece.high)]
        grid = np.unique([*grid, *(p for p in ends if low < p < high)])

    def size(p: Array) -> float:
        return norm(*lpv.matrices(float(p[0])), lpv.dt, tolerance)[0]

    gamma, at = worst_over(size, [grid], gain_at_poles(*lpv.matrices(grid), lpv.dt))
    p = float(at[0])
    return FrozenGain(gamma, p, norm(*lpv.matrices(p), lpv.dt, tolerance)[1])


def _over_a_box(lpv: LPVStateSpace, tolerance: float) -> FrozenGain:
    from synthesis.certify.lower_bounds.box import worst_frozen
    from synthesis.numerics.polynomial.pieces import pieces

    def size(A: Array, B: Array, C: Array, D: Array) -> float:
        return norm(A, B, C, D, lpv.dt, tolerance)[0]

    gamma, p, _ = worst_frozen(pieces(lpv), size, partial(gain_at_poles, dt=lpv.dt))
    m = lpv.at(*(p or ()))
    omega = math.nan if math.isinf(gamma) else norm(m.A, m.B, m.C, m.D, lpv.dt, tolerance)[1]
    return FrozenGain(gamma, p, omega)


STARTS = 3
"""Number of grid peaks, the highest first, from which an ascent starts."""


def grid_of(axes: Sequence[Array]) -> Array:
    """Return all points (K, m) of a grid."""
    return np.array(list(product(*axes)), dtype=float)


def worst_over(
    size: Callable[[Array], float], axes: Sequence[Array], values: Array | None = None
) -> tuple[float, Array]:
    """Return (value, p) of the largest `size(p)` found over the grid of the `axes` and by local
    searches from its highest peaks; the first infinite value ends it.

    `values` (K,) on the grid, where they are known already, or something close to them.
    """
    grid = grid_of(axes)
    if values is None:
        found = []
        for p in grid:
            found.append(size(p))
            if found[-1] == math.inf:
                return math.inf, p
        values = np.array(found)
        best = float(values.max()), grid[int(values.argmax())]
    else:
        k = int(values.argmax())
        if values[k] == math.inf:
            return math.inf, grid[k]
        best = size(grid[k]), grid[k]
    climb = _along_line if len(axes) == 1 else _in_box
    for k in _peaks(values.reshape([len(axis) for axis in axes]))[:STARTS] if len(axes) else ():
        p = climb(size, axes, grid[k])
        best = max(best, (size(p), p), key=lambda pair: pair[0])
    return best


def _along_line(size: Callable[[Array], float], axes: Sequence[Array], start: Array) -> Array:
    (axis,) = axes
    k = int(np.searchsorted(axis, start[0]))
    a, b = float(axis[max(k - 1, 0)]), float(axis[min(k + 1, len(axis) - 1)])
    result: Any = minimize_scalar(
        lambda p: -size(np.array([p])),
        bounds=(a, b),
        method="bounded",
        options={"xatol": 1e-6 * (b - a)},
    )
    return np.array([float(result.x)])


def _in_box(size: Callable[[Array], float], axes: Sequence[Array], start: Array) -> Array:
    low, high = (np.array([end(axis) for axis in axes]) for end in (np.min, np.max))
    step = np.array([(axis.max() - axis.min()) / (len(axis) - 1) for axis in axes])
    inward = np.where(start + step > high, -1.0, 1.0)
    result: Any = minimize(
        lambda p: -min(size(np.clip(p, low, high)), 1e300),
        start,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={
            "initial_simplex": np.vstack([start, start + np.diag(inward * step)]),
            "maxfev": 40 * len(axes),
            "xatol": 1e-7 * float((high - low).min()),
            "fatol": 1e-12,
        },
    )
    return np.clip(result.x, low, high)


def _peaks(values: Array) -> list[int]:
    """Return the flat indices that no neighbour on the grid exceeds, the largest first."""
    padded = np.pad(values, 1, constant_values=-np.inf)
    inner = tuple(slice(1, -1) for _ in values.shape)
    highest = np.ones(values.shape, dtype=bool)
    for shift in product((-1, 0, 1), repeat=values.ndim):
        highest &= values >= np.roll(padded, shift, axis=tuple(range(values.ndim)))[inner]
    flat = values.ravel()
    return sorted(np.flatnonzero(highest.ravel()).tolist(), key=lambda k: -flat[k])
