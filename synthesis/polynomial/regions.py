"""The boxes on which an inequality is one polynomial, and the model and P there, in any
arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, product
from math import comb
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace, Matrices, Piece, Product, Scheduling
from synthesis.bernstein import composition
from synthesis.cells import Strip, strips
from synthesis.pieces import CONSTANT, ModelPiece, function_pieces, model_pieces
from synthesis.polynomial.matrix import Box, PolynomialMatrix

Array = np.ndarray
Number = Callable[[float], Any]


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


class Region(NamedTuple):
    """One strip a parameter: p in a box, inside one piece of the model and one segment of P, and
    where p(k+1) may be.
    """

    strips: tuple[Strip, ...]
    piece: tuple[int, ...]

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """Range of p."""
        return tuple((s.cell.low, s.cell.high) for s in self.strips)

    @property
    def segment(self) -> tuple[int, ...]:
        """Segment of P, one index a parameter."""
        return tuple(s.cell.segment for s in self.strips)

    @property
    def next_segment(self) -> tuple[int, ...]:
        """Segment of P at p(k+1)."""
        return tuple(s.next_segment for s in self.strips)


def regions(model: Pieces, knots: Sequence[Array], steps: Sequence[float]) -> Iterator[Region]:
    """All of them: the ranges cut at knots and breaks, and where p moves by at most `steps` a
    sample, where that leads to.
    """
    nothing = np.zeros((1, 0, 0))
    every = []
    for breaks, k, step in zip(model.breaks, knots, steps, strict=True):
        # only the ends of the pieces matter here
        stretches = [
            ModelPiece(a, b, nothing, nothing, nothing, nothing) for a, b in pairwise(breaks)
        ]
        every.append(strips(stretches, k, step))
    for choice in product(*every):
        index = [
            int(np.searchsorted(b, 0.5 * (s.cell.low + s.cell.high)) - 1)
            for b, s in zip(model.breaks, choice, strict=True)
        ]
        yield Region(choice, tuple(index))


def exact(values: Array, number: Number) -> Array:
    """The doubles as numbers of the arithmetic."""
    return (
        np.asarray(values, dtype=float)
        if number is float
        else np.asarray(np.frompyfunc(number, 1, 1)(values), dtype=object)
    )


def convert(F: PolynomialMatrix, number: Number) -> PolynomialMatrix:
    """The polynomial with its doubles as numbers of the arithmetic."""
    box = tuple((number(float(a)), number(float(b))) for a, b in F.box)
    return PolynomialMatrix(box, exact(F.coefficients, number))


def model_on(model: Pieces, region: Region, number: Number) -> tuple[PolynomialMatrix, ...]:
    """A, B, C, D over the box of the region."""
    box = _box(region, number)
    return tuple(convert(M, number).restrict(box) for M in model.models[region.piece])


def now(P: PolynomialMatrix, region: Region, number: Number) -> PolynomialMatrix:
    """P(p) over the box of the region; P in the arithmetic of the proof, on its segment."""
    return P.restrict(_box(region, number))


def successor(
    P: PolynomialMatrix, region: Region, number: Number, moving: Sequence[bool]
) -> PolynomialMatrix:
    """P(p(k+1)) over the box of p and one [0, 1] a parameter, which runs from the lower to the
    upper limit of p(k+1).
    """
    m = len(P.box)
    box, c = _box(region, number), P.coefficients
    for i, strip in enumerate(region.strips):
        low, high = P.box[i]
        corners = [[(number(q) - low) / (high - low) for q in pair] for pair in strip.corners]
        if not moving[i]:
            corners = [[pair[0], pair[0]] for pair in corners]
        T = composition(P.degrees[i], corners)
        if not moving[i]:
            T = T[:, :1]
        elif corners[0] == corners[1]:
            # where p(k+1) may be does not depend on p: a step as wide as the range, or a strip
            # between two knots
            T = T[:1]
        # axis i becomes x_i; s_i goes behind the parameters
        c = np.tensordot(T, c, axes=(2, i))
        c = np.moveaxis(c, (0, 1), (i, m + i))
    unit = (number(0.0), number(1.0))
    return PolynomialMatrix((*box, *(unit,) * m), c)


def _box(region: Region, number: Number) -> Box:
    return tuple((number(a), number(b)) for a, b in region.box)
