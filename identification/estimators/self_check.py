"""Whether coefficients are the least-squares ones: their residual is orthogonal to every regressor,
as far as rounding allows.
"""

from __future__ import annotations

import numpy as np

from identification.design.determined import PRIOR, largest
from identification.recursive.rls_state import RLSState
from identification.structure.lpvarx import LPVARX
from symheli.errors import AccuracyError
from symheli.values.arrays import Array

MAX_ROUNDINGS = 1e3
"""Permitted error in roundings of a sum: a backward stable method needs some tens."""


def check_least_squares(arx: LPVARX, phi: Array, y: Array, theta: Array, method: str) -> None:
    """Raises `AccuracyError` unless theta (n, ny) minimises |y - phi theta|, phi (m, n), y (m, ny).

    The gradient phi' (y - phi theta) is zero at the minimum, whatever the condition; here, to
    rounding of its terms and up to what a recursion pretends beside the data
    (`identification.design.determined`). Costs two products with phi, a few percent of the fit.
    Source: Bjorck (1996), Numerical Methods for Least Squares Problems, section 1.4.
    """
    lengths = np.linalg.norm(phi, axis=0)
    size = np.linalg.norm(y, axis=0) + lengths @ np.abs(theta)
    gradient = np.where(arx.free, phi.T @ (y - phi @ theta), 0.0)
    signals = (
        np.abs(phi).max(axis=0, initial=0.0).reshape(-1, arx.basis.size) / largest(arx.basis)
    ).max(axis=1)
    pretended = PRIOR * np.outer(signals, largest(arx.basis)).reshape(-1, 1) ** 2 * np.abs(theta)
    allowed = np.finfo(float).eps * (
        MAX_ROUNDINGS * np.sqrt(len(phi)) * np.outer(lengths, size) + 2 * pretended
    )
    if not (np.abs(gradient) <= allowed).all():
        row, output = np.unravel_index(
            np.nanargmax(np.where(np.isfinite(gradient), np.abs(gradient) / allowed, np.inf)),
            gradient.shape,
        )
        raise AccuracyError(
            f"method {method!r} lost its accuracy: the residual of {arx.outputs[output]} is not"
            f" orthogonal to {arx.regressor_names[row]}; these coefficients are not the"
            " least-squares ones, use another method and report the record"
        )


def check_recursion(state: RLSState, phi: Array, y: Array) -> None:
    """Raise `AccuracyError` unless the coefficients updated sample by sample predict the same as
    those solved from the factor.

    With any forgetting; to 1e-8 of the spread of each output over phi (m, n), y (m, ny).
    """
    apart = np.abs(phi @ (state.theta - state.solve(as_it_stands=True))).max(axis=0)
    if not (apart <= 1e-8 * np.std(y, axis=0) + 1e-12 * np.abs(y).max(axis=0)).all():
        raise AccuracyError(
            f"the recursion lost its accuracy: its coefficients predict {apart.max():.3g} apart"
            ' from those of its factor; use method "ls" and report the record'
        )
