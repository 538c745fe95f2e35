"""Robust output feedback, discrete time, of Schwenkel et al. (2025): two constant parameters.

Source: example2.m of the authors; published gain of their design between 37.46092 and 37.46863,
`musyn` of MATLAB 37.65.
"""

import numpy as np

from symheli import LFT, LinearModel, Scheduling
from symheli.lpv import connect

A = np.array([[0.6, 0.2], [-0.1, -0.3]])
B = np.array([[0.2, 0.2, 3, 2, 1, 0], [0.3, -0.2, 3, 1, 2, 0.2]])
C = np.array([[0.2, -0.3], [0.8, 0.5], [2, 1], [2, 3], [1, 0]])
D = np.array(
    [
        [0.4, 0.3, 3, 1, 0, 0],
        [-0.6, 0.1, 2, 7, 0, 0.1],
        [1, 2, 1, -2, 4, 0],
        [-1, 4, -4, 3, 0, 0],
        [0, 0, 0.1, 0.2, 0, 0],
    ]
)
RANGES = ((-0.1, 0.5), (-0.3, 0.6))
PUBLISHED = 37.46863


def plant():
    """The LFT from (w1, w2, u1, u2) to (z1, z2, y)."""
    names = ["p1", "p2", "w1", "w2", "u1", "u2"], ["q1", "q2", "z1", "z2", "y"]
    model = LinearModel(A, B, C, D, ["x1", "x2"], *names, 1.0)
    deltas = [
        LFT.parameter(Scheduling(f"d{k}", "1", *ends), f"q{k}", f"p{k}", 1.0)
        for k, ends in enumerate(RANGES, 1)
    ]
    return connect(model, *deltas, inputs=names[0][2:], outputs=names[1][2:])


def frozen_gain(K, delta, omega):
    """The largest gain at frequencies of the loop of u = K(z) y, written without the package: the
    equations of plant, parameters and controller are solved at each frequency.
    """
    worst = 0.0
    for z in np.exp(1j * omega):
        G = C @ np.linalg.solve(z * np.eye(2) - A, B) + D
        k = K.C @ np.linalg.solve(z * np.eye(len(K.A)) - K.A, K.B) + K.D
        close = np.zeros((4, 3), complex)
        close[:2, :2], close[2:, 2:] = np.diag(delta), k
        into, out, rows, columns = [0, 1, 4, 5], [0, 1, 4], [2, 3], [2, 3]
        through = np.linalg.solve(np.eye(4) - close @ G[np.ix_(out, into)], close)
        T = G[np.ix_(rows, columns)]
        T = T + G[np.ix_(rows, into)] @ through @ G[np.ix_(out, columns)]
        worst = max(worst, np.linalg.norm(T, 2))
    return worst
