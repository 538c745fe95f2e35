"""An identified model: coefficients with names, units and sample period."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identification.design.excitation import ExcitationReport
from identification.model import prediction, realization
from identification.model.coefficients import Coefficients
from identification.model.noise_model import NoiseModel
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import check_units
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.balanced_truncation import BalancedTruncation
from symheli.lpv.bases import FunctionSpace
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal, signals
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.numbers import whole
from symheli.values.sample_period import JITTER, same_period
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, kw_only=True)
class LPVARXModel:
    """A structure with its coefficients and the sample period they belong to, as `fit` returns it.

    Parameters
    ----------
    structure : LPVARX
        Signals, orders, basis.
    theta : array (n_regressors, ny)
        The coefficients; zero where an equation lacks a regressor.
    dt : float
        Sample period, s.
    outputs, inputs : tuple of Signal
        With the units of the record.
    scheduling : Signal or tuple of Signal
        Several where the structure has.
    residual_covariance : array (ny, ny)
        Of the one-step residuals, in the units of the outputs.
    rows_used, rows_dropped : int
        Samples of the fit.
    method : str
        How it was fitted.
    least_squares : bool, optional
        Whether that was least squares alone: see `identification.methods.Method`. Default, as of
        files that do not say it: what "ls" and "rls" are.
    excitation : ExcitationReport, optional
        On the data.
    details : mapping
        What the method chose (weights, iterations, ...): plain numbers and lists by name.
    covariance : array (ny, n_regressors, ny, n_regressors), optional
        Of all coefficients together, theta[i, y] with theta[j, z] at [y, i, z, j], under the
        hypothesis of the method that `fit` names; None where the method gives none. Zero for
        coefficients an equation does not have.
    noise : NoiseModel, optional
        Of the outputs or the equations, as "bj" and "armax" find it: predictions go on with it.

    Raises
    ------
    InputError
        Shapes or signals that are not those of the structure, a period that is not positive,
        samples that are not counted.

    Examples
    --------
    >>> model.rows_used, model.method, model.predict(record, horizon=5).shape
    (799, 'ls', (800, 1))
    >>> print(model.at(0.0).poles().round(1), model.to_state_space().dt)
    [0.5] 0.1
    """

    structure: LPVARX
    theta: Array
    dt: float
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    scheduling: Signal | tuple[Signal, ...]
    residual_covariance: Array
    rows_used: int
    rows_dropped: int = 0
    method: str = "ls"
    least_squares: bool | None = field(default=None, repr=False)
    excitation: ExcitationReport | None = field(default=None, repr=False)
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)
    covariance: Array | None = field(default=None, repr=False)
    noise: NoiseModel | None = field(default=None, repr=False)

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        arx = self.structure
        object.__setattr__(self, "outputs", signals(self.outputs))
        object.__setattr__(self, "inputs", signals(self.inputs))
        parameters = signals(
            [self.scheduling] if isinstance(self.scheduling, str) else self.scheduling
        )
        object.__setattr__(
            self, "scheduling", parameters[0] if len(parameters) == 1 else parameters
        )
        object.__setattr__(self, "theta", frozen(self.theta, "theta", (arx.n_regressors, arx.ny)))
        object.__setattr__(
            self,
            "residual_covariance",
            frozen(self.residual_covariance, "residual covariance", (arx.ny, arx.ny)),
        )
        if self.least_squares is None:
            object.__setattr__(self, "least_squares", self.method in ("ls", "rls"))
        if self.covariance is not None:
            n = arx.n_regressors
            object.__setattr__(
                self, "covariance", frozen(self.covariance, "covariance", (arx.ny, n) * 2)
            )
        own, given = (
            (arx.outputs, arx.inputs, arx.parameters),
            (self.outputs, self.inputs, parameters),
        )
        if own != given:
            raise InputError(f"signals {given} are not those of the structure: {own}")
        if np.any(self.theta[~arx.free]):
            raise InputError("theta: coefficients that the structure leaves out must be zero")
        if not (isinstance(self.dt, int | float | np.floating) and 0 < self.dt < np.inf):
            raise InputError(f"dt must be a positive number of seconds, got {self.dt!r}")
        for count in ("rows_used", "rows_dropped"):
            object.__setattr__(self, count, whole(getattr(self, count), count))

    @property
    def parameters(self) -> tuple[Signal, ...]:
        """The scheduling parameters, also where there is one."""
        return (self.scheduling,) if isinstance(self.scheduling, Signal) else self.scheduling

    @property
    def coefficients(self) -> Coefficients:
        """A_i, B_j, c, d in the basis; `.at(p)` for values, `.monomial()` for powers of p."""
        return Coefficients.of(self.structure, self.theta)

    def predict(self, record: FlightRecord, horizon: int, *, hold_p: bool = False) -> Array:
        """Predictions (n, ny) `horizon` samples ahead: outputs known up to t - horizon, inputs and
        p up to t.

        `hold_p`: p too is known up to t - horizon only and held from there. So judge a model that
        is scheduled on a measurement: the p of later carries what the outputs will do. A commanded
        p is known ahead.

        NaN where a past is incomplete: the first memory + horizon - 1 samples of each segment, and
        behind missing samples. Infinite where the prediction overflows. Raises `InputError` for
        another sample period or unit.
        """
        if hold_p:
            if self.noise is not None:
                raise InputError("hold_p: a model with coloured noise is predicted with p as it is")
            self.require_same_kind(record)
            return prediction.predict_holding(self.structure, self.theta, record, horizon)
        return prediction.predict(self._along(record), horizon, self.noise)

    def simulate(self, record: FlightRecord) -> Array:
        """Free run (n, ny) from the first samples of each segment with the record's inputs and p.

        NaN for the samples the run starts from and where inputs or p are missing (behind which it
        starts again); infinite from where it diverges. Raises `InputError` for another sample
        period or unit.
        """
        return prediction.simulate(self._along(record))

    def with_theta(self, theta: Array) -> LPVARXModel:
        """The same with other coefficients (n, ny), whose covariance is not known."""
        return replace(self, theta=theta, covariance=None)

    def score(
        self, record: FlightRecord, horizon: int | None = None, *, hold_p: bool = False
    ) -> NamedVector:
        """Fit in percent of each output, `horizon` samples ahead or, with None, in free run; see
        `fit_percent`.

        `hold_p` as in `predict`; a free run follows p all along, so that it raises `InputError`
        with it.
        """
        if horizon is None and hold_p:
            raise InputError(
                "hold_p: a free run follows p from its start to its end; give a horizon (samples)"
                " to hold p over"
            )
        guess = (
            self.simulate(record)
            if horizon is None
            else self.predict(record, horizon, hold_p=hold_p)
        )
        return prediction.named_fit(self.outputs, record, guess)

    def at(self, *p: float) -> LinearModel:
        """The discrete model with the scheduling held at p (one number a parameter, none where
        coefficients are constant), in observer form.

        The offsets are left out: deviation dynamics.
        """
        held = realization.held_value(p, self.structure.basis)
        return realization.at(self.coefficients, held, self.outputs, self.inputs, self.dt)

    def plot(self, input: str | None = None, output: str | None = None) -> tuple[Axes, Axes]:
        """Draw the frequency response from an input to an output (default: the first of each) at
        values of the parameters; (magnitude, phase). Raises `UnknownNameError`.
        """
        from symheli.lpv.frozen_plots import bode

        lpv = self.to_state_space()
        return bode(lpv, input or lpv.inputs[0], output or lpv.outputs[0])

    def to_state_space(self, route: Literal["shifted", "direct"] | None = None) -> LPVStateSpace:
        """The discrete LPV model with static dependence on p(k) that responds exactly as this one,
        however p moves.

        "shifted" (for coefficients at the lag): observer form, minimal where the input lags do not
        exceed na; with na = nb = delay = 1 the states are the outputs. "direct" (for coefficients
        at "now"): past outputs and inputs as the state, not minimal. None chooses the right one,
        the wrong one raises `InputError`. The offsets c(p) and d(p) are left out: the model
        describes deviations from the moving trim. The ranges of the parameters are those of the
        basis, their rates unlimited: `.with_rate(...)`, `.with_scheduling(...)` say more.
        """
        build = {"shifted": realization.shifted, "direct": realization.direct}[
            realization.route_for(self.structure, route)
        ]
        parameters = tuple(
            Scheduling(str(p), p.unit, low, high)
            for p, (low, high) in zip(self.parameters, self.structure.basis.ranges, strict=True)
        )
        return build(self.coefficients, parameters, self.outputs, self.inputs, self.dt)

    def truncate(self, order: int, **options: Any) -> BalancedTruncation[LPVStateSpace]:
        """The exact realization, truncated to `order` states, with the frozen error it makes; see
        `symheli.lpv.balanced_truncation`, which has the options.
        """
        return self.to_state_space().truncate(order, **options)

    def to_frame(self) -> pandas.DataFrame:
        """The coefficients: a row a regressor, a column an output; the units of the outputs in
        attrs["units"], those of the regressors in attrs["regressor_units"]. Raises `InputError`
        without pandas.
        """
        from identification.model.labelled_coefficients import coefficients_frame

        return coefficients_frame(self)

    def to_xarray(self) -> xarray.Dataset:
        """The coefficients `theta` over "regressor" and "output", each with its units; the basis is
        an attribute. Raises `InputError` without xarray.
        """
        from identification.model.labelled_coefficients import coefficients_dataset

        return coefficients_dataset(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model as JSON, every number exact, at once or not at all; see `load`."""
        from identification.model import saved_model

        return saved_model.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str], basis: FunctionSpace | None = None) -> LPVARXModel:
        """A saved model, equal to the last bit; one with `UserFunctions` needs its `basis`. Raises
        `InputError` for any other file.
        """
        from identification.model import saved_model

        return saved_model.load(path, basis)

    def save_mat(self, path: str | os.PathLike[str]) -> Path:
        """Write coefficients, names and units as a MATLAB file (version 5), with a readme
        inside.
        """
        from identification.model import saved_model

        return saved_model.save_mat(self, path)

    def require_same_kind(self, record: FlightRecord) -> None:
        """Raises `InputError` where `record` has another sample period, or a signal of the model in
        another unit.
        """
        parameters = () if self.structure.constant else self.parameters
        check_units((*self.outputs, *self.inputs, *parameters), record)
        if not same_period(record.dt, self.dt, JITTER):
            raise InputError(
                f"the model was identified at dt = {self.dt:.4g} s, the record has {record.dt:.4g}"
                " s; resample it"
            )

    def _along(self, record: FlightRecord) -> prediction.OutputRecursion:
        self.require_same_kind(record)
        return prediction.OutputRecursion.along(self.structure, self.theta, record)
