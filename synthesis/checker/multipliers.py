"""Gains by multipliers: x' P x of a loop with the lags of its multipliers, P of any sign.

d = Delta v are inputs of a model and f others; x has its states and those of lags of signals of the
blocks. The gain from f to y is below g where for all (x, w) other than zero, w = (d, f),

    d(x' P x)/dt + sum of the forms + |y|^2 - g^2 |f|^2 < 0

(sampled: x+' P x+ - x' P x), each form has an integral >= 0 for all v and d = Delta(v) of finite
energy, the loop with d = N v is stable, and the blocks are joined to N by a path of blocks with the
same forms. E is a power of a lag a/(s + a), sampled (1 - a)/(z - a). The forms:

    static     e = d - low v, u = high v - d: sum over (i, j) of c (e_i u_i + e_j u_j -+ 2 e_i E
               u_j)/2 and of the same with (E e_i) u_j, c >= 0, + if phi is odd; s_i e_i u_i, s_i
               above half the difference of the sums of c in row i and column i, i != j; q e dv/dt
    parameter  e = d - middle v: radius^2 |v|_Y^2 - |e|_Y^2 + 2 v' S e over v, e and all E v, E e,
               Y > 0, S = -S'
    dynamics   bound^2 |v|_Y^2 - |d|_Y^2 over each channel and all its E, Y > 0
    delay      e = v(t - T) - v(t): |v|_X^2 - |v + e|_X^2 over the powers E, X of any sign; |N
               v|_Y^2 - |D e|_Y^2, with |exp(-s T) - 1| <= |N/D|, Y > 0, over powers of the lag; 3
               |K v|_W^2 + (L v)' W M e, W > 0, as e lags; of a window, e = s d and T^2 |v|_Z^2 -
               |d|_Z^2, Z > 0
    own        M of the outputs of a filter of (v, d), with weights >= 0
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

from .demands import Claim, Demand
from .functions import solved
from .polynomials import Polynomial, diagonal, even, matrix
from .reading import Unreadable, array, number, whole
from .signals import Block, Form, Loop, Refused, Row, added, stable

CORNER, ZEROS, POLES = Fraction(2363, 1000), Fraction(838, 1000), Fraction(685, 1000)
LAG, TURN = Fraction(27, 100), Fraction(14, 5)
OF_ONES_OWN = "a causal block of bounded gain with the integral inequalities of the file's filter"


class Told(NamedTuple):
    """Demands of the multipliers of a block, their words, and the factor of the nominal block."""

    demands: Sequence[Demand]
    words: str
    nominal: Fraction


def _copies(loop: Loop, block: Block, signals: Sequence[Row]) -> list[list[Row]]:
    """Return the signals, then those through each power of each lag."""
    out = [list(signals)]
    for pole in block.poles:
        own = list(signals)
        for _ in range(block.order):
            own = [loop.lagged(row, pole) for row in own]
            out.append(own)
    return out


def _range(block: Block) -> tuple[Fraction, Fraction]:
    low, high = block.value("low"), block.value("high")
    if low >= high:
        raise Unreadable("the file is damaged: a range is empty")
    return low, high


def _not_below(values: Sequence[Fraction]) -> None:
    if any(v < 0 for v in values):
        raise Refused("a multiplier is not of its class: a coefficient is below zero")


def _static(loop: Loop, form: Form, block: Block) -> Told:
    low, high = _range(block)
    sloped, odd, constant, popov = (block.flag(k) for k in ("sloped", "odd", "constant", "popov"))
    if (not constant and (sloped or popov)) or (not sloped and block.poles):
        raise Refused("a function that depends on time, or has no slopes, has no such multiplier")
    channels = range(len(block.inputs))
    v = [loop.output(j) for j in block.outputs]
    d = [loop.input(i) for i in block.inputs]
    u = [added([(high, v[i]), (Fraction(-1), d[i])]) for i in channels]
    e = [added([(Fraction(1), d[i]), (-low, v[i])]) for i in channels]
    copies = _copies(loop, block, [*u, *e])[1:]
    spare = [block.take() for _ in channels]
    rows, columns = [Fraction(0)] * len(spare), [Fraction(0)] * len(spare)

    def pair(i: int, j: int, p: Row, q: Row, sign: int) -> None:
        c = block.take()
        _not_below([c])
        if i != j:
            rows[i] += c
            columns[j] += c
        form.add(sign * c, p, q)
        form.add(c / 2, e[i], u[i])
        form.add(c / 2, e[j], u[j])

    every = [(i, j) for i in channels for j in channels]
    for sign in ((-1, 1) if odd else (-1,)) if sloped else ():
        for i, j in every:
            if i != j:
                pair(i, j, e[i], u[j], sign)
        for own in copies:
            for i, j in every:
                pair(i, j, e[i], own[j], sign)
            for i, j in every:
                pair(i, j, own[len(u) + i], u[j], sign)
    for i in channels:
        _not_below([spare[i] - abs(rows[i] - columns[i]) / 2])
        form.add(spare[i], e[i], u[i])
        if popov:
            form.add(block.take(), e[i], loop.slope(block.outputs[i]))
    kind = "slopes" if sloped else "a sector"
    time = "" if constant else ", which may depend on time"
    shape = f"{', odd' * odd}{', zero at zero,' * sloped}"
    words = f"static functions, the same{shape} of {kind} from {float(low)!r} to"
    return Told((), f"{words} {float(high)!r}{time}", low)


def _parameter(loop: Loop, form: Form, block: Block) -> Told:
    low, high = _range(block)
    middle, radius = (low + high) / 2, (high - low) / 2
    moves = block.flag("moves")
    if moves and block.poles:
        raise Refused("a parameter that moves has no multiplier with lags")
    v = [loop.output(j) for j in block.outputs]
    d = [loop.input(i) for i in block.inputs]
    e = [added([(Fraction(1), b), (-middle, a)]) for a, b in zip(v, d, strict=True)]
    copies = _copies(loop, block, [*v, *e])
    v = [row for own in copies for row in own[: len(block.inputs)]]
    e = [row for own in copies for row in own[len(block.inputs) :]]
    Y = block.lower(len(v))
    form.square(Y, v, radius * radius)
    form.square(Y, e, -1)
    for i in range(len(v)):
        for j in range(i):
            value = block.take()
            form.add(2 * value, v[i], e[j])
            form.add(-2 * value, v[j], e[i])
    how = "moving in any way" if moves else "constant"
    words = f"a real number from {float(low)!r} to {float(high)!r}, {how}"
    return Told([Demand("a multiplier is positive", even(Y))], words, middle)


def _dynamics(loop: Loop, form: Form, block: Block) -> Told:
    bound = block.value("bound")
    _not_below([bound])
    v = [loop.output(j) for j in block.outputs]
    copies = _copies(loop, block, [*v, *(loop.input(i) for i in block.inputs)])
    Y = block.lower(len(copies))
    for k in range(len(copies[0])):
        size = bound * bound if k < len(v) else Fraction(-1)
        form.square(Y, [own[k] for own in copies], size)
    words = f"stable linear time-invariant dynamics of gain at most {float(bound)!r}"
    return Told([Demand("a multiplier is positive", even(Y))], words, Fraction(0))


def _delay(loop: Loop, form: Form, block: Block) -> Told:
    T, shape, (a, *more) = block.value("longest"), block.content["shape"], block.poles
    window, count, top = shape == "window", len(block.inputs), block.order
    known = shape in ("difference", "delay", "window")
    if not known or T <= 0 or more or top < 3 + window or loop.dt is not None:
        raise Refused(
            "a delay is not above zero, or its multipliers have not one lag to its power 3"
        )
    nominal = Fraction(shape == "delay")
    v = [loop.output(j) for j in block.outputs]
    d = [
        added([(Fraction(1), loop.input(i)), (-nominal, own)])
        for i, own in zip(block.inputs, v, strict=True)
    ]
    copies = _copies(loop, block, [*v, *d])
    v_all, d_all = [own[:count] for own in copies], [own[count:] for own in copies]
    v, e = v_all, d_all
    if window:  # s E^k = a (E^(k - 1) - E^k)
        v, e = (
            v_all[1:],
            [
                [added([(a, p), (-a, q)]) for p, q in zip(before, own, strict=True)]
                for before, own in pairwise(d_all)
            ],
        )
    one = Fraction(1)
    flat = [row for own in v for row in own]
    both = [
        added([(one, p), (one, q)])
        for x, y in zip(v, e, strict=True)
        for p, q in zip(x, y, strict=True)
    ]
    X = block.lower(len(flat))
    form.square(X, flat)
    form.square(X, both, -1)
    c = CORNER
    N = [Fraction(0), T, 2 * ZEROS / c * T**2, T**3 / c**2]
    first, second = 2 * POLES / c * T, T**2 / c**2
    D = [one, first + T / 2, second + T / 2 * first, T / 2 * second]
    up, down = (_through(p, own, a, 3) for p, own in ((N, v), (D, e)))
    Y = block.lower(len(up))
    form.square(Y, up)
    form.square(Y, down, -1)
    matrices = [Y]
    M = [2 * TURN**2, 2 * TURN * T, T**2]
    L = times(M, [one, -2 * LAG * T, (LAG * T) ** 2])
    large, ahead = (_through(p, v, a, 4) for p in ([0 * T, 0 * T, T**2], L))
    behind = _through(M, e, a, 4)
    W = block.lower(len(large))
    form.square(W, large, 3)
    for row, p in zip(W, ahead, strict=True):
        for value, q in zip(row, behind, strict=True):
            form.add(value, p, q)
    matrices.append(W)
    if window:
        Z = block.lower(len(flat) + count)
        form.square(Z, [row for own in v_all for row in own], T * T)
        form.square(Z, [row for own in d_all for row in own], -1)
        matrices.append(Z)
    demands = [Demand("a multiplier is positive", even(M)) for M in matrices if M]
    says = {"difference": "v(t - T) - v(t)", "delay": "v(t - T)"}
    words = says.get(shape, "minus the integral of v from t - T to t")
    return Told(
        [*demands, *_above_the_error(), *_ahead_of_the_phase()],
        f"{words}, T constant, from 0 to {float(T)!r} s",
        nominal,
    )


def _through(
    p: Sequence[Fraction], copies: Sequence[Sequence[Row]], a: Fraction, m: int
) -> list[Row]:
    """Return p(s)/(s + a)^m times the powers of the lag, from the first on: with E = a/(s + a), s =
    a (1 - E)/E, so that s^k/(s + a)^m = a^(k - m) (1 - E)^k E^(m - k).
    """
    weights = [Fraction(0)] * (m + 1)
    for k, value in enumerate(p):
        size = value * a**k / a**m
        for i in range(k + 1):
            weights[m - k + i] += size * (-1) ** i * math.comb(k, i)
    return [
        added((w, copies[start + r][i]) for r, w in enumerate(weights))
        for start in range(len(copies) - m)
        for i in range(len(copies[0]))
    ]


def times(p: Sequence[Fraction], q: Sequence[Fraction]) -> list[Fraction]:
    """Return the product of polynomials."""
    out = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            out[i + j] += a * b
    return out


def _positive(p: Sequence[Fraction], said: str) -> Demand:
    """Return that a polynomial is positive on [0, 1]."""
    poly = Polynomial((1, 1), {}, 1)
    for k, value in enumerate(p):
        M = matrix([[value]], 1)
        poly = poly + Polynomial((1, 1), {(k,) if k else (): M.terms[()]}, M.below)
    return Demand(said, poly, variables=1)


def _ahead_of_the_phase() -> Iterator[Demand]:
    """Yield that (1 + a^2 t^2) (cos(phi - t) - cos(phi)) > -3 t^4/(b + t^4), b = 4 q^4, with tan
    (phi/2) = a t, for t up to 4.9: the left side is (1 - a^2 t^2) (cos t - 1) + 2 a t sin t, of
    Taylor sums less what they leave out. Beyond, where it is above -2, 3 t^4/(b + t^4) > 2. Below
    4.9, t < phi + pi, so that of shorter delays cos(phi - theta) is least at an end, too.
    """
    end, terms, b = Fraction(49, 10), 24, 4 * TURN**4
    said = "the phase of a delay is behind that of its multiplier"
    yield _positive([3 * end**4 - 2 * (b + end**4)], said)
    cos, sin = [Fraction(0)] * (terms + 1), [Fraction(0)] * (terms + 1)
    for k in range(1, terms):
        (sin if k % 2 else cos)[k] = Fraction((-1) ** (k // 2), math.factorial(k))
    rest = [Fraction(0)] * terms + [Fraction(-2, math.factorial(terms))]
    left = times([Fraction(1), Fraction(0), -(LAG**2)], cos)
    parts = [left, times([Fraction(0), 2 * LAG], sin), times([1 + LAG, 2 * LAG, LAG**2], rest)]
    total = [sum((p[k] for p in parts if k < len(p)), Fraction(0)) for k in range(terms + 3)]
    whole_ = times(total, [b, Fraction(0), Fraction(0), Fraction(0), Fraction(1)])
    whole_[4] += 3
    scaled = [value * end**k for k, value in enumerate(whole_[2:])]
    yield _positive(scaled, said)


def _above_the_error() -> Iterator[Demand]:
    """Yield that |exp(-s T) - 1|^2 <= |N/D|^2, in t = (w T)^2: 2 - 2 cos is below its Taylor sum up
    to t = 9.87 > pi^2, where it also is below the same of a longer delay, and below 4 at all t.
    """

    def squared(damping: Fraction) -> list[Fraction]:
        return [Fraction(1), (4 * damping**2 - 2) / CORNER**2, 1 / CORNER**4]

    N, D = [Fraction(0), *squared(ZEROS)], times([Fraction(1), Fraction(1, 4)], squared(POLES))
    taylor, factor = [Fraction(0)], Fraction(2)
    for k in range(7):
        factor /= (2 * k + 1) * (2 * k + 2)
        taylor.append((-1) ** k * factor)
    sums = times(D, taylor)
    near = [(N[k] if k < len(N) else 0) - v for k, v in enumerate(sums)][2:]
    end, start = Fraction(987, 100), Fraction(986, 100)
    scaled = [v * end**k for k, v in enumerate(near)]
    far = [(a - 4 * b) * start**k for k, (a, b) in enumerate(zip(N, D, strict=True))][:-1]
    for p in (scaled, far[::-1]):
        yield _positive(p, "the weight is above the error of a delay")


def _own(loop: Loop, form: Form, block: Block) -> Told:
    A, B, C, D = (array(M, "a filter", None, None) for M in block.content["filter"])
    if not stable(A, loop.dt is not None):
        raise Refused("the filter of a multiplier is not stable")
    signals = [
        *(loop.output(j) for j in block.outputs),
        *(loop.input(i) for i in block.inputs),
    ]
    first = loop.used
    states = [loop.state(added(zip(row, signals, strict=True))) for row in B]
    for i, row in enumerate(A):
        own = [(Fraction(1), loop.motion[first + i]), *zip(row, states, strict=True)]
        loop.motion[first + i] = added(own)
    z = [
        added([*zip(c, states, strict=True), *zip(d, signals, strict=True)])
        for c, d in zip(C, D, strict=True)
    ]
    for M in block.content["forms"]:
        weight = block.take()
        _not_below([weight])
        rows = array(M, "a form", len(z), len(z))
        even(rows)
        form.square(rows, z, weight)
    return Told((), f"{OF_ONES_OWN}; so has every multiple of it from 0 to 1", Fraction(0))


KINDS = {
    "static": _static,
    "parameter": _parameter,
    "dynamics": _dynamics,
    "delay": _delay,
    "own": _own,
}


def _nominal(loop: Loop, factors: Mapping[tuple[int, int], Fraction]) -> list[Row]:
    """Return A + B N (I - D N)^-1 C of the nominal blocks d_i = N_ij v_j."""
    p = range(len(loop.C))
    left = [
        [
            Fraction(i == j)
            - sum((loop.D[i][k] * f for (k, q), f in factors.items() if q == j), Fraction(0))
            for j in p
        ]
        for i in p
    ]
    try:
        out = solved(left, loop.C) if loop.own else []
    except ZeroDivisionError:
        raise Refused("the nominal loop is not well posed") from None
    return [
        [
            loop.A[i][j]
            + sum((loop.B[i][k] * f * out[q][j] for (k, q), f in factors.items()), Fraction(0))
            for j in range(loop.own)
        ]
        for i in range(loop.own)
    ]


def channels(values: Any, size: int) -> list[int]:
    """Return different numbers of channels."""
    found = [whole(v, "a channel", 0, size - 1) for v in values]
    if len(set(found)) < len(found):
        raise Unreadable("the file is damaged: a channel stands twice")
    return found


def blocks_of(content: Any, loop: Loop) -> list[Block]:
    """Return the blocks of a file."""
    out = []
    for each in content["blocks"]:
        inputs, outputs = channels(each["inputs"], loop.m), channels(each["outputs"], len(loop.C))
        values = iter(array(each["coefficients"], "coefficients", None))
        out.append(Block(each, inputs, outputs, values))
    return out


def sentences(
    loop: Loop,
    into: Sequence[int],
    out: Sequence[int],
    blocks: Sequence[Block],
    told: Sequence[Told],
) -> list[str]:
    """Return of which model and blocks a claim is."""
    time = "continuous time" if loop.dt is None else f"samples of {float(loop.dt)!r} s"
    f, y = (", ".join(str(i + 1) for i in own) for own in (into, out))
    said = [
        f"a model of {loop.own} states, {loop.m} inputs, {len(loop.C)} outputs, in {time}",
        f"f: inputs {f}; y: outputs {y}",
    ]
    for block, each in zip(blocks, told, strict=False):
        d, v = (", ".join(str(i + 1) for i in own) for own in block[1:3])
        said.append(f"inputs {d} of outputs {v}: {each.words}")
    return said


def claimed(content: Any) -> Claim:
    """Return what a file of a gain by multipliers claims."""
    loop, bound = Loop(content), number(content["gain"], "the gain")
    into, out = channels(content["into"], loop.m), channels(content["out"], len(loop.C))
    form, blocks = Form(loop.size), blocks_of(content, loop)
    refused, told = "" if bound >= 0 else "a gain is below zero", []
    try:
        told = told_of(loop, form, blocks, into, KINDS)
    except Refused as error:
        refused = str(error)
    demands = [demand for each in told for demand in each.demands]
    if not refused:
        demands.append(_gain(loop, form, content, into, out))
    claim = f"the energy gain is below {float(bound)!r}: |y|_2 < {float(bound)!r} |f|_2 from rest"
    said = sentences(loop, into, out, blocks, told)
    return Claim(claim, said, demands, bound, lambda g: g * g, refused=refused)


def told_of(
    loop: Loop,
    form: Form,
    blocks: Sequence[Block],
    into: Sequence[int],
    kinds: Mapping[str, Any],
    nominal: bool = True,
) -> list[Told]:
    """Add the forms of all blocks; return what they demand. Raise where they do not fit, or, with
    `nominal`, where the loop with the nominal blocks is not stable.
    """
    d = [i for block in blocks for i in block.inputs]
    v = [j for block in blocks for j in block.outputs]
    if sorted([*d, *into]) != list(range(loop.m)):
        raise Refused("an input belongs to two blocks, or to none")
    types = {str(block.content["type"]) for block in blocks}
    at_once = any(loop.D[j][i] for j in v for i in d)
    if at_once and not types <= {"parameter", "dynamics", "box"}:
        raise Refused("an output of a block depends on an input of one at the same instant")
    told, factors = [], {}
    for block in blocks:
        told.append(_read(loop, form, block, kinds))
        if len(block.inputs) == len(block.outputs):
            pairs = zip(block.inputs, block.outputs, strict=True)
            factors |= dict.fromkeys(pairs, told[-1].nominal)
    own = {k: f for k, f in factors.items() if f}
    if nominal and not stable(_nominal(loop, own), loop.dt is not None):
        raise Refused("the nominal loop is not stable")
    return told


def _read(loop: Loop, form: Form, block: Block, kinds: Mapping[str, Any]) -> Told:
    """Add the form of a block; return what it demands."""
    kind = block.content["type"]
    if kind not in kinds:
        raise Unreadable(f"a block of the type {kind!r:.40} is not known")
    if len(block.inputs) != len(block.outputs) and kind not in ("dynamics", "own"):
        raise Unreadable("the file is damaged: a block has other inputs than outputs")
    poles = block.poles
    if len(set(poles)) < len(poles) or any(a <= 0 or (loop.dt and a >= 1) for a in poles):
        raise Refused("a pole of a lag is not stable, or there twice")
    told = kinds[kind](loop, form, block)
    if next(block.values, None) is not None:
        raise Unreadable("the file is damaged: a multiplier has too many coefficients")
    return told


def motion_of(loop: Loop, form: Form, P: Sequence[Row]) -> None:
    """Add the change of x' P x."""
    states = [[Fraction(k == i) for k in range(loop.size)] for i in range(loop.n)]
    if loop.dt is None:
        for i, own in enumerate(P):
            form.add(Fraction(2), added(zip(own, states, strict=True)), loop.motion[i])
    else:
        form.square(P, loop.motion)
        form.square(P, states, -1)


def _gain(loop: Loop, form: Form, content: Any, into: Sequence[int], out: Sequence[int]) -> Demand:
    """Return the inequality of the gain."""
    P = array(content["P"], "P", loop.n, loop.n)
    even(P)
    motion_of(loop, form, P)
    for j in out:
        form.add(Fraction(1), loop.output(j), loop.output(j))
    energy = diagonal([int(k - loop.n in into) for k in range(loop.size)])
    F = even(form.rows)
    return Demand("the inequality of the gain", -F, None, energy)
