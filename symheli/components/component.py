"""Interface of every component of the airframe."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NamedTuple

from symheli.codegen.symbolic import unnamed
from symheli.components.entry import Entry
from symheli.errors import InputError
from symheli.values.signal import Signal


class AirMotion(NamedTuple):
    """Motion of the body through the air: velocity of the c.g. relative to the air u_a v_a w_a
    (m/s), body rates p q r (rad/s), rotor speed Om relative to the body (rad/s), air density rho
    (kg/m^3).
    """

    u_a: Any
    v_a: Any
    w_a: Any
    p: Any
    q: Any
    r: Any
    Om: Any
    rho: Any


@dataclass
class Flow:
    """Flow quantities made by components evaluated earlier, by name, and the inflow solver of the
    rotors.

    `inflow(c0, c1, ct_max, mu2, mu_z, efficiency)` returns lam0 (see
    `symheli.physics.inflow.solve`). `name(symbol, value)` gives an intermediate value its symbol in
    the field's notation (LaTeX): where numbers are wanted it returns the value; where the equations
    are printed it keeps the equation and returns the symbol.
    """

    inflow: Callable[..., Any]
    values: dict[str, Any] = field(default_factory=dict)
    name: Callable[[str, Any], Any] = unnamed

    def __getitem__(self, name: str) -> Any:
        return self.values[name]


@dataclass
class Effect:
    """Effect of a part, in body axes: force X Y Z (N) and moment L M N (N m) about its reference
    point (the c.g. unless the vehicle places it elsewhere), the derivatives of its own states, the
    torque it takes from the main shaft (N m, referred to the main rotor), the flow it makes, and
    switching functions whose sign changes mark a corner of the model (a jump where the name begins
    with "jump": no equilibrium need exist beside it).
    """

    force: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)
    moment: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)
    rates: Mapping[str, Any] = field(default_factory=dict)
    shaft_torque: Any = 0.0
    flow: Mapping[str, Any] = field(default_factory=dict)
    switches: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Component:
    """A part of the airframe: a pure function and what it must be given.

    `parameters` {name: `Entry`} come from the vehicle file (a unit alone stands for an `Entry` of
    that unit); `states` are its own; it may use the flow in `needs` and makes the flow in `makes`.
    `place` names the coordinates x y z that its section must give, `opposite` {entry: coordinate
    that it gives with the other sign}, as published distances behind and above the c.g. do.
    `evaluate(parameters, motion, controls, own, flow)` returns an `Effect` under these names: where
    a vehicle has two of a kind or puts one off the c.g., `symheli.airframe.part.InstalledPart`
    translates. In print, `subscript` marks its forces.
    """

    evaluate: Callable[
        [SimpleNamespace, AirMotion, Mapping[str, Any], Mapping[str, Any], Flow], Effect
    ]
    parameters: Mapping[str, Entry | str]
    states: tuple[Signal, ...] = ()
    needs: tuple[str, ...] = ()
    makes: tuple[str, ...] = ()
    subscript: str = ""
    place: tuple[str, ...] = ()
    opposite: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if unknown := {*self.place, *self.opposite.values()} - {"x", "y", "z"}:
            raise InputError(f"place: expected x, y or z, got {', '.join(sorted(unknown))}")
        if reserved := {"x", "y", "z"} & set(self.parameters):
            raise InputError(
                f"parameters {', '.join(sorted(reserved))}: every part has a place x y z already;"
                " choose other names, or require it: place=('x', 'z')"
            )

    @property
    def entries(self) -> dict[str, Entry]:
        """Its `parameters`, each as an `Entry`."""
        return {
            name: Entry(entry) if isinstance(entry, str) else entry
            for name, entry in self.parameters.items()
        }
