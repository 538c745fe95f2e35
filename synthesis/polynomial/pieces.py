"""The matrices of a model as polynomials in Bernstein form on the pieces of its scheduling range:
`pieces(model)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import comb
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FunctionSpace, LPVStateSpace, Matrices, Piece, Product, Scheduling
from synthesis.polynomial.bernstein import restriction
from synthesis.polynomial.matrix import PolynomialMatrix

Array = np.ndarray

CONSTANT = 1e-14
"""Coefficients that differ by less than this fraction of the largest are one constant: the rounding
of the basis itself.
"""


class ModelPiece(NamedTuple):
    """A(p), B(p), C(p), D(p) on [low, high]: Bernstein coefficients (d + 1, rows, columns), d = 0
    where constant.
    """

    low: float
    high: float
    A: Array
    B: Array
    C: Array
    D: Array

    def scaled(
        self, left: Array, right: Array, inputs: Array, outputs: Array, time: float
    ) -> ModelPiece:
        """The piece with states x = right z (left = right^-1), dt = time dtau and u and y in the
        units `inputs` (nu,) and `outputs` (ny,).

        Both are per square root of the new time unit, so that energies keep their ratio.
        """
        root, out = np.sqrt(time), outputs[:, None]
        return self._replace(
            A=time * left @ self.A @ right,
            B=root * left @ self.B * inputs,
            C=root * self.C @ right / out,
            D=self.D * inputs / out,
        )


def model_pieces(lpv: LPVStateSpace) -> tuple[ModelPiece, ...]:
    """The pieces of the model over its scheduling range, in order of p.

    The coefficients are doubles: an exact proof is about the model they define, which is the given
    one to rounding.
    """
    s = lpv.scheduling
    return tuple(
        ModelPiece(a, b, *(_coefficients(M, functions) for M in (lpv.A, lpv.B, lpv.C, lpv.D)))
        for a, b, functions in function_pieces(lpv.basis, s.low, s.high)
    )


def function_pieces(basis: FunctionSpace, low: float, high: float) -> tuple[Piece, ...]:
    """The pieces of the functions of a basis between `low` and `high`."""
    slack = 1e-9 * (high - low)
    out = []
    for piece in basis.pieces():
        a, b = max(piece.low, low), min(piece.high, high)
        a, b = (low if abs(a - low) <= slack else a), (high if abs(b - high) <= slack else b)
        if b - a <= slack:
            continue
        functions = piece.bernstein
        if (a, b) != (piece.low, piece.high):
            width = piece.high - piece.low
            functions = (
                functions
                @ restriction(
                    functions.shape[1] - 1, (a - piece.low) / width, (b - piece.low) / width
                ).T
            )
        out.append(Piece(a, b, functions))
    return tuple(out)


def same_pieces(a: Sequence[ModelPiece], b: Sequence[ModelPiece]) -> bool:
    """Whether they are equal to the last bit."""
    return len(a) == len(b) and all(
        np.array_equal(x, y)
        for one, other in zip(a, b, strict=True)
        for x, y in zip(one, other, strict=True)
    )


def _coefficients(M: Array, functions: Array) -> Array:
    coefficients = np.tensordot(functions.T, M, axes=1)
    spread = np.ptp(coefficients, axis=0)
    # entry by entry: states and channels may differ in size by orders of magnitude
    if np.all(spread <= CONSTANT * np.abs(M).sum(axis=0) * np.abs(functions).max()):
        return coefficients.mean(axis=0)[None]
    return coefficients


class Pieces(NamedTuple):
    """A model of one or several parameters, polynomial between the `breaks` of each (most have none
    inside their range).

    `source` is the model as it was given.
    """

    source: LPVStateSpace
    parameters: tuple[Scheduling, ...]
    breaks: tuple[tuple[float, ...], ...]
    models: dict[tuple[int, ...], tuple[PolynomialMatrix, ...]]
    dt: float | None

    def at(self, p: Array) -> Matrices:
        """The matrices at p (k, m) by the model's own code, for checks."""
        return self.source.matrices(p[..., 0] if len(self.parameters) == 1 else p)

    @property
    def passes_peaks(self) -> bool:
        """Whether an input of any height passes at once to the outputs: feedthrough in continuous
        time.
        """
        return self.dt is None and any(np.any(D.coefficients) for *_, D in self.models.values())

    @property
    def original(self) -> bool:
        """Whether these are the pieces of the `source`, to the last bit."""
        own = pieces(self.source)
        same = (self.parameters, self.breaks, self.dt, self.models.keys()) == (
            own.parameters,
            own.breaks,
            own.dt,
            own.models.keys(),
        )
        return same and all(
            M.box == N.box and np.array_equal(M.coefficients, N.coefficients)
            for key in own.models
            for M, N in zip(self.models[key], own.models[key], strict=True)
        )

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Number of states, inputs and outputs."""
        A, B, C, _ = next(iter(self.models.values()))
        return A.shape[0], B.shape[1], C.shape[0]

    def scaled(
        self, left: Array, right: Array, inputs: float, outputs: float, time: float
    ) -> Pieces:
        """x = right z, dt = time dtau, u and y in the units `inputs` and `outputs`."""

        def change(M: PolynomialMatrix, L: Any, R: Any, factor: float) -> PolynomialMatrix:
            return PolynomialMatrix(M.box, factor * (L @ M.coefficients @ R))

        _, nu, ny = self.sizes
        one, two = np.eye(ny), np.eye(nu)
        models = {
            key: (
                change(A, left, right, time),
                change(B, left, two, time * inputs),
                change(C, one, right, 1 / outputs),
                change(D, one, two, inputs / outputs),
            )
            for key, (A, B, C, D) in self.models.items()
        }
        return self._replace(models=models)


def pieces(model: LPVStateSpace) -> Pieces:
    """The model in polynomial pieces over its box."""
    s = model.parameters
    if len(s) == 1:
        parts = model_pieces(model)
        models = {
            (k,): tuple(
                PolynomialMatrix(((piece.low, piece.high),), M)
                for M in (piece.A, piece.B, piece.C, piece.D)
            )
            for k, piece in enumerate(parts)
        }
        breaks = ((parts[0].low, *(piece.high for piece in parts)),)
        return Pieces(model, s, breaks, models, model.dt)
    basis = model.basis
    if not isinstance(basis, Product):
        raise InputError(
            f"{type(basis).__name__} is not known to be polynomial in each of {len(s)} parameters;"
            " use a Product of one-parameter bases"
        )
    axes = [function_pieces(f, q.low, q.high) for f, q in zip(basis.factors, s, strict=True)]
    models = {}
    for key in product(*(range(len(axis)) for axis in axes)):
        chosen = [axis[k] for axis, k in zip(axes, key, strict=True)]
        models[key] = tuple(
            _over_box(basis.tensor(M), chosen) for M in (model.A, model.B, model.C, model.D)
        )
    breaks = tuple((axis[0].low, *(piece.high for piece in axis)) for axis in axes)
    return Pieces(model, s, breaks, models, model.dt)


def _over_box(tensor: Array, chosen: Sequence[Piece]) -> PolynomialMatrix:
    """Bernstein coefficients of sum_j f_j M_j, f_j products of functions on one piece each."""
    coefficients = tensor
    for i, piece in enumerate(chosen):
        coefficients = np.moveaxis(np.tensordot(piece.bernstein.T, coefficients, axes=(1, i)), 0, i)
    for i in range(len(chosen)):
        coefficients = _lowered(coefficients, i)
    return PolynomialMatrix(tuple((q.low, q.high) for q in chosen), coefficients)


def _lowered(coefficients: Array, axis: int) -> Array:
    """The same polynomial written in the degree it has along one axis, to rounding."""
    c = np.moveaxis(coefficients, axis, 0)
    while (d := len(c) - 1) > 0:
        binomials = np.array([comb(d, k) for k in range(d + 1)], dtype=float)
        top = np.tensordot(binomials * (-1.0) ** np.arange(d + 1), c, axes=1)
        if np.any(np.abs(top) > CONSTANT * np.tensordot(binomials, np.abs(c), axes=1)):
            break
        raised = np.zeros((d + 1, d))
        k = np.arange(d)
        raised[k, k], raised[k + 1, k] = 1 - k / d, (k + 1) / d
        c = np.tensordot(np.linalg.pinv(raised), c, axes=1)
    return np.moveaxis(c, 0, axis)
