"""The specification sheet of a vehicle as a page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.report.pages import rendered
from symheli.values.whole_files import write_text
from synthesis.sheet.evaluation import Reached, boundary, margin, worst
from synthesis.sheet.picture import figure_of

if TYPE_CHECKING:
    from synthesis.sheet.evaluation import SpecificationTable

PROOFS = ["controller", "axis", "specification", "unit", "proven", "frozen", "margin, %", "s"]
"""Columns of the table of proofs."""


def write(
    table: SpecificationTable,
    path: Path,
    title: str,
    lead: str,
    missing: Mapping[str, str],
    of: str,
) -> Path:
    """Write the page, and its figures into a folder `figures` beside it; `of`: what the proofs are
    about.
    """
    from studies.report.drawn import drawn

    count = len(table.controllers)
    axes = dict.fromkeys(s.axis for s in table.frozen if s.sense)
    caption = "{}: design margins of the frozen loops, a mark an airspeed."
    pictures = drawn(
        [
            (f"specs-{axis}", caption.format(axis.capitalize()), "", figure_of(table, [axis]))
            for axis in axes
        ],
        path.parent / "figures",
    )
    text = rendered(
        "specs.html.j2",
        title=title,
        lead=lead,
        verdicts=[(name, table.verdict(name)) for name in table.controllers],
        missing=missing,
        pictures=pictures,
        width=380 + 190 * count,
        least=170 + 90 * count,
        controllers=table.controllers,
        margins=_margins(table),
        proofs=proofs(table),
        proofs_of=of,
        sources=_sources(table),
        seconds=table.seconds,
    )
    return write_text(path, text)


def proofs(table: SpecificationTable) -> list[list[str]]:
    """Return a row of `PROOFS` for each proof."""
    rows = []
    for name, each in table.proven.items():
        for one in each:
            spec = one.specification
            value = "none" if math.isnan(one.value) else f"{one.value:.4g}"
            frozen = "unstable" if math.isnan(one.frozen) else f"{one.frozen:.4g}"
            share = "" if math.isnan(one.margin) else f"{one.margin:.0f}"
            seconds = f"{one.seconds:.0f}"
            rows.append([name, spec.axis, spec.name, spec.unit, value, frozen, share, seconds])
    return rows


def _margins(table: SpecificationTable) -> list[dict[str, Any]]:
    each = [table.reached(name) for name in table.controllers]
    rows = []
    for k, spec in enumerate(table.sheet.specifications):
        cells = [_cell(reached[k], str(table.parameter.unit)) for reached in each]
        rows.append(
            {
                "axis": ""
                if k and table.sheet.specifications[k - 1].axis == spec.axis
                else spec.axis,
                "name": spec.name,
                "unit": spec.unit,
                "boundary": boundary(spec),
                "cells": cells,
            }
        )
    return rows


def _cell(r: Reached, unit: str) -> dict[str, str]:
    at = "" if math.isnan(r.at) else f" at {r.at:.4g} {unit}"
    text = worst(r) + at
    if r.failure:
        return {"text": r.failure, "level": "three", "title": text}
    if math.isnan(r.margin):
        return {"text": worst(r), "level": "open", "title": text}
    level = "one" if r.margin >= 0 else "two" if r.margin >= -100 else "three"
    return {"text": margin(r), "level": level, "title": text}


def _sources(table: SpecificationTable) -> list[list[str]]:
    """Return a row for each name and source: the axes that share them."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for s in table.sheet.specifications:
        task = f" ({s.other_task}: another task)" if s.other_task else ""
        rows.setdefault((s.name, s.source + task, s.level_2_by or "-"), []).append(s.axis)
    return [[name, ", ".join(axes), source, by] for (name, source, by), axes in rows.items()]
