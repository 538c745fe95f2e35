"""Back-off: the factor by which a design level exceeds the optimum."""

from __future__ import annotations

from collections.abc import Sequence

from symheli.errors import InputError

LARGEST = 1e3
"""Largest back-off; larger factors are meaningless and numerically unsafe."""


def levels_above(back_off: float | Sequence[float]) -> tuple[float, ...]:
    """Return the factors to try in order; raise `InputError` unless each is from 1 to `LARGEST`."""
    factors = (back_off,) if isinstance(back_off, int | float) else tuple(back_off)
    if not factors or not all(1 <= factor <= LARGEST for factor in factors):
        raise InputError(f"back_off: expected numbers from 1 to {LARGEST:g}, got {back_off!r:.80}")
    return factors
