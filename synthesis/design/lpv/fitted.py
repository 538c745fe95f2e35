"""Gains computed at some p as functions of p, and as a controller in the units of its plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli import LPVStateSpace, Scheduling
from symheli.lpv import BSpline
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.polynomials import lobatto_points, piecewise_lobatto, polynomials
from symheli.values.arrays import Array
from symheli.values.signal import signals
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.scaled_plant import ScaledPlant

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant

DEGREES = {1: (0, 1, 2, 3, 4, 5, 6, 8, 10), 2: (0, 1, 2, 3, 4, 5, 6, 8)}
"""Degrees of the polynomials tried in turn (more parameters: up to 4)."""
SEGMENTS = (4, 8, 16, 32)
"""Numbers of segments of the cubic splines of one parameter, tried after the polynomials."""
NEGLIGIBLE_ENTRY = 0.01
"""The misfit of an entry is relative to its size, but at least to this fraction of the geometric
mean of the largest entries of its row and column.
"""
NODES = {1: 129, 2: 17}
"""Values of each parameter at which the gains are computed (more parameters: 7)."""
MAX_SEGMENTS, MIN_SEGMENT = 256, 1e-6
"""Largest number of segments of a spline, and its shortest segment as a fraction of the range."""
CHECKS_PER_SEGMENT, FINAL_CHECKS = 9, 33
"""Values of p in each segment at which a fit is checked (gains are computed at every other one),
and once it passes there.
"""


class Fitted(NamedTuple):
    """Gains (r, c) as functions of p: sum_j f_j(p) coefficients[j].

    `misfit` is the largest error of an entry relative to that entry, one that is small in its row
    and column relative to `NEGLIGIBLE_ENTRY` of those.
    """

    basis: FunctionSpace
    coefficients: Array
    misfit: float

    def __call__(self, p: Array) -> Array:
        """The gains (K, r, c) at p (K, m)."""
        values = self.basis(p[:, 0] if p.shape[1] == 1 else p)
        return np.tensordot(values, self.coefficients, axes=1)


def fits(gains: Callable[[Array], Array], parameters: Sequence[Scheduling]) -> Iterator[Fitted]:
    """Yield `gains` (K, r, c) at p (K, m) as polynomials of rising degree, then as splines."""
    m = len(parameters)
    box = [(s.low, s.high) for s in parameters]
    p = lobatto_points(NODES.get(m, 7), box)
    values = gains(p.reshape(len(p), -1))
    for basis in _bases(box):
        yield _fit(basis, p, values)


def cut_to_serve(
    gains: Callable[[Array], Array],
    parameter: Scheduling,
    serves: Callable[[Fitted, Array], Array],
) -> Fitted | None:
    """Return `gains` of one parameter as a cubic spline whose segments are halved where the check
    `serves` fails ((K,) at p (K, 1)); None where that takes more than `MAX_SEGMENTS` or segments
    too short.
    """
    known: dict[float, Array] = {}
    knots = np.linspace(parameter.low, parameter.high, SEGMENTS[0] + 1)
    shortest = MIN_SEGMENT * (parameter.high - parameter.low)
    while len(knots) <= MAX_SEGMENTS and np.diff(knots).min() > shortest:
        p = np.unique(piecewise_lobatto(knots.tolist(), CHECKS_PER_SEGMENT))
        nodes = p[::2]
        new = np.array([q for q in nodes if q not in known])
        if len(new):
            known.update(zip(new, gains(new[:, None]), strict=True))
        fit = _fit(BSpline(3, tuple(knots)), nodes, np.array([known[q] for q in nodes]))
        bad = p[~serves(fit, p[:, None])]
        if not len(bad):
            p = np.unique(piecewise_lobatto(knots.tolist(), FINAL_CHECKS))
            bad = p[~serves(fit, p[:, None])]
        if not len(bad):
            return fit
        cut = np.unique(np.searchsorted(knots[1:-1], bad, side="right"))
        knots = np.sort(np.concatenate([knots, 0.5 * (knots[cut] + knots[cut + 1])]))
    return None


def _fit(basis: FunctionSpace, p: Array, values: Array) -> Fitted:
    """Return the functions of this basis nearest to these values (K, r, c)."""
    size = np.abs(values).max(axis=0)
    rows, columns = (size.max(axis=k, keepdims=True, initial=0.0) for k in (1, 0))
    size = np.maximum(size, NEGLIGIBLE_ENTRY * np.sqrt(rows * columns))
    size[size == 0] = 1.0
    coefficients = basis.fit(p, values)
    off = np.abs(np.tensordot(basis(p), coefficients, axes=1) - values)
    return Fitted(basis, coefficients, float((off / size).max(initial=0.0)))


def _bases(box: Sequence[tuple[float, float]]) -> Iterator[FunctionSpace]:
    m = len(box)
    for degree in DEGREES.get(m, tuple(range(5))):
        yield polynomials([degree] * m, box)
    if m == 1:
        for segments in SEGMENTS:
            yield BSpline(3, tuple(np.linspace(*box[0], segments + 1)))


def fitted(
    gains: Callable[[Array], Array], parameters: Sequence[Scheduling], accuracy: float
) -> Fitted:
    """Return the first of the `fits` within `accuracy` of every gain, or the nearest of all."""
    best: Fitted | None = None
    for fit in fits(gains, parameters):
        best = fit if best is None or fit.misfit < best.misfit else best
        if fit.misfit <= accuracy:
            break
    assert best is not None  # noqa: S101 - some basis is always tried
    return best


def in_plant_units(
    plant: Plant, c: ScaledPlant, fit: Fitted, gamma: float, method: str
) -> Controller:
    """Return the controller in the units of the plant, for gains in scaled ones as
    functions of p.
    """
    M = fit.coefficients
    n = M.shape[-1] - len(plant.measurements)
    pace = np.full(n, 1 / math.sqrt(c.time))
    rows = np.concatenate([pace, c.controls])
    columns = np.concatenate([pace, c.measurements])
    names = tuple(f"k{i + 1}" for i in range(n))
    return controller_from(
        plant, fit._replace(coefficients=rows[:, None] * M * columns), names, gamma, method
    )


def controller_from(
    plant: Plant, fit: Fitted, states: Sequence[str], promised: float, method: str
) -> Controller:
    """Return the controller [A B; C D] (n + nu, n + ny) that is a function of p, in the units of
    its plant.
    """
    M, n = fit.coefficients, len(states)
    model = LPVStateSpace(
        fit.basis,
        M[:, :n, :n],
        M[:, :n, n:],
        M[:, n:, :n],
        M[:, n:, n:],
        plant.parameters,
        signals(states),
        plant.measurements,
        plant.controls,
        plant.dt,
    )
    return Controller(model=model, plant=plant, promised=promised, method=method, misfit=fit.misfit)
