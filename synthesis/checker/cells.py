"""Boxes of p on which model and P are polynomials, and in discrete time the values that p(k+1) may
have from there.

|dp_i/dt| <= rate_i, or dp_i/dt = p_j (`tie` j). With a period dt, p_i changes by at most rate_i dt,
or by dt p_j within dt^2/2 times the rate of p_j. A p_j that is the rate of p_i can be no larger
than what lets p_i stay in its range: p_j^2 <= 2 rate_j (high_i - p_i) above zero, and in the same
way below.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from itertools import product as combinations
from typing import NamedTuple

from .polynomials import Box, Polynomial, combined, scalar, variable
from .reading import Model, Parameter

PARTS = 8
"""Parts of the range of a parameter that is the rate of another, where p(k+1) depends on it."""


class Strip(NamedTuple):
    """An interval of one parameter inside one segment of P; where P moves in discrete time, what of
    a `following` segment is reached: p(k+1) at (lower end, least), (lower end, largest), (upper
    end, least), (upper end, largest).
    """

    low: Fraction
    high: Fraction
    segment: int
    following: int
    reached: tuple[Fraction, ...] | None


class Cell(NamedTuple):
    """A box of p, `here`, as polynomials on a unit box whose first variables are those of p, and
    p(k+1), `there`; segments of P at both, and the middle of the box.
    """

    strips: tuple[Strip, ...]
    here: tuple[Polynomial, ...]
    there: tuple[Polynomial, ...]
    motion: tuple[Parameter, ...]
    variables: int
    segments: tuple[int, ...]
    following: tuple[int, ...]
    middle: tuple[Fraction, ...]

    def drifts(self, F: Polynomial, varies: Sequence[bool]) -> list[tuple[str, Polynomial]]:
        """Return (at which rates, dF/dt) at every corner of the box of rates of the parameters with
        which F varies.
        """
        found = [("", F * 0)]
        for i, (p, strip) in enumerate(zip(self.motion, self.strips, strict=True)):
            if not varies[i]:
                continue
            slope = F.derivative(i) * (1 / (strip.high - strip.low))
            if p.tie is not None:
                along = combined([self.here[p.tie]], [slope])
                found = [(said, G + along) for said, G in found]
            elif p.rate is not None:
                found = [
                    (f"{said} with dp{i + 1}/dt = {float(rate):.6g}", G + slope * rate)
                    for said, G in found
                    for rate in (-p.rate, p.rate)
                ]
        return found

    def reaches(self, box: Box) -> bool:
        """Whether p can be in this part of the unit box and stay in its ranges forever."""
        ends = [
            tuple(s.low + t * (s.high - s.low) for t in side)
            for s, side in zip(self.strips, box, strict=False)
        ]
        for i, p in enumerate(self.motion):
            jerk = None if p.tie is None else self.motion[p.tie].rate
            if p.tie is None or jerk is None:
                continue
            (a, b), (c, d) = ends[i], ends[p.tie]
            if d < 0 and d * d > 2 * jerk * (b - p.low):
                return False
            if c > 0 and c * c > 2 * jerk * (p.high - a):
                return False
        return True

    def place(self, point: Sequence[Fraction]) -> str:
        """Say where a point of the unit box is."""
        said = []
        for i, (strip, *both) in enumerate(zip(self.strips, self.here, self.there, strict=True)):
            now, later = (F.value(point) for F in both)
            said.append(f"p{i + 1} = {now.terms[()][0][0] / now.below:.9g}")
            if strip.reached is not None:
                said.append(f"p{i + 1} a sample later = {later.terms[()][0][0] / later.below:.9g}")
        return ", ".join(said)


def cells(
    model: Model,
    motion: tuple[Parameter, ...],
    knots: Sequence[Sequence[Fraction]],
    moving: Sequence[bool],
) -> Iterator[Cell]:
    """Yield boxes that cover all p; `moving`: whether P changes as a parameter moves."""
    m, dt = len(motion), model.dt
    free = [i for i in range(m) if motion[i].tie is None]
    tied = [i for i in range(m) if motion[i].tie is not None]

    def strips(i: int, others: dict[int, Strip]) -> list[Strip]:
        p, cuts = motion[i], {*knots[i], *model.factors[i].breaks}
        if dt is not None and any(motion[k].tie == i and moving[k] for k in tied):
            cuts |= {p.low + (p.high - p.low) * Fraction(k, PARTS) for k in range(PARTS)}
        span = _span(motion, i, others, dt) if dt is not None and moving[i] else None
        inside = sorted({p.low, p.high, *(c for c in cuts if p.low < c < p.high)})
        return list(_strips(p, inside, knots[i], span))

    for choice in combinations(*(strips(i, {}) for i in free)):
        found = dict(zip(free, choice, strict=True))
        for rest in combinations(*(strips(i, found) for i in tied)):
            found.update(zip(tied, rest, strict=True))
            cell = _cell(tuple(found[i] for i in range(m)), motion)
            if cell.reaches(((Fraction(0), Fraction(1)),) * m):
                yield cell


def _span(
    motion: Sequence[Parameter], i: int, others: dict[int, Strip], dt: Fraction
) -> tuple[Fraction, Fraction]:
    """Return the (least, largest) change of a parameter in a sample; the width of its range where
    it may jump.
    """
    p, width = motion[i], motion[i].high - motion[i].low
    if p.tie is None:
        reach = width if p.rate is None else min(p.rate * dt, width)
        return -reach, reach
    q, strip = motion[p.tie], others[p.tie]
    low, high = q.low * dt, q.high * dt
    if q.rate is not None:
        slack = q.rate * dt * dt / 2
        low, high = max(low, strip.low * dt - slack), min(high, strip.high * dt + slack)
    return max(low, -width), min(high, width)


def _strips(
    p: Parameter,
    cuts: Sequence[Fraction],
    knots: Sequence[Fraction],
    span: tuple[Fraction, Fraction] | None,
) -> Iterator[Strip]:
    """Yield the intervals of one parameter, with each segment of P that is reached from them."""
    for a, b in pairwise(cuts):
        own = sum((a + b) / 2 >= k for k in knots[1:-1])
        if span is None:
            yield Strip(a, b, own, own, None)
            continue
        down, up = span
        for j, (left, right) in enumerate(pairwise(knots)):
            # the segment is reached from left - up to right - down; the limits of p(k+1), clipped
            # to it, are straight lines between these values and those where the clipping begins
            ends = sorted({a, b, *(c for k in (left, right) for c in (k - up, k - down)
                                   if a < c < b)})  # fmt: skip
            for c, d in pairwise(ends):
                if not left - up <= (c + d) / 2 <= right - down:
                    continue
                q = [min(max(v + s, left), right) for v in (c, d) for s in (down, up)]
                yield Strip(c, d, own, j, tuple(q))


def _cell(strips: tuple[Strip, ...], motion: tuple[Parameter, ...]) -> Cell:
    m = len(strips)
    more = [i for i, s in enumerate(strips) if s.reached is not None]
    here, there, one = [], [], scalar(1)
    for i, s in enumerate(strips):
        t = variable(i)
        here.append((one * s.low + t * (s.high - s.low)).reduced())
        if s.reached is None:
            there.append(here[-1])
            continue
        r = variable(m + more.index(i))
        a, b, c, d = s.reached
        q = one * a + r * (b - a) + t * (c - a) + t @ r * (a - b - c + d)
        there.append(q.reduced())
    middle = tuple((s.low + s.high) / 2 for s in strips)
    return Cell(
        *(strips, tuple(here), tuple(there), motion, m + len(more)),
        *(tuple(s.segment for s in strips), tuple(s.following for s in strips), middle),
    )
