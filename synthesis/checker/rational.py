"""Functions V = x' P(delta) x of an LFT whose parameters move at limited rates.

With w = Delta z, Delta = diag(delta_i I), delta_i = (p_i - middle)/radius in [-1, 1], rows (z,
dx/dt, y) of the LFT, and a matrix F(delta), for all (x, w, u) other than zero and extreme rates

    2 x' P dx/dt + x' dP/dt x + |y|^2 - g^2 |u|^2 + 2 (x, w, u)' F (w - Delta z) < 0,  P > 0

where w - Delta z is zero along every motion. With x = u = 0 no w other than zero is left, so that
the loop is well posed. P and F have Bernstein coefficients over the box of delta.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple

from . import words
from .demands import Claim, Demand
from .polynomials import (
    Polynomial,
    bernstein_functions,
    block,
    combined,
    diagonal,
    matrix,
    scalar,
    variable,
    zero,
)
from .reading import Parameter, Unreadable, array, names, number, parameters, whole

GAIN, STABILITY = "gain of a rational model", "stability of a rational model"
MOST, HIGHEST = 4, 12
"""Parameters, and degree in one, beyond which nothing is read."""


class Rows(NamedTuple):
    """dx/dt, z and y as functions of (x, w, u), the sizes of the blocks, those of x and u."""

    moves: Polynomial
    into: Polynomial
    shows: Polynomial
    sizes: Sequence[int]
    x: int
    u: int


def demands(
    own: Rows, P: Polynomial, F: Polynomial, moving: Sequence[Parameter]
) -> Iterator[Demand]:
    """Yield what must be positive definite over the unit box of (delta + 1)/2."""
    m, width, order = len(own.sizes), own.moves.shape[1], sum(own.sizes)
    every = diagonal([1] * width)
    state, inside = every.part(range(own.x)), every.part(range(own.x, own.x + order))
    deltas = [variable(i) * 2 - scalar(1) for i in range(m)]
    owner = [i for i, size in enumerate(own.sizes) for _ in range(size)]
    turned = zero(order, width)
    for k, i in enumerate(owner):
        row = diagonal([int(j == k) for j in range(order)])
        turned = turned + combined([deltas[i]], [row @ own.into])
    held = F @ (inside - turned)
    moved = state.T @ P @ own.moves
    form = moved + moved.T + held + held.T + own.shows.T @ own.shows
    energy = diagonal([int(k >= width - own.u) for k in range(width)]) if own.u else None
    yield Demand("V > 0", P, variables=m)
    # of the unit box, half of the rate of delta
    rates = [None if p.rate is None else p.rate / (p.high - p.low) for p in moving]
    slopes = [(P.derivative(i), rate) for i, rate in enumerate(rates) if rate]
    for signs in product((-1, 1), repeat=len(slopes)):
        total = form
        for sign, (slope, rate) in zip(signs, slopes, strict=True):
            total = total + state.T @ slope @ state * (sign * rate)
        yield Demand(f"V falls at the rates {signs}", -total, None, energy, m)


def _function(value: Any, name: str, m: int, rows: int, columns: int) -> Polynomial:
    """Return a matrix of polynomials over the unit box from its Bernstein coefficients."""
    lengths = [whole(k, "a degree", 1, HIGHEST + 1) for k in value["shape"][:m]]
    nested = array(value, name, *lengths, rows, columns)

    def along(values: Any, axis: int) -> Polynomial:
        if axis == m:
            return matrix(values, columns)
        functions = bernstein_functions(lengths[axis] - 1, variable(axis))
        return combined(functions, [along(each, axis + 1) for each in values])

    return along(nested, 0)


def claimed(content: Any) -> Claim:
    """Return what a file of a rational gain claims; its fields are named here alone."""
    lft = content["lft"]
    moving = parameters([each["scheduling"] for each in lft["blocks"]])
    if len(moving) > MOST or any(p.tie is not None for p in moving) or lft["dt"] is not None:
        raise Unreadable("an LFT of this kind has no proof that is known here")
    sizes = [whole(each["size"], "the size of a block", 0, 10**3) for each in lft["blocks"]]
    x, u, y = (len(names(lft[name])) for name in ("states", "inputs", "outputs"))
    kind = GAIN if u else STABILITY
    if content["kind"] != kind:
        raise Unreadable(f"the claim about {u} inputs is no {kind}")
    w = sum(sizes)

    def rows(into: str, states: str, count: int) -> list[Polynomial]:
        left = matrix(array(lft[into], "the LFT", count, w), w)
        right = matrix(array(lft[states], "the LFT", count, x + u), x + u)
        return [block([[right.part(range(count), range(x)), left,
                        right.part(range(count), range(x, x + u))]])]  # fmt: skip

    (z,) = rows("M11", "M12", w)
    (rest,) = rows("M21", "M22", x + y)
    own = Rows(rest.part(range(x)), z, rest.part(range(x, x + y)), sizes, x, u)
    P = _function(content["P"], "P", len(moving), x, x)
    P = (P + P.T) * Fraction(1, 2)
    F = _function(content["F"], "F", len(moving), x + w + u, w)
    still = [p.rate is None and content["P"]["shape"][i] > 1 for i, p in enumerate(moving)]
    refused = "P depends on a parameter that may jump" if any(still) else ""
    bound = number(content["gamma"], "the bound") if u else Fraction(0)
    said = words.model(x, u, y, None, moving)
    claim = (
        words.energy(bound)
        if u
        else "the free state decays exponentially, and the loop is well posed"
    )
    refused = refused or ("a gain is not below zero" if bound < 0 else "")
    own_demands = demands(own, P, F, moving)
    return Claim(claim, said, own_demands, bound, lambda g: g * g, refused=refused)
