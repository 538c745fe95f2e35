"""A plant in coordinates in which its synthesis has numbers of order one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.balancing import square_root
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import factors_of, interpolation_points
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.statement.scaling import model_scaling
from synthesis.design.lti.linear_quadratic import control_gains
from synthesis.design.plant.generalized import Generalized
from synthesis.numerics.program.bases import extreme_motions

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant

MatricesAt = Callable[[Array], Generalized]

POINTS = 9
"""Number of values of p, on the diagonal of its box, from which coordinates are computed."""
REGULARIZATION = 1e-6
"""Fraction of the mean eigenvalue added to a solution of a Riccati equation, so that states
without cost, or known exactly, have a scale too.
"""
MAX_DEGREE = 10
"""Highest degree in a parameter to which data on a cell are represented; the remainder is left to
the analysis of the closed loop.
"""
NEGLIGIBLE_COEFFICIENT = 1e-10
"""A Chebyshev coefficient below this fraction of the largest coefficient of its entry is rounding.
"""


@dataclass(frozen=True, eq=False)
class ScaledPlant:
    """x = right z (left = right^-1), time in units of `time` (s; 1 in discrete time), performance
    in units of `channel`, u = controls u~ and y~ = measurements y. `values` (n,): cost of each
    state by error of its estimate, falling; None where the coordinates are not balanced. The states
    after the first `states` are at rest: what follows them at once.
    """

    matrices: MatricesAt
    parameters: tuple[Scheduling, ...]
    basis: FunctionSpace
    dt: float | None
    left: Array
    right: Array
    time: float
    channel: float
    controls: Array
    measurements: Array
    values: Array | None = None
    states: int | None = None

    @classmethod
    def of(
        cls,
        matrices: MatricesAt,
        parameters: tuple[Scheduling, ...],
        basis: FunctionSpace,
        dt: float | None,
        channel: float = 1.0,
    ) -> ScaledPlant:
        """Balanced: in the mean over p the LQG controller's cost of a state and the error of its
        estimate are the same diagonal matrix (Jonckheere and Silverman 1983). X and Y of the
        inequalities are near the inverses of these two. A control of unit size is one that costs a
        unit of performance, a measurement of unit size has a unit of noise.

        Where neither Riccati equation has a solution, balanced between what drives and what shows
        the states.
        """
        low, high = np.array([(s.low, s.high) for s in parameters]).T
        line = low + np.linspace(0.0, 1.0, POINTS)[:, None] * (high - low)
        every = matrices(line)
        A, B1, B2, C1, C2, _, D12, D21, _ = every
        controls = 1.0 / _sizes(D12 / channel, axis=-2)
        measurements = 1.0 / _sizes(D21, axis=-1)
        B = np.concatenate([B1, B2 * controls], axis=-1)
        C = np.concatenate([C1 / channel, measurements[:, None] * C2], axis=-2)
        D = np.zeros((POINTS, C.shape[-2], B.shape[-1]))
        names = [
            tuple(f"{k}{i}" for i in range(n))
            for k, n in (("x", A.shape[-1]), ("u", B.shape[-1]), ("y", C.shape[-2]))
        ]
        middle = POINTS // 2
        model = LinearModel(A[middle], B[middle], C[middle], D[middle], *names, dt=dt)  # type: ignore[arg-type]
        scale = model_scaling(model, 1.0, Matrices(A, B, C, D))
        own = cls(
            matrices,
            parameters,
            basis,
            dt,
            scale.left,
            scale.right,
            scale.time,
            channel,
            controls,
            measurements,
        )
        T, values = _balancing(own.at(line), dt)
        if T is None:
            return own
        left, right = np.linalg.solve(T, own.left), own.right @ T
        return replace(own, left=left, right=right, values=values)

    def first(self, states: int) -> ScaledPlant:
        """Return the plant with the first so many states, the others at rest (singular
        perturbation), which keeps the response to slow signals.
        """
        return self if states >= len(self.left) else replace(self, states=states)

    def at(self, p: Array) -> Generalized:
        """Return the matrices (K, ..) at p (K, m)."""
        A, B1, B2, C1, C2, D11, D12, D21, D22 = self.matrices(p)
        root, L, R = np.sqrt(self.time), self.left, self.right
        u, y = self.controls, self.measurements[:, None]
        whole = Generalized(
            self.time * L @ A @ R,
            root * L @ B1,
            root * L @ B2 * u,
            root * C1 @ R / self.channel,
            root * y * C2 @ R,
            D11 / self.channel,
            D12 * u / self.channel,
            y * D21,
            y * D22 * u,
        )
        return whole if self.states is None else whole.at_rest(self.states, self.dt)

    def motions(self, p: Array, matters: Sequence[bool]) -> list[Array]:
        """Return every extreme dp/dt (K, m) at p (K, m) per unit of time: the value of another
        parameter where that is the rate, else both signs of the limit; zero for parameters that do
        not matter.
        """
        return extreme_motions(self.parameters, p, matters, self.time)

    @property
    def breaks(self) -> list[list[float]]:
        """Breaks of the piecewise polynomials of each parameter, ends included."""
        return breaks_of(self)


def breaks_of(model: ScaledPlant | LPVStateSpace) -> list[list[float]]:
    """Return the breaks of the piecewise polynomials of each parameter, ends included; of functions
    that are none the ends.
    """
    out = []
    for s, factor in zip(model.parameters, factors_of(model.basis), strict=True):
        try:
            inner = [piece.low for piece in factor.pieces()[1:]]
        except InputError:
            inner = []
        out.append([s.low, *(q for q in inner if s.low < q < s.high), s.high])
    return out


def _sizes(D: Array, axis: int) -> Array:
    """Return the size of each channel over all p; 1 for a zero channel."""
    size = np.sqrt(np.square(D).sum(axis=axis).mean(axis=0))
    return np.where(size > 0, size, 1.0)


def _balancing(plants: Generalized, dt: float | None) -> tuple[Array | None, Array | None]:
    """Return T (n, n) with T'XT = T^-1 Y T^-T diagonal, X and Y the mean solutions of the Riccati
    equations of control and of estimation, and the squares of that diagonal; with one of X and Y
    alone T'XT = I, or T^-1 Y T^-T = I, and None.
    """
    X, Y = _mean_cost(plants, dt), _mean_cost(plants.dual, dt)
    if X is None or Y is None:
        one, power = (Y, 0.5) if X is None else (X, -0.5)
        if one is None:
            return None, None
        values, vectors = np.linalg.eigh(one)
        return vectors * values**power, None
    # the mean cost of a state may be rounding beside that of another
    L = square_root(Y, REGULARIZATION**2)
    U, squares, _ = np.linalg.svd(L.T @ X @ L)
    return L @ U / squares**0.25, squares


def _mean_cost(plants: Generalized, dt: float | None) -> Array | None:
    """Return the mean cost of a state under optimal full-information control: the mean of these
    matrices divided by their traces, times the geometric mean of the traces; None where there is no
    such control.
    """
    n = plants.A.shape[-1]
    every = (Generalized(*each) for each in zip(*plants, strict=True))
    found = [control_gains(each, dt) for each in every if _priced(each.D12)]
    costs = [f.X for f in found if f is not None and np.trace(f.X) > 0]
    if not costs:
        return None
    traces = np.array([np.trace(X) for X in costs])
    mean = np.mean(costs / traces[:, None, None], axis=0) + REGULARIZATION / n * np.eye(n)
    return float(np.exp(np.log(traces).mean())) * mean


def _priced(D: Array) -> bool:
    """Whether every control has a cost."""
    return D.shape[1] == 0 or np.linalg.matrix_rank(D) == D.shape[1]


def scaled_plant_of(plant: Plant, channel: float) -> ScaledPlant:
    """Return the scaled plant with performance in units of `channel`."""
    one = len(plant.parameters) == 1
    return ScaledPlant.of(
        lambda p: plant.matrices(p[:, 0] if one else p),
        plant.parameters,
        plant.basis,
        plant.dt,
        channel,
    )


def depends(plant: Plant) -> list[bool]:
    """Return for each parameter whether the data depend on it."""
    c = scaled_plant_of(plant, 1.0)
    return [d > 0 for d in degrees_of(lambda p: list(c.at(p)), c.breaks)]


def degrees_of(
    data: Callable[[Array], Sequence[Array]], breaks: Sequence[Sequence[float]]
) -> tuple[int, ...]:
    """Return the degree in each parameter of `data` (arrays (K, ...) at p (K, m)) on the widest
    cells, at most `MAX_DEGREE`.
    """
    sides = [max(pairwise(b), key=lambda side: side[1] - side[0]) for b in breaks]
    unit = interpolation_points([MAX_DEGREE], [(-1.0, 1.0)])
    to_chebyshev = np.linalg.inv(chebyshev.chebvander(unit, MAX_DEGREE))
    found = []
    for i in range(len(sides)):
        axes = [
            0.5 * (a + b) + 0.5 * (b - a) * (unit if k == i else np.zeros(1))
            for k, (a, b) in enumerate(sides)
        ]
        degree = 0
        for values in data(tensor_grid(axes)):
            c = np.abs(to_chebyshev @ values.reshape(len(unit), -1))
            above = np.flatnonzero(
                (c > NEGLIGIBLE_COEFFICIENT * max(float(c.max(initial=0.0)), 1e-300)).any(axis=1)
            )
            degree = max(degree, int(above.max(initial=0)))
        found.append(degree)
    return tuple(found)
