"""First-order forms: c + g'z + [-r, r] over the symbols z of a domain, beside an interval.

The quadratic part of a product over a ball is enclosed by its eigenvalues; functions of one
variable by the line that leaves the smallest remainder. Rounding errors of c and g are added to r.
Source: affine arithmetic (de Figueiredo & Stolfi 2004), balls instead of boxes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.tubes.enclosure.interval import Interval, down, up

EPS = float(np.finfo(float).eps)
MARGIN = 1 + 2.0**-40
"""Factor on sums of bounds: more than the rounding errors of 1000 additions of numbers >= 0."""
UNDERFLOW = 1e-150
"""Added to norms, whose squares may underflow."""


@dataclass(frozen=True, eq=False)
class AffineForm:
    """Numbers `centre` + `slopes` z + [-rest, rest] that also lie in `interval`.

    `centre`, `rest` and the interval's sides have one shape, (N,) or (N, s); `slopes` has one more
    axis, over the symbols. `groups`: number of symbols of each group of the domain.
    """

    centre: Array
    slopes: Array
    rest: Array
    groups: tuple[int, ...]
    bound: Interval | None = field(default=None, repr=False)

    # --- range -----------------------------------------------------------------------------------

    @cached_property
    def norms(self) -> Array:
        """Upper bounds of the norms of the slopes by group, (..., number of groups)."""
        return _norms(self.slopes, self.groups)

    @cached_property
    def linear(self) -> Array:
        """Upper bound of |slopes z|."""
        return self.norms.sum(axis=-1) * MARGIN

    @cached_property
    def interval(self) -> Interval:
        """Guaranteed interval of the numbers."""
        radius = self.linear + self.rest
        # a constant has no radius: 0 stays 0, so that max(x, 0) has a square root
        radius = np.where(radius == 0.0, 0.0, up(radius * MARGIN))
        own = Interval.around(self.centre, radius)
        return own if self.bound is None else own.intersect(self.bound)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the centre."""
        return self.centre.shape

    def __getitem__(self, index: Any) -> AffineForm:
        bound = self.bound
        return AffineForm(
            self.centre[index],
            self.slopes[index],
            self.rest[index],
            self.groups,
            None if bound is None else Interval(bound.lower[index], bound.upper[index]),
        )

    @classmethod
    def constant(cls, value: Any, like: AffineForm) -> AffineForm:
        """Known numbers, in the shape of another form."""
        centre = np.broadcast_to(np.asarray(value, float), like.shape)
        return cls(centre, np.zeros(like.slopes.shape), np.zeros(like.shape), like.groups)

    @classmethod
    def between(cls, interval: Interval, like: AffineForm) -> AffineForm:
        """Numbers of which only an interval is known."""
        middle = interval.middle
        return cls(
            middle,
            np.zeros((*middle.shape, like.slopes.shape[-1])),
            interval.reach(middle),
            like.groups,
            interval,
        )

    def settled(self) -> AffineForm:
        """The same numbers by their interval where the form is infinite or the wider one."""
        inside = self.interval
        middle = inside.middle
        radius = inside.reach(middle)
        poor = ~(
            np.isfinite(self.centre)
            & np.isfinite(self.rest)
            & np.all(np.isfinite(self.slopes), axis=-1)
        ) | (radius < self.rest)
        if not np.any(poor):
            return self
        lower = np.where(np.isnan(inside.lower), -np.inf, inside.lower)
        upper = np.where(np.isnan(inside.upper), np.inf, inside.upper)
        radius = np.where(np.isnan(radius), np.inf, radius)
        return AffineForm(
            np.where(poor, middle, self.centre),
            np.where(poor[..., None], 0.0, self.slopes),
            np.where(poor, radius, self.rest),
            self.groups,
            Interval(lower, upper),
        )

    # --- arithmetic ------------------------------------------------------------------------------

    def _spread(self) -> float:
        """|g|_1 is at most this times the sum of the norms by group."""
        return max(self.groups, default=1) ** 0.5 * MARGIN

    def __neg__(self) -> AffineForm:
        bound = None if self.bound is None else -self.bound
        return AffineForm(-self.centre, -self.slopes, self.rest, self.groups, bound)

    def __add__(self, other: AffineForm | float) -> AffineForm:
        if not isinstance(other, AffineForm):
            other = AffineForm.constant(other, self)
        centre, slopes = self.centre + other.centre, self.slopes + other.slopes
        size = np.abs(self.centre) + np.abs(other.centre)
        size = size + self._spread() * (self.linear + other.linear)
        rest = (self.rest + other.rest + EPS * size) * MARGIN
        return AffineForm(
            centre, slopes, rest, self.groups, self.interval + other.interval
        ).settled()

    def __sub__(self, other: AffineForm | float) -> AffineForm:
        return self + (-other)

    def __mul__(self, other: AffineForm | float) -> AffineForm:
        if not isinstance(other, AffineForm):
            return self.scaled(other)
        if self.shape != other.shape:
            a, b = np.broadcast_arrays(self.centre, other.centre)
            return self.broadcast(a.shape) * other.broadcast(b.shape)
        dots = _by_group(self.slopes * other.slopes, self.groups)
        middle = 0.5 * dots.sum(axis=-1)
        whole, own = self.linear * other.linear, (self.norms * other.norms).sum(axis=-1)
        # within a group z'a b'z lies between (a'b -+ |a||b|)/2, or is 0
        quadratic = np.maximum(whole - 0.5 * own, 0.0) + 2.0**-40 * whole
        a, b = np.abs(self.centre), np.abs(other.centre)
        rounding = a * b + self._spread() * (a * other.linear + b * self.linear + whole)
        rest = (
            quadratic
            + self.rest * (b + other.linear)
            + other.rest * (a + self.linear)
            + self.rest * other.rest
            + (4 + self.slopes.shape[-1]) * EPS * rounding
            + UNDERFLOW
        ) * MARGIN
        return AffineForm(
            self.centre * other.centre + middle,
            self.centre[..., None] * other.slopes + other.centre[..., None] * self.slopes,
            rest,
            self.groups,
            self.interval * other.interval,
        ).settled()

    def square(self) -> AffineForm:
        """The numbers squared."""
        half = 0.5 * self.linear**2
        a = np.abs(self.centre)
        rounding = a * a + half + self._spread() * a * self.linear
        rest = (
            half
            + self.rest * (2 * a + 2 * self.linear + self.rest)
            + 8 * EPS * rounding
            + UNDERFLOW
        ) * MARGIN
        return AffineForm(
            self.centre**2 + half,
            2 * self.centre[..., None] * self.slopes,
            rest,
            self.groups,
            self.interval.square(),
        ).settled()

    def scaled(self, factor: float | Array) -> AffineForm:
        """The numbers times a known one, a float or an array of the form's shape."""
        factor = np.asarray(factor, float)
        size = np.abs(factor)
        rounding = np.abs(self.centre) + self._spread() * self.linear
        bound = Interval.around(np.broadcast_to(factor, self.shape)) * self.interval
        return AffineForm(
            self.centre * factor,
            self.slopes * factor[..., None],
            (size * (self.rest + EPS * rounding) + UNDERFLOW) * MARGIN,
            self.groups,
            bound,
        ).settled()

    def broadcast(self, shape: tuple[int, ...]) -> AffineForm:
        """The same form in a larger shape; (N,) becomes (N, s) by a new last axis first."""
        form = self[:, None] if len(self.shape) < len(shape) else self
        slopes = np.broadcast_to(form.slopes, (*shape, form.slopes.shape[-1]))
        bound = form.interval
        return AffineForm(
            np.broadcast_to(form.centre, shape),
            slopes,
            np.broadcast_to(form.rest, shape),
            form.groups,
            Interval(np.broadcast_to(bound.lower, shape), np.broadcast_to(bound.upper, shape)),
        )

    # --- functions of one variable ---------------------------------------------------------------

    def _line(self, slope: Array, remainder: Interval, bound: Interval) -> AffineForm:
        """slope x + remainder, where that encloses the function on the interval of x."""
        middle = remainder.middle
        own = self.scaled(slope)
        free = AffineForm(own.centre, own.slopes, own.rest, self.groups)
        shifted = free.centre + middle
        rest = (free.rest + remainder.reach(middle) + EPS * np.abs(shifted)) * MARGIN
        return AffineForm(shifted, free.slopes, rest, self.groups, bound).settled()

    def sqrt(self) -> AffineForm:
        """Square roots: concave, so that sqrt(x) - s x lies between its ends and 1/(4 s); without
        bounds where some of the numbers are negative.
        """
        none = ~(self.interval.lower >= 0)
        x = Interval(np.maximum(self.interval.lower, 0.0), self.interval.upper)
        bound = self.interval.sqrt()
        total = bound.lower + bound.upper
        slope = 1 / np.where(total > UNDERFLOW, total, 1.0)
        s = Interval.around(slope)
        ends = [Interval.around(t).sqrt() - s * Interval.around(t) for t in (x.lower, x.upper)]
        least = np.minimum(ends[0].lower, ends[1].lower)
        most = (Interval.around(np.full(self.shape, 4.0)) * s).inverse().upper
        least, most = np.where(none, -np.inf, least), np.where(none, np.inf, most)
        return self._line(slope, Interval(least, most), bound)

    def inverse(self) -> AffineForm:
        """1/x: convex for x > 0, so that 1/x + s x lies between 2 sqrt(s) and its ends; odd."""
        negative = self.interval.upper < 0
        x = Interval(
            np.where(negative, -self.interval.upper, self.interval.lower),
            np.where(negative, -self.interval.lower, self.interval.upper),
        )
        usable = x.lower > 0
        x = Interval(np.where(usable, x.lower, 1.0), np.where(usable, x.upper, 1.0))
        slope = 1 / (x.lower * x.upper)
        slope = np.where(np.isfinite(slope) & (slope > 0), slope, 1.0)
        s = Interval.around(slope)
        ends = [Interval.around(t).inverse() + s * Interval.around(t) for t in (x.lower, x.upper)]
        least = down(down(2 * np.sqrt(slope) * (1 - 2 * EPS)))
        most = np.maximum(ends[0].upper, ends[1].upper)
        remainder = Interval(np.where(negative, -most, least), np.where(negative, -least, most))
        remainder = Interval(
            np.where(usable, remainder.lower, -np.inf), np.where(usable, remainder.upper, np.inf)
        )
        return self._line(-slope, remainder, self.interval.inverse())

    def absolute(self) -> AffineForm:
        """|x|: itself, its negative, or a line in between where the sign is open."""
        x = self.interval
        width = x.upper - x.lower
        open_ = (x.lower < 0) & (x.upper > 0) & np.isfinite(width) & (width > 0)
        tilted = (x.upper + x.lower) / np.where(open_, width, 1.0)
        slope = np.where(open_, tilted, np.where(x.lower >= 0, 1.0, -1.0))
        slope = np.clip(slope, -1.0, 1.0)
        s = Interval.around(slope)
        ends = [Interval.around(t).absolute() - s * Interval.around(t) for t in (x.lower, x.upper)]
        # |x| - s x is convex with its least value 0 at 0
        most = np.maximum(np.maximum(ends[0].upper, ends[1].upper), 0.0)
        zero = np.zeros(self.shape)
        endless = ~np.isfinite(most)
        remainder = Interval(zero, np.where(open_ | endless, most, 0.0))
        return self._line(slope, remainder, x.absolute())

    def maximum(self, other: AffineForm) -> AffineForm:
        """The larger of two numbers."""
        difference = self - other
        sum_ = (difference + difference.absolute()).scaled(0.5) + other
        a, b = self.interval, other.interval
        bound = Interval(np.maximum(a.lower, b.lower), np.maximum(a.upper, b.upper))
        chosen = replace(sum_, bound=sum_.interval.intersect(bound)).settled()
        apart = difference.interval
        chosen = pick((a.lower >= b.upper) | (apart.lower >= 0), self, chosen)
        return pick((b.lower >= a.upper) | (apart.upper <= 0), other, chosen)

    def minimum(self, other: AffineForm) -> AffineForm:
        """The smaller of two numbers."""
        return -((-self).maximum(-other))

    def elementary(self, name: str) -> AffineForm:
        """sin, cos, exp, asin or atan of the numbers, by the first-order Taylor polynomial about
        the middle of their interval and bounds of the second derivative.
        """
        x = self.interval
        finite = np.isfinite(x.lower) & np.isfinite(x.upper)
        x = Interval(np.where(finite, x.lower, 0.0), np.where(finite, x.upper, 0.0))
        middle = x.middle
        at, bound = Interval.around(middle), x.apply(name)
        slope, second = _derivatives(name, at, x)
        s = slope.middle
        reach = Interval.around(np.zeros(self.shape), x.reach(middle))
        curved = second * reach.square() * Interval.around(np.full(self.shape, 0.5))
        curved = Interval(np.minimum(curved.lower, 0.0), np.maximum(curved.upper, 0.0))
        # f = f(m) + s (x - m) + (f'(m) - s)(x - m) + curved
        remainder = (
            at.apply(name) - Interval.around(s) * at + (slope - Interval.around(s)) * reach + curved
        )
        remainder = Interval(
            np.where(finite, remainder.lower, -np.inf), np.where(finite, remainder.upper, np.inf)
        )
        bound = Interval(
            np.where(finite, bound.lower, -np.inf), np.where(finite, bound.upper, np.inf)
        )
        return self._line(s, remainder, bound)

    def slope_of(self, name: str) -> AffineForm:
        """The derivative of an elementary function at the numbers."""
        match name:
            case "sin":
                return self.elementary("cos")
            case "cos":
                return -self.elementary("sin")
            case "exp":
                return self.elementary("exp")
            case "asin":
                return (-self.square() + 1.0).sqrt().inverse()
            case "atan":
                return (self.square() + 1.0).inverse()
        raise AssertionError(name)


