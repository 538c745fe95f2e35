"""The equations of steady flight: CasADi functions, and machine code for many flights side by side,
with every parameter an input.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property
from importlib import resources
from typing import Any, Literal, NamedTuple

import casadi

from symheli.codegen import Layout, ScalarProgram, c_function, program
from symheli.codegen.compile import library, loaded
from symheli.codegen.numeric import Numeric
from symheli.codegen.symbolic import SX, Function, column, cos, dense, jacobian, sin
from symheli.dynamics import Dynamics, Sum
from symheli.helicopter import Helicopter
from symheli.steady.flight_condition import DEMAND
from symheli.values.kinematics import INPUTS
from symheli.values.signal import Signal, signals

SIDE_BY_SIDE = Layout(width=8)
"""Trims in vector registers at a time."""

Name = Literal["system", "point", "slopes"]


class Flight(NamedTuple):
    """A steady flight in symbols: its unknowns, what it is to have and the parameters; state, input
    and wind in body axes; the rates asked for, and those there are with the sum of the parts.
    """

    arguments: list[SX]
    x: SX
    u: SX
    wind: SX
    wanted: SX
    xdot: SX
    total: Sum


class SteadyEquations:
    """Unknowns z (phi theta, own states but the rotor speed, the four inputs) against the equations
    of motion.

    `system`: (z, demand, par) -> residual of every equation, derivative of the balanced ones with
    respect to z, row by row. `point`: (z, demand, par) -> x, wind in body axes, xdot, residual,
    switching functions, engine torque. `slopes`: (x, u, wind, par) -> A, B, E, row by row.
    """

    def __init__(self, dynamics: Dynamics):
        self.dynamics = dynamics
        own = tuple(s for s in dynamics.own_states if s != "Om")
        self.free = [dynamics.states.index(s) for s in (*signals(("phi", "theta")), *own)]
        self.unknowns = (*(dynamics.states[i] for i in self.free), *INPUTS)
        self.balanced = [
            i for i, s in enumerate(dynamics.states) if s not in ("phi", "theta", "om_i")
        ]
        self._functions: dict[Name, Function] = {}

    # --- as functions ----------------------------------------------------------------------------

    def function(self, name: Name) -> Function:
        """One of the three, in CasADi."""
        if name not in self._functions:
            made = {"system": self._system, "point": self._point, "slopes": self._slopes}[name]()
            self._functions[name] = made
        return self._functions[name]

    @cached_property
    def _flight(self) -> Flight:
        sizes = {
            "z": len(self.unknowns),
            "demand": len(DEMAND),
            "par": len(self.dynamics.parameters),
        }
        z, demand, par = (SX.sym(name, size) for name, size in sizes.items())
        turned = _heading_to_body(z[0], z[1])
        air, wind, push = (
            turned(demand[0], demand[1], demand[2]),
            turned(demand[4], demand[5], demand[6]),
            turned(demand[7], 0.0, 0.0),
        )
        values = {
            **dict(zip("uvw", (a + b for a, b in zip(air, wind, strict=True)), strict=True)),
            **dict(zip("pqr", turned(0.0, 0.0, demand[3]), strict=True)),
            **{str(name): z[k] for k, name in enumerate(self.unknowns)},
        }
        if self.dynamics.governor == "pi":
            nominal = Signal(self.dynamics.entries["drivetrain"]["nominal_speed"])
            values["Om"] = par[self.dynamics.parameters.index(nominal)]
        x, u = (column([values[s] for s in of]) for of in (self.dynamics.states, INPUTS))
        wanted = column([*push, *[0.0] * (len(self.dynamics.states) - 3)])
        xdot, total = self.dynamics.euler(x, u, column(wind), par, self.dynamics.inflow_solver)
        return Flight([z, demand, par], x, u, column(wind), wanted, xdot, total)

    @cached_property
    def switches(self) -> tuple[str, ...]:
        """Names of the switching functions."""
        return tuple(name.replace("_", " ") for name in self._flight.total.switches)

    def _system(self) -> Function:
        flight = self._flight
        par = flight.arguments[2]

        def form(solver: Callable[..., Any]) -> Any:
            return self.dynamics.euler(flight.x, flight.u, flight.wind, par, solver)

        def derive(xdot: SX) -> list[SX]:
            return [jacobian((xdot - flight.wanted)[self.balanced], flight.arguments[0])]

        slopes = self.dynamics.derived(form, derive)[0]
        residual = dense(flight.xdot - flight.wanted)
        return Function("system", flight.arguments, [residual, _by_rows(slopes)])

    def _point(self) -> Function:
        flight, total = self._flight, self._flight.total
        # a rotor held at constant speed is turned with the body, and the engine turns it
        torque = total.flow["Q_e"] + total.added_inertia * flight.xdot[5]
        residual = dense(flight.xdot - flight.wanted)
        switches = column([*total.switches.values()])
        outputs = [flight.x, flight.wind, flight.xdot, residual, switches, dense(torque)]
        return Function("point", flight.arguments, outputs)

    def _slopes(self) -> Function:
        given = self.dynamics.function("jacobian")
        arguments = [SX.sym(given.name_in(i), *given.size_in(i)) for i in range(given.n_in())]
        return Function("slopes", arguments, [_by_rows(m) for m in given.call(arguments)])

    # --- as machine code -------------------------------------------------------------------------

    @cached_property
    def machine_code(self) -> ctypes.CDLL | None:
        """`steady.c` compiled behind these functions, None where there is no compiler."""
        held, rest = self._program("system").hoist((0,))
        sizes = {
            "NX": len(self.dynamics.states),
            "NZ": len(self.unknowns),
            "NC": len(DEMAND),
            "NP": len(self.dynamics.parameters),
            "NS": len(self.switches),
            "NK": max(len(held.outputs[0]), 1),
        }
        layout = SIDE_BY_SIDE
        parts = [
            layout.prelude,
            *(f"#define {name} {size}" for name, size in sizes.items()),
            f"static const int balanced[NZ] = {{{', '.join(map(str, self.balanced))}}};",
            c_function(held, layout, "held"),
            c_function(rest, layout, "system_of"),
            c_function(self._program("point"), layout, "point_of"),
            c_function(self._program("slopes"), layout, "slopes_of"),
            (resources.files("symheli.steady") / "steady.c").read_text(encoding="utf-8"),
        ]
        path = library("\n".join(parts), f"steady-{layout.lanes}")
        return None if path is None else loaded(path)

    def _program(self, name: Name) -> ScalarProgram:
        return program(self.function(name))


def steady_equations(heli: Helicopter) -> SteadyEquations:
    """Return the equations of this helicopter's arrangement of parts, built once for all airframes
    that differ only in numbers.
    """
    kept = vars(heli.dynamics)
    if "_steady" not in kept:
        kept["_steady"] = SteadyEquations(heli.dynamics)
    return kept["_steady"]


def numeric(heli: Helicopter, name: Name) -> Numeric:
    """One of the functions with the numbers of this helicopter, in CasADi's virtual machine: for
    one point compiling would take longer.
    """
    kept = vars(heli).setdefault("_steady", {})
    if name not in kept:
        kept[name] = Numeric(steady_equations(heli).function(name), heli.parameters.array)
    return kept[name]


def _heading_to_body(phi: Any, theta: Any) -> Callable[[Any, Any, Any], list[Any]]:
    """Rotation from forward-right-down axes of the heading to body axes."""
    cp, sp, ct, st = cos(phi), sin(phi), cos(theta), sin(theta)
    rows = ((ct, 0.0, -st), (sp * st, cp, sp * ct), (cp * st, -sp, cp * ct))
    return lambda *v: [sum(a * b for a, b in zip(row, v, strict=True)) for row in rows]


def _by_rows(matrix: Any) -> Any:
    return dense(casadi.vec(matrix.T))
