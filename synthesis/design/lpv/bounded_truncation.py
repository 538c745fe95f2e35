"""Fewer states with an error bound that holds while p moves: constant Gramians for all p.

With D constant, R = I + D'D, S = I + DD', A_o = A - B R^-1 D'C, the inequalities of the coprime
factors are linear in the inverses Z and W of the Gramians X of control and Y of filtering,

    A_o Z + Z A_o' + Z C' S^-1 C Z <= B R^-1 B',   W A_o + A_o' W + W B R^-1 B' W <= C' S^-1 C,

and X, (X + W)^-1 are Gramians of the right factors, whose Hankel singular values are s = v / (1 +
v^2)^1/2, v^2 the eigenvalues of XY.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symheli import LPVStateSpace
from symheli.errors import InputError, SynthesisError
from symheli.lpv.balanced_truncation import (
    NEGLIGIBLE,
    Balance,
    BalancedTruncation,
    check_order,
    mean_gramians,
    truncated_by,
)
from symheli.lpv.balancing import REGULAR, balanced_gramians, projected
from symheli.lpv.bases.polynomials import factors_of, lobatto_points, polynomials
from symheli.lpv.nu_gap import channel_scales
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from synthesis.design.lpv.scaled_plant import breaks_of, degrees_of
from synthesis.numerics.program.affine_program import AffineProgram, cells, from_lower
from synthesis.numerics.program.cone_program import Solver

LARGEST = 1e8
"""Gramians and their inverses are kept below this multiple of the identity, in coordinates in which
those of the frozen models are balanced.
"""
POINTS = {1: 201, 2: 21}
"""Values of each parameter at which the inequalities are recomputed (more parameters: 7)."""
ROUNDING = 1e-9
"""Fraction of the largest term of an inequality by which it may be violated there."""
SOLVER = Solver("CLARABEL", tolerance=1e-12)
"""Far below `ROUNDING`: at its usual tolerance one answer in seven is refused there."""


@with_one_thread
def bounded_truncation(
    model: LPVStateSpace,
    order: int,
    *,
    balance: Balance = "factors",
    nodes: int = 21,
    input_scale: object = 1.0,
    output_scale: object = 1.0,
) -> BalancedTruncation[LPVStateSpace]:
    """Reduce the number of states of a continuous model by one projection, with an error bound for
    every p(t) within its range, however fast it moves.

    As `symheli.lpv.balanced_truncation`, with constant Gramians that serve every p: solutions of
    linear matrix inequalities by Bernstein coefficients, recomputed on a fine grid of p.

    Parameters
    ----------
    model : LPVStateSpace
        Continuous, polynomial or piecewise polynomial in p; balanced for feedback with constant D.
    order : int
        States to keep.
    balance : str
        "factors": the bound is one of the L2 gain of the difference of right coprime factors, and
        so of every frozen nu-gap; the model may be unstable. "response": of the L2 gain of the
        difference of the models, in scaled channels; for a quadratically stable model.
    nodes : int
        Values of p of the frozen comparisons.
    input_scale, output_scale : float or array
        Inputs and outputs are divided by it (one a channel, in their units).

    Returns
    -------
    BalancedTruncation
        Its `bound` holds while p moves; `nu_gap` and `error` of frozen p as ever.

    Raises
    ------
    InputError
        A sampled model, functions that are not piecewise polynomial, an order that is too large.
    SynthesisError
        No constant Gramians serve every p: `symheli.lpv.balanced_truncation` needs none.

    References
    ----------
    Wood (1995), Control of parameter-dependent mechanical systems, PhD thesis, Cambridge; Wood,
    Goddard and Glover (1996), IEEE CDC; `lpvbalreal` and `lpvncfbalreal` of LPVTools.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> A = [[[-1.0, 0.1], [0.1, -20.0]], [[0.5, 0.0], [0.0, 1.0]]]
    >>> model = LPVStateSpace.polynomial(A, [[[1.0], [1.0]]], [[[1.0, 1.0]]], [[[0.0]]], p)
    >>> small = synthesis.designs.bounded_truncation(model, 1, balance="response")
    >>> bool(small.error.max() < small.bound < 0.1)
    True
    """
    if not isinstance(model, LPVStateSpace) or model.dt is not None:
        raise InputError("expected a continuous LPVStateSpace, whose parameters may move")
    check_order(order, model)
    for factor in factors_of(model.basis):
        factor.pieces()
    su = channel_scales(input_scale, "input_scale", len(model.inputs))
    sy = channel_scales(output_scale, "output_scale", len(model.outputs))
    gramians = mean_gramians(model, balance, nodes, su, sy)
    into, out, values = balanced_gramians(*gramians, REGULAR)
    values = np.maximum(values, NEGLIGIBLE * values[0])
    inside = model.scaled(
        dict(zip(model.inputs, su, strict=True)), dict(zip(model.outputs, sy, strict=True))
    )
    whole = _FullModel.of(projected(inside, into, out), balance)
    first, second = whole.least(values), whole.dual.least(values)
    if balance == "factors":
        found = into.T @ np.linalg.inv(first) @ into, out @ np.linalg.inv(second) @ out.T
    else:
        found = into.T @ second @ into, out @ first @ out.T
    return truncated_by(found, model, order, balance, nodes, su, sy)


@dataclass(frozen=True, eq=False)
class _FullModel:
    """A, B, C, D (K, ., .) at p (K, m), whose inequality is linear in the unknown Gramian: that of
    reachability, or Z; `dual` has the other.
    """

    matrices: Callable[[Array], Sequence[Array]]
    breaks: list[list[float]]
    box: list[tuple[float, float]]
    balance: Balance

    @classmethod
    def of(cls, model: LPVStateSpace, balance: Balance) -> _FullModel:
        """Time in units in which A is of order one."""
        one = len(model.parameters) == 1
        size = float(np.abs(model.A).max())
        root = 1 / np.sqrt(size) if size > 0 else 1.0

        def matrices(p: Array) -> Sequence[Array]:
            A, B, C, D = model.matrices(p[:, 0] if one else p)
            return root**2 * A, root * B, root * C, D

        if balance == "factors" and degrees_of(lambda p: [matrices(p)[3]], breaks_of(model)) != (
            0,
        ) * len(model.parameters):
            raise InputError(
                "the feedthrough depends on the parameters, and the inequalities of the factors are"
                " of a constant one: put a filter there, or balance the response"
            )
        return cls(matrices, breaks_of(model), list(model.box), balance)

    @property
    def dual(self) -> _FullModel:
        """The transposed model."""

        def turned(p: Array) -> Sequence[Array]:
            A, B, C, D = (np.swapaxes(M, 1, 2) for M in self.matrices(p))
            return A, C, B, D

        return replace(self, matrices=turned)

    def least(self, values: Array) -> Array:
        """Return the Gramian (n, n) of least weighted trace, or the inverse of the largest."""
        n = len(values)
        program = AffineProgram()
        unknown = program.symmetric(n, polynomials([0] * len(self.box), self.box))
        M = program.value(unknown)
        degrees = [2 * d for d in degrees_of(self.matrices, self.breaks)]
        for cell in cells(self.breaks, degrees):
            program.positive(cell, self.inequality(cell.nodes, M, program.known))
        program.positive(cell, program.known(LARGEST * np.eye(n)) - M)
        program.positive(cell, M - program.known(np.eye(n) / LARGEST))
        sign, weight = (-1.0, values) if self.balance == "factors" else (1.0, 1 / values)
        cost = np.zeros(program.count)
        cost[unknown.columns[0]] = sign * np.einsum("eii,i->e", unknown.entries, weight)
        x = program.minimise(cost, SOLVER).x
        found = None if x is None else unknown.coefficients(x)[0]
        if found is None or not self.holds(found):
            raise SynthesisError(
                "no constant Gramians were found that serve every p of the range, however fast it"
                " moves: narrow the range, or take symheli.lpv.balanced_truncation, whose error is"
                " that of frozen p"
            )
        return found

    def inequality(self, p: Array, M: Array, known: Callable[[Array], Array]) -> Array:
        """Return what must be positive semidefinite at p (K, m), with M in the format of the
        matrices that `known` makes.
        """
        A, B, C, D = self.matrices(p)
        if self.balance == "response":
            flow = A @ M + M @ A.mT
            return from_lower([[-flow], [known(B.mT), known(np.eye(B.shape[2]))]])
        R = np.linalg.inv(np.eye(D.shape[2]) + D.mT @ D)
        A = A - B @ R @ D.mT @ C
        flow = A @ M + M @ A.mT
        S = np.eye(D.shape[1]) + D @ D.mT
        return from_lower([[known(B @ R @ B.mT) - flow], [-(C @ M), known(S)]])

    def holds(self, M: Array) -> bool:
        """Whether the inequality holds on a fine grid, to rounding."""
        p = lobatto_points(POINTS.get(len(self.box), 7), self.box).reshape(-1, len(self.box))
        values = np.linalg.eigvalsh(self.inequality(p, M, lambda known: known))
        return bool(values[:, 0].min() >= -ROUNDING * np.abs(values).max())
