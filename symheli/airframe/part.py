"""A component installed in an airframe: its place, its inputs, and the names of its signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from symheli.airframe.sections import PLACE, required_place
from symheli.components import AirMotion, Component, Effect, Entry, Flow
from symheli.values.signal import Signal


@dataclass(frozen=True)
class InstalledPart:
    """One section of a vehicle file.

    suffix: added to the names of its states, flow and switches; empty for the first of a kind, "_"
    + section for the others. controls: {control of the component: {control of the vehicle: gain}}
    where they differ. flow: {needed: name it is taken from} where they differ. placed: whether it
    has or needs an x, y or z. given: the component's optional entries it has. kind: the component
    as the file names it.
    """

    section: str
    component: Component
    suffix: str = ""
    controls: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    flow: Mapping[str, str] = field(default_factory=dict)
    placed: bool = False
    given: tuple[str, ...] = ()
    kind: str = ""

    @property
    def entries(self) -> dict[str, Entry]:
        """Entries of its section, without optional entries that are absent."""
        own = self.component.entries
        required = {name: e for name, e in own.items() if not e.optional or name in self.given}
        return {**required, **(PLACE if self.placed else {}), **required_place(self.component)}

    @property
    def subscript(self) -> str:
        """Subscript of its forces in print."""
        return self.component.subscript + self.suffix

    @property
    def states(self) -> tuple[Signal, ...]:
        """Its states by the vehicle's names."""
        return tuple(Signal(f"{s}{self.suffix}", s.unit) for s in self.component.states)

    @property
    def needs(self) -> tuple[str, ...]:
        """The flow it takes, as the vehicle names it."""
        return tuple(self.flow.get(name, name) for name in self.component.needs)

    @property
    def makes(self) -> tuple[str, ...]:
        """The flow it makes, as the vehicle names it."""
        return tuple(name + self.suffix for name in self.component.makes)

    def evaluate(
        self,
        par: SimpleNamespace,
        motion: AirMotion,
        controls: Mapping[str, Any],
        own: Mapping[str, Any],
        flow: Flow,
    ) -> Effect:
        """Evaluate its effect about the c.g. and under the vehicle's names; arguments as in
        `Component.evaluate`, of the vehicle.
        """
        inner = self.component.evaluate(
            par,
            _moved(motion, par) if self.placed else motion,
            {
                **controls,
                **{
                    name: sum(gain * controls[c] for c, gain in mix.items())
                    for name, mix in self.controls.items()
                },
            },
            {str(s): own[f"{s}{self.suffix}"] for s in self.component.states},
            Flow(
                flow.inflow,
                {name: flow[self.flow.get(name, name)] for name in self.component.needs},
                flow.name,
            ),
        )
        prefix = f"{self.section} " if self.suffix else ""
        return Effect(
            force=inner.force,
            moment=_about_cg(inner, par) if self.placed else inner.moment,
            rates={name + self.suffix: rate for name, rate in inner.rates.items()},
            shaft_torque=inner.shaft_torque,
            flow={name + self.suffix: value for name, value in inner.flow.items()},
            switches={prefix + name: value for name, value in inner.switches.items()},
        )


def _moved(motion: AirMotion, par: SimpleNamespace) -> AirMotion:
    """The motion of the reference point: V + omega x r."""
    return motion._replace(
        u_a=motion.u_a + motion.q * par.z - motion.r * par.y,
        v_a=motion.v_a + motion.r * par.x - motion.p * par.z,
        w_a=motion.w_a + motion.p * par.y - motion.q * par.x,
    )


def _about_cg(effect: Effect, par: SimpleNamespace) -> tuple[Any, Any, Any]:
    """Moment about the c.g.: M + r x F."""
    (X, Y, Z), (L, M, N) = effect.force, effect.moment
    return L + par.y * Z - par.z * Y, M + par.z * X - par.x * Z, N + par.x * Y - par.y * X
