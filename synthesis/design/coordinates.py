"""A plant in coordinates in which its synthesis is a matter of numbers of order one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FunctionSpace, LinearModel, Matrices, Scheduling
from symheli.lpv.bases.polynomials import factors_of
from synthesis.design.cells import degrees_of
from synthesis.design.generalized import Generalized
from synthesis.program.scaling import model_scaling

if TYPE_CHECKING:
    from synthesis.design.plant import Plant

Array = np.ndarray

MatricesAt = Callable[[Array], Generalized]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """x = right z (left = right^-1), time in units of `time` (s; 1 in discrete time), performance
    in units of `channel`, u = controls u~ and y~ = measurements y.
    """

    matrices: MatricesAt
    parameters: tuple[Scheduling, ...]
    basis: FunctionSpace
    dt: float | None
    left: Array
    right: Array
    time: float
    channel: float
    controls: Array
    measurements: Array

    @classmethod
    def of(
        cls,
        matrices: MatricesAt,
        parameters: tuple[Scheduling, ...],
        basis: FunctionSpace,
        dt: float | None,
        channel: float = 1.0,
    ) -> Coordinates:
        """Balanced between what drives and what shows the states; a control of unit size is one
        that costs a unit of performance, a measurement of unit size has a unit of noise.
        """
        low, high = np.array([(s.low, s.high) for s in parameters]).T
        line = low + np.linspace(0.0, 1.0, 9)[:, None] * (high - low)
        every = matrices(line)
        A, B1, B2, C1, C2, _, D12, D21, _ = every
        controls = 1.0 / _sizes(D12 / channel, axis=-2)
        measurements = 1.0 / _sizes(D21, axis=-1)
        B = np.concatenate([B1, B2 * controls], axis=-1)
        C = np.concatenate([C1 / channel, measurements[:, None] * C2], axis=-2)
        D = np.zeros((len(line), C.shape[-2], B.shape[-1]))
        names = [
            tuple(f"{k}{i}" for i in range(n))
            for k, n in (("x", A.shape[-1]), ("u", B.shape[-1]), ("y", C.shape[-2]))
        ]
        middle = LinearModel(A[4], B[4], C[4], D[4], *names, dt=dt)  # type: ignore[arg-type]
        scale = model_scaling(middle, 1.0, Matrices(A, B, C, D))
        # what enters the states as large as what leaves them
        enters, leaves = np.linalg.norm(scale.left @ B), np.linalg.norm(C @ scale.right)
        even = math.sqrt(enters / leaves) if enters > 0 and leaves > 0 else 1.0
        return cls(
            matrices,
            parameters,
            basis,
            dt,
            scale.left / even,
            scale.right * even,
            scale.time,
            channel,
            controls,
            measurements,
        )

    def at(self, p: Array) -> Generalized:
        """Matrices (K, ..) at p (K, m)."""
        A, B1, B2, C1, C2, D11, D12, D21, D22 = self.matrices(p)
        root, L, R = np.sqrt(self.time), self.left, self.right
        u, y = self.controls, self.measurements[:, None]
        return Generalized(
            self.time * L @ A @ R,
            root * L @ B1,
            root * L @ B2 * u,
            root * C1 @ R / self.channel,
            root * y * C2 @ R,
            D11 / self.channel,
            D12 * u / self.channel,
            y * D21,
            y * D22 * u,
        )

    @property
    def breaks(self) -> list[list[float]]:
        """Where the plant is not one polynomial, ends included, of each parameter."""
        out = []
        for s, factor in zip(self.parameters, factors_of(self.basis), strict=True):
            try:
                ends = {q for piece in factor.pieces() for q in (piece.low, piece.high)}
            except InputError:
                ends = set()
            slack = 1e-9 * (s.high - s.low)
            out.append(
                [s.low, *sorted(q for q in ends if s.low + slack < q < s.high - slack), s.high]
            )
        return out


def _sizes(D: Array, axis: int) -> Array:
    """Of each channel over all p; 1 where there is nothing."""
    size = np.sqrt(np.square(D).sum(axis=axis).mean(axis=0))
    return np.where(size > 0, size, 1.0)


def coordinates_of(plant: Plant, channel: float) -> Coordinates:
    """Coordinates of the plant with performance in units of `channel`."""
    one = len(plant.parameters) == 1
    return Coordinates.of(
        lambda p: plant.matrices(p[:, 0] if one else p),
        plant.parameters,
        plant.basis,
        plant.dt,
        channel,
    )


def depends(plant: Plant) -> list[bool]:
    """On which parameters."""
    c = coordinates_of(plant, 1.0)
    return [d > 0 for d in degrees_of(lambda p: list(c.at(p)), c.breaks)]
