"""Members of a set of models: the plant of a design with its uncertain parts at fixed values."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Generalized
from synthesis.robust.design_plant import DesignPlant, size_of
from synthesis.robust.exact_loop import Part
from synthesis.robust.worst_case_gain import Member

MOST_CORNERS = 16
"""Corners of the real parameters that are all taken."""
REAL = 1e-9
"""Angle below which a number counts as real."""

Dynamics = tuple[Array, Array, Array, Array]


def first_members(plant: DesignPlant) -> list[Generalized]:
    """Return the plant at the middle of its parameters and at their corners, without dynamics."""
    m = plant.loop.reals
    corners = list(product((-1.0, 1.0), repeat=m)) if m and 2**m <= MOST_CORNERS else []
    return [at_values(plant, np.array(d), []) for d in ((0.0,) * m, *corners)]


def of_member(plant: DesignPlant, member: Member) -> Generalized:
    """Return the plant of a member that was found."""
    full = [part for part in plant.parts[:-1] if not part.real]
    delta = [] if member.blocks is None else _blocks(full, member.blocks)
    return at_values(plant, member.reals, [through(one, member.omega) for one in delta])


def _blocks(full: list[Part], delta: Array) -> list[Array]:
    first_row, first_column = full[0].rows.start, full[0].columns.start
    return [
        delta[
            part.columns.start - first_column : part.columns.stop - first_column,
            part.rows.start - first_row : part.rows.stop - first_row,
        ]
        for part in full
    ]


def at_values(plant: DesignPlant, reals: Array, dynamics: list[Dynamics]) -> Generalized:
    """Return the plant from (disturbances, controls) to (performance, measurements) with the real
    parts at these normalised values and these dynamics in the others, none where there are none.
    """
    A, B, C, D = plant.loop[:4]
    parts = plant.parts[:-1]
    rows, columns = (sum(size_of(getattr(p, side)) for p in parts) for side in ("rows", "columns"))
    if not rows or not columns:
        return Generalized.split(A, B, C, D, len(plant.controls), len(plant.measurements))
    delta = _closing(parts, reals, dynamics)
    into = np.r_[columns : B.shape[1], :columns]
    out = np.r_[rows : len(C), :rows]
    turned = Generalized.split(A, B[:, into], C[out], D[np.ix_(out, into)], columns, rows)
    found = turned.closed(*delta)
    return Generalized.split(*found, len(plant.controls), len(plant.measurements))


def _closing(parts: tuple[Part, ...], reals: Array, dynamics: list[Dynamics]) -> Dynamics:
    """Return all blocks side by side."""
    values, each = iter(reals), iter(dynamics)
    found = []
    for part in parts:
        out, into = size_of(part.columns), size_of(part.rows)
        d = next(values) * np.eye(out) if part.real else np.zeros((out, into))
        none = np.zeros((0, 0)), np.zeros((0, into)), np.zeros((out, 0)), d
        found.append(none if part.real else next(each, none))
    A, B, C, D = (_diagonal([one[i] for one in found]) for i in range(4))
    return A, B, C, D


def _diagonal(given: list[Array]) -> Array:
    """Return a block diagonal matrix, of blocks without rows or columns too."""
    out = np.zeros((sum(len(M) for M in given), sum(M.shape[1] for M in given)))
    i = j = 0
    for M in given:
        out[i : i + len(M), j : j + M.shape[1]] = M
        i, j = i + len(M), j + M.shape[1]
    return out


def through(delta: Array, omega: float) -> Dynamics:
    """Return stable dynamics of gain 1 at every frequency that have the direction of `delta`, of
    rank one, at `omega`: all-pass lags before and behind a matrix.

    Source: Zhou, Doyle and Glover, Robust and Optimal Control (1996), theorem 9.1.
    """
    left, size, right = np.linalg.svd(delta)
    if not size[0]:
        return (
            np.zeros((0, 0)), np.zeros((0, delta.shape[1])), np.zeros((len(delta), 0)),
            np.zeros(delta.shape),
        )  # fmt: skip
    a, b = left[:, 0], right[0]
    turn = np.conj(b[np.argmax(np.abs(b))])
    turn /= abs(turn)
    before, behind = _phases(b * turn, omega), _phases(a / turn, omega)
    # u = (all-pass columns) sum of (all-pass rows) of y
    A1, B1, C1, D1 = before
    A2, B2, C2, D2 = behind
    b1, c1, d1 = B1, C1.sum(axis=0, keepdims=True), D1.sum(axis=0, keepdims=True)
    one = np.ones((len(a), 1))
    A = np.block([[A1, np.zeros((len(A1), len(A2)))], [B2 @ one @ c1, A2]])
    return (
        A,
        np.vstack([b1, B2 @ one @ d1]),
        np.hstack([D2 @ one @ c1, C2]),
        D2 @ one @ d1,
    )


def _phases(v: Array, omega: float) -> Dynamics:
    """Return diag(|v_i| a_i(s)), a_i all-pass of the phase of v_i at `omega`."""
    n, size, angle = len(v), np.abs(v), np.angle(v)
    sign = np.where(angle < -REAL, -1.0, 1.0)
    phase = np.where(angle < -REAL, angle + math.pi, angle)  # in [0, pi]
    sign = np.where(np.abs(phase - math.pi) < REAL, -sign, sign)
    turned = (phase > REAL) & (np.abs(phase - math.pi) >= REAL) & (size > 0)
    turned &= (0 < omega) & (omega < math.inf)
    own = np.flatnonzero(turned)
    # (s - b)/(s + b) has the phase pi - 2 atan(omega/b) at omega
    pole = omega / np.tan(0.5 * (math.pi - phase[own])) if len(own) else np.zeros(0)
    into, out = np.zeros((len(own), n)), np.zeros((n, len(own)))
    into[np.arange(len(own)), own] = 1.0
    out[own, np.arange(len(own))] = -2 * pole * (sign * size)[own]
    return -np.diag(pole), into, out, np.diag(sign * size)
