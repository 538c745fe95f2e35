"""Equations of every component as computed: the code is evaluated with symbols, and its named
expressions are recorded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import sympy

from symheli.airframe.sections import FIXED
from symheli.components import AirMotion, Component, Effect, Flow
from symheli.equations.notation import dot, printed, real, symbol_of, upright
from symheli.physics import inflow, rigid_body
from symheli.values.kinematics import RIGID_BODY

if TYPE_CHECKING:
    from symheli.equations.described import Described


@dataclass(frozen=True)
class Parameter:
    """A number of the vehicle file: LaTeX symbol, entry, value in SI, unit, source."""

    symbol: str
    entry: str
    value: float
    unit: str
    source: str


@dataclass(frozen=True)
class Section:
    """Equations (LaTeX, one a line) that belong together, what they are, where they come from, and
    their parameters.
    """

    title: str
    text: str
    equations: tuple[str, ...]
    parameters: tuple[Parameter, ...] = ()


@dataclass
class _Notes:
    """Keeps an equation for every value that gets a name; a flow solver that leaves the inflow a
    symbol.
    """

    equations: list[str] = field(default_factory=list)
    known: dict[Any, sympy.Symbol] = field(default_factory=dict)

    def name(self, symbol: str, value: Any) -> Any:
        if not isinstance(value, sympy.Basic) or value.is_Atom:
            return value
        if value not in self.known:
            self.known[value] = real(symbol)
            self.equal(symbol, value)
        return self.known[value]

    def inflow(self, *arguments: Any) -> Any:
        lam0 = real(r"\lambda_0")
        c0, c1, ct_max, *axial = arguments
        ct = self.name("C_T", inflow.thrust_coefficient(lam0, c0, c1, ct_max))
        self.equations.append(f"{printed(inflow.momentum(lam0, *axial))} = {printed(ct)}")
        return lam0

    def equal(self, symbol: str, value: Any) -> None:
        equation = f"{upright(symbol)} = {printed(value)}"
        if equation not in self.equations:
            self.equations.append(equation)


def listing(heli: Described) -> tuple[Section, ...]:
    """Return the equations of `heli`: rigid body, components in the order they are evaluated,
    drivetrain, attitude and position in flight.
    """
    s = _symbols(heli)
    motion = AirMotion(*[vars(s)[name] for name in AirMotion._fields])
    controls, own = (
        {str(name): vars(s)[str(name)] for name in names} for names in (heli.inputs, heli.states)
    )
    made: dict[str, Any] = {}
    sections, effects = [], {}
    for part in heli.dynamics.order:
        notes, subscript = _Notes(), (part.subscript or part.section).replace("_", ",")
        effect = part.evaluate(
            _parameters(heli, part.section),
            motion,
            controls,
            own,
            Flow(notes.inflow, made, notes.name),
        )
        for name, value in effect.flow.items():
            made[name] = notes.name(symbol_of(name), value)
        _outcome(notes, effect, subscript)
        sections.append(
            Section(
                _title(part.section),
                _about(part.component),
                tuple(notes.equations),
                _table(heli, part.section),
            )
        )
        effects[subscript] = effect
    return (_rigid_body(heli, s, effects), *sections, _drivetrain(heli, own, effects), _flight(s))


def _symbols(heli: Described) -> SimpleNamespace:
    """A symbol for every signal and every field of the motion, by the code's name."""
    names = (
        *heli.states,
        *heli.inputs,
        *heli.wind,
        *AirMotion._fields,
        "psi",
        "Om",
        "q0",
        "q1",
        "q2",
        "q3",
    )
    return SimpleNamespace(**{str(name): real(symbol_of(str(name))) for name in names})


def _parameters(heli: Described, section: str) -> SimpleNamespace:
    latex = _latex_of(heli, section)
    values = {entry: real(latex[entry]) for entry in heli.vehicle.sections[section]}
    weight = real(FIXED["body"]["mass"].symbol) * rigid_body.GRAVITY
    return SimpleNamespace(**values, printed=heli.printed, smoothing=heli.smoothing, weight=weight)


def _latex_of(heli: Described, section: str) -> Mapping[str, str]:
    return {
        name: entry.symbol or rf"\mathrm{{{name}}}".replace("_", r"\_")
        for name, entry in heli.vehicle.entries[section].items()
    }


def _table(heli: Described, section: str) -> tuple[Parameter, ...]:
    latex = _latex_of(heli, section)
    return tuple(
        Parameter(upright(latex[entry]), f"{section}.{entry}", q.value, q.unit, q.source)
        for entry, q in heli.vehicle.sections[section].items()
    )


def _title(section: str) -> str:
    return section.replace("_", " ").capitalize()


def _about(component: Component) -> str:
    """First line of the component's file, and its source as its function states it."""
    text = component.evaluate.__globals__["__doc__"] or ""
    source = re.search(r"Source: (.*?)(?:\n\s*\n|$)", component.evaluate.__doc__ or "", re.DOTALL)
    lines = [
        text.strip().partition("\n")[0],
        f"Source: {' '.join(source[1].split())}" if source else "",
    ]
    return " ".join(line for line in lines if line)


