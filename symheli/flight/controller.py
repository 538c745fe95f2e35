"""Linear controllers scheduled by airspeed and acceleration, and what else becomes a controller."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel, is_control_system
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.mixing import ERROR, turned
from symheli.lpv.scheduling import UNSCHEDULED, Scheduling
from symheli.values.arrays import Array, frozen
from symheli.values.controllers import PureController, StatefulController
from symheli.values.kinematics import INPUTS, RIGID_BODY
from symheli.values.named_vector import NamedVector
from symheli.values.numbers import positive
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

MEASURED = RIGID_BODY
"""Measured states: a controller receives the readings of their sensors."""
ROTOR = signals(("Om", "om_i"))
"""Rotor states, passed on without sensor errors; present with the PI governor."""
CONTROLLER_INPUTS = (*MEASURED, *ROTOR)
SCHEDULING = (Signal("airspeed", "m/s"), Signal("acceleration", "m/s^2"))
"""Signals by which a controller can be scheduled."""
EVERY_SPEED = Scheduling("airspeed", "m/s", 0.0, 1.0)
"""Scheduling of an unscheduled controller."""
RATE, COMMAND = "_rate", "_command"
"""Suffixes of an output that is the rate of a command, and of an input that is the command."""
Follow = Literal["command", "reading"]


def deviations(given: object) -> LPVStateSpace:
    """The model of a controller, of `given` itself or its `model`, with inputs measured minus
    reference: of a design against `reference - y`, whose inputs are called `<name>_error`, those
    inputs as `<name>` with the other sign.

    Raises `InputError` where there is no LPV model.
    """
    model = given if isinstance(given, LPVStateSpace) else getattr(given, "model", None)
    if not isinstance(model, LPVStateSpace):
        raise InputError(
            "expected an LPVStateSpace, or a controller of synthesis with such a .model, got"
            f" {type(given).__name__}"
        )
    return turned(
        model,
        {y: y.removesuffix(ERROR) for y in model.inputs if y.endswith(ERROR)},
    )


class PolynomialPieces(NamedTuple):
    """Matrices as polynomials of p - break: breaks (pieces + 1,), coefficients (pieces, degree + 1,
    rows, columns) from the highest power.
    """

    breaks: Array
    coefficients: Array


@dataclass(frozen=True, eq=False)
class ScheduledController:
    """x(k+1) = A(p) x + B(p) e, u = u0 + C(p) x + D(p) e with e = measured - reference.

    u0 is the trim of the flight at each moment; inputs the model does not name stay there. p is
    held at the ends of the model's range where it leaves it.

    Parameters
    ----------
    model : LPVStateSpace
        Sampled; its inputs are measured states (u v w p q r phi theta; Om om_i), its outputs
        helicopter inputs (d_lon d_lat d_col d_ped), both as deviations, its parameters `airspeed`,
        `acceleration` or both, or none. An input `<name>_error` is reference minus measured, and
        becomes `<name>`; of a `synthesis.Controller` its model.
    follow : {"command", "reading"}
        Whether p is what is commanded, or the airspeed as its sensor reads it.

    Raises
    ------
    InputError
        A continuous model, signals or parameters of another name, a reading of anything but
        airspeed.

    Examples
    --------
    >>> speed = symheli.Scheduling("airspeed", "m/s", low=0.0, high=13.0)
    >>> D = [[[0.03, 0.01]], [[0.001, 0.0]]]  # rad per rad and rad/s, and their change per m/s
    >>> basis = symheli.lpv.Polynomial(1, 0.0, 13.0)
    >>> empty = np.zeros((2, 0, 0)), np.zeros((2, 0, 2)), np.zeros((2, 1, 0))
    >>> gains = symheli.LPVStateSpace(
    ...     basis, *empty, -np.array(D), speed, (), ("phi", "p"), ("d_lat",), dt=0.02
    ... )
    >>> symheli.flight.ScheduledController(gains).dt
    0.02
    """

    model: LPVStateSpace
    follow: Follow = "command"

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", deviations(self.model))
        if self.model.dt is None:
            raise InputError("the controller is continuous: sample it with .discretize(dt)")
        if self.follow not in get_args(Follow):
            raise UnknownNameError("way to schedule", self.follow, get_args(Follow))
        if rates := [y for y in self.model.outputs if y in {f"{u}{RATE}" for u in INPUTS}]:
            raise InputError(
                f"{', '.join(rates)}: the rate of a command is integrated by a TableController,"
                " within its limits: TableController.of(model)"
            )
        require_names("measured signal", self.model.inputs, CONTROLLER_INPUTS)
        require_names("helicopter input", self.model.outputs, INPUTS)
        if [s.name for s in self.model.parameters] == [UNSCHEDULED.name]:
            one = self.model.at(UNSCHEDULED.middle)
            object.__setattr__(self, "model", LPVStateSpace.constant(one, EVERY_SPEED))
        names = tuple(s.name for s in self.model.parameters)
        require_parameters(
            "a controller flies over airspeed (m/s) and acceleration (m/s^2)", self.model
        )
        if self.follow == "reading" and (names != ("airspeed",) or self.pieces is None):
            raise InputError(
                "only a controller over airspeed alone, polynomial or piecewise polynomial in it,"
                f" can follow its reading; this one is scheduled by {', '.join(names)}"
            )

    @property
    def dt(self) -> float:
        """Sample period, s."""
        assert self.model.dt is not None  # noqa: S101
        return self.model.dt

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.model.states)

    @cached_property
    def rows(self) -> list[int]:
        """Position of each output among the helicopter inputs."""
        return indices(self.model.outputs, INPUTS, "output")

    @cached_property
    def coefficients(self) -> Array:
        """(n, order + 4, order + 10): [A B; C D] of each function of the basis, with a column for
        every measured state and a row for every input of the helicopter.
        """
        m, n = self.model, self.order
        out = np.zeros((m.basis.size, n + len(INPUTS), n + len(CONTROLLER_INPUTS)))
        rows = [n + i for i in self.rows]
        columns = [n + i for i in indices(m.inputs, CONTROLLER_INPUTS, "input")]
        out[:, :n, :n] = m.A
        out[:, :n, columns] = m.B
        out[:, rows, :n] = m.C
        out[np.ix_(range(m.basis.size), rows, columns)] = m.D
        return out

    @cached_property
    def pieces(self) -> PolynomialPieces | None:
        """The same as polynomials between breaks; None with several parameters or functions that
        are no polynomials there.
        """
        if len(self.model.parameters) > 1:
            return None
        try:
            parts = self.model.basis.pieces()
        except InputError:
            return None
        powers = np.stack([_powers(part.bernstein, part.high - part.low) for part in parts])
        return PolynomialPieces(
            np.array([parts[0].low, *(part.high for part in parts)]),
            np.einsum("kdj,jrc->kdrc", powers, self.coefficients),
        )

    def matrices(self, p: Array) -> Array:
        """[A B; C D] (n, order + 4, order + 10) at p (n, 2), airspeed and acceleration."""
        own = np.stack(
            [np.clip(p[:, i], *s) for i, s in zip(self.scheduled, self.box, strict=True)]
        )
        at = own[0] if len(own) == 1 else own.T
        return np.tensordot(self.model.basis(at), self.coefficients, axes=1)

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """Range of each parameter."""
        return self.model.basis.ranges

    @property
    def scheduled(self) -> list[int]:
        """Position of each parameter among airspeed and acceleration."""
        return indices([s.name for s in self.model.parameters], SCHEDULING, "scheduling parameter")

    def init(self, command: ArrayLike | None = None, *, fade: float = 1.0) -> Array | Entered:
        """The states x (n,) before a flight: zero.

        With `command` (ny,), rad, the one in force now for each output of the model: the first step
        answers just that, whatever is measured then, and what it differs by from the controller's
        own fades away with the time constant `fade`, s. Such a flight is an `Entered` one.

        Raises `InputError` for another number of commands, or no positive time.
        """
        x = _held(np.zeros(self.order))
        if command is None:
            return x
        commanded = frozen(command, "command", (len(self.model.outputs),))
        left = math.exp(-self.dt / positive(fade, "fade"))
        return Entered(x, np.zeros(len(INPUTS)), commanded, left)

    def step(
        self,
        state: Array | Entered,
        measured: NamedVector,
        reference: NamedVector,
        p: NamedVector,
    ) -> tuple[Array, Array | Entered]:
        """Commands (4,), rad, and the states x (n,) of the next sample; see `PureController`."""
        if isinstance(state, Entered):
            return self._after_entry(state, measured, reference, p)
        if np.shape(state) != (self.order,):
            raise InputError(
                f"state: expected the {self.order} numbers of init() or of the step before, got"
                f" {state!r:.80}"
            )
        error = np.array(
            [measured[s] - reference[s] if s in measured else 0.0 for s in CONTROLLER_INPUTS]
        )
        at = [measured["airspeed"], 0.0] if self.follow == "reading" else list(p.array)
        M, n = self.matrices(np.array([at]))[0], self.order
        answer = M @ np.concatenate([state, error])
        return np.array([reference[s] for s in INPUTS]) + answer[n:], _held(answer[:n].copy())

    def _after_entry(
        self, state: Entered, measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, Entered]:
        u, x = self.step(state.x, measured, reference, p)
        offset = state.offset
        if state.command is not None:
            offset = np.zeros(len(INPUTS))
            offset[self.rows] = state.command - u[self.rows]
        assert not isinstance(x, Entered)  # noqa: S101 - the step of plain states
        return u + offset, Entered(x, _held(state.left * offset), None, state.left)


class Entered(NamedTuple):
    """State of a controller that took over in flight: its states `x` (n,), what is left of the
    `offset` (4,), rad, of its commands, of which the part `left` is there a sample later, and the
    `command` (ny,), rad, to begin with; None once it has begun.
    """

    x: Array
    offset: Array
    command: Array | None
    left: float


def _held(state: Array) -> Array:
    """The same, not to be written to."""
    state.flags.writeable = False
    return state


def require_parameters(
    what: str, model: LPVStateSpace, known: Sequence[Signal] = SCHEDULING
) -> None:
    """Raises `InputError` where a parameter of the model is none of these, or in another unit."""
    for s in model.parameters:
        if not any(s.name == k and s.unit == k.unit for k in known):
            raise InputError(
                f"{what}; this model is scheduled by {s.name} ({s.unit}): where that is one of"
                " them under another name or in another unit, .with_scheduling(Scheduling(name,"
                " unit, low, high, rate)) brings it to that"
            )


def require_names(kind: str, given: Sequence[str], known: Sequence[str]) -> None:
    """Raise `InputError` if a signal of a controller is not among the known ones."""
    try:
        indices(given, known, kind)
    except UnknownNameError as error:
        raise InputError(
            f"unknown name of a signal of the controller: {error}; use the names of the flight:"
            " inputs are measured minus reference, outputs are added to the trim"
        ) from error


def _powers(bernstein: Array, width: float) -> Array:
    """Coefficients (degree + 1, n), highest power of p - low first, of Bernstein ones (n, degree +
    1).
    """
    d = bernstein.shape[1] - 1
    powers = [
        comb(d, k)
        * sum((-1) ** (k - i) * comb(k, i) * bernstein[:, i] for i in range(k + 1))
        / width**k
        for k in range(d + 1)
    ]
    return np.stack(powers[::-1])


def controller_of(given: object, dt: float) -> PureController | StatefulController:
    """A controller from what a user gives: LTI models, python-control systems and LPV models (where
    continuous, sampled every `dt` seconds) become scheduled ones, the rest must answer by itself.
    """
    if hasattr(given, "scheduled_controller"):
        return given.scheduled_controller  # type: ignore[attr-defined]
    if isinstance(given, ScheduledController):
        return given
    if is_control_system(given):
        given = LinearModel.from_control(given)
    if isinstance(given, LinearModel | LPVStateSpace):
        sampled = given.discretize(dt) if given.dt is None else given
        return ScheduledController(
            LPVStateSpace.constant(sampled, EVERY_SPEED)
            if isinstance(sampled, LinearModel)
            else sampled
        )
    if isinstance(given, PureController | StatefulController) and not isinstance(given, type):
        return given
    raise InputError(
        f"controller: expected gains over airspeed (Autopilot), a LinearModel, an LPVStateSpace, a"
        " system of python-control, or an object with dt, reset() and step(measured, reference, p)"
        f" or dt, init() and step(state, measured, reference, p); got {type(given).__name__}"
    )
