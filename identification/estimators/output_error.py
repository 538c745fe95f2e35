"""Output error: the model whose free run comes closest to the measured outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from scipy.optimize import least_squares

from identification.estimators.instrumental_variables import starting_point
from identification.estimators.instruments import Instruments, source_of
from identification.estimators.method import Estimate, Method, not_settled
from identification.estimators.refined_instruments import RefinedInstruments
from identification.model.stretches import Stretch, contracted, free_of, stretches
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole

ADVICE = "allow more evaluations, or fit a smaller structure"
"""Advice where the search stops early."""


@dataclass(frozen=True)
class OutputError(Method):
    """Output-error method: the free run closest to the record, the maximum-likelihood estimate for
    white Gaussian noise on the outputs.

    The search starts from least squares or (with `instruments`) instrumental variables, and from
    their refinement; in closed loop coloured noise biases it.

    Parameters
    ----------
    instruments : str, sequence of str, or InstrumentSource, optional
        For the start, as for `InstrumentalVariables`.
    initial : {"estimated", "measured"}
        The outputs each stretch starts from: found with the coefficients, or taken as measured.
    evaluations : int
        Of the simulation, at most.
    tolerance : float
        In (0, 1), on the relative change of cost and coefficients.

    Raises
    ------
    InputError
        A number out of range, or another `initial`.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2 and 7.4.

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.OutputError())
    >>> print(found.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """

    instruments: Instruments | None = None
    initial: Literal["estimated", "measured"] = field(default="estimated", kw_only=True)
    evaluations: int = field(default=100, kw_only=True)
    tolerance: float = field(default=1e-10, kw_only=True)
    shorthand: ClassVar[str] = "oe"

    def __post_init__(self) -> None:
        if self.instruments is not None:
            source_of(self.instruments)
        if self.initial not in ("estimated", "measured"):
            raise InputError(f'initial: expected "estimated" or "measured", got {self.initial!r}')
        whole(self.evaluations, "evaluations", 1)
        if not 0 < self.tolerance < 1:
            raise InputError(f"tolerance: expected a number in (0, 1), got {self.tolerance}")

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with `evaluations`, whether the search `converged`, its
        `message`, and the `simulation_covariance` in the details.
        """
        source = None if self.instruments is None else source_of(self.instruments)
        starts = [starting_point(arx, records, data, source)]
        try:
            refined = RefinedInstruments(source, iterations=10, tolerance=1e-3)
            starts.append(refined.estimate(arx, records, data).theta)
        except ExcitationError:  # a refinement that fails leaves the first start
            pass
        found = output_error(arx, records, starts, self)
        return Estimate(
            theta=found.theta,
            details={
                "evaluations": found.evaluations,
                "converged": found.converged,
                "message": found.message,
                "simulation_covariance": found.simulation_covariance.tolist(),
            },
            remarks=() if found.converged else (not_settled(self, ADVICE),),
        )


@dataclass(frozen=True, eq=False)
class OutputErrorResult:
    """theta (n_regressors, ny), the covariance (ny, ny) of the simulation error, and how the search
    ended.
    """

    theta: Array
    simulation_covariance: Array
    evaluations: int
    converged: bool
    message: str


class SimulationError:
    """Residuals, each output divided by its spread, and their exact derivatives, as functions of
    coefficients and initial outputs.
    """

    def __init__(self, arx: LPVARX, runs: Sequence[Stretch], *, estimated: bool):
        self.arx, self.runs, self.estimated = arx, runs, estimated
        self.row, self.output = free_of(arx)
        measured = np.concatenate([run.y for run in runs])
        spread = np.nanstd(measured, axis=0)
        self.scale = np.where(spread > 0, spread, 1.0)
        self.na = len(arx.output_lags)

    def start(self, theta: Array) -> Array:
        """The unknowns for coefficients theta and measured initial outputs (0 where one is
        missing).
        """
        pasts = [np.nan_to_num(run.past[:, 0]) for run in self.runs] if self.estimated else []
        return np.concatenate([theta[self.row, self.output], *pasts])

    def theta(self, unknowns: Array) -> Array:
        """The coefficients among the unknowns."""
        theta = np.zeros((self.arx.n_regressors, self.arx.ny))
        theta[self.row, self.output] = unknowns[: len(self.row)]
        return theta

    def residuals(self, unknowns: Array) -> Array:
        """(measurements,) simulated less measured, initial outputs first where they are estimated;
        infinite where a run diverges.
        """
        theta, parts = self.theta(unknowns), []
        for i, run in enumerate(self.runs):
            model = self._from(run, i, unknowns)
            parts.append(self._kept(run, model.past, model.free_run(theta)))
        return np.concatenate(parts)

    def jacobian(self, unknowns: Array) -> Array:
        """(measurements, unknowns), by the filters that the sensitivities obey."""
        theta, n, width, parts = self.theta(unknowns), len(self.row), self.na * self.arx.ny, []
        for i, run in enumerate(self.runs):
            model = self._from(run, i, unknowns)
            phi = model.with_outputs(model.free_run(theta)).regressors()
            spread = model.spread(theta, phi, np.eye(width) if self.estimated else None)
            full = np.zeros(
                (len(spread) + (self.na if self.estimated else 0), self.arx.ny, len(unknowns))
            )
            full[-len(spread) :, :, :n] = spread[:, :, :n]
            if self.estimated:
                own = slice(n + i * width, n + (i + 1) * width)
                full[-len(spread) :, :, own] = spread[:, :, n:]
                full[: self.na, :, own] = np.eye(width).reshape(self.na, self.arx.ny, width)
            target = self._measured(run)
            parts.append((full / self.scale[None, :, None])[np.isfinite(target)])
        return np.concatenate(parts)

    def _from(self, run: Stretch, i: int, unknowns: Array) -> Stretch:
        """The stretch with the initial outputs of the unknowns."""
        width, m = self.na * self.arx.ny, self.arx.memory
        y = np.nan_to_num(run.y)
        if self.estimated:
            past = unknowns[len(self.row) + i * width : len(self.row) + (i + 1) * width]
            y[m - self.na : m] = past.reshape(self.na, self.arx.ny)[::-1]
        return run.with_outputs(y)

    def _measured(self, run: Stretch) -> Array:
        """Initial outputs, newest first, where they are estimated, then the targets."""
        m = self.arx.memory
        return (
            np.vstack([run.y[m - self.na : m][::-1], run.target]) if self.estimated else run.target
        )

    def _kept(self, run: Stretch, past: Array, response: Array) -> Array:
        target = self._measured(run)
        simulated = (
            np.vstack([past.reshape(self.na, self.arx.ny), response])
            if self.estimated
            else response
        )
        return ((simulated - target) / self.scale)[np.isfinite(target)]


def output_error(
    arx: LPVARX, records: Sequence[FlightRecord], starts: Sequence[Array], options: OutputError
) -> OutputErrorResult:
    """Minimise the simulation error over coefficients (and initial outputs) from the best of the
    coefficients `starts`.

    The maximum-likelihood estimate for white Gaussian noise on the outputs. A start whose free run
    diverges is first drawn in (`contracted`). Exact derivatives; trust-region reflective search of
    SciPy.

    Raises `ExcitationError` where the records hold no stretch to simulate.
    """
    runs = stretches(arx, records, outputs=False)
    if options.initial == "measured":
        runs = [run for run in runs if np.isfinite(run.past).all()]
    if not runs:
        raise ExcitationError(
            f"no unbroken stretch of more than {arx.memory} samples of inputs and scheduling to"
            " simulate"
        )
    problem = SimulationError(arx, runs, estimated=options.initial == "estimated")
    candidates = [problem.start(contracted(arx, theta, runs)) for theta in starts]
    best = min(
        candidates, key=lambda unknowns: float(np.sum(np.square(problem.residuals(unknowns))))
    )
    found = least_squares(
        problem.residuals,
        best,
        jac=problem.jacobian,  # type: ignore[arg-type]
        method="trf",
        x_scale="jac",
        max_nfev=options.evaluations,
        ftol=options.tolerance,
        xtol=options.tolerance,
        gtol=options.tolerance,
    )
    theta = problem.theta(found.x)
    error = np.concatenate(
        [run.target - problem._from(run, i, found.x).free_run(theta) for i, run in enumerate(runs)]
    )
    error = error[np.isfinite(error).all(axis=1)]
    covariance = error.T @ error / max(len(error) - len(problem.row) // arx.ny, 1)
    return OutputErrorResult(
        theta, covariance, int(found.nfev), bool(found.status > 0), str(found.message)
    )
