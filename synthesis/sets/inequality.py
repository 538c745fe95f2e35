"""The inequalities of an invariant ellipsoid x' Q(p)^-1 x <= 1 of an LPV model with u = K(p) x.

With Y = K Q they are affine in Q and Y. For disturbances |w_i| <= 1 (W has their amplitudes) and
dQ/dt = sum_i nu_i dQ/dp_i at every corner nu of the box of rates:

    [dQ/dt - alpha Q - (A Q + B Y) - (A Q + B Y)'   -W; .   diag(tau)] > 0,  sum tau <= alpha

since V = x' Q^-1 x then falls where V > 1: dV/dt < -alpha V + sum tau_i w_i^2. Sampled, with Q+ =
Q(p(k+1)):

    [(1 - alpha) Q   0   (A Q + B Y)'; .   diag(tau)   W'; .   .   Q+] > 0,  sum tau <= alpha

and V+ < (1 - alpha) V + sum tau_i w_i^2. A limit |c x + d u| <= b holds in the ellipsoid where

    [Q   (c Q + d Y)'; .   b^2] > 0

Source: Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and Control
Theory" (1994), sections 5.2, 6.1 and 7.2; Blanchini, "Set invariance in control", Automatica 35
(1999).

Each function returns the lower triangle of one of them, for values at points and for polynomials
alike; a block on the diagonal stands for its symmetric part.
"""

from __future__ import annotations

from typing import Any

Lower = list[list[Any]]


def decrease(motion: Any, Q: Any, slope: Any, Wt: Any, shares: Any, alpha: Any) -> Lower:
    """The inequality in continuous time; `motion` is A Q + B Y, `slope` dQ/dt, Wt is W'."""
    top = slope - Q * alpha - motion * 2
    return [[top], [-Wt, shares]] if Wt.shape[-2] else [[top]]


def decrease_sampled(
    motion: Any, Q: Any, after: Any, W: Any, shares: Any, alpha: Any, none: Any
) -> Lower:
    """The inequality in discrete time; `after` is Q+, `none` the zero matrix of the shape of W'."""
    top = Q * (1 - alpha)
    if not W.shape[-1]:
        return [[top], [motion, after]]
    return [[top], [none, shares], [motion, W, after]]


def within(row: Any, Q: Any, square: Any) -> Lower:
    """A limit: `row` is c Q + d Y, `square` b^2."""
    return [[Q], [row, square]]
