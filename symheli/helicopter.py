"""The helicopter: the sum of its parts, as compiled functions of state, input and wind."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from symheli import inflow
from symheli.compile import compiled
from symheli.components import Flow, Motion
from symheli.drivetrain import ideal_governor, pi_governor
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.signal import Signal, signals
from symheli.numeric import Numeric
from symheli.rigid_body import GRAVITY, body_to_earth, euler_rates, gravity_euler, quaternion_rates, rotation, translation
from symheli.symbolic import SX, Function, column, dense, jacobian
from symheli.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from symheli.equations import RightHandSide

PRINTED = ("lateral_flapping", "fuselage_downwash", "rotor_reaction")
"""Options that bring back a sign as printed in G15 where this project decided otherwise; see docs/model.md."""

VELOCITY = signals(("u", "v", "w", "p", "q", "r"))
ATTITUDE = signals(("phi", "theta"))
QUATERNION = signals(("q0", "q1", "q2", "q3"))
POSITION = signals(("x_n", "x_e", "x_d"))
WIND = signals(("u_w", "v_w", "w_w"))
INPUTS = signals(("d_lon", "d_lat", "d_col", "d_ped"))

Governor = Literal["pi", "ideal"]
Triple = tuple[Any, Any, Any]


def _triple(entry: Callable[[int], Any]) -> Triple:
    """A vector from its entries by index."""
    return entry(0), entry(1), entry(2)


@dataclass(frozen=True)
class _Sum:
    """Everything the parts say at one motion."""

    force: Triple
    moment: Triple
    rates: dict[str, Any]
    added_inertia: Any
    speed_follows_yaw: float
    flow: dict[str, Any]
    switches: dict[str, Any]
    lam: list[Any]


@dataclass(frozen=True)
class Helicopter:
    """An airframe with a governor in air of constant density, as CasADi functions with named signals.

    `states` (Euler form: u v w p q r phi theta, component states a1 b1, and Om om_i where `governor` is "pi"), `inputs`
    (d_lon d_lat d_col d_ped) and `wind` (u_w v_w w_w, body axes) are `Signal`s that carry their unit; SI and radians.

    governor: "pi" (engine and governor dynamics, 12 states) or "ideal" (rotor speed held exactly, 10 states).
    density: air density, kg/m^3. printed: names from `PRINTED`. smoothing: rounds wake edges and force limits (0: as printed).
    """

    vehicle: Vehicle
    governor: Governor = "pi"
    density: float = 1.225
    printed: frozenset[str] = frozenset()
    smoothing: float = 0.0

    def __post_init__(self) -> None:
        if self.governor not in ("pi", "ideal"):
            raise UnknownNameError("governor", self.governor, ("pi", "ideal"))
        if not (np.isfinite(self.density) and self.density > 0):
            raise InputError(f"density must be positive (kg/m^3; 1.225 at sea level), got {self.density}")
        if not self.smoothing >= 0:
            raise InputError(f"smoothing must be >= 0, got {self.smoothing}")
        for name in self.printed:
            if name not in PRINTED:
                raise UnknownNameError("printed option", name, PRINTED)

    @classmethod
    def load(
        cls,
        vehicle: str | os.PathLike[str],
        governor: Governor = "pi",
        density: float = 1.225,
        printed: Sequence[str] = (),
        smoothing: float = 0.0,
    ) -> Helicopter:
        """By the name of a packaged airframe (`symheli.vehicle.vehicles()`) or the path of a vehicle TOML file."""
        return cls(load_vehicle(vehicle), governor, float(density), frozenset(printed), float(smoothing))

    # --- signals -----------------------------------------------------------------------------------------------

    @cached_property
    def states(self) -> tuple[Signal, ...]:
        """States of the Euler form, in order."""
        return (*VELOCITY, *ATTITUDE, *self._own_states)

    @cached_property
    def flight_states(self) -> tuple[Signal, ...]:
        """States of the quaternion form: velocities and rates, quaternion (scalar first), position north east down, the rest."""
        return (*VELOCITY, *QUATERNION, *POSITION, *self._own_states)

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """d_lon d_lat d_col d_ped, rad; d_ped is the total tail blade pitch."""
        return INPUTS

    @property
    def wind(self) -> tuple[Signal, ...]:
        """Wind in body axes (Euler form), m/s."""
        return WIND

    @cached_property
    def travel(self) -> np.ndarray:
        """Largest deflection of each input (4,), rad, symmetric."""
        limits = self.vehicle.values("controls")
        return np.array([limits[name] for name in self.inputs])

    @cached_property
    def nominal_speed(self) -> float:
        """Commanded rotor speed, rad/s."""
        return self.vehicle.sections["drivetrain"]["nominal_speed"].value

    @cached_property
    def _own_states(self) -> tuple[Signal, ...]:
        own = [s for name in self._order for s in self.vehicle.components[name].states]
        return signals([*own, *(("Om", "om_i") if self.governor == "pi" else ())])

    # --- functions ---------------------------------------------------------------------------------------------

    @cached_property
    def rhs(self) -> Function:
        """(x, u, wind) -> xdot in Euler form; wind in body axes. Symbolic: call it with numbers or CasADi expressions."""
        return self._function("rhs", lambda x, u, w: [self._euler(x, u, w, inflow.solve)[0]], ["xdot"])

    @cached_property
    def flight_rhs(self) -> Function:
        """(x, u, wind) -> xdot in quaternion form with position; wind in earth axes (north east down)."""
        return self._function("flight_rhs", lambda x, u, w: [self._quaternion(x, u, w)], ["xdot"], self.flight_states)

    @cached_property
    def jacobian(self) -> Function:
        """(x, u, wind) -> A (nx, nx), B (nx, 4), E (nx, 3): derivatives of xdot, algorithmic, exact through the implicit inflow.

        The inflow enters as a symbol advanced by one Newton step: its derivative there is that of the root. Only then is
        the solved value put in its place.
        """

        def build(x: SX, u: SX, w: SX) -> list[SX]:
            lam = self._euler(x, u, w, inflow.solve)[1].lam
            symbol = SX.sym("lam", len(lam))
            position = iter(range(len(lam)))

            def step(*arguments: Any) -> Any:
                return inflow.newton_step(symbol[next(position)], *arguments)

            xdot = self._euler(x, u, w, step)[0]
            blocks = [jacobian(xdot, z) for z in (x, u, w)]
            return Function("J", [x, u, w, symbol], blocks).call([x, u, w, column(lam)], True, False)

        return self._function("jacobian", build, ["A", "B", "E"])

    @cached_property
    def implicit(self) -> Function:
        """(x, u, wind, lam) -> xdot, balance: as `rhs`, with the inflow ratio of each rotor given, and the residual of its
        momentum balance, which is 0 where lam is the inflow."""
        lam: list[SX] = []

        def unknown() -> SX:
            lam.append(SX.sym(f"lam_{len(lam)}"))
            return lam[-1]

        x, u, w = SX.sym("x", len(self.states)), SX.sym("u", 4), SX.sym("wind", 3)
        xdot, balance = self.with_inflow(x, u, w, unknown)
        return Function("implicit", [x, u, w, column(lam)], [xdot, balance], ["x", "u", "wind", "lam"], ["xdot", "balance"])

    def with_inflow(self, x: Any, u: Any, wind: Any, unknown: Callable[[], Any]) -> tuple[Any, Any]:
        """(xdot, balance) of the Euler form in CasADi or SymPy expressions; `unknown()` makes the inflow ratio of the next rotor.

        `balance` is the residual of each rotor's momentum balance, 0 where the unknown is its inflow ratio.
        """
        balance: list[Any] = []

        def solver(*arguments: Any) -> Any:
            lam = unknown()
            balance.append(inflow.residual(lam, *arguments))
            return lam

        xdot, _ = self._euler(x, u, wind, solver)
        return xdot, column(balance)

    def sympy(self) -> RightHandSide:
        """The Euler form in SymPy, with symbols for parameters and inflow; see `symheli.equations.RightHandSide`."""
        from symheli.equations import right_hand_side

        return right_hand_side(self)

    def compiled(self, name: Literal["rhs", "flight_rhs", "jacobian", "diagnostics"]) -> Function:
        """One of the functions as machine code where a C compiler is there: the same numbers, faster, numbers only."""
        return self.numeric(name).function

    def numeric(self, name: Literal["rhs", "flight_rhs", "jacobian", "diagnostics"]) -> Numeric:
        """The compiled function as a fast call on NumPy arrays."""
        kept = self.__dict__.setdefault("_numeric", {})
        if name not in kept:
            kept[name] = Numeric(compiled(getattr(self, name)))
        return kept[name]

    @cached_property
    def diagnostics(self) -> Function:
        """(x, u, wind) -> every flow quantity and switching function by name (see `Effect`), and the total force X Y Z (N) and
        moment L M N (N m) of the air and the engine's reaction on the body."""
        x, u, w = SX.sym("x", len(self.states)), SX.sym("u", 4), SX.sym("wind", 3)
        total = self._euler(x, u, w, inflow.solve)[1]
        wrench = dict(zip("XYZLMN", (*total.force, *total.moment), strict=True))
        values = {**total.flow, **wrench, **{f"switch: {k}": v for k, v in total.switches.items()}}
        names = [name.replace(": ", "_").replace(" ", "_") for name in values]
        return Function("diagnostics", [x, u, w], [dense(v) for v in values.values()], ["x", "u", "wind"], names)

    def switches(self, x: object, u: object, wind: object = (0.0, 0.0, 0.0)) -> dict[str, float]:
        """Value of every switching function at a point."""
        values = zip(self.diagnostics.name_out(), self.numeric("diagnostics")(x, u, wind), strict=True)
        return {name.removeprefix("switch_").replace("_", " "): float(v[0]) for name, v in values if name.startswith("switch_")}

    # --- the sum of the parts ----------------------------------------------------------------------------------

    @cached_property
    def _order(self) -> list[str]:
        """Component sections ordered by the flow they need."""
        waiting = dict(self.vehicle.components)
        order: list[str] = []
        made: set[str] = set()
        while waiting:
            ready = [name for name, part in waiting.items() if set(part.needs) <= made]
            if not ready:
                lacking = sorted({n for part in waiting.values() for n in part.needs} - made)
                raise InputError(f"components {', '.join(waiting)} need flow that no component makes: {', '.join(lacking)}")
            for name in ready:
                made |= set(waiting.pop(name).makes)
                order.append(name)
        return order

    @cached_property
    def _parameters(self) -> dict[str, SimpleNamespace]:
        extra = {"printed": self.printed, "smoothing": self.smoothing}
        return {section: SimpleNamespace(**self.vehicle.values(section), **extra) for section in self.vehicle.sections}

    def _sum(self, air: Triple, rates: Triple, own: dict[str, Any], u: Any, solver: Callable[..., Any]) -> _Sum:
        parameters = self._parameters
        speed = own["Om"] if self.governor == "pi" else self.nominal_speed
        motion = Motion(*air, *rates, Om=speed, rho=self.density)
        controls = {str(name): u[i] for i, name in enumerate(self.inputs)}
        lam: list[Any] = []

        def solve(*arguments: Any) -> Any:
            lam.append(solver(*arguments))
            return lam[-1]

        flow = Flow(solve)
        effects = []
        for section in self._order:
            effect = self.vehicle.components[section].evaluate(parameters[section], motion, controls, own, flow)
            flow.values.update(effect.flow)
            effects.append(effect)
        shaft_torque = sum(effect.shaft_torque for effect in effects)
        drivetrain = parameters["drivetrain"]
        drive = (
            pi_governor(drivetrain, shaft_torque, own["Om"], own["om_i"])
            if self.governor == "pi"
            else ideal_governor(drivetrain, shaft_torque)
        )
        force = _triple(lambda i: sum(effect.force[i] for effect in effects))
        moment = _triple(lambda i: sum(effect.moment[i] for effect in effects) - (drive.torque if i == 2 else 0.0))
        rates_of_own = {name: value for effect in effects for name, value in effect.rates.items()} | drive.rates
        switches = {name: value for effect in effects for name, value in effect.switches.items()}
        return _Sum(
            force, moment, rates_of_own, drive.added_inertia, drive.speed_follows_yaw,
            {**flow.values, "Q_e": drive.torque}, switches, lam,
        )  # fmt: skip

    def _accelerations(self, x: Any, air: Triple, gravity: Triple, own: dict[str, Any], u: Any, solver: Callable[..., Any]) -> Any:
        """(u' v' w' p' q' r'), derivatives of the own states, and the sum."""
        body = self._parameters["body"]
        velocity, rates = _triple(lambda i: x[i]), _triple(lambda i: x[3 + i])
        total = self._sum(air, rates, own, u, solver)
        linear = translation(*velocity, *rates, gravity, total.force, body.mass)
        angular = rotation(*rates, total.moment, body.Ixx, body.Iyy, body.Izz, total.added_inertia)
        derivatives = dict(total.rates)
        if "Om" in derivatives:
            derivatives["Om"] = derivatives["Om"] + total.speed_follows_yaw * angular[2]
        return (*linear, *angular), [derivatives[s] for s in self._own_states], total

    def _own(self, x: Any, first: int) -> dict[str, Any]:
        return {str(s): x[first + i] for i, s in enumerate(self._own_states)}

    def _euler(self, x: Any, u: Any, wind: Any, solver: Callable[..., Any]) -> tuple[Any, _Sum]:
        air = _triple(lambda i: x[i] - wind[i])
        phi, theta = x[6], x[7]
        accelerations, own, total = self._accelerations(x, air, gravity_euler(phi, theta), self._own(x, 8), u, solver)
        attitude = euler_rates(phi, theta, x[3], x[4], x[5])[:2]
        return column([*accelerations, *attitude, *own]), total

    def _quaternion(self, x: Any, u: Any, wind: Any) -> Any:
        quaternion = (x[6], x[7], x[8], x[9])
        R = body_to_earth(*quaternion)
        air = _triple(lambda i: x[i] - sum(R[j][i] * wind[j] for j in range(3)))
        gravity = _triple(lambda i: R[2][i] * GRAVITY)
        accelerations, own, _ = self._accelerations(x, air, gravity, self._own(x, 13), u, inflow.solve)
        position = [sum(R[j][i] * x[i] for i in range(3)) for j in range(3)]
        return column([*accelerations, *quaternion_rates(*quaternion, x[3], x[4], x[5]), *position, *own])

    def _function(
        self, name: str, build: Callable[[SX, SX, SX], list[SX]], outputs: list[str], states: tuple[Signal, ...] | None = None
    ) -> Function:
        x, u, w = SX.sym("x", len(states or self.states)), SX.sym("u", 4), SX.sym("wind", 3)
        return Function(name, [x, u, w], build(x, u, w), ["x", "u", "wind"], outputs)
