"""Refined instrumental variables: the model's own noise-free response instruments, and filters, the
next estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from identification.design.excitation import (
    RANK_TOLERANCE,
    column_scale,
    direction_in_words,
    spectrum,
)
from identification.design.tall_factors import orthonormal
from identification.estimators.instrumental_variables import starting_point
from identification.estimators.instruments import Instruments, explained, source_of
from identification.estimators.method import Estimate, Method, not_settled
from identification.estimators.observer import Observer
from identification.model.noise_model import NoiseModel
from identification.model.stretches import (
    Stretch,
    contracted,
    filtered,
    free_of,
    stretches,
)
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import ExcitationError, InputError
from symheli.progress import tracked
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole

Filter = Callable[[Array], Array]

SIMPLER = 'where the model is simpler than the plant, method "iv" is the better one'
ADVICE = (
    'a plant that is unstable in open loop needs instruments=("name", ...), the external'
    f" excitation; {SIMPLER}"
)
"""Advice where the iteration stops early, with instruments and without."""


@dataclass(frozen=True)
class RefinedInstruments(Method):
    """Refined instrumental variables: the response simulated by the current model serves as
    instruments and sets the filters, repeated until convergence.

    Parameters
    ----------
    instruments : str, sequence of str, or InstrumentSource, optional
        As for `InstrumentalVariables`; in closed loop they are needed, and then the plant may be
        unstable.
    iterations : int
        At most.
    tolerance : float
        The relative change of the coefficients that ends them.
    noise_order : int
        Of an autoregressive model of the output noise of each output; 0 takes it as white.

    Raises
    ------
    InputError
        A number out of range.

    References
    ----------
    Laurain, Toth, Gilson and Garnier (2010), Refined instrumental variable methods for
    identification of LPV Box-Jenkins models, Automatica 46, 959-967.

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.methods.RefinedInstruments(noise_order=1))
    >>> print(found.coefficients.at(0.0).A.round(2), found.details["converged"])
    [[[-0.5]]] True
    """

    instruments: Instruments | None = None
    iterations: int = field(default=40, kw_only=True)
    tolerance: float = field(default=1e-6, kw_only=True)
    noise_order: int = field(default=0, kw_only=True)
    shorthand: ClassVar[str] = "riv"

    def __post_init__(self) -> None:
        if self.instruments is not None:
            source_of(self.instruments)
        whole(self.iterations, "iterations", 1)
        whole(self.noise_order, "noise_order")
        if not self.tolerance > 0:
            raise InputError(f"tolerance: expected a number > 0, got {self.tolerance}")

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with `iterations`, whether they `converged` and the `noise`
        model in the details.
        """
        source = None if self.instruments is None else source_of(self.instruments)
        start, exogenous = starting_point(arx, records, data, source), None
        if source is not None:
            records, exogenous = explained(arx, records, source)
        found = refined_instruments(arx, records, exogenous, start, self)
        return Estimate(
            theta=found.theta,
            details={
                "iterations": found.iterations,
                "converged": found.converged,
                "noise": found.noise.ar.tolist(),
            },
            remarks=() if found.converged else (not_settled(self, SIMPLER if source else ADVICE),),
        )


@dataclass(frozen=True, eq=False)
class Refinement:
    """theta (n_regressors, ny), the autoregressive `noise` of the outputs, and whether the
    iteration `converged`.
    """

    theta: Array
    noise: NoiseModel
    iterations: int
    converged: bool


