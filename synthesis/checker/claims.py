"""A P or K that somebody else computed, for listed vertices, a grid of one parameter, or a terminal
set; with u = K x + w, A + BK for A and C + DK for C.

Vertices and grids, P > 0 and

    stability    -(A'P + PA + dP/dt) > 0
    decay rate   -(A'P + PA + dP/dt + 2 a P) > 0, of vertices >= 0
    gain         -[A'P + PA + dP/dt + C'C   PB + C'D; .   D'D - g^2 I] > 0

sampled P - A'P+A, P - exp(2 a dt) A'P+A, and in the gain A'P+A - P, A'P+B, D'D + B'P+B - g^2 I. All
are convex in the plant: vertices are enough. On a grid matrices are straight lines of p. A terminal
set x'Px <= c: P - A'PA >= 0, c a'P^-1 a <= b^2 of every limit a'x <= b; Hx <= h: a = H'y, y >= 0,
h'y <= b of every limit and of every row of H after a step. Its cost: P - A'PA - Q - K'RK >= 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

from . import bounded_regions
from .demands import Claim, Demand, exponential
from .exact import nonnegative
from .functions import solved
from .polynomials import Polynomial, block, combined, diagonal, even, matrix, scalar, variable, zero
from .reading import INFINITE, Unreadable, array, ascending, limit, number, period, whole

Stack = list[Polynomial]


def claimed(content: Any) -> Claim:
    """Return what a file of a claim of somebody else claims."""
    plant, own = content["plant"], content["claim"]
    kinds = plant["type"], own["type"]
    if kinds in (("vertices", "lyapunov"), ("grid", "lyapunov")):
        return _lyapunov(plant, own)
    if kinds == ("limited", "terminal"):
        return _terminal(plant, own, content)
    if kinds == ("polynomial", "region"):
        return bounded_regions.claimed(plant, own, content)
    raise Unreadable(f"a claim {kinds!r:.60} is not known")


def _stack(value: Any, name: str, count: int | None, *size: int | None) -> Stack:
    """Return a stack of matrices; of one matrix a stack of one."""
    several = len(value["shape"]) == 3
    nested = array(value, name, *([count] if several else []), *size)
    return [matrix(M, len(M[0]) if M else 0) for M in (nested if several else [nested])]


class Given(NamedTuple):
    """A claim by V = x'Px: A + BK, B, C + DK, D and P by vertices or points, one of each or `count`
    of them; the kind and the bound.
    """

    system: tuple[Stack, Stack, Stack, Stack]
    P: Stack
    K: Stack
    count: int
    kind: str
    bound: Fraction
    dt: Fraction | None

    def of(self, M: Stack, i: int) -> Polynomial:
        """Return the matrix of a vertex or point."""
        return M[i] if len(M) > 1 else M[0]

    def falling(
        self, system: Sequence[Polynomial], P: Polynomial, after: Polynomial, slope: Polynomial
    ) -> Polynomial:
        """Return what must be positive definite."""
        A, B, C, D = system
        moved = after @ A
        top = moved + moved.T + slope if self.dt is None else A.T @ moved
        if self.kind == "decay rate":
            if self.dt is None:
                return -(top + P * (2 * self.bound))
            return P - top * exponential(2 * self.bound * self.dt)[1]
        top = top if self.dt is None else top - P
        if self.kind == "stability":
            return -top
        side = (P @ B if self.dt is None else A.T @ after @ B) + C.T @ D
        corner = D.T @ D - diagonal([self.bound**2] * B.shape[1])
        corner = corner if self.dt is None else corner + B.T @ after @ B
        return -block([[top + C.T @ C, side], [side.T, corner]])


def _closed(system: Sequence[Polynomial], K: Polynomial) -> Stack:
    A, B, C, D = system
    return [A + B @ K, B, C + D @ K, D]


def _lyapunov(plant: Any, own: Any) -> Claim:
    count, n = _sizes(plant)
    A = _stack(plant["A"], "A", count, n, n)
    B, C = (_stack(plant[name], name, count, *size) for name, size in
            (("B", (n, None)), ("C", (None, n))))  # fmt: skip
    m, q = plant["B"]["shape"][2], plant["C"]["shape"][1]
    B, C = [_wide(M, m) for M in B], [_wide(M, n) for M in C]
    D = [_wide(M, m) for M in _stack(plant["D"], "D", count, q, m)]
    P = [even(_rows(M)) for M in _stack(own["P"], "P", count, n, n)]
    K = [zero(m, n)] if own["K"] is None else _stack(own["K"], "K", count, m, n)
    kind, dt = own["kind"], period(plant["dt"])
    bound = number(own["bound"], "the bound")
    if kind not in ("stability", "decay rate", "l2 gain") or bound < 0:
        raise Unreadable("a claim by V = x'Px of a kind that is not known, or a bound below zero")
    if kind == "l2 gain" and not (m and q):
        raise Unreadable("a gain without inputs or outputs")
    given = Given((A, B, C, D), P, K, count, kind, bound, dt)
    said = {
        "stability": "the state tends to zero exponentially from every start",
        "decay rate": f"|x(t)| <= c exp(-a t) |x(0)|, a = {float(bound)!r} 1/s",
        "l2 gain": f"exponentially stable, and |y|_2 < {float(bound)!r} |u|_2 from rest",
    }[kind]
    time = "continuous time" if dt is None else f"samples of {float(dt)!r} s"
    if plant["type"] == "grid":
        return _on_grid(given, plant, said, time)
    refused = ""
    if len(P) > 1 and dt is None:
        refused = "a P of each vertex proves nothing in continuous time"
    demands = list(_of_vertices(given))
    if kind == "decay rate" and not refused:
        demands, refused = _at_least(demands)
    hypotheses = [f"any convex combination of {count} models of {n} states, changing in any way, in"
                  f" {time}"]  # fmt: skip
    if own["K"] is not None:
        each = ", the combination is that of the closed loops of each K" if len(K) > 1 else ""
        hypotheses.append(f"closed by u = K x{each}")
    return Claim(said, hypotheses, demands, refused=refused)


def _sizes(plant: Any) -> tuple[int, int]:
    """Return the numbers of models and of states, both above zero."""
    count, n, _ = (whole(v, "a size", 1, 10**6) for v in plant["A"]["shape"])
    return count, n


def _rows(M: Polynomial) -> list[list[Fraction]]:
    return [[Fraction(v, M.below) for v in row] for row in M.terms.get((), [])]


def _wide(M: Polynomial, columns: int) -> Polynomial:
    return M if M.shape[0] else zero(0, columns)


def _of_vertices(given: Given) -> Iterator[Demand]:
    for i, P in enumerate(given.P):
        yield Demand(f"V > 0 at vertex {i + 1}", P)
    for i in range(given.count):
        own = _closed([given.of(M, i) for M in given.system], given.of(given.K, i))
        P = given.of(given.P, i)
        for j, after in enumerate(given.P):
            form = given.falling(own, P, after, P * 0)
            yield Demand(f"V falls at vertex {i + 1}, before {j + 1}", form)


def _at_least(demands: list[Demand]) -> tuple[list[Demand], str]:
    """Return the strict demands, and which of the others fails: V falls as fast as claimed."""
    strict, refused = [], ""
    for demand in demands:
        if demand.name.startswith("V > 0"):
            strict.append(demand)
        elif not nonnegative(demand.matrix.terms.get((), [])):
            refused = refused or f"{demand.name}: the matrix is not positive semidefinite"
    return strict, refused


def _on_grid(given: Given, plant: Any, said: str, time: str) -> Claim:
    p = ascending(plant["p"], "the points")
    rate = None if plant["rate"] == INFINITE else limit(plant["rate"], "the rate")
    if len(p) != given.count:
        raise Unreadable("the file is damaged: the points are not as many as the models")
    refused = ""
    if given.dt is None and rate is None and any(_rows(P) != _rows(given.P[0]) for P in given.P):
        refused = "P depends on p, and p may jump"

    def demands() -> Iterator[Demand]:
        for k, (a, b) in enumerate(pairwise(p)):
            t = variable(0)
            *system, P, K = (_line(M, k, t) for M in (*given.system, given.P, given.K))
            own = _closed(system, K)
            where = f"between points {k + 1} and {k + 2}"
            yield Demand(f"V > 0 {where}", P, variables=1)
            if given.dt is None:
                slope = P.derivative(0) * (1 / (b - a))
                for r in (-rate, rate) if rate else (Fraction(0),):
                    yield Demand(f"V falls {where}", given.falling(own, P, P, slope * r),
                                 variables=1)  # fmt: skip
                continue
            for c, d, after in _successors(given.P, p, a, b, rate, given.dt):
                part = (t * ((d - c) / (b - a)) + scalar((c - a) / (b - a))).reduced()
                here = [M.at(0, part) for M in (*own, P)]
                form = given.falling(here[:4], here[4], after, P * 0)
                yield Demand(f"V falls {where}", form, variables=1)

    moving = "p may jump" if rate is None else f"|dp/dt| <= {float(rate)!r} per second"
    lines = f"{given.count} models at points of p in [{float(p[0])!r}, {float(p[-1])!r}], straight"
    return Claim(said, [f"{lines} lines between them, in {time}", moving], demands(),
                 refused=refused)  # fmt: skip


def _line(M: Stack, k: int, t: Polynomial) -> Polynomial:
    return M[0] if len(M) == 1 else combined([scalar(1) - t, t], M[k : k + 2])


def _successors(
    P: Stack, p: Sequence[Fraction], a: Fraction, b: Fraction, rate: Fraction | None, dt: Fraction
) -> Iterator[tuple[Fraction, Fraction, Polynomial]]:
    """Yield parts (c, d) of a cell with P at every corner of where p may be a sample later: the
    ends of a step, straight lines, and the points between them.
    """
    low, high = p[0], p[-1]
    step = high - low if rate is None else min(rate * dt, high - low)
    cuts = sorted({a, b, *(c for q in p for c in (q - step, q + step) if a < c < b)})
    for c, d in pairwise(cuts):
        for side in (-step, step):
            ends = [_value(P, p, min(max(q + side, low), high)) for q in (c, d)]
            yield c, d, _line(ends, 0, variable(0))
        for k, q in enumerate(p):
            if len(P) > 1 and d - step <= q <= c + step:
                yield c, d, P[k]


def _value(P: Stack, p: Sequence[Fraction], q: Fraction) -> Polynomial:
    if len(P) == 1:
        return P[0]
    k = max(i for i in range(len(p) - 1) if p[i] <= q)
    t = (q - p[k]) / (p[k + 1] - p[k])
    return P[k] * (1 - t) + P[k + 1] * t


def _terminal(plant: Any, own: Any, content: Any) -> Claim:
    count, n = _sizes(plant)
    m = plant["B"]["shape"][2]
    K = matrix(array(own["K"], "K", m, n), n)
    models = zip(_stack(plant["A"], "A", count, n, n), _stack(plant["B"], "B", count, n, m),
                 strict=True)  # fmt: skip
    loops = [A + B @ K for A, B in models]
    limits = []
    for name, size, to_x in (("x", n, diagonal([1] * n)), ("u", m, K)):
        h = array(plant[f"h_{name}"], "limits", None)
        H = array(plant[f"H_{name}"], "limits", len(h), size)
        limits += [(matrix([a], size) @ to_x, b) for a, b in zip(H, h, strict=True)]
    if any(b < 0 for _, b in limits):
        raise Unreadable("the file is damaged: a limit is below zero")
    ellipsoid = own["level"] is not None
    P = even(array(own["P"], "P", n, n)) if ellipsoid or own["Q"] is not None else diagonal([1] * n)
    demands = [Demand("P > 0", P)]
    if ellipsoid:
        level = number(own["level"], "the level")
        said, refused = f"x'Px <= {float(level)!r}", _ellipsoid(P, level, loops, limits)
    else:
        h = array(own["h"], "h", None)
        H = matrix(array(own["H"], "H", len(h), n), n)
        after = [((H.part([i]) @ A), h[i]) for A in loops for i in range(len(h))]
        said, refused = "H x <= h", _polytope(H, h, limits + after, content["multipliers"])
    claim = f"no motion leaves {said}, and all limits hold in it"
    if own["Q"] is not None:
        Q, R = even(array(own["Q"], "Q", n, n)), even(array(own["R"], "R", m, m))
        claim += "; the cost x'Px falls by x'(Q + K'RK)x at least"
        forms = (P - A.T @ P @ A - Q - K.T @ R @ K for A in loops)
        if not refused and not all(nonnegative(form.terms.get((), [])) for form in forms):
            refused = "the cost falls by less than the stage cost"
    hypotheses = [f"any convex combination of {count} sampled models of {n} states, {m} inputs"]
    return Claim(claim, hypotheses, demands, refused=refused)


def _ellipsoid(P: Any, level: Fraction, loops: Stack, limits: Sequence[Any]) -> str:
    if level <= 0:
        return "the level is not above zero"
    for i, (a, b) in enumerate(limits):
        row = _rows(a.reduced())[0] if a.reduced().terms else [Fraction(0)] * P.shape[0]
        try:
            along = solved(_rows(P), [[v] for v in row])
        except ZeroDivisionError:
            return "P is singular"
        if level * sum(v * x for v, (x,) in zip(row, along, strict=True)) > b * b:
            return f"limit {i + 1} is exceeded in the set"
    for A in loops:
        if not nonnegative((P - A.T @ P @ A).terms.get((), [])):
            return "a state of the set leaves it"
    return ""


def _polytope(H: Polynomial, h: Sequence[Fraction], conditions: Any, multipliers: Any) -> str:
    if any(v < 0 for v in h):
        return "zero is not in the set"
    if len(conditions) != len(multipliers):
        raise Unreadable("the file is damaged: the multipliers are not those of the conditions")
    for i, ((a, b), texts) in enumerate(zip(conditions, multipliers, strict=True)):
        y = [bounded_regions.rational(text) for text in texts]
        if len(y) != len(h):
            raise Unreadable("the file is damaged: a multiplier for each row of H is missing")
        same = not (matrix([y], len(y)) @ H - a).reduced().terms
        total = sum(v * w for v, w in zip(y, h, strict=True))
        if any(v < 0 for v in y) or not same or total > b:
            return f"condition {i + 1} of the set does not follow from its multipliers"
    return ""
