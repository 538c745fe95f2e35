"""Prediction error methods: output error, Box-Jenkins and ARMAX, by one search."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from scipy.optimize import least_squares

from identification.design.excitation import RANK_TOLERANCE
from identification.estimators.instrumental_variables import starting_point
from identification.estimators.instruments import Instruments, source_of
from identification.estimators.method import Estimate, Method, not_settled
from identification.estimators.refined_instruments import RefinedInstruments
from identification.model.noise_model import NoiseModel
from identification.model.stretches import Stretch, contracted, filtered, free_of, stretches
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ExcitationError, InputError
from symheli.progress import task
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole

WORSE = 4.0
"""Sum of squares, over the least so far, beyond which a free run from measured outputs refuses its
model.
"""

ADVICE = "allow more evaluations, or fit a smaller structure"
"""Advice where the search stops early."""


@dataclass(frozen=True)
class PredictionError(Method):
    """Base of the methods that find the least sum of squares of one-step prediction errors e, each
    output divided by its spread: the maximum-likelihood estimate for white Gaussian e.

    Noise v = (C/D) e of each output enters at the outputs or in the equations. The search starts
    from least squares or (with `instruments`) instrumental variables, and from their refinement.

    Parameters
    ----------
    instruments : str, sequence of str, or InstrumentSource, optional
        For the start, as for `InstrumentalVariables`.
    evaluations : int
        Of the model, at most.
    tolerance : float
        In (0, 1), on the relative change of cost and coefficients.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2 and 7.4.
    """

    instruments: Instruments | None = None
    evaluations: int = field(default=100, kw_only=True)
    tolerance: float = field(default=1e-10, kw_only=True)

    def __post_init__(self) -> None:
        if self.instruments is not None:
            source_of(self.instruments)
        whole(self.evaluations, "evaluations", 1)
        if not 0 < self.tolerance < 1:
            raise InputError(f"tolerance: expected a number in (0, 1), got {self.tolerance}")
        ar, ma, _ = self.noise
        whole(ar, "ar")
        whole(ma, "ma")

    @property
    @abstractmethod
    def noise(self) -> tuple[int, int, Literal["output", "equation"]]:
        """Orders of D and C, and where the noise enters."""

    @property
    def estimated_start(self) -> bool:
        """Whether the outputs that each stretch starts from are unknowns too."""
        return False

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients and the noise model, with `evaluations`, whether the search
        `converged`, its `message`, and the `simulation_covariance` of output error in the details.
        """
        source = None if self.instruments is None else source_of(self.instruments)
        starts = [starting_point(arx, records, data, source)]
        try:
            refined = RefinedInstruments(source, iterations=10, tolerance=1e-3)
            starts.append(refined.estimate(arx, records, data).theta)
        except ExcitationError:  # a refinement that fails leaves the first start
            pass
        return prediction_error(arx, records, starts, self)


@dataclass(frozen=True)
class OutputError(PredictionError):
    """Output-error method: the free run closest to the record; in closed loop coloured noise biases
    it.

    Parameters
    ----------
    instruments, evaluations, tolerance
        As in `PredictionError`.
    initial : {"estimated", "measured"}
        The outputs each stretch starts from: found with the coefficients, or taken as measured.

    Raises
    ------
    InputError
        A number out of range, or another `initial`.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2 and 7.4.

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.methods.OutputError())
    >>> print(found.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """

    initial: Literal["estimated", "measured"] = field(default="estimated", kw_only=True)
    shorthand: ClassVar[str] = "oe"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.initial not in ("estimated", "measured"):
            raise InputError(f'initial: expected "estimated" or "measured", got {self.initial!r}')

    @property
    def noise(self) -> tuple[int, int, Literal["output", "equation"]]:
        """White, at the outputs."""
        return 0, 0, "output"

    @property
    def estimated_start(self) -> bool:
        """Whether the outputs that each stretch starts from are unknowns too."""
        return self.initial == "estimated"


