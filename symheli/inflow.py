"""Induced velocity of a rotor: blade-element thrust balanced with momentum flow (Glauert's hypothesis)."""

from __future__ import annotations

from typing import Any

from symheli.symbolic import absolute, clip, maximum, minimum, sqrt, where

NEWTON_STEPS = 6
"""Steps taken from the bracketing start; the residual is below 1e-14 outside `vortex_ring` (see tests)."""

_ROOT_GUARD = 1e-20  # added under the root: its derivative stays finite without flow, its value moves by 1e-10


def thrust_line(pitch: Any, mu2: Any, mu_z: Any, lift_slope: Any, solidity: Any) -> tuple[Any, Any]:
    """(c0, c1) of the unlimited thrust coefficient C_T = c0 - c1 lam0, dimensionless.

        C_T = (a sigma/2) [ pitch (1/3 + mu^2/2) + (mu_z - lam0)/2 ]

    pitch in rad, lift_slope in 1/rad. Source: G15, main rotor thrust.
    """
    half = 0.5 * lift_slope * solidity
    return half * (pitch * (1 / 3 + 0.5 * mu2) + 0.5 * mu_z), 0.5 * half


def thrust_coefficient(lam0: Any, c0: Any, c1: Any, ct_max: Any) -> Any:
    """C_T = c0 - c1 lam0 limited to +-ct_max (blade stall); a tie is not limited."""
    return clip(c0 - c1 * lam0, -ct_max, ct_max)


def newton_step(lam0: Any, c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """One full Newton step on 2 eta_w lam0 sqrt(mu^2 + (lam0 - mu_z)^2) = C_T(lam0).

    From a root it returns the root, and its derivatives with respect to the other arguments are those of the root
    (implicit function theorem): this is how derivatives are taken, exactly, through the solved inflow.
    """
    root = sqrt(mu2 + (lam0 - mu_z) ** 2 + _ROOT_GUARD)
    line = c0 - c1 * lam0
    residual = 2 * efficiency * lam0 * root - clip(line, -ct_max, ct_max)
    slope = 2 * efficiency * (root + lam0 * (lam0 - mu_z) / root) + where(absolute(line) <= ct_max, c1, 0.0)
    # in a vortex ring the slope may vanish; a floor keeps the step finite there
    slope = where(absolute(slope) > 1e-6, slope, 1e-6)
    return lam0 - residual / slope


def solve(c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """Inflow ratio lam0 (dimensionless, of the tip speed) on the branch continued from hover.

    The start is an upper bound: the smaller of the axial-flow root (exact for mu = 0) and C_T/(2 eta_w mu); on the
    branch above mu_z the equation is convex, so Newton descends to the root monotonically; below it, steps are kept
    between 0 and the start. Negative thrust is the mirror image.
    """
    sign = where(c0 >= 0, 1.0, -1.0)
    drive, flow = sign * c0, sign * mu_z
    below, through = maximum(flow, 0.0), absolute(flow)
    b = 2 * efficiency * through + c1
    limited = minimum(drive, ct_max + c1 * below)  # the unlimited line, cut where the stall limit is already reached
    rest = maximum(limited - c1 * below, 0.0)
    axial = below + 2 * rest / (b + sqrt(b**2 + 8 * efficiency * rest))
    forward = drive / (2 * efficiency * sqrt(mu2 + _ROOT_GUARD) + c1)
    stalled = below + sqrt(ct_max / (2 * efficiency))
    top = minimum(minimum(axial, forward), stalled)
    top = where(drive - c1 * top > ct_max, stalled, top)
    lam = top
    for _ in range(NEWTON_STEPS):
        lam = clip(newton_step(lam, drive, c1, ct_max, mu2, flow, efficiency), 0.0, maximum(stalled, top))
    return sign * lam


def vortex_ring(lam_hover: Any, mu2: Any, mu_z: Any) -> Any:
    """Positive where momentum theory promises nothing: descending by more than half the hover inflow at little forward speed.

    `lam_hover` = sqrt(|C_T|/(2 eta_w)); covers every state with several inflow roots. Source: Leishman,
    Principles of Helicopter Aerodynamics (2006), section 2.13; the multiple-root bound mu < mu_z/sqrt(8) is derived here.
    """
    edge = maximum(lam_hover, 0.36 * mu_z)
    return minimum(mu_z - 0.5 * lam_hover, edge - sqrt(mu2 + _ROOT_GUARD))
