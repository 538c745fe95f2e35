"""Gains to the peak of outputs, by multipliers of finite times.

With V = x' P x, a decay r and numbers a, b, for all (x, w) other than zero, w = (d, f),

    dV/dt + r V + forms - a |f|^2 < 0,    |y|^2 - V + other forms - b |f|^2 < 0

(sampled: V(k+1) - V(k)), the forms those of `multipliers` that are nonnegative at every instant: of
functions in a sector without Popov's term, and of parameters without lags, several of them also
together, [v; d]' M [v; d] with M concave in each parameter and positive at the corners of the box.
Then |y|^2 <= g^2 max |f|^2 with g^2 = a/r + b. With r = 0, |y|^2 <= g^2 |f|_2^2, g^2 the larger of
a and b; there, sampled, forms of dynamics without lags and of a filter of one's own count too,
which are nonnegative summed from rest over every finite time, where first less other ones are of
their class as well. In continuous time no f reaches y or v at the same instant then, and f leaves
the second inequality.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

from .demands import Claim, Demand
from .multipliers import (
    KINDS,
    OF_ONES_OWN,
    Told,
    blocks_of,
    channels,
    motion_of,
    sentences,
    told_of,
)
from .polynomials import even, matrix
from .reading import Unreadable, array, number
from .signals import Block, Form, Loop, Refused

POINTWISE = {"static", "parameter", "box"}
SUMMED = {"dynamics", "own"}
ENERGY, PEAK = "energy to peak", "peak to peak"
MOST = 10


def box(loop: Loop, form: Form, block: Block) -> Told:
    """Add the form of parameters together; see the head of this module."""
    lows, highs = ([number(v, k) for v in block.content[k]] for k in ("lows", "highs"))
    copies = [int(number(v, "copies")) for v in block.content["copies"]]
    n, m = len(block.inputs), len(copies)
    fits = len(lows) == len(highs) == m <= MOST and sum(copies) == n and min(copies, default=0) > 0
    if not fits or block.poles or any(a >= b for a, b in zip(lows, highs, strict=True)):
        raise Refused("the parameters are not those of the channels, or too many")
    v, d = [loop.output(j) for j in block.outputs], [loop.input(i) for i in block.inputs]
    M = block.lower(2 * n)
    form.square(M, [*v, *d])
    demands, ends = [], [sum(copies[:k]) for k in range(m + 1)]
    for a, b in pairwise(ends):
        own = [[-M[n + i][n + j] for j in range(a, b)] for i in range(a, b)]
        demands.append(Demand("a multiplier is concave in each parameter", even(own)))
    for corner in product(*zip(lows, highs, strict=True)):
        at = [value for value, count in zip(corner, copies, strict=True) for _ in range(count)]
        rows = [
            [
                M[i][j]
                + M[i][n + j] * at[j]
                + at[i] * M[n + i][j]
                + at[i] * M[n + i][n + j] * at[j]
                for j in range(n)
            ]
            for i in range(n)
        ]
        demands.append(Demand("a multiplier is positive at the corners", even(rows)))
    each = ", ".join(f"{float(a)!r} to {float(b)!r}" for a, b in zip(lows, highs, strict=True))
    return Told(demands, f"real numbers, moving in any way: {each}", Fraction(0))


def own(loop: Loop, form: Form, block: Block) -> Told:
    """Add the form of a filter of one's own, in the words of inequalities over finite times."""
    told = KINDS["own"](loop, form, block)
    return told._replace(words=f"{OF_ONES_OWN}, over every finite time from rest")


READERS = {**KINDS, "box": box, "own": own}


def claimed(content: Any) -> Claim:
    """Return what a file of a gain to a peak claims."""
    measure, bound = content["measure"], number(content["gain"], "the gain")
    if measure not in (ENERGY, PEAK):
        raise Unreadable(f"a gain of the kind {measure!r:.40} is not known")
    size = repr(float(bound))
    most = "|f|_2" if measure == ENERGY else "max |f|"
    claim = f"from rest |y(t)| < {size} {most} at every t"
    loop = Loop(content)
    into, out = channels(content["into"], loop.m), channels(content["out"], len(loop.C))
    demands, told, refused = [], [], ""
    try:
        _fits(loop, content, measure, into, out)
        told, demands = _demands(content, measure, into, out)
    except Refused as error:
        refused = str(error)
    said = sentences(loop, into, out, blocks_of(content, loop), told)
    return Claim(claim, said, demands, refused=refused)


