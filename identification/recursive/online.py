"""The recursive estimator for real time: one memory, changed in place."""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.recursive.kernel import configuration as at
from identification.recursive.kernel import twin
from identification.recursive.kernel.configuration import KernelConfiguration
from identification.recursive.kernel.twin import DETERMINED, LEARNT, REFUSED, SATURATED
from identification.recursive.rls_state import RLSState
from identification.structure.regressors import vector
from symheli.errors import InputError
from symheli.values.arrays import Array


class Online:
    """A recursive estimator for real time: `update` changes it in place without copying; `state` is
    a value to keep, save or continue from.

    Made by `RecursiveLeastSquares.online`. The first update with float64 arrays of the right shape
    costs microseconds where the kernel is compiled; anything else that is a number works, more
    slowly.

    Examples
    --------
    >>> online = idn.RecursiveLeastSquares(arx).online()
    >>> for k in range(100):
    ...     learnt = online.update(record["y"][k], record["u"][k], record["p"][k])
    >>> learnt, online.determined, online.coefficients.shape
    (True, True, (4, 1))
    """

    def __init__(self, configuration: KernelConfiguration, kernel: Any, state: RLSState):
        self._configuration, self._kernel, self._start = configuration, kernel, state
        self._state, self._work = (
            aligned(size, configuration.dtype) for size in configuration.sizes
        )
        self._state[:] = state.memory
        self._status = (DETERMINED if state.determined else 0) | (
            SATURATED if state.saturated else 0
        )
        self._views = (
            None if len(configuration.groups) > 1 else _coefficients(configuration, self._state)
        )

    def update(self, y: object, u: object, p: object) -> bool:
        """Take in y (ny,), u (nu,), p of one instant; True where a complete regressor was there and
        the coefficients moved.

        A NaN anywhere is a missing sample: nothing is learnt and the lags start afresh. Raises
        `InputError` for wrong shapes, infinite values and p outside the basis; the coefficients are
        then as before and the lags start afresh.
        """
        try:
            self._status = status = self._kernel.update(self._state, self._work, y, u, p)
        except (TypeError, ValueError, BufferError):
            self._status = status = self._convert_and_update(y, u, p)
        if status & REFUSED:
            complain(self._configuration, y, u, p)
        return status & LEARNT != 0

    def absorb(self, phi: Array, y: Array) -> bool:
        """Take in one regressor phi (n,) with the outputs y (ny,) it must explain; the lags are
        left alone.

        Raises `InputError` for wrong shapes. To save time, phi is not checked for NaN; a NaN makes
        the state unusable. `RecursiveLeastSquares.absorb` checks.
        """
        try:
            self._status = self._kernel.absorb(self._state, self._work, phi, y)
        except (TypeError, ValueError, BufferError):
            arx = self._configuration.structure
            self._status = self._kernel.absorb(
                self._state,
                self._work,
                vector(phi, arx.n_regressors, "phi"),
                vector(y, arx.ny, "y"),
            )
        return True

    def run(self, samples: Array, history: bool = True) -> tuple[Array, Array | None, Array | None]:
        """Take in rows [y, u, p] (k, ny + nu + parameters), p within the basis.

        Returns which of them taught something (k,), and with `history` the innovations (k, ny), NaN
        elsewhere, and the coefficients after each (k, n, ny).
        """
        samples = np.ascontiguousarray(samples, float)
        arx, k = self._configuration.structure, len(samples)
        width = arx.ny + arx.nu + len(arx.parameters)
        if samples.shape != (k, width):
            raise InputError(f"samples: expected shape (any, {width}), got {samples.shape}")
        if not self._configuration.factors:
            samples = np.hstack(
                [samples, functions(self._configuration, samples[:, arx.ny + arx.nu :])]
            )
        statuses, dtype = np.zeros(k, np.int32), self._configuration.dtype
        innovations = np.full((k, arx.ny), np.nan, dtype) if history else None
        coefficients = np.empty((k, arx.n_regressors, arx.ny), dtype) if history else None
        self._kernel.run(self._state, self._work, samples, statuses, innovations, coefficients)
        if (refused := np.flatnonzero(statuses & REFUSED)).size:
            row = samples[refused[0]]
            complain(self._configuration, *np.split(row[:width], [arx.ny, arx.ny + arx.nu]))
        self._status = int(statuses[-1]) if k else self._status
        return (statuses & LEARNT).astype(bool), innovations, coefficients

    def forget_past(self) -> None:
        """The next update finds no past: after a gap in the data."""
        self._state[at.FILLED] = 0

    @property
    def _filled(self) -> bool:
        """Whether the last sample is remembered."""
        return self._state[at.FILLED] > 0

    @property
    def coefficients(self) -> Array:
        """(n, ny) as they are now: a view of what `update` changes where all outputs share their
        regressors, else a copy.
        """
        return twin.theta(self._configuration, self._state) if self._views is None else self._views

    @property
    def innovation(self) -> Array:
        """(ny,) y minus its prediction, at the last sample that was learnt."""
        start = at.padded(self._configuration.structure.n_regressors)
        return self._work[start : start + self._configuration.structure.ny]

    @property
    def gain(self) -> Array:
        """How the coefficients of an output moved per unit of its innovation: (n,), or (n, ny)
        where outputs have different regressors.
        """
        c = self._configuration
        if len(c.groups) == 1:
            return self._work[c.groups[0].in_work["gain"]][: c.groups[0].n]
        out = np.zeros((c.structure.n_regressors, c.structure.ny), c.dtype)
        for layout in c.groups:
            out[c.structure.regressors(layout.group)[:, None], layout.group.outputs] = self._work[
                layout.in_work["gain"]
            ][: layout.n, None]
        return out

    @property
    def determined(self) -> bool:
        """Whether the data fix every coefficient."""
        return self._status & DETERMINED != 0

    @property
    def saturated(self) -> bool:
        """Whether an ordinary sample is lost to rounding; see `RLSState.saturated`."""
        return self._status & SATURATED != 0

    @property
    def state(self) -> RLSState:
        """The state now, as a value."""
        memory, knew = self._state.copy(), self._start.memory
        learnt = memory[at.COUNT] != knew[at.COUNT] or memory[at.MILLIONS] != knew[at.MILLIONS]
        return RLSState(self._configuration, memory) if learnt else self._start.after_idling(memory)

    def _convert_and_update(self, y: object, u: object, p: object) -> int:
        """For anything but float64 arrays, and for functions of p that only Python knows."""
        c, arx = self._configuration, self._configuration.structure
        parts = vector(y, arx.ny, "y"), vector(u, arx.nu, "u"), vector(p, len(arx.parameters), "p")
        more = () if c.factors else functions(c, parts[-1][None, :])
        return self._kernel.update(self._state, self._work, *parts, *more)


