"""Parameter-dependent Lyapunov functions: V = x' P(p) x, of higher degree in x, or with a memory of
p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.certify.statement.lag import LagRegion
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.bernstein import blossom
from synthesis.numerics.polynomial.symmetric import symmetrized
from synthesis.numerics.polynomial.symmetric_power import (
    monomials,
    null_matrix,
    null_size,
    null_weights,
    power,
)


@dataclass(frozen=True, eq=False)
class SplineLyapunov:
    """P(p) of `degree` d on the K segments between `knots` (K + 1,), continuous: coefficients (K d
    + 1, n, n).

    Segment j has the Bernstein coefficients j d .. (j + 1) d; P is in physical units of the states,
    V in those of the squared output times seconds (samples in discrete time). Degree 0 is one
    constant P.

    `order` m > 1: V = z' P(p) z with the N monomials z of degree m in the states (see
    `symmetric_power`), n = N then. `slack` (blocks, null space): what was added to each Bernstein
    coefficient of -dV/dt to make it definite. `multiplier` (K e + 1,) >= 0 of a norm-bounded block,
    (K e + 1, parts) of one of several parts: Bernstein coefficients of lambda(p), a continuous
    spline of degree e on the same knots, in squared outputs per squared output of the block.
    `coordinates` T (n, n), for order 1: V is (T x)' P(p) (T x), where rounding P to the units of
    the states would take its margin.
    """

    knots: Array
    degree: int
    coefficients: Array
    order: int = 1
    slack: Array | None = None
    multiplier: Array | None = None
    coordinates: Array | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        optional = ("slack", "multiplier", "coordinates")
        given = (name for name in optional if getattr(self, name) is not None)
        _freeze(self, "knots", "coefficients", *given)
        if self.fault:
            raise InputError(self.fault)

    @property
    def fault(self) -> str | None:
        """Reason why the form is invalid, None where it is valid."""
        found = structure.first(
            structure.ascending(self.knots),
            structure.whole(self.degree, 0, "degree"),
            structure.whole(self.order, 1, "order"),
        )
        if found:
            return found
        n = self.coefficients.shape[-1] if self.coefficients.ndim else 0
        if self.slack is not None and (self.slack.ndim != 2 or not np.all(np.isfinite(self.slack))):
            return (
                "slack must be finite numbers, a row a Bernstein coefficient, got shape"
                f" {self.slack.shape}"
            )
        return structure.first(
            structure.symmetric(self.coefficients, (self.segments * self.degree + 1, n, n)),
            self._fault_of_multiplier(self.multiplier),
            self._fault_of_coordinates(self.coordinates, n),
        )

    def _fault_of_coordinates(self, T: Array | None, n: int) -> str | None:
        if T is None or (self.order == 1 and T.shape == (n, n) and np.all(np.isfinite(T))):
            return None
        return f"coordinates must be a finite matrix of shape {(n, n)}, for order 1"

    def _fault_of_multiplier(self, values: Array | None) -> str | None:
        if values is None:
            return None
        if values.ndim not in (1, 2) or not values.size or (len(values) - 1) % self.segments:
            return (
                f"a multiplier on {self.segments} segment(s) has a multiple of that many"
                f" coefficients and one, got shape {values.shape}"
            )
        if not (np.all(np.isfinite(values)) and np.all(values >= 0)):
            return "the coefficients of a multiplier must be finite numbers >= 0"
        return None

    def fault_for(self, low: float, high: float, states: int) -> str | None:
        """Return why it is not a function of `states` states for every p in [low, high]; None where
        it is.
        """
        if self.fault:
            return self.fault
        size = len(monomials(states, self.order)) if self.order > 1 else states
        if self.coefficients.shape[-1] != size:
            return f"P is of {self.coefficients.shape[-1]} variables, the model has {size}"
        if self.slack is not None and self.slack.shape[1] != null_size(states, self.order):
            return (
                f"slack must have {null_size(states, self.order)} columns, got"
                f" {self.slack.shape[1]}"
            )
        return structure.covering(self.knots, low, high)

    @property
    def segments(self) -> int:
        """Number of segments K."""
        return len(self.knots) - 1

    @property
    def form(self) -> str:
        """The form in words."""
        P = (
            "constant P"
            if self.degree == 0
            else f"P a continuous spline of degree {self.degree} on {self.segments} segment(s)"
        )
        if self.multiplier is not None:
            P = f"{P}, multiplier of degree {self.multiplier_degree}"
        return P if self.order == 1 else f"V of degree {2 * self.order} in the states, {P}"

    @property
    def multiplier_degree(self) -> int:
        """Degree e of the multiplier; -1 without one."""
        return -1 if self.multiplier is None else (len(self.multiplier) - 1) // self.segments

    def in_units(
        self, T: Array, factor: float = 1.0, time: float = 1.0, multiplier: float = 1.0
    ) -> SplineLyapunov:
        """Return factor V as a function of the states z, x = T z, T (n, n), with time in units of
        `time` and the multiplier times `multiplier`.
        """
        lifted = power(T, self.order)
        slack = self.slack
        if slack is not None:
            n = len(T)
            slack = null_weights(
                factor * time * lifted.T @ null_matrix(slack, n, self.order) @ lifted, n, self.order
            )
        if self.coordinates is not None:
            lifted = self.coordinates @ lifted
        return replace(
            self,
            coefficients=_congruent(self.coefficients, lifted, factor),
            coordinates=None,
            slack=slack,
            multiplier=None if self.multiplier is None else multiplier * self.multiplier,
        )

    def kept_in(self, T: Array, factor: float = 1.0) -> SplineLyapunov:
        """Return factor V as a function of the states x, z = T x, with these `coordinates`."""
        return replace(self, coefficients=factor * self.coefficients, coordinates=T)

    def segment(self, j: int) -> Array:
        """Bernstein coefficients (d + 1, n, n) on segment j."""
        return self.coefficients[j * self.degree : (j + 1) * self.degree + 1]

    @property
    def multipliers(self) -> Array:
        """Bernstein coefficients (K e + 1, parts) of the multipliers."""
        assert self.multiplier is not None  # noqa: S101 - see the callers
        return self.multiplier.reshape(len(self.multiplier), -1)

    def multiplier_segment(self, j: int) -> Array:
        """Bernstein coefficients (e + 1, parts) of the multipliers on segment j."""
        e = self.multiplier_degree
        return self.multipliers[j * e : (j + 1) * e + 1]

    def at(self, p: float | Array) -> Array:
        """P at p in the units of the states, shape p.shape + (n, n). Raises `InputError` outside
        the knots.
        """
        j, t = self._locate(p)
        return self._of_states(self._sum(self.coefficients, self.degree, j * self.degree, t))

    def derivative(self, p: float | Array) -> Array:
        """dP/dp at p (per unit of p), the right-hand one at a knot, shape p.shape + (n, n)."""
        j, t = self._locate(p)
        if self.degree == 0:
            return np.zeros((*np.shape(t), *self.coefficients.shape[1:]))
        widths = np.repeat(np.diff(self.knots), self.degree)[:, None, None]
        slopes = self.degree * np.diff(self.coefficients, axis=0) / widths
        return self._of_states(self._sum(slopes, self.degree - 1, j * self.degree, t))

    def _of_states(self, P: Array) -> Array:
        return P if self.coordinates is None else _congruent(P, self.coordinates, 1.0)

    @staticmethod
    def _sum(coefficients: Array, degree: int, first: Array, t: Array) -> Array:
        weights = blossom([t] * degree)
        return sum(
            (
                (w * np.ones_like(t))[..., None, None] * coefficients[first + i]
                for i, w in enumerate(weights)
            ),
            np.zeros(()),
        )

    def _locate(self, p: float | Array) -> tuple[Array, Array]:
        p = np.asarray(p, dtype=float)
        slack = 1e-9 * (self.knots[-1] - self.knots[0])
        if p.size and (p.min() < self.knots[0] - slack or p.max() > self.knots[-1] + slack):
            raise InputError(
                f"p spans [{p.min():.4g}, {p.max():.4g}], P is known on [{self.knots[0]:.4g},"
                f" {self.knots[-1]:.4g}]"
            )
        j = np.clip(np.searchsorted(self.knots, p, side="right") - 1, 0, self.segments - 1)
        t = (p - self.knots[j]) / (self.knots[j + 1] - self.knots[j])
        return j, np.clip(t, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class MemoryLyapunov:
    """V = x' P(p, e) x with the lag error e = p - q of p and its own lag q (see `LagRegion`), a
    spline in both.

    On segment j of the region's knots P has degree `degree` in p; across, in s = (e - lower)/(upper
    - lower), degree `lead_degree` on the segments between `lead_knots` (from 0 to 1).
    `coefficients` (K d + 1, L l + 1, n, n).
    """

    region: LagRegion
    degree: int
    lead_knots: Array
    lead_degree: int
    coefficients: Array

    __repr__ = summarized

    order = 1
    slack = None
    multiplier = None
    coordinates = None

    def __post_init__(self) -> None:
        _freeze(self, "lead_knots", "coefficients")
        if self.fault:
            raise InputError(self.fault)

    @property
    def fault(self) -> str | None:
        """Reason why the form is invalid, None where it is valid."""
        if not isinstance(self.region, LagRegion):
            return f"region must be a LagRegion, got {type(self.region).__name__}"
        found = structure.first(
            self.region.fault,
            structure.ascending(self.lead_knots, "lead_knots"),
            structure.whole(self.degree, 1, "degree"),
            structure.whole(self.lead_degree, 1, "lead_degree"),
        )
        if found:
            return found
        n = self.coefficients.shape[-1] if self.coefficients.ndim else 0
        shape = (
            self.segments * self.degree + 1,
            (len(self.lead_knots) - 1) * self.lead_degree + 1,
            n,
            n,
        )
        return structure.first(
            structure.covering(self.lead_knots, 0.0, 1.0, "the share"),
            structure.symmetric(self.coefficients, shape),
        )

    def fault_for(self, low: float, high: float, states: int) -> str | None:
        """Return why it is not a function of `states` states for every p in [low, high]; None where
        it is.
        """
        if self.fault:
            return self.fault
        if self.coefficients.shape[-1] != states:
            return f"P is of {self.coefficients.shape[-1]} variables, the model has {states}"
        return structure.covering(self.knots, low, high)

    @property
    def knots(self) -> Array:
        """Knots in p (K + 1,)."""
        return self.region.knots

    @property
    def segments(self) -> int:
        """Number of segments in p, K."""
        return len(self.knots) - 1

    @property
    def form(self) -> str:
        """The form in words."""
        across = f"{self.lead_degree} on {len(self.lead_knots) - 1} segment(s) of p - q"
        return (
            f"P(p, p - q) of degree {self.degree} on {self.segments} segment(s) of p and {across}, "
            f"q a lag of p of {self.region.time:g} s: a known state of p, not of the model"
        )

    def in_units(
        self, T: Array, factor: float = 1.0, time: float = 1.0, multiplier: float = 1.0
    ) -> MemoryLyapunov:
        """Return factor V as a function of the states z, x = T z, T (n, n), with time in units of
        `time`; there is no `multiplier`.
        """
        region = replace(self.region, time=self.region.time / time)
        return replace(self, region=region, coefficients=_congruent(self.coefficients, T, factor))

    def patch(self, j: int, i: int) -> Array:
        """Bernstein coefficients (d + 1, l + 1, n, n) on segment j in p and i across."""
        d, l = self.degree, self.lead_degree
        return self.coefficients[j * d : (j + 1) * d + 1, i * l : (i + 1) * l + 1]

    def at(self, p: float, share: float) -> tuple[Array, Array, Array]:
        """(P, dP/dp at constant e, dP/de) at p and e = lower + share (upper - lower), per unit of
        p.
        """
        j = min(int(np.searchsorted(self.knots, p, side="right")) - 1, self.segments - 1)
        i = min(
            int(np.searchsorted(self.lead_knots, share, side="right")) - 1, len(self.lead_knots) - 2
        )
        width, breadth = (
            self.knots[j + 1] - self.knots[j],
            self.lead_knots[i + 1] - self.lead_knots[i],
        )
        x, y = (p - self.knots[j]) / width, (share - self.lead_knots[i]) / breadth
        patch = self.patch(j, i)
        along, across = blossom([x] * self.degree), blossom([y] * self.lead_degree)
        steeper, wider = blossom([x] * (self.degree - 1)), blossom([y] * (self.lead_degree - 1))
        P = np.einsum("i,k,iknm->nm", along, across, patch)
        in_p = (
            np.einsum("i,k,iknm->nm", steeper, across, self.degree * np.diff(patch, axis=0)) / width
        )
        in_share = (
            np.einsum("i,k,iknm->nm", along, wider, self.lead_degree * np.diff(patch, axis=1))
            / breadth
        )
        _, height, rise, widening = (float(v) for v in self.region.locate(np.array(p)))
        return P, in_p - in_share * (rise + share * widening) / height, in_share / height


Lyapunov = SplineLyapunov | MemoryLyapunov


def _freeze(thing: object, *names: str) -> None:
    for name in names:
        object.__setattr__(thing, name, structure.numbers(getattr(thing, name), name))


def _congruent(P: Array, T: Array, factor: float) -> Array:
    return symmetrized(factor * T.T @ P @ T)


def graded_knots(
    low: float,
    high: float,
    segments: int,
    grading: float,
    breaks: Sequence[float] = (),
    shortest: float = 0.0,
) -> Array:
    """Return knots low + (high - low) (k/K)^grading, moved onto a `break` of the model that is
    near, none closer than `shortest`.

    They are short binary fractions, so that exact arithmetic on them stays short.
    """
    quantum = 2.0 ** np.floor(np.log2((high - low) / (8 * segments**grading)))
    ideal = low + (high - low) * (np.arange(1, segments) / segments) ** grading
    inner = np.round(ideal / quantum) * quantum
    points = np.array([low, *inner, high])
    for k in range(1, segments):
        reach = 0.3 * min(points[k] - points[k - 1], points[k + 1] - points[k])
        near = [b for b in breaks if abs(b - points[k]) <= reach]
        points[k] = min(near, key=lambda b: abs(b - points[k])) if near else points[k]
    kept = [low]
    for point in points[1:-1]:
        if point - kept[-1] >= max(shortest, 0.5 * quantum) and high - point >= max(
            shortest, 0.5 * quantum
        ):
            kept.append(float(point))
    return np.array([*kept, high])
