"""The constant matrix of a linear fractional transformation and its blocks of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized


class Block(NamedTuple):
    """`size` copies of one parameter, normalised to delta = (p - middle)/radius in [-1, 1]."""

    scheduling: Scheduling
    size: int


def parts(sizes: Sequence[int]) -> list[slice]:
    """The rows of each of blocks of these sizes, one after the other."""
    return [slice(int(a), int(b)) for a, b in pairwise(np.cumsum([0, *sizes]))]


@dataclass(frozen=True, eq=False)
class LFTMatrices:
    """M22 + M21 Delta (I - M11 Delta)^-1 M12 with its names: what a proof is about.

    Parameters and errors are those of `LFT`, which adds what is done with one.
    """

    M11: Array
    M12: Array
    M21: Array
    M22: Array
    blocks: tuple[Block, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        object.__setattr__(self, "blocks", tuple(Block(*block) for block in self.blocks))
        names = [block.scheduling.name for block in self.blocks]
        if len(set(names)) != len(names):
            raise InputError(
                f"one block a parameter, got {', '.join(names)}; order the rows so that a parameter"
                " has one block"
            )
        n = self.order
        rows, columns = len(self.states) + len(self.outputs), len(self.states) + len(self.inputs)
        for name, shape in (
            ("M11", (n, n)),
            ("M12", (n, columns)),
            ("M21", (rows, n)),
            ("M22", (rows, columns)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        if self.dt is not None and not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds or None, got {self.dt}")

    @property
    def order(self) -> int:
        """Total size of the parameter blocks."""
        return sum(self.sizes)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of copies of each parameter."""
        return tuple(block.size for block in self.blocks)

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters, in the order of the blocks."""
        return tuple(block.scheduling for block in self.blocks)

    @property
    def scheduling(self) -> Scheduling:
        """The parameter, where there is one; raises `InputError` otherwise."""
        if len(self.blocks) != 1:
            raise InputError(
                f"this LFT has {len(self.blocks)} parameters: {self._names()}; use .parameters"
            )
        return self.blocks[0].scheduling

    def normalised(self, *p: float, **named: float) -> Array:
        """Normalised parameters (m,) in [-1, 1] of physical values, given in order or by name."""
        names = [s.name for s in self.parameters]
        for name in named:
            if name not in names:
                raise UnknownNameError("scheduling parameter", name, names)
        if len(p) + len(named) != len(names) or any(name in named for name in names[: len(p)]):
            raise InputError(
                f"expected {len(names)} parameter value(s) ({self._names()}), got"
                f" {len(p) + len(named)}"
            )
        values = [*p, *(named[name] for name in names[len(p) :])]
        pairs = zip(self.parameters, values, strict=True)
        return np.array([s.normalised(s.check(value)) for s, value in pairs])

    def matrix(self, delta: object) -> Array:
        """[A B; C D] at normalised parameters `delta` (..., m), shape (..., nx + ny, nx + nu)."""
        delta = np.atleast_1d(frozen(delta, "delta"))
        if delta.shape[-1] != len(self.blocks):
            raise InputError(
                f"expected {len(self.blocks)} normalised parameter(s), got shape {delta.shape}"
            )
        D = np.repeat(delta, self.sizes, axis=-1)
        try:
            inner = np.linalg.solve(
                np.eye(self.order) - self.M11 * D[..., None, :],
                np.broadcast_to(self.M12, (*D.shape, self.M12.shape[1])),
            )
        except np.linalg.LinAlgError as error:
            raise InputError(
                "the parameter loop is not well posed there: I - M11 Delta is singular; see"
                " .well_posed()"
            ) from error
        return self.M22 + self.M21 @ (D[..., :, None] * inner)

    def matrices(self, p: object) -> Matrices:
        """A, B, C, D at physical p: (...,) with one parameter, (..., m) with several; the axes of p
        come first.
        """
        p = frozen(p, "scheduling parameters")
        if len(self.blocks) == 1:
            p = p[..., None]
        if not p.ndim or p.shape[-1] != len(self.blocks):
            raise InputError(
                f"expected the {len(self.blocks)} parameters ({self._names()}) along the last axis,"
                f" got shape {p.shape}"
            )
        delta = [s.normalised(s.check(p[..., i])) for i, s in enumerate(self.parameters)]
        M, nx = self.matrix(np.stack(delta, axis=-1) if delta else p), len(self.states)
        return Matrices(M[..., :nx, :nx], M[..., :nx, nx:], M[..., nx:, :nx], M[..., nx:, nx:])

    def _names(self) -> str:
        return ", ".join(s.name for s in self.parameters) or "none"
