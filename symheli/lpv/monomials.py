"""Models written as {exponents: matrix}: checked, and put together in one matrix a monomial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen


def as_blocks(
    A: Mapping[Any, Any],
    B: Mapping[Any, Any],
    C: Mapping[Any, Any],
    D: Mapping[Any, Any],
    count: int,
) -> tuple[dict[tuple[int, ...], Array], int]:
    """({exponents: [A B; C D]}, number of states) of monomials in `count` parameters; raises
    `InputError` where shapes or exponents do not fit.
    """
    given = {
        name: _coefficients(name, M, count) for name, M in (("A", A), ("B", B), ("C", C), ("D", D))
    }
    (nx, _), (_, nu), (ny, _) = given["A"][0], given["B"][0], given["C"][0]
    for name, shape in (("A", (nx, nx)), ("B", (nx, nu)), ("C", (ny, nx)), ("D", (ny, nu))):
        if given[name][0] != shape:
            raise InputError(f"{name}: expected matrices of shape {shape}, got {given[name][0]}")
    zero = {name: np.zeros(shape) for name, (shape, _) in given.items()}
    whole = {}
    for exponents in sorted({e for _, matrices in given.values() for e in matrices}):
        M = {name: matrices.get(exponents, zero[name]) for name, (_, matrices) in given.items()}
        whole[exponents] = np.block([[M["A"], M["B"]], [M["C"], M["D"]]])
    return whole, nx


def _coefficients(
    name: str, matrices: Mapping[Any, Any], count: int
) -> tuple[tuple[int, int], dict[tuple[int, ...], Array]]:
    """(shape, {exponents: matrix}) after checking both."""
    if not isinstance(matrices, Mapping) or not matrices:
        raise InputError(
            f"{name}: expected {{exponents: matrix}} with at least one entry, such as"
            f" {{{(0,) * count}: {name}0}}"
        )
    out = {}
    for key, M in matrices.items():
        exponents = tuple(key) if isinstance(key, tuple | list) else (key,)
        if len(exponents) != count or any(int(e) != e or e < 0 for e in exponents):
            raise InputError(
                f"{name}: expected {count} exponent(s) >= 0, one a parameter, got {key!r}"
            )
        out[tuple(int(e) for e in exponents)] = frozen(M, f"{name}{exponents}", (None, None))
    if len({M.shape for M in out.values()}) > 1:
        raise InputError(
            f"{name}: coefficient matrices differ in shape:"
            f" {', '.join(str(M.shape) for M in out.values())}"
        )
    return next(iter(out.values())).shape, out  # type: ignore[return-value]
