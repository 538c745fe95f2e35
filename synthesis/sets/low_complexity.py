"""Invariant sets of sampled LPV models with as many pairs of faces as states: |W x| <= 1.

With W = V^-1 square, x(k+1) = A(p) x + E(p) w stays in |W x|_inf <= 1 for all |w_i| <= 1 where
every row of W A V and W E together has an absolute sum of at most 1 (the dual of the linear
programs over the 2^n vertices); |c x| <= b holds in it where the absolute sum of c V is at most b.
The entries are polynomials in p, and their sums at any p are at most convex combinations of those
of their Bernstein coefficients, so finitely many sums prove all p, however p moves.

Sources: Bitsoris, "Positively invariant polyhedral sets of discrete-time linear systems", Int. J.
Control 47 (1988); Blanchini and Miani, "Set-Theoretic Methods in Control" (2008), chapter 4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import linprog

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized
from synthesis.numerics.polynomial.exact import Number, exact, rational
from synthesis.sets.proof import closed_pieces
from synthesis.sets.proven_set import ProvenSet
from synthesis.sets.statement import SetStatement, stated

STEPS = 60
"""Linear programs at most."""
TRUST, LEAST_TRUST = 0.2, 1e-4
"""Largest relative change of V in a step, at first, and where the search ends."""
ROOM = 1.01
"""Factor on the spectral radius of a matrix that is scaled to be stable."""
SPARE = 1e-9
"""Part of every sum that the search leaves for rounding."""


@dataclass(frozen=True, eq=False)
class LowComplexitySet(ProvenSet):
    """The states x = V z, |z_i| <= 1, that no motion of a sampled LPV model leaves, within limits.

    Made by `low_complexity_set`.

    Attributes
    ----------
    statement : SetStatement
        Model, feedback, disturbances and limits.
    V : array (n, n)
        Its columns are the directions to the faces; W = V^-1.
    verified : bool
        The sums hold in exact arithmetic for every p.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a set without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    >>> import numpy as np
    >>> from symheli import LinearModel
    >>> model = LinearModel(
    ...     [[0.5, 0.2], [0.0, 0.7]], np.zeros((2, 0)), np.eye(2), np.zeros((2, 0)), ["x", "y"], [],
    ...     ["x_m", "y_m"], dt=0.1)
    >>> found = synthesis.sets.low_complexity_set(model, state_bounds={"x": 1.0, "y": 2.0})
    >>> found.verified, found.half_widths.round(3).tolist(), found.contains([0.9, 1.9])
    (True, [1.0, 2.0], True)
    """

    statement: SetStatement
    V: Array
    verified: bool
    why: str = ""
    form: ClassVar[str] = "invariant parallelepiped"

    __repr__ = summarized

    @property
    def shape_stored(self) -> Mapping[str, Any]:
        """Values that a file holds of the set beside its statement."""
        return {"V": self.V}

    @cached_property
    def half_widths(self) -> Array:
        """Largest size of each state, (n,), in its unit."""
        return np.abs(self.V).sum(axis=1)

    @property
    def volume(self) -> float:
        """Volume, in the product of the states' units."""
        return float(2.0 ** len(self.V) * abs(np.linalg.det(self.V)))

    def level(self, x: Any) -> Array:
        """|W x|_inf of states (..., n): at most 1 in the set."""
        x = frozen(x, "x")
        if x.shape[-1:] != (len(self.V),):
            raise InputError(f"x: expected {len(self.V)} states along the last axis, got {x.shape}")
        z = np.linalg.solve(self.V, x.reshape(-1, len(self.V)).T)
        return np.abs(z).max(axis=0).reshape(x.shape[:-1])

    def verify(self, rigorous: bool = True) -> bool:
        """Check every sum again, in rational arithmetic always."""
        number = rational()
        V = exact(self.V, number)
        W = _inverse(V)
        if W is None:
            return False
        one, own = number(1.0), _Matrices.of(self.statement, number)
        moved = all(
            max(abs(W @ np.concatenate([A @ V, E], axis=1)).sum(axis=1)) <= one
            for A, E in zip(own.A, own.E, strict=True)
        )
        return moved and all(max(abs(c @ V).sum(axis=1)) <= one for c in own.limits)


