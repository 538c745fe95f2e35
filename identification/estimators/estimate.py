"""Estimation of a model from records, by the chosen method."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import overload

import numpy as np

from identification.design.excitation import excitation_of
from identification.design.leakage import warn_of_leakage
from identification.estimators.filter_error import FilterError
from identification.estimators.instrumental_variables import InstrumentalVariables
from identification.estimators.instruments import FlightSource
from identification.estimators.least_squares import residual_covariance
from identification.estimators.method import Method, exported_methods, method_of
from identification.estimators.prediction_error import BoxJenkins
from identification.estimators.refined_instruments import RefinedInstruments
from identification.estimators.state_space_search import state_space_of
from identification.model.flown_in import flown_in
from identification.model.kinematic_fit import mean_trim
from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from identification.model.state_space_model import StateSpaceModel
from identification.structure.kinematic_arx import STATES, KinematicARX
from identification.structure.lpvarx import LPVARX, require_structure
from identification.structure.regressors import as_records, stacked, units_of
from identification.structure.state_space import StateSpace
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.records.mending import BRIDGED, bridged

IN_FLIGHT = {FilterError.shorthand: 0.5, InstrumentalVariables.shorthand: BRIDGED}
"""Longest hole that a simulated flight bridges, s, by method. Instruments alone take what is
bridged for measured: holes of half a second then cost more than the rows do. Chosen on the seeds
1000 to 1011 of the study's flights, 5 % of their rows lost; .07 to .21 s differ little.
"""

SLOW = 0.6
"""Share of the samples below which a sensor is slower than the others."""


@overload
def fit(
    structure: KinematicARX,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method | str = "ls",
) -> KinematicModel: ...


@overload
def fit(
    structure: StateSpace,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method | str = "oe",
) -> StateSpaceModel: ...


@overload
def fit(
    structure: LPVARX,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method | str = "ls",
) -> LPVARXModel: ...


def fit(
    structure: LPVARX | KinematicARX | StateSpace,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method | str | None = None,
) -> LPVARXModel | KinematicModel | StateSpaceModel:
    """Identify the coefficients of a structure from one record or several.

    Parameters
    ----------
    structure : LPVARX, KinematicARX or StateSpace
        Signals, orders, delays and the basis in the scheduling parameters; with known kinematics
        only the aerodynamics are fitted, states by the closest free run.
    records : FlightRecord or iterable of FlightRecord
        Of one sample period and in the same units; lags never reach across a gap or from one record
        into the next.
    method : Method or str, optional
        An estimator with its options, or the shorthand of one with its defaults: "ls"; of a
        `StateSpace` "oe", where only "innovations" and "subspace" do besides. Any subclass of
        `Method` will do. Those of `identification.methods`, of which noise on the outputs
        biases all of least squares:

    Returns
    -------
    LPVARXModel, KinematicModel of a KinematicARX, StateSpaceModel of a StateSpace
        Its `method` is the shorthand, its `excitation` the report on the data, its `details` what
        the method chose (weights, iterations, strength of the instruments), its `covariance`
        (ny, n, ny, n) that of all coefficients together as far as the method knows it:

        - "ls", and "rls" that forgets nothing: the covariance of the residuals (x) (phi' phi)^-1.
          It holds for residuals that are white and regressors without noise; modelling errors
          colour residuals, see `uncertainty`, and noise on the outputs biases the coefficients, of
          which it says nothing;
        - "iv" flown in a simulator, all equations with the same regressors, and `FilterError`:
          summed over residuals correlated in time, up to 25 samples, and between equations; for
          records that are long against that;
        - of states (1, n, 1, n), of all entries, along the directions that change the response: for
          white innovations, or for residuals of a free run correlated up to 25 samples; not
          "subspace";
        - of all others None: prices on coefficients move them by more than they scatter.

    Raises
    ------
    ExcitationError
        The data (for ridge and lasso: with the penalty) do not determine every coefficient; carries
        the report.
    UnknownNameError
        A signal the records lack, or an unknown shorthand.
    InputError
        The scheduling parameter leaves the range of the basis, records differ in sample period or
        units, or a delay or a bandwidth is to be estimated by another method than `FilterError`.
    AccuracyError
        A residual of "ls" or "rls" is not orthogonal to every regressor.

    Warns
    -----
    ConvergenceWarning
        An iteration does not settle.
    DataWarning
        Of states: an output stands far from zero without an offset, or the records do not tell all
        of the matrices. Else: the scheduling signal contains the outputs that the model is to
        predict, samples are means and the delay is not 0, or instruments are weak.

    See Also
    --------
    identification.LPVARX : a difference equation over parameters
    identification.scores : one step ahead to free run
    identification.excitation_report : whether data determine the coefficients

    References
    ----------
    Bamieh and Giarre (2002), Identification of linear parameter varying models, Int. J. Robust and
    Nonlinear Control 12.

    Examples
    --------
    The coefficient of y(k-1) at p = 0 is -0.5:

    >>> found = idn.fit(arx, record, method=idn.methods.Ridge(weight=1e-6))
    >>> print(found.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """
    if isinstance(structure, StateSpace):
        return state_space_of(structure, as_records(records), method_of(method or "oe"))
    method = method_of(method or "ls")
    if isinstance(structure, KinematicARX):
        return _rigid(structure, as_records(records), method)
    return _fitted(structure, records, method)


def _with_methods(text: str | None) -> str:
    """Return the docstring of `fit` with the estimators that the package has."""
    lines = [
        textwrap.fill(
            f'- `{method.__name__}`, "{method.shorthand}": {_first(method)}',
            width=100,
            initial_indent=8 * " ",
            subsequent_indent=10 * " ",
        )
        for method in exported_methods()
    ]
    before, all_of, after = (text or "").partition("biases all of least squares:\n")
    return "\n".join([before + all_of, *lines, after])


def _first(method: type[Method]) -> str:
    """Return the first paragraph of its docstring."""
    return " ".join((method.__doc__ or "").partition("\n\n")[0].split())


fit.__doc__ = _with_methods(fit.__doc__)


def _rigid(
    structure: KinematicARX, records: tuple[FlightRecord, ...], method: Method
) -> KinematicModel:
    """The model of a rigid vehicle; with its parts (actuators, wind, sensors) as they
    were found. The
    equation of a rotor's speed is fitted by least squares: a governed speed is measured well.
    """
    parts = structure.aerodynamics.parts
    unknown = [f"{n} of the {name}" for name, part in parts.items() for n in part.unknown]
    if unknown and not isinstance(method, FilterError):
        raise InputError(
            f"{', '.join(unknown)}: estimated by FilterError(...) only; give deviations of 0 for"
            f" method {method.shorthand!r}"
        )
    if isinstance(method, RefinedInstruments | BoxJenkins):
        raise InputError(
            f"method {method.shorthand!r} simulates lagged outputs; a KinematicARX has none: its"
            " equations give increments; take FilterError(...), or InstrumentalVariables(...)"
        )
    records = tuple(_complete(record, method) for record in records)
    aerodynamics = _fitted(structure.aerodynamics, records, method)
    if unknown:
        known = {n: p.settled(aerodynamics.details.get(n, {})) for n, p in parts.items()}
        structure = replace(structure, **known)
        aerodynamics = replace(aerodynamics, structure=structure.aerodynamics)
    flown = {"flown_in": flown_in(records)}
    aerodynamics = replace(aerodynamics, details={**aerodynamics.details, **flown})
    drive = structure.drive
    return KinematicModel(
        structure=structure,
        aerodynamics=aerodynamics,
        trim=mean_trim(structure, records),
        drive=None if drive is None else _fitted(drive, records, "ls"),
    )


def _complete(record: FlightRecord, method: Method) -> FlightRecord:
    """The record with its short holes bridged: by the flight of the method's simulator where it
    has one, else those between the values of a slower sensor alone.
    """
    if isinstance(method, FilterError):
        return bridged_in_flight(record, method.shorthand, method.simulator)
    if isinstance(method, InstrumentalVariables) and isinstance(method.instruments, FlightSource):
        return bridged_in_flight(record, method.shorthand, method.instruments)
    there = np.isfinite(record.columns(STATES)).mean(axis=0)
    return bridged(
        record, [name for name, share in zip(STATES, there, strict=True) if share < SLOW]
    )


def bridged_in_flight(record: FlightRecord, method: str, simulator: FlightSource) -> FlightRecord:
    """The record with lost rows there again, and samples of any signal, in holes as long as a
    method bridges by the simulator's flight (`IN_FLIGHT`).
    """
    longest = IN_FLIGHT.get(method)
    return record if longest is None else bridged(record, STATES, longest, simulator.flown)


def _fitted(
    structure: LPVARX,
    records: FlightRecord | Iterable[FlightRecord],
    method: Method | str,
) -> LPVARXModel:
    """The model of a regression."""
    require_structure(structure)
    method = method_of(method)
    records = tuple(structure.prepared(record) for record in as_records(records))
    outputs, inputs = units_of(structure.outputs, records), units_of(structure.inputs, records)
    scheduling = units_of(structure.parameters, records)
    warn_of_leakage(structure, records)
    data = stacked(structure, records)
    report = excitation_of(structure, data)
    if method.needs_excitation or len(data.phi) == 0:
        report.require()
    found = method.estimate(structure, records, data)
    for remark in found.remarks:
        warnings.warn(remark, stacklevel=3)
    residual = found.residual_covariance
    if residual is None:
        residual = residual_covariance(structure, data.y - data.phi @ found.theta)
    return LPVARXModel(
        structure=structure,
        theta=found.theta,
        dt=records[0].dt,
        outputs=outputs,
        inputs=inputs,
        scheduling=scheduling,
        residual_covariance=residual,
        rows_used=len(data.phi),
        rows_dropped=data.dropped,
        method=method.shorthand,
        least_squares=method.least_squares,
        excitation=report,
        details=found.details,
        covariance=found.covariance,
        noise=found.noise,
    )
