"""Verification of P(p) on the whole box, from the model and P alone, for every relaxation.

Floating point: Bernstein coefficients, boxes halved until they decide, and a grid through the
model's own code. Exact: the same boxes in rational arithmetic, and single p by `pointwise`. The
inequalities themselves (`inequalities`), the regions and the algebra of polynomials are those from
which the cone program was assembled; `pointwise` has none of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.lpv.bases.polynomials import factors_of
from symheli.lpv.lpv_matrices import LPVMatrices, Matrices
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.tracking import tracked
from synthesis.certify.proof import pointwise
from synthesis.certify.proof.inequalities import Pair, decrease, output_form, positivity
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.definite import negative_definite, negative_definite_exactly
from synthesis.numerics.polynomial.exact import Number, exact, rational
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import Pieces
from synthesis.numerics.polynomial.regions import convert, regions

GRID = 100
"""Number of values of p at which a proof is checked in floating point."""

INDEPENDENT_POINTS = 40
"""Number of values of several parameters at which a proof is checked once more, through the
model's own matrices.
"""


class BoxEvidence(NamedTuple):
    """A model with the required property, against which any P and bound can be checked;
    `demand.shift` is left to the bound.
    """

    model: Pieces
    units: Scaling
    demand: Demand

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The parameters of the model."""
        return self.model.parameters

    @property
    def matrices(self) -> LPVMatrices:
        """The model."""
        return self.model.source

    def fault(self, P: BoxLyapunov, kind: str, rates: tuple[float, ...]) -> str | None:
        """Return why P does not belong to this model and statement, before any inequality is
        checked; None where it does.
        """
        if not isinstance(P, BoxLyapunov):
            return f"expected a BoxLyapunov, got {type(P).__name__}"
        if kind != self.demand.kind or self.demand.shift != 0.0:
            return f"the proof is of the {self.demand.kind}, the certificate of the {kind}"
        if (
            len(rates) != len(self.model.parameters)
            or not all(r >= 0 for r in rates)
            or rates != self.demand.rates
        ):
            return f"the proof is for rates {self.demand.rates}, the certificate for {rates}"
        if not self.demand.motion.suits(self.model.parameters) or self.demand.time != 1.0:
            return "the parameters of the model do not move as those of the proof"
        if not self.model.original:
            return "the pieces are not those of the model"
        if self.demand.channel != 1.0:
            return "the outputs of the model are not in the units of the proof"
        if self.demand.of_gramian and self.model.passes_peaks:
            return f"the {kind} of a continuous model needs D = 0"
        return structure.first(
            P.fault_for([(s.low, s.high) for s in self.model.parameters], self.model.sizes[0]),
            self.units.fault(self.model.sizes[0]),
        )

    @property
    def scaled(self) -> tuple[Pieces, Demand]:
        """The model and the required property in scaled units; outputs per root of time where their
        energy counts, unchanged where their peaks do.
        """
        u, root = self.units, math.sqrt(self.units.time)
        outputs = u.channel if self.demand.of_gramian else u.channel / root
        model = self.model.scaled(u.left, u.right, 1 / root, outputs, u.time)
        time = u.time if model.dt is None else 1.0
        return model, self.demand._replace(time=time, channel=u.channel)

    def in_units(self, value: float) -> float:
        """Return a physical gain (decay rate, 1/s) in the scaled units."""
        if self.demand.kind.facets.decays:
            return value * self.units.time if self.model.dt is None else value
        return value / self.units.channel ** self.demand.kind.facets.powers[1]

    def to_physical(self, P: Array) -> Array:
        """Return Lyapunov matrices of V in physical units, squared outputs times seconds or, where
        peaks count, squared inputs times seconds, from those in scaled ones.
        """
        return self.units.to_physical(P) / self._input_energy

    def to_scaled(self, P: Array) -> Array:
        """Return the inverse of `to_physical`."""
        return self.units.to_scaled(P) * self._input_energy

    def scaled_back(self, P: BoxLyapunov) -> BoxLyapunov:
        """Return P in scaled units."""
        return replace(P, coefficients=self.to_scaled(P.coefficients))

    @property
    def _input_energy(self) -> float:
        return self.units.channel ** (2.0 - self.demand.kind.facets.powers[0])

    def floating(self, P: BoxLyapunov, bound: float) -> bool:
        """Check the whole box in floating point, and a grid of p through the model's own
        matrices.
        """
        model, demand = self.scaled
        if not demand.meaningful(model.dt, P.degrees) or math.isinf(bound):
            return False
        back = self.scaled_back(P)
        if not all(
            map(negative_definite, polynomials(model, back, demand, self.in_units(bound), float))
        ):
            return False
        return self.on_grid(P, bound)

    def exact(self, P: BoxLyapunov, bound: float) -> bool:
        """Check the whole box in rational arithmetic: the doubles of model, P, rates and bound as
        exact rationals.
        """
        if not self.demand.meaningful(self.model.dt, P.degrees) or math.isinf(bound):
            return False
        statement = self.model, P, self.demand, bound
        count = sum(1 for _ in polynomials(*statement, float))
        every = tracked(
            "verifying in rational arithmetic", polynomials(*statement, rational()), count
        )
        return all(map(negative_definite_exactly, every)) and self.checked_independently(
            P, bound, rational()
        )

    def checked_independently(self, P: BoxLyapunov, bound: float, number: Number) -> bool:
        """Check that the pieces are the model, and that the inequalities hold at some p without
        them; see `pointwise`.
        """
        points = self._points(P, 1, INDEPENDENT_POINTS)
        own = self.model.at(points)
        if not all(self._reproduced(p, [M[k] for M in own]) for k, p in enumerate(points)):
            return False
        every = (
            F
            for k, p in enumerate(points)
            for F in pointwise.inequalities(
                *(P, p, Matrices(*(exact(M[k], number) for M in own)), self.demand),
                *(self.model.dt, bound, number),
            )
        )
        return pointwise.negative(every, number)

    def on_grid(self, P: BoxLyapunov, bound: float) -> bool:
        """Check the same in floating point at more p, in scaled units."""
        u, points, (_, demand) = self.units, self._points(P, GRID, GRID), self.scaled
        model = u.of_matrices(self.model.at(points))
        if self.demand.of_gramian:
            C, D = (M / math.sqrt(u.time) for M in (model.C, model.D))
            model = model._replace(C=C, D=D)
        back, bound = self.scaled_back(P), self.in_units(bound)
        every = (
            F
            for k, p in enumerate(points)
            for F in pointwise.inequalities(
                *(back, p, Matrices(*(M[k] for M in model)), demand, self.model.dt, bound, float),
            )
        )
        return pointwise.negative(every, float, u.weight)

    def _points(self, P: BoxLyapunov, least: int, count: int) -> Array:
        """Return values of p at which it can stay forever, on every interval between knots of P and
        breaks of the model's own functions, independent of the pieces.
        """
        axes = []
        for factor, s, breaks, knots in zip(
            factors_of(self.model.source.basis),
            *(self.model.parameters, self.model.breaks, P.knots),
            strict=True,
        ):
            own = (q.low for q in factor.pieces() if s.low < q.low < s.high)
            axes.append(pointwise.inside([*knots, *own, *breaks], least))
        points = pointwise.combined(axes, count)
        return points[[self.demand.motion.reaches([(q, q) for q in p]) for p in points]]

    def _reproduced(self, p: Array, own: list[Array]) -> bool:
        index = tuple(
            pointwise.segment_of(np.array(b), float(q))
            for b, q in zip(self.model.breaks, p, strict=True)
        )
        for M, expected in zip(self.model.models[index], own, strict=True):
            size = np.abs(M.coefficients).max(axis=tuple(range(len(p))))
            if not pointwise.same_entries(
                pointwise.tensor(M.coefficients, M.box, p), expected, size
            ):
                return False
        return True