class _Matrices:
    """Bernstein coefficients of A(p) of the loop (k, n, n), E(p) times the amplitudes (k, n, nw),
    and the limits' rows over their bounds (k, limits, n), in an arithmetic.
    """

    def __init__(self, A: Array, E: Array, limits: Array):
        self.A, self.E, self.limits = A, E, limits

    @classmethod
    def of(cls, statement: SetStatement, number: Number) -> _Matrices:
        """Those of all pieces of the model."""
        parts = [[], [], []]
        for closed in closed_pieces(statement, number):
            degrees = [max(d) for d in zip(*(M.degrees for M in closed), strict=True)]
            for out, M in zip(parts, closed, strict=True):
                c = M.elevate(degrees).coefficients
                out += list(c.reshape(math.prod(c.shape[:-2]), *c.shape[-2:]))
        return cls(*(np.array(each) for each in parts))


def _inverse(M: Array) -> Array | None:
    """The inverse of a matrix of rationals, by Gauss and Jordan; None where there is none."""
    n = len(M)
    one = M[0, 0] * 0 + 1
    work = np.concatenate([M, np.array([[one * (i == j) for j in range(n)] for i in range(n)])], 1)
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k, i] != 0), None)
        if pivot is None:
            return None
        work[[i, pivot]] = work[[pivot, i]]
        work[i] = work[i] / work[i, i]
        for k in range(n):
            if k != i:
                work[k] = work[k] - work[k, i] * work[i]
    return work[:, n:]


def low_complexity_set(
    model: LPVStateSpace | LinearModel,
    *,
    controller: Any = None,
    state_bounds: Mapping[str, float] | None = None,
    input_bounds: Mapping[str, float] | None = None,
    disturbance: Mapping[str, float] | None = None,
) -> LowComplexitySet:
    """A large proven parallelepiped |W x| <= 1, W square, that a sampled loop does not leave,
    within limits, however its parameters move.

    Parameters
    ----------
    model : LPVStateSpace or LinearModel
        In discrete time; each input is a disturbance or moved by the controller.
    controller, state_bounds, input_bounds, disturbance
        As for `invariant_set`; a model with controls needs the controller.

    Returns
    -------
    LowComplexitySet
        `verified` says whether there is one, `why` why not: the search is local, by linear programs
        about the set before, and poles with |Re| + |Im| > 1 have none.

    Raises
    ------
    InputError
        Continuous time, no controller, or bounds and inputs that do not fit.

    References
    ----------
    Blanchini and Miani (2008), chapter 4; Bitsoris, Int. J. Control 47 (1988).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> sampled = LinearModel(
    ...     [[1.2]], [[1.0, 0.1]], [[1.0]], [[0.0, 0.0]], ["x"], ["u", "w"], ["x_m"], dt=0.1)
    >>> found = synthesis.sets.low_complexity_set(
    ...     sampled, controller=[[-0.7]], input_bounds={"u": 0.7}, disturbance={"w": 1.0})
    >>> found.verified, round(found.half_widths.item(), 6)
    (True, 1.0)
    """
    statement = stated(model, controller, state_bounds, input_bounds, disturbance)
    if statement.model.dt is None:
        raise InputError("model: expected one in discrete time: model.discretize(dt) makes one")
    if statement.controls and statement.feedback is None:
        raise InputError(f"controller: expected gains for {', '.join(statement.controls)}")
    matrices = _Matrices.of(statement, float)
    none = np.zeros_like(matrices.A[0])
    if not np.any(matrices.limits):
        return LowComplexitySet(statement, none, False, "the limits see no state: limit a state")
    found = [V for start in _starts(matrices) if (V := _grown(matrices, start)) is not None]
    if not found:
        return LowComplexitySet(statement, none, False, "the search finds no set")
    V = max(found, key=lambda V: abs(np.linalg.det(V)))
    made = LowComplexitySet(statement, V, False, "the sums do not hold in exact arithmetic")
    return made.established()