def _derivatives(name: str, at: Interval, x: Interval) -> tuple[Interval, Interval]:
    """First derivative at a point, second on an interval around it."""
    one = Interval.around(np.ones(x.lower.shape))
    match name:
        case "sin":
            return at.apply("cos"), -x.apply("sin")
        case "cos":
            return -at.apply("sin"), -x.apply("cos")
        case "exp":
            return at.apply("exp"), x.apply("exp")
        case "asin":
            slope, hill = (one - at.square()).sqrt().inverse(), one - x.square()
            return slope, x * (hill * hill.sqrt()).inverse()
        case "atan":
            two = Interval.around(np.full(x.lower.shape, 2.0))
            return (one + at.square()).inverse(), -(two * x * (one + x.square()).square().inverse())
    raise AssertionError(name)


@cache
def _runs(groups: tuple[int, ...]) -> list[tuple[int, slice, slice]]:
    """Groups side by side of one size where that is 1, else each: (size, groups, symbols)."""
    out: list[tuple[int, slice, slice]] = []
    for i, (group, start) in enumerate(zip(groups, np.cumsum([0, *groups]).tolist(), strict=False)):
        if group == 1 and out and out[-1][0] == 1:
            _, which, symbols = out.pop()
            out.append((1, slice(which.start, i + 1), slice(symbols.start, start + 1)))
        else:
            out.append((group, slice(i, i + 1), slice(start, start + group)))
    return out