def aligned(size: int, dtype: type[np.floating]) -> Array:
    """Return zeros that start at a cache line, where the longest vector registers load fastest."""
    raw = np.zeros(size * np.dtype(dtype).itemsize + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size * np.dtype(dtype).itemsize].view(dtype)


def _coefficients(configuration: KernelConfiguration, memory: Array) -> Array:
    layout = configuration.groups[0]
    return memory[layout.in_state["theta"]].reshape(layout.m, -1)[:, : layout.n].T


def functions(configuration: KernelConfiguration, p: Array) -> Array:
    """The basis (k, size) at p (k, parameters), NaN where p is not finite: for functions the kernel
    cannot evaluate.
    """
    basis = configuration.structure.basis
    out, known = np.full((len(p), basis.size), np.nan), np.isfinite(p).all(axis=1)
    out[known] = basis(p[known, 0] if basis.dimension == 1 else p[known])
    return out


def complain(configuration: KernelConfiguration, y: object, u: object, p: object) -> None:
    """Raises the `InputError` for a sample the kernel refused."""
    arx = configuration.structure
    largest = twin.Limits.of(
        float if configuration.dtype is np.float64 else configuration.dtype
    ).largest
    for name, array in (
        ("y", vector(y, arx.ny, "y")),
        ("u", vector(u, arx.nu, "u")),
        ("p", vector(p, len(arx.parameters), "p")),
    ):
        if np.isinf(array).any():
            raise InputError(f"{name} is infinite; mark a missing sample as NaN")
        if (np.abs(array) > largest).any():
            raise InputError(
                f"{name} is {array[np.argmax(np.abs(array))]:.3g}, beyond {largest:.0e}, where"
                " squares overflow; check its unit"
            )
    arx.basis(vector(p, len(arx.parameters), "p"))
