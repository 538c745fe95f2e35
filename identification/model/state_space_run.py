"""Free run of an LPV state-space model and its sensitivities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.model.prediction import DIVERGED
from identification.structure.regressors import basis_values
from identification.structure.state_space import StateSpace
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class StateSpaceRun:
    """Unknowns of a `StateSpace`, side by side: A (n, nx, nx) and B (n, nx, nu) by function, C
    (ny, nx), D (ny, nu) where there is feedthrough; then the state a run starts from.
    """

    structure: StateSpace

    @cached_property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of A, B, C and D."""
        n, nx = self.structure.basis.size, self.structure.order
        ny, nu = len(self.structure.outputs), len(self.structure.inputs)
        through = nu if self.structure.feedthrough else 0
        return (n, nx, nx), (n, nx, nu), (ny, nx), (ny, through)

    @cached_property
    def size(self) -> int:
        """Number of entries of the matrices."""
        return sum(int(np.prod(shape)) for shape in self.shapes)

    def matrices(self, unknowns: Array) -> tuple[Array, Array, Array, Array]:
        """A, B, C and D."""
        ends = np.cumsum([int(np.prod(shape)) for shape in self.shapes])
        parts = np.split(unknowns[: self.size], ends[:-1])
        A, B, C, D = (part.reshape(shape) for part, shape in zip(parts, self.shapes, strict=True))
        return A, B, C, D if D.size else np.zeros((len(C), B.shape[2]))

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Positions of the entries of A, B, C and D among the unknowns."""
        ends = np.cumsum([0, *(int(np.prod(shape)) for shape in self.shapes)])
        return tuple(
            np.arange(a, b).reshape(shape)
            for a, b, shape in zip(ends[:-1], ends[1:], self.shapes, strict=True)
        )

    def outputs(self, unknowns: Array, start: Array, u: Array, p: Array) -> Array:
        """Response (m, ny) from the state `start` to inputs u (m, nu), p (m,) or (m, parameters) as
        measured; infinite from where it diverges.
        """
        return self._run(unknowns, start, u, p, slopes=False)[0]

    def sensitivities(self, unknowns: Array, start: Array, u: Array, p: Array) -> Array:
        """(m, ny, size + nx) derivatives of the response by the matrices and the state it starts
        from.
        """
        return self._run(unknowns, start, u, p, slopes=True)[1]

    def _run(
        self, unknowns: Array, start: Array, u: Array, p: Array, *, slopes: bool
    ) -> tuple[Array, Array]:
        A, B, C, D = self.matrices(unknowns)
        at_A, at_B, at_C, at_D = self._columns
        rows, (m, ny), nx = np.arange(len(start))[:, None], (len(u), len(C)), len(start)
        wide = self.size + nx if slopes else 0
        y, dy = np.full((m, ny), np.inf), np.zeros((m, ny, wide))
        x, S = start, np.zeros((nx, wide))
        S[:, self.size :] = np.eye(nx)[:, : max(wide - self.size, 0)]
        own, basis = self.structure.own_scheduling, self.structure.basis
        functions = None if own else basis_values(self.structure.regression, p)
        place = self.structure.outputs.index(self.structure.scheduling) if own else 0  # type: ignore[arg-type]
        for k in range(m):
            y[k] = C @ x + D @ u[k]
            if not np.all(np.abs(y[k]) < DIVERGED):
                y[k:] = np.inf
                break
            if slopes:
                dy[k] = C @ S
                for i in range(ny):
                    dy[k, i, at_C[i]] += x
                    if at_D.size:
                        dy[k, i, at_D[i]] += u[k]
            held = float(np.clip(y[k, place], *basis.ranges[0])) if own else 0.0
            f = functions[k] if functions is not None else basis(held)
            now, drive = np.tensordot(f, A, 1), np.tensordot(f, B, 1)
            if slopes:
                S = now @ S
                for j, weight in enumerate(f):
                    S[rows, at_A[j]] += weight * x
                    S[rows, at_B[j]] += weight * u[k]
                if own and held == y[k, place]:
                    slope = basis(held, 1)
                    bent = np.tensordot(slope, A, 1) @ x + np.tensordot(slope, B, 1) @ u[k]
                    S += np.outer(bent, dy[k, place])
            x = now @ x + drive @ u[k]
        return y, dy
