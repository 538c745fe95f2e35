"""LPV models the tests share."""

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from synthesis.certify.questions.certify import route
from synthesis.certify.questions.problem import pose


def lag(rate=1.0):
    """dx/dt = -(1 + p) x + u, y = x, p in [0, 1]: gain 1 at any rate (constant P = 1 proves it, p =
    0 attains it).
    """
    return LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0, rate)
    )


def spring(rate=0.02, damping=0.05, change=0.6):
    """x'' + 2 d x' + (1 + change p) x = u, p in [-1, 1]: frozen stable, pumped up when p switches
    every quarter period.
    """
    A = [[[0, 1], [-1, -2 * damping]], [[0, 0], [-change, 0]]]
    return LPVStateSpace.polynomial(
        A, [[[0.0], [1]]], [[[1.0, 0]]], [[[0.0]]], Scheduling("p", "1", -1.0, 1.0, rate)
    )


def fastest_growth(damping, change):
    """Largest growth rate of x'' + 2 d x' + (1 + c p) x = 0 over every p(t) in [-1, 1], by the
    angle of (x, x').

    Where r' = r f(angle, p), angle' = -g(angle, p), the best rate is the one at which the integral
    over half a turn of max_p (f - rate)/g vanishes.
    """
    angle = (np.arange(4000) + 0.5) * np.pi / 4000
    c, s = np.cos(angle), np.sin(angle)
    k = np.array([[1 - change], [1 + change]])
    f, g = s * c * (1 - k) - 2 * damping * s**2, s**2 + k * c**2 + 2 * damping * s * c
    return brentq(lambda rate: ((f - rate) / g).max(axis=0).sum(), -1.0, 1.0)


def constant(A, B, C, D, dt=None):
    """A time-invariant model in LPV clothes."""
    return LPVStateSpace.polynomial([A], [B], [C], [D], Scheduling("p", "1", 0.0, 1.0, 0.5), dt=dt)


def uncertain_pole(pole, bound, dt=None):
    """dx/dt = (pole + delta) x + u, y = x, |delta| <= bound, whatever p is; or x(k+1)."""
    model = LPVStateSpace.polynomial(
        *([[[pole]]], [[[1.0, 1.0]]], [[[1.0], [1.0]]], [np.zeros((2, 2))]),
        *(Scheduling("p", "1", 0.0, 1.0, 0.5), dt, ["x"], ["u", "d"], ["y", "v"]),
    )
    return UncertainStateSpace(model, "d", "v", bound, 0.95, "a pole read off a plot")


def random_uncertain(seed, bound, dt=None):
    """`random_stable` with a full block (2, 3) that all states and inputs feed, E and G moving with
    p.
    """
    rng = np.random.default_rng(seed + 100)
    lpv = random_stable(seed, dt=dt)
    n, nx = lpv.basis.size, len(lpv.states)
    slow = 1.0 if dt is None else dt

    def moving(*shape):
        return (
            0.3 * rng.standard_normal((n, *shape)) * np.r_[1.0, np.full(n - 1, 0.3)][:, None, None]
        )

    E, G = slow * moving(nx, 2), moving(3, nx)
    out = np.concatenate([lpv.D, 0.3 * moving(3, 2)], axis=1)
    model = replace(
        lpv,
        B=np.concatenate([lpv.B, E], axis=2),
        C=np.concatenate([lpv.C, G], axis=1),
        D=np.concatenate([out, np.zeros((n, 5, 2))], axis=2),
        inputs=(*lpv.inputs, "d1", "d2"),
        outputs=(*lpv.outputs, "v1", "v2", "v3"),
    )
    return UncertainStateSpace(model, ["d1", "d2"], ["v1", "v2", "v3"], bound, 1.0, "by choice")


def random_stable(seed, states=3, degree=2, dt=None, rate=0.3):
    """Random polynomial model, 2 inputs, 2 outputs: every frozen model has its poles shifted well
    inside.
    """
    rng = np.random.default_rng(seed)
    A = [
        rng.standard_normal((states, states)) * (1.0 if i == 0 else 0.4) for i in range(degree + 1)
    ]
    grid = np.linspace(0, 1, 51)
    worst = max(np.linalg.eigvals(sum(p**i * M for i, M in enumerate(A))).real.max() for p in grid)
    A[0] = A[0] - (worst + 0.4) * np.eye(states)
    if dt is not None:
        A = [np.eye(states) + dt * A[0], *(dt * M for M in A[1:])]
    B = [
        rng.standard_normal((states, 2)) * (1 if dt is None else dt),
        0.3 * rng.standard_normal((states, 2)) * (1 if dt is None else dt),
    ]
    C = [rng.standard_normal((2, states))]
    D = [0.1 * rng.standard_normal((2, 2))]
    return LPVStateSpace.polynomial(A, B, C, D, Scheduling("p", "1", 0.0, 1.0, rate), dt=dt)


def lateral():
    """Lateral helicopter motion v p r phi b1 with attitude hold, gust v_w to (r, phi), 0-13 m/s,
    cubic in airspeed.

    Rounded from a linearised 8 kg helicopter: Dutch roll from 1.5 rad/s near hover to 5 rad/s, slow
    modes barely damped.
    """
    V = np.linspace(0.0, 13.0, 14)
    x = V / 13.0
    k = np.zeros((14, 5, 5))
    k[:, 0, 0], k[:, 0, 1], k[:, 0, 2], k[:, 0, 3], k[:, 0, 4] = (
        -0.11 - 0.19 * x,
        -0.1 * x,
        -12.8 * x,
        9.77,
        10.0 + 0.3 * x,
    )
    k[:, 1, 0], k[:, 1, 1], k[:, 1, 2], k[:, 1, 4] = (
        -0.15 - 0.17 * x,
        -0.011 - 0.007 * x,
        0.135 + 0.16 * x,
        407 + 3 * x,
    )
    k[:, 2, 0], k[:, 2, 1], k[:, 2, 2] = 0.81 + x**1.5, 0.06 + 0.04 * x, -0.73 - 0.9 * x
    k[:, 3, 1], k[:, 3, 2] = 1.0, -0.12 * x
    k[:, 4, 0], k[:, 4, 1], k[:, 4, 3], k[:, 4, 4] = -0.0026, -1.0, -0.02 * 8.35 * 4.2, -8.35
    B = -k[:, :, :1] * np.array([1, 1, 1, 0, 1.0])[:, None]
    powers = np.linalg.lstsq(
        np.vander(V, 4, increasing=True), np.concatenate([k, B], 2).reshape(14, -1), rcond=None
    )[0].reshape(4, 5, 6)
    return LPVStateSpace.polynomial(
        list(powers[:, :, :5]),
        list(powers[:, :, 5:]),
        [np.eye(5)[[2, 3]]],
        [np.zeros((2, 1))],
        Scheduling("airspeed", "m/s", 0.0, 13.0, 1.0),
        states=["v", "p", "r", "phi", "b1"],
        inputs=["v_w"],
        outputs=["r", "phi"],
    )


def forged(cert, **parts):
    """The certificate with other parts of its proof: `evidence`, `lyapunov`."""
    return replace(cert, proof=cert.proof._replace(**parts))


def searched(model, rate, kind, form=None, impose=None, solver="CLARABEL"):
    """What the search for a proof finds without the look at frozen poles."""
    return route(pose(model, rate, kind, form, impose, solver, None)).search(math.inf)