@dataclass(frozen=True)
class BoxJenkins(OutputError):
    """Box-Jenkins method: the free run and (C/D) e beside it, constant C and D of each output.

    Parameters
    ----------
    instruments, evaluations, tolerance, initial
        As in `OutputError`.
    ar, ma : int
        Orders of D and C.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2; Laurain, Toth, Gilson and Garnier (2010),
    Refined instrumental variable methods for identification of LPV Box-Jenkins models, Automatica
    46, 959-967.

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.methods.BoxJenkins(ar=1))
    >>> print(found.coefficients.at(0.0).A.round(2), found.noise.ar.shape)
    [[[-0.5]]] (1, 1)
    """

    ar: int = field(default=1, kw_only=True)
    ma: int = field(default=0, kw_only=True)
    shorthand: ClassVar[str] = "bj"

    @property
    def noise(self) -> tuple[int, int, Literal["output", "equation"]]:
        """(C/D) e, at the outputs."""
        return self.ar, self.ma, "output"


@dataclass(frozen=True)
class ARMAX(PredictionError):
    """ARMAX method: the equations leave (C/D) e, constant C and D of each output; D = 1 unless `ar`
    says otherwise.

    Parameters
    ----------
    instruments, evaluations, tolerance
        As in `PredictionError`.
    ma, ar : int
        Orders of C and D.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Ljung (1999), System Identification, sec. 4.2.

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.methods.ARMAX(ma=1))
    >>> print(found.coefficients.at(0.0).A.round(2), abs(found.noise.ma[0, 0]) < 0.2)
    [[[-0.5]]] True
    """

    ma: int = field(default=1, kw_only=True)
    ar: int = field(default=0, kw_only=True)
    shorthand: ClassVar[str] = "armax"

    @property
    def noise(self) -> tuple[int, int, Literal["output", "equation"]]:
        """(C/D) e, in the equations."""
        return self.ar, self.ma, "equation"


