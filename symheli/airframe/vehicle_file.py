"""Reading a vehicle file: every message names file, line, entry and the unit expected."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symheli.airframe.part import PLACE, Part
from symheli.airframe.plausibility import impossibilities
from symheli.airframe.quantity import Quantity, read_quantity
from symheli.components import Component, find
from symheli.errors import InputError, UnknownNameError

BODY = {"mass": "kg", "Ixx": "kg m^2", "Iyy": "kg m^2", "Izz": "kg m^2"}
DRIVETRAIN = {
    "nominal_speed": "rad/s",
    "inertia": "kg m^2",
    "max_power": "W",
    "governor_kp": "s/rad",
    "governor_ki": "1/rad",
}
CONTROLS = dict.fromkeys(("d_lon", "d_lat", "d_col", "d_ped"), "rad")
FIXED = {"body": BODY, "drivetrain": DRIVETRAIN, "controls": CONTROLS}
"""Sections every airframe has, {entry: unit}; every other section is a component."""

WIRING = ("component", "controls", "flow")
"""Keys of a component's section that are no quantities."""

LINEAR = ".linear.toml"
"""How a file ends that holds an identified linear model in place of an airframe."""


class VehicleFile:
    """The text of a vehicle file, its tables, and where in the text each entry stands."""

    def __init__(self, path: str, text: str, folder: Path | None = None):
        self.path, self.lines, self.folder = path, text.splitlines(), folder
        try:
            self.tables: Mapping[str, Any] = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{path} is not valid TOML: {error}") from error

    def parts(self) -> dict[str, Part]:
        """Every section that is not fixed, as a part, in the order of the file."""
        parts: dict[str, Part] = {}
        taken: set[str] = set()
        for section, table in self._sections().items():
            if section not in FIXED:
                if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", section):
                    raise InputError(
                        f"{self.where(section)}: a section is named with letters, digits and single"
                        " underscores"
                    )
                component = self._component(section, table)
                names = {
                    f"[{table.get('component', section)}]",
                    *component.states,
                    *component.makes,
                }
                suffix = f"_{section}" if names & taken else ""
                taken |= {f"{name}{suffix}" for name in names}
                mix, flow = self._controls(section, table), self._flow(section, table, component)
                given = tuple(entry for entry in component.optional if entry in table)
                parts[section] = Part(
                    section,
                    component,
                    suffix,
                    mix,
                    flow,
                    any(axis in table for axis in PLACE),
                    given,
                )
        return parts

    def quantities(self, parts: Mapping[str, Part]) -> dict[str, dict[str, Quantity]]:
        """Every number of every section."""
        tables = self._sections()
        for required in FIXED:
            if required not in tables:
                raise InputError(f"{self.path}: section [{required}] is missing")
        wanted = {}
        for section, table in tables.items():
            units = FIXED.get(section) or parts[section].parameters
            for entry in table:
                if entry not in (*units, *(() if section in FIXED else (*WIRING, *PLACE))):
                    raise InputError(
                        f"{self.where(section, entry)}: {UnknownNameError('entry', entry, units)}"
                    )
            wanted[section] = units
        out: dict[str, dict[str, Quantity]] = {section: {} for section in wanted}
        for by_reference in (False, True):  # values first: a wrong one is reported where it stands
            for section, units in wanted.items():
                for entry, unit in units.items():
                    if _refers(tables[section].get(entry)) == by_reference:
                        out[section][entry] = self._quantity(section, entry, unit)
        for section, entry, wrong in impossibilities(out, parts):
            raise InputError(f"{self.where(section, entry)}: {wrong}")
        return out

    def where(self, section: str, entry: str = "") -> str:
        """File, line and name of an entry (or of a section), as far as the text tells."""
        line = self._line(section, entry) or self._line(section, "")
        name = f"{section}.{entry}" if entry else f"[{section}]"
        return f"{self.path}, line {line}, {name}" if line else f"{self.path}, {name}"

    def _line(self, section: str, entry: str) -> int | None:
        """Line of `entry =` below [section], of `section.entry =`, or of [section.entry]; of
        [section] without an entry.
        """
        wanted = [section, entry] if entry else [section]
        header: list[str] = []
        for number, line in enumerate(self.lines, 1):
            if found := re.match(r"\s*\[+([^\[\]]+)\]+\s*(#.*)?$", line):
                header = _keys(found[1])
                path = header
            elif found := re.match(r"\s*([\w\-.\"' ]+?)\s*=", line):
                path = header + _keys(found[1])
            else:
                continue
            if path[: len(wanted)] == wanted:
                return number
        return None

    def _sections(self) -> dict[str, dict[str, Any]]:
        return {key: value for key, value in self.tables.items() if isinstance(value, dict)}

    def _quantity(self, section: str, entry: str, unit: str) -> Quantity:
        where, table = self.where(section, entry), self.tables[section].get(entry)
        if table is None and entry in PLACE:
            return Quantity(0.0, unit, "not given: at the c.g.")
        if table is None:
            raise InputError(
                f"{where}: missing; add {entry} = {{ value = ..., unit = {unit!r}, source = ... }}"
            )
        if _refers(table):
            other_section, _, other_entry = str(table["ref"]).partition(".")
            target = self.tables.get(other_section, {})
            target = target.get(other_entry) if isinstance(target, Mapping) else None
            if len(table) > 1 or not isinstance(target, Mapping) or "ref" in target:
                raise InputError(
                    f"{where}: {{ ref = 'section.entry' }} must name an entry with a value and say"
                    f" nothing else, got {table}"
                )
            return read_quantity(where, target, unit)._replace(ref=str(table["ref"]))
        return read_quantity(where, table, unit)

    def _component(self, section: str, table: Mapping[str, Any]) -> Component:
        try:
            return find(str(table.get("component", section)), self.folder)
        except UnknownNameError as error:
            raise InputError(
                f"{self.where(section, 'component')}: {error}; or name a file: component ="
                f" './{section}.py'"
            ) from error
        except InputError as error:
            raise InputError(f"{self.where(section, 'component')}: {error}") from error

    def _controls(self, section: str, table: Mapping[str, Any]) -> dict[str, dict[str, float]]:
        where, mixes = self.where(section, "controls"), table.get("controls", {})
        if not isinstance(mixes, Mapping) or not all(
            isinstance(mix, Mapping) for mix in mixes.values()
        ):
            raise InputError(
                f"{where}: expected {{ d_col = {{ d_col = 1.0, d_lon = 0.2 }} }}, for a control of"
                f" the part its mix; got {mixes}"
            )
        for name in (*mixes, *(control for mix in mixes.values() for control in mix)):
            if name not in CONTROLS:
                raise InputError(f"{where}: {UnknownNameError('control', name, CONTROLS)}")
        for gain in (gain for mix in mixes.values() for gain in mix.values()):
            if (
                isinstance(gain, bool)
                or not isinstance(gain, int | float)
                or not math.isfinite(gain)
            ):
                raise InputError(f"{where}: a gain must be a finite number (rad/rad), got {gain!r}")
        return {
            name: {control: float(gain) for control, gain in mix.items()}
            for name, mix in mixes.items()
        }

    def _flow(self, section: str, table: Mapping[str, Any], component: Component) -> dict[str, str]:
        where, flow = self.where(section, "flow"), table.get("flow", {})
        if not isinstance(flow, Mapping):
            raise InputError(
                f"{where}: expected {{ V_imr = 'V_imr_aft_rotor' }}: for a flow the part needs,"
                f" whose it takes, got {flow!r}"
            )
        for name in flow:
            if name not in component.needs:
                raise InputError(f"{where}: {UnknownNameError('flow', name, component.needs)}")
        return {name: str(source) for name, source in flow.items()}


def _refers(table: Any) -> bool:
    return isinstance(table, Mapping) and "ref" in table


def _keys(dotted: str) -> list[str]:
    return [key.strip().strip("\"'") for key in dotted.split(".")]
