"""Writer of vehicle files with a comment on every entry, and of the reference of all entries."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

from symheli.airframe.part import InstalledPart
from symheli.airframe.plausibility import RANGES
from symheli.airframe.quantity import Quantity
from symheli.airframe.sections import FIXED, PLACE, required_place
from symheli.airframe.vehicle import Vehicle
from symheli.components import Component, Entry, find, packaged
from symheli.values.units import dimension, units_of

_HEAD = """\
# A vehicle file: NAME = { value = ..., unit = "...", source = "..." }; above each what it is, its
# unit, what it must be and plausibly is. Change what is yours, say where each number is from, and
# load the file by its path. Other units are converted. deviation = ... is the standard deviation of
# a number, in its unit. assumed = true marks what is not published, unusual = true a number that is
# meant although no helicopter is known to have it, and { ref = "section.entry" } takes the value of
# another entry.
"""

REFERENCE = "## Every part and entry"
"""Heading of the reference."""


def as_toml(vehicle: Vehicle) -> str:
    """The vehicle file of an airframe, each entry below its meaning; loaded, it is the same
    airframe.
    """
    lines = [_HEAD, f"title = {_text(vehicle.title)}", f"source = {_text(vehicle.source)}"]
    entries = vehicle.entries
    for section, quantities in vehicle.sections.items():
        part = vehicle.components.get(section)
        lines += ["", *_about(part.component if part else None), f"[{section}]"]
        lines += _wiring(part) if part else []
        for name, q in quantities.items():
            if not (name in PLACE and part and part.placed and q.source.startswith("not given")):
                expected = entries[section][name]
                lines += [*_comment(expected), f"{name} = {_entry(q)}"]
    return "\n".join(lines) + "\n"


def reference() -> str:
    """Every part and entry a vehicle file may have, as a section in Markdown: meaning, unit, the
    units that are read, and the plausible range.
    """
    lines = [REFERENCE, ""]
    for section, entries in FIXED.items():
        lines += [f"### [{section}]", "", "Every airframe has it.", "", *_table(entries), ""]
    for kind in packaged():
        component = find(kind)
        lines += [f"### [{kind}]", "", *_about(component, ""), ""]
        flow = [
            f"{word}: {', '.join(f'`{name}`' for name in names)}"
            for word, names in (("needs", component.needs), ("makes", component.makes))
            if names
        ]
        lines += [f"Flow it {'; '.join(flow)}.", ""] if flow else []
        lines += [*_table(component.entries | required_place(component)), ""]
    lines += ["### In the section of any part", "", *_table(PLACE), ""]
    return "\n".join(lines).rstrip() + "\n"


def with_reference(page: str) -> str:
    """Return a page in Markdown with that section in place of its own, or at its end."""
    before, _, old = page.partition(f"{REFERENCE}\n")
    _, next_heading, after = old.partition("\n## ")
    return f"{before}{reference()}{next_heading}{after}"


def _table(entries: Mapping[str, Entry]) -> Iterator[str]:
    yield "| entry | meaning | unit | read too | plausible |"
    yield "|---|---|---|---|---|"
    for name, entry in entries.items():
        may = " (may be left out)" if entry.optional else ""
        cells = (f"`{name}`", entry.meaning + may, entry.unit, _others(entry), _bounds(entry))
        yield f"| {' | '.join(cells)} |"


def _bounds(entry: Entry) -> str:
    """Return the permitted and the plausible range of an entry."""
    must = f"whole number >= {entry.least}" if entry.least is not None else ""
    must = must or ("> 0" if entry.positive else "")
    plausible = str(RANGES[entry.kind]).rstrip() if entry.kind in RANGES else ""
    return ", ".join(text for text in (must, plausible) if text)


def _others(entry: Entry) -> str:
    if not dimension(entry.unit):
        return ""
    return ", ".join(unit for unit in units_of(dimension(entry.unit)) if unit != entry.unit)


def _comment(entry: Entry) -> Iterator[str]:
    """Yield the comment above an entry."""
    comments = (entry.meaning, entry.unit if dimension(entry.unit) else "", _bounds(entry))
    yield f"# {'; '.join(text for text in comments if text)}"


def _about(component: Component | None, mark: str = "# ") -> list[str]:
    """First sentence of the file of a component."""
    text = (component.evaluate.__globals__["__doc__"] or "") if component else ""
    first = text.strip().partition("\n")[0]
    return [f"{mark}{first}"] if first else []


def _wiring(part: InstalledPart) -> Iterator[str]:
    if part.kind != part.section:
        yield f"component = {_text(part.kind)}"
    if part.controls:
        mixes = (f"{name} = {_inline(mix)}" for name, mix in part.controls.items())
        yield f"controls = {{ {', '.join(mixes)} }}"
    if part.flow:
        yield f"flow = {_inline(part.flow)}"


def _inline(table: Mapping[str, float | str]) -> str:
    cells = (f"{k} = {_text(v) if isinstance(v, str) else repr(v)}" for k, v in table.items())
    return f"{{ {', '.join(cells)} }}"


def _entry(q: Quantity) -> str:
    if q.ref:
        return f"{{ ref = {_text(q.ref)} }}"
    flags = "".join(f", {name} = true" for name in ("assumed", "unusual") if getattr(q, name))
    known = f", deviation = {q.deviation!r}" if q.deviation else ""
    number = f"value = {q.value!r}, unit = {_text(q.unit)}{known}"
    return f"{{ {number}{flags}, source = {_text(q.source)} }}"


def _text(text: str) -> str:
    """A basic TOML string: JSON's escapes are TOML's."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
