"""The model in 50 digits, by a route of its own: implicit form, inflow by mpmath's root finder,
derivatives by differences.
"""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np

from symheli.equations import evaluate
from symheli.values.tape import Tape

DIGITS = 50
STEP = mpmath.mpf(10) ** -20
"""Of differences: truncation 1e-40, rounding 1e-30, both times derivatives of the order of 1e4."""


class Exact:
    """xdot and its derivatives of `heli` (Euler form) as mpmath numbers; arguments (x, u, wind) in
    one list.
    """

    def __init__(self, heli):
        self.heli, self.tape = heli, Tape.of(heli.implicit)
        self.sizes = [rows for rows, _ in self.tape.sizes_in[:3]]
        self.rotors = self.tape.sizes_in[3][0]

    def implicit(self, z, lam):
        """(xdot, balance) with the inflow ratios given."""
        parts = [z[a:b] for a, b in pairwise(np.cumsum([0, *self.sizes]))]
        xdot, balance = evaluate(self.tape, *parts, lam, digits=DIGITS)
        return list(xdot), list(balance)

    def inflow(self, z, start):
        """Root of each momentum balance, one after the other: a rotor's balance knows the rotors
        before it.
        """
        lam = [mpmath.mpf(s) for s in start]
        for i in range(self.rotors):

            def balance(value, i=i):
                return self.implicit(z, [*lam[:i], value, *lam[i + 1 :]])[1][i]

            lam[i] = mpmath.findroot(
                balance,
                (lam[i], lam[i] * mpmath.mpf("1.01")),
                solver="secant",
                tol=mpmath.mpf(10) ** -90,
            )
        return lam

    def near(self, z, lam, slope):
        """xdot at a point 1e-20 away from one with inflow `lam`: two chord steps, of which the
        first leaves 1e-40.
        """
        for _ in range(2):
            xdot, balance = self.implicit(z, lam)
            if max(abs(b) for b in balance) < mpmath.mpf(10) ** -45:
                return xdot
            lam = [
                a - c
                for a, c in zip(lam, mpmath.lu_solve(slope, mpmath.matrix(balance)), strict=True)
            ]
        xdot, balance = self.implicit(z, lam)
        assert max(abs(b) for b in balance) < mpmath.mpf(10) ** -38
        return xdot

    def slope(self, z, lam):
        """d balance/d lam."""
        S = mpmath.matrix(self.rotors)
        for j in range(self.rotors):
            up, down = (
                [value + sign * STEP * (i == j) for i, value in enumerate(lam)] for sign in (1, -1)
            )
            for i, (a, b) in enumerate(
                zip(self.implicit(z, up)[1], self.implicit(z, down)[1], strict=True)
            ):
                S[i, j] = (a - b) / (2 * STEP)
        return S

    def rhs(self, point, start):
        """xdot (nx,) as floats of the 50-digit numbers; `start`: inflow ratios to start from."""
        with mpmath.workdps(DIGITS):
            z = [mpmath.mpf(float(v)) for v in point]
            return np.array([float(v) for v in self.implicit(z, self.inflow(z, start))[0]])

    def jacobian(self, point, start, sides=(1, -1)):
        """d xdot/d(x, u, wind) (nx, nx + 7): central differences, or one-sided ones with sides (1,
        0) and (0, -1).
        """
        with mpmath.workdps(DIGITS):
            z = [mpmath.mpf(float(v)) for v in point]
            lam = self.inflow(z, start)
            slope = self.slope(z, lam)
            columns = []
            for j in range(len(z)):
                ends = [
                    self.near([v + side * STEP * (i == j) for i, v in enumerate(z)], lam, slope)
                    for side in sides
                ]
                columns.append(
                    [
                        float((a - b) / (STEP * (sides[0] - sides[1])))
                        for a, b in zip(*ends, strict=True)
                    ]
                )
            return np.array(columns).T
