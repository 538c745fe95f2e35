"""The coefficients of an identified model, by lag and basis function."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.structure.lpvarx import LPVARX, Term
from symheli.lpv.bases import FunctionSpace
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized


class CoefficientValues(NamedTuple):
    """Coefficients at given p; the axes of p come first.

    Parameters
    ----------
    A : array (..., na, ny, ny)
        Of the outputs.
    B : array (..., nb, ny, nu)
        Of the inputs.
    c : array (..., ny)
        The offset.
    d : array (..., ny) or (..., ny, parameters)
        Of the increment of p.

    Examples
    --------
    >>> values = model.coefficients.at([-1.0, 0.0, 1.0])
    >>> print(values.A[:, 0, 0, 0].round(1))
    [-0.2 -0.5 -0.8]
    """

    A: Array
    B: Array
    c: Array
    d: Array

    __repr__ = summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class Coefficients:
    """A_i(p) = sum_j f_j(p) A[i-1, j] and so on, f_j the n functions of a basis.

    Units are those of y per those of what they multiply; c and d are zero where the structure has
    none.

    Parameters
    ----------
    basis : FunctionSpace
        The functions f_j.
    input_lags : tuple of int
        The lags of B, samples.
    A : array (na, n, ny, ny)
        For the output lags 1 .. na.
    B : array (nb, n, ny, nu)
        For `input_lags`.
    c : array (n, ny)
        The offset.
    d : array (n, ny) or (n, ny, parameters)
        Of the increment of p.

    Examples
    --------
    In powers of p, A(p) = -0.5 - 0.3 p:

    >>> print(model.coefficients.monomial().A[0, :, 0, 0].round(1))
    [-0.5 -0.3]
    """

    basis: FunctionSpace
    input_lags: tuple[int, ...]
    A: Array
    B: Array
    c: Array
    d: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        n, ny = self.basis.size, self.c.shape[-1]
        increments = (n, ny) if self.basis.dimension == 1 else (n, ny, self.basis.dimension)
        for name, shape in (
            ("A", (None, n, ny, ny)),
            ("B", (len(self.input_lags), n, ny, None)),
            ("c", (n, ny)),
            ("d", increments),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))

    @classmethod
    def of(cls, arx: LPVARX, theta: Array) -> Coefficients:
        """Return the coefficients of theta (n_regressors, ny) in the order of the regressors."""
        n, ny, d = arx.basis.size, arx.ny, len(arx.parameters)
        blocks = {
            "output": np.zeros((len(arx.output_lags), n, ny, ny)),
            "input": np.zeros((len(arx.input_lags), n, ny, arx.nu)),
            "offset": np.zeros((1, n, ny, 1)),
            "increment": np.zeros((1, n, ny, d)),
        }
        row = 0
        for term in arx.terms:
            width = len(term.signals)
            block = (
                theta[row : row + width * n].reshape(width, n, ny).transpose(1, 2, 0)
            )  # (function, output, signal)
            blocks[term.kind][_position(arx, term)][:, :, list(term.signals)] = block
            row += width * n
        A, B, c, increments = blocks.values()
        return cls(
            basis=arx.basis,
            input_lags=tuple(arx.input_lags),
            A=A,
            B=B,
            c=c[0, :, :, 0],
            d=increments[0, :, :, 0] if d == 1 else increments[0],
        )

    def theta(self, arx: LPVARX) -> Array:
        """(n_regressors, ny) in the order of the regressors: the inverse of `of`."""
        increments = self.d.reshape(1, *self.c.shape, -1)
        source = {
            "output": self.A,
            "input": self.B,
            "offset": self.c[None, :, :, None],
            "increment": increments,
        }
        blocks = [
            source[t.kind][_position(arx, t)][:, :, list(t.signals)]
            .transpose(2, 0, 1)
            .reshape(-1, arx.ny)
            for t in arx.terms
        ]
        return np.where(arx.free, np.vstack(blocks), 0.0)

    def at(self, p: object) -> CoefficientValues:
        """Values at p (a number or an array in the unit of the scheduling signal; several
        parameters along the last axis).

        Raises `InputError` outside the basis.
        """
        f = self.basis(p)
        A, B = (np.einsum("...j,ijyz->...iyz", f, M) for M in (self.A, self.B))
        return CoefficientValues(A, B, *(np.tensordot(f, M, axes=1) for M in (self.c, self.d)))

    def form(self, name: str) -> CoefficientValues:
        """Coefficients of the functions of another form, arranged as A, B, c, d are.

        For polynomials (and products of them): "monomial" (1, p, p^2, ... in the unit of p),
        "scaled" (powers of x in [-1, 1] over the range), "chebyshev", "legendre", "orthonormal",
        "bernstein".
        """
        T = self.basis.form(name)
        A, B = (np.einsum("jm,ijyz->imyz", T, M) for M in (self.A, self.B))
        return CoefficientValues(A, B, *(np.tensordot(T.T, M, axes=1) for M in (self.c, self.d)))

    def monomial(self) -> CoefficientValues:
        """Coefficients of 1, p, p^2, ... (p in its own unit), arranged as A, B, c, d are;
        polynomial bases only.
        """
        return self.form("monomial")


def _position(arx: LPVARX, term: Term) -> int:
    """Position of the coefficients of a term along the first axis of A or B."""
    match term.kind:
        case "output":
            return term.lag - 1
        case "input":
            return term.lag - arx.input_lags[0]
    return 0
