"""The helicopter: an airframe in air, as compiled functions of state, input and wind."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np

from symheli.airframe.printed_forms import PRINTED
from symheli.airframe.vehicle import Vehicle, load_vehicle
from symheli.codegen.compile import compiled
from symheli.codegen.numeric import Numeric
from symheli.codegen.symbolic import SX, Function, column
from symheli.dynamics import Dynamics, Governor, Name
from symheli.environment import standard_atmosphere
from symheli.errors import InputError, UnknownNameError
from symheli.physics import inflow
from symheli.values.html_table import as_table
from symheli.values.kinematics import INPUTS
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, signals

if TYPE_CHECKING:
    from symheli.equations import RightHandSide

WIND = signals(("u_w", "v_w", "w_w"))
DENSITY = Signal("density", "kg/m^3")


def require(heli: object, call: str) -> None:
    """Raises `InputError` that shows `call` as it is meant, where this is no helicopter."""
    if not isinstance(heli, Helicopter):
        raise InputError(
            f"expected a Helicopter first, got {heli!r:.80}: {call}, with heli ="
            " Helicopter.load('xcell60')"
        )


@dataclass(frozen=True)
class Helicopter:
    """A helicopter is an airframe with a governor in air of constant density: its equations of
    motion as CasADi functions with named signals.

    `states` (Euler form: u v w p q r phi theta, component states a1 b1, and Om om_i where
    `governor` is "pi"), `inputs` (d_lon d_lat d_col d_ped) and `wind` (u_w v_w w_w, body axes) are
    `Signal`s that carry their unit; SI and radians.

    Parameters
    ----------
    vehicle : Vehicle
        The numbers, with units and sources; `load` reads them from a packaged or another file.
    governor : {"pi", "ideal"}
        Engine and governor dynamics (12 states), or rotor speed held exactly (10 states).
    density : float
        Of the air, kg/m^3.
    printed : frozenset of str
        Names from `PRINTED`: equations as they were printed, where the code corrects them.
    smoothing : float
        Rounds wake edges and force limits; 0: as printed.

    Raises
    ------
    InputError
        An unknown governor, a density that is not positive, a vehicle that lacks a number.

    See Also
    --------
    symheli.vehicles : airframes that come along
    symheli.trim : one steady flight
    symheli.fly : one closed-loop flight

    References
    ----------
    Gavrilets (2015), Dynamic model for a miniature aerobatic helicopter, Handbook of Unmanned
    Aerial Vehicles, Springer.

    Examples
    --------
    >>> [str(s) for s in heli.states]
    ['u', 'v', 'w', 'p', 'q', 'r', 'phi', 'theta', 'a1', 'b1']
    >>> heli.inputs[0].unit, round(float(heli.nominal_speed))
    ('rad', 167)
    """

    vehicle: Vehicle
    governor: Governor = "pi"
    density: float = 1.225
    printed: frozenset[str] = frozenset()
    smoothing: float = 0.0

    _repr_html_ = as_table

    def __repr__(self) -> str:
        options = "".join(
            f", {field.name}={value!r}"
            for field in fields(self)[1:]
            if (value := getattr(self, field.name)) != field.default or field.name == "governor"
        )
        return f"Helicopter({self.vehicle.name!r}{options}): {self.vehicle.title}"

    def __post_init__(self) -> None:
        if not isinstance(self.vehicle, Vehicle):
            raise InputError(
                f"vehicle: expected a Vehicle, got {self.vehicle!r:.60}; a packaged airframe or a"
                f" file is loaded by Helicopter.load({self.vehicle!r:.60})"
            )
        if self.governor not in ("pi", "ideal"):
            raise UnknownNameError("governor", self.governor, ("pi", "ideal"))
        if not (np.isfinite(self.density) and self.density > 0):
            raise InputError(
                f"density must be positive (kg/m^3; 1.225 at sea level), got {self.density}"
            )
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
        *,
        allow_code: bool = False,
    ) -> Helicopter:
        """Load a packaged airframe by name (`symheli.airframe.vehicle.vehicles()`) or a vehicle
        TOML file by path. With `allow_code` the Python files that it names as parts are run.
        """
        if isinstance(printed, str):
            raise InputError(f"printed: expected a list of names, such as [{printed!r}]")
        loaded = load_vehicle(vehicle, allow_code=allow_code)
        return cls(loaded, governor, float(density), frozenset(printed), float(smoothing))

    def __getstate__(self) -> dict[str, Any]:
        """The airframe and its options, without what was built from them: CasADi's functions cross
        no process border.
        """
        return {field.name: getattr(self, field.name) for field in fields(self)}

    # --- other numbers, same equations -----------------------------------------------------------

    @cached_property
    def parameters(self) -> NamedVector:
        """Every number of the model by name, in SI: "density", "body.mass", "main_rotor.radius",
        ...
        """
        return NamedVector(self.dynamics.parameters, np.array(self._values))

    def with_parameters(
        self, changes: Mapping[str, float] | None = None, **entries: float
    ) -> Helicopter:
        """Return the same helicopter with other numbers, {"body.mass": 9.0, "density": 1.1} in SI;
        names as in `parameters`.

        Nothing is built or compiled anew: the compiled functions take the parameters as an
        argument. Raises `InputError` for names and values that cannot be.
        """
        if entries or not isinstance(changes, Mapping):
            given = next(iter(entries), "mass")
            ending = f".{given}"
            known = [n for n in map(str, self.parameters.signals) if n.endswith(ending)]
            raise InputError(
                "with_parameters: give one mapping from the names of .parameters to numbers in SI,"
                f" such as with_parameters({{{(known or ['body.mass'])[0]!r}:"
                f" {entries.get(given, 9.0):g}}})"
            )
        density = changes.get(DENSITY, self.density)
        vehicle = self.vehicle.with_values(
            {name: value for name, value in changes.items() if name != DENSITY}
        )
        return self._sharing(replace(self, vehicle=vehicle, density=density))

    def in_air(self, density: float) -> Helicopter:
        """Return the same helicopter in air of this density, kg/m^3."""
        return self if density == self.density else self.with_parameters({"density": density})

    def at_altitude(self, altitude: float) -> Helicopter:
        """Return the same helicopter in the air of the standard atmosphere at `altitude` (m above
        sea level).
        """
        return self.in_air(standard_atmosphere(altitude).density)

    def scaled(self, factor: float) -> Helicopter:
        """The dynamically similar helicopter whose lengths are `factor` N times these, in the same
        air; see `Vehicle.scaled`.

        Its trim at sqrt(N) times the airspeed is the same in angles, its eigenvalues are N^-0.5
        times these.
        """
        return self._sharing(replace(self, vehicle=self.vehicle.scaled(factor)))

    def _sharing(self, other: Helicopter) -> Helicopter:
        other.__dict__.update(dynamics=self.dynamics, _functions=self._functions)
        return other

    @cached_property
    def dynamics(self) -> Dynamics:
        """The equations of motion of this arrangement of parts, with every parameter an input."""
        own = self.vehicle.quantities
        return Dynamics(
            self.vehicle.components,
            {
                s: {e: q.ref or f"{s}.{e}" for e, q in entries.items()}
                for s, entries in self.vehicle.sections.items()
            },
            (DENSITY, *(Signal(name, q.unit) for name, q in own.items())),
            self.governor,
            self.printed,
            self.smoothing,
        )

    @cached_property
    def _functions(self) -> dict[str, Function]:
        """Compiled functions of (x, u, wind, par) by name, built on first use."""
        return {}

    @cached_property
    def _values(self) -> list[float]:
        return [self.density, *(q.value for q in self.vehicle.quantities.values())]

    # --- signals ---------------------------------------------------------------------------------

    @cached_property
    def states(self) -> tuple[Signal, ...]:
        """States of the Euler form, in order."""
        return self.dynamics.states

    @cached_property
    def flight_states(self) -> tuple[Signal, ...]:
        """States of the quaternion form: velocities and rates, quaternion (scalar first), position
        north east down, the rest.
        """
        return self.dynamics.flight_states

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

    # --- functions -------------------------------------------------------------------------------

    @cached_property
    def rhs(self) -> Function:
        """(x, u, wind) -> xdot in Euler form; wind in body axes. Symbolic: call it with numbers or
        CasADi expressions.
        """
        return self.dynamics.function("rhs", self._values)

    @cached_property
    def flight_rhs(self) -> Function:
        """(x, u, wind) -> xdot in quaternion form with position; wind in earth axes (north east
        down).
        """
        return self.dynamics.function("flight_rhs", self._values)

    @cached_property
    def jacobian(self) -> Function:
        """(x, u, wind) -> A (nx, nx), B (nx, 4), E (nx, 3): derivatives of xdot, algorithmic, exact
        through the implicit inflow.
        """
        return self.dynamics.function("jacobian", self._values)

    @cached_property
    def diagnostics(self) -> Function:
        """(x, u, wind) -> every flow quantity and switching function by name (see `Effect`), and
        the total force X Y Z (N) and moment L M N (N m) of the air and the engine's reaction on the
        body.
        """
        return self.dynamics.function("diagnostics", self._values)

    @cached_property
    def implicit(self) -> Function:
        """(x, u, wind, lam) -> xdot, balance: as `rhs`, with the inflow ratio of each rotor given,
        and the residual of its momentum balance, which is 0 where lam is the inflow.
        """
        lam: list[SX] = []

        def unknown() -> SX:
            lam.append(SX.sym(f"lam_{len(lam)}"))
            return lam[-1]

        x, u, w = SX.sym("x", len(self.states)), SX.sym("u", 4), SX.sym("wind", 3)
        xdot, balance = self.with_inflow(x, u, w, unknown)
        return Function(
            "implicit",
            [x, u, w, column(lam)],
            [xdot, balance],
            ["x", "u", "wind", "lam"],
            ["xdot", "balance"],
        )

    @cached_property
    def inflow(self) -> Function:
        """(x, u, wind) -> lam: the solved inflow ratio of each rotor, as `implicit` takes them."""
        x, u, w = SX.sym("x", len(self.states)), SX.sym("u", 4), SX.sym("wind", 3)
        solved = self.dynamics.euler(x, u, w, self._values, self.dynamics.inflow_solver)[1].lam
        return Function("inflow", [x, u, w], [column(solved)], ["x", "u", "wind"], ["lam"])

    def with_inflow(
        self,
        x: Any,
        u: Any,
        wind: Any,
        unknown: Callable[[], Any],
        par: Sequence[Any] | None = None,
    ) -> tuple[Any, Any]:
        """(xdot, balance) of the Euler form in CasADi or SymPy expressions; `unknown()` makes the
        inflow ratio of the next rotor.

        `balance` is the residual of each rotor's momentum balance, 0 where the unknown is its
        inflow ratio. `par` has an expression for each of `parameters`, whose values are taken
        without it.
        """
        balance: list[Any] = []

        def solver(*arguments: Any) -> Any:
            lam = unknown()
            balance.append(inflow.residual(lam, *arguments))
            return lam

        xdot, _ = self.dynamics.euler(x, u, wind, self._values if par is None else par, solver)
        return xdot, column(balance)

    def sympy(self) -> RightHandSide:
        """The Euler form in SymPy, with symbols for parameters and inflow; see
        `symheli.equations.RightHandSide`.
        """
        from symheli.equations import right_hand_side

        return right_hand_side(self)

    def latex(self, standalone: bool = False) -> str:
        """Return every component's equations and parameters in LaTeX: the body of a document, or
        with `standalone` a complete one.
        """
        from symheli.equations import latex

        return latex(self, standalone=standalone)

    def compiled(self, name: Name) -> Function:
        """Return one of the functions as machine code where a C compiler is installed: the same
        numbers, faster, numbers only.
        """
        function = self._compiled(name)
        symbols = [casadi.MX.sym(function.name_in(i), *function.size_in(i)) for i in range(3)]
        outputs = function.call([*symbols, casadi.DM(self._values)], False, False)
        return Function(name, symbols, outputs, function.name_in()[:3], function.name_out())

    def numeric(self, name: Name) -> Numeric:
        """Return the compiled function as a fast call on NumPy arrays."""
        kept = self.__dict__.setdefault("_numeric", {})
        if name not in kept:
            kept[name] = Numeric(self._compiled(name), self._values)
        return kept[name]

    def _compiled(self, name: Name) -> Function:
        if name not in self._functions:
            self._functions[name] = compiled(self.dynamics.function(name))
        return self._functions[name]

    def switches(self, x: object, u: object, wind: object = (0.0, 0.0, 0.0)) -> dict[str, float]:
        """Value of every switching function at a point."""
        function = self.numeric("diagnostics")
        values = zip(function.function.name_out(), function(x, u, wind), strict=True)
        return {
            name.removeprefix("switch_").replace("_", " "): float(v[0])
            for name, v in values
            if name.startswith("switch_")
        }
