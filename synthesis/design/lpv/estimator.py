"""Gain-scheduled estimation: an observer of the performance from the measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli import LPVStateSpace
from symheli.lpv.matrix_function import MatrixFunction, block, in_one_basis
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.rates import Rate, limits
from synthesis.design.loops.controller import until_promised
from synthesis.design.lpv.existence import Existence, Solution, imposed_at
from synthesis.design.lpv.fitted import Fitted
from synthesis.design.lpv.frozen_stability import frozen_stability
from synthesis.design.lpv.output_feedback import USUAL
from synthesis.design.lpv.recovery import control_gain, state_gain
from synthesis.design.lpv.scaled_plant import ScaledPlant, depends
from synthesis.design.lpv.search import BACK_OFF, Gains, best, settled
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import failed, least_ranks, levels_above
from synthesis.numerics.program.bases import Bases, Dependence, dependence


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimator:
    """x^' = A x^ + B2 u + L (y - C2 x^ - D22 u), z^ = C1 x^ + D12 u, of a plant.

    Attributes
    ----------
    model : LPVStateSpace
        From measurements and controls to `<performance>_estimate`.
    error : LPVStateSpace
        From the disturbances to the performance minus its estimate.
    promised : float
        What its synthesis promised; `certify` proves.
    misfit : float
        Of the functions of p to the gains that were computed, relative.
    attempts : tuple of Attempt
        Every program that was solved.

    Examples
    --------
    >>> made = synthesis.estimator(plant)
    >>> print(made.model.inputs, made.model.outputs)
    ('y', 'u') ('z_x_estimate', 'z_u_estimate')
    """

    model: LPVStateSpace
    error: LPVStateSpace
    promised: float
    misfit: float
    attempts: tuple[Attempt, ...] = ()

    __repr__ = summarized
    _repr_html_ = as_table

    def certify(self, rate: Any = None, **options: Any) -> Certificate:
        """Certify the gain of the error with `synthesis.l2_gain`; its work ends as that of
        `Controller.certify`.
        """
        from synthesis.certify.questions.questions import l2_gain

        options.setdefault("effort", until_promised(self.promised))
        return l2_gain(self.error, rate, **options)


@with_one_thread
def estimator(
    plant: Plant,
    rate: Rate = None,
    *,
    X: Dependence | None = None,
    back_off: float | Sequence[float] = BACK_OFF,
    divisions: int = 1,
    impose: Grid | None = None,
) -> Estimator:
    """Design an observer whose error has the least L2 gain, for every p(t) within its range and
    rates. It returns an `Estimator`: an observer commands nothing.

    The plant may be unstable: what is estimated is seen through the error alone. L needs no rate
    of p.

    Parameters
    ----------
    plant : Plant
        Its performance is estimated from its measurements; its controls, if any, are known.
        Every measurement must be disturbed (D21 of full row rank).
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the plant's own; math.inf: p may jump.
    X : int, tuple or FunctionSpace, optional
        Degree of the storage function in every parameter, one each, or functions; in discrete time
        constant while p moves.
    back_off : float or sequence
        Multiples of the least gamma at which X is settled, tried in turn.
    divisions : int
        In so many parts every range is cut where the inequalities are imposed.
    impose : Grid, optional
        As in `output_feedback`: at these points and nowhere else.

    Returns
    -------
    Estimator
        With its model and that of its error.

    Raises
    ------
    InputError, SynthesisError
        As `output_feedback`.

    See Also
    --------
    synthesis.output_feedback : a controller of the order of the plant
    synthesis.lqg : the regulator on a Kalman filter

    References
    ----------
    The dual of Wu, Yang, Packard and Becker (1996), theorem 4.1.

    Examples
    --------
    >>> made = synthesis.estimator(plant)
    >>> proof = made.certify(search=None)
    >>> proof.verified, bool(proof.gamma <= made.promised)
    (True, True)
    """
    require_plant(plant)
    parameters = limits(plant.parameters, rate)
    plant = plant.with_scheduling(parameters)
    least_ranks(plant, controls=False)
    attempts: list[Attempt] = []
    matters, still = depends(plant), plant.dt is not None

    def every(degree: int) -> list[Bases]:
        return [Bases(dependence(X, parameters, "X", matters, degree, still=still), None)]

    start = best(plant, every, imposed_at(divisions, impose), USUAL, attempts)
    factors = levels_above(back_off)
    for design in settled(start, factors, _recover, USUAL, attempts, _error):
        model, error = _observer(plant, design.scaled, design.fit)
        if frozen_stability(error).stable is not False:
            return Estimator(
                model=model,
                error=error,
                promised=design.gamma,
                misfit=design.fit.misfit,
                attempts=tuple(attempts),
            )
    raise failed(plant, attempts)


def _recover(scaled: ScaledPlant, existence: Existence, found: Solution) -> Gains:
    X = existence.X
    assert X is not None  # noqa: S101

    def gains(p: Array) -> Array:
        """L (K, n, ny)."""
        at, x = scaled.at(p).dual, X.at(found.coefficients, p)
        if scaled.dt is not None:
            F = state_gain(at, x, x, found.gamma)
        else:
            nothing = np.zeros((len(p), at.B2.shape[-1], at.D21.shape[-2]))
            F = control_gain(at, x, nothing, found.gamma) @ np.linalg.inv(x)
        return -np.swapaxes(F, 1, 2)

    return gains


def _error(scaled: ScaledPlant, gains: Gains, p: Array) -> tuple[Array, ...]:
    """Return the system from disturbances to the error of the estimate."""
    at, L = scaled.at(p), gains(p)
    return at.A - L @ at.C2, at.B1 - L @ at.D21, at.C1, at.D11


def _observer(plant: Plant, c: ScaledPlant, fit: Fitted) -> tuple[LPVStateSpace, LPVStateSpace]:
    """Return the observer and its error system."""
    rows, columns = c.right / math.sqrt(c.time), c.measurements
    basis, coefficients = fit.basis, rows @ fit.coefficients * columns
    at: Any = plant.functions()
    box = plant.nominal.box
    L = MatrixFunction(basis, -coefficients, box)
    zero = MatrixFunction.constant(np.zeros((at.C1.shape[0], at.C2.shape[0])), box)
    A = at.A + L @ at.C2
    minus = MatrixFunction(basis, coefficients, box)
    estimates = tuple(Signal(f"{z}_estimate", z.unit) for z in plant.performance)
    known = (*plant.measurements, *plant.controls)
    into = block(((minus, at.B2 + L @ at.D22),))
    observer = _model(plant, (A, into, at.C1, block(((zero, at.D12),))), known, estimates)
    error = _model(
        plant, (A, at.B1 + L @ at.D21, at.C1, at.D11), plant.disturbances, plant.performance
    )
    return observer, error


def _model(
    plant: Plant, functions: Sequence[MatrixFunction], inputs: Any, outputs: Any
) -> LPVStateSpace:
    basis, (A, B, C, D) = in_one_basis(list(functions), plant.basis.ranges)
    return LPVStateSpace(
        basis, A, B, C, D, plant.parameters, plant.states, inputs, outputs, plant.dt
    )
