"""How often the bands of identified frequency responses hold the exact ones."""

from __future__ import annotations

import numpy as np

from identification import KinematicModel
from studies.known_kinematics.truth import AXES, SPEEDS, Truth, frozen
from symheli import LinearModel
from symheli.values.arrays import Array

FREQUENCIES = np.geomspace(0.3, 20.0, 8)
"""rad/s."""

EVERY = 6
"""Of the airspeeds of a truth, one in so many is looked at."""

WITHIN = 5.991
"""Quantile .95 of chi-squared with two degrees of freedom: real and imaginary part."""


def coverage(model: KinematicModel, truth: Truth, draws: int = 120, seed: int = 0) -> float:
    """Share of the responses of the lateral model (each input to each output, airspeed, frequency)
    whose nominal 95 % region, from draws of the coefficients, holds the exact one.
    """
    covariance = model.covariance
    assert covariance is not None
    size = covariance.shape[0] * covariance.shape[1]
    values, vectors = np.linalg.eigh(covariance.reshape(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(seed)
    members = [
        model.with_theta(model.theta + (root @ rng.standard_normal(size)).reshape(6, -1).T)
        for _ in range(draws)
    ]
    inside = []
    for k in range(0, len(SPEEDS), EVERY):
        exact = _responses(truth.models["lateral"][k])
        own = _at(model, k)
        spread = np.stack([_at(member, k) for member in members]) - own
        parts = np.stack([np.real(spread), np.imag(spread)], axis=-1)
        covariances = np.einsum("d...i,d...j->...ij", parts, parts) / draws
        away = exact - own
        off = np.stack([np.real(away), np.imag(away)], axis=-1)[..., None]
        distance = np.sum(off * np.linalg.solve(covariances, off), axis=(-2, -1))
        inside.append(distance <= WITHIN)
    return float(np.mean(inside))


def _at(model: KinematicModel, k: int) -> Array:
    return _responses(frozen(model, AXES["lateral"], float(SPEEDS[k])))


def _responses(model: LinearModel) -> Array:
    return model.frequency_response(FREQUENCIES)
