"""A controller as it flies: a table over its scheduling parameter, in single precision."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from symheli.errors import InputError, UnknownNameError
from symheli.flight.controller import (
    COMMAND,
    CONTROLLER_INPUTS,
    SCHEDULING,
    Follow,
    ScheduledController,
    require_names,
)
from symheli.flight.parameter_monitor import ParameterMonitor
from symheli.flight.single_precision import (
    MAX_NUMBER,
    NUMBER,
    checked_numbers,
    increasing,
    inward,
    rounded,
)
from symheli.flight.table_arithmetic import (
    MAX_COUNT,
    InitialCommand,
    Numbers,
    TableState,
    commands,
    follow_parameter,
)
from symheli.flight.tabulated import Tabulated
from symheli.lpv.bases.interpolating import PiecewiseLinear
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import UNSCHEDULED, Scheduling
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.kinematics import INPUTS
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized
from symheli.values.units import per_second, ratio

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class TableController:
    """A table controller computes commands from measurements in 32-bit arithmetic, with matrices
    from a table over one parameter p.

    x(k+1) = A(p) x + B(p) e + L(p) (u - w), w = u0 + C(p) x + D(p) e, u = w within its limits, e =
    measured - reference.

    A .. L stand in a table over one parameter p, straight between its knots. `model` holds the same
    numbers: what an analysis certifies is what `fly` flies and what `write_controller` writes in C,
    which gives the same bits. u0 is the trim of the flight at each moment. A command that
    integrates starts there and is then u(k) = u(k-1) + C x + D e within its limits, at which the
    integration stops. The parameter in use moves at the certified rate at most, whatever is read:
    see `ParameterMonitor`. `fly` provides the commanded airspeed and acceleration, and by `follow`
    the readings; a table over anything else, as a Mach number, gets its parameter by `update`.
    What it keeps in flight is a `TableState`: `init` is the first, `update` and `step` return the
    next.

    Parameters
    ----------
    knots : array (K,)
        Values of `parameter` in its unit, increasing, K >= 2.
    matrices : array (K, n + ny, n + nu + ny)
        [A B L; C D 0] at the knots; rounded to 32 bits. Rows of a command that integrates are what
        it changes by in a sample.
    states, inputs, outputs : sequence of str
        n names; of nu measured signals; of ny controls; any names. What `fly` flies measures states
        of the helicopter and commands its inputs. An input may also be the command in force of an
        output that integrates, <name>_command, with the trim as reference.
    dt : float
        Sample period, s.
    integrates : sequence of str
        The outputs that integrate.
    limits : mapping of str to (float, float)
        Ends of the commands, in their units; none where nothing is given.
    rate : float
        Certified rate of the parameter, in its unit per second.
    fade : float
        Time constant, s, of the offset that joins the first command to the one in force before.
    monitor : ParameterMonitor
        Filter, limits and fallback of the measured parameter.
    follow : {"command", "reading"}
        Whether it is scheduled by what is commanded of the parameter, or as its sensor reads it.
    misfit : float
        Largest departure from the model that the table was made of; see `of`.
    parameter : Signal
        What the table is over, with its unit; default the airspeed, m/s.

    Raises
    ------
    InputError
        Shapes that do not fit, knots that do not increase, names given twice, numbers that are not
        finite in 32 bits.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.flight.ParameterMonitor : the parameter in use
    symheli.export.write_controller : the controller in C

    Examples
    --------
    >>> lqr = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> limits = {name: (-t, t) for name, t in zip(heli.inputs, heli.travel)}
    >>> table = symheli.TableController.of(lqr.scheduled_controller.model, 17, limits=limits)
    >>> hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    >>> record = symheli.fly(heli, hover, controller=table)
    >>> u, state = table.update(table.init(), np.full(8, 0.1), np.zeros(8), np.zeros(4), 2.0)
    >>> table.misfit < 1e-6, round(float(state.parameter_used), 2)
    (True, 2.0)
    """

    knots: Array
    matrices: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float
    integrates: tuple[str, ...] = ()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rate: float = math.inf
    fade: float = 1.0
    monitor: ParameterMonitor = field(default_factory=ParameterMonitor)
    follow: Follow = "command"
    misfit: float = 0.0
    parameter: Signal = SCHEDULING[0]

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        if not self.inputs or not self.outputs:
            raise InputError("a controller needs at least one input and one output")
        held = indices(self.integrates, self.outputs, "output that integrates")
        object.__setattr__(self, "integrates", tuple(map(str, self.integrates)))
        own = {f"{self.outputs[i]}{COMMAND}": self.outputs[i].unit for i in held}
        read = tuple(Signal(s, own.get(s)) for s in self.inputs)
        object.__setattr__(self, "inputs", read)
        object.__setattr__(self, "parameter", Signal(self.parameter))
        object.__setattr__(self, "knots", increasing(self.knots, "knots"))
        n, nu, ny = self.order, len(self.inputs), len(self.outputs)
        object.__setattr__(
            self,
            "matrices",
            rounded(self.matrices, "matrices", (len(self.knots), n + ny, n + nu + ny)),
        )
        if not (math.isfinite(self.dt) and self.dt > 0):
            raise InputError(f"dt must be a positive number of seconds, got {self.dt}")
        if not self.fade > 0:
            raise InputError(f"fade: expected a time constant in s > 0, got {self.fade}")
        if not self.rate >= 0:
            raise InputError(f"rate: expected a number >= 0 of {self._per_second}, got {self.rate}")
        if not self.misfit >= 0:
            raise InputError(f"misfit: expected a number >= 0, got {self.misfit}")
        if self.follow not in get_args(Follow):
            raise UnknownNameError("way to schedule", self.follow, get_args(Follow))
        object.__setattr__(self, "limits", checked_limits(self.limits, self.outputs))
        self.init()  # what its numbers do not allow is refused here

    @classmethod
    def of(
        cls,
        model: LPVStateSpace | Any,
        knots: int | Sequence[float] = 33,
        *,
        correction: object | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        fade: float = 1.0,
        monitor: ParameterMonitor | None = None,
        follow: Follow = "command",
        integrates: Collection[str] | None = None,
    ) -> TableController:
        """The table of a sampled model over one parameter, of any name and unit.

        Its `misfit` is the largest entry of table minus model, at the knots and at four points
        between every two, over the largest of the model: in A, B, C or D, where it is worst.

        Parameters
        ----------
        model : LPVStateSpace or synthesis.Controller
            Sampled, over one parameter, with inputs measured minus reference. An input
            `<name>_error` is reference minus measured, and becomes `<name>`. An output may be the
            rate of a command, as d_lon_rate (rad/s), and d_lon_command an input, as in a design on
            `plant.velocity_form(measured=True)`.
        knots : int or sequence of float
            So many at equal distances over the range of the model, or the values, in its unit.
        correction : array_like, optional
            L, rad to states, (n, ny) or one at each knot (K, n, ny); 0: none. Default: gains of
            Kalman filters that read the states from the commands applied, none for those that
            integrate (see `symheli.flight.anti_windup`).
        limits, fade, monitor, follow
            See above.
        integrates : collection of str, optional
            The commands, d_lon of d_lon_rate, that integrate. Default: each whose output is called
            <name>_rate; () takes every output as the command itself.

        Raises
        ------
        InputError
            A continuous model or one over several parameters, knots beyond its range, numbers
            beyond those of 32 bits.
        """
        source = Tabulated(model, integrates)
        at = source.knots(knots)
        table = cls(
            at,
            source.matrices(at, correction),
            source.model.states,
            source.model.inputs,
            source.outputs,
            source.dt,
            tuple(str(y) for y, rate in zip(source.outputs, source.rates, strict=True) if rate),
            limits or {},
            source.model.scheduling.limit,
            fade,
            monitor or ParameterMonitor(),
            follow,
            parameter=source.parameter,
        )
        return replace(table, misfit=source.misfit(table.knots, table.matrices))

    # --- what it is ------------------------------------------------------------------------------

    @cached_property
    def numbers(self) -> Numbers:
        """Numbers of the arithmetic, here and in C."""
        a, (low, high) = self.monitor, self._ends
        fallback = 0.5 * (low + high) if a.fallback is None else a.fallback
        if not low <= fallback <= high:
            raise InputError(
                f"fallback: expected a value of the table, {low:g} to {high:g}"
                f" {self.parameter.unit}, got {fallback:g}"
            )
        plausible = a.plausible or (2 * low - high, 2 * high - low)
        ends = [self.limits.get(str(y), (-math.inf, math.inf)) for y in self.outputs]
        return Numbers(
            order=self.order,
            knots=self.knots,
            matrices=self.matrices,
            low=np.array([inward(e, math.inf) for e, _ in ends], NUMBER),
            high=np.array([inward(e, -math.inf) for _, e in ends], NUMBER),
            integrates=np.array([y in self.integrates for y in self.outputs]),
            fade=NUMBER(math.exp(-self.dt / self.fade)),
            step=self._largest_step(),
            gain=NUMBER(-math.expm1(-self.dt / a.lag) if a.lag > 0 else 1.0),
            plausible=(inward(plausible[0], math.inf), inward(plausible[1], -math.inf)),
            fallback=np.clip(NUMBER(fallback), self.knots[0], self.knots[-1]),
            frozen=self._samples(math.inf if self.follow == "command" else a.frozen, 1),
            hold=self._samples(a.hold, 0),
        )

    @property
    def order(self) -> int:
        """Number of states, without the commands that integrate."""
        return len(self.states)

    @cached_property
    def model(self) -> LPVStateSpace:
        """The controller within its limits as a model for analysis: outputs added to the
        trim, the coefficients the 32-bit numbers of the table, straight between the knots. Only the
        rounding of sums and products in flight is left out.

        A command that integrates is a state more, <name>_held, its deviation from the trim, which
        is also what an input <name>_command reads; that the trim moves under it is left out.
        """
        n, own = self.order, self.order + len(self.inputs)
        read = self.own_commands
        seen = [n + j for j, s in enumerate(self.inputs) if s not in read]
        M = self.matrices[:, :, :own].astype(float)
        held = [i for i, y in enumerate(self.outputs) if y in self.integrates]
        count, m, ny = len(self.knots), len(held), len(self.outputs)
        keep = np.zeros((count, ny, m))
        keep[:, held, range(m)] = 1.0
        A = np.zeros((count, n + m, n + m))
        A[:, :n, :n] = M[:, :n, :n]
        A[:, n:, :n] = M[:, n:, :n][:, held]
        A[:, n:, n:] = np.eye(m)
        for j, s in enumerate(self.inputs):
            if s in read:
                k = held.index(indices([read[s]], self.outputs, "output")[0])
                A[:, :n, n + k] += M[:, :n, n + j]
                A[:, n:, n + k] += M[:, n:, n + j][:, held]
                keep[:, :, k] += M[:, n:, n + j]
        return LPVStateSpace(
            PiecewiseLinear(tuple(self.knots.astype(float).tolist())),
            A,
            np.concatenate([M[:, :n, seen], M[:, n:, seen][:, held]], axis=1),
            np.concatenate([M[:, n:, :n], keep], axis=2),
            M[:, n:, seen],
            (Scheduling(str(self.parameter), self.parameter.unit, *self._ends, self._rate),),
            (*self.states, *(Signal(f"{y}_held", y.unit) for y in (self.outputs[i] for i in held))),
            tuple(s for s in self.inputs if s not in read),
            self.outputs,
            self.dt,
        )

    @property
    def in_double_precision(self) -> ScheduledController:
        """`model` in 64-bit arithmetic, compiled: for many flights within the limits, with an
        parameter that keeps to its rate and is always good.

        Raises `InputError` where a command integrates, and for a parameter that is neither airspeed
        nor acceleration.
        """
        if self.integrates:
            raise InputError(
                f"{', '.join(self.integrates)} integrate from a command on, not about the trim; fly"
                " the TableController itself instead of this model"
            )
        return ScheduledController(self.model, self.follow)

    def plot(self, input: str | None = None, output: str | None = None) -> tuple[Axes, Axes]:
        """Draw the frequency response from a measured signal to a command (default: the first of
        each) at values of the parameter; (magnitude, phase). Raises `UnknownNameError`.
        """
        from symheli.lpv.frozen_plots import bode

        return bode(self.model, input or self.model.inputs[0], output or self.model.outputs[0])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the controller as JSON, every number exact; a reader sees the old file or the new
        one. Raises `SymheliError` where the file cannot be written.
        """
        from symheli.flight.table_file import save

        return save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> TableController:
        """The one in `path`, equal to the last bit; raises `InputError` unless the file is whole
        and of this kind.
        """
        from symheli.flight.table_file import load

        return load(path)

    # --- how it flies ----------------------------------------------------------------------------

    def init(
        self, command: ArrayLike | None = None, axes: Collection[str] | None = None
    ) -> TableState:
        """Return states, filters and integrators on the ground; the parameter in use starts at the
        next valid reading.

        With `command` (ny,), in the units of the outputs, the one in force now: the first step
        answers just that, whatever is measured then, and what it differs by from the controller's
        own fades away (or stays, where a command integrates). `axes` are the outputs that are
        flown, default all; see `fly_axes`.
        """
        every = np.ones(len(self.outputs), bool)
        state = TableState.ground(self.numbers, every if axes is None else self._flown(axes))
        if command is None:
            return state
        return state.entering(rounded(command, "command", (len(self.outputs),)))

    def fly_axes(self, state: TableState, axes: Collection[str]) -> TableState:
        """The state from which these outputs alone are flown. The others stay at what is applied
        there, to which the states follow; when they are flown again they begin at it.
        """
        return replace(self._own(state), flown=self._flown(axes))

    def update(
        self,
        state: TableState,
        measured: ArrayLike,
        reference: ArrayLike,
        trim: ArrayLike,
        parameter: float,
        *,
        valid: bool = True,
        others: ArrayLike | None = None,
    ) -> tuple[Array, TableState]:
        """Return the commands (ny,), float32, in the units of the outputs, at one sample, and the
        next state, whose `status` lists the events of the step.

        Parameters
        ----------
        measured, reference : (nu,)
            Of the inputs, in their units; of an input <name>_command the command in force, which is
            the trim on the ground, and its trim.
        trim : (ny,)
            Of the outputs, in their units.
        parameter : float
            As it is read, or commanded, in its unit; anything where it is bad.
        valid : bool
            Whether who read it trusts it.
        others : (ny,), optional
            Commands applied on the axes that are not flown, in their units; default the trim.
        """
        n, s, nu, ny = self.numbers, self._own(state), len(self.inputs), len(self.outputs)
        with np.errstate(all="ignore"):  # NaN and infinity are handled below
            seen, held = (
                checked_numbers("measured", measured, nu),
                checked_numbers("reference", reference, nu),
            )
            at = checked_numbers("trim", trim, ny)
            elsewhere = at if others is None else checked_numbers("others", others, ny)
            s = follow_parameter(n, s, NUMBER(parameter), valid)
            s = commands(n, s, seen - held, at, elsewhere)
        return s.command.copy(), s

    def step(
        self, state: TableState, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, TableState]:
        """Commands (4,), rad, and the state of the next sample; see `PureController`. Inputs it
        does not name stay at their trim.

        Raises `InputError` where a flight of the helicopter does not provide the parameter or the
        inputs of the table, or has no such control.
        """
        parameter = self._provided(measured if self.follow == "reading" else p)
        u = np.array([reference[s] for s in INPUTS])
        trim, state, read = u[self._rows], self._own(state), self.own_commands
        before = np.where(state.entry == InitialCommand.GROUND, trim, state.command)
        in_force = dict(zip(map(str, self.outputs), before, strict=True))
        u[self._rows], state = self.update(
            state,
            [in_force[read[s]] if s in read else measured[s] for s in self.inputs],
            [reference[read.get(s, s)] for s in self.inputs],
            trim,
            parameter,
        )
        return u, state

    # --- inside ----------------------------------------------------------------------------------

    def _own(self, state: object) -> TableState:
        """Raises `InputError` for what is no state of a table of this size."""
        own = self.order, len(self.outputs), bool
        if not isinstance(state, TableState) or (
            (len(state.x), len(state.command), state.flown.dtype) != own
        ):
            raise InputError(
                f"state: expected that of init() or of the step before, got {state!r:.80}"
            )
        return state

    def _flown(self, axes: Collection[str]) -> Array:
        """(ny,) of bool."""
        indices(axes, self.outputs, "output")
        return np.array([y in axes for y in self.outputs])

    @cached_property
    def _rows(self) -> list[int]:
        """Position of each output among the helicopter inputs, where `fly` can fly it."""
        require_names("measured signal", self.inputs, (*CONTROLLER_INPUTS, *self.own_commands))
        require_names("helicopter input", self.outputs, INPUTS)
        for s in (*self.inputs, *self.outputs):
            own = Signal(self.own_commands.get(s, str(s))).unit
            if s.unit != own:
                raise InputError(
                    f"the table has {s} in {s.unit}, and a flight has it in {own}: design with the"
                    " units of the helicopter model"
                )
        return indices(self.outputs, INPUTS, "helicopter input")

    @cached_property
    def own_commands(self) -> Mapping[str, str]:
        """{input <name>_command: the output that it is the command in force of}."""
        known = {f"{y}{COMMAND}": y for y in self.integrates}
        return {str(s): known[s] for s in self.inputs if s in known}

    def _provided(self, provided: NamedVector) -> float:
        """Return the parameter in the unit of the table from the signals of a flight."""
        if self.parameter == UNSCHEDULED.name:
            return UNSCHEDULED.middle
        for signal, value in zip(provided.signals, provided.array, strict=True):
            if signal == self.parameter and (size := ratio(signal.unit, self.parameter.unit)):
                return size * float(value)
        known = ", ".join(f"{s} ({s.unit})" for s in provided.signals)
        raise InputError(
            f"the table is over {self.parameter} ({self.parameter.unit}), and a flight provides"
            f" {known} where it follows the {self.follow}: pass its parameter by .update(state,"
            " measured, reference, trim, parameter) in a controller of your own; or, where it is"
            " one of them under another name, rename that of the model,"
            " .with_scheduling(Scheduling(name, unit, low, high, rate))"
        )

    @property
    def _per_second(self) -> str:
        return per_second(self.parameter.unit)

    @property
    def _ends(self) -> tuple[float, float]:
        return float(self.knots[0]), float(self.knots[-1])

    @property
    def _rate(self) -> float:
        return self.rate if self.monitor.rate is None else self.monitor.rate

    def _largest_step(self) -> np.float32:
        """Return the largest change of the parameter in use in a sample: rounding its sum takes it
        no farther than the rate allows.
        """
        most = self._rate * self.dt
        if most == 0.0 or math.isinf(most):
            return min(NUMBER(most), MAX_NUMBER)
        rounding = float(np.spacing(np.abs(self.knots).max()))
        if most <= 2 * rounding:
            raise InputError(
                f"rate: {self._rate:g} {self._per_second} moves {self.parameter} by less in a"
                " sample than 32 bits resolve; sample more slowly, or give rate=0"
            )
        return inward(most - rounding, -math.inf)

    def _samples(self, seconds: float, least: int) -> int:
        return int(max(min(math.floor(min(seconds / self.dt, MAX_COUNT) + 1e-9), MAX_COUNT), least))


def checked_limits(given: object, outputs: Sequence[Signal]) -> Mapping[str, tuple[float, float]]:
    """Return the ends of each output; raise `InputError` unless they are low < high."""
    if not isinstance(given, Mapping):
        raise InputError(f"limits: expected {{output: (low, high)}} in its unit, got {given!r:.80}")
    out = {}
    for name, ends in given.items():
        (i,) = indices([name], outputs, "output with a limit")
        try:
            low, high = map(float, ends)
        except (TypeError, ValueError):
            low = high = math.nan
        if not low < high:
            raise InputError(
                f"limits[{name!r}]: expected (low, high) in {outputs[i].unit}, got {ends!r:.80}"
            )
        out[str(name)] = (low, high)
    return out
