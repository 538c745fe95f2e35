"""How the parameters move at the nodes of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from symheli.lpv import FunctionSpace, Scheduling
from symheli.lpv.bases.polynomials import factors_of

Array = np.ndarray


def moves(parameters: Sequence[Scheduling]) -> bool:
    """Whether any of them may change."""
    return any(isinstance(s.rate, str) or s.rate > 0 for s in parameters)


def used(basis: FunctionSpace) -> list[bool]:
    """Which parameters the functions depend on."""
    return [factor.size > 1 for factor in factors_of(basis)]


def motions(
    parameters: Sequence[Scheduling], p: Array, time: float, matters: Sequence[bool]
) -> list[Array]:
    """Every extreme dp/dt (K, m) at p (K, m), per `time` seconds: of a parameter whose rate is
    another the value of that, of the others both signs of their limit.
    """
    names = [s.name for s in parameters]
    choices: list[list[Array]] = []
    for s, counts in zip(parameters, matters, strict=True):
        if not counts:
            choices.append([np.zeros(len(p))])
        elif isinstance(s.rate, str):
            choices.append([time * p[:, names.index(s.rate)]])
        else:
            rates = (-s.rate, s.rate) if s.rate > 0 else (0.0,)
            choices.append([np.full(len(p), time * r) for r in rates])
    return [np.stack(choice, axis=1) for choice in product(*choices)]
