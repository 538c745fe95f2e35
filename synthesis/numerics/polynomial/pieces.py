"""The matrices of a model as polynomials in Bernstein form on the pieces of its scheduling range:
`pieces(model)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace, Piece, Polynomial, Product
from symheli.lpv.lpv_matrices import LPVMatrices, Matrices
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.bernstein import restriction
from synthesis.numerics.polynomial.matrix import PolynomialMatrix


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
        """Return the piece with states x = right z (left = right^-1), dt = time dtau and u and y in
        the units `inputs` (nu,) and `outputs` (ny,).

        Both are per square root of the new time unit, so that energies keep their ratio.
        """
        root, out = np.sqrt(time), outputs[:, None]
        return self._replace(
            A=time * left @ self.A @ right,
            B=root * left @ self.B * inputs,
            C=root * self.C @ right / out,
            D=self.D * inputs / out,
        )


def model_pieces(lpv: LPVMatrices) -> tuple[ModelPiece, ...]:
    """Return the pieces of the model over its scheduling range, in order of p.

    The coefficients are doubles: an exact proof is about the model they define, which is the given
    one but for the rounding of each. What varies with p in the last place only varies there too; a
    matrix is constant where its coefficients in the basis say so exactly.
    """
    s = lpv.scheduling
    every = []
    for M in (lpv.A, lpv.B, lpv.C, lpv.D):
        basis, least = _in_least_degree(lpv.basis, M)
        if basis is None:
            every.append(None)
            continue
        found = function_pieces(basis, s.low, s.high)
        every.append([np.tensordot(functions.T, least, axes=1) for _, _, functions in found])
    return tuple(
        ModelPiece(a, b, *_each(every, k, lpv))
        for k, (a, b, _) in enumerate(function_pieces(lpv.basis, s.low, s.high))
    )


def function_pieces(basis: FunctionSpace, low: float, high: float) -> tuple[Piece, ...]:
    """Return the pieces of the functions of a basis between `low` and `high`, however narrow: none
    is left out. Where the basis ends before the range does, by rounding, its first and last
    polynomial continue, as its values do.
    """
    every = basis.pieces()
    out = []
    for k, piece in enumerate(every):
        a = low if k == 0 else max(piece.low, low)
        b = high if k == len(every) - 1 else min(piece.high, high)
        if not a < b:
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


def _each(every: Sequence[list[Array] | None], k: int, lpv: LPVMatrices) -> list[Array]:
    """Return the coefficients on piece k; for a constant matrix, a single one."""
    return [
        found[k] if found is not None else _constant(lpv.basis, M)[None]  # type: ignore[index]
        for found, M in zip(every, (lpv.A, lpv.B, lpv.C, lpv.D), strict=True)
    ]


def _in_least_degree(basis: FunctionSpace, M: Array) -> tuple[FunctionSpace | None, Array]:
    """Return the same function of one parameter in as few functions as the zeros of M allow; None
    and the matrix (1, ...) of a constant. Exact: no small number is dropped.
    """
    constant = _constant(basis, M)
    if constant is not None:
        return None, constant[None]
    if isinstance(basis, Polynomial):
        degree = int(np.flatnonzero(np.any(M.reshape(len(M), -1) != 0, axis=1))[-1])
        return Polynomial(degree, basis.low, basis.high), M[: degree + 1]
    return basis, M


def _constant(basis: FunctionSpace, M: Array) -> Array | None:
    """Return the constant matrix that the coefficients M represent, None where they
    represent none.
    """
    try:
        one = basis.constant()
    except InputError:
        return None
    k = int(np.argmax(np.abs(one)))
    same = one[k] == 1.0 and np.array_equal(M, np.multiply.outer(one, M[k]))
    return M[k] if same else None


class Pieces(NamedTuple):
    """A model of one or several parameters, polynomial between the `breaks` of each (most have none
    inside their range).

    `source` is the model as it was given: an `LPVStateSpace`, of a file its `LPVMatrices`.
    """

    source: Any
    parameters: tuple[Scheduling, ...]
    breaks: tuple[tuple[float, ...], ...]
    models: dict[tuple[int, ...], tuple[PolynomialMatrix, ...]]
    dt: float | None

    def at(self, p: Array) -> Matrices:
        """Return the matrices at p (k, m) by the model's own code, for checks."""
        return self.source.matrices(p[..., 0] if len(self.parameters) == 1 else p)

    @property
    def passes_peaks(self) -> bool:
        """Whether an input peak of any height passes to the outputs at once: feedthrough in
        continuous time.
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
        """Numbers of states, inputs and outputs."""
        A, B, C, _ = next(iter(self.models.values()))
        return A.shape[0], B.shape[1], C.shape[0]

    def scaled(
        self, left: Array, right: Array, inputs: float, outputs: float, time: float
    ) -> Pieces:
        """Return the model with x = right z, dt = time dtau, u and y in the units `inputs` and
        `outputs`.
        """

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


def pieces(model: LPVMatrices) -> Pieces:
    """Return the model in polynomial pieces over its box."""
    s = model.parameters
    if len(s) == 1:
        return joined(model, model_pieces(model))
    basis = model.basis
    if not isinstance(basis, Product):
        raise InputError(
            f"{type(basis).__name__} is not known to be polynomial in each of {len(s)} parameters;"
            " use a Product of one-parameter bases"
        )
    axes = [function_pieces(f, q.low, q.high) for f, q in zip(basis.factors, s, strict=True)]
    every = [_along_axes(basis, M, s) for M in (model.A, model.B, model.C, model.D)]
    models = {}
    for key in product(*(range(len(axis)) for axis in axes)):
        box = tuple((axis[k].low, axis[k].high) for axis, k in zip(axes, key, strict=True))
        models[key] = tuple(
            _over_box(tensor, [each[k] for each, k in zip(functions, key, strict=True)], box)
            for tensor, functions in every
        )
    breaks = tuple((axis[0].low, *(piece.high for piece in axis)) for axis in axes)
    return Pieces(model, s, breaks, models, model.dt)


def joined(model: LPVMatrices, parts: Sequence[ModelPiece]) -> Pieces:
    """Return the pieces of the `parts` of a model of one parameter, in any units."""
    models = {
        (k,): tuple(PolynomialMatrix(((piece.low, piece.high),), M) for M in piece[2:])
        for k, piece in enumerate(parts)
    }
    breaks = ((parts[0].low, *(piece.high for piece in parts)),)
    return Pieces(model, model.parameters, breaks, models, model.dt)


def _along_axes(
    basis: Product, M: Array, s: Sequence[Scheduling]
) -> tuple[Array, list[list[Array]]]:
    """Return M as a tensor, in as few functions of each parameter as its zeros allow, and the
    Bernstein coefficients of those on every piece of each.
    """
    tensor, functions = basis.tensor(M), []
    for i, (factor, q) in enumerate(zip(basis.factors, s, strict=True)):
        own, least = _in_least_degree(factor, np.moveaxis(tensor, i, 0))
        tensor = np.moveaxis(least, 0, i)
        found = function_pieces(factor if own is None else own, q.low, q.high)
        one = np.ones((1, 1))
        functions.append([one if own is None else piece.bernstein for piece in found])
    return tensor, functions


def _over_box(tensor: Array, functions: Sequence[Array], box: Any) -> PolynomialMatrix:
    """Return the Bernstein coefficients of sum_j f_j M_j, f_j products of functions on one piece
    each.
    """
    coefficients = tensor
    for i, bernstein in enumerate(functions):
        coefficients = np.moveaxis(np.tensordot(bernstein.T, coefficients, axes=(1, i)), 0, i)
    return PolynomialMatrix(box, coefficients)
