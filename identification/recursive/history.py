"""History of a recursive estimate over a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from identification.structure.kinematic_arx import KinematicARX
from identification.structure.lpvarx import LPVARX
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.summary import summarized

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from identification.recursive.rls_state import RLSState


@dataclass(frozen=True, eq=False, kw_only=True)
class History:
    """The course of a recursive estimate over a record, as `RecursiveLeastSquares.run` returns it.

    Parameters
    ----------
    structure : LPVARX or KinematicARX
        What was identified.
    time : array (n,)
        Of the samples, s.
    coefficients : array (n, n_regressors, ny)
        After each sample.
    innovations : array (n, ny)
        NaN where no regressor was complete.
    state : RLSState
        After the last sample; go on from it with `update`.
    dt : float
        Sample period, s.
    outputs, inputs, scheduling : Signal or tuple of Signal
        With the units of the record.
    dropped : int
        Samples without a regressor.
    trim : array (basis size, 8), optional
        With known kinematics, see `KinematicModel`.

    Examples
    --------
    >>> history = idn.RecursiveLeastSquares(arx).run(record)
    >>> history.coefficients.shape, history.dropped
    ((800, 4, 1), 1)
    >>> print(history.model.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """

    structure: LPVARX | KinematicARX
    time: Array
    coefficients: Array
    innovations: Array
    state: RLSState
    dt: float
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    scheduling: Signal | tuple[Signal, ...]
    dropped: int
    trim: Array | None = None

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def model(self) -> Any:
        """The model at the end, its coefficients solved from the triangular factor: an
        `LPVARXModel`, or the `KinematicModel` of a `KinematicARX`.
        """
        kin = self.structure if isinstance(self.structure, KinematicARX) else None
        regression = LPVARXModel(
            structure=self.state.configuration.structure,
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
        if kin is None or self.trim is None:
            return regression
        return KinematicModel(structure=kin, aerodynamics=regression, trim=self.trim)

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """Names of the rows of the coefficients, such as "q(k-1) f0(airspeed(k-1))"."""
        return self.state.configuration.structure.regressor_names

    def plot(
        self,
        ax: Axes | None = None,
        output: str | None = None,
        regressors: Sequence[str] | None = None,
    ) -> Axes:
        """Plot the coefficients of `output` (default: the first): those of all regressors, or of
        some of `regressor_names`, over time (s), each divided by its last value. The vertical range
        suits the end; early estimates may leave it.
        """
        from identification.recursive.history_plot import plot_history

        return plot_history(self, ax, output, regressors)
