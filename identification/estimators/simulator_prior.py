"""Prior of coefficients from a simulated flight, as wide as the measured flights say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.structure.lpvarx import LPVARX
from symheli.values.arrays import Array

ROUNDS = 100
"""Number of updates of the variances a Gauss-Newton step, at most."""

CLOSE = 0.01
"""Relative change of the variances that ends them: coefficients move by less than that, of their
standard deviations.
"""

LEAST = 1e-4
"""Least variance of a departure, in squares of the size of a coefficient: no simulator is believed
beyond a hundredth.
"""

LARGEST = 1e6
"""Largest: a group counts for nothing."""


class Simulated(NamedTuple):
    """Coefficients (n, ny) of simulated flights, and the root mean squares of regressors (n,) and
    outputs (ny,).
    """

    theta: Array
    regressors: Array
    outputs: Array


@dataclass(eq=False)
class SimulatorPrior:
    """Unknowns (m,) are normally distributed about a `mean`, independent of each other: those of a
    group with one variance, which is estimated (empirical Bayes, the maximum of the marginal
    likelihood).

    A group is what one signal at one lag does in one equation: where the simulator is right there,
    its functions of p are taken over, and where the flights contradict it, it counts for nothing.
    The functions of an offset are free: trims are not dynamics.

    Parameters
    ----------
    mean, size : array (m,)
        In units of the unknowns; a departure counts in `size`.
    group : array (m,)
        Number of each unknown's group; -1: its variance is infinite, -2: it is `size` squared.
    variance : array (groups,)
        Of departures from the mean, in squares of their size.

    References
    ----------
    MacKay (1992), Bayesian interpolation, Neural Computation 4, eq. 4.9 for the update.
    """

    mean: Array
    size: Array
    group: Array
    variance: Array

    @classmethod
    def of(
        cls, arx: LPVARX, simulated: Simulated, unknown: int, *, believed: bool
    ) -> SimulatorPrior:
        """About the coefficients of a simulated flight, equation by equation, or where it is not
        `believed` of infinite variance; then `unknown` others about 0 with variance 1.
        """
        regressors, outputs = (np.where(s > 0, s, 1.0) for s in simulated[1:])
        free = np.array([not believed or e.kind in ("offset", "increment") for e in arx.entries])
        entry = np.cumsum(~free) - 1
        count = int(entry[-1]) + 1
        of_one = np.repeat(np.where(free, -1, entry), arx.basis.size)
        groups = [np.where(of_one < 0, -1, of_one + count * y) for y in range(arx.ny)]
        return cls(
            np.append(simulated.theta.T.reshape(-1), np.zeros(unknown)),
            np.append((outputs[:, None] / regressors).reshape(-1), np.ones(unknown)),
            np.concatenate([*groups, np.full(unknown, -2)]),
            np.ones(count * arx.ny),
        )

    def precision(self) -> Array:
        """(m,) the inverse variance of each unknown, in its unit."""
        inverse = np.append(1.0 / self.variance, [1.0, 0.0])
        return inverse[self.group] / self.size**2

    def learn(self, normal: Array, right: Array, at: Array) -> None:
        """Move the variances towards the largest marginal likelihood of data whose normal equations
        about the unknowns `at` (m,) are normal (m, m) and right (m,).
        """
        if not len(self.variance):
            return
        scaled = normal * np.outer(self.size, self.size)
        pulled = self.size * (right + normal @ (at - self.mean))
        inside = self.group >= 0
        for _ in range(ROUNDS):
            before, own = self.variance, self.precision() * self.size**2
            covariance = np.linalg.inv(scaled + np.diag(own))
            squares, told = (covariance @ pulled) ** 2, 1.0 - own * np.diag(covariance)
            sums, count = (
                np.bincount(self.group[inside], v[inside], len(before)) for v in (squares, told)
            )
            found = sums / np.maximum(count, np.finfo(float).tiny)
            self.variance = np.clip(found, LEAST, LARGEST)
            if np.all(np.abs(np.log(self.variance / before)) < CLOSE):
                break
