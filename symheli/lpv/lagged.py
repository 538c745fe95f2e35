"""Scheduling by a lag of the parameter: its rate is known without differentiation."""

from __future__ import annotations

import math

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.polynomials import interpolation_points, polynomials
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Scheduling
from symheli.values.units import per_second

LAGGED, LAG_RATE = "_lagged", "_lag_rate"
"""After the name of a parameter p: q with T dq/dt = p - q, and r = dq/dt = (p - q)/T."""


def lagged(lpv: LPVStateSpace, seconds: float) -> LPVStateSpace:
    """Return the model over q and r with T dq/dt = p - q, r = dq/dt: its parameter is p = q + T r.

    The rate of q is the parameter r, |r| <= rate of p, and |dr/dt| <= 2 rate/T. Polynomials of one
    parameter p are polynomials of q and r, exactly; beyond the range of p, at corners that q and r
    do not reach together, they are what the polynomials are there. The trim is left out.

    Parameters
    ----------
    lpv : LPVStateSpace
        Polynomial in one parameter whose rate is a number.
    seconds : float
        T > 0.

    Raises
    ------
    InputError
        Another basis, several parameters, a rate of 0 or without limit, a lag that is not positive.

    Examples
    --------
    >>> slow = lpv.tools.lagged(spring.with_rate(0.5), 0.2)
    >>> print([s.name for s in slow.parameters], slow.parameters[0].rate)
    ['p_lagged', 'p_lag_rate'] p_lag_rate
    >>> float(abs(slow.at(0.5, 0.4).A - spring.at(0.58).A).max()) < 1e-12
    True
    """
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f"lag: expected a number of seconds > 0, got {seconds!r}")
    s = lpv.scheduling
    if not isinstance(lpv.basis, Polynomial):
        raise InputError(
            f"a lagged parameter needs polynomials, not {type(lpv.basis).__name__}: interpolate"
            " with kind='polynomial'"
        )
    if isinstance(s.rate, str) or not 0 < s.rate < math.inf:
        raise InputError(f"a lagged parameter needs the rate of {s.name}, > 0 and finite: {s.rate}")
    reach, degree = seconds * s.rate, lpv.basis.degree
    own = lpv.basis.samples(lpv.box)
    wide = Polynomial(degree, s.low - reach, s.high + reach)
    given = (
        Scheduling(s.name + LAGGED, s.unit, s.low, s.high, rate=s.name + LAG_RATE),
        Scheduling(s.name + LAG_RATE, per_second(s.unit), -s.rate, s.rate, 2 * s.rate / seconds),
    )
    box = [(q.low, q.high) for q in given]
    nodes = interpolation_points([degree, degree], box)
    basis = polynomials([degree, degree], box)

    def over_both(M: np.ndarray) -> np.ndarray:
        extended = wide.fit(own, np.tensordot(lpv.basis(own), M, axes=1))
        p = np.clip(nodes @ [1.0, seconds], wide.low, wide.high)
        return basis.fit(nodes, np.tensordot(wide(p), extended, axes=1))

    A, B, C, D = (over_both(M) for M in (lpv.A, lpv.B, lpv.C, lpv.D))
    return LPVStateSpace(basis, A, B, C, D, given, lpv.states, lpv.inputs, lpv.outputs, lpv.dt)
