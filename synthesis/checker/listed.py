"""Functions V of listed models that follow one another in any order, or mix.

V = x' P(w) x, w the word of the mode that acts now and of those that act next; for every word (i,
..., j) of one mode more, w without its last and w+ without its first letter, in discrete time

    level P(w) - A_i' P(w+) A_i > 0  (growth),
    [P(w), 0; 0, level] - [A_i, B_i]' P(w+) [A_i, B_i] - [C_i, D_i]' [C_i, D_i] > 0  (gain)

and P(w) > 0; in continuous time one P, level P - A_i'P - P A_i > 0, and the bounded real lemma. By
Schur's complement they are affine in every mode of w, and so hold for mixtures. The level is the
square of the factor or gain, twice the exponent. Of growth, x may stand for its monomials of degree
d, which move linearly; the level is then that of d times the growth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations_with_replacement, product
from typing import Any, NamedTuple

from . import words
from .demands import Claim, Demand
from .polynomials import Polynomial, block, diagonal, even, matrix, zero
from .reading import Unreadable, array, number, period, whole

GROWTH, GAIN = "growth of listed models", "l2 gain of listed models"
MOST_WORDS, MOST_LETTERS, HIGHEST = 5000, 12, 12
"""Words, letters of one, and degree of monomials beyond which nothing is read."""

Rows = list[list[Fraction]]


class Model(NamedTuple):
    """Matrices of one of the listed models."""

    A: Polynomial
    B: Polynomial
    C: Polynomial
    D: Polynomial


def risen(A: Sequence[Sequence[Fraction]], degree: int, sampled: bool) -> Rows:
    """Return the matrix by which the monomials of this degree move where x moves by A."""
    n = range(len(A))
    every = list(combinations_with_replacement(n, degree))
    place = {word: i for i, word in enumerate(every)}
    out = [[Fraction(0)] * len(every) for _ in every]
    for row, word in zip(out, every, strict=True):
        if sampled:
            # the product of the sums over j of A_ij x_j, multiplied out factor by factor
            terms: dict[tuple[int, ...], Fraction] = {(): Fraction(1)}
            for i in word:
                longer: dict[tuple[int, ...], Fraction] = {}
                for known, value in terms.items():
                    for j in n:
                        key = tuple(sorted((*known, j)))
                        longer[key] = longer.get(key, Fraction(0)) + value * A[i][j]
                terms = longer
        else:
            # by the rule of the product
            terms = {}
            for k, i in enumerate(word):
                for j in n:
                    key = tuple(sorted((*word[:k], *word[k + 1 :], j)))
                    terms[key] = terms.get(key, Fraction(0)) + A[i][j]
        for key, value in terms.items():
            row[place[key]] += value
    return out


def demands(
    models: Sequence[Model], P: Sequence[Polynomial], letters: int, sampled: bool, gain: bool
) -> Iterator[Demand]:
    """Yield everything that must be positive definite, P by the words in order."""
    modes = range(len(models))
    place = {word: i for i, word in enumerate(product(modes, repeat=letters))}
    for word, i in place.items():
        yield Demand(f"V > 0 before the modes {word}", P[i])
    for word in product(modes, repeat=letters + 1 if sampled else 1):
        own = models[word[0]]
        before, after = P[place[word[:letters]]], P[place[word[1:] if letters else ()]]
        said = f"V falls along the modes {word}"
        if not gain:
            moved = before @ own.A
            form = -(own.A.T @ after @ own.A) if sampled else -(moved + moved.T)
            yield Demand(said, form, None, before)
            continue
        moves, shows = block([[own.A, own.B]]), block([[own.C, own.D]])
        states, inputs = own.A.shape[0], own.B.shape[1]
        keeps = block([[diagonal([1] * states), zero(states, inputs)]])
        rate = keeps.T @ before @ moves
        if sampled:
            change = moves.T @ after @ moves - keeps.T @ before @ keeps
        else:
            change = rate + rate.T
        energy = diagonal([0] * states + [1] * inputs)
        yield Demand(said, -(change + shows.T @ shows), None, energy)


def claimed(content: Any) -> Claim:
    """Return what a file of listed models claims; its fields are named here alone."""
    dt, gain = period(content["dt"]), content["kind"] == GAIN
    letters = whole(content["letters"], "the letters", 0, MOST_LETTERS if dt else 0)
    degree = whole(content["degree"], "the degree", 1, 1 if gain else HIGHEST)
    every = [array(content["A"], "A", None, None, None)]
    count, n = len(every[0]), len(every[0][0])
    every[0] = array(content["A"], "A", count, n, n)
    if not 0 < count ** (letters + 1) <= MOST_WORDS:
        raise Unreadable("the words of the modes are more than this checker looks at")
    if gain:
        nu, ny = (content[name]["shape"][axis] for name, axis in (("B", 2), ("C", 1)))
        nu, ny = whole(nu, "the inputs", 1, 10**4), whole(ny, "the outputs", 1, 10**4)
        shapes = {"B": (count, n, nu), "C": (count, ny, n), "D": (count, ny, nu)}
        every += [array(content[name], name, *shape) for name, shape in shapes.items()]
        widths = (n, nu, n, nu)
        models = [
            Model(*(matrix(M, c) for M, c in zip(one, widths, strict=True)))
            for one in zip(*every, strict=True)
        ]
    else:
        moves = [risen(A, degree, dt is not None) for A in every[0]]
        nothing = zero(0, 0)
        models = [Model(matrix(A, len(A)), nothing, nothing, nothing) for A in moves]
    m = models[0].A.shape[0]
    P = [even(M) for M in array(content["P"], "P", count**letters, m, m)]
    bound = number(content["bound"], "the bound")
    refused = "a factor or a gain is not below zero" if bound < 0 and (gain or dt) else ""

    def level(value: Fraction) -> Fraction:
        return 2 * degree * value if dt is None and not gain else value ** (2 * degree)

    time = "in continuous time" if dt is None else f"sampled every {float(dt)!r} s"
    said = [f"{count} linear models of {n} states, {time}, in any order and any mixture"]
    claim = _claim(bound, gain, dt is not None)
    return Claim(claim, said, demands(models, P, letters, dt is not None, gain), bound, level,
                 refused=refused)  # fmt: skip


def _claim(bound: Fraction, gain: bool, sampled: bool) -> str:
    if gain:
        return words.energy(bound)
    if sampled:
        return f"every state stays below a constant times {float(bound)!r}^k after k samples"
    return f"every state stays below a constant times exp({float(bound)!r} t), t in s"