def _fits(loop: Loop, content: Any, measure: str, into: Sequence[int], out: Sequence[int]) -> None:
    """Raise unless blocks and numbers are those of such a gain."""
    kinds = {str(block["type"]) for block in content["blocks"]}
    known = POINTWISE | (SUMMED if loop.dt is not None and measure == ENERGY else set())
    if not kinds <= known:
        raise Refused("a multiplier says nothing of an instant, or of finite times")
    for block in content["blocks"]:
        if block["poles"] or any(block.get(name, False) for name in ("sloped", "popov")):
            raise Refused("a multiplier says nothing of finite times")
    bound, r = number(content["gain"], "the gain"), number(content["decay"], "the decay")
    a, b = (number(v, "a share") for v in content["shares"])
    if min(a, b, bound, r) < 0:
        raise Refused("a number is below zero")
    if measure == ENERGY:
        good = r == 0 and max(a, b) <= bound**2
    else:
        good = r > 0 and (loop.dt is None or r <= 1) and a / r + b <= bound**2
    if not good:
        raise Refused("the numbers of both inequalities do not give this gain")
    if measure == ENERGY and loop.dt is None:
        rows = [*out, *(j for block in content["blocks"] for j in block["outputs"])]
        if any(loop.D[j][i] for j in rows for i in into):
            raise Refused("an input reaches an output at the same instant")


def _demands(
    content: Any, measure: str, into: Sequence[int], out: Sequence[int]
) -> tuple[list[Told], list[Demand]]:
    """Return what is said of the blocks, and all that must be positive definite."""
    first, second = Loop(content), Loop(content)
    forms = Form(first.size), Form(second.size)
    told = told_of(first, forms[0], blocks_of(content, first), into, READERS, nominal=False)
    at = _with(content, content["at_peak"])
    again = told_of(second, forms[1], blocks_of(at, second), into, READERS, nominal=False)
    demands = [demand for each in (*told, *again) for demand in each.demands]
    demands += _left_over(content, into)
    P = array(content["P"], "P", first.n, first.n)
    even(P)
    n, (a, b) = first.n, (number(v, "a share") for v in content["shares"])
    states = [[Fraction(k == i) for k in range(first.size)] for i in range(n)]
    motion_of(first, forms[0], P)
    forms[0].square(P, states, number(content["decay"], "the decay"))
    forms[1].square(P, states, -1)
    for j in out:
        forms[1].add(Fraction(1), second.output(j), second.output(j))
    for form, share in zip(forms, (a, b), strict=True):
        for i in into:
            form.add(-share, first.input(i), first.input(i))
    kept = list(range(first.size))
    if measure == ENERGY and first.dt is None:
        kept = [k for k in kept if k - n not in into]
    for form, name, own in zip(forms, ("V", "the peak"), (range(first.size), kept), strict=True):
        rows = matrix([[form.rows[i][j] for j in own] for i in own], len(own))
        demands.append(Demand(f"the inequality of {name}", -rows))
    return told, demands


def _with(content: Mapping[str, Any], coefficients: Sequence[Any]) -> dict[str, Any]:
    pairs = zip(content["blocks"], coefficients, strict=True)
    return {**content, "blocks": [{**block, "coefficients": c} for block, c in pairs]}


def _left_over(content: Mapping[str, Any], into: Sequence[int]) -> Iterator[Demand]:
    """Yield that multipliers over time of the first inequality, less those of the second, are of
    their class.
    """
    own: list[Any] = []
    for block, at in zip(content["blocks"], content["at_peak"], strict=True):
        c, other = (array(v, "coefficients", None) for v in (block["coefficients"], at))
        summed = block["type"] in SUMMED
        rest = [x - y for x, y in zip(c, other, strict=True)] if summed else c
        own.append(rest)
    loop = Loop(content)
    blocks = [
        block._replace(values=iter(rest))
        for block, rest in zip(blocks_of(content, loop), own, strict=True)
    ]
    told = told_of(loop, Form(loop.size), blocks, into, READERS, nominal=False)
    for each in told:
        yield from each.demands
