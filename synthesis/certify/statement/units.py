"""Units of states, outputs and time in which the numbers of a proof are of order one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.pieces import ModelPiece
from synthesis.numerics.polynomial.symmetric import symmetrized


class Scaling(NamedTuple):
    """x = right z, left = right^-1, outputs in units of `channel`, time in units of `time` (s; 1 in
    discrete time).

    `weight` (n, n): in the coordinates weight^-1 z the state block of the LMI is near -I, or below,
    where P is near I: slow and fast states then count alike. `multiplier` is the unit of that of a
    norm-bounded block, squared outputs per squared v.
    """

    left: Array
    right: Array
    channel: float
    time: float
    weight: Array
    multiplier: float = 1.0

    def fault(self, states: int) -> str | None:
        """Return why these are not coordinates of this number of states; None where they are."""
        return structure.first(
            structure.coordinates(
                self.left, self.right, (self.channel, self.time, self.multiplier), states
            ),
            structure.symmetric(np.asarray(self.weight), (states, states), "the weight"),
        )

    def of_pieces(
        self, pieces: Iterable[ModelPiece], block: NormBounded | None = None
    ) -> tuple[ModelPiece, ...]:
        """Return the pieces of a model in these units, those of the channels of a `block` too."""

        def scaled(piece: ModelPiece) -> ModelPiece:
            inputs, outputs = np.ones(piece.B.shape[2]), np.full(piece.C.shape[1], self.channel)
            if block is not None:
                own = self.channel / math.sqrt(self.multiplier)
                inputs[: block.inputs] = outputs[len(outputs) - block.outputs :] = own
            return piece.scaled(self.left, self.right, inputs, outputs, self.time)

        return tuple(map(scaled, pieces))

    def of_matrices(self, model: Matrices, block: NormBounded | None = None) -> Matrices:
        """Return the matrices (K, ...) of a model in these units, as `of_pieces`."""
        return Matrices(*self.of_pieces([ModelPiece(0.0, 1.0, *model)], block)[0][2:])

    def to_physical(self, P: Array) -> Array:
        """Return Lyapunov matrices in physical units from those in z."""
        return symmetrized(self.channel**2 * self.left.T @ P @ self.left)

    def to_scaled(self, P: Array) -> Array:
        """Return the inverse of `to_physical`."""
        return symmetrized(self.right.T @ P @ self.right / self.channel**2)
