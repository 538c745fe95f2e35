"""Sampled plants and their controllers as continuous ones: z = (1 + s)/(1 - s) keeps every gain."""

from __future__ import annotations

import math

import numpy as np

from symheli.errors import InputError
from symheli.lpv.equilibration import is_singular
from synthesis.plant.generalized import Generalized
from synthesis.worst.frozen import to_continuous

Array = np.ndarray


def continuous_plant(plant: Generalized) -> Generalized:
    """The continuous plant of a sampled one: stability and H-infinity norms of loops are the same.

    Its state is (x(k+1) + x(k))/sqrt(2), in the coordinates of x. Raises `InputError` where the
    plant has a mode at z = -1.
    """
    if is_singular(plant.A + np.eye(len(plant.A))):
        raise InputError(
            "the sampled plant has a mode at z = -1 (half the sample frequency), which the bilinear"
            " transformation cannot take; sample at another rate or leave the mode out"
        )
    controls, measured = plant.B2.shape[1], plant.C2.shape[0]
    return Generalized.split(*to_continuous(*plant.joined), controls, measured)


def sampled_controller(
    A: Array, B: Array, C: Array, D: Array
) -> tuple[Array, Array, Array, Array] | None:
    """The sampled controller of a continuous one, the way back; None where it has a pole at
    s = 1, which is one at infinite z.
    """
    eye = np.eye(len(A))
    if is_singular(eye - A):
        return None
    inverse, root = np.linalg.inv(eye - A), math.sqrt(2.0)
    return inverse @ (eye + A), root * inverse @ B, root * C @ inverse, D + C @ inverse @ B