def _starts(own: _Matrices) -> list[Array]:
    """V from which the search starts: coordinates in which the middle matrix is made of real blocks
    of its eigenvalues, those of its Lyapunov function, and the states themselves.
    """
    A = own.A.mean(axis=0)
    values, vectors = np.linalg.eig(A)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
    V = np.array(columns).T
    radius = max(np.abs(values).max(), 1.0) * ROOM
    ball = np.linalg.cholesky(solve_discrete_lyapunov(A / radius, np.eye(len(A))))
    return [V for V in (V, ball, np.eye(len(A))) if np.linalg.cond(V) < 1 / SPARE]


def _sums(own: _Matrices, V: Array) -> tuple[float, float]:
    """The largest sum of the motion, and of the limits, with V."""
    W = np.linalg.inv(V)
    motion = np.abs(np.concatenate([W @ own.A @ V, W @ own.E], axis=2)).sum(axis=2).max()
    return float(motion), float(np.abs(own.limits @ V).sum(axis=2).max())


def _grown(own: _Matrices, V: Array) -> Array | None:
    """The largest set that linear programs about one another lead to: first the sums of the motion
    fall below 1, then the volume grows.
    """
    V, trust, most = V / _sums(own, V)[1], TRUST, 1 - SPARE
    for _ in range(STEPS):
        motion = _sums(own, V)[0]
        Z = _step(own, V, trust, None if motion > most else most)
        ahead = None if Z is None else V @ (np.eye(len(V)) + Z)
        better, closer = False, V
        if ahead is not None and np.linalg.matrix_rank(ahead) == len(V):
            closer = ahead * (most / max(_sums(own, ahead)[1], most))
            after = _sums(own, closer)[0]
            larger = abs(np.linalg.det(closer)) > (1 + SPARE) * abs(np.linalg.det(V))
            better = after < motion if motion > most else after <= most and larger
        V, trust = (closer, trust) if better else (V, trust / 2)
        if trust < LEAST_TRUST:
            break
    return V if _sums(own, V)[0] <= 1 else None


def _step(own: _Matrices, V: Array, trust: float, most: float | None) -> Array | None:
    """Z of the next V (I + Z), |Z_ij| <= trust, to first order: the largest volume with sums of the
    motion below `most`; None: the least sums.

    W A V changes by H Z - Z H, W E by -Z W E, C V by C V Z.
    """
    n, W = len(V), np.linalg.inv(V)
    eye = np.eye(n)
    rows, values, bounds = [], [], []  # |values + rows z| summed stays below the bound
    for A, E in zip(own.A, own.E, strict=True):
        H, F = W @ A @ V, W @ E
        for i in range(n):
            left = np.einsum("a,jb->jab", H[i], eye) - np.einsum("a,bj->jab", eye[i], H)
            right = -np.einsum("a,bj->jab", eye[i], F)
            rows.append(np.concatenate([left, right]).reshape(-1, n * n))
            values.append(np.concatenate([H[i], F[i]]))
            bounds.append(True)
    for C in own.limits:
        for c in C @ V:
            rows.append(np.einsum("a,jb->jab", c, eye).reshape(-1, n * n))
            values.append(c)
            bounds.append(False)
    ends = np.cumsum([0, *map(len, values)])
    total = int(ends[-1])
    count = n * n + total + 1  # z, the absolute values, the largest sum
    M, v = np.concatenate(rows), np.concatenate(values)
    above = np.hstack([M, -np.eye(total), np.zeros((total, 1))])
    below = np.hstack([-M, -np.eye(total), np.zeros((total, 1))])
    sums = np.zeros((len(values), count))
    for k, moves in enumerate(bounds):
        sums[k, n * n + ends[k] : n * n + ends[k + 1]] = 1.0
        sums[k, -1] = -1.0 if moves else 0.0
    right = np.where(bounds, 0.0, 1.0)
    cost = np.zeros(count)
    if most is None:
        cost[-1] = 1.0
    else:
        cost[: n * n] = -eye.ravel()
    limits = [(-trust, trust)] * (n * n) + [(0.0, None)] * total + [(0.0, most)]
    found = linprog(
        cost, np.vstack([above, below, sums]), np.concatenate([-v, v, right]), bounds=limits
    )
    return found.x[: n * n].reshape(n, n) if found.status == 0 else None