def polynomials(
    model: Pieces, P: BoxLyapunov, demand: Demand, bound: float, number: Number
) -> Iterator[PolynomialMatrix]:
    """Yield every polynomial matrix that must be negative definite, for this bound."""
    for index in np.ndindex(*P.segments):
        yield positivity(convert(P.segment(index), number))
    nx, nu, ny = model.sizes
    kind = demand.kind
    g = kind.facets.level(number(bound)) if kind.driven else None
    if kind.facets.decays:
        demand = demand._replace(shift=bound)
    level = 0 if kind.facets.supply is None else g
    for region in regions(model, P.knots, demand.motion, demand.moving(P.degrees)):
        pair = Pair(
            *(convert(P.segment(index), number) for index in (region.segment, region.next_segment))
        )
        for F in decrease(model, region, pair, demand, number, level):
            if demand.of_gramian:
                F = _less(F, np.r_[np.zeros(nx), np.ones(nu)], number(1.0), number)
            yield F
        if demand.of_gramian and region.next_segment == region.segment:
            F, seen = output_form(model, region, pair.here, demand, number), demand.seen(ny)
            yield _less(F, np.r_[np.zeros(F.shape[0] - seen), np.ones(seen)], g, number)


def _less(F: PolynomialMatrix, where: Array, g: object, number: Number) -> PolynomialMatrix:
    return F - PolynomialMatrix.constant(exact(np.diag(where), number) * g, F.box)
