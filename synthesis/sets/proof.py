"""The exact check of an invariant ellipsoid: its inequalities for every p, in rational
arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from symheli import LPVStateSpace
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.proof.inequalities import slope_along
from synthesis.numerics.polynomial.definite import negative_definite, negative_definite_exactly
from synthesis.numerics.polynomial.exact import Number, exact, rational
from synthesis.numerics.polynomial.matrix import PolynomialMatrix, block
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.polynomial.regions import Region, convert, model_on, regions
from synthesis.sets.inequality import Lower, decrease, decrease_sampled, within
from synthesis.sets.statement import SetStatement


def holds(
    statement: SetStatement,
    shape: LPVStateSpace,
    alpha: float,
    shares: Array,
    *,
    rigorous: bool = True,
) -> bool:
    """Whether x' Q(p)^-1 x <= 1 is invariant within the limits, for all p: Q(p) is the A of `shape`
    (its symmetric part), one polynomial, and Y(p), where no feedback is given, its C; `shares` are
    tau. In rational arithmetic on the doubles given, or in floating point.
    """
    number = rational() if rigorous else float
    tau = np.asarray(shares, dtype=float)
    if not (alpha >= 0 and np.all(tau >= 0) and len(tau) == len(statement.disturbance)):
        return False
    if sum(map(number, tau.tolist()), number(0.0)) > number(alpha):
        return False
    parts = _Parts(statement, shape, number)
    if not parts.fits():
        return False
    negative = negative_definite_exactly if rigorous else negative_definite
    return all(
        negative(-F)
        for region in tracked("verifying the set", parts.regions())
        for F in parts.inequalities(region, alpha, tau)
    )


class _Loop:
    """Model and given feedback as polynomials on regions, in the arithmetic of `number`."""

    def __init__(self, statement: SetStatement, number: Number):
        self.statement, self.number = statement, number
        self.model = pieces(statement.model)
        self.feedback = None if statement.feedback is None else pieces(statement.feedback)
        self.motion = Motion.of(statement.model.parameters)

    def regions(self) -> list[Region]:
        """All boxes of p on which everything is polynomial."""
        box = [(s.low, s.high) for s in self.statement.model.parameters]
        breaks = box if self.feedback is None else self.feedback.breaks
        still = [False] * len(box)  # no inequality has Q at another p
        return list(regions(self.model, [np.array(b) for b in breaks], self.motion, still))

    def matrices(self, region: Region) -> tuple[PolynomialMatrix, ...]:
        """A, B of the controls, W of disturbances of size 1, C, D of the controls."""
        own, number = self.statement, self.number
        A, B, C, D = model_on(self.model, region, number)
        Bu, W, Du = (
            PolynomialMatrix(M.box, M.coefficients[..., which])
            for M, which in ((B, own.moved), (B, own.disturbed), (D, own.moved))
        )
        W = PolynomialMatrix(W.box, W.coefficients * exact(own.amplitudes, number))
        return A, Bu, W, C, Du

    def gains(self, region: Region) -> PolynomialMatrix:
        """The given K; none where nothing is controlled."""
        if self.feedback is None:
            nothing = exact(np.zeros((0, self.model.sizes[0])), self.number)
            box = tuple((self.number(a), self.number(b)) for a, b in region.box)
            return PolynomialMatrix.constant(nothing, box)
        return self.on(self.feedback.models[region.segment][3], region.box)

    def on(self, M: PolynomialMatrix, box: Sequence[tuple[float, float]]) -> PolynomialMatrix:
        """A polynomial matrix on a box."""
        own = tuple((self.number(a), self.number(b)) for a, b in box)
        return convert(M, self.number).restrict(own)


def closed_pieces(
    statement: SetStatement, number: Number
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix, PolynomialMatrix]]:
    """A and W (of disturbances of size 1) of the loop with the given feedback, and the rows of all
    limits over their bounds, on boxes that cover all p.
    """
    loop = _Loop(statement, number)
    for region in loop.regions():
        A, B, W, C, D = loop.matrices(region)
        K = loop.gains(region)
        eye = PolynomialMatrix.constant(exact(np.eye(A.shape[0]), number), A.box)
        seen = (eye, C + D @ K, K)
        one = number(1.0)
        rows = [
            _row(seen[limit.where], limit.index) * (one / number(limit.bound))
            for limit in statement.limits
        ]
        yield A + B @ K, W, block([[row] for row in rows])


def _row(M: PolynomialMatrix, index: int) -> PolynomialMatrix:
    return PolynomialMatrix(M.box, M.coefficients[..., index : index + 1, :])


class _Parts(_Loop):
    """The loop with Q and, where it was designed, Y."""

    def __init__(self, statement: SetStatement, shape: LPVStateSpace, number: Number):
        super().__init__(statement, number)
        self.shape = pieces(shape)
        self.law = next(iter(self.shape.models.values()))

    @property
    def moving(self) -> list[bool]:
        """Whether Q depends on each parameter."""
        return [degree > 0 for degree in self.law[0].degrees]

    def fits(self) -> bool:
        """Whether Q has the states of the model and is one polynomial on its box, and depends on no
        parameter that may jump, in discrete time on none that moves.
        """
        model, own = self.statement.model, self.law
        n, nu = len(model.states), len(self.statement.controls)
        rows = nu if self.feedback is None else 0
        if len(self.shape.models) > 1 or self.shape.source.box != model.box:
            return False
        if own[0].shape != (n, n) or own[2].shape != (rows, n):
            return False
        for s, moves in zip(model.parameters, self.moving, strict=True):
            jumps = s.rate == math.inf if model.dt is None else s.rate != 0
            if moves and jumps:
                return False
        return True

    def inequalities(
        self, region: Region, alpha: float, shares: Array
    ) -> Iterator[PolynomialMatrix]:
        """Every matrix that must be positive definite on the region."""
        own, number, box = self.statement, self.number, region.box
        A, Bu, W, C, Du = self.matrices(region)
        Q = self.on(self.law[0], box)
        Q = (Q + Q.T) * number(0.5)
        Y = self.on(self.law[2], box) if self.feedback is None else self.gains(region) @ Q
        tau = PolynomialMatrix.constant(exact(np.diag(shares), number), W.box)
        motion = A @ Q + Bu @ Y
        if self.model.dt is not None:
            rows = decrease_sampled(motion, Q, Q, W, tau, number(alpha), W.T * 0)
            yield _whole(rows, number)
        else:
            for drift in self.motion.drifts(self.moving):
                slope = slope_along(Q, drift, 1.0, number)
                slope = Q * 0 if slope is None else slope
                yield _whole(decrease(motion, Q, slope, W.T, tau, number(alpha)), number)
        seen = (Q, C @ Q + Du @ Y, Y)
        for limit in own.limits:
            row = _row(seen[limit.where], limit.index)
            bound = exact([[limit.bound]], number)
            yield _whole(within(row, Q, PolynomialMatrix.constant(bound @ bound, row.box)), number)


def _whole(rows: Lower, number: Number) -> PolynomialMatrix:
    """The symmetric matrix of a lower triangle of blocks."""
    half = number(0.5)
    n = len(rows)
    full = [
        [(rows[i][i] + rows[i][i].T) * half if i == j else rows[i][j] if j < i else rows[j][i].T
         for j in range(n)]
        for i in range(n)
    ]  # fmt: skip
    return block(full)
