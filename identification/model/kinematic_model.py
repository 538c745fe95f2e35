"""An identified rigid vehicle: known kinematics around identified aerodynamics."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.model import kinematic_run
from identification.model.excited_directions import excited_directions
from identification.model.flown_in import sentence
from identification.model.kinematic_realization import Realization
from identification.model.kinematic_run import Run
from identification.model.lpvarx_model import LPVARXModel
from identification.model.prediction import named_fit, require_horizon
from identification.model.realization import held_value
from identification.structure.actuators import bare
from identification.structure.kinematic_arx import MOVING, STATES, KinematicARX
from symheli import LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.kinematics import RIGID_BODY
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    import xarray

    from identification.model.kinematic_observer import KinematicObserver


@dataclass(frozen=True, eq=False, kw_only=True)
class KinematicModel:
    """A `KinematicARX` with its coefficients, as `fit` returns it.

    Parameters
    ----------
    structure : KinematicARX
        Signals, lags, basis.
    aerodynamics : LPVARXModel
        The regression: coefficients, their covariance, that of the residuals, what the method
        said.
    trim : array (basis size, 8)
        u v w p q r phi theta at steady p, as functions of p: the mean of the records there. What
        the kinematics are linearized about in `at` and `to_state_space`, and nothing else.
    drive : LPVARXModel, optional
        The regression of the rotor's speed, where the structure has it.

    Raises
    ------
    InputError
        Shapes, or a regression, that are not those of the structure.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> flight = symheli.fly(heli, plan, excitation=excitation)
    >>> kin = idn.KinematicARX(
    ...     heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> model = idn.fit(kin, flight)
    >>> model.predict(flight, horizon=25).shape[1], bool(model.score(flight, 25)["p"] > 90)
    (8, True)
    """

    structure: KinematicARX
    aerodynamics: LPVARXModel
    trim: Array
    drive: LPVARXModel | None = None

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        size = self.structure.basis.size
        object.__setattr__(self, "trim", frozen(self.trim, "trim", (size, len(STATES))))
        if self.aerodynamics.structure != self.structure.aerodynamics:
            raise InputError("aerodynamics: another regression than that of the structure")
        if (self.drive and self.drive.structure) != self.structure.drive:
            raise InputError("drive: another regression than that of the structure")

    # --- what it is ------------------------------------------------------------------------------

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """u v w p q r phi theta."""
        return RIGID_BODY

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """The controls, or their commands where actuators follow them."""
        return tuple(
            Signal(name, behind.unit)
            for name, behind in zip(self.structure.inputs, self._regressed, strict=True)
        )

    @property
    def _regressed(self) -> tuple[Signal, ...]:
        """The inputs of the regression: the controls, or the mean deflections behind actuators."""
        first = len(MOVING)
        return self.aerodynamics.inputs[first : first + len(self.structure.inputs)]

    @property
    def parameters(self) -> tuple[Signal, ...]:
        """The scheduling parameters, also where there is one."""
        return self.aerodynamics.parameters

    @property
    def dt(self) -> float:
        """Sample period, s."""
        return self.aerodynamics.dt

    @property
    def theta(self) -> Array:
        """Coefficients (n_regressors, 6)."""
        return self.aerodynamics.theta

    @property
    def covariance(self) -> Array | None:
        """Covariance of all coefficients (6, n, 6, n), (equation, regressor, equation, regressor),
        as of `LPVARXModel`; None where the method gives none.
        """
        return self.aerodynamics.covariance

    @property
    def method(self) -> str:
        """Name of the estimation method."""
        return self.aerodynamics.method

    @property
    def least_squares(self) -> bool:
        """Whether it was fitted by least squares alone."""
        return bool(self.aerodynamics.least_squares)

    @property
    def details(self) -> Any:
        """Details of the estimation method."""
        return self.aerodynamics.details

    # --- predictions along a record --------------------------------------------------------------

    def predict(self, record: FlightRecord, horizon: int) -> Array:
        """Predictions (n, 8) `horizon` samples ahead: states known up to t - horizon, inputs and p
        up to t.

        Each step solves the trapezoidal rule by two corrections. NaN where a past is incomplete,
        infinite where a prediction overflows or pitch passes 90 deg. Raises `InputError` for
        another sample period or unit.
        """
        require_horizon(horizon)
        return kinematic_run.predict(self._along(record), int(horizon))

    def simulate(self, record: FlightRecord) -> Array:
        """Free run (n, 8) from the first samples of each segment with the record's inputs and p.

        In open loop: a plant that is unstable there leaves the record whatever the model is worth;
        see `closed_loop`.
        """
        return kinematic_run.simulate(self._along(record))

    def closed_loop(self, record: FlightRecord, controller: Any = None) -> Array:
        """The model flown in the loop of the record, (n, 8): same controller, reference and
        excitation.

        `controller` is a `symheli.flight.PureController` or `symheli.flight.StatefulController`;
        default that of the record's plan. From the first samples of each segment on nothing
        measured is used.
        Raises `InputError` for a record without references, or without a controller.
        """
        self.structure.require_plain("a run in the recorded loop")
        return kinematic_run.closed_loop(
            self._along(record), self.structure.inputs, record, controller
        )

    def with_theta(self, theta: Array) -> KinematicModel:
        """The same with other coefficients (n, 6), whose covariance is not known."""
        return replace(self, aerodynamics=self.aerodynamics.with_theta(theta))

    def score(self, record: FlightRecord, horizon: int | None = None) -> NamedVector:
        """Fit of each state in percent, `horizon` samples ahead or with None in free run; see
        `fit_percent`.
        """
        guess = self.simulate(record) if horizon is None else self.predict(record, horizon)
        return named_fit(self.outputs, record, guess)

    def states(self, record: FlightRecord) -> Array:
        """States (n, nx) of the whole `to_state_space` along a record, as measured: y(k), and what
        is remembered of earlier samples; NaN where a past is missing.

        They are not deviations: take a trim away for that.
        """
        run = self._along(record)
        return self.realization.remembered(run.y, run.u, run.segments)

    def observer(
        self,
        noise: Mapping[str, float],
        process: Mapping[str, float] | float | None = None,
    ) -> KinematicObserver:
        """The states in flight from noisy measurements: an extended Kalman filter.

        Parameters
        ----------
        noise : mapping of str to float
            Standard deviation of the sensor of each of u v w p q r phi theta, in its unit.
        process : mapping of str to float, or float, optional
            Standard deviation of what one sample adds to each of u v w p q r beyond the model (m/s,
            rad/s); default what `FilterError` found.

        Raises
        ------
        UnknownNameError
            Another name.
        InputError
            A name without a number, one that is not positive, or no `process` where the method
            found none.
        """
        from identification.model.kinematic_observer import KinematicObserver, deviations

        self.structure.require_plain("an observer")
        found = self.details.get("process_noise") if process is None else process
        if found is None:
            raise InputError(
                "process: give the standard deviation of what gusts and model errors add in a"
                f' sample; the method "{self.method}" has not found it, "filter error" does'
            )
        return KinematicObserver(
            self,
            deviations(noise, STATES, "sensor in noise"),
            deviations(found, MOVING, "velocity in process"),
        )

    # --- for design ------------------------------------------------------------------------------

    @cached_property
    def realization(self) -> Realization:
        """The state-space form from deflections: states, matrices at any p."""
        kin, rotor = self.structure, self.aerodynamics.inputs[len(MOVING) + len(self._regressed) :]
        theta = np.hstack([self.theta, self.drive.theta]) if self.drive else self.theta
        return Realization.of(kin, theta, self.trim, self.inputs, self.dt, rotor)

    def _actuators(self, inputs: Sequence[str] | None) -> dict[str, LinearModel]:
        """Actuators before each of the inputs that stay."""
        if self.structure.actuators is None:
            return {}
        kept = [u for u in self.inputs if inputs is None or u in inputs]
        return self.structure.actuators.sampled({bare(u): u for u in kept}, self.dt)

    def at(
        self,
        *p: float,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> LinearModel:
        """The discrete model with the scheduling held at p (one number a parameter), linear about
        the trim there: deviation dynamics.

        With `outputs` and `inputs` only these, as `to_state_space` keeps them.
        """
        model = self.realization.at(held_value(p, self.structure.basis), outputs, inputs)
        return model.driven_by(parts) if (parts := self._actuators(inputs)) else model

    def to_state_space(
        self,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        *,
        held: Mapping[str, float] | None = None,
        degree: int | None = None,
    ) -> LPVStateSpace:
        """The discrete LPV model of deviations from the moving trim, its kinematic rows known
        numbers.

        x(k+1) = A(p) x(k) + B(p) u(k) with p that of the sample the step leads to.

        Parameters
        ----------
        outputs, inputs : sequence of str, optional
            Only these; the influence of the other states is left out, as `LinearFamily.select`
            leaves it out.
        held : mapping of str to float, optional
            Parameters that stay where they are: {"acceleration_command": 0.0}.
        degree : int, optional
            Of the polynomials in each parameter; default the least at which no entry is 1e-9 of
            the largest off. What is off stands in `.residuals`.

        Returns
        -------
        LPVStateSpace
            Rates unlimited: see `.with_rate`.

        Raises
        ------
        UnknownNameError
            A signal or a parameter that the model does not have.
        InputError
            A basis that is not polynomial, or nothing that moves.
        """
        model = self.realization.lpv(self.parameters, outputs, inputs, held or {}, degree)
        return model.driven_by(parts) if (parts := self._actuators(inputs)) else model

    def uncertain(
        self,
        probability: float = 0.95,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        *,
        held: Mapping[str, float] | None = None,
        degree: int | None = None,
        draws: int = 0,
        other: KinematicModel | None = None,
        head_wind: tuple[float, float] = (0.0, 0.0),
        tight_for: UncertainStateSpace | None = None,
    ) -> UncertainStateSpace:
        """Return `to_state_space` with every model of an ellipsoid of coefficients: the set for
        which a certificate must hold to hold for the vehicle.

        The ellipsoid covers the estimated covariance, with the offsets and what `outputs` and
        `inputs` leave out as they may be; kinematic rows are known numbers and carry no
        uncertainty. One full block: d = Delta v, |Delta|_2 <= bound.

        With an `other` model the set has, equation by equation, what lies between the two: the
        vehicle with another mass, say. With a `head_wind` the velocity over ground in the kinematic
        rows is less than the one through the air by any number in that range; the scheduling
        parameter stays the airspeed, of flights in still air. Each is a block of its own beside
        that of the coefficients, and what is proven holds too where they move.

        Parameters
        ----------
        probability : float
            Of the ellipsoid, for Gaussian errors with the estimated covariance.
        outputs, inputs, held, degree
            As of `to_state_space`.
        draws : int
            0: a proven radius; else that of so many draws, see `matrix_ellipsoid`.
        other : KinematicModel, optional
            Of the same structure and sample period, from flights of the vehicle in another state.
        head_wind : (float, float)
            Least and largest steady wind along the heading, m/s; from behind where negative.
        tight_for : UncertainStateSpace, optional
            A loop closed around what the same call without it returns: the ellipsoid becomes tight
            where this loop excites errors of the coefficients, at the same probability.

        Returns
        -------
        UncertainStateSpace
            Its `source` says what the probability is of.

        Raises
        ------
        InputError
            The method gave no covariance, or is least squares, whose covariance says nothing of
            the bias by noise in the regressors: fit by `FilterError`.

        References
        ----------
        Barenthin and Hjalmarsson (2008), Identification and control: joint input design and H-inf
        state feedback with ellipsoidal parametric uncertainty via LMIs, Automatica 44, for
        ellipsoids of coefficients in LMIs.
        """
        ends = [self] if other is None else [self, other]
        for end in ends:
            end._require_a_set(self)
        low, high = (float(w) for w in head_wind)
        if not -np.inf < low <= high < np.inf:
            raise InputError(
                f"head_wind: expected (least, largest) in m/s, such as (-2.0, 2.0), got {head_wind}"
            )
        middle, apart = replace(self.realization, head_wind=0.5 * (low + high)), None
        if other is not None:
            apart = 0.5 * (other.theta - self.theta)
            middle = replace(middle, theta=self.theta + apart, trim=0.5 * (self.trim + other.trim))
        block, ellipsoid = middle.uncertain_part(
            self.parameters,
            outputs,
            inputs,
            held or {},
            [end.covariance for end in ends if end.covariance is not None],
            probability,
            draws,
            apart,
            0.5 * (high - low),
            None if tight_for is None else excited_directions(tight_for),
        )
        model = middle.lpv(self.parameters, outputs, inputs, held or {}, degree, block)
        between = ", between two such in each equation," if other is not None else ""
        return UncertainStateSpace(
            model,
            block.perturbations,
            block.excited,
            bound=ellipsoid.bound,
            probability=probability,
            source=(
                f"the coefficients identified by {self.method!r}{between} lie within this bound"
                f" with probability {probability:g} if their errors are Gaussian with the estimated"
                " covariance; that the vehicle is of this structure is assumed;"
                f" {sentence([end.details for end in ends], (low, high))}"
            ),
            parts=block.parts,
        )

    def _require_a_set(self, first: KinematicModel) -> None:
        """Raises `InputError` for a model without a covariance that holds, of another structure
        than `first`, or with more than the vehicle in it.
        """
        if self.covariance is None or self.least_squares:
            raise InputError(
                f"method {self.method!r} gives no covariance that holds for noise in the"
                " regressors: fit by FilterError(SimulatedFlight(...))"
            )
        self.structure.require_plain("a set of models")
        if self.structure != first.structure or self.dt != first.dt:
            raise InputError(
                "other: expected a model of the same structure and sample period; identify both"
                " with one KinematicARX"
            )

    # --- files -----------------------------------------------------------------------------------

    def to_frame(self) -> pandas.DataFrame:
        """The coefficients: a row a regressor, a column an output; the units of the outputs in
        attrs["units"], those of the regressors in attrs["regressor_units"]. Raises `InputError`
        without pandas.
        """
        from identification.model.labelled_coefficients import coefficients_frame

        return coefficients_frame(self.aerodynamics)

    def to_xarray(self) -> xarray.Dataset:
        """The coefficients `theta` over "regressor" and "output", each with its units; the basis is
        an attribute. Raises `InputError` without xarray.
        """
        from identification.model.labelled_coefficients import coefficients_dataset

        return coefficients_dataset(self.aerodynamics)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model as JSON, every number exact, at once or not at all; see `load`."""
        from identification.model import saved_kinematic_model

        return saved_kinematic_model.save(self, path)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], basis: FunctionSpace | None = None
    ) -> KinematicModel:
        """A saved model, equal to the last bit; one with `UserFunctions` needs its `basis`. Raises
        `InputError` for any other file.
        """
        from identification.model import saved_kinematic_model

        return saved_kinematic_model.load(path, basis)

    def save_mat(self, path: str | os.PathLike[str]) -> Path:
        """Write coefficients, trim, names and units as a MATLAB file (version 5), with a readme
        inside.
        """
        from identification.model import saved_kinematic_model

        return saved_kinematic_model.save_mat(self, path)

    def _along(self, record: FlightRecord) -> Run:
        prepared = self.structure.aerodynamics.prepared(record)
        self.aerodynamics.require_same_kind(prepared)
        return Run.along(self.structure, self.theta, prepared)
