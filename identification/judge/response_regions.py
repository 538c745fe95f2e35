"""Regions of identified frequency responses, and the bias of a structure in them as the simulator
shows it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from identification.estimators.estimate import bridged_in_flight, fit
from identification.estimators.instruments import FlightSource
from identification.judge.coefficient_covariance import drawn
from identification.judge.frozen_plant import FrozenPlant, Model, Point, tuples, with_covariance
from identification.structure.kinematic_arx import KinematicARX
from identification.structure.lpvarx import LPVARX
from identification.structure.state_space import StateSpace
from symheli import LinearModel
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.sample_period import same_period
from symheli.values.summary import summarized

CERTAIN, AGREES = 1e-12, 1e-9
"""Deviation, as a share of a response, that is rounding alone; difference that is none then."""


@dataclass(frozen=True, eq=False)
class ResponseRegions:
    """Frequency responses with an elliptic region of 95 % for each, in the complex plane.

    Parameters
    ----------
    centre : array (K, w, ny, nu), complex
        Responses of the estimate at points of the scheduling and frequencies.
    covariance : array (K, w, ny, nu, 2, 2)
        Of real and imaginary part.

    Examples
    --------
    >>> from identification.judge.response_regions import ResponseRegions
    >>> one = ResponseRegions(np.ones((1, 1, 1, 1)), np.eye(2)[None, None, None, None])
    >>> one.contains([[[[3.4]]]]).item(), one.contains([[[[3.5]]]]).item()
    (True, False)
    """

    centre: Array
    covariance: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        centre = np.array(self.centre, complex)
        object.__setattr__(self, "centre", centre)
        shape = (*centre.shape, 2, 2)
        object.__setattr__(self, "covariance", frozen(self.covariance, "covariance", shape))

    def contains(self, exact: object) -> Array:
        """Whether each response (K, w, ny, nu) is in its region. What is certain, as that a
        response at frequency 0 is real, must agree to nine digits.

        Raises `InputError` for responses of another shape.
        """
        exact = np.asarray(exact, complex)
        if exact.shape != self.centre.shape:
            raise InputError(f"exact: expected shape {self.centre.shape}, got {exact.shape}")
        away = exact - self.centre
        values, axes = np.linalg.eigh(self.covariance)
        off = np.stack([np.real(away), np.imag(away)], axis=-1)
        along = np.abs(np.sum(axes * off[..., None], axis=-2))
        size = np.maximum(np.abs(self.centre), np.sqrt(np.max(values, axis=-1)))[..., None]
        spread = values > (CERTAIN * size) ** 2
        distance = np.sum(np.where(spread, along**2, 0.0) / np.where(spread, values, 1.0), axis=-1)
        limit = np.array([0.0, *chi2.ppf(0.95, [1, 2])])[np.sum(spread, axis=-1)]
        agrees = np.all(spread | (along <= AGREES * size), axis=-1)
        return np.asarray((distance <= limit) & agrees)

    @property
    def width(self) -> Array:
        """Standard deviation of each response (K, w, ny, nu)."""
        return np.sqrt(np.trace(self.covariance, axis1=-2, axis2=-1))


@dataclass(frozen=True, eq=False)
class StructureBias:
    """A structure as it was identified in a simulator without noise, beside the exact linear models
    there: what they differ by is what the structure leaves out.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        Identified in the simulator.
    exact : mapping of point to LinearModel
        Of the simulator's vehicle, at the period of the model.

    Examples
    --------
    >>> from identification.judge.response_regions import StructureBias
    >>> off = StructureBias(model, {0.0: model.at(0.0)})
    >>> bool(np.abs(off.responses([0.1, 1.0], model.outputs, model.inputs)).max() < 1e-12)
    True
    """

    model: Model
    exact: Mapping[Any, LinearModel]

    __repr__ = summarized

    def __post_init__(self) -> None:
        tuples(self.exact)
        for truth in self.exact.values():
            if not same_period(truth.dt, self.model.dt):
                raise InputError(
                    f"exact: expected linear models sampled every {self.model.dt:g} s, got"
                    f" {truth.dt}; use .discretize(dt)"
                )

    def require(self, points: list[tuple[float, ...]]) -> None:
        """Raise `InputError` unless it is at these points."""
        if tuples(self.exact) != points:
            raise InputError(f"bias: expected one at the points {points}, got {tuples(self.exact)}")

    def responses(
        self, frequencies: object, outputs: Sequence[str], inputs: Sequence[str]
    ) -> Array:
        """What frequency responses are off by, (K, w, ny, nu), at the points of `exact`."""
        plant = FrozenPlant(self.model, tuple(map(str, outputs)), tuple(map(str, inputs)))
        omega, off = frozen(frequencies, "frequencies", (None,)), []
        for p, truth in zip(tuples(self.exact), self.exact.values(), strict=True):
            part = truth.select(inputs=plant.inputs, outputs=plant.outputs)
            off.append(plant.at(*p).frequency_response(omega) - part.frequency_response(omega))
        return np.stack(off)


def response_regions(
    model: Model,
    points: Iterable[Point],
    frequencies: object,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    *,
    bias: StructureBias | None = None,
    draws: int = 120,
    seed: int = 0,
) -> ResponseRegions:
    """Return regions of 95 % of the frequency responses of an identified model with the scheduling
    held, by draws of its coefficients.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        With a covariance.
    points : iterable
        K values of the scheduling: numbers, or tuples of one number a parameter.
    frequencies : array (w,)
        rad/s.
    outputs, inputs : sequence of str, optional
        Only these.
    bias : StructureBias, optional
        From `structure_bias`, at the same points. Of what responses are off by the size counts, the
        phase does not, and zeros do not: half the mean of |bias|^2 over neighbouring points and
        frequencies is added to the variance of both parts.
    draws, seed : int
        Of a normal distribution.

    Returns
    -------
    ResponseRegions
        `.contains(exact)`, `.width`.

    Raises
    ------
    InputError
        No covariance, no points, a bias at other points.

    Examples
    --------
    >>> found = idn.judge.response_regions(model, [-0.5, 0.5], [0.1, 1.0])
    >>> found.centre.shape[:2], bool(found.contains(found.centre).all())
    ((2, 2), True)
    """
    if model.covariance is None:
        raise InputError(f"method {model.method!r} gives no covariance; {with_covariance(model)}")
    plant = _plant(model, outputs, inputs)
    thetas = drawn(model.theta, model.covariance, plant.free, whole(draws, "draws", 3), seed)
    omega, centres, covariances = frozen(frequencies, "frequencies", (None,)), [], []
    chosen = tuples(points)
    for p in chosen:
        own = plant.at(*p).frequency_response(omega)
        spread = np.stack([m.frequency_response(omega) for m in plant.of_each(thetas, *p)]) - own
        parts = np.stack([np.real(spread), np.imag(spread)], axis=-1)
        centres.append(own)
        covariances.append(np.einsum("d...i,d...j->...ij", parts, parts) / len(thetas))
    centre, covariance = np.stack(centres), np.stack(covariances)
    if bias is not None:
        bias.require(chosen)
        off = bias.responses(omega, plant.outputs, plant.inputs)
        power = with_neighbours(with_neighbours(np.abs(off) ** 2, 0), 1)
        covariance += 0.5 * power[..., None, None] * np.eye(2)
    return ResponseRegions(centre, covariance)


def structure_bias(
    model: Model,
    records: FlightRecord | Sequence[FlightRecord],
    simulator: FlightSource,
    exact: Mapping[Any, LinearModel],
) -> StructureBias:
    """Return how far the structure of a model is off on flights like these, as a simulator of known
    linear models shows it: the same flights in the simulator, without noise, identified in the
    same structure by least squares, beside its exact linear models.

    States are identified by their closest free run there. No noise is in it, so that all of it is
    what the structure leaves out of a nonlinear vehicle in these manoeuvres. The simulator may be
    another vehicle: sizes of the bias carry over, phases need not. Rows that a log has lost are
    there as far as the method of the model bridges holes: without them the bias is another one.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        Of the structure.
    records : FlightRecord or sequence of them
        What it was identified from.
    simulator : FlightSource
        `symheli.flight.SimulatedFlight(heli)`.
    exact : mapping of point to LinearModel
        Linear models of the simulator's vehicle at points of the scheduling, sampled at the period
        of the model, with its outputs and inputs.

    Returns
    -------
    StructureBias
        For `response_regions` and `fit_for_control`; `.responses(frequencies, outputs, inputs)`.

    Raises
    ------
    InputError
        Another source, no points, linear models of another period.

    References
    ----------
    Goodwin, Gevers and Ninness (1992), Quantifying the error in estimated transfer functions with
    application to model order selection, IEEE Trans. Automatic Control 37, for undermodelling as
    a random part of the error; its size from a simulator: here.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> ramps = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> flight = symheli.fly(heli, ramps, noise_db=30.0,
    ...     excitation=symheli.Excitation(dict.fromkeys(heli.inputs, 0.01)))
    >>> kin = idn.KinematicARX(heli.inputs, "airspeed_command", nb=1,
    ...     basis=idn.Polynomial(1, 2.0, 6.0))
    >>> wrong = symheli.Helicopter.load("xcell_kahn_hudson", governor="ideal")
    >>> there = {4.0: symheli.linearize(wrong, airspeed=4.0).discretize(0.02)}
    >>> simulator = symheli.flight.SimulatedFlight(wrong)
    >>> off = idn.judge.structure_bias(idn.fit(kin, flight), flight, simulator, there)
    >>> off.responses([1.0, 5.0], ["p"], ["d_lat"]).shape
    (1, 2, 1, 1)
    """
    if not isinstance(simulator, FlightSource):
        raise InputError(
            "simulator: expected a source of flights such as SimulatedFlight(heli), got"
            f" {simulator!r:.80}"
        )
    given = [records] if isinstance(records, FlightRecord) else list(records)
    if isinstance(model.structure, KinematicARX):
        given = [bridged_in_flight(record, model.method, simulator) for record in given]
    own = fit(_in_time(model.structure), [simulator.flown(record) for record in given])
    return StructureBias(own, exact)  # type: ignore[arg-type]


def _in_time(structure: LPVARX | KinematicARX | StateSpace) -> LPVARX | KinematicARX | StateSpace:
    """The structure for a simulated flight, whose sensors are not late."""
    return replace(structure, sensors=None) if isinstance(structure, KinematicARX) else structure


def with_neighbours(values: Array, axis: int) -> Array:
    """The mean of each of three neighbours along an axis, ends twice."""
    ends = [(1, 1) if i == axis else (0, 0) for i in range(values.ndim)]
    wide = np.moveaxis(np.pad(values, ends, mode="edge"), axis, 0)
    return np.moveaxis((wide[:-2] + wide[1:-1] + wide[2:]) / 3.0, 0, axis)


def _plant(
    model: Model, outputs: Sequence[str] | None, inputs: Sequence[str] | None
) -> FrozenPlant:
    y = tuple(map(str, model.outputs)) if outputs is None else tuple(outputs)
    u = tuple(map(str, model.inputs)) if inputs is None else tuple(inputs)
    return FrozenPlant(model, y, u)
