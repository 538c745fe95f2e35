"""Functions V = x' P(theta) x of a model whose parameters are known functions of an angle theta.

theta' = omega; p_i = mean + sum a_k cos(k theta) + b_k sin(k theta), and P has the same form:

    [A'P + PA + dP/dt + C'C, PB + C'D; *, D'D - g^2 I] < 0,  P > 0  at every theta

With q = tan(theta/2) in [-1, 1], cos = (1 - q^2)/e and sin = 2 q/e, e = 1 + q^2, on the half of the
circle around 0; around pi cos and sin have the other sign. Times a power of e all is polynomial.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from math import comb
from typing import Any, NamedTuple

from . import words
from .demands import Claim, Demand
from .polynomials import Polynomial, block, diagonal, even, matrix, scalar, variable
from .reading import Unreadable, array, number, whole

GAIN, STABILITY = "gain of a periodic model", "stability of a periodic model"
MOST = 60
"""Degree in a parameter, and terms of a series, beyond which nothing is read."""
Q = variable(0) * 2 - scalar(1)
BELOW = scalar(1) + Q @ Q


class Over(NamedTuple):
    """A matrix of polynomials in q over a power of 1 + q^2."""

    top: Polynomial
    power: int

    def raised(self, power: int) -> Polynomial:
        """Return the numerator over another, larger power."""
        return _wide(self.top, _power(BELOW, power - self.power))

    def __matmul__(self, other: Over) -> Over:
        return Over((self.top @ other.top).reduced(), self.power + other.power)

    def __add__(self, other: Over) -> Over:
        most = max(self.power, other.power)
        return Over(self.raised(most) + other.raised(most), most)

    @property
    def T(self) -> Over:
        """The transpose."""
        return Over(self.top.T, self.power)


def _power(of: Polynomial, k: int) -> Polynomial:
    out = scalar(1)
    for _ in range(k):
        out = (out @ of).reduced()
    return out


def _wide(M: Polynomial, factor: Polynomial) -> Polynomial:
    """Return a matrix times a scalar polynomial."""
    columns = [M.part(range(M.shape[0]), [j]) @ factor for j in range(M.shape[1])]
    return block([columns]).reduced() if columns else M


def _series(terms: Sequence[Polynomial], side: int) -> Over:
    """Return a mean with cosines and sines."""
    cosine, sine = (scalar(1) - Q @ Q) * side, Q * (2 * side)
    total, c, s = Over(terms[0], 0), scalar(1), scalar(0)
    for k in range(1, len(terms) // 2 + 1):
        c, s = (c @ cosine - s @ sine).reduced(), (s @ cosine + c @ sine).reduced()
        for M, wave in ((terms[2 * k - 1], c), (terms[2 * k], s)):
            total = total + Over(_wide(M, wave), k)
    return total


def _composed(nested: Any, lengths: Sequence[int], columns: int, units: Sequence[Over]) -> Over:
    """Return a matrix by Bernstein coefficients of functions u of theta."""
    total = None
    for place in product(*map(range, lengths)):
        rows = nested
        for k in place:
            rows = rows[k]
        term = Over(matrix(rows, columns), 0)
        for k, length, u in zip(place, lengths, units, strict=True):
            d = length - 1
            rest = _power(BELOW, u.power) - u.top
            factor = _power(u.top, k) @ _power(rest, d - k) * comb(d, k)
            term = Over(_wide(term.top, factor), term.power + u.power * d)
        total = term if total is None else total + term
    if total is None:
        raise Unreadable("a matrix has no coefficients")
    return total


def _demands(content: Any, P: Sequence[Polynomial], driven: bool) -> Iterator[Demand]:
    omega = number(content["omega"], "the speed")
    motion = array(content["motion"], "the motion", None, None)
    ranges = array(content["ranges"], "the ranges", len(motion), 2)
    n, m = P[0].shape[0], len(motion)
    nu = whole(content["B"]["shape"][-1], "the inputs", 0, 10**4)
    ny = whole(content["C"]["shape"][-2], "the outputs", 0, 10**4)
    slope = [P[0] * 0]
    for k in range(1, len(P) // 2 + 1):
        slope += [P[2 * k] * (omega * k), P[2 * k - 1] * (-omega * k)]
    for side, said in ((1, "around 0"), (-1, "around pi")):
        units = []
        for (low, high), terms in zip(ranges, motion, strict=True):
            p = _series([scalar(v) for v in terms], side)
            units.append(Over((p.top - _power(BELOW, p.power) * low) * (1 / (high - low)), p.power))
        own = {}
        sizes = {"A": (n, n), "B": (n, nu), "C": (ny, n), "D": (ny, nu)}
        for name in "ABCD" if driven else "A":
            lengths = [whole(k, "a degree", 1, MOST) for k in content[name]["shape"][:m]]
            nested = array(content[name], name, *lengths, *sizes[name])
            own[name] = _composed(nested, lengths, sizes[name][1], units)
        V = _series(P, side)
        yield Demand(f"V > 0 {said}", V.top, variables=1)
        move = V @ own["A"]
        rate = move + move.T + _series(slope, side)
        if not driven:
            yield Demand(f"V falls {said}", -rate.top, variables=1)
            continue
        across = V @ own["B"] + own["C"].T @ own["D"]
        corner, last = rate + own["C"].T @ own["C"], own["D"].T @ own["D"]
        whole_power = max(corner.power, across.power, last.power)
        a, b, d = (each.raised(whole_power) for each in (corner, across, last))
        energy = diagonal([int(i >= n) for i in range(n + nu)])
        paid = _wide(energy, _power(BELOW, whole_power))
        yield Demand(f"V falls {said}", -block([[a, b], [b.T, d]]), None, paid, 1)


def claimed(content: Any) -> Claim:
    """Return what a file of a periodic model claims; its fields are named here alone."""
    n = whole(content["A"]["shape"][-1], "the states", 1, 10**4)
    terms = array(content["P"], "P", None, n, n)
    columns = whole(content["motion"]["shape"][1], "the terms of a motion", 1, MOST)
    if not len(terms) % 2 or not columns % 2 or len(terms) > MOST:
        raise Unreadable("a series has a mean, and a cosine and a sine of each harmonic")
    driven = content["kind"] == GAIN
    bound = number(content["gamma"], "the bound") if driven else Fraction(0)
    P = [even(M) for M in terms]
    omega = number(content["omega"], "the speed")
    said = [f"a model of {n} states in continuous time, whose parameters are known functions of an"
            f" angle that turns at {float(omega)!r} rad/s"]  # fmt: skip
    claim = words.energy(bound) if driven else "the free state decays exponentially"
    refused = "a gain is not below zero, nor a speed" if bound < 0 or omega <= 0 else ""
    own = _demands(content, P, driven)
    return Claim(claim, said, own, bound, lambda g: g * g, refused=refused)