class Residuals:
    """Prediction errors, each output divided by its spread, and their exact derivatives, as
    functions of the unknowns: free coefficients, those of the noise model output by output, and the
    outputs that each stretch starts from where these are estimated.
    """

    def __init__(self, arx: LPVARX, runs: Sequence[Stretch], options: PredictionError):
        self.arx, self.runs, self.estimated = arx, runs, options.estimated_start
        self.enters: Literal["output", "equation"]
        self.ar, self.ma, self.enters = options.noise
        self.row, self.output = free_of(arx)
        measured = np.concatenate([run.y for run in runs])
        spread = np.nanstd(measured, axis=0)
        self.scale = np.where(spread > 0, spread, 1.0)
        self.na = len(arx.output_lags)
        self.first = len(self.row) + arx.ny * (self.ar + self.ma)

    def start(self, theta: Array) -> Array:
        """The unknowns for coefficients theta, the noise model that is seen with them, and measured
        initial outputs (0 where one is missing).
        """
        pasts = [np.nan_to_num(run.past[:, 0]) for run in self.runs] if self.estimated else []
        unknowns = np.concatenate(
            [theta[self.row, self.output], np.zeros(self.first - len(self.row)), *pasts]
        )
        if self.ar + self.ma:
            left = [np.nan_to_num(v[-len(run.target) :]) for run, v in self._left(unknowns)]
            noise = NoiseModel.of(left, self.ar, self.ma, self.enters)
            unknowns[len(self.row) : self.first] = np.hstack([noise.ar, noise.ma]).reshape(-1)
        return unknowns

    def theta(self, unknowns: Array) -> Array:
        """The coefficients among the unknowns."""
        theta = np.zeros((self.arx.n_regressors, self.arx.ny))
        theta[self.row, self.output] = unknowns[: len(self.row)]
        return theta

    def noise(self, unknowns: Array) -> NoiseModel:
        """The noise model among the unknowns."""
        both = unknowns[len(self.row) : self.first].reshape(self.arx.ny, self.ar + self.ma)
        return NoiseModel(both[:, : self.ar], both[:, self.ar :], self.enters)

    def residuals(self, unknowns: Array) -> Array:
        """(measurements,) initial outputs first where they are estimated; infinite where a run
        diverges, or the noise model is not invertible.
        """
        noise = self.noise(unknowns)
        with np.errstate(all="ignore"):
            parts = [
                (noise.filtered(v) if noise.stable else np.full_like(v, np.inf))[self._kept(run)]
                for run, v in self._left(unknowns)
            ]
        return np.concatenate(parts)

    def jacobian(self, unknowns: Array) -> Array:
        """(measurements, unknowns), by the filters that the sensitivities obey."""
        parts, own = [], self.first
        for block in self._blocks(unknowns):
            width = block.shape[1] - self.first
            full = np.zeros((len(block), len(unknowns)))
            full[:, : self.first], full[:, own : own + width] = np.split(block, [self.first], 1)
            parts.append(full)
            own += width
        return np.concatenate(parts)

    def settled(self, unknowns: Array) -> Array:
        """The unknowns with the initial outputs that leave the least squares beside the others."""
        if not self.estimated:
            return unknowns
        out, width, noise = unknowns.copy(), self.na * self.arx.ny, self.noise(unknowns)
        out[self.first :] = 0.0
        with np.errstate(all="ignore"):
            for i, (run, v) in enumerate(self._left(out)):
                kept = self._kept(run)
                by_past = np.zeros((*v.shape, width))
                self._by_past(by_past, run, self.theta(unknowns))
                by_past, left = (noise.filtered(part)[kept] for part in (by_past, v))
                if np.isfinite(by_past).all() and np.isfinite(left).all():
                    best = np.linalg.lstsq(by_past, -left, rcond=None)[0]
                    out[self.first + i * width : self.first + (i + 1) * width] = best
        return out

    def reduced_jacobian(self, settled: Array) -> Array:
        """(measurements, coefficients and noise): what initial outputs that settle anew do not
        undo.

        Their columns touch one stretch each and are projected out there. Source: Kaufman (1975),
        BIT 15, for the variable projection of Golub and Pereyra.
        """
        parts = []
        for block in self._blocks(settled):
            by_others, by_past = np.split(block, [self.first], axis=1)
            if by_past.size:
                U, size, _ = np.linalg.svd(by_past, full_matrices=False)
                U = U[:, size > RANK_TOLERANCE * size[0]]
                by_others = by_others - U @ (U.T @ by_others)
            parts.append(by_others)
        return np.concatenate(parts)

    def _blocks(self, unknowns: Array) -> Iterator[Array]:
        """Yield the Jacobian of each stretch (measurements, coefficients, noise and its own initial
        outputs).
        """
        noise, width = self.noise(unknowns), self.na * self.arx.ny * self.estimated
        for i, (run, v) in enumerate(self._left(unknowns)):
            full = np.zeros((*v.shape, self.first + width))
            self._by_model(full, run, i, unknowns)
            full = noise.filtered(full)
            full[:, :, len(self.row) : self.first] = noise.by_coefficients(v, noise.filtered(v))
            yield full[self._kept(run)]

    def _by_model(self, full: Array, run: Stretch, i: int, unknowns: Array) -> None:
        """Fill in how what is left of stretch i answers coefficients and initial outputs."""
        n = len(self.row)
        if self.enters == "equation":
            full[:, :, :n] = run.spread_out(run.regressors()) / self.scale[:, None]
            return
        theta = self.theta(unknowns)
        model = self._from(run, i, unknowns)
        phi = model.with_outputs(model.free_run(theta)).regressors()
        spread = model.spread(theta, phi)
        full[-len(spread) :, :, :n] = spread / self.scale[:, None]
        if self.estimated:
            self._by_past(full[:, :, self.first :], run, theta)

    def _by_past(self, out: Array, run: Stretch, theta: Array) -> None:
        """Fill in how what is left of a stretch answers its initial outputs, newest first."""
        width = out.shape[2]
        A = run.lag_coefficients(theta)
        out[self.na :] = filtered(A, np.zeros((len(A), self.arx.ny, width)), np.eye(width))
        out[: self.na] = np.eye(width).reshape(self.na, self.arx.ny, width)
        out /= self.scale[:, None]

    def _left(self, unknowns: Array) -> list[tuple[Stretch, Array]]:
        """Each stretch with what the model without noise leaves of it, less its sign."""
        theta, out = self.theta(unknowns), []
        for i, run in enumerate(self.runs):
            if self.enters == "equation":
                model = run.regressors() @ theta
            else:
                there = self._from(run, i, unknowns)
                model = there.free_run(theta)
                if self.estimated:
                    model = np.vstack([there.past.reshape(self.na, self.arx.ny), model])
            out.append((run, (model - self._measured(run)) / self.scale))
        return out

    def _from(self, run: Stretch, i: int, unknowns: Array) -> Stretch:
        """The stretch with the initial outputs of the unknowns."""
        width, m = self.na * self.arx.ny, self.arx.memory
        y = np.nan_to_num(run.y)
        if self.estimated:
            past = unknowns[self.first + i * width : self.first + (i + 1) * width]
            y[m - self.na : m] = past.reshape(self.na, self.arx.ny)[::-1]
        return run.with_outputs(y)

    def _measured(self, run: Stretch) -> Array:
        """Initial outputs, newest first, where they are estimated, then the targets."""
        m = self.arx.memory
        return (
            np.vstack([run.y[m - self.na : m][::-1], run.target]) if self.estimated else run.target
        )

    def _kept(self, run: Stretch) -> Array:
        """Which measurements there are."""
        return np.isfinite(self._measured(run))


