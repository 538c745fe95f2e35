"""Lyapunov functions where none is given: the quadratic one, and one that grows from it."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from symheli.errors import InputError
from symheli.lpv.riccati import lyapunov
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.multivariate import SparsePolynomial
from synthesis.numerics.polynomial.symmetric import symmetrized
from synthesis.numerics.program.cone_program import Solver


def linearization(f: Sequence[SparsePolynomial]) -> Array:
    """Return A of dx/dt = A x near 0."""
    n = len(f)
    units = np.eye(n, dtype=int).tolist()
    return np.array([[float(p.terms.get(tuple(u), 0)) for u in units] for p in f])


def quadratic(f: Sequence[SparsePolynomial]) -> SparsePolynomial:
    """Return x'P x with A'P + PA = -I of the linearization where it is stable, else x'x."""
    A, n = linearization(f), len(f)
    stable = np.linalg.eigvals(A).real.max() < 0
    P = symmetrized(lyapunov(A.T, np.eye(n), None)) if stable else np.eye(n)
    x = SparsePolynomial.variables(n)
    every = [x[i] * x[j] * Fraction(float(P[i, j])) for i in range(n) for j in range(n)]
    return sum(every, SparsePolynomial(n, {}))


def grown(
    f: Sequence[SparsePolynomial], V: SparsePolynomial, degree: int, solver: Solver
) -> SparsePolynomial:
    raise InputError("not yet")