def refined_instruments(
    arx: LPVARX,
    records: Sequence[FlightRecord],
    exogenous: Sequence[FlightRecord] | None,
    start: Array,
    options: RefinedInstruments,
) -> Refinement:
    """Iterate from theta `start`: simulate, instrument and filter by the current model, solve,
    until convergence.

    With y = x + v, x the noise-free response, A(p) y = B(p) u + A(p) v: filtered by the last
    A(p)^-1 the noise of the equation is v itself, and by the noise model white. The filter A(p)^-1
    moves with p; it is applied to the products of signals and functions of p, which leaves the
    equation linear in the coefficients whatever the basis and however the outputs are coupled. (The
    published method filters by the constant part of A alone and so needs a basis with a constant.)
    Instruments are the same products of the simulated response, so the fixed point is that of the
    simulation error with white noise.

    In closed loop `exogenous` are the records with inputs and outputs replaced by what the external
    excitation explains of them (see `explained`): an observer driven by these takes the place of
    the simulation, and filters, so that the plant may be unstable.

    Raises `ExcitationError` where the first response does not determine every coefficient; where a
    later one does not, the iteration ends with the coefficients before it. Source:
    Laurain, Toth, Gilson and Garnier (2010), Refined instrumental variable methods for
    identification of LPV Box-Jenkins models, Automatica 46, 959-967.
    """
    runs = stretches(arx, records, outputs=True)
    if not runs:
        raise ExcitationError(f"no unbroken stretch of more than {arx.memory} samples to simulate")
    clean = runs if exogenous is None else stretches(arx, exogenous, outputs=True)
    theta, noise, size = (
        start,
        NoiseModel(np.zeros((arx.ny, options.noise_order)), np.zeros((arx.ny, 0))),
        _size([run.target - run.regressors() @ start for run in runs]),
    )
    row, output = free_of(arx)
    for iteration in tracked("refined instruments", range(1, options.iterations + 1)):
        model = contracted(arx, theta, clean) if exogenous is None else theta
        filters = [
            _filter(run.lag_coefficients(model), size, simulate=exogenous is None) for run in runs
        ]
        noise_free = [_response(run, model, by) for run, by in zip(clean, filters, strict=True)]
        errors = [_error(run, model, by) for run, by in zip(runs, filters, strict=True)]
        size, noise = _size(errors), NoiseModel.of(errors, options.noise_order, 0)
        parts = [
            _equations(run, c, by, noise, size)
            for run, c, by in zip(runs, noise_free, filters, strict=True)
        ]
        Z, X, y = (np.concatenate(part) for part in zip(*parts, strict=True))
        found = np.zeros_like(theta)
        try:
            found[row, output] = _instrumented(arx, Z, X, y)
        except ExcitationError:
            if iteration == 1:
                raise
            return Refinement(theta, noise, iteration, False)
        change = np.linalg.norm((found - theta)[row, output] * column_scale(X)) / max(
            np.linalg.norm(y), 1e-300
        )
        theta = found
        if change < options.tolerance:
            return Refinement(theta, noise, iteration, True)
    return Refinement(theta, noise, options.iterations, False)


def _filter(A: Array, size: Array, *, simulate: bool) -> Filter:
    """A(p)^-1, or where it may be unstable what an observer leaves of an equation error (n, ny,
    m).
    """
    if simulate:
        return lambda error: filtered(A, error, np.zeros((A.shape[2], error.shape[2])))
    return Observer.of(A, size).innovations


def _error(run: Stretch, theta: Array, by: Filter) -> Array:
    """Return the residuals of the model's outputs, (n - memory, ny)."""
    return by((run.target - run.regressors() @ theta)[:, :, None])[:, :, 0]


def _response(run: Stretch, theta: Array, by: Filter) -> Stretch:
    """The stretch with what the model explains of the outputs."""
    return run.with_outputs(run.target - _error(run, theta, by))


def _equations(
    run: Stretch, noise_free: Stretch, by: Filter, noise: NoiseModel, size: Array
) -> tuple[Array, ...]:
    """Instruments, regressors (rows, free coefficients) and outputs (rows,) of one stretch,
    filtered and whitened.
    """
    signals = (
        noise_free.spread_out(noise_free.regressors()),
        run.spread_out(run.regressors()),
        run.target[:, :, None],
    )
    return tuple(
        (noise.filtered(by(part))[noise.ar.shape[1] :] / size[None, :, None]).reshape(
            -1, *part.shape[2:][: part.shape[2] > 1]
        )
        for part in signals
    )


def _instrumented(arx: LPVARX, Z: Array, X: Array, y: Array) -> Array:
    """Return b with Z'(y - X b) = 0, by the orthonormal factor of the scaled instruments."""
    scale = column_scale(X)
    Q, _ = orthonormal(Z / column_scale(Z))
    square = Q.T @ (X / scale)
    values, directions = spectrum(square)
    if values[-1] <= RANK_TOLERANCE * values[0]:
        row, output = free_of(arx)
        names = tuple(
            f"{arx.regressor_names[r]} in {arx.outputs[o]}"
            for r, o in zip(row, output, strict=True)
        )
        missing = direction_in_words(directions[-1], names)
        raise ExcitationError(
            f"the simulated response does not determine: {missing}; excite the inputs more richly,"
            " or lower the orders"
        )
    return np.linalg.solve(square, Q.T @ y) / scale


def _size(errors: Sequence[Array]) -> Array:
    size = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0))
    return np.where(size > 0, size, 1.0)
