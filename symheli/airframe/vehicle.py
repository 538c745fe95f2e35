"""An airframe as data: every number with its unit and source, read from a TOML file and checked."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

from symheli.airframe.part import InstalledPart
from symheli.airframe.plausibility import implausibilities, impossibilities
from symheli.airframe.quantity import Quantity
from symheli.airframe.vehicle_file import LINEAR, VehicleFile, entries_of
from symheli.components import Entry
from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.values.caller import level_of_caller
from symheli.values.summary import summarized
from symheli.values.text_file import text_of
from symheli.values.units import dimension


@dataclass(frozen=True)
class Vehicle:
    """An airframe: quantities by section and entry, and the part that each other section is."""

    name: str
    title: str
    source: str
    sections: Mapping[str, Mapping[str, Quantity]]
    components: Mapping[str, InstalledPart]

    __repr__ = summarized

    @property
    def entries(self) -> dict[str, Mapping[str, Entry]]:
        """Entries of each section, {section: {entry: `Entry`}}."""
        return entries_of(self.sections, self.components)

    def values(self, section: str) -> dict[str, float]:
        """{entry: value in SI} of a section."""
        return {entry: quantity.value for entry, quantity in self.sections[section].items()}

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{"section.entry": quantity} of every entry that has a value of its own."""
        return {
            f"{s}.{e}": q
            for s, entries in self.sections.items()
            for e, q in entries.items()
            if not q.ref
        }

    @property
    def assumed(self) -> list[str]:
        """Names of the entries that are assumptions."""
        return [name for name, quantity in self.quantities.items() if quantity.assumed]

    def with_values(
        self,
        changes: Mapping[str, float],
        source: str = "set by hand",
        deviations: Mapping[str, float] | None = None,
    ) -> Vehicle:
        """Return the same airframe with other values (SI), {"body.mass": 9.0}, and their standard
        deviations where known; entries that refer to a changed one follow it. Raises `InputError`
        for impossible values, warns (`DataWarning`) of implausible ones.
        """
        stated = deviations or {}
        for name, value in changes.items():
            if name not in self.quantities:
                raise UnknownNameError("parameter", name, self.quantities)
            if not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(
                    f"{name}: expected a finite number in {self.quantities[name].unit}, got"
                    f" {value!r}"
                )
        changed = self._map(
            lambda name, q: (
                q._replace(
                    value=float(changes[name]),
                    source=f"{source}, was {q.value:g}",
                    given="",
                    deviation=float(stated.get(name, 0.0)),
                )
                if name in changes
                else q
            )
        )
        for section, entry, wrong in impossibilities(changed.sections, changed.entries):
            raise InputError(f"{self.title}, {section}.{entry}: {wrong}")
        self._warn_of(changed)
        return changed

    def scaled(self, factor: float) -> Vehicle:
        """The Froude-scaled airframe: lengths times `factor` N, masses N^3, times sqrt(N), so that
        gravity and air density stay.

        The exponent of each entry follows from its unit: mass 3, length 1, time 1/2, so inertias
        N^5, stiffness N^4, power N^3.5, rotor speed N^-0.5, while angles and ratios stay. Warns
        (`DataWarning`) of a copy that no helicopter is like.
        """
        if not (math.isfinite(factor) and factor > 0):
            raise InputError(
                "scaling needs a factor > 0 (length of the copy by length of the original), got"
                f" {factor}"
            )

        def scale(_: str, q: Quantity) -> Quantity:
            powers = dimension(q.unit)
            exponent = 3 * powers.get("kg", 0) + powers.get("m", 0) + powers.get("s", 0) / 2
            return q._replace(
                value=q.value * factor**exponent,
                source=f"{q.source}; Froude-scaled by {factor:g}",
                deviation=q.deviation * factor**exponent,
            )

        copy = replace(self._map(scale), title=f"{self.title}, Froude-scaled by {factor:g}")
        self._warn_of(copy)
        return copy

    def _warn_of(self, changed: Vehicle) -> None:
        """One `DataWarning` of every number that became implausible, or was and is now another."""
        doubts = {
            (section, entry): wrong
            for section, entry, wrong in implausibilities(changed.sections, changed.entries)
        }
        if not doubts:
            return
        known = {
            (section, entry)
            for section, entry, _ in implausibilities(self.sections, self.entries)
            if self.sections[section][entry].value == changed.sections[section][entry].value
        }
        doubtful = [f"{s}.{e}: {wrong}" for (s, e), wrong in doubts.items() if (s, e) not in known]
        if doubtful:
            head = f"{changed.title} has numbers that no helicopter has:"
            warnings.warn("\n  ".join([head, *doubtful]), DataWarning, level_of_caller())

    def _map(self, change: Callable[[str, Quantity], Quantity]) -> Vehicle:
        """Every quantity changed; one that refers to another is changed as the other."""
        sections = {
            section: {
                entry: change(q.ref or f"{section}.{entry}", q) for entry, q in entries.items()
            }
            for section, entries in self.sections.items()
        }
        return replace(self, sections=sections)


def vehicles() -> list[str]:
    """Return the names of the airframes that come with the package.

    Returns
    -------
    list of str
        What `Helicopter.load` takes, beside a path.

    See Also
    --------
    symheli.Helicopter : the equations with numbers
    symheli.airframe.identified_models : published identified models

    Examples
    --------
    >>> symheli.vehicles()
    ['xcell60', 'xcell_kahn_hudson', 'yamaha_r50']
    """
    files = [p.name for p in resources.files("symheli.airframe.vehicles").iterdir()]
    return sorted(
        name.removesuffix(".toml")
        for name in files
        if name.endswith(".toml") and not name.endswith(LINEAR)
    )


def load_vehicle(name_or_path: str | os.PathLike[str], *, allow_code: bool = False) -> Vehicle:
    """Read a packaged airframe by name, or any TOML file by path.

    A Python file that it names as a part is run only with `allow_code`. Raises `InputError` with
    every wrong or missing entry of the file: its line, what was expected and what came.
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise InputError(
            f"vehicle: expected a name, one of {', '.join(vehicles())}, or a .toml file, got"
            f" {name_or_path!r:.80}"
        )
    given = os.fspath(name_or_path)
    if given.endswith(".toml"):
        path = Path(given)
        if not path.is_file():
            raise InputError(
                f"no vehicle file at {given}; packaged airframes: {', '.join(vehicles())}"
            )
        file = VehicleFile(given, text_of(path), path.parent, allow_code=allow_code)
        name = path.stem
    else:
        if given not in vehicles():
            raise UnknownNameError("vehicle", given, vehicles())
        file, name = VehicleFile(given, packaged_text(given)), given
    parts, quantities = file.read()
    return Vehicle(
        name,
        str(file.tables.get("title", name)),
        str(file.tables.get("source", "")),
        quantities,
        parts,
    )


def packaged_text(name: str) -> str:
    """The file of a packaged airframe."""
    return (resources.files("symheli.airframe.vehicles") / f"{name}.toml").read_text("utf-8")
