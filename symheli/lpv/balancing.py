"""Gramians, their square roots, and the coordinates in which two of them are equal and diagonal."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.riccati import lyapunov
from symheli.values.arrays import Array
from symheli.values.signal import Signal

Model = TypeVar("Model", LPVStateSpace, LinearModel)

REGULAR = 1e-15
"""Fraction of its largest eigenvalue to which a Gramian is raised where states that nothing moves
or shows may be kept: their coordinates stay regular.
"""


def method(by: str | None, order: int | None, loss: float | None, *approximations: str) -> str:
    """Return the method of a reduction: without a name "minimal", with an order or a loss the first
    of the approximations. Raises `UnknownNameError`, and `InputError` for what it does not take.
    """
    given = order is not None or loss is not None
    by = by or (approximations[0] if given else "minimal")
    if by not in (known := ("minimal", *approximations)):
        raise UnknownNameError("method of reduction", by, known)
    if order is not None and loss is not None:
        raise InputError("reduce: give an order, or a loss such as 0.03, and not both")
    if by == "minimal" and given:
        raise InputError(
            'by: "minimal" loses nothing and finds its order; for an order or a loss give'
            f" {' or '.join(approximations)}"
        )
    return by


class Balancing(NamedTuple):
    """Coordinates `into` x with x = `out` z, in which both Gramians have the `values` on their
    diagonals, in falling order; into @ out = I.
    """

    into: Array
    out: Array
    values: Array


def square_root(M: Array, floor: float = 0.0) -> Array:
    """Return L (n, n) with L L' = M, whose eigenvalues are raised to the fraction `floor` of the
    largest.
    """
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    return vectors * np.sqrt(np.maximum(values, floor * max(float(values[-1]), 0.0)))


def balancing(seen: Array, reached: Array) -> Balancing:
    """Return the coordinates that balance the Gramians seen' seen and reached reached', from seen
    (k, n) and reached (n, m); the states whose value is zero have none.
    """
    U, values, Vt = np.linalg.svd(seen @ reached, full_matrices=False)
    n = len(reached)
    size = np.sqrt(np.maximum(values[:n], np.finfo(float).tiny))
    return Balancing((U[:, :n] / size).T @ seen, reached @ (Vt[:n].T / size), values[:n])


def balanced_gramians(seen: Array, reached: Array, floor: float = 0.0) -> Balancing:
    """Return the coordinates that balance the Gramians (n, n) of observability and reachability."""
    return balancing(square_root(seen, floor).T, square_root(reached, floor))


def response_gramians(A: Array, B: Array, C: Array, dt: float | None) -> tuple[Array, Array]:
    """Return the observability and reachability Gramians (n, n) of a stable model."""
    return lyapunov(A.T, C.T @ C, dt), lyapunov(A, B @ B.T, dt)


def projected(model: Model, into: Array, out: Array) -> Model:
    """Return the model of the states z = into x, with x = out z."""
    states = tuple(Signal(f"x{i + 1}") for i in range(len(into)))
    parts = dict(A=into @ model.A @ out, B=into @ model.B, C=model.C @ out, states=states)
    if isinstance(model, LinearModel):
        return replace(model, **parts, point=None)
    trim = model.trim and model.trim.projected(into.T)
    return replace(model, **parts, trim=trim, residuals=None)
