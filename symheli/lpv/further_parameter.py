"""The same model over additional parameters on which it does not depend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace, tensor_grid
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.polynomials import factors_of
from symheli.lpv.bases.product import Product
from symheli.lpv.lpv_state_space import FitResiduals, LPVStateSpace
from symheli.lpv.scheduling import Scheduling, parameters


def with_parameter(lpv: LPVStateSpace, scheduling: Scheduling) -> LPVStateSpace:
    """Return the same matrices and trim over (parameters of `lpv`, `scheduling`): f_j(p) 1.

    Raises `InputError` for a name that repeats, and a basis that cannot be a factor of a product.
    """
    return over(lpv, (*lpv.parameters, scheduling))


def over(lpv: LPVStateSpace, given: Sequence[Scheduling]) -> LPVStateSpace:
    """Return the same matrices and trim over the parameters `given`: those of `lpv`, by name and in
    any order, and others.
    """
    given = parameters(given)
    if [s.name for s in given] == [s.name for s in lpv.parameters]:
        return replace(lpv, parameters=given)
    basis, order = _over(lpv.basis, lpv.parameters, given)
    trim, residuals = lpv.trim, lpv.residuals
    if trim is not None:
        other, own = _over(trim.basis, lpv.parameters, given)
        rates, y = (None if M is None else M[own] for M in (trim.xdot, trim.y))
        trim = replace(trim, basis=other, x=trim.x[own], u=trim.u[own], xdot=rates, y=y)
    return replace(
        lpv,
        basis=basis,
        **{name: getattr(lpv, name)[order] for name in "ABCD"},
        parameters=given,
        trim=trim,
        residuals=residuals and _everywhere(residuals, lpv.parameters, given),
    )


def _over(
    basis: FunctionSpace, own: Sequence[Scheduling], given: Sequence[Scheduling]
) -> tuple[Product, list[int] | slice]:
    """Every function times 1, and which function of `basis` each is: a slice, which leaves arrays
    as they are to the last bit, where they keep their order.
    """
    factor = dict(zip([s.name for s in own], factors_of(basis), strict=True))
    factors = tuple(factor.get(s.name) or Polynomial(0, s.low, s.high) for s in given)
    total = basis.total_degree if isinstance(basis, Product) else None
    wider = Product(factors, total)  # type: ignore[arg-type]  # a Product refuses what is no factor
    names = [s.name for s in given]
    at = [names.index(s.name) for s in own]
    known = basis.indices if isinstance(basis, Product) else [(j,) for j in range(basis.size)]
    where = {index: j for j, index in enumerate(known)}
    order = [where[tuple(index[i] for i in at)] for index in wider.indices]
    return wider, slice(None) if order == list(range(basis.size)) else order


def _everywhere(
    residuals: FitResiduals, own: Sequence[Scheduling], given: Sequence[Scheduling]
) -> FitResiduals:
    """Return the same misfit at both ends of every new range."""
    nodes = residuals.nodes.reshape(len(residuals.nodes), -1)
    known = {s.name: column for s, column in zip(own, nodes.T, strict=True)}
    new = [s for s in given if s.name not in known]
    ends = tensor_grid([np.array([s.low, s.high]) for s in new]) if new else np.zeros((1, 0))
    count = len(ends)
    columns = {name: np.repeat(column, count) for name, column in known.items()}
    columns |= {s.name: np.tile(end, len(nodes)) for s, end in zip(new, ends.T, strict=True)}
    repeated = (np.repeat(M, count, axis=0) for M in residuals.matrices)
    return FitResiduals(np.column_stack([columns[s.name] for s in given]), *repeated)
