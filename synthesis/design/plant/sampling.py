"""Sampling of a controller, and the plant with its inputs held for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.bases.polynomials import lobatto_points, piecewise_lobatto
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from symheli.values.numbers import positive
from synthesis.design.plant.plant import Plant

NODES = {1: 41, 2: 13}
"""Least number of values of each parameter at which the rule is applied (more parameters: 7)."""
PARTS_PER_PIECE = 5
"""Least number of parts of every piece of the functions of one parameter."""


def tustin(model: LPVStateSpace, dt: float) -> LPVStateSpace:
    """Apply the trapezoidal rule at every frozen p and fit the same functions of p: stability is
    preserved. The misfit is in `.residuals`.

    Raises `InputError` for a model that is sampled already and a period that is not positive.
    """
    if model.dt is not None:
        raise InputError(f"the controller is already sampled (dt = {model.dt} s)")
    positive(dt, "dt")

    return resampled(model, _rule(model, dt, "tustin"), dt)


def held(plant: Plant, dt: float) -> Plant:
    """Return the plant with its inputs held between the samples at every frozen p. Polynomials of p
    become those of twice the degree, in which the exponential is right to the second power of dt;
    other functions stay the same. The misfit is in `.model.residuals`.

    Raises `InputError` for an uncertain plant.
    """
    degrees = plant.basis.degrees
    if degrees is not None or not isinstance(plant.model, LPVStateSpace):
        return plant.sampled(dt, None if degrees is None else [2 * n for n in degrees])
    return replace(plant, model=resampled(plant.model, _rule(plant.model, dt, "hold"), dt))


def _rule(
    model: LPVStateSpace, dt: float, method: Literal["hold", "tustin"]
) -> Callable[[Array, Array, Array, Array], tuple[Array, ...]]:
    def rule(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, ...]:
        each = [
            LinearModel(*M, model.states, model.inputs, model.outputs).discretize(dt, method)
            for M in zip(A, B, C, D, strict=True)
        ]
        return tuple(np.stack([getattr(m, name) for m in each]) for name in "ABCD")

    return rule


def resampled(
    model: LPVStateSpace,
    change: Callable[[Array, Array, Array, Array], tuple[Array, ...]],
    dt: float | None,
) -> LPVStateSpace:
    """Return the model with its matrices (K, ..) changed at every p, by the same functions of p."""
    p = _nodes(model)
    exact = Matrices(*change(*model.matrices(p)))
    A, B, C, D = (model.basis.fit(p, M) for M in exact)
    sampled = LPVStateSpace(
        model.basis, A, B, C, D, model.parameters, model.states, model.inputs, model.outputs, dt
    )
    return sampled.with_residuals(p, exact)


def _nodes(model: LPVStateSpace) -> Array:
    if len(model.parameters) > 1:
        return lobatto_points(NODES.get(len(model.parameters), 7), model.box)
    pieces = model.basis.pieces()
    ((low, high),) = model.box  # may be narrower than the range of the functions
    knots = [low, *(piece.high for piece in pieces if low < piece.high < high), high]
    return piecewise_lobatto(knots, max(PARTS_PER_PIECE, -(-NODES[1] // (len(knots) - 1))))
