"""Search for the largest invariant ellipsoids by semidefinite programs, in floating point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.polynomials import factors_of, lobatto_points, polynomials
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.program.affine_program import (
    AffineProgram,
    BernsteinCell,
    cells,
    from_lower,
)
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver
from synthesis.sets.inequality import decrease, decrease_sampled, within
from synthesis.sets.statement import SetStatement

SPARE = 1e-7
"""Share of every inequality that a candidate leaves, in coordinates in which Q is of order one."""
VOLUME = 1e-3
"""Weight of the volume where the extent along directions is asked for: of the other directions."""
VOLUME_POINTS = 3
"""Values of each parameter at which the volume counts, where Q moves with it."""


class SetSolution(NamedTuple):
    """Q (k, n, n) and Y (k, nu, n) in the functions of the search, tau (nw,), and the objective:
    the geometric mean of the squared semi-axes in the coordinates of the search, or the extent.
    """

    Q: Array
    Y: Array
    shares: Array
    size: float


class SetSearch:
    """The programs of one statement, with Q and Y in these functions of p.

    directions (k, n): make s largest with s times each of them in the set at all p; none: the
    volume.
    """

    def __init__(
        self,
        statement: SetStatement,
        basis: FunctionSpace,
        directions: Array,
        solver: Solver,
    ):
        self.statement, self.basis, self.solver = statement, basis, solver
        self.directions = directions
        model = statement.model
        self.motion = Motion.of(model.parameters)
        self.parts = [
            pieces(model),
            *([] if statement.feedback is None else [pieces(statement.feedback)]),
        ]
        self.cells = self._cells()
        self.points = self._volume_points()
        self.unit = self._time_unit()

    @property
    def sampled(self) -> bool:
        """Whether time is discrete."""
        return self.statement.model.dt is not None

    def largest(self, alpha: float, T: Array, spare: float = SPARE) -> SetSolution | None:
        """The largest set with this alpha, in the coordinates x = T z; None: the solver has
        none.
        """
        own, program = self.statement, AffineProgram()
        n, nu, nw = len(T), len(own.controls), len(own.disturbance)
        Q = program.symmetric(n, self.basis)
        designed = own.feedback is None
        Y = program.full(nu, n, self.basis) if designed and nu else None
        constant = polynomials([0] * len(own.model.parameters), own.model.box)
        unit = np.eye(nw)
        tau = program.variable(unit[:, :, None] * unit, constant) if nw else None
        lower = np.array(
            [np.outer(np.eye(n)[i], np.eye(n)[j]) for i in range(n) for j in range(i + 1)]
        )
        roots = [program.variable(lower, constant) for _ in self.points]
        one = np.ones((1, 1, 1))
        leaves = n * len(self.points)
        depth = max(leaves - 1, 0).bit_length()
        means = [program.variable(one, constant) for _ in range(max(2**depth - 1, 1))]
        extent = program.variable(one, constant) if len(self.directions) else None

        back = np.linalg.inv(T)
        value = program.value
        q = value(Q)
        share = value(tau) if tau is not None else program.known(np.zeros((0, 0)))
        for cell in self.cells:
            M = own.model.matrices(cell.nodes[:, 0] if cell.nodes.shape[1] == 1 else cell.nodes)
            A = back @ M.A @ T
            B, C, D = back @ M.B, M.C @ T, M.D
            if own.feedback is not None:
                y = self._gains(cell) @ T @ q
            elif Y is not None:
                y = value(Y)
            else:
                y = program.known(np.zeros((0, n)))
            motion = A @ q + B[..., own.moved] @ y
            W = B[..., own.disturbed] * own.amplitudes
            least = np.zeros((program.values, 1, 1, 1))
            least[0] = spare
            self._decreases(program, cell, (motion, q, program.slope(Q), W, share), alpha, least)
            seen = (T @ q, C @ q + D[..., own.moved] @ y, y)
            for limit in own.limits:
                row = seen[limit.where][..., limit.index : limit.index + 1, :] / limit.bound
                square = program.known(np.eye(1))
                F = from_lower(within(row, q, square))
                program.positive(cell, F - least * np.eye(n + 1))
            if extent is not None:
                for d in self.directions @ back.T:
                    F = from_lower([[q], [value(extent) * d[None], program.known(np.eye(1))]])
                    program.positive(cell, F)
        point = BernsteinCell(np.atleast_2d(self.points[0]), np.ones((1, 1)))
        if tau is not None:
            room = program.known(np.array([[alpha * self.unit * (1 - spare)]]))
            program.nonnegative(point, room - np.einsum("...ii->...", share)[..., None, None])
        for p, root in zip(self.points, roots, strict=True):
            at = BernsteinCell(np.atleast_2d(p), np.ones((1, 1)))
            L = value(root)
            diagonal = L * np.eye(n)
            program.positive(at, from_lower([[q], [np.swapaxes(L, -1, -2), diagonal]]))
        self._means(program, point, [value(m) for m in means], [value(r) for r in roots])
        cost = np.zeros(program.count)
        weight = 1.0 if extent is None else VOLUME
        cost[means[0].columns.ravel()] = -weight
        if extent is not None:
            cost[extent.columns.ravel()] = -1.0
        answer = program.minimise(cost, self.solver)
        if answer.x is None or answer.answer is not Answer.SOLVED:
            return None
        x = answer.x
        found = T @ Q.coefficients(x) @ T.T
        law = np.zeros((self.basis.size, nu if designed else 0, n))
        if Y is not None:
            law = Y.coefficients(x) @ T.T
        shares = np.zeros(0) if tau is None else np.maximum(np.diag(tau.coefficients(x)[0]), 0.0)
        size = -float(cost @ x)
        return SetSolution(0.5 * (found + np.swapaxes(found, 1, 2)), law, shares / self.unit, size)

    def _decreases(
        self, program: AffineProgram, cell: BernsteinCell, parts: tuple[Array, ...], alpha: float,
        least: Array,
    ) -> None:  # fmt: skip
        (motion, q, slope, W, share), unit = parts, self.unit
        if self.sampled:
            W = program.known(W)
            none = 0 * np.swapaxes(W, -1, -2)
            F = from_lower(decrease_sampled(motion, q, q, W, share, alpha, none))
            program.positive(cell, F - least * np.eye(F.shape[-1]))
            return
        Wt = unit * program.known(np.swapaxes(W, -1, -2))
        for drift in self.motion.drifts([f.size > 1 for f in factors_of(self.basis)]):
            rates = [
                np.full(len(cell.nodes), rate) if j is None else cell.nodes[:, j]
                for rate, j in zip(drift.rates, drift.ties, strict=True)
            ]
            F = from_lower(decrease(motion * unit, q, slope * unit, Wt, share, alpha * unit))
            program.positive(cell, F - least * np.eye(F.shape[-1]), np.transpose(rates))

    def _means(
        self, program: AffineProgram, point: BernsteinCell, means: list[Array], roots: list[Array]
    ) -> None:
        """Impose that the first of the means is no more than the geometric mean of the diagonals
        of all roots.

        A binary tree: each is at most the geometric mean of the two below it, [a m; m b] >= 0; the
        places beyond the last leaf are taken by the first mean itself.
        """
        leaves = [L[..., i : i + 1, i : i + 1] for L in roots for i in range(L.shape[-1])]
        if len(leaves) == 1:
            program.nonnegative(point, leaves[0] - means[0])
            return
        nodes = [*means, *leaves]
        nodes += [means[0]] * (2 * len(means) + 1 - len(nodes))
        for k, mean in enumerate(means):
            a, b = nodes[2 * k + 1], nodes[2 * k + 2]
            program.positive(point, from_lower([[a], [mean, b]]))

    def _gains(self, cell: BernsteinCell) -> Array:
        K = self.statement.feedback
        assert K is not None  # noqa: S101 - asked by the caller
        return K.matrices(cell.nodes[:, 0] if cell.nodes.shape[1] == 1 else cell.nodes).D

    def _cells(self) -> list[BernsteinCell]:
        """The boxes between all breaks, with nodes for the degrees of the products."""
        breaks, degrees = [], []
        for i in range(len(self.motion.box)):
            inner = {b for part in self.parts for b in part.breaks[i]}
            breaks.append(sorted(inner))
            most = sum(
                max(M.degrees[i] for models in part.models.values() for M in models)
                for part in self.parts
            )
            q = factors_of(self.basis)[i].size - 1
            degrees.append(most + q + any(j == i for j in self.motion.ties))
        return cells(breaks, degrees)

    def _volume_points(self) -> list[Array]:
        moving = [f.size > 1 for f in factors_of(self.basis)]
        box = self.motion.box
        if not any(moving):
            return [np.array([0.5 * (a + b) for a, b in box])]
        points = lobatto_points(VOLUME_POINTS, box).reshape(-1, len(box))
        return list(points)

    def _time_unit(self) -> float:
        """A time of the order of the model's, s; 1 in discrete time."""
        if self.sampled:
            return 1.0
        middle = [0.5 * (a + b) for a, b in self.motion.box]
        poles = np.abs(np.linalg.eigvals(self.statement.model.at(*middle).A))
        typical = float(np.median(poles)) if len(poles) else 0.0
        return 1.0 / typical if typical > 0 else 1.0
