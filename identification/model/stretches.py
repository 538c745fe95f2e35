"""Unbroken stretches of records along which a model runs free, and the sensitivity of its response
to its coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from identification.model.coefficients import Coefficients
from identification.model.prediction import DIVERGED
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Samples, regressor_rows
from symheli.records import FlightRecord
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class Stretch:
    """Consecutive samples y (n, ny), u (n, nu), p (n,) or (n, parameters), f (n, functions); the
    first `memory` are the past of the others.

    Inputs and scheduling are complete; NaN in y is a missing measurement.
    """

    arx: LPVARX
    y: Array
    u: Array
    p: Array
    f: Array

    @property
    def target(self) -> Array:
        """The outputs (n - memory, ny) to be explained."""
        return self.y[self.arx.memory :]

    def with_outputs(self, y: Array) -> Stretch:
        """The same inputs and scheduling with other outputs: `y` (n, ny), or (n - memory, ny)
        behind the same past.
        """
        return replace(
            self, y=y if len(y) == len(self.y) else np.vstack([self.y[: self.arx.memory], y])
        )

    def regressors(self, kinds: Iterable[str] | None = None) -> Array:
        """phi (n - memory, n_regressors), or those of some kinds."""
        return regressor_rows(self.arx, self.y, self.u, self.p, self.f, kinds)

    def lag_coefficients(self, theta: Array) -> Array:
        """A_i at each sample to be explained, side by side: (n - memory, ny, na ny)."""
        by_lag, m, n, ny = (
            Coefficients.of(self.arx, theta).A,
            self.arx.memory,
            len(self.f),
            self.arx.ny,
        )
        out = np.zeros((n - m, ny, len(by_lag) * ny))
        for i, A in enumerate(by_lag, start=1):
            back = i if self.arx.scheduling_at == "lag" else 0
            out[:, :, (i - 1) * ny : i * ny] = np.tensordot(self.f[m - back : n - back], A, axes=1)
        return out

    def free_run(self, theta: Array) -> Array:
        """Response (n - memory, ny) to the inputs from the past in `y`; infinite from where it
        diverges.
        """
        outputs = sum(e.kind == "output" for e in self.arx.entries) * self.arx.basis.size
        known = self.regressors(("input", "offset", "increment")) @ theta[outputs:]
        return filtered(self.lag_coefficients(theta), known[:, :, None], self.past)[:, :, 0]

    @property
    def past(self) -> Array:
        """The outputs before the first one to be explained, newest first, as one column (na ny,
        1).
        """
        m, na = self.arx.memory, len(self.arx.output_lags)
        return self.y[m - na : m][::-1].reshape(-1, 1)

    def spread(self, theta: Array, phi: Array, past: Array | None = None) -> Array:
        """A(p)^-1 applied to each free coefficient's share of the equations: (n - memory, ny,
        number of free coefficients).

        With phi from the free run this is the derivative of the response with respect to the
        coefficients (as `free_of` orders them); columns of `past` (na ny, m) are responses to
        initial conditions, appended.
        """
        free = self.spread_out(phi)
        forcing = (
            free
            if past is None
            else np.concatenate([free, np.zeros((*free.shape[:2], past.shape[1]))], axis=2)
        )
        start = np.zeros((self.past.shape[0], forcing.shape[2]))
        if past is not None:
            start[:, free.shape[2] :] = past
        return filtered(self.lag_coefficients(theta), forcing, start)

    def spread_out(self, phi: Array) -> Array:
        """Each free coefficient's share of the equations, (n - memory, ny, number of free
        coefficients), as `free_of` orders them.
        """
        row, output = free_of(self.arx)
        shares = np.zeros((len(phi), self.arx.ny, len(row)))
        shares[:, output, np.arange(len(row))] = phi[:, row]
        return shares


def stretches(arx: LPVARX, records: Sequence[FlightRecord], *, outputs: bool) -> list[Stretch]:
    """Every unbroken stretch long enough to explain a sample; with `outputs` True no measurement is
    missing in it either.
    """
    found = []
    for record in records:
        s = Samples.of(arx, record)
        known: list[bool] = (
            np.isfinite(np.column_stack([s.u, s.f, *([s.y] if outputs else [])]))
            .all(axis=1)
            .tolist()
        )  # type: ignore[assignment]
        for part in s.segments:
            for whole, group in groupby(
                range(part.start, part.stop), key=lambda k, known=known: known[k]
            ):
                samples = list(group)
                if whole and len(samples) > arx.memory:
                    keep = slice(samples[0], samples[-1] + 1)
                    found.append(Stretch(arx, s.y[keep], s.u[keep], s.p[keep], s.f[keep]))
    return found


def free_of(arx: LPVARX) -> tuple[Array, Array]:
    """(regressor, output) of every coefficient that is not zero by structure, output by output."""
    output, row = np.nonzero(arx.free.T)
    return row, output


def filtered(A: Array, forcing: Array, past: Array) -> Array:
    """X(k) = forcing(k) - A(k) [X(k-1); X(k-2); ...], (n, ny, m) as forcing, with A (n, ny, na ny)
    and past (na ny, m).

    Infinite from where it diverges.
    """
    n, ny, m = forcing.shape
    na = A.shape[2] // ny
    X = np.empty((na + n, ny, m))
    X[:na] = past.reshape(na, ny, m)[::-1]
    oldest_first = A.reshape(n, ny, na, ny)[:, :, ::-1].reshape(n, ny, na * ny)
    with np.errstate(all="ignore"):
        for k in range(n):
            np.subtract(
                forcing[k], oldest_first[k] @ X[k : k + na].reshape(na * ny, m), out=X[na + k]
            )
        diverged = np.flatnonzero(~(np.abs(X[na:]).max(axis=(1, 2), initial=0.0) < DIVERGED))
    if len(diverged):
        X[na + diverged[0] :] = np.inf
    return X[na:]


def contracted(arx: LPVARX, theta: Array, runs: Sequence[Stretch]) -> Array:
    """`theta` itself where its free run stays bounded, else with the poles drawn in (A_i times r^i)
    by the least that bounds it.

    A starting point for the iterative methods, never a result: the noise can make least squares
    unstable.
    """
    size = max(np.nanmax(np.abs(run.y), initial=0.0) for run in runs)
    lags = np.repeat([e.lag if e.kind == "output" else 0 for e in arx.entries], arx.basis.size)[
        :, None
    ]
    for r in (1.0, 0.995, 0.98, 0.95, 0.9, 0.8, 0.6, 0.3):
        candidate = theta * r**lags
        if all(
            np.abs(run.free_run(candidate)).max(initial=0.0) <= 10 * size
            for run in runs
            if np.isfinite(run.past).all()
        ):
            return candidate
    return theta * 0.0**lags
