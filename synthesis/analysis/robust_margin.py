"""How many times the stated uncertainty a model bears: a parameter and a block grown together."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace, Polynomial, Scheduling, UncertainStateSpace
from synthesis.analysis.questions import stability
from synthesis.worst.frozen import frozen_gain

SHARES = (0.9995, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9, 0.75, 0.5)
"""Parts of the upper bound for which a proof is tried, in turn."""
MIN_SCALE = 1e-6
"""A model that does not bear this part of its uncertainty counts as unstable without any."""
ACCURACY = 1e-6
"""Relative accuracy of the upper bound."""
POINTS = 21
"""Values of the parameter whose highest peaks are climbed."""


class RobustMargin(NamedTuple):
    """`lower` times the stated uncertainty is proven to be borne, `upper` times it is not: there a
    stable perturbation of that norm makes the model with the parameter at `p` oscillate at `omega`
    (rad/s; NaN where the model at p is unstable without any).
    """

    lower: float
    upper: float
    p: float
    omega: float


def robust_margin(model: UncertainStateSpace, *, largest: float = 10.0) -> RobustMargin:
    """Compute the factor by which the range of a constant parameter about its middle, and the bound
    of a block of any dynamics, may grow together before a model of the set is unstable.

    The upper bound is attained: it is the factor r at which r bound |M_p| = 1 for the worst p of
    the range grown by r, M_p from the inputs of the block to its outputs. The lower one is proven
    by `stability` for that set.

    Parameters
    ----------
    model : UncertainStateSpace
        The loop, continuous or sampled, polynomial in its one parameter, whose range is grown about
        its middle.
    largest : float
        No larger factor is looked for.

    Returns
    -------
    RobustMargin
        With `upper` inf where the factor `largest` is borne.

    Raises
    ------
    InputError
        Several parameters, other functions of it, a bound of zero.

    References
    ----------
    `robstab` of MATLAB; Zhou, Doyle and Glover, Robust and Optimal Control (1996), ch. 9 and 11.

    Examples
    --------
    x' = -(1 - delta) x - k x with |delta| <= 1/2 and k = 1 within 1/2: 2 = r/2 + r/2:

    >>> from symheli.lpv import LPVStateSpace, Scheduling, UncertainStateSpace
    >>> k = Scheduling("k", "1", 0.5, 1.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], k)
    >>> found = robust_margin(UncertainStateSpace(lag, ["u1"], ["y1"], 0.5, 1.0, "an example"))
    >>> bool(1.98 < found.lower <= 2.0), round(found.upper, 4)
    (True, 2.0)
    """
    if not isinstance(model, UncertainStateSpace):
        raise InputError(f"expected an UncertainStateSpace, got {type(model).__name__}")
    if not isinstance(model.model.basis, Polynomial):
        raise InputError("expected a model that is polynomial in one parameter, which is grown")
    if not (model.bound > 0 and largest > MIN_SCALE):
        raise InputError("expected a block with a bound > 0 and a largest factor > 0")
    block = model.model.select(inputs=model.perturbation_inputs, outputs=model.perturbation_outputs)

    def excess(r: float) -> float:
        """1 where no model is lost, 0 at the margin, below it beyond."""
        return 1 - min(r * model.bound * frozen_gain(_grown(block, r), points=POINTS).gain, 2.0)

    if excess(MIN_SCALE) <= 0:
        return _at(block, 0.0, MIN_SCALE)
    borne = excess(largest) >= 0
    upper = largest if borne else float(brentq(excess, MIN_SCALE, largest, rtol=ACCURACY))  # type: ignore[arg-type]
    for share in (1.0 if borne else SHARES[0], *SHARES[1:]):
        r = share * upper
        grown = replace(model, model=_grown(model.model, r), bound=r * model.bound)
        if stability(grown, 0.0, search=None).verified:
            break
    else:
        r = 0.0
    found = _at(block, r, upper)
    return found._replace(upper=float("inf")) if borne else found


def _at(block: LPVStateSpace, lower: float, upper: float) -> RobustMargin:
    worst = frozen_gain(_grown(block, upper))
    return RobustMargin(lower, upper, worst.p, worst.omega)


def _grown(lpv: LPVStateSpace, r: float) -> LPVStateSpace:
    """The same polynomials over a range that is r times as wide."""
    s, basis = lpv.scheduling, lpv.basis
    assert isinstance(basis, Polynomial)  # noqa: S101 - checked before
    wide = Scheduling(s.name, s.unit, s.middle - r * s.radius, s.middle + r * s.radius, 0.0)
    # x from -1 to 1 over the old range becomes `factor` times that over the new one
    middle, radius = 0.5 * (basis.low + basis.high), 0.5 * (basis.high - basis.low)
    reach = max(wide.high - middle, middle - wide.low)
    wider = Polynomial(basis.degree, middle - reach, middle + reach)
    powers = (reach / radius) ** np.arange(basis.size)

    def same(M: np.ndarray) -> np.ndarray:
        scaled = np.tensordot(basis.form("scaled").T, M, axes=1)
        return wider.from_scaled(powers[:, None, None] * scaled)

    A, B, C, D = (same(M) for M in (lpv.A, lpv.B, lpv.C, lpv.D))
    names = lpv.states, lpv.inputs, lpv.outputs
    return LPVStateSpace(wider, A, B, C, D, (wide,), *names, lpv.dt)
