"""How far above the optimum a design is made."""

from __future__ import annotations

from collections.abc import Sequence

from symheli.errors import InputError

LARGEST = 1e3
"""Beyond this nothing of the optimum is left, and the solvers' numbers run out."""


def levels_above(back_off: float | Sequence[float]) -> tuple[float, ...]:
    """The factors to try in order; raises `InputError` unless each is from 1 to `LARGEST`."""
    factors = (back_off,) if isinstance(back_off, int | float) else tuple(back_off)
    if not factors or not all(1 <= factor <= LARGEST for factor in factors):
        raise InputError(f"back_off: expected numbers from 1 to {LARGEST:g}, got {back_off!r:.80}")
    return factors
