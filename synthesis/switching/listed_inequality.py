"""Functions V of models that are listed and may follow one another in any order, in exact
arithmetic.

In discrete time x+ = A_i x + B_i u, y = C_i x + D_i u with any sequence of i, V = x' P(w) x depends
on the word w of the mode that acts now and those that act next. For every word (i, ..., j) of one
mode more, w without its last and w+ without its first letter,

    level P(w) - A_i' P(w+) A_i > 0  (growth),
    [P(w) - A_i'P(w+)A_i - C_i'C_i, *; -B_i'P(w+)A_i - D_i'C_i, level - B_i'P(w+)B_i - D_i'D_i] > 0

and P(w) > 0. Words of no letter: one P. By Schur's complement both are affine in each factor of w,
so that they hold for every mixture of the listed models, too (Daafouz and Bernussou, Systems and
Control Letters 43, 2001; Ahmadi, Jungers, Parrilo and Roozbehani, SIAM J. Control and Optimization
52, 2014). In continuous time one P: level P - A_i'P - P A_i > 0, and the bounded real lemma.

Of growth, x may be replaced by its monomials of degree d, which follow linear equations, too
(Parrilo and Jadbabaie, Linear Algebra and its Applications 428, 2008): the level is the d-th power.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import exact, positive_definite, rational

Word = tuple[int, ...]


class Listed(NamedTuple):
    """Models of equal sizes A (N, n, n), B (N, n, nu), C (N, ny, n), D (N, ny, nu), and the sample
    period, s; None: continuous time.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    dt: float | None

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """The matrices without the sample period."""
        return self.A, self.B, self.C, self.D

    def changed(self, change: Callable[[str, Array], Array]) -> Listed:
        """Return the models with each matrix changed, by its name."""
        A, B, C, D = (change(n, M) for n, M in zip("ABCD", self.matrices, strict=True))
        return Listed(A, B, C, D, self.dt)

    def lifted(self, degree: int) -> Listed:
        """Return the models of the monomials of x of this degree, without inputs and outputs."""
        A = np.array([lifted(each, degree, self.dt is not None) for each in self.A])
        n, count = A.shape[-1], len(A)
        B, C, D = np.zeros((count, n, 0)), np.zeros((count, 0, n)), np.zeros((count, 0, 0))
        return Listed(A, B, C, D, self.dt)

    def exactly(self) -> Listed:
        """Return the same matrices as rationals."""
        number = rational()
        return self.changed(lambda _, M: exact(M, number))


def words(count: int, letters: int) -> list[Word]:
    """Return all words of so many letters, in order."""
    return list(product(range(count), repeat=letters))


@cache
def monomials(n: int, degree: int) -> dict[Word, int]:
    """Return the place of each product of `degree` states, as ascending states."""
    return {word: i for i, word in enumerate(combinations_with_replacement(range(n), degree))}


def lifted(A: Array, degree: int, sampled: bool) -> Array:
    """Return the matrix by which monomials of this degree move where x moves by A."""
    if degree == 1:
        return A
    place = monomials(len(A), degree)
    out = np.zeros((len(place), len(place)), dtype=A.dtype)
    for word, row in place.items():
        for column, value in (_powers if sampled else _slopes)(A, word):
            out[row, place[column]] += value
    return out


def _powers(A: Array, word: Word) -> list[tuple[Word, float]]:
    every = product(range(len(A)), repeat=len(word))
    return [
        (tuple(sorted(into)), math.prod(A[i, j] for i, j in zip(word, into, strict=True)))
        for into in every
    ]


def _slopes(A: Array, word: Word) -> list[tuple[Word, float]]:
    every = product(range(len(word)), range(len(A)))
    return [(tuple(sorted((*word[:k], j, *word[k + 1 :]))), A[word[k], j]) for k, j in every]


def holds(models: Listed, P: Array, letters: int, level: float, degree: int, gain: bool) -> bool:
    """Whether P (N^letters, n, n) proves the bound, whose power is the level: the square of a gain
    or of a factor a sample, to the `degree` of the monomials; twice an exponent times it.
    """
    if not np.array_equal(P, np.swapaxes(P, -1, -2)):
        return False  # lower triangles alone are read below
    if level < 0 and (gain or models.dt is not None):
        return False  # its square says nothing
    own, number = models.exactly().lifted(degree), rational()
    if gain:
        own = models.exactly()
    exactly, bound = exact(P, number), number(float(level))
    power = (bound + bound) * degree if models.dt is None and not gain else bound ** (2 * degree)
    every = (positive_definite(each) for each in exactly)
    return all(every) and all(
        positive_definite(form) for form in inequalities(own, exactly, letters, power, gain)
    )


def inequalities(models: Listed, P: Array, letters: int, power: float, gain: bool) -> list[Array]:
    """Return what must be positive definite beside P, in the arithmetic of its arguments."""
    count = len(models.A)
    place = {word: i for i, word in enumerate(words(count, letters))}
    out = []
    for word in words(count, letters + 1 if models.dt is not None else 1):
        before, after = (P[0], P[0]) if letters == 0 else (P[place[word[:-1]]], P[place[word[1:]]])
        A, B, C, D = (M[word[0]] for M in models.matrices)
        if models.dt is not None:
            moved = after @ A
            xx, xu, uu = before - A.T @ moved, -B.T @ moved, -B.T @ after @ B
        else:
            moved = before @ A
            xx, xu, uu = -(moved + moved.T), -B.T @ before, 0 * (D.T @ D)
        if not gain:
            growing = power * before
            out.append(xx - before + growing if models.dt is not None else xx + growing)
            continue
        across = xu - D.T @ C
        level = power * np.eye(len(uu), dtype=int)
        out.append(np.block([[xx - C.T @ C, across.T], [across, level + uu - D.T @ D]]))
    return out
