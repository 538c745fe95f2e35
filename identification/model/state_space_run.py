"""Free run of an LPV state-space model, or its innovation filter, and their sensitivities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.model.prediction import DIVERGED
from identification.model.time_varying import states_of
from identification.structure.regressors import basis_values
from identification.structure.state_space import StateSpace
from symheli.values.arrays import Array

ENTRIES = 2**23
"""Largest number of sensitivities of a state that are held at a time: 64 MB."""


@dataclass(frozen=True, eq=False)
class Along:
    """States along m samples, and what they obey: x(k+1) = now(k) x(k) + ..., with the functions f
    (m, n), inputs u (m, nu), outputs y (m, ny), what is fed back e (m, ny) by `gain` (m, nx, ny).
    """

    f: Array
    u: Array
    x: Array
    y: Array
    e: Array
    now: Array
    gain: Array | None
    bent: Array | None
    """(m, nx) slope of x(k+1) by the model's own p."""


@dataclass(frozen=True, eq=False)
class StateSpaceRun:
    """Unknowns of a `StateSpace`, side by side: A (n, nx, nx) and B (n, nx, nu) by function, C
    (ny, nx), D (ny, nu) where there is feedthrough, K (n, nx, ny) with `innovations`; then the
    state a run starts from. With an offset B has one more column, for the input 1.
    """

    structure: StateSpace
    innovations: bool = False

    @cached_property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of A, B, C, D and K."""
        n, nx = self.structure.basis.size, self.structure.order
        ny, nu = len(self.structure.outputs), len(self.structure.inputs)
        through = nu if self.structure.feedthrough else 0
        driven, fed = nu + self.structure.offset, ny if self.innovations else 0
        return (n, nx, nx), (n, nx, driven), (ny, nx), (ny, through), (n, nx, fed)

    @cached_property
    def size(self) -> int:
        """Number of entries of the matrices."""
        return sum(int(np.prod(shape)) for shape in self.shapes)

    @property
    def undetermined(self) -> int:
        """Number of directions that no data determine: the choice of the states."""
        nx, ny = self.structure.order, len(self.structure.outputs)
        return nx * nx + max(nx - ny, 0) * self.structure.offset

    def matrices(self, unknowns: Array) -> tuple[Array, Array, Array, Array, Array]:
        """A, B, C, D and K."""
        A, B, C, D, K = (unknowns[columns] for columns in self._columns)
        return A, B, C, D if D.size else np.zeros((len(C), len(self.structure.inputs))), K

    def unknowns(self, A: Array, B: Array, C: Array, D: Array, K: Array) -> Array:
        """The unknowns of matrices; D and K only where they are sought."""
        given = (A, B, C, D, K)
        wide = zip(given, self.shapes, strict=True)
        return np.concatenate([part[..., : shape[-1]].reshape(-1) for part, shape in wide])

    def units(self, y: Array, u: Array) -> Array:
        """Units (size,) of the entries where outputs are measured in y (ny,), inputs in u (nu,)."""
        A, B, C, _, _ = self.shapes
        driven = np.append(u, np.ones(int(self.structure.offset)))
        return self.unknowns(
            np.ones(A),
            np.broadcast_to(1.0 / driven, B),
            np.broadcast_to(y[:, None], C),
            y[:, None] / u,
            np.broadcast_to(1.0 / y, (*A[:2], len(y))),
        )

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Positions of the entries of A, B, C, D and K among the unknowns."""
        ends = np.cumsum([0, *(int(np.prod(shape)) for shape in self.shapes)])
        return tuple(
            np.arange(a, b).reshape(shape)
            for a, b, shape in zip(ends[:-1], ends[1:], self.shapes, strict=True)
        )

    @property
    def gains(self) -> Array:
        """Positions of K among the unknowns."""
        return self._columns[4].reshape(-1)

    def outputs(
        self, unknowns: Array, start: Array, u: Array, p: Array, y: Array | None = None
    ) -> Array:
        """Response (m, ny) from the state `start` to inputs u (m, nu), p (m,) or (m, parameters) as
        measured; infinite from where it diverges.

        With measurements y (m, ny): one step ahead, by the innovation filter. What is missing in y
        is not fed back.
        """
        return self.along(unknowns, start, u, p, y).y

    def ahead(
        self, unknowns: Array, start: Array, u: Array, p: Array, y: Array, horizon: int
    ) -> Array:
        """Predictions (m, ny) of y(t) from outputs up to t - horizon, inputs and p up to t; the
        first ones are from the start.
        """
        found = self.along(unknowns, start, u, p, y)
        A, B, C, D, _ = self.matrices(unknowns)
        now, drive = np.tensordot(found.f, A, 1), self._driven(B, found.f, found.u)
        x, steps = found.x, min(horizon, len(u)) - 1
        for _ in range(steps):  # all starts advance together
            x = np.concatenate([found.x[:1], _times(now, x)[:-1] + drive[:-1]])
        return _flagged(x @ C.T + u @ D.T)

    def sensitivities(
        self, unknowns: Array, start: Array, u: Array, p: Array, y: Array | None = None
    ) -> Array:
        """(m, ny, size + nx) derivatives of the response by the matrices and the state it starts
        from.
        """
        found = self.along(unknowns, start, u, p, y)
        return np.concatenate([slopes for _, slopes in self.slopes(unknowns, found)])

    def along(
        self, unknowns: Array, start: Array, u: Array, p: Array, y: Array | None = None
    ) -> Along:
        """The states of a run, or with measurements y of the innovation filter."""
        A, B, C, D, K = self.matrices(unknowns)
        through = u @ D.T
        if self.structure.own_scheduling:
            return self._own(A, B, C, start, u, through)
        f = basis_values(self.structure.regression, p)
        now, drive = np.tensordot(f, A, 1), self._driven(B, f, u)
        gain = None
        if y is not None and K.size:
            seen = np.isfinite(y)
            gain = np.tensordot(f, K, 1) * seen[:, None, :]
            now = now - gain @ C
            drive = drive + _times(gain, np.where(seen, y, 0.0) - through)
        x = states_of(now, drive[:, :, None], start[:, None])[:-1, :, 0]
        with np.errstate(all="ignore"):
            guess = _flagged(x @ C.T + through)
        e = np.zeros_like(guess) if y is None else np.where(np.isfinite(y), y - guess, 0.0)
        return Along(f, u, x, guess, e, now, gain, None)

    def _driven(self, B: Array, f: Array, u: Array) -> Array:
        """(m, nx) what the inputs add to the next state."""
        return _times(np.tensordot(f, B, 1), self._inputs(u))

    def _inputs(self, u: Array) -> Array:
        return np.column_stack([u, np.ones(len(u))]) if self.structure.offset else u

    def _own(self, A: Array, B: Array, C: Array, start: Array, u: Array, through: Array) -> Along:
        """The same, p being an output of the run, held at the ends of its range."""
        basis, m, driven = self.structure.basis, len(u), self._inputs(u)
        place = self.structure.outputs.index(self.structure.scheduling)  # type: ignore[arg-type]
        low, high = basis.ranges[0]
        x, xs, y = start, np.zeros((m, len(start))), np.full((m, len(C)), np.inf)
        f, last = np.zeros((m, basis.size)), m
        for k in range(m):
            xs[k], y[k] = x, C @ x + through[k]
            if not np.all(np.abs(y[k]) < DIVERGED):
                y[k:], last = np.inf, k
                break
            f[k] = basis(min(max(y[k, place], low), high))
            x = f[k] @ (A @ x + B @ driven[k])
        held = np.clip(y[:, place], low, high)
        slope = np.zeros_like(f)
        slope[:last] = basis(held[:last], 1) * (held == y[:, place])[:last, None]
        now = np.tensordot(f, A, 1)
        bent = _times(np.tensordot(slope, A, 1), xs) + self._driven(B, slope, u)
        now = now + bent[:, :, None] * C[place]
        return Along(f, u, xs, y, np.zeros_like(y), now, None, bent)

    def slopes(self, unknowns: Array, found: Along) -> Iterator[tuple[slice, Array]]:
        """Yield derivatives (rows, ny, size + nx) of the response along a run by the matrices and
        the start, rows after rows.
        """
        _, _, C, _, _ = self.matrices(unknowns)
        nx, wide, m = self.structure.order, self.size + self.structure.order, len(found.x)
        S = np.zeros((nx, wide))
        S[:, self.size :] = np.eye(nx)
        rows = max(ENTRIES // (nx * wide), 1)
        for first in range(0, m, rows):
            part = slice(first, min(first + rows, m))
            explicit = self._explicit(found, part)
            S_all = states_of(found.now[part], self._forcing(found, part, explicit), S)
            S = S_all[-1]
            with np.errstate(all="ignore"):
                yield part, C @ S_all[:-1] + explicit

    def by_start(self, unknowns: Array, found: Along) -> Array:
        """(m, ny, nx) derivatives of the response along a run by the state it starts from."""
        nx = self.structure.order
        still = np.zeros((len(found.x), nx, nx))
        with np.errstate(all="ignore"):
            return self.matrices(unknowns)[2] @ states_of(found.now, still, np.eye(nx))[:-1]

    def _explicit(self, found: Along, part: slice) -> Array:
        """(rows, ny, size + nx) how outputs answer C and D with the states held."""
        _, _, at_C, at_D, _ = self._columns
        x, u = found.x[part], found.u[part]
        out = np.zeros((len(x), len(at_C), self.size + self.structure.order))
        for i in range(len(at_C)):
            out[:, i, at_C[i]] = x
            if at_D.size:
                out[:, i, at_D[i]] = u
        return out

    def _forcing(self, found: Along, part: slice, explicit: Array) -> Array:
        """(rows, nx, size + nx) how the next state answers the matrices with the state held."""
        at_A, at_B, _, _, at_K = self._columns
        f, nx = found.f[part, :, None], self.structure.order
        signals = [(at_A, found.x), (at_B, self._inputs(found.u)), (at_K, found.e)]
        out = np.zeros((len(f), nx, explicit.shape[2]))
        for at, signal in signals:
            if at.size:
                weighted = (f * signal[part, None, :]).reshape(len(f), -1)
                for r in range(nx):
                    out[:, r, at[:, r].reshape(-1)] = weighted
        first = self._columns[2].min(initial=0)
        some = slice(int(first), self.size - at_K.size)  # C and D
        if found.gain is not None:
            out[:, :, some] -= found.gain[part] @ explicit[:, :, some]
        if found.bent is not None:
            place = self.structure.outputs.index(self.structure.scheduling)  # type: ignore[arg-type]
            out[:, :, some] += found.bent[part, :, None] * explicit[:, None, place, some]
        return out


def _times(matrices: Array, vectors: Array) -> Array:
    """(m, a) of matrices (m, a, b) and vectors (m, b)."""
    return np.matmul(matrices, vectors[:, :, None])[:, :, 0]


def _flagged(y: Array) -> Array:
    """Infinite from the first sample on that is no number below `DIVERGED`."""
    lost = np.flatnonzero(~np.all(np.abs(y) < DIVERGED, axis=1))
    if len(lost):
        y = y.copy()
        y[lost[0] :] = np.inf
    return y
