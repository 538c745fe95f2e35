"""The equations of motion in SymPy, made by the code that makes the CasADi functions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

if TYPE_CHECKING:
    from symheli.equations.described import Described


@dataclass(frozen=True, kw_only=True)
class RightHandSide:
    """xdot = f(states, inputs, wind, inflow) with balance(...) = 0 for the inflow ratios, one a
    rotor, in order of the components.

    `parameters` {symbol: value in SI} names each parameter section.entry, and density;
    `xdot.subs(rhs.parameters)` puts the numbers in.
    """

    states: tuple[sympy.Symbol, ...]
    inputs: tuple[sympy.Symbol, ...]
    wind: tuple[sympy.Symbol, ...]
    inflow: tuple[sympy.Symbol, ...]
    xdot: sympy.Matrix
    balance: sympy.Matrix
    parameters: Mapping[sympy.Symbol, float]


def right_hand_side(heli: Described) -> RightHandSide:
    """The Euler form of `heli` in body axes with a symbol for every one of its `parameters`, air
    density among them.
    """
    parameters = {
        sympy.Symbol(str(name), real=True): value for name, value in heli.parameters.items()
    }
    states, inputs, wind = (
        tuple(sympy.Symbol(str(name), real=True) for name in names)
        for names in (heli.states, heli.inputs, heli.wind)
    )
    inflow: list[sympy.Symbol] = []

    def unknown() -> sympy.Symbol:
        inflow.append(sympy.Symbol(f"lam_{len(inflow)}", real=True))
        return inflow[-1]

    xdot, balance = heli.with_inflow(states, inputs, wind, unknown, list(parameters))
    return RightHandSide(
        states=states,
        inputs=inputs,
        wind=wind,
        inflow=tuple(inflow),
        xdot=xdot,
        balance=balance,
        parameters=parameters,
    )
