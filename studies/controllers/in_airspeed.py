"""Models as polynomials in airspeed of a given degree."""

from __future__ import annotations

from dataclasses import replace

from symheli import LPVStateSpace
from symheli.lpv.bases import Polynomial
from symheli.lpv.bases.polynomials import lobatto_points

NODES = 41


def of_degree(model: LPVStateSpace, degree: int) -> LPVStateSpace:
    """Every entry a polynomial of this degree in the one parameter, fitted at `NODES` values."""
    basis = Polynomial(degree, *model.box[0])
    p = lobatto_points(NODES, model.box)
    A, B, C, D = (basis.fit(p, entries) for entries in model.matrices(p))
    return replace(model, basis=basis, A=A, B=B, C=C, D=D, trim=None, residuals=None)
