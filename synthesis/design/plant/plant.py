"""The design plant: a model with named disturbances, performance, controls and measurements, and
the systems between it and the controller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import connect
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.delay import delay_of
from symheli.lpv.in_series import Part
from symheli.lpv.linear_model import is_control_system
from symheli.lpv.lower_feedback import Partition, Positions
from symheli.lpv.matrix_function import functions_of
from symheli.lpv.mixing import ERROR, itself, mixed
from symheli.lpv.scheduling import Rates
from symheli.lpv.tools import Actuation, lagged, lower_feedback
from symheli.values.html_table import as_table
from symheli.values.numbers import by_name, positive
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized
from symheli.values.units import per_second
from synthesis.design.plant import parts
from synthesis.design.plant.as_controller import as_controller
from synthesis.design.plant.generalized import Channels, Generalized
from synthesis.design.plant.parts import (
    DISTURBANCE,
    Model,
    disturbed,
    new_name,
    on,
    passing,
    with_row,
)

TRUE, WEIGHTED = "true_", "weighted_"
"""Prefixes of a performance signal that is also measured: without the noise and filter of the
measurement, and with a weight.
"""
RATIONAL = (
    "the plant is an LFT: synthesis.structured tunes gains for it, and of the LFT itself"
    " synthesis.robust.mu_synthesis designs for constant parameters, synthesis.designs.lft_feedback"
    " for those that jump"
)
BEFORE = (
    "the plant is an LFT: connect weights, servos, delays, and outputs that equal inputs, to the"
    " model first with symheli.lpv.connect"
)


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant is the model that a controller is designed for, with disturbances, controls,
    performance and measurements.

    dx/dt = A x + B1 w + B2 u, z = C1 x + D11 w + D12 u, y = C2 x + D21 w + D22 u; or sampled.

    w are the disturbances, u the controls, z the performance and y the measurements; all matrices
    are functions of the scheduling parameters. Each method gives a new plant; in the order of the
    calls the parts come to stand between the model and the controller. States come (model, parts in
    order of the calls).

    Parameters
    ----------
    model : LPVStateSpace, UncertainStateSpace, LFT, LinearModel or a system of python-control
        What does not depend on a parameter becomes a model over one called "constant". An LFT is
        for `synthesis.structured` alone, with its parameters constant. Afterwards `model` has the
        inputs (disturbances, controls) and the outputs (performance, measurements that are not
        among those), then the channels of an uncertain one's block.
    disturbances, controls : sequence of str
        Inputs of the model, none in both.
    performance : sequence of str
        Outputs of the model; or disturbances and controls, which then are performance as they are:
        of a control behind a servo or a delay that is the command.
    measurements : sequence of str
        Outputs of the model. A signal may be performance too.

    Raises
    ------
    InputError
        A model of another kind, an input that is disturbance and control, a name that repeats.
    UnknownNameError
        A signal that the model does not have.

    See Also
    --------
    synthesis.output_feedback : a controller of the order of the plant
    synthesis.Controller : what a design returns
    symheli.LPVStateSpace : matrices as functions of parameters

    Examples
    --------
    >>> import numpy as np, symheli, synthesis
    >>> roll = symheli.LinearModel(
    ...     [[-8.0, 0.0], [1.0, 0.0]], [[120.0, 1.0], [0.0, 0.0]], np.eye(2), np.zeros((2, 2)),
    ...     ("p", "phi"), ("d_lat", "gust"), ("p", "phi"))
    >>> plant = (
    ...     synthesis.Plant(roll, disturbances=["gust"], performance=["phi", "d_lat"],
    ...                     controls=["d_lat"], measurements=["phi", "p"])
    ...     .with_delay(0.02, order=2)
    ...     .weighted({"phi": 2.0, "d_lat": 10.0}))
    >>> print(plant.states, plant.performance)
    ('p', 'phi', 'd_lat_delay1', 'd_lat_delay2') ('weighted_phi', 'weighted_d_lat')
    >>> loop = plant.close({("d_lat", "phi"): -0.1, ("d_lat", "p"): -0.02})
    >>> print(loop.inputs, loop.outputs, loop.at(0.0).is_stable())
    ('gust',) ('weighted_phi', 'weighted_d_lat') True
    """

    model: Model | LFT
    disturbances: tuple[Signal, ...] = ()
    performance: tuple[Signal, ...] = ()
    controls: tuple[Signal, ...] = ()
    measurements: tuple[Signal, ...] = ()

    if TYPE_CHECKING:  # names and systems that are given become those above

        def __init__(
            self,
            model: Any,
            disturbances: Sequence[str] = (),
            performance: Sequence[str] = (),
            controls: Sequence[str] = (),
            measurements: Sequence[str] = (),
        ) -> None: ...

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        model = _scheduled(self.model)
        groups = {
            "disturbances": _named(self.disturbances, model.inputs, "disturbance"),
            "controls": _named(self.controls, model.inputs, "control"),
            "measurements": _named(self.measurements, model.outputs, "measurement"),
        }
        w, u = groups["disturbances"], groups["controls"]
        for name in w:
            if name in u:
                raise InputError(
                    f"{name} is a disturbance and a control: keep it as a control, and"
                    f" .with_input_disturbance(['{name}']) adds a disturbance to it"
                )
        known = (*model.outputs, *(s for s in (*w, *u) if s not in model.outputs))
        z = _named(self.performance, known, "performance signal")
        groups["performance"] = z
        within = [name for name in z if name in (*w, *u)]
        if not isinstance(model, LFT):
            model = on(model, passing(within))
        elif within:
            raise InputError(BEFORE)
        y = [name for name in groups["measurements"] if name not in z]
        object.__setattr__(self, "model", model.select(inputs=[*w, *u], outputs=[*z, *y]))
        for name, value in groups.items():
            object.__setattr__(self, name, value)

    @property
    def nominal(self) -> LPVStateSpace:
        """The model; for an uncertain one, that of Delta = 0. Raises `InputError` for an LFT."""
        model = self._functions
        return model.nominal if isinstance(model, UncertainStateSpace) else model

    @property
    def _functions(self) -> Model:
        """The model, which is no LFT."""
        if isinstance(self.model, LFT):
            raise InputError(RATIONAL)
        return self.model

    @property
    def _frozen(self) -> LPVStateSpace | LFT:
        """The model that is frozen at p."""
        return self.model if isinstance(self.model, LFT) else self.nominal

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """The range of every parameter."""
        return tuple((s.low, s.high) for s in self.parameters)

    @property
    def states(self) -> tuple[Signal, ...]:
        """Names of the states."""
        return self.model.states

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters."""
        return self.model.parameters

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.model.dt

    @property
    def basis(self) -> FunctionSpace:
        """The basis functions of the matrices."""
        return self.nominal.basis

    def matrices(self, p: object) -> Generalized:
        """Return the nine matrices at p; see `LPVStateSpace.matrices`. For an uncertain plant,
        those of Delta = 0.
        """
        return Generalized(*Partition.of(self._frozen.matrices(p), self._positions))

    def at(self, *p: float) -> Generalized:
        """Return the nine matrices frozen at p, one value a parameter."""
        model = self._frozen.at(*p)
        return Generalized(*Partition.of((model.A, model.B, model.C, model.D), self._positions))

    def functions(self) -> Generalized:
        """The nine matrices as functions of p, `symheli.lpv.MatrixFunction`."""
        return Generalized(*Partition.of(functions_of(self.nominal), self._positions))  # type: ignore[arg-type]

    @property
    def channels(self) -> Channels:
        """The names of all signals."""
        return Channels(
            self.states, self.disturbances, self.controls, self.performance, self.measurements
        )

    @property
    def _positions(self) -> Positions:
        inputs, outputs = self._frozen.inputs, self._frozen.outputs
        return Positions(
            indices(self.disturbances, inputs, "input"),
            indices(self.controls, inputs, "input"),
            indices(self.performance, outputs, "output"),
            indices(self.measurements, outputs, "output"),
        )

    @classmethod
    def sized(
        cls,
        model: Any,
        *,
        disturbances: Mapping[str, float] = MappingProxyType({}),
        performance: Mapping[str, float] = MappingProxyType({}),
        controls: Mapping[str, float],
        measurements: Mapping[str, float],
        servos: Mapping[str, object] | Actuation = MappingProxyType({}),
        delay: float = 0.0,
    ) -> Plant:
        """Return a plant from the size of each of its signals, in the unit of the signal.

        A gain below 1 then means: with disturbances and noise of these sizes, performance and
        controls stay within theirs, in the sense of energies.

        Parameters
        ----------
        model : LPVStateSpace, LinearModel, UncertainStateSpace or system of python-control
            The model.
        disturbances : mapping
            {input: the size to expect}.
        performance : mapping
            {output: the size to permit}.
        controls : mapping
            {input: the size to permit}: each is performance too.
        measurements : mapping
            {output: the size of its noise}, 0 without.
        servos : mapping or Actuation
            {control: actuator}, as of `with_servo`, before the weights.
        delay : float
            Of all controls, s: as of `with_delay`, before the weights.

        Raises
        ------
        InputError
            A size that is not > 0 (of noise: >= 0), and what `Plant` refuses.

        Examples
        --------
        >>> import symheli, synthesis
        >>> lag = symheli.LinearModel([[-2.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]],
        ...                           ["p"], ["gust", "d_lat"], ["p"])
        >>> plant = synthesis.Plant.sized(lag, disturbances={"gust": 2.0}, performance={"p": 0.5},
        ...                               controls={"d_lat": 0.1}, measurements={"p": 0.01})
        >>> print(plant.disturbances, plant.performance)
        ('gust', 'p_noise') ('true_p', 'weighted_d_lat')
        """
        permitted = {**performance, **controls}
        for name, size in {**disturbances, **permitted}.items():
            positive(size, f"the size of {name}")
        plant = cls(model, [*disturbances], [*permitted], [*controls], [*measurements])
        plant = plant.behind(Actuation.of(servos, delay))
        noisy = {name: size for name, size in measurements.items() if size != 0}
        weights = {name: 1.0 / size for name, size in permitted.items()}
        return plant.with_noise(noisy).weighted({**disturbances, **weights})

    def weighted(self, weights: Mapping[str, object]) -> Plant:
        """Add `weights` {disturbance or performance signal: weight}: a number > 0, a LinearModel or
        python-control system of one input and output, or an LPVStateSpace over the same parameters.

        A disturbance drives its weight and keeps its name; a performance signal is weighted, and
        called `weighted_<name>` where the name itself stays that of a measurement, disturbance or
        control. Both then have unit "1". A name that is both a disturbance and performance means
        the disturbance. On a sampled plant continuous weights are sampled by Tustin's rule, an
        LPVStateSpace must be. Raises `InputError` for another weight or sample period.
        """
        plant = self
        for name, given in weights.items():
            part = parts.weight(given, name, self.dt)
            if name in plant.disturbances:
                plant = plant._weighted_disturbance(name, part)
            else:
                plant = plant._weighted_performance(name, part)
        return plant

    def behind(self, actuation: Actuation, degree: int | Sequence[int] | None = None) -> Plant:
        """Put an `Actuation` before the controls: its servos, the sampling where it has a period
        and the plant none (`degree` as of `sampled`), and the delay of all controls.

        Raises `InputError` as `with_servo` and `with_delay`, and for a plant of another period.
        """
        plant = self._driven(actuation.parts(self.dt))
        if plant.dt is None and actuation.period:
            plant = plant.sampled(actuation.period, degree)
        Actuation.of(actuation, period=plant.dt)
        return plant.with_delay(actuation.delay) if actuation.delay else plant

    def with_servo(self, servos: Mapping[str, object] | Actuation) -> Plant:
        """Add actuators {control: Servo, LinearModel or python-control system}; the controls keep
        their names and are the commands.

        A sampled plant takes them with their output held between the samples: put them before
        `sampled` for the hold at the command alone. Raises `InputError` where the control is
        weighted already.
        """
        return self.behind(Actuation.of(servos))

    def with_delay(
        self, seconds: float, signals: Sequence[str] | None = None, order: int = 4
    ) -> Plant:
        """Add a delay at all or at these controls: exact in a sampled plant, Pade's approximation
        of `order` states in a continuous one.

        Raises `InputError` for a delay that is no whole number of samples, and where the control is
        weighted already.
        """
        names = self.controls if signals is None else _tuple(signals)
        return self._driven({name: delay_of(name, seconds, self.dt, order) for name in names})

    def with_filter(self, filters: Mapping[str, object]) -> Plant:
        """Add filters {measurement: LinearModel, python-control system, or the bandwidth of a
        first-order lag in rad/s}, on a sampled plant by Tustin's rule.

        The performance stays unfiltered, as `true_<name>` where it had the name of the
        measurement.
        """
        plant = self
        for name, given in filters.items():
            part = parts.sensor_filter(given, name, self.dt)
            plant = plant._with_own_measurement(name)
            plant = plant._changed(lambda m, at=name, by=part: m.filtered_by({at: by}))
        return plant

    def with_input_disturbance(self, controls: Sequence[str] | None = None) -> Plant:
        """Add a disturbance `<control>_disturbance`, in the unit of the control, to all or to these
        controls: called before `with_servo` behind the servo, after it to the command. A control
        that is performance stays the command alone.

        Raises `InputError` where the control is weighted already.
        """
        names = self.controls if controls is None else _tuple(controls)
        own = [self.controls[i] for i in indices(names, self.controls, "control")]
        self._bare(own)
        new = (Signal(f"{u}{DISTURBANCE}", u.unit) for u in own)
        return self._changed(
            lambda model: disturbed(model, own), disturbances=(*self.disturbances, *new)
        )

    def with_noise(self, sizes: Mapping[str, float]) -> Plant:
        """Add a disturbance `<measurement>_noise` (unit "1") for {measurement: size} in the unit of
        each.

        The performance stays without noise, as `true_<name>` where it had the name of the
        measurement.
        """
        plant = self
        for name, size in by_name(sizes, "noise", "{measurement: size}").items():
            noise, size = Signal(f"{name}_noise", "1"), positive(size, f"the noise of {name}")
            plant = plant._with_own_measurement(name)._with_disturbance(noise, {name: size})
        return plant

    def with_cost(self, sizes: Mapping[str, float]) -> Plant:
        """Add a performance signal `<control>_cost` (unit "1"), size times the control, for
        {control: size} per unit of each: what a control costs beside what its weights ask.
        """
        plant = self
        for name, size in by_name(sizes, "cost", "{control: size}").items():
            (i,) = indices([name], self.controls, "control")
            cost, size = Signal(f"{name}_cost", "1"), positive(size, f"the cost of {name}")
            across: dict[str, float] = {self.controls[i]: size}
            plant = plant._changed(
                lambda model, new=cost, across=across: with_row(model, new, {}, across),
                performance=(*plant.performance, cost),
            )
        return plant

    def with_reference(self, signals: Sequence[str] | None = None) -> Plant:
        """With a disturbance `<name>_reference` for each of these performance signals and
        measurements (None: those that are both); they become `<name>_error` = reference - signal,
        and a performance signal `true_<name>` becomes `true_<name>_error`. What flies reads
        `<name>` measured minus reference again: `fly` and `TableController.of` turn the sign.

        Raises `InputError` where no signal is both and none is given.
        """
        if signals is None:
            signals = [
                name
                for name in self.measurements
                if name in self.performance or TRUE + name in self.performance
            ]
            if not signals:
                raise InputError(
                    "no measurement is also a performance signal: give the signals that follow a"
                    " reference"
                )
        plant = self
        for name in _tuple(signals):
            plant = plant._with_reference(name)
        return plant

    def velocity_form(
        self, controls: Sequence[str] | None = None, *, measured: bool = False
    ) -> Plant:
        """Add integrators in front of all or of these controls: the new controls are their rates
        `<name>_rate`, per second, and the integrator states `<name>_command`.

        In discrete time u(k+1) = u(k) + dt v(k). Where the control was performance, its command is.
        With `measured` the commands are measurements too, `<name>_command`.
        """
        plant = self
        for name in self.controls if controls is None else _tuple(controls):
            plant = plant._integrated(name, measured)
        return plant

    def sampled(self, dt: float, degree: int | Sequence[int] | None = None) -> Plant:
        """Sample the plant every `dt` s with the inputs held between; see
        `LPVStateSpace.discretize`, whose `.residuals` the model has. Raises `InputError` for an
        uncertain plant.
        """
        if isinstance(self.model, UncertainStateSpace):
            raise InputError(
                "an uncertain plant is not sampled: the outputs of its block are not held between"
                " the samples; start from an uncertain model that is sampled"
            )
        return self._changed(lambda model: model.discretize(dt, degree=degree))

    def lagged(self, seconds: float) -> Plant:
        """Return the plant scheduled by a lag of its parameter and the rate of that lag, both known
        to a controller: X and Y may then depend on the lag; see `symheli.lpv.tools.lagged`.
        """
        if isinstance(self.model, UncertainStateSpace):
            raise InputError("an uncertain plant has no lagged parameter: take its .nominal")
        return self._changed(lambda model: lagged(model, seconds))

    def with_rate(self, rate: Rates) -> Plant:
        """Return the same plant with |dp/dt| <= rate; see `LPVStateSpace.with_rate`."""
        return replace(self, model=self._functions.with_rate(rate))

    def with_scheduling(self, scheduling: Scheduling | Sequence[Scheduling]) -> Plant:
        """Return the same plant over narrower ranges or with other rate limits."""
        if isinstance(self.model, LFT):
            model = self.model
            for each in [scheduling] if isinstance(scheduling, Scheduling) else scheduling:
                model = model.with_scheduling(each)
            return replace(self, model=model)
        return replace(self, model=self.model.with_scheduling(scheduling))

    def close(self, controller: Any) -> Any:
        """Return the loop of u = K y from the disturbances to the performance; see
        `symheli.lpv.tools.lower_feedback`.

        `controller`: {(control, measurement): gain}, an array (controls, measurements) of gains, a
        LinearModel, an LPVStateSpace, a python-control system (in the order of the plant where its
        signals have no names), or what has such a `model` or `controller`. Controls that it does
        not drive stay zero. An `UncertainStateSpace` of an uncertain plant. Raises `SynthesisError`
        for a design without a controller. Of an LFT the loop is one, of constant gains.
        """
        K = as_controller(controller, self.controls, self.measurements)
        w, z = self.disturbances, self.performance
        if not isinstance(self.model, LFT):
            return lower_feedback(self.model, K, inputs=w, outputs=z)
        if isinstance(K, LPVStateSpace) and K.basis.size > 1:
            raise InputError("the plant is an LFT, and the controller depends on its parameters")
        one = K.at(*(s.middle for s in K.parameters)) if isinstance(K, LPVStateSpace) else K
        return connect(self.model, one, inputs=w, outputs=z)

    def _changed(self, change: Callable[[LPVStateSpace], LPVStateSpace], **groups: Any) -> Plant:
        """Return the plant with another model, to which inputs that are performance are
        added anew.
        """
        inputs = (*self.disturbances, *self.controls)
        if isinstance(self.model, LFT):
            raise InputError(BEFORE)
        own = self.model.select(outputs=[y for y in self.model.outputs if y not in inputs])
        return replace(self, model=on(own, change), **groups)

    def _driven(self, by: Mapping[str, Part]) -> Plant:
        indices(by, self.controls, "control")
        self._bare(by)
        return self._changed(lambda model: model.driven_by(by)) if by else self

    def _bare(self, controls: Iterable[str]) -> None:
        """Raise `InputError` where one of these signals is weighted."""
        for name in controls:
            if WEIGHTED + name in self.performance:
                raise InputError(
                    f"{WEIGHTED}{name} weights {name} as it is: add servos, delays and disturbances"
                    " first, then the weights of the commands"
                )

    def _weighted_disturbance(self, name: str, part: Part) -> Plant:
        unit = Signal(name, "1")

        def change(model: LPVStateSpace) -> LPVStateSpace:
            behind = model.driven_by({name: part})
            inputs = tuple(unit if u == name else u for u in behind.inputs)
            return replace(behind, inputs=inputs)

        return self._changed(change, disturbances=_with(self.disturbances, name, unit))

    def _weighted_performance(self, name: str, part: Part) -> Plant:
        if name not in self.performance and TRUE + name in self.performance:
            name = TRUE + name
        if name not in self.performance:
            known = (*self.disturbances, *self.performance)
            raise UnknownNameError("disturbance or performance signal", name, known)
        stays = name in (*self.measurements, *self.controls)
        new = Signal(WEIGHTED + name.removeprefix(TRUE) if stays else name, "1")

        def change(model: LPVStateSpace) -> LPVStateSpace:
            if name in self.controls:
                model = with_row(model, new, {}, {name: 1.0})
            elif stays:
                model = with_row(model, new, {name: 1.0})
            filtered = model.filtered_by({new: part})
            return replace(
                filtered, outputs=tuple(new if y == new else y for y in filtered.outputs)
            )

        return self._changed(change, performance=_with(self.performance, name, new))

    def _with_own_measurement(self, name: str) -> Plant:
        """Separate a measurement from a performance signal of the same name: the latter becomes
        `true_<name>`.
        """
        (i,) = indices([name], self.measurements, "measurement")
        if name not in self.performance:
            return self
        true = Signal(TRUE + name, self.measurements[i].unit)
        return self._changed(
            lambda model: with_row(model, true, {name: 1.0}),
            performance=_with(self.performance, name, true),
        )

    def _with_disturbance(self, new: Signal, enters: Mapping[str, float]) -> Plant:
        """Add a disturbance that adds {output: gain} to outputs."""

        def change(model: LPVStateSpace) -> LPVStateSpace:
            across = {Signal(y): {new: gain} for y, gain in enters.items()}
            inputs = {**itself(model.inputs), **new_name(new, model.inputs, "input")}
            return mixed(model, inputs, itself(model.outputs), across)

        return self._changed(change, disturbances=(*self.disturbances, new))

    def _with_reference(self, name: str) -> Plant:
        passing = (*self.disturbances, *self.controls)
        known = dict.fromkeys((*self.performance, *self.measurements))
        known = [s for s in known if s not in passing]
        (i,) = indices([name], known, "performance signal or measurement")
        unit = known[i].unit
        reference = Signal(f"{name}_reference", unit)
        errors = {y: Signal(f"{y}{ERROR}", unit) for y in (name, TRUE + name) if y in known}

        def change(model: LPVStateSpace) -> LPVStateSpace:
            outputs = {errors.get(y, y): {y: -1.0 if y in errors else 1.0} for y in model.outputs}
            inputs = {**itself(model.inputs), **new_name(reference, model.inputs, "input")}
            across = {error: {reference: 1.0} for error in errors.values()}
            return mixed(model, inputs, outputs, across)

        return self._changed(
            change,
            disturbances=(*self.disturbances, reference),
            performance=tuple(errors.get(y, y) for y in self.performance),
            measurements=tuple(errors.get(y, y) for y in self.measurements),
        )

    def _integrated(self, name: str, measured: bool) -> Plant:
        (i,) = indices([name], self.controls, "control")
        unit = self.controls[i].unit
        rate, command = Signal(f"{name}_rate", per_second(unit)), Signal(f"{name}_command", unit)
        part = parts.integrator(self.controls[i], self.dt)
        commands = (command,) if measured else ()
        rows = (*commands, self.controls[i]) if name in self.performance else commands

        def change(model: LPVStateSpace) -> LPVStateSpace:
            for row in rows:
                model = with_row(model, row, {}, {name: 1.0})
            behind = model.driven_by({name: part})
            return replace(behind, inputs=tuple(rate if u == name else u for u in behind.inputs))

        return self._changed(
            change,
            controls=_with(self.controls, name, rate),
            measurements=(*self.measurements, *commands),
        )


def require_plant(given: object) -> None:
    """Raise `InputError`, with an example, for anything but a `Plant`."""
    if not isinstance(given, Plant):
        raise InputError(
            f"plant: expected a synthesis.Plant, got {type(given).__name__}; declare the signals of"
            " a model first: synthesis.Plant(model, disturbances=[...], performance=[...],"
            " controls=[...], measurements=[...])"
        )


def _scheduled(given: Any) -> Model | LFT:
    if is_control_system(given):
        given = LinearModel.from_control(given)
    if isinstance(given, LinearModel):
        given = LPVStateSpace.constant(given)
    if not isinstance(given, LPVStateSpace | UncertainStateSpace | LFT):
        raise InputError(
            "model: expected an LPVStateSpace, an UncertainStateSpace, an LFT, a LinearModel or a"
            f" system of python-control, got {type(given).__name__}"
        )
    return given


def _named(given: Iterable[str], known: Sequence[Signal], kind: str) -> tuple[Signal, ...]:
    """Return these of the known signals, with their units; raise `InputError` for a name that
    repeats.
    """
    return signals(tuple(known[i] for i in indices(_tuple(given), known, kind)))


def _tuple(given: Iterable[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _with(names: Sequence[Signal], old: str, new: Signal) -> tuple[Signal, ...]:
    return tuple(new if name == old else name for name in names)
