"""Powers of a parameter about another centre, in exact arithmetic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import comb, prod
from typing import Any

import numpy as np

from symheli.values.arrays import Array

_exact = np.frompyfunc(Fraction, 1, 1)

Centre = tuple[Fraction, Fraction]
"""(middle, radius) of a parameter p = middle + radius delta."""


def centre(low: float, high: float) -> Centre:
    """Return the centre of a parameter in [low, high], exactly."""
    return (Fraction(low) + Fraction(high)) / 2, (Fraction(high) - Fraction(low)) / 2


def recentred(
    terms: Mapping[tuple[int, ...], Array], centres: Sequence[Centre]
) -> dict[tuple[int, ...], Array]:
    """{exponents: matrix} of powers of delta from those of p = middle + radius delta, one centre a
    parameter.

    The doubles are taken as the rationals they are and every sum is rounded once: nothing cancels,
    however far from zero p lives.
    """
    out: dict[tuple[int, ...], Any] = {}
    for exponents, M in terms.items():
        M = _exact(np.asarray(M, dtype=float))
        for powers in product(*(range(e + 1) for e in exponents)):
            factor = prod(
                comb(e, k) * r**k * c ** (e - k)
                for (c, r), e, k in zip(centres, exponents, powers, strict=True)
            )
            if factor:
                out[powers] = out[powers] + factor * M if powers in out else factor * M
    return {powers: np.asarray(M).astype(float) for powers, M in out.items()}
