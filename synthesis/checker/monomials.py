"""Functions V = z' P z of the monomials z of one degree, `order`, in x."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations_with_replacement as powers

from .polynomials import Polynomial, bernstein_functions, combined, matrix, variable
from .reading import Unreadable


def generator(A: Polynomial, order: int) -> Polynomial:
    """Return G of dz/dt = G z where dx/dt = A x."""
    if order == 1:
        return A
    n, z, terms = A.shape[0], list(powers(range(A.shape[0]), order)), {}
    place = {factors: i for i, factors in enumerate(z)}
    for k, rows in A.terms.items():
        terms[k] = [[0] * len(z) for _ in z]
        for i, factors in enumerate(z):
            for at, factor in enumerate(factors):
                for j in range(n):
                    other = tuple(sorted((*factors[:at], j, *factors[at + 1 :])))
                    terms[k][i][place[other]] += rows[factor][j]
    return Polynomial((len(z), len(z)), terms, A.below)


def zeros(
    weights: Sequence[Sequence[Fraction]], n: int, order: int, count: int
) -> Iterator[Polynomial]:
    """Yield `count` polynomials L with z' L z = 0, by rows of weights of their Bernstein
    coefficients: each weight stands at a pair of monomials, and is taken away at the first pair
    with the same product.
    """
    if not weights:
        return
    z, first, pairs = list(powers(range(n), order)), {}, []
    for b in range(len(z)):
        for a in range(b + 1):
            same = first.setdefault(tuple(sorted(z[a] + z[b])), (a, b))
            if same != (a, b):
                pairs.append(((a, b), same))
    each, rest = divmod(len(weights), count)
    if rest or not each:
        raise Unreadable("the file is damaged: rows of slack that fit no degree")
    forms = []
    for row in weights:
        L = [[Fraction(0)] * len(z) for _ in z]
        for weight, entries in zip(row, pairs, strict=True):
            for sign, (a, b) in zip((1, -1), entries, strict=True):
                L[a][b] += sign * weight
                L[b][a] += sign * weight
        forms.append(matrix(L, len(z)))
    for k in range(0, len(forms), each):
        yield combined(bernstein_functions(each - 1, variable(0)), forms[k : k + each])
