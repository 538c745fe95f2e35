"""An identified model: coefficients with names, units and sample period."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from identification import prediction, realization
from identification.coefficients import Coefficients
from identification.excitation import ExcitationReport
from identification.structure import LPVARX
from symheli.errors import InputError
from symheli.lpv import FlightRecord, LinearModel, LPVStateSpace, NamedVector, Scheduling, Signal, signals
from symheli.lpv.arrays import Array, frozen


@dataclass(frozen=True, eq=False)
class LPVARXModel:
    """A structure with its coefficients `theta` (n_regressors, ny) and the sample period `dt` (s) they belong to.

    `outputs`, `inputs`, `scheduling` carry the units of the record. `residual_covariance` (ny, ny) of the one-step
    residuals, `rows_used` and `rows_dropped` samples of the fit, `method` how it was fitted, `excitation` the report on the data.
    """

    structure: LPVARX
    theta: Array
    dt: float
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    scheduling: Signal
    residual_covariance: Array
    rows_used: int
    rows_dropped: int = 0
    method: str = "ls"
    excitation: ExcitationReport | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        arx = self.structure
        object.__setattr__(self, "outputs", signals(self.outputs))
        object.__setattr__(self, "inputs", signals(self.inputs))
        object.__setattr__(self, "theta", frozen(self.theta, "theta", (arx.n_regressors, arx.ny)))
        object.__setattr__(self, "residual_covariance", frozen(self.residual_covariance, "residual covariance", (arx.ny, arx.ny)))
        if self.outputs != arx.outputs or self.inputs != arx.inputs:
            raise InputError(f"signals {self.outputs} and {self.inputs} are not those of the structure: {arx.outputs} and {arx.inputs}")
        if not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds, got {self.dt}")

    @property
    def coefficients(self) -> Coefficients:
        """A_i, B_j, c, d in the basis; `.at(p)` for values, `.monomial()` for powers of p."""
        return Coefficients.of(self.structure, self.theta)

    def predict(self, record: FlightRecord, horizon: int) -> Array:
        """Predictions (n, ny) `horizon` samples ahead: outputs known up to t - horizon, inputs and p up to t.

        NaN where a past is incomplete: the first memory + horizon - 1 samples of each segment, and behind missing
        samples. Infinite where the prediction overflows. Raises `InputError` for another sample period.
        """
        return prediction.predict(self._along(record), horizon)

    def simulate(self, record: FlightRecord) -> Array:
        """Free run (n, ny) from the first samples of each segment with the record's inputs and p.

        NaN for the samples the run starts from and where inputs or p are missing (behind which it starts again);
        infinite from where it diverges. Raises `InputError` for another sample period.
        """
        return prediction.simulate(self._along(record))

    def score(self, record: FlightRecord, horizon: int | None = None) -> NamedVector:
        """Fit in percent of each output, `horizon` samples ahead or, with None, in free run; see `fit_percent`."""
        guess = self.simulate(record) if horizon is None else self.predict(record, horizon)
        fit = prediction.fit_percent(record.columns(self.outputs), guess)
        return NamedVector(tuple(Signal(s, "%") for s in self.outputs), fit)

    def at(self, p: float) -> LinearModel:
        """The discrete model with the scheduling held at p, in observer form; offsets are left out (deviation dynamics)."""
        return realization.at(self.coefficients, float(p), self.outputs, self.inputs, self.dt)

    def to_state_space(self, route: Literal["shifted", "direct"] | None = None) -> LPVStateSpace:
        """The discrete LPV model with static dependence on p(k) that responds exactly as this one, however p moves.

        "shifted" (for coefficients at the lag): observer form, minimal where the input lags do not exceed na; with
        na = nb = delay = 1 the states are the outputs. "direct" (for coefficients at "now"): past outputs and inputs as the state,
        not minimal. None chooses the right one, the wrong one raises `InputError`. The offsets c(p) and d(p) are left
        out: the model describes deviations from the moving trim. The range of p is that of the basis, its rate unlimited:
        `.with_rate(...)`, `.with_scheduling(...)` say more.
        """
        build = {"shifted": realization.shifted, "direct": realization.direct}[realization.route_for(self.structure, route)]
        basis = self.structure.basis
        scheduling = Scheduling(str(self.scheduling), self.scheduling.unit, basis.low, basis.high)
        return build(self.coefficients, scheduling, self.outputs, self.inputs, self.dt)

    def _along(self, record: FlightRecord) -> prediction.Recursion:
        if abs(record.dt - self.dt) > 0.01 * self.dt:
            raise InputError(f"the model was identified at dt = {self.dt:.4g} s, the record has {record.dt:.4g} s; resample it")
        return prediction.Recursion.along(self.structure, self.theta, record)
