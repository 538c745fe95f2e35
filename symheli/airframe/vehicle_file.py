"""Reading a vehicle file: one message names every wrong or missing entry with its line."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from symheli.airframe.part import InstalledPart
from symheli.airframe.plausibility import implausibilities, impossibilities
from symheli.airframe.quantity import Quantity, read_quantity
from symheli.airframe.readable import (
    UNREADABLE,
    Problem,
    broken_lines,
    problem,
    readable,
    refuse,
)
from symheli.airframe.sections import CONTROLS, FIXED, PLACE
from symheli.components import Component, Entry, find, packaged
from symheli.errors import InputError, UnknownNameError
from symheli.values.units import dimension

WIRING = ("component", "controls", "flow")
"""Keys of a component's section that are no quantities."""

LINEAR = ".linear.toml"
"""Suffix of a file with an identified linear model in place of an airframe."""


class VehicleFile:
    """Text of a vehicle file, its tables, the line of each entry, and all errors found."""

    def __init__(
        self, path: str, text: str, folder: Path | None = None, *, allow_code: bool = False
    ):
        self.path, self.lines, self.folder = path, text.splitlines(), folder
        self.allow_code = allow_code
        self.tables, unread = readable(text)
        self._written: dict[str, str] = {}
        """{section: name it has in the text}, where that is misspelt."""
        self._entries: dict[tuple[str, str], str] = {}
        """{(section, entry): name it has in the text}, where that is misspelt."""
        self._doubted: set[tuple[str, str]] = set()
        self._asked: Mapping[str, Mapping[str, Entry]] = {}
        self.problems: list[Problem] = broken_lines(unread)

    def read(self) -> tuple[dict[str, InstalledPart], dict[str, dict[str, Quantity]]]:
        """The parts in the order of the file, and every number of every section.

        Raises one `InputError` with everything that is wrong, in the order of the file.
        """
        tables = self._sections()
        parts = self._parts(tables)
        entries = entries_of(tables, parts)
        self._asked = entries
        quantities = self._quantities(tables, parts, entries)
        for section, entry, wrong in impossibilities(quantities, entries):
            self._problem(section, entry, wrong)
        for section, entry, wrong in implausibilities(self._sound(quantities), entries):
            self._problem(section, entry, f"{wrong} (unusual = true if it is meant)")
        refuse(self.path, self.problems)
        return parts, quantities

    def _parts(self, tables: Mapping[str, dict[str, Any]]) -> dict[str, InstalledPart]:
        """Every section that is not fixed, as a part; one that cannot be is noted and left out."""
        parts: dict[str, InstalledPart] = {}
        taken: set[str] = set()
        whole = True
        for section, table in tables.items():
            if section in FIXED:
                continue
            if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", section):
                self._problem(
                    section, "", "a section is named with letters, digits and single underscores"
                )
                whole = False
                continue
            kind = str(table.get("component", section))
            try:
                component = self._component(section, kind)
            except InputError as error:
                self._problem(section, "component", str(error))
                whole = False
                continue
            names = {f"[{kind}]", *component.states, *component.makes}
            suffix = f"_{section}" if names & taken else ""
            taken |= {f"{name}{suffix}" for name in names}
            for name, axis in component.opposite.items():
                if name in table and axis in table:
                    wrong = f"{name} gives it, {axis} = -{name}: leave {axis} out"
                    self._problem(section, axis, wrong)
            optional = (name for name, entry in component.entries.items() if entry.optional)
            parts[section] = InstalledPart(
                section,
                component,
                suffix,
                self._controls(section, table),
                self._flow(section, table, component),
                bool(component.place) or any(axis in table for axis in PLACE),
                tuple(entry for entry in optional if entry in table),
                kind,
            )
        if whole:
            self._flow_is_made(parts)
        return parts

    def _flow_is_made(self, parts: Mapping[str, InstalledPart]) -> None:
        """Note every flow that a part needs and no part makes, with the part that would."""
        made = {name for part in parts.values() for name in part.makes}
        for section, part in parts.items():
            for name in part.needs:
                if name not in made:
                    makers = [kind for kind in packaged() if name in find(kind).makes]
                    add = f"; add a section [{makers[0]}]" if makers else ""
                    self._problem(
                        section,
                        "flow" if part.flow else "",
                        f"needs the flow {name}, which no part makes{add} (made are"
                        f" {', '.join(sorted(made)) or 'none'})",
                    )

    def _quantities(
        self,
        tables: Mapping[str, dict[str, Any]],
        parts: Mapping[str, InstalledPart],
        entries: Mapping[str, Mapping[str, Entry]],
    ) -> dict[str, dict[str, Quantity]]:
        """Every number that can be read; what cannot, and what is missing or unknown, is noted."""
        for required in FIXED:
            if required not in tables:
                expected = ", ".join(f"{name} ({e.unit})" for name, e in FIXED[required].items())
                self.problems.append(
                    (len(self.lines) + 1, f"section [{required}] is missing: it has {expected}")
                )
        out: dict[str, dict[str, Quantity]] = {section: {} for section in entries}
        for section, expected in entries.items():
            table = tables[section]
            known = (*expected, *(() if section in FIXED else (*WIRING, *PLACE)))
            if section in parts:
                known += tuple(parts[section].component.entries)
            for name in table:
                if name not in known:
                    self._problem(section, name, str(UnknownNameError("entry", name, expected)))
                    free = [
                        e for e in expected if e not in table and (section, e) not in self._entries
                    ]
                    for near in difflib.get_close_matches(name, free, n=1, cutoff=0.6):
                        self._entries[section, near] = name
        for by_reference in (False, True):  # what is referred to comes first
            for section, expected in entries.items():
                for name, entry in expected.items():
                    written = self._entries.get((section, name), name)
                    if _refers(tables[section].get(written)) != by_reference:
                        continue
                    try:
                        out[section][name] = self._quantity(section, name, entry, out)
                    except InputError as error:
                        self._problem(section, written, str(error))
                    except _AlreadySaidError:
                        pass
        return out

    def _sections(self) -> dict[str, dict[str, Any]]:
        """The sections; one whose name is nearly that of a missing fixed or a packaged one is taken
        for that, and noted.
        """
        found = {key: value for key, value in self.tables.items() if isinstance(value, dict)}
        for key in self.tables:
            if key not in found and key not in ("title", "source"):
                self._problem(
                    key, "", f"stands in no section: put it below one of {', '.join(FIXED)}, ..."
                )
        known = [*FIXED, *packaged()]
        out = {}
        for name, table in found.items():
            near = difflib.get_close_matches(
                name, [k for k in known if k not in found and k not in out], n=1, cutoff=0.6
            )
            if name in known or "component" in table or not near:
                out[name] = table
            else:
                self._problem(name, "", f"unknown component {name!r}; did you mean {near[0]!r}?")
                self._written[near[0]] = name
                out[near[0]] = table
        return out

    def _problem(self, section: str, entry: str, wrong: str) -> None:
        """Note what is wrong with an entry (or a section)."""
        self._doubted.add((section, entry))
        self.problems.append(
            problem(self.lines, self._written.get(section, section), entry, wrong, section)
        )

    def _sound(
        self, quantities: Mapping[str, dict[str, Quantity]]
    ) -> dict[str, dict[str, Quantity]]:
        """The numbers nothing was found wrong with."""
        return {
            section: {name: q for name, q in of.items() if (section, name) not in self._doubted}
            for section, of in quantities.items()
        }

    def _quantity(
        self,
        section: str,
        name: str,
        entry: Entry,
        known: Mapping[str, Mapping[str, Quantity]],
    ) -> Quantity:
        """Return an entry, from those with a value `known` where it refers to one; the message has
        no line number.
        """
        written = self._entries.get((section, name), name)
        table = self.tables[self._written.get(section, section)].get(written)
        unit = entry.unit
        if table is None and entry.optional:
            return Quantity(0.0, unit, "not given: at the c.g.")
        if table is None:
            raise InputError(
                f"missing ({entry.meaning}); add {name} = {{ value = ..., unit = {unit!r}, source ="
                " ... }"
            )
        if table == UNREADABLE:
            raise _AlreadySaidError
        if not _refers(table):
            return _read(table, unit)
        target = self._target(table)
        if len(table) > 1 or target is None or _refers(target):
            if target is not None and _refers(target) and self._target(target) is None:
                raise _AlreadySaidError
            raise InputError(
                "{ ref = 'section.entry' } must name an entry with a value and have no other key,"
                f" got {table}"
            )
        ref = str(table["ref"])
        where, _, other = ref.partition(".")
        if other not in known.get(where, {}):
            raise _AlreadySaidError
        if dimension(known[where][other].unit) != dimension(unit):
            raise InputError(
                f"expected {unit}, got the {known[where][other].unit} of {ref}, which is another"
                " kind of quantity"
            )
        return known[where][other]._replace(unit=unit, ref=ref)

    def _target(self, table: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """The entry that another refers to, as the file has it, a missing one as one that refers to
        nothing; None where no section has such an entry.
        """
        section, _, entry = str(table["ref"]).partition(".")
        expected = self.tables.get(self._written.get(section, section))
        target = expected.get(self._entries.get((section, entry), entry)) if expected else None
        if target is None and entry in self._asked.get(section, {}):
            return {"ref": ""}
        return target if isinstance(target, Mapping) else None

    def _component(self, section: str, kind: str) -> Component:
        try:
            return find(kind, self.folder, allow_code=self.allow_code)
        except UnknownNameError as error:
            raise InputError(f"{error}; or name a file: component = './{section}.py'") from error

    def _controls(self, section: str, table: Mapping[str, Any]) -> dict[str, dict[str, float]]:
        """{control of the part: {control of the vehicle: gain}}; what cannot be is noted."""
        mixes = table.get("controls", {})
        if not isinstance(mixes, Mapping) or not all(
            isinstance(mix, Mapping) for mix in mixes.values()
        ):
            self._problem(
                section,
                "controls",
                "expected { d_col = { d_col = 1.0, d_lon = 0.2 } }, for a control of the part its"
                f" mix; got {mixes}",
            )
            return {}
        for name in (*mixes, *(control for mix in mixes.values() for control in mix)):
            if name not in CONTROLS:
                self._problem(section, "controls", str(UnknownNameError("control", name, CONTROLS)))
        for gain in (gain for mix in mixes.values() for gain in mix.values()):
            if (
                isinstance(gain, bool)
                or not isinstance(gain, int | float)
                or not math.isfinite(gain)
            ):
                self._problem(
                    section, "controls", f"a gain must be a finite number (rad/rad), got {gain!r}"
                )
                return {}
        return {
            name: {control: float(gain) for control, gain in mix.items()}
            for name, mix in mixes.items()
        }

    def _flow(self, section: str, table: Mapping[str, Any], component: Component) -> dict[str, str]:
        """{flow the part needs: whose it takes}; what cannot be is noted."""
        flow = table.get("flow", {})
        if not isinstance(flow, Mapping):
            self._problem(
                section,
                "flow",
                "expected { V_imr = 'V_imr_aft_rotor' }: for a flow the part needs, whose it takes,"
                f" got {flow!r}",
            )
            return {}
        for name in flow:
            if name not in component.needs:
                self._problem(section, "flow", str(UnknownNameError("flow", name, component.needs)))
        return {name: str(source) for name, source in flow.items()}


class _AlreadySaidError(Exception):
    """Raised for an error that has been noted at its place."""


def entries_of(
    sections: Iterable[str], parts: Mapping[str, InstalledPart]
) -> dict[str, Mapping[str, Entry]]:
    """Return the entries of each section; sections that are neither fixed nor a part are
    left out.
    """
    return {
        section: FIXED[section] if section in FIXED else parts[section].entries
        for section in sections
        if section in FIXED or section in parts
    }


def _read(table: Any, unit: str) -> Quantity:
    """Call `read_quantity` for an entry whose place another message gives."""
    try:
        return read_quantity("", table, unit)
    except InputError as error:
        raise InputError(str(error).removeprefix(": ")) from error


def _refers(table: Any) -> bool:
    return isinstance(table, Mapping) and "ref" in table
