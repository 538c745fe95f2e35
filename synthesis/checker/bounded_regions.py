"""A polynomial V that somebody else computed: {V <= rho} is a region of attraction of x' = f(x).

It is where {V <= rho} is bounded, and V > 0 > dV/dt at all of its x other than zero: a component of
it holds a least V, there dV/dx = 0, so that it is zero. With x = diag(box) r y, y on a face of the
unit box, the signs of V/r^k, (dV/dt)/r^l and V - rho are decided on 0 <= r <= 1, and with r = 1/s,
V > rho on 0 <= s <= 1, by Bernstein coefficients on boxes that are halved.
"""

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product as combinations
from typing import Any

from .demands import Claim
from .polynomials import Polynomial, bernstein_coefficients, scalar, variable
from .reading import Unreadable, whole

MOST_BOXES, MOST_TERMS, MOST_STATES = 20_000, 5000, 8
Terms = dict[tuple[int, ...], Fraction]


def rational(text: Any) -> Fraction:
    """Return the rational of a text such as "-3/4"."""
    if not isinstance(text, str) or len(text) > 10_000 or set(text) - set("0123456789-/"):
        raise Unreadable("the file is damaged: a rational is no text of digits")
    return Fraction(text)


def _terms(value: Any, n: int) -> Terms:
    found = {tuple(whole(k, "an exponent", 0) for k in e): rational(c) for e, c in value}
    if any(len(e) != n for e in found) or len(found) != len(value) or len(found) > MOST_TERMS:
        raise Unreadable("the file is damaged: exponents that fit no states, or are there twice")
    return {e: c for e, c in found.items() if c}


def _slope(V: Terms, f: Sequence[Terms]) -> Terms:
    """Return dV/dt = sum_i dV/dx_i f_i."""
    found: Terms = {}
    for i, own in enumerate(f):
        for (e, c), (k, d) in combinations(V.items(), own.items()):
            if e[i]:
                key = tuple(a + b - (j == i) for j, (a, b) in enumerate(zip(e, k, strict=True)))
                found[key] = found.get(key, Fraction(0)) + c * d * e[i]
    return {e: c for e, c in found.items() if c}


def claimed(plant: Any, own: Any, content: Any) -> Claim:
    """Return what a file of a region of attraction claims."""
    names, rho = plant["states"], rational(own["rho"])
    if not isinstance(names, list) or not 1 <= len(names) <= MOST_STATES:
        raise Unreadable(f"a region of attraction is known for 1 to {MOST_STATES} states")
    n = len(names)
    f, V = [_terms(each, n) for each in plant["f"]], _terms(own["V"], n)
    box = [rational(text) for text in content["box"]]
    claim = f"every motion that starts in V <= {float(rho)!r} tends to zero"
    said = [f"x' = f(x) with {n} polynomials of {sum(map(len, f))} terms, f(0) = 0"]
    zero = (0,) * n
    if len(f) != n or len(box) != n or not n or any(b <= 0 for b in box):
        raise Unreadable("the file is damaged: not one polynomial and one width of a state")
    if rho <= 0 or zero in V or any(zero in own for own in f) or not V:
        return Claim(claim, said, (), refused="rho is not above zero, or V(0) or f(0) is not zero")
    return Claim(claim, said, (), refused=_missed(V, _slope(V, f), rho, box))


def _missed(V: Terms, slope: Terms, rho: Fraction, box: Sequence[Fraction]) -> str:
    """Return why {V <= rho} is not shown to be a region of attraction; nothing where it is."""
    n = len(box)
    if not slope:
        return "V does not fall"
    level, fall = {**V, (0,) * n: -rho}, {e: -c for e, c in slope.items()}
    most = max(map(sum, V))
    for face in combinations(range(n), (-1, 1)):
        beyond = _on(level, face, box, lambda k: most - k)
        if not _decided([beyond], n, all):
            return "{V <= rho} is not shown to lie in the box"
        own = [_on(F, face, box, _lowered(F)) for F in (V, fall)]
        own.append(_on(level, face, box, lambda k: k))
        if not _decided(own, n, lambda good: good[2] or (good[0] and good[1])):
            return "V is not shown to be positive and to fall at all states with V <= rho"
    return ""


def _lowered(F: Terms) -> Callable[[int], int]:
    least = min(map(sum, F))
    return lambda k: k - least


def _on(
    F: Terms, face: tuple[int, int], box: Sequence[Fraction], radial: Callable[[int], int]
) -> Polynomial:
    """Return F at x = diag(box) y, each term of degree k times r^radial(k): in t of the other
    coordinates, y = 2 t - 1, and r.
    """
    axis, sign = face
    n, others = len(box), [j for j in range(len(box)) if j != face[0]]
    most = max(max(e) for e in F)
    powers = []
    for i in range(len(others)):
        y = variable(i) * 2 - scalar(1)
        own = [scalar(1)]
        for _ in range(most):
            own.append((own[-1] @ y).reduced())
        powers.append(own)
    found: Polynomial | None = None
    for e, c in F.items():
        for b, k in zip(box, e, strict=True):
            c = c * b**k
        k = radial(sum(e))
        term = Polynomial((1, 1), {(*(0,) * (n - 1), k) if k else (): [[1]]})
        term = term * (c * sign ** e[axis])
        for i, j in enumerate(others):
            term = term @ powers[i][e[j]]
        found = term if found is None else found + term
    return (found or scalar(0)).reduced()


def _decided(every: Sequence[Polynomial], n: int, settled: Callable[[list[bool]], bool]) -> bool:
    """Whether halving the unit box settles all of its parts, from which polynomials are positive on
    each.
    """
    waiting, looked = [(list(every), 0)], 0
    while waiting:
        own, depth = waiting.pop()
        looked += 1
        good = [_positive(F, n) for F in own]
        if settled(good):
            continue
        if looked > MOST_BOXES or depth > 60 * n:
            return False
        axis, half = depth % n, Fraction(1, 2)
        for side in (0, 1):
            t = (variable(axis) + scalar(side)) * half
            waiting.append(([F.at(axis, t) for F in own], depth + 1))
    return True


def _positive(F: Polynomial, n: int) -> bool:
    return all(row[0][0] > 0 for row in bernstein_coefficients(F, n).values())
