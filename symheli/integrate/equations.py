"""The equations a flight needs, with every parameter an input: as programs, machine code, or CasADi
functions.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cached_property
from importlib import resources
from typing import Any, Literal

from symheli.codegen import Layout, ScalarProgram, as_casadi, c_function, program
from symheli.codegen.compile import library, loaded
from symheli.codegen.numeric import Numeric
from symheli.codegen.symbolic import SX, Function, adjoint_product, column, tangent_product
from symheli.dynamics import Dynamics
from symheli.helicopter import Helicopter

Which = Literal["rates", "switched_rates", "tangent_rates", "parameter_rates", "adjoint_rates"]
VARYING = {
    "rates": (0,),
    "switched_rates": (0,),
    "tangent_rates": (0, 4),
    "parameter_rates": (0, 4),
    "adjoint_rates": (0, 4),
}
"""Inputs of each function that change from stage to stage; u, wind, parameters and their changes
are held for a sample.
"""


class Equations:
    """Right-hand side of the quaternion form and its derivatives, with every parameter an input,
    each built when first used.
    """

    def __init__(self, dynamics: Dynamics):
        self.states = dynamics.flight_states
        self.parameters = dynamics.parameters
        self._functions = _functions(dynamics)
        self._programs: dict[str, ScalarProgram] = {}
        self._hoisted: dict[str, tuple[ScalarProgram, ScalarProgram]] = {}
        self._libraries: dict[tuple[str | tuple[str, ...] | Layout, ...], ctypes.CDLL | None] = {}

    def hoisted(self, which: Which) -> tuple[ScalarProgram, ScalarProgram]:
        """(held, rest) of one of the functions; see `ScalarProgram.hoist`."""
        if which not in self._hoisted:
            self._hoisted[which] = self._program(which).hoist(VARYING[which])
        return self._hoisted[which]

    def _program(self, which: Which) -> ScalarProgram:
        if which not in self._programs:
            self._programs[which] = program(self._functions[which], VARYING[which])
        return self._programs[which]

    def virtual_machine(self, which: Which, columns: int = 1) -> Numeric:
        """One of the functions in CasADi's virtual machine, on `columns` points at once: the
        numbers of the machine code to rounding.
        """
        function = as_casadi(self._program(which))
        return Numeric(function if columns == 1 else function.map(columns))

    @cached_property
    def rates(self) -> Numeric:
        """(x, u, wind, p) -> xdot in CasADi's virtual machine."""
        return self.virtual_machine("rates")

    @property
    def function(self) -> Function:
        """(x, u, wind, p) -> xdot as a CasADi function, for CasADi's own integrators."""
        return self._functions["rates"]

    def machine_code(
        self,
        kernel: str | tuple[str, ...],
        which: Sequence[Which] = ("rates",),
        layout: Layout | None = None,
        head: str = "",
    ) -> ctypes.CDLL | None:
        """The C file `kernel` of this folder (or several, from the package's folder: "flight/x.c")
        compiled behind these functions, None where there is no compiler.
        """
        layout = layout or Layout()
        key = (kernel, *which, layout, head)
        if key not in self._libraries:
            nx = len(self.states)
            parts = [
                layout.prelude,
                f"#define NX {nx}\n#define NE {nx - 5}\n#define NP {len(self.parameters)}\n",
                head,
            ]
            for name in which:
                held, rest = self.hoisted(name)
                prefix = name.removesuffix("rates")
                parts.append(f"#define {prefix.upper()}NK {max(len(held.outputs[0]), 1)}\n")
                parts += [c_function(held, layout, f"{prefix}held"), c_function(rest, layout, name)]
            files = (f"integrate/{kernel}",) if isinstance(kernel, str) else kernel
            package = resources.files("symheli")
            parts += [(package / file).read_text(encoding="utf-8") for file in files]
            name = files[-1].rpartition("/")[2].removesuffix(".c")
            path = library("\n".join(parts), f"{name}-{layout.lanes}")
            self._libraries[key] = None if path is None else loaded(path)
        return self._libraries[key]


def equations(heli: Helicopter) -> Equations:
    """The equations of this helicopter's arrangement of parts, built once for all airframes that
    differ in numbers alone.
    """
    kept = vars(heli.dynamics)
    if "_equations" not in kept:
        kept["_equations"] = Equations(heli.dynamics)
    return kept["_equations"]


def _functions(dynamics: Dynamics) -> dict[str, Function]:
    """(x, u, wind, p) -> xdot, and the same with the switching functions of the parts, which are
    zero where the equations change their form; (x, u, wind, p, dx, du, dwind) -> xdot, dxdot; the
    same with dp; (x, u, wind, p, x_bar) -> x_bar' d xdot/d(x, u, wind).
    """
    sizes = {"x": len(dynamics.flight_states), "u": 4, "wind": 3}
    point, change = (
        [SX.sym(mark + name, size) for name, size in sizes.items()] for mark in ("", "d")
    )
    p, dp = (SX.sym(name, len(dynamics.parameters)) for name in ("p", "dp"))
    bar = SX.sym("x_bar", sizes["x"])
    x, u, wind = point

    def form(solver: Callable[..., Any]) -> Any:
        return dynamics.quaternion(x, u, wind, p, solver)

    xdot, total = form(dynamics.inflow_solver)
    switches = column([*total.switches.values()] or [SX(1.0)])
    tangent = dynamics.derived(form, lambda f: [tangent_product(f, point, change)])
    moved, moves = [*point, p], [*change, dp]
    parametric = dynamics.derived(form, lambda f: [tangent_product(f, moved, moves)])
    adjoint = dynamics.derived(form, lambda f: [adjoint_product(f, z, bar) for z in point])
    return {
        "rates": Function("rates", [*point, p], [xdot]),
        "switched_rates": Function("switched_rates", [*point, p], [xdot, switches]),
        "tangent_rates": Function("tangent_rates", [*point, p, *change], [xdot, *tangent]),
        "parameter_rates": Function("parameter_rates", [*moved, *moves], [xdot, *parametric]),
        "adjoint_rates": Function("adjoint_rates", [*point, p, bar], adjoint),
    }
