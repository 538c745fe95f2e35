"""The largest H-infinity norm of the models frozen at each p, a lower bound on the gain of the LPV
model.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, LPVStateSpace, UserFunctions
from symheli.values.numbers import whole
from synthesis.certify.lower_bounds.over_box import worst_over
from synthesis.certify.lower_bounds.scheduled import Scheduled
from synthesis.numerics.linear.norm import gain_at_poles, norm

Array = np.ndarray


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

    References
    ----------
    Boyd and Balakrishnan, Systems and Control Letters 15 (1990); Bruinsma and Steinbuch, Systems
    and Control Letters 14 (1990): the level-set method on a Hamiltonian matrix.

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> frozen_gain(lag)  # 1/(1 + p), at p = 0
    FrozenGain(gain=1.0, p=0.0, omega=0.0)
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance: expected a number between 0 and 1, got {tolerance!r:.60}")
    if isinstance(lpv, LFT) and len(lpv.parameters) > 1:
        from synthesis.certify.lower_bounds.lft import frozen_box_gain

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
