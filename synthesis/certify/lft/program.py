"""The LMIs of an LFT as cone programs.

Continuous time, with w = Delta z and a multiplier [Q S; S' R]: for all (x, w, u) but zero

    2 x'P (A x + Bw w + Bu u) + [w; z]'[Q S; S' R][w; z] + y'y - gamma^2 u'u < 0,   P > 0,

so that V = x'P x falls by more than y'y - gamma^2 u'u along every trajectory; discrete time:
x(k+1)'P x(k+1) - x'P x. For w alone it states that the parameter loop is well posed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.certify.lft.classes import Class
from synthesis.certify.lft.coordinates import Loop
from synthesis.numerics.polynomial.symmetric import basis, extended, smat, svec
from synthesis.numerics.program.cone_program import ConeProgram

FLOOR = 0.1
"""P and the conditions of the multiplier are held above this fraction of the margin (scaled
coordinates), so that they are strict.
"""


class Linear(NamedTuple):
    """constant + sum_k x_k matrices[k] on (x, w, u) must be negative; `first` of the unknowns are
    those of P.
    """

    constant: Array
    matrices: Array
    first: int

    def congruent(self, weight: Array) -> Linear:
        """W' F W for every F, W = diag(weight, I)."""
        W = extended(weight, len(self.constant) - len(weight))
        return self._replace(constant=W.T @ self.constant @ W, matrices=W.T @ self.matrices @ W)


def inequality(loop: Loop, multipliers: Class, continuous: bool) -> Linear:
    """The left side with gamma = 0: linear in the unknowns of P and of the multiplier."""
    x, w, u = len(loop.A), loop.Bw.shape[1], loop.Bu.shape[1]
    move = np.hstack([loop.A, loop.Bw, loop.Bu])
    z, y = np.hstack([loop.Cz, loop.Dzw, loop.Dzu]), np.hstack([loop.Cy, loop.Dyw, loop.Dyu])
    here, own = np.eye(x + w + u)[:x], np.eye(x + w + u)[x : x + w]
    P = basis(x)
    if continuous:
        half = here.T @ (P @ move)
        lyapunov = half + np.swapaxes(half, -1, -2)
    else:
        lyapunov = move.T @ P @ move - here.T @ P @ here
    side = own.T @ multipliers.S @ z
    static = (
        own.T @ multipliers.Q @ own + side + np.swapaxes(side, -1, -2) + z.T @ multipliers.R @ z
    )
    return Linear(y.T @ y, np.concatenate([lyapunov, static]), len(P))


def with_state_channels(loop: Loop) -> Loop:
    """Add noise on every state as the input and the state as the output: the gain between them
    exists if the loop is stable.
    """
    x, w = len(loop.A), loop.Bw.shape[1]
    return loop._replace(
        Bu=np.eye(x), Dzu=np.zeros((w, x)), Cy=np.eye(x), Dyw=np.zeros((x, w)), Dyu=np.zeros((x, x))
    )


def gain_program(
    linear: Linear, multipliers: Class, states: int, inputs: int, margin: float
) -> ConeProgram:
    """Minimise gamma^2 with the (x, w) block below -margin I. Unknowns: P, multiplier, gamma^2."""
    size = len(linear.constant)
    inner = np.zeros((size, size))
    inner[: size - inputs, : size - inputs] = np.eye(size - inputs)
    gain = np.eye(size) - inner
    rows = [(linear.constant + margin * inner, np.concatenate([linear.matrices, -gain[None]]))]
    rows += [
        (FLOOR * margin * np.eye(len(M[0])), -M)
        for M in _positive(linear, multipliers, states, extra=1)
    ]
    return _assembled(rows, _last(len(linear.matrices) + 1, 1.0))


def margin_program(linear: Linear, multipliers: Class, states: int, inputs: int) -> ConeProgram:
    """Maximise t with the (x, w) block below -t I, without channels, P and the multiplier's
    conditions between 0 and I.

    Nothing can hold strictly where the largest t is zero. Unknowns: P, multiplier, t.
    """
    size = len(linear.constant) - inputs
    inner = linear.matrices[:, :size, :size]
    rows = [(np.zeros((size, size)), np.concatenate([inner, np.eye(size)[None]]))]
    for M in _positive(linear, multipliers, states, extra=1):
        rows += [(np.zeros(M.shape[1:]), -M), (-np.eye(len(M[0])), M)]
    return _assembled(rows, _last(len(linear.matrices) + 1, -1.0))


def unpack(x: Array, multipliers: Class, states: int) -> tuple[Array, Array, Array, Array]:
    """Return P, Q, S, R (scaled coordinates) at the unknowns."""
    first = states * (states + 1) // 2
    P = smat(x[:first], states)
    Q, S, R = (
        np.tensordot(x[first:-1], M, axes=1) for M in (multipliers.Q, multipliers.S, multipliers.R)
    )
    return P, Q, S, R


def _positive(linear: Linear, multipliers: Class, states: int, extra: int) -> list[Array]:
    """Return the matrices that must be positive, per unknown: P and the multiplier's conditions."""
    count = len(linear.matrices) + extra
    P = np.zeros((count, states, states))
    P[: linear.first] = basis(states)
    out: list[Array] = [P]
    for condition in multipliers.conditions:
        M: Array = np.zeros((count, *condition.matrices.shape[1:]))
        M[linear.first : linear.first + len(condition.matrices)] = condition.matrices
        out.append(M)
    return out


def _last(count: int, value: float) -> Array:
    c = np.zeros(count)
    c[-1] = value
    return c


def _assembled(rows: list[tuple[Array, Array]], c: Array) -> ConeProgram:
    """constant + sum_k x_k matrices[k] <= 0 for each pair."""
    A = np.concatenate([svec(matrices).T for _, matrices in rows])
    b = -np.concatenate([svec(constant) for constant, _ in rows])
    return ConeProgram(c, sparse.csc_matrix(A), b, tuple(len(constant) for constant, _ in rows))
