"""State feedback for listed plants: one gain for all, or one each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError, SynthesisError
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.design.plant.generalized import Generalized
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.numerics.program.affine_program import (
    CONSTANT,
    POINT,
    AffineProgram,
    MatrixVariable,
    from_lower,
)
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.switching.listed import ListedBound, listed_gain

PAIRS = 64
"""Pairs of models that follow one another up to which each model has a storage function."""
BACK_OFFS, ENOUGH = (1.01, 1.05, 1.2, 2.0), 1.02
"""Multiples of the least gain at which gains of moderate size are chosen, tried in turn, and that
of a multiple up to which what is proven ends the search.
"""
MARGIN = 1e-7
"""Least multiple of the identity that is left in every inequality, in the units of the plant."""


@dataclass(frozen=True, eq=False)
class ListedFeedback:
    """Gains of u = K x, with the gain from disturbances to performance that is proven of them.

    Attributes
    ----------
    K : array (N, nu, n)
        Of every plant, for nu controls; all the same where one gain serves all.
    optimum : float
        Least gain of the program, computed.
    proof : ListedBound
        What is proven of the closed loops in any order.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> model = LinearModel(
    ...     [[1.0]], [[1.0, 1.0]], [[1.0], [0.0]], [[0.0, 0.0], [0.0, 0.1]],
    ...     ["x"], ["w", "u"], ["x", "cost"])
    >>> plant = synthesis.Plant(model, ["w"], ["x", "cost"], ["u"], ["x"])
    >>> synthesis.switching.listed_feedback([plant]).proof.verified
    True
    """

    K: Array
    optimum: float
    proof: ListedBound

    __repr__ = summarized

    def __str__(self) -> str:
        each = "one gain for each plant" if np.ptp(self.K, axis=0).any() else "one gain for all"
        return f"{each}, optimum {self.optimum:.6g}\n{self.proof}"


@with_one_thread
def listed_feedback(
    plants: Sequence[Plant], *, scheduled: bool = False, solver: Solver | str = "CLARABEL"
) -> ListedFeedback:
    """Design u = K x of least L2 gain for listed plants that follow one another in any order.

    Sampled plants, up to eight, have a storage function each; others one together. One K for all
    serves their mixtures too; with `scheduled` the plant that acts must be known.

    Parameters
    ----------
    plants : sequence of Plant
        Of the same states, disturbances, controls and performance, each without parameters; their
        measurements are not used.
    scheduled : bool
        One gain for each plant.
    solver : Solver or str
        For the design and the search of the proof.

    Returns
    -------
    ListedFeedback
        Gains and proof.

    Raises
    ------
    InputError
        Plants that do not fit together, or with parameters.
    SynthesisError
        No gain was found.

    See Also
    --------
    synthesis.state_feedback : gains that are functions of parameters

    References
    ----------
    de Oliveira, Bernussou and Geromel, Systems and Control Letters 37 (1999).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> def plant(a):
    ...     model = LinearModel(
    ...         [[a]], [[1.0, 1.0]], [[1.0], [0.0]], [[0.0, 0.0], [0.0, 0.1]],
    ...         ["x"], ["w", "u"], ["x", "cost"], dt=0.1)
    ...     return synthesis.Plant(model, ["w"], ["x", "cost"], ["u"], ["x"])
    >>> made = synthesis.switching.listed_feedback([plant(0.9), plant(1.3)])
    >>> print(f"K = {made.K[0].item():.3f}, gain {made.proof.bound:.3f}")
    K = -1.100, gain 1.258
    """
    each = _plants(plants)
    solver, best = general_solver(solver), None
    optimum = _Design(each, scheduled, plants[0].dt).least(solver)
    for level in () if optimum is None else (factor * optimum for factor in BACK_OFFS):
        K = _Design(each, scheduled, plants[0].dt).gains(level, solver)
        if K is None:
            continue
        loops = [_closed(G, k, plants[0].dt) for G, k in zip(each, K, strict=True)]
        made = ListedFeedback(K, optimum or 0.0, listed_gain(loops, solver=solver))
        best = made if best is None or made.proof.bound < best.proof.bound else best
        if best.proof.bound <= ENOUGH * level:
            break
    if best is None or not best.proof.verified:
        words = "one gain for each plant" if scheduled else "one gain for all plants"
        raise SynthesisError(
            f"no gain was found that passes the exact check, of {words}"
            + ("" if scheduled else "; scheduled=True gives each its own")
        )
    return best


def _plants(given: Sequence[Plant]) -> list[Generalized]:
    if not isinstance(given, Sequence) or not given:
        raise InputError("plants: expected a list of at least one Plant")
    for plant in given:
        require_plant(plant)
    first = given[0].channels[:4]
    if any(p.channels[:4] != first or p.dt != given[0].dt for p in given):
        raise InputError(
            "plants: expected the same states, disturbances, controls, performance and sample"
            " period of all"
        )
    if any(p.nominal.basis.size > 1 for p in given):
        raise InputError("plants: expected plants without parameters; list their frozen models")
    return [p.at(*(s.middle for s in p.parameters)) for p in given]


class _Design:
    """The program of the gains K = Y G^-1 of listed plants."""

    def __init__(self, each: Sequence[Generalized], scheduled: bool, dt: float | None) -> None:
        size, (n, nu) = len(each), each[0].B2.shape
        self.size, self.apart = size, size if scheduled else 1
        self.program = program = AffineProgram()
        many = dt is not None and size**2 <= PAIRS
        X = [program.symmetric(n, CONSTANT) for _ in range(size if many else 1)]
        self.G = [program.full(n, n, CONSTANT) for _ in range(self.apart)] if many else X
        self.Y = [program.full(nu, n, CONSTANT) for _ in range(self.apart)]
        self.level = program.variable(np.ones((1, 1, 1)), CONSTANT)
        self.most = program.variable(np.ones((1, 1, 1)), CONSTANT)
        values = [[program.value(one) for one in group] for group in (X, self.G, self.Y)]
        for own in values[0]:
            self._positive(own)
        for i, at in enumerate(each):
            own = (values[0][i % len(X)], values[1][i % len(self.G)], values[2][i % self.apart])
            for after in values[0]:
                self._positive(_inequality(program, at, own, after, program.value(self.level), dt))
        most = program.value(self.most)
        for own in values[0]:  # then |Y X^-1| is at most the number
            program.positive(
                POINT, from_lower([[own], [program.known(np.eye(n)), most * np.eye(n)]])
            )
            for Y in values[2]:
                program.positive(POINT, from_lower([[own], [Y, most * np.eye(nu)]]))

    def _positive(self, form: Array) -> None:
        margin = self.program.known(MARGIN * np.eye(form.shape[-1]))
        self.program.positive(POINT, form - margin)

    def least(self, solver: Solver) -> float | None:
        """Return the least gain, None where there is none."""
        x = self._solved(self.level, solver)
        return None if x is None else math.sqrt(max(self._number(self.level, x), 0.0))

    def gains(self, gamma: float, solver: Solver) -> Array | None:
        """Return the gains (N, nu, n) of moderate size that have this gain."""
        level = self.program.value(self.level)
        self.program.positive(POINT, self.program.known(np.array([[gamma**2]])) - level)
        x = self._solved(self.most, solver)
        if x is None:
            return None
        inverse = [np.linalg.inv(one.coefficients(x)[0]) for one in self.G]
        Y = [one.coefficients(x)[0] for one in self.Y]
        made = [Y[i % len(Y)] @ inverse[i % len(inverse)] for i in range(self.size)]
        return np.array(made)

    def _number(self, of: MatrixVariable, x: Array) -> float:
        return float(x[of.columns.ravel()][0])

    def _solved(self, of: MatrixVariable, solver: Solver) -> Array | None:
        cost = np.zeros(self.program.count)
        cost[of.columns.ravel()] = 1.0
        found = self.program.minimise(cost, solver)
        return None if found.answer is Answer.INFEASIBLE else found.x


def _inequality(
    program: AffineProgram,
    at: Generalized,
    own: tuple[Array, Array, Array],
    after: Array,
    g: Array,
    dt: float | None,
) -> Array:
    """Return what must be positive: of the storage x' X^-1 x, with A G + B2 Y the loop times G."""
    X, G, Y = own
    nw, nz = at.B1.shape[1], at.C1.shape[0]
    moves, shows = at.A @ G + at.B2 @ Y, at.C1 @ G + at.D12 @ Y
    supply, one = g * np.eye(nw), program.known(np.eye(nz))
    B1, D11 = program.known(at.B1), program.known(at.D11)
    if dt is None:
        rate = -(moves + np.swapaxes(moves, -1, -2))
        return from_lower([[rate], [-np.swapaxes(B1, -1, -2), supply], [-shows, -D11, one]])
    before = G + np.swapaxes(G, -1, -2) - X
    return from_lower([[before], [None, supply], [moves, B1, after], [shows, D11, None, one]])


def _closed(at: Generalized, K: Array, dt: float | None) -> LinearModel:
    names = [tuple(f"{letter}{i}" for i in range(n)) for letter, n in
             zip("xwz", (len(at.A), at.B1.shape[1], len(at.C1)), strict=True)]  # fmt: skip
    return LinearModel(at.A + at.B2 @ K, at.B1, at.C1 + at.D12 @ K, at.D11, *names, dt=dt)
