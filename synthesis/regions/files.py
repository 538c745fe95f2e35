"""Polynomials and sums of squares as JSON holds them."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import frozen
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.numerics.polynomial.multivariate import Exponents, SparsePolynomial
from synthesis.regions.proof import Gram, RegionProof

SUMS = ("sum_V", "sum_sigma", "sum_s", "sum_rest")
HIGHEST = 60
"""Largest exponent that is read."""


def written_terms(p: SparsePolynomial) -> list[Any]:
    """Return the terms [exponents, "numerator/denominator"]."""
    return [[list(k), f"{c.numerator}/{c.denominator}"] for k, c in p.terms.items()]


def read_terms(content: Any, n: int) -> SparsePolynomial:
    """Return the polynomial of n variables with these terms."""
    terms = {_exponents(k, n): Fraction(str(c)) for k, c in content}
    if len(terms) < len(content):
        raise InputError("a polynomial has one monomial twice")
    return SparsePolynomial(n, terms)


def _exponents(given: Any, n: int) -> Exponents:
    own = tuple(given)
    if len(own) != n or not all(type(e) is int and 0 <= e <= HIGHEST for e in own):
        raise InputError(f"expected {n} exponents from 0 to {HIGHEST}, got {given!r:.60}")
    return own


def written_proof(proof: RegionProof) -> dict[str, Any]:
    """Return coordinates and sums of squares."""
    made = {"T": encoded(proof.T)}
    for name, gram in zip(SUMS, proof[1:], strict=True):
        made[name] = {"monomials": [list(k) for k in gram.basis], "Q": encoded(gram.Q)}
    return made


def read_proof(content: Mapping[str, Any], n: int) -> RegionProof:
    """Return coordinates and sums of squares of n states."""
    return RegionProof(
        frozen(decoded(content["T"]), "T", (n, n)), *(_read_gram(content[k], n) for k in SUMS)
    )


def _read_gram(content: Any, n: int) -> Gram:
    basis = tuple(_exponents(k, n) for k in content["monomials"])
    if len(set(basis)) < len(basis):
        raise InputError("a sum of squares has one monomial twice")
    Q = frozen(decoded(content["Q"]), "Q", (len(basis), len(basis)))
    if not np.array_equal(Q, Q.T):
        raise InputError("a sum of squares has a Q that is not symmetric")
    return Gram(basis, Q)
