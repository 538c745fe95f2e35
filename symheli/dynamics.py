"""The equations of motion: rigid body, drivetrain and the sum of the parts, with every parameter an
input.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

from symheli.airframe.part import InstalledPart
from symheli.codegen.symbolic import SX, Function, column, dense, jacobian, replaced
from symheli.components import AirMotion, Flow, unnamed
from symheli.errors import InputError
from symheli.physics import inflow
from symheli.physics.drivetrain import Drive, ideal_governor, pi_governor
from symheli.physics.rigid_body import (
    body_to_earth,
    euler_rates,
    gravity_euler,
    quaternion_rates,
    rotation,
    translation,
)
from symheli.values.kinematics import GRAVITY, INPUTS, RIGID_BODY, VELOCITIES
from symheli.values.signal import Signal, signals

QUATERNION = signals(("q0", "q1", "q2", "q3"))
POSITION = signals(("x_n", "x_e", "x_d"))

Governor = Literal["pi", "ideal"]
Name = Literal["rhs", "flight_rhs", "jacobian", "diagnostics"]
"""The functions a helicopter compiles."""

Triple = tuple[Any, Any, Any]


class Sum(NamedTuple):
    """Sum of the effects of all parts in one motion."""

    force: Triple
    moment: Triple
    rates: dict[str, Any]
    added_inertia: Any
    speed_follows_yaw: float
    flow: dict[str, Any]
    switches: dict[str, Any]
    lam: list[Any]


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The equations of one arrangement of parts, without numbers: airframes that differ in numbers
    alone share them, compiled code too.

    entries: {section: {entry: name of the parameter it takes}}. `parameters`: their names and units
    in the order of the argument `par`, air density first. governor, printed, smoothing: as in
    `Helicopter`.
    """

    parts: Mapping[str, InstalledPart]
    entries: Mapping[str, Mapping[str, str]]
    parameters: tuple[Signal, ...]
    governor: Governor
    printed: frozenset[str]
    smoothing: float

    @cached_property
    def own_states(self) -> tuple[Signal, ...]:
        """States of the parts, and Om om_i where the governor is "pi"."""
        own = [s for part in self.order for s in part.states]
        return signals([*own, *(("Om", "om_i") if self.governor == "pi" else ())])

    @property
    def states(self) -> tuple[Signal, ...]:
        """States of the Euler form."""
        return (*RIGID_BODY, *self.own_states)

    @property
    def flight_states(self) -> tuple[Signal, ...]:
        """States of the quaternion form."""
        return (*VELOCITIES, *QUATERNION, *POSITION, *self.own_states)

    @cached_property
    def order(self) -> tuple[InstalledPart, ...]:
        """The parts ordered by the flow they need."""
        waiting = dict(self.parts)
        order: list[InstalledPart] = []
        made: set[str] = set()
        while waiting:
            ready = [name for name, part in waiting.items() if set(part.needs) <= made]
            if not ready:
                lacking = sorted({n for part in waiting.values() for n in part.needs} - made)
                raise InputError(
                    f"{', '.join(waiting)} need flow quantities that no earlier part computes:"
                    f" {', '.join(lacking)}; known: {', '.join(sorted(made))}"
                )
            for name in ready:
                order.append(waiting.pop(name))
                made |= set(order[-1].makes)
        return tuple(order)

    def function(self, name: Name, values: Sequence[float] | None = None) -> Function:
        """(x, u, wind, par) -> ..., or with `values` of the parameters written into it (x, u, wind)
        -> ...; see `Helicopter`.
        """
        states = self.flight_states if name == "flight_rhs" else self.states
        arguments = {
            "x": SX.sym("x", len(states)),
            "u": SX.sym("u", len(INPUTS)),
            "wind": SX.sym("wind", 3),
        }
        par: Any = values
        if values is None:
            par = arguments["par"] = SX.sym("par", len(self.parameters))
        x, u, wind = arguments["x"], arguments["u"], arguments["wind"]
        outputs = {
            "rhs": self._rhs,
            "flight_rhs": self._flight_rhs,
            "jacobian": self._jacobian,
            "diagnostics": self._diagnostics,
        }[name](x, u, wind, par)
        return Function(
            name, list(arguments.values()), list(outputs.values()), list(arguments), list(outputs)
        )

    def _rhs(self, x: SX, u: SX, wind: SX, par: Any) -> dict[str, SX]:
        return {"xdot": self.euler(x, u, wind, par, self.inflow_solver)[0]}

    def _flight_rhs(self, x: SX, u: SX, wind: SX, par: Any) -> dict[str, SX]:
        return {"xdot": self.quaternion(x, u, wind, par, self.inflow_solver)[0]}

    def _jacobian(self, x: SX, u: SX, wind: SX, par: Any) -> dict[str, SX]:
        blocks = self.derived(
            lambda solver: self.euler(x, u, wind, par, solver),
            lambda xdot: [jacobian(xdot, z) for z in (x, u, wind)],
        )
        return dict(zip(("A", "B", "E"), blocks, strict=True))

    def derived(
        self, form: Callable[[Callable[..., Any]], tuple[SX, Sum]], derive: Callable[[SX], list[SX]]
    ) -> list[SX]:
        """derive(xdot) of form(solver) -> xdot, sum, `euler` or `quaternion` at a point; exact
        through the implicit inflow.

        The inflow enters as a symbol advanced by one Newton step: its derivative there is that of
        the root. Only then is the solved value put in its place.
        """
        lam = form(self.inflow_solver)[1].lam
        symbol = SX.sym("lam", len(lam))
        position = iter(range(len(lam)))

        def step(*arguments: Any) -> Any:
            return inflow.newton_step(symbol[next(position)], *arguments)

        return replaced(derive(form(step)[0]), symbol, column(lam))

    def _diagnostics(self, x: SX, u: SX, wind: SX, par: Any) -> dict[str, SX]:
        xdot, total = self.euler(x, u, wind, par, self.inflow_solver)
        # a rotor held at constant speed is turned with the body: the engine's torque and its
        # reaction on the body say so
        held = total.added_inertia * xdot[5]
        wrench = dict(
            zip("XYZLMN", (*total.force, *total.moment[:2], total.moment[2] - held), strict=True)
        )
        values = {
            **total.flow,
            "Q_e": total.flow["Q_e"] + held,
            **wrench,
            **{f"switch {k}": v for k, v in total.switches.items()},
        }
        return {name.replace(" ", "_"): dense(v) for name, v in values.items()}

    # --- the sum of the parts; floats, arrays and CasADi expressions alike -----------------------

    def euler(
        self, x: Any, u: Any, wind: Any, par: Any, solver: Callable[..., Any]
    ) -> tuple[Any, Sum]:
        """State derivative in Euler form, wind in body axes, with `solver` for the inflow
        (`symheli.physics.inflow`); and the sum of the parts.
        """
        air = _triple(lambda i: x[i] - wind[i])
        phi, theta = x[6], x[7]
        accelerations, own, total = self._accelerations(
            x, air, gravity_euler(phi, theta), self._own(x, 8), u, par, solver
        )
        attitude = euler_rates(phi, theta, x[3], x[4], x[5])[:2]
        return column([*accelerations, *attitude, *own]), total

    def quaternion(
        self, x: Any, u: Any, wind: Any, par: Any, solver: Callable[..., Any]
    ) -> tuple[Any, Sum]:
        """State derivative in quaternion form, wind in earth axes; and the sum of the parts."""
        quaternion = (x[6], x[7], x[8], x[9])
        R = body_to_earth(*quaternion)
        air = _triple(lambda i: x[i] - sum(R[j][i] * wind[j] for j in range(3)))
        gravity = _triple(lambda i: R[2][i] * GRAVITY)
        accelerations, own, total = self._accelerations(
            x, air, gravity, self._own(x, 13), u, par, solver
        )
        position = [sum(R[j][i] * x[i] for i in range(3)) for j in range(3)]
        return (
            column(
                [*accelerations, *quaternion_rates(*quaternion, x[3], x[4], x[5]), *position, *own]
            ),
            total,
        )

    def accelerations(self, x: Any, u: Any, wind: Any, par: Any) -> list[Any]:
        """u' v' w' p' q' r' and the derivatives of the own states, Euler form, as a list: no CasADi
        where the arguments are floats.
        """
        air = _triple(lambda i: x[i] - wind[i])
        body, own, _ = self._accelerations(
            x, air, gravity_euler(x[6], x[7]), self._own(x, 8), u, par, self.inflow_solver
        )
        return [*body, *own]

    def _accelerations(
        self,
        x: Any,
        air: Triple,
        gravity: Triple,
        own: dict[str, Any],
        u: Any,
        par: Any,
        solver: Callable[..., Any],
    ) -> tuple[list[Any], list[Any], Sum]:
        """(u' v' w' p' q' r'), derivatives of the own states, and the sum."""
        parameters = self._sections(par)
        body = parameters["body"]
        velocity, rates = _triple(lambda i: x[i]), _triple(lambda i: x[3 + i])
        total = self._sum(air, rates, own, u, parameters, par[0], solver)
        linear = translation(*velocity, *rates, gravity, total.force, body.mass)
        angular = rotation(*rates, total.moment, body.Ixx, body.Iyy, body.Izz, total.added_inertia)
        derivatives = dict(total.rates)
        if "Om" in derivatives:
            derivatives["Om"] = derivatives["Om"] + total.speed_follows_yaw * angular[2]
        return [*linear, *angular], [derivatives[s] for s in self.own_states], total

    def _sum(
        self,
        air: Triple,
        rates: Triple,
        own: dict[str, Any],
        u: Any,
        parameters: Mapping[str, SimpleNamespace],
        density: Any,
        solver: Callable[..., Any],
    ) -> Sum:
        drivetrain = parameters["drivetrain"]
        motion = AirMotion(
            *air,
            *rates,
            Om=own["Om"] if self.governor == "pi" else drivetrain.nominal_speed,
            rho=density,
        )
        controls = {str(name): u[i] for i, name in enumerate(INPUTS)}
        lam: list[Any] = []

        def solve(*arguments: Any) -> Any:
            lam.append(solver(*arguments))
            return lam[-1]

        flow = Flow(solve)
        effects = []
        for part in self.order:
            effect = part.evaluate(parameters[part.section], motion, controls, own, flow)
            flow.values.update(effect.flow)
            effects.append(effect)
        shaft_torque = sum(effect.shaft_torque for effect in effects)
        drive = self.drive(drivetrain, shaft_torque, own)
        force = _triple(lambda i: sum(effect.force[i] for effect in effects))
        moment = _triple(
            lambda i: (
                sum(effect.moment[i] for effect in effects) - (drive.torque if i == 2 else 0.0)
            )
        )
        return Sum(
            force,
            moment,
            {name: value for effect in effects for name, value in effect.rates.items()}
            | drive.rates,
            drive.added_inertia,
            drive.speed_follows_yaw,
            {**flow.values, "Q_e": drive.torque},
            {name: value for effect in effects for name, value in effect.switches.items()},
            lam,
        )

    def drive(
        self,
        par: SimpleNamespace,
        shaft_torque: Any,
        own: Mapping[str, Any],
        name: Callable[[str, Any], Any] = unnamed,
    ) -> Drive:
        """Engine torque and rotor speed with this governor; `own` has Om and om_i where it is "pi",
        `name` is as in `Flow`.
        """
        if self.governor == "pi":
            return pi_governor(par, shaft_torque, own["Om"], own["om_i"], name)
        return ideal_governor(par, shaft_torque)

    @property
    def inflow_solver(self) -> Callable[..., Any]:
        """The solver of a rotor's inflow: `inflow.solve`, or the printed form."""
        return inflow.relaxed if "relaxed_inflow" in self.printed else inflow.solve

    def _sections(self, par: Any) -> dict[str, SimpleNamespace]:
        """The parameters as the parts read them: `par.radius`."""
        at = {str(name): par[i] for i, name in enumerate(self.parameters)}
        extra = {
            "printed": self.printed,
            "smoothing": self.smoothing,
            "weight": at[self.entries["body"]["mass"]] * GRAVITY,
        }
        return {
            section: SimpleNamespace(**{e: at[name] for e, name in of.items()}, **extra)
            for section, of in self.entries.items()
        }

    def _own(self, x: Any, first: int) -> dict[str, Any]:
        return {str(s): x[first + i] for i, s in enumerate(self.own_states)}


def _triple(entry: Callable[[int], Any]) -> Triple:
    """A vector from its entries by index."""
    return entry(0), entry(1), entry(2)
