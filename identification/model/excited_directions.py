"""Directions in which a loop excites the errors of a set of models: it is to be tight there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symheli import UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.bases.function_space import tensor_grid
from symheli.values.arrays import Array

POINTS = 7
"""Values of each parameter looked at."""

FREQUENCIES = 60
"""Over three decades below the Nyquist frequency of a sampled loop."""


def excited_directions(loop: UncertainStateSpace) -> Array:
    """Return the second moments (n, n) of the outputs v of the first block of a sampled set: summed
    over the inputs, frequencies and frozen parameters, each weighted by the gain with which the
    block acts on the outputs; the other blocks at zero and, one after another, at both bounds.
    Raises `InputError` in continuous time.
    """
    count, (first, *_) = len(loop.outputs), loop.every_part
    inputs = [*loop.inputs, *loop.perturbation_inputs]
    outputs = [*loop.outputs, *loop.perturbation_outputs]
    model = loop.model.select(inputs=inputs, outputs=outputs)
    axes = [np.linspace(s.low, s.high, POINTS) for s in loop.parameters]
    grid = axes[0] if len(axes) == 1 else tensor_grid(axes)
    if model.dt is None:
        raise InputError("tight_for: expected a sampled loop, closed around a set of models")
    omega = np.pi / model.dt * np.geomspace(1e-3, 1.0, FREQUENCIES)
    moments, u = np.zeros((first.outputs, first.outputs)), len(loop.inputs)
    for p in grid:
        G = model.at(*np.atleast_1d(p)).frequency_response(omega)
        for H in _at_bounds(G, loop, u, count):
            excited = H[:, count:, :u]
            weight = np.linalg.norm(H[:, :count, u:], 2, axis=(1, 2)) ** 2
            moments += np.einsum("k,kiu,kju->ij", weight, excited, excited.conj()).real
    return moments


def _at_bounds(G: Array, loop: UncertainStateSpace, u: int, y: int) -> Iterator[Array]:
    """Yield the responses G (frequencies, outputs, inputs) from the first `u` inputs and those of
    the first block to the first `y` outputs and those of the block, with the others closed.
    """
    first = loop.every_part[0]
    rows, columns = y + first.outputs, u + first.inputs
    yield G[:, :rows, :columns]
    for d, v in loop.places[1:]:
        size = min(d.stop - d.start, v.stop - v.start)
        for sign in (1.0, -1.0):
            K = np.zeros((d.stop - d.start, v.stop - v.start))
            K[:size, :size] = sign * loop.bound * np.eye(size)
            i, o = slice(u + d.start, u + d.stop), slice(y + v.start, y + v.stop)
            back = np.linalg.solve(np.eye(len(K)) - K @ G[:, o, i], K @ G[:, o, :columns])
            yield G[:, :rows, :columns] + G[:, :rows, i] @ back