def _outcome(notes: _Notes, effect: Effect, subscript: str) -> None:
    """List the results of a component: forces, moments, derivatives of its states, torque."""
    for axis, value in zip("XYZLMN", (*effect.force, *effect.moment), strict=True):
        if value not in (0, real(f"{axis}_{{{subscript}}}")):
            notes.equal(f"{axis}_{{{subscript}}}", value)
    for name, value in effect.rates.items():
        notes.equal(dot(symbol_of(name)), value)
    if effect.shaft_torque != 0:
        notes.equal(rf"\tau_{{{subscript}}}", effect.shaft_torque)


def _total(symbol: str, effects: Mapping[str, Effect], entry: Callable[[Effect], Any]) -> str:
    terms = [
        upright(f"{symbol}_{{{subscript}}}")
        for subscript, effect in effects.items()
        if entry(effect) != 0
    ]
    return f"{symbol} = {' + '.join(terms) or 0}"


def _rigid_body(heli: Described, s: SimpleNamespace, effects: Mapping[str, Effect]) -> Section:
    notes = _Notes()
    for name in ("u", "v", "w"):
        notes.equal(symbol_of(f"{name}_a"), vars(s)[name] - vars(s)[f"{name}_w"])
    for i, axis in enumerate("XYZ"):
        notes.equations.append(_total(axis, effects, lambda e, i=i: e.force[i]))
    for i, axis in enumerate("LMN"):
        notes.equations.append(_total(axis, effects, lambda e, i=i: e.moment[i]))
    X, Y, Z, L, M, N, Q_e = (real(name) for name in ("X", "Y", "Z", "L", "M", "N", "Q_e"))
    body, rates = _parameters(heli, "body"), (s.p, s.q, s.r)
    added = heli.dynamics.drive(_parameters(heli, "drivetrain"), Q_e, vars(s)).added_inertia
    linear = rigid_body.translation(
        s.u, s.v, s.w, *rates, rigid_body.gravity_euler(s.phi, s.theta), (X, Y, Z), body.mass
    )
    angular = rigid_body.rotation(*rates, (L, M, N - Q_e), body.Ixx, body.Iyy, body.Izz, added)
    attitude = rigid_body.euler_rates(s.phi, s.theta, *rates)
    for name, value in zip(
        (*map(str, RIGID_BODY), "psi"),
        (*linear, *angular, *attitude),
        strict=True,
    ):
        notes.equal(dot(symbol_of(name)), value)
    text = (
        "Body axes x forward, y right, z down; air-relative velocity, sum of the parts,"
        " translation, rotation, attitude. Source: Budiyono and Sutarto, eqs 1 to 4."
    )
    return Section("Rigid body", text, tuple(notes.equations), _table(heli, "body"))


def _drivetrain(heli: Described, own: Mapping[str, Any], effects: Mapping[str, Effect]) -> Section:
    notes = _Notes([_total(r"\tau", effects, lambda e: e.shaft_torque)])
    drive = heli.dynamics.drive(_parameters(heli, "drivetrain"), real(r"\tau"), own, notes.name)
    if drive.torque != real("Q_e"):
        notes.equal("Q_e", drive.torque)
    for name, value in drive.rates.items():
        notes.equal(
            dot(symbol_of(name)),
            value + (drive.speed_follows_yaw * real(dot("r")) if name == "Om" else 0),
        )
    if heli.governor == "ideal":
        notes.equal(symbol_of("Om"), real(FIXED["drivetrain"]["nominal_speed"].symbol))
    held = (
        "The rotor speed is held exactly"
        if heli.governor == "ideal"
        else "Engine and proportional-integral governor"
    )
    return Section(
        "Drivetrain",
        f"{held}. Source: G15, engine and rotor speed dynamics.",
        tuple(notes.equations),
        _table(heli, "drivetrain"),
    )


def _flight(s: SimpleNamespace) -> Section:
    """Quaternion and position, integrated in flights in place of the Euler angles."""
    notes = _Notes()
    quaternion, velocity = (s.q0, s.q1, s.q2, s.q3), (s.u, s.v, s.w)
    for name, value in zip(
        ("q0", "q1", "q2", "q3"),
        rigid_body.quaternion_rates(*quaternion, s.p, s.q, s.r),
        strict=True,
    ):
        notes.equal(dot(symbol_of(name)), value)
    for name, row in zip(("x_n", "x_e", "x_d"), rigid_body.body_to_earth(*quaternion), strict=True):
        notes.equal(dot(symbol_of(name)), sum(a * b for a, b in zip(row, velocity, strict=True)))
    return Section(
        "Attitude and position in flight",
        "A unit quaternion, scalar first; north, east, down.",
        tuple(notes.equations),
    )
