"""Plants of published scheduled designs, weighted as their sources weight them."""

import math

import numpy as np

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.lpv.bases.polynomials import interpolation_points, polynomials
from synthesis import Plant

DEGREE = 10
"""Of the polynomials in place of sine and cosine: over a whole turn within 2e-5 of them."""


def weight(b1, b0, a1, a0):
    """(b1 s + b0)/(a1 s + a0)."""
    pole, direct = -a0 / a1, b1 / a1
    return LinearModel(
        [[pole]], [[1.0]], [[b0 / a1 + pole * direct]], [[direct]], ["x"], ["in"], ["out"]
    )


def spinning_disks(rate):
    """Two masses in the slots of spinning disks, coupled by a spring; the second follows a command.

    The parameters are the speeds of the disks squared, rad^2/s^2, each with this `rate` per second.
    Source: Wu, Control of Linear Parameter Varying Systems, Ph.D. thesis, Berkeley (1995).
    """
    return disks(rate, weight(0.3, 1.2, 1.0, 0.04), weight(1.0, 0.1, 0.01, 125.0))


def disks(rate, error, command):
    """The disks with these weights of the tracking error and the command."""
    m1, m2, spring, damping, disturbed = 1.0, 0.5, 200.0, 1.0, 0.1
    A = {(0, 0): np.zeros((4, 4)), (1, 0): np.zeros((4, 4)), (0, 1): np.zeros((4, 4))}
    A[0, 0][:2, 2:] = np.eye(2)
    A[0, 0][2:, :2] = spring * np.array([[-1 / m1, 1 / m1], [1 / m2, -1 / m2]])
    A[0, 0][2:, 2:] = -damping * np.diag([1 / m1, 1 / m2])
    A[1, 0][2, 0] = A[0, 1][3, 1] = 1.0
    B = np.zeros((4, 5))  # force, forces that disturb, noise, reference
    B[2:, :3] = [[1 / m1, disturbed / m1, 0], [0, 0, disturbed / m2]]
    C, D = np.zeros((4, 4)), np.zeros((4, 5))
    C[:2, 1] = 1.0
    D[0, 4], D[1, 3], D[2, 4], D[3, 0] = -1.0, 1.0, 1.0, 1.0
    model = LPVStateSpace.polynomial(
        A,
        *({(0, 0): M} for M in (B, C, D)),
        [
            Scheduling(name, "rad^2/s^2", 0.0, high, rate=rate)
            for name, high in (("rho1", 9.0), ("rho2", 25.0))
        ],
        states=["r1", "r2", "v1", "v2"],
        inputs=["u", "d1", "d2", "noise", "reference"],
        outputs=["error", "position", "command", "force"],
    )
    plant = Plant(
        model,
        disturbances=["d1", "d2", "noise", "reference"],
        performance=["error", "force", "u"],
        controls=["u"],
        measurements=["command", "position"],
    )
    return plant.with_servo({"u": weight(0.0, 1.0, 0.01, 1.0)}).weighted(
        {
            "error": error,
            "force": 1e-5,
            "u": command,
            "noise": weight(1.0, 0.4, 0.01, 400.0),
        }
    )


def wu_1996(rate, half=math.pi):
    """Two unstable states turned by an angle rho against their two actuators; both follow commands.

    rho in [-half, half] rad moves by `rate` rad/s. Source: Wu, Yang, Packard and Becker, Int. J.
    Robust and Nonlinear Control 6 (1996), with polynomials in place of sine and cosine.
    """
    rho = Scheduling("rho", "rad", -half, half, rate=rate)
    nodes = interpolation_points([DEGREE], [(rho.low, rho.high)])
    basis = polynomials([DEGREE], [(rho.low, rho.high)])
    A = np.zeros((len(nodes), 4, 4))
    A[:, :2, :2] = [[0.75, 2.0], [0.0, 0.5]]
    A[:, 0, 2] = A[:, 1, 3] = np.cos(nodes.ravel())
    A[:, 0, 3] = np.sin(nodes.ravel())
    A[:, 1, 2] = -np.sin(nodes.ravel())
    A[:, 2, 2] = A[:, 3, 3] = -10.0
    B = np.zeros((4, 7))  # force, references, noises, controls
    B[1, 0], B[2:, 5:] = 3.0, 10.0 * np.eye(2)
    C = np.vstack([np.eye(2, 4)] * 2)
    D = np.zeros((4, 7))
    D[:2, 1:3] = D[2:, 1:3] = -np.eye(2)
    D[2:, 3:5] = np.eye(2)

    def constant(M):
        return basis.fit(nodes, np.broadcast_to(M, (len(nodes), *M.shape)))

    model = LPVStateSpace(
        basis,
        basis.fit(nodes, A),
        *(constant(M) for M in (B, C, D)),
        (rho,),
        ("x1", "x2", "actuator1", "actuator2"),
        ("force", "r1", "r2", "n1", "n2", "u1", "u2"),
        ("error1", "error2", "y1", "y2"),
    )
    plant = Plant(
        model,
        disturbances=["force", "r1", "r2", "n1", "n2"],
        performance=["error1", "error2", "u1", "u2"],
        controls=["u1", "u2"],
        measurements=["y1", "y2"],
    )
    follow, noise = weight(0.0, 20.0, 1.0, 0.2), weight(10.0, 100.0, 1.0, 1000.0)
    return plant.weighted(
        {"r1": follow, "r2": follow, "n1": noise, "n2": noise, "u1": 1 / 280, "u2": 1 / 280}
    )