def _by_group(values: Array, groups: tuple[int, ...]) -> Array:
    """Sums over the symbols of each group."""
    if all(g == 1 for g in groups):
        return values
    out = np.empty((*values.shape[:-1], len(groups)))
    for group, which, symbols in _runs(groups):
        own = values[..., symbols]
        out[..., which] = own if group == 1 else own.sum(axis=-1, keepdims=True)
    return out


def _norms(slopes: Array, groups: tuple[int, ...]) -> Array:
    if all(g == 1 for g in groups):
        return np.abs(slopes)
    out = np.empty((*slopes.shape[:-1], len(groups)))
    for group, which, symbols in _runs(groups):
        own = slopes[..., symbols]
        if group == 1:
            out[..., which] = np.abs(own)
        else:
            square = np.einsum("...i,...i->...", own, own)[..., None]
            out[..., which] = np.sqrt(square) * MARGIN + UNDERFLOW
    return out


def pick(condition: Array, yes: AffineForm, no: AffineForm) -> AffineForm:
    """`yes` where the condition (N,) or (N, s) holds, else `no`."""
    if np.all(condition):
        return yes
    if not np.any(condition):
        return no
    a, b = yes.interval, no.interval
    return AffineForm(
        np.where(condition, yes.centre, no.centre),
        np.where(condition[..., None], yes.slopes, no.slopes),
        np.where(condition, yes.rest, no.rest),
        yes.groups,
        Interval(np.where(condition, a.lower, b.lower), np.where(condition, a.upper, b.upper)),
    )


def hull(a: AffineForm, b: AffineForm) -> AffineForm:
    """A form that contains both."""
    centre, slopes = 0.5 * a.centre + 0.5 * b.centre, 0.5 * a.slopes + 0.5 * b.slopes
    apart = np.abs(a.centre - b.centre) + _norms(a.slopes - b.slopes, a.groups).sum(axis=-1)
    size = np.abs(a.centre) + np.abs(b.centre) + a._spread() * (a.linear + b.linear)
    rest = (0.5 * apart + np.maximum(a.rest, b.rest) + 4 * EPS * size) * MARGIN
    return AffineForm(centre, slopes, rest, a.groups, a.interval.hull(b.interval)).settled()