def prediction_error(
    arx: LPVARX, records: Sequence[FlightRecord], starts: Sequence[Array], options: PredictionError
) -> Estimate:
    """Minimise the prediction errors over coefficients, noise model (and initial outputs) from the
    best of the coefficients `starts`.

    A start whose free run diverges is first drawn in (`contracted`). Initial outputs, in which the
    errors are linear, are settled at each evaluation, so that a record of many parts has no more
    unknowns than one. Models that run from the measured outputs `WORSE` than one before are
    refused: settled outputs keep an unstable mode still. Trust-region reflective search of SciPy.

    Raises `ExcitationError` where the records hold no stretch to simulate.
    """
    ar, ma, enters = options.noise
    runs = stretches(arx, records, outputs=enters == "equation" or ar + ma > 0)
    if not options.estimated_start:
        runs = [run for run in runs if np.isfinite(run.past).all()]
    if not runs:
        raise ExcitationError(
            f"no unbroken stretch of more than {arx.memory} samples of inputs and scheduling to"
            " simulate"
        )
    problem = Residuals(arx, runs, options)
    candidates = [problem.start(contracted(arx, theta, runs)) for theta in starts]
    best, rest = min(
        ((problem.settled(unknowns), unknowns[problem.first :]) for unknowns in candidates),
        key=lambda pair: _cost(problem, pair[0]),
    )
    runs_free: list[float] = [_cost(problem, np.concatenate([best[: problem.first], rest]))]
    with task(f"{options.shorthand}: evaluations, at most", options.evaluations) as search:

        def residuals(own: Array) -> Array:
            search.step()
            unknowns = np.concatenate([own, rest])
            runs_free.append(_cost(problem, unknowns))
            error = problem.residuals(problem.settled(unknowns))
            return error if runs_free[-1] <= WORSE * min(runs_free) else np.full_like(error, np.inf)

        def jacobian(own: Array) -> Array:
            return problem.reduced_jacobian(problem.settled(np.concatenate([own, rest])))

        found = least_squares(
            residuals,
            best[: problem.first],
            jac=jacobian,  # type: ignore[arg-type]
            method="trf",
            x_scale="jac",
            max_nfev=options.evaluations,
            ftol=options.tolerance,
            xtol=options.tolerance,
            gtol=options.tolerance,
        )
    found.x = problem.settled(np.concatenate([found.x, rest]))
    noise = problem.noise(found.x)
    error = np.concatenate(
        [noise.filtered(v)[-len(run.target) :] for run, v in problem._left(found.x)]
    )
    error = error[np.isfinite(error).all(axis=1)] * problem.scale
    covariance = error.T @ error / max(len(error) - problem.first // arx.ny, 1)
    converged = bool(found.status > 0)
    details = {
        "evaluations": int(found.nfev),
        "converged": converged,
        "message": str(found.message),
    }
    white = ar + ma == 0 and enters == "output"
    return Estimate(
        theta=problem.theta(found.x),
        details=details | ({"simulation_covariance": covariance.tolist()} if white else {}),
        remarks=() if converged else (not_settled(options, ADVICE),),
        residual_covariance=None if white else covariance,
        noise=None if white else noise,
    )


def _cost(problem: Residuals, unknowns: Array) -> float:
    """The sum of squares; infinite where a run diverges."""
    with np.errstate(all="ignore"):
        cost = float(np.sum(np.square(problem.residuals(unknowns))))
    return cost if np.isfinite(cost) else np.inf
