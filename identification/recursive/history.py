"""What a recursive estimate did over a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.model.lpvarx_model import LPVARXModel
from identification.structure.lpvarx import LPVARX
from symheli.values import Signal
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from identification.recursive.rls_state import RLSState


@dataclass(frozen=True, eq=False, kw_only=True)
class History:
    """`time` (n,) in s, `coefficients` (n, n_regressors, ny) after each sample, `innovations` (n,
    ny), NaN where no regressor was complete.

    `state` after the last sample (go on from it with `update`), `dropped` samples without a
    regressor.
    """

    structure: LPVARX
    time: Array
    coefficients: Array
    innovations: Array
    state: RLSState
    dt: float
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    scheduling: Signal | tuple[Signal, ...]
    dropped: int

    @property
    def model(self) -> LPVARXModel:
        """The model at the end, its coefficients solved from the triangular factor."""
        return LPVARXModel(
            structure=self.structure,
            theta=self.state.solve(),
            dt=self.dt,
            outputs=self.outputs,
            inputs=self.inputs,
            scheduling=self.scheduling,
            residual_covariance=self.state.residual_covariance,
            rows_used=self.state.count,
            rows_dropped=self.dropped,
            method="rls",
        )
