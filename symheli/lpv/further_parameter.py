"""One more scheduling parameter, on which nothing depends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product
from symheli.lpv.lpv_state_space import LPVStateSpace, Matrices, Residuals
from symheli.lpv.scheduling import Scheduling


def with_parameter(lpv: LPVStateSpace, scheduling: Scheduling) -> LPVStateSpace:
    """The same matrices and trim over (parameters of `lpv`, `scheduling`): f_j(p) 1.

    Raises `InputError` for a name that repeats, and a basis that cannot be a factor of a product.
    """
    one = Polynomial(0, scheduling.low, scheduling.high)
    trim, residuals = lpv.trim, lpv.residuals
    return replace(
        lpv,
        basis=_times(lpv.basis, one),
        parameters=(*lpv.parameters, scheduling),
        trim=trim and replace(trim, basis=_times(trim.basis, one)),
        residuals=residuals and _at_the_ends(residuals, scheduling),
    )


def _times(basis: FunctionSpace, one: Polynomial) -> Product:
    """Every function times 1, in the same order."""
    if isinstance(basis, Product):
        return replace(basis, factors=(*basis.factors, one))
    return Product((basis, one))  # type: ignore[arg-type]  # a Product refuses what is no factor


def _at_the_ends(residuals: Residuals, s: Scheduling) -> Residuals:
    """The same misfit at both ends of the new range."""
    nodes = residuals.nodes.reshape(len(residuals.nodes), -1)
    ends = np.tile([s.low, s.high], len(nodes))
    twice = Matrices(*(np.repeat(M, 2, axis=0) for M in residuals.matrices))
    return Residuals(np.column_stack([np.repeat(nodes, 2, axis=0), ends]), *twice)
