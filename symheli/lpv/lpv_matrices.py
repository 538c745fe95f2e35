"""The matrices of an LPV model as functions of the scheduling parameters, with their names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.scheduling import RANGE_SLACK, Scheduling, check_all, parameters
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized


class Matrices(NamedTuple):
    """A (..., nx, nx), B (..., nx, nu), C (..., ny, nx), D (..., ny, nu)."""

    A: Array
    B: Array
    C: Array
    D: Array

    __repr__ = summarized


@dataclass(frozen=True, eq=False)
class LPVMatrices:
    """A(p) = sum_j f_j(p) A_j, and B(p), C(p), D(p) likewise: what a proof is about.

    Parameters and errors are those of `LPVStateSpace`, which adds what is done with a model.
    """

    basis: FunctionSpace
    A: Array
    B: Array
    C: Array
    D: Array
    parameters: tuple[Scheduling, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", parameters(self.parameters))
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        n, nx, nu, ny = self.basis.size, len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (
            ("A", (n, nx, nx)),
            ("B", (n, nx, nu)),
            ("C", (n, ny, nx)),
            ("D", (n, ny, nu)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        if self.basis.dimension != len(self.parameters):
            raise InputError(
                f"the basis is one of {self.basis.dimension} parameter(s), the model has"
                f" {len(self.parameters)}: {', '.join(s.name for s in self.parameters)}"
            )
        for s, (low, high) in zip(self.parameters, self.basis.ranges, strict=True):
            slack = RANGE_SLACK * (s.high - s.low)
            if low > s.low + slack or high < s.high - slack:
                raise InputError(
                    f"the basis covers [{low}, {high}] but scheduling {s.name} ranges over"
                    f" [{s.low}, {s.high}]"
                )
        if self.dt is not None and not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds or None, got {self.dt}")

    @property
    def scheduling(self) -> Scheduling:
        """The scheduling parameter; raises `InputError` where there are several."""
        if len(self.parameters) > 1:
            raise InputError(
                f"the model has {len(self.parameters)} scheduling parameters"
                f" ({', '.join(s.name for s in self.parameters)}): use .parameters"
            )
        return next(iter(self.parameters))

    def matrices(self, p: object) -> Matrices:
        """A, B, C, D at p; the axes of p come first, that of several parameters left out. Raises
        `InputError` outside the ranges.
        """
        f = self.basis(check_all(self.parameters, p))
        return Matrices(*(np.tensordot(f, M, axes=1) for M in (self.A, self.B, self.C, self.D)))