def first_order_lag(pole, gain, output, parameters):
    """x' = -pole x + gain (Wu + u), y = output x, which follows a command r and is disturbed by d.

    `pole`, `gain` and `output` map exponents of the parameters to coefficients. The error r - y is
    weighted by We = (s + 25)/(5 s + 5), the disturbed control u + d/10 by
    Wu = (10 s + 10)/(s + 100). Source: the pages on LFT models and on conversions between grids
    and LFTs of LPVTools' documentation.
    """
    A, B, C = {}, {}, {}

    def entry(matrices, shape, place, polynomial, sign=1.0):
        for exponents, coefficient in polynomial.items():
            matrices.setdefault(exponents, np.zeros(shape))[place] += sign * coefficient

    one = {(0,) * len(parameters): 1.0}
    # states x, of We, of Wu; inputs r, d, u; outputs We, Wu, r - y
    wu = {"state": -990.0, "direct": 10.0}
    entry(A, (3, 3), (0, 0), pole, -1.0)
    entry(A, (3, 3), (0, 2), gain, wu["state"])
    entry(A, (3, 3), (1, 0), output, -1.0)
    entry(A, (3, 3), (1, 1), one, -1.0)
    entry(A, (3, 3), (2, 2), one, -100.0)
    entry(B, (3, 3), (0, 1), gain, 0.1 * wu["direct"])
    entry(B, (3, 3), (0, 2), gain, wu["direct"] + 1.0)
    entry(B, (3, 3), (1, 0), one)
    entry(B, (3, 3), (2, 1), one, 0.1)
    entry(B, (3, 3), (2, 2), one)
    entry(C, (3, 3), (0, 0), output, -0.2)
    entry(C, (3, 3), (0, 1), one, 4.8)
    entry(C, (3, 3), (1, 2), one, wu["state"])
    entry(C, (3, 3), (2, 0), output, -1.0)
    D = {(0,) * len(parameters): np.array([[0.2, 0, 0], [0, 1.0, 10.0], [1.0, 0, 0]])}
    model = LPVStateSpace.polynomial(
        A,
        B,
        C,
        D,
        list(parameters),
        states=["x", "we", "wu"],
        inputs=["r", "d", "u"],
        outputs=["error", "effort", "measured"],
    )
    return Plant(
        model,
        disturbances=["r", "d"],
        performance=["error", "effort"],
        controls=["u"],
        measurements=["measured"],
    )


def lft_tutorial(rate):
    """x' = rho (u - x), y = x, for rho in [1, 10] 1/s moving by `rate` a second."""
    rho = Scheduling("rho", "1/s", 1.0, 10.0, rate=rate)
    return first_order_lag({(1,): 1.0}, {(1,): 1.0}, {(0,): 1.0}, [rho])


def grid_to_lft(rate):
    """x' = -rho1 x + rho2 u, y = rho1 rho2 x, for rho1 in [1, 10], rho2 in [1, 3]."""
    rho = [
        Scheduling("rho1", "1/s", 1.0, 10.0, rate=rate),
        Scheduling("rho2", "1/s", 1.0, 3.0, rate=rate),
    ]
    return first_order_lag({(1, 0): 1.0}, {(0, 1): 1.0}, {(1, 1): 1.0}, rho)


def noisy_spinning_disks(rate):
    """The spinning disks with a strictly proper weight of the error, for the least variance in
    white noise.

    The parameters are those of `spinning_disks`. Source: the page on stochastic LPV systems of
    LPVTools' documentation, after Wu, Ph.D. thesis, Berkeley (1995).
    """
    return disks(rate, weight(0.0, 2.0, 1.0, 0.04), 1 / 50)
