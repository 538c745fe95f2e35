"""Conversion of polynomials in one or several parameters to an LFT, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.polynomials import (
    coefficients_of,
    interpolation_points,
    polynomials,
    scaled_powers,
)
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft_matrices import Block, parts
from symheli.lpv.lpv_state_space import FitResiduals, LPVStateSpace
from symheli.lpv.monomials import as_blocks
from symheli.lpv.recentred import centre, recentred
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.signal import signals

ROUNDING = 16 * np.finfo(float).eps
"""Relative rounding error of an entry of an LFT."""


def from_lpv(lpv: LPVStateSpace) -> LFT:
    """M(delta) as a sum of monomials by Horner's rule, exact; with one parameter of degree d the
    order is d (nx + nu).
    """
    degrees = lpv.basis.degrees
    if degrees is None:
        raise InputError(
            "an LFT needs polynomial (or rational) dependence; interpolate with kind='polynomial'"
            " first"
        )
    stacked, basis = np.block([[lpv.A, lpv.B], [lpv.C, lpv.D]]), lpv.basis
    if basis.ranges != lpv.box:
        nodes = interpolation_points(degrees, lpv.box)
        stacked = np.tensordot(basis(nodes), stacked, axes=1)
        basis = polynomials(degrees, lpv.box)
        stacked = basis.fit(nodes, stacked)
    monomials = scaled_powers(basis, stacked)
    constant = (0,) * len(degrees)
    kept = {e: M for e, M in monomials.items() if e == constant or len(degrees) == 1 or np.any(M)}
    return _chains(kept, lpv.parameters, lpv.states, lpv.inputs, lpv.outputs, lpv.dt)


def from_monomials(
    A: Mapping[Any, Any],
    B: Mapping[Any, Any],
    C: Mapping[Any, Any],
    D: Mapping[Any, Any],
    parameters: Sequence[Scheduling],
    dt: float | None,
    states: Sequence[str] | None,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
) -> LFT:
    """See `LFT.polynomial`."""
    parameters = tuple(parameters)
    whole, nx = as_blocks(A, B, C, D, count=len(parameters))
    rows, columns = next(iter(whole.values())).shape
    return _chains(
        recentred(whole, [centre(s.low, s.high) for s in parameters]),
        parameters,
        signals(states or [f"x{i + 1}" for i in range(nx)]),
        signals(inputs or [f"u{i + 1}" for i in range(columns - nx)]),
        signals(outputs or [f"y{i + 1}" for i in range(rows - nx)]),
        dt,
    )


def _chains(
    coefficients: Mapping[tuple[int, ...], Array],
    parameters: Sequence[Scheduling],
    states: Any,
    inputs: Any,
    outputs: Any,
    dt: float | None,
) -> LFT:
    """One signal delta^a v a monomial a, made from that of the monomial before by one more factor;
    v is the input of M.
    """
    m = len(parameters)
    zero: tuple[int, ...] = (0,) * m
    needed: set[tuple[int, ...]] = {zero}
    for exponents in coefficients:
        while exponents not in needed:
            needed.add(exponents)
            exponents = _before(exponents)[1]
    # sorted by parameter, so that each has one block
    chain = sorted(needed - {zero}, key=lambda e: (_before(e)[0], e))
    rows, width = next(iter(coefficients.values())).shape
    n = len(chain) * width
    M11, M12, M21 = np.zeros((n, n)), np.zeros((n, width)), np.zeros((rows, n))
    for k, exponents in enumerate(chain):
        here, before = slice(k * width, (k + 1) * width), _before(exponents)[1]
        if before == zero:
            M12[here] = np.eye(width)
        else:
            j = chain.index(before)
            M11[here, j * width : (j + 1) * width] = np.eye(width)
        if exponents in coefficients:
            M21[:, here] = coefficients[exponents]
    blocks = tuple(
        Block(s, width * sum(_before(e)[0] == i for e in chain)) for i, s in enumerate(parameters)
    )
    return LFT(
        M11,
        M12,
        M21,
        coefficients.get(zero, np.zeros((rows, width))),
        blocks,
        states,
        inputs,
        outputs,
        dt,
    )


def _before(exponents: tuple[int, ...]) -> tuple[int, tuple[int, ...]]:
    """(parameter of the last factor, monomial without it)."""
    i = max(k for k, e in enumerate(exponents) if e)
    return i, (*exponents[:i], exponents[i] - 1, *exponents[i + 1 :])


def expanded(lft: LFT) -> dict[tuple[int, ...], Array] | None:
    """{exponents: coefficient} of M in powers of delta, None where the dependence is rational.

    A polynomial is one whose powers of L = M11 Delta end: exactly, as those of `LFT.polynomial` do,
    or, where the loop was rotated (reduced, say), to rounding. Then what is left out is proven to
    stay below `_rounding` in the whole box, entry by entry; so do the coefficients left out. Units
    of states, inputs, outputs and copies play no part.
    """
    m, n = len(lft.blocks), lft.order
    zero: tuple[int, ...] = (0,) * m
    power: dict[tuple[int, ...], Array] = {zero: np.eye(n)}
    out: dict[tuple[int, ...], Array] = {zero: lft.M22}
    size = np.zeros((n, n))
    for _ in range(n):  # no polynomial of n copies has a higher degree
        size = size + sum(np.abs(M) for M in power.values())
        fed = _times_delta(power, lft)
        for exponents, M in fed.items():
            out[exponents] = out.get(exponents, np.zeros_like(lft.M22)) + lft.M21 @ M @ lft.M12
        power = {e: lft.M11 @ M for e, M in fed.items()}
        bar = _rounding(lft, size)
        if np.all(
            _rest(lft, size, sum((np.abs(M) for M in power.values()), np.zeros((n, n)))) <= bar
        ):
            kept = {e: np.where(np.abs(M) > bar, M, 0.0) for e, M in out.items() if e != zero}
            return {zero: lft.M22, **{e: M for e, M in kept.items() if np.any(M)}}
    return None if n else out


def _rounding(lft: LFT, size: Array) -> Array:
    """Return the largest change of M anywhere in the box, to first order, where every entry of M11
    .. M22 changes by `ROUNDING` of itself.

    `size` bounds (I - M11 Delta)^-1 entry by entry.
    """
    reached = np.abs(lft.M12) + np.abs(lft.M11) @ size @ np.abs(lft.M12)
    return ROUNDING * (np.abs(lft.M22) + np.abs(lft.M21) @ size @ reached)


def _rest(lft: LFT, size: Array, last: Array) -> Array:
    """Return a bound of all powers of L after the k summed so far: |L^k| <= `last`, |(I - L)^-1| <=
    `size` (I - last)^-1.
    """
    if not np.any(last):
        return np.zeros(lft.M22.shape)
    if not np.abs(np.linalg.eigvals(last)).max() < 0.5:
        return np.full(lft.M22.shape, np.inf)
    return (
        np.abs(lft.M21) @ size @ last @ np.linalg.solve(np.eye(lft.order) - last, np.abs(lft.M12))
    )


def _times_delta(word: Mapping[tuple[int, ...], Array], lft: LFT) -> dict[tuple[int, ...], Array]:
    """Delta times a polynomial in delta whose coefficients have the rows of the loop."""
    out: dict[tuple[int, ...], Array] = {}
    for exponents, M in word.items():
        for i, rows in enumerate(parts(lft.sizes)):
            if np.any(M[rows]):
                raised = (*exponents[:i], exponents[i] + 1, *exponents[i + 1 :])
                out.setdefault(raised, np.zeros_like(M))[rows] += M[rows]
    return out


def to_lpv(lft: LFT, degree: int | Sequence[int] | None) -> LPVStateSpace:
    """See `LFT.to_lpv`."""
    nx, box = len(lft.states), [(s.low, s.high) for s in lft.parameters]
    terms = expanded(lft)
    found = None if terms is None else [max(column) for column in zip(*terms, strict=True)]
    wanted = found if degree is None else np.broadcast_to(degree, len(box)).tolist()
    if wanted is None:
        raise InputError(
            "this LFT depends on its parameters rationally; to_lpv(degree=...) fits polynomials and"
            " reports the misfit"
        )
    misfit = None
    if found is not None and all(a <= b for a, b in zip(found, wanted, strict=True)):
        padded = {tuple(wanted): np.zeros_like(lft.M22), **(terms or {})}
        basis, M = coefficients_of(padded, box)
    else:
        basis = polynomials(wanted, box)
        nodes = interpolation_points([8 * (d + 1) - 1 for d in wanted], box)
        columns = nodes[:, None] if len(box) == 1 else nodes
        delta = [s.normalised(columns[:, i]) for i, s in enumerate(lft.parameters)]
        values = lft.matrix(np.stack(delta, axis=-1))
        M = basis.fit(nodes, values)
        wrong = np.tensordot(basis(nodes), M, axes=1) - values
        misfit = FitResiduals(
            nodes, wrong[:, :nx, :nx], wrong[:, :nx, nx:], wrong[:, nx:, :nx], wrong[:, nx:, nx:]
        )
    return LPVStateSpace(
        basis,
        M[:, :nx, :nx],
        M[:, :nx, nx:],
        M[:, nx:, :nx],
        M[:, nx:, nx:],
        lft.parameters,
        lft.states,
        lft.inputs,
        lft.outputs,
        dt=lft.dt,
        residuals=misfit,
    )
