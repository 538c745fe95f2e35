"""An airframe as data: every number with its unit and source, read from a TOML file and checked."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from symheli.components import Component, find
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.units import to_si

BODY = {"mass": "kg", "Ixx": "kg m^2", "Iyy": "kg m^2", "Izz": "kg m^2"}
DRIVETRAIN = {"nominal_speed": "rad/s", "inertia": "kg m^2", "max_power": "W", "governor_kp": "s/rad", "governor_ki": "1/rad"}
CONTROLS = dict.fromkeys(("d_lon", "d_lat", "d_col", "d_ped"), "rad")
_FIXED = {"body": BODY, "drivetrain": DRIVETRAIN, "controls": CONTROLS}


class Quantity(NamedTuple):
    """A value in SI, its SI unit, and where it was published."""

    value: float
    unit: str
    source: str


@dataclass(frozen=True)
class Vehicle:
    """An airframe: quantities by section and entry, and the component of each remaining section."""

    name: str
    title: str
    source: str
    sections: Mapping[str, Mapping[str, Quantity]]
    components: Mapping[str, Component]

    def values(self, section: str) -> dict[str, float]:
        """{entry: value in SI} of a section."""
        return {entry: quantity.value for entry, quantity in self.sections[section].items()}


def vehicles() -> list[str]:
    """Names of the airframes that come with the package."""
    return sorted(p.name.removesuffix(".toml") for p in resources.files("symheli.vehicles").iterdir() if p.name.endswith(".toml"))


def load_vehicle(name_or_path: str | os.PathLike[str]) -> Vehicle:
    """Read a packaged airframe by name, or any TOML file by path. Raises `InputError` naming the entry and the unit at fault."""
    given = os.fspath(name_or_path)
    if given.endswith(".toml"):
        path = Path(given)
        if not path.is_file():
            raise InputError(f"no vehicle file at {given}; packaged airframes: {', '.join(vehicles())}")
        text, name = path.read_text(encoding="utf-8"), path.stem
    else:
        if given not in vehicles():
            raise UnknownNameError("vehicle", given, vehicles())
        text, name = (resources.files("symheli.vehicles") / f"{given}.toml").read_text(encoding="utf-8"), given
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{given} is not valid TOML: {error}") from error
    return _Reader(given, text, data).vehicle(name)


class _Reader:
    """Turns the parsed file into quantities, with messages that name entry and line."""

    def __init__(self, path: str, text: str, data: Mapping[str, Any]):
        self.path, self.lines, self.data = path, text.splitlines(), data

    def vehicle(self, name: str) -> Vehicle:
        tables = {key: value for key, value in self.data.items() if isinstance(value, dict)}
        for required in _FIXED:
            if required not in tables:
                raise InputError(f"{self.path}: section [{required}] is missing")
        components = {section: find(table.get("component", section)) for section, table in tables.items() if section not in _FIXED}
        sections = {}
        for section in tables:
            expected = _FIXED.get(section) or components[section].parameters
            sections[section] = {entry: self.quantity(section, entry, unit) for entry, unit in expected.items()}
            for entry in tables[section]:
                if entry not in expected and entry != "component":
                    raise UnknownNameError(f"entry at {self.where(section, entry)}", entry, expected)
        return Vehicle(name, self.data.get("title", name), self.data.get("source", ""), sections, components)

    def quantity(self, section: str, entry: str, unit: str) -> Quantity:
        where = self.where(section, entry)
        table = self.data[section].get(entry)
        if table is None:
            raise InputError(f"{self.path}: [{section}] needs the entry {entry} = {{ value = ..., unit = {unit!r}, source = ... }}")
        if not isinstance(table, dict):
            raise InputError(f"{where}: write {{ value = {table}, unit = {unit!r}, source = ... }}: a bare number has no unit")
        if "ref" in table:
            other_section, _, other_entry = str(table["ref"]).partition(".")
            if "ref" in self.data.get(other_section, {}).get(other_entry, {"ref": ""}):
                raise InputError(f"{where}: ref = {table['ref']!r} must name an entry with a value, as section.entry")
            return self.quantity(other_section, other_entry, unit)
        value = table.get("value")
        if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
            raise InputError(f"{where}: expected a finite number as value, got {value!r}")
        try:
            factor, si = to_si(str(table.get("unit")))
        except UnknownNameError as error:
            raise InputError(f"{where}: {error}") from error
        if si != unit:
            raise InputError(f"{where}: expected a unit that converts to {unit}, got {table.get('unit')}")
        if not table.get("source"):
            raise InputError(f"{where}: every number needs a source (or 'assumed')")
        return Quantity(factor * float(value), unit, str(table["source"]))

    def where(self, section: str, entry: str) -> str:
        inside = False
        for number, line in enumerate(self.lines, 1):
            if line.strip().startswith("["):
                inside = line.strip() == f"[{section}]"
            elif inside and line.split("=")[0].strip() == entry:
                return f"{self.path}, line {number}, {section}.{entry}"
        return f"{self.path}, {section}.{entry}"
