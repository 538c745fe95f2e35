"""Induced velocity of a rotor: blade-element thrust balanced with momentum flow (Glauert's
hypothesis).
"""

from __future__ import annotations

from typing import Any

from symheli.codegen.symbolic import absolute, clip, maximum, minimum, sqrt, where

HALLEY_STEPS = 3
"""Steps taken from the bounding start; the residual is below 1e-16 outside `vortex_ring` (see
tests).
"""
RELAXATION, RELAXED_STEPS = 0.6, 40
"""Relaxation of the printed iteration; 0.4^40 is below rounding."""

STEP_TOLERANCE = 1e-7
"""Step of the inflow iteration at which it ends: the error is of the order of its cube."""

# added under the root: its derivative stays finite without flow, its value moves by 1e-10
_ROOT_GUARD = 1e-20
_TINY = 1e-60  # keeps a quotient finite where numerator and denominator vanish together


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


def momentum(lam0: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """Thrust coefficient that the momentum of the flow through the disc carries: 2 eta_w lam0
    sqrt(mu^2 + (lam0 - mu_z)^2).
    """
    return 2 * efficiency * lam0 * sqrt(mu2 + (lam0 - mu_z) ** 2 + _ROOT_GUARD)


def residual(lam0: Any, c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """Momentum less blade-element thrust coefficient, dimensionless: 0 where lam0 is the inflow
    ratio.
    """
    return momentum(lam0, mu2, mu_z, efficiency) - thrust_coefficient(lam0, c0, c1, ct_max)


def newton_step(
    lam0: Any, c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any
) -> Any:
    """One full Newton step on the `residual`.

    From a root it returns the root, and its derivatives with respect to the other arguments are
    those of the root (implicit function theorem): this is how derivatives are taken, exactly,
    through the solved inflow.
    """
    root = sqrt(mu2 + (lam0 - mu_z) ** 2 + _ROOT_GUARD)
    slope = 2 * efficiency * (root + lam0 * (lam0 - mu_z) / root) + where(
        absolute(c0 - c1 * lam0) <= ct_max, c1, 0.0
    )
    # in a vortex ring the slope may vanish; a floor keeps the step finite there
    slope = where(absolute(slope) > 1e-6, slope, 1e-6)
    return lam0 - residual(lam0, c0, c1, ct_max, mu2, mu_z, efficiency) / slope


def solve(c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """Inflow ratio lam0 (dimensionless, of the tip speed) on the branch continued from hover.

    Thrust is limited or it is not: the momentum balance at the corner lam = (c0 - C_Tmax)/c1 says
    which, so that a smooth equation is left. Its start is an upper bound: the smaller of the
    axial-flow root (exact for mu = 0) and C_T/(2 eta_w mu). Halley's steps (order 3, one root and
    one quotient each) stay between 0 and that bound until one is below `STEP_TOLERANCE`. Negative
    thrust is the mirror image.
    """
    drive, flow = absolute(c0), where(c0 >= 0, mu_z, -mu_z)
    mu2 = mu2 + _ROOT_GUARD
    excess = drive - ct_max
    balance = (
        4 * efficiency**2 * excess**2 * (c1**2 * mu2 + (excess - c1 * flow) ** 2)
        - (ct_max * c1**2) ** 2
    )
    stalled = minimum(excess, balance) > 0
    line0, line1 = where(stalled, ct_max, drive), where(stalled, 0.0, c1)
    below = maximum(flow, 0.0)
    b = 2 * efficiency * absolute(flow) + line1
    rest = maximum(line0 - line1 * below, 0.0)
    axial = below + 2 * rest / (b + sqrt(b**2 + _TINY + 8 * efficiency * rest))
    forward = line0 / (2 * efficiency * sqrt(mu2) + line1)
    previous = top = minimum(axial, forward)
    lam = clip(_halley_step(top, line0, line1, mu2, flow, efficiency), 0.0, top)
    for _ in range(HALLEY_STEPS - 1):
        settled = absolute(lam - previous) <= STEP_TOLERANCE
        following = clip(_halley_step(lam, line0, line1, mu2, flow, efficiency), 0.0, top)
        previous, lam = lam, where(settled, lam, following)
    return where(c0 >= 0, lam, -lam)


def _halley_step(lam: Any, line0: Any, line1: Any, mu2: Any, flow: Any, efficiency: Any) -> Any:
    """lam - 2 g g'/(2 g'^2 - g g'') for g = 2 eta_w lam root - (line0 - line1 lam), root =
    sqrt(mu^2 + (lam - mu_z)^2).

    Numerator and denominator are multiplied by root^4: g' root and g'' root^3 are polynomials in
    root. mu2 > 0.
    """
    axial = lam - flow
    square = mu2 + axial**2
    root = sqrt(square)
    residual = (2 * efficiency * lam * root - (line0 - line1 * lam)) * root
    slope = 2 * efficiency * (square + lam * axial) + line1 * root
    curvature = efficiency * (2 * axial * square + lam * mu2)
    denominator = slope**2 * square - residual * curvature
    # in a vortex ring it may vanish; the caller's bounds keep the step finite there
    return lam - residual * slope * square / where(
        absolute(denominator) > _TINY, denominator, _TINY
    )


def relaxed(c0: Any, c1: Any, ct_max: Any, mu2: Any, mu_z: Any, efficiency: Any) -> Any:
    """The printed iteration: lam0 + 0.6 h, from the hover inflow of the collective alone; the error
    falls by 0.4 a step.

        h = -(2 eta_w lam0 Lam^(1/2) - C_T) Lam
            / (2 eta_w Lam^(3/2) + (a sigma/4) Lam - C_T (mu_z - lam0))
        Lam = mu^2 + (lam0 - mu_z)^2

    a sigma/4 = c1 while the thrust is not limited, else 0. Source: G15, main rotor inflow; the
    printed option "relaxed_inflow".
    """
    lam = where(c0 >= 0, 1.0, -1.0) * sqrt(
        absolute(clip(c0, -ct_max, ct_max)) / (2 * efficiency) + _ROOT_GUARD
    )
    for _ in range(RELAXED_STEPS):
        ct = thrust_coefficient(lam, c0, c1, ct_max)
        square = mu2 + (lam - mu_z) ** 2 + _ROOT_GUARD
        slope = where(absolute(c0 - c1 * lam) <= ct_max, c1, 0.0)
        denominator = 2 * efficiency * square * sqrt(square) + slope * square - ct * (mu_z - lam)
        denominator = where(absolute(denominator) > _TINY, denominator, _TINY)
        lam = lam - RELAXATION * (momentum(lam, mu2, mu_z, efficiency) - ct) * square / denominator
    return lam


def vortex_ring(lam_hover: Any, mu2: Any, mu_z: Any) -> Any:
    """Return a function that is positive where momentum theory is invalid: descent at more than
    half the hover inflow at little forward speed.

    `lam_hover` = sqrt(|C_T|/(2 eta_w)); covers every state with several inflow roots. Source:
    Leishman, Principles of Helicopter Aerodynamics (2006), section 2.13; the multiple-root bound mu
    < mu_z/sqrt(8) is derived here.
    """
    edge = maximum(lam_hover, 0.36 * mu_z)
    return minimum(mu_z - 0.5 * lam_hover, edge - sqrt(mu2 + _ROOT_GUARD))
