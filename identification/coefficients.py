"""The coefficients of an identified model, by lag and basis function."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.structure import LPVARX
from symheli.errors import InputError
from symheli.lpv import Basis, Polynomial
from symheli.lpv.arrays import Array, frozen


class CoefficientValues(NamedTuple):
    """Coefficients at given p: A (..., na, ny, ny), B (..., nb, ny, nu), c (..., ny), d (..., ny); the axes of p come first."""

    A: Array
    B: Array
    c: Array
    d: Array


@dataclass(frozen=True, eq=False)
class Coefficients:
    """A_i(p) = sum_j f_j(p) A[i-1, j] and so on, f_j the functions of `basis`.

    A (na, n, ny, ny) for output lags 1 .. na, B (nb, n, ny, nu) for the lags `input_lags`, c (n, ny) and d (n, ny) for
    the offset and the increment of p (zero where the structure has none). Units: those of y per those of what they multiply.
    """

    basis: Basis
    input_lags: tuple[int, ...]
    A: Array
    B: Array
    c: Array
    d: Array

    def __post_init__(self) -> None:
        n, ny = self.basis.size, self.c.shape[-1]
        for name, shape in (("A", (None, n, ny, ny)), ("B", (len(self.input_lags), n, ny, None)), ("c", (n, ny)), ("d", (n, ny))):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))

    @classmethod
    def of(cls, arx: LPVARX, theta: Array) -> Coefficients:
        """From theta (n_regressors, ny) in the order of the regressors."""
        n, ny = arx.basis.size, arx.ny
        A, B = np.zeros((arx.na, n, ny, ny)), np.zeros((len(arx.input_lags), n, ny, arx.nu))
        c, d = np.zeros((n, ny)), np.zeros((n, ny))
        row = 0
        for term in arx.terms:
            width = len(arx.channels(term))
            block = theta[row : row + width * n].reshape(width, n, ny).transpose(1, 2, 0)  # (function, output, channel)
            row += width * n
            match term.kind:
                case "output":
                    A[term.lag - 1] = block
                case "input":
                    B[term.lag - arx.delay] = block
                case "offset":
                    c[:] = block[:, :, 0]
                case "increment":
                    d[:] = block[:, :, 0]
        return cls(arx.basis, tuple(arx.input_lags), A, B, c, d)

    def theta(self, arx: LPVARX) -> Array:
        """(n_regressors, ny) in the order of the regressors: the inverse of `of`."""
        blocks = []
        for term in arx.terms:
            match term.kind:
                case "output":
                    block = self.A[term.lag - 1]
                case "input":
                    block = self.B[term.lag - arx.delay]
                case "offset":
                    block = self.c[:, :, None]
                case "increment":
                    block = self.d[:, :, None]
            blocks.append(block.transpose(2, 0, 1).reshape(-1, arx.ny))
        return np.vstack(blocks)

    def at(self, p: object) -> CoefficientValues:
        """Values at p (a number or an array, unit of the scheduling signal); raises `InputError` outside the basis."""
        f = self.basis(p)
        return CoefficientValues(
            np.einsum("...j,ijyz->...iyz", f, self.A), np.einsum("...j,ijyz->...iyz", f, self.B), f @ self.c, f @ self.d
        )

    def monomial(self) -> CoefficientValues:
        """Coefficients of 1, p, p^2, ... (p in its own unit), arranged as A, B, c, d are; polynomial bases only."""
        if not isinstance(self.basis, Polynomial):
            raise InputError(f"only a polynomial basis has monomial coefficients, this one is {type(self.basis).__name__}")
        T = self.basis.monomial
        return CoefficientValues(np.einsum("jm,ijyz->imyz", T, self.A), np.einsum("jm,ijyz->imyz", T, self.B), T.T @ self.c, T.T @ self.d)
