"""Sizes of a design while they are moved: which there are, their values, the pieces of the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from studies.controllers.design_choices import DesignChoices
from studies.controllers.judged import NAME
from studies.controllers.synthesized_report import margin_rows
from studies.page import charts
from studies.page.frozen import Frozen, Numbers, Point, Response, scales
from studies.page.proving import Proof, Proving
from symheli.values.signal import Signal
from synthesis.design.loops.loop_measures import MEASURES
from synthesis.sheet.evaluation import SpecificationTable, boundary, worst

NOISE = "Noise of measurements"
DECADES, STEP = 1.0, 0.02
"""How far a size may be moved to either side, and a step of the keyboard: powers of ten."""
COMPUTED = (
    "Computed at {n} airspeeds held, by point designs ({how}) in these sizes. Nothing of this is"
    " proven, and the controller that is proven is another one: the LPV design in the same sizes."
)
SHOWN = ("gain", "phase", "crossover")
LIMITS = {"gain": "gain_margin", "phase": "phase_margin"}
"""Entry of the sheet whose Level 1 is drawn beside a measure."""
IN_BRACKETS = "worst over airspeed; in brackets its Level"
FIRST = 6
"""Entries that miss Level 1 and are named."""


class Size(NamedTuple):
    """One size of the file: the table it stands in (sizes, noise), its name and unit, and the group
    in which it is shown.
    """

    table: str
    name: str
    unit: str
    group: str

    @property
    def label(self) -> str:
        """Name for a reader."""
        return f"{self.name} noise" if self.table == "noise" else self.name


def sizes_of(choices: DesignChoices) -> list[Size]:
    """Return the sizes that change the plant of the design, in the order of the file."""
    found = []
    for table in ("sizes", "noise"):
        for name, value in getattr(choices, table).items():
            doubled = replace(choices, **{table: {**getattr(choices, table), name: 2.0 * value}})
            before, after = scales(choices), scales(doubled)
            if all(np.array_equal(a, b) for a, b in zip(before, after, strict=True)):
                continue
            bare = name.removesuffix("_disturbance").removesuffix("_reference")
            unit = Signal(bare).unit
            found.append(Size(table, name, unit, _group(choices, table, name)))
    return found


def _group(choices: DesignChoices, table: str, name: str) -> str:
    if table == "noise":
        return NOISE
    if name in choices.controls:
        return "Commands"
    return "Deviations" if name in choices.measurements else "Disturbances"


class Moved:
    """Sizes as powers of ten by which they are moved from those of the file.

    Parameters
    ----------
    choices : DesignChoices
        The file.
    ask : callable
        Called with the choices after each move.
    """

    def __init__(self, choices: DesignChoices, ask: Callable[[DesignChoices], object]):
        self.file, self.sizes = choices, sizes_of(choices)
        self.at = dict.fromkeys(self.sizes, 0.0)
        self.changes, self._ask = 0, ask

    def move(self, size: Size, to: float) -> None:
        """Move one size to 10^to of its value in the file, and ask; nothing where it is there."""
        to = min(max(to, -DECADES), DECADES)
        if abs(to - self.at[size]) < 1e-9:
            return
        self.at[size] = to
        self.changes += 1
        self._ask(self.choices)

    def value(self, size: Size) -> float:
        """Return a size in its unit: three digits where it was moved."""
        own = float(getattr(self.file, size.table)[size.name])
        return float(f"{own * 10.0 ** self.at[size]:.3g}") if self.at[size] else own

    @property
    def choices(self) -> DesignChoices:
        """The choices with the sizes as they are now."""
        tables = {
            table: dict(getattr(self.file, table))
            | {size.name: self.value(size) for size in self.sizes if size.table == table}
            for table in ("sizes", "noise")
        }
        return replace(self.file, **tables)


# --- the pieces of the page -----------------------------------------------------------------------


def parts(numbers: Numbers, points: Sequence[Point]) -> dict[str, str]:
    """Return the pieces of HTML of frozen numbers, by name."""
    designs = [numbers.designs[v] for v in sorted(numbers.designs)]
    table = numbers.table(points)
    return {
        "state": state(numbers, designs, points),
        "margins": margins(designs, points[0].sheet) if designs else "",
        "sheet": sheet(table),
        "steps": steps(designs),
        "gusts": gusts(designs),
    }


def state(numbers: Numbers, designs: Sequence[Frozen], points: Sequence[Point]) -> str:
    """Return what the numbers are, how long they took, and where there is no design."""
    how = " and ".join(dict.fromkeys(one.method for one in designs if one.method)) or "LQG"
    said = COMPUTED.format(n=len(points), how=how)
    words = Markup('<p class="quiet">{}</p>').format(said)
    if math.isnan(numbers.designed):
        return words + Markup('<p class="quiet">computing...</p>')
    took = f"Margins and responses {numbers.designed:.2f} s after the change"
    more = "" if math.isnan(numbers.judged) else f", the whole sheet {numbers.judged:.1f} s"
    words += Markup('<p class="quiet">{}{}.</p>').format(took, more)
    for one in designs:
        if one.failure:
            words += Markup('<p class="alarm">At {:.3g} m/s: {}</p>').format(
                one.airspeed, one.failure
            )
    return words


def margins(designs: Sequence[Frozen], sheet: object) -> str:
    """Return charts of the margins and crossovers over airspeed, a curve an axis."""
    V = np.array([one.airspeed for one in designs])
    axes = list(dict.fromkeys(axis for one in designs for axis in one.measures))
    if not axes:
        return "<p>The controller has none of the axes of the specification sheet.</p>"
    pictures = []
    for name in SHOWN:
        measure = MEASURES[name]
        curves = [
            charts.Curve(axis, V, _over(designs, axis, name), f"c{k}", marks=True)
            for k, axis in enumerate(axes)
        ]
        limit = _limit(sheet, name)
        if math.isfinite(limit):
            curves.append(charts.Curve("Level 1", V[[0, -1]], np.full(2, limit), "limit"))
        about = f"{measure.words} of {', '.join(axes)} over airspeed"
        top = max((float(np.nanmax(c.y, initial=0.0)) for c in curves), default=0.0)
        picture = charts.chart(
            curves, about, "airspeed, m/s", measure.unit, y=(0.0, 1.08 * top or 1.0)
        )
        pictures.append(f"<figure><figcaption>{measure.words}</figcaption>{picture}</figure>")
    names = [(axis, f"c{k}") for k, axis in enumerate(axes)]
    return (
        f'{charts.legend(names)}<div class="charts">{"".join(pictures)}</div>'
        '<p class="quiet">Dashed: boundary of Level 1. 40 dB and 180 deg: that or more.</p>'
    )


def sheet(table: SpecificationTable | None) -> str:
    """Return the verdict of the specification sheet, its margins with their Levels, and what misses
    Level 1.
    """
    if table is None:
        return '<p class="quiet">being computed</p>'
    if not table.stable[NAME].all():
        return "<p>Not every loop is stable: no verdict.</p>"
    rows = [
        (
            r.specification.axis,
            r.specification.name,
            f"{worst(r)} {r.specification.unit}",
            f"{r.at:.3g} m/s",
            boundary(r.specification),
        )
        for r in table.missed(NAME)
    ]
    heads = ("axis", "entry", "worst", "at", "Level 1")
    more = f"<p>and {len(rows) - FIRST} more</p>" if len(rows) > FIRST else ""
    missed = (
        f"<h3>Misses Level 1, furthest first</h3>{html_table([heads, *rows[:FIRST]])}{more}"
        if rows
        else ""
    )
    verdict = Markup("<p>{}</p>").format(table.verdict(NAME))
    levels = html_table(margin_rows(table))
    if not levels:
        return verdict
    return f'{verdict}{levels}<p class="quiet">{IN_BRACKETS}</p>{missed}'


def steps(designs: Sequence[Frozen]) -> str:
    """Return the responses to a command of 1 of each axis, a curve an airspeed."""
    axes = list(dict.fromkeys(axis for one in designs for axis in one.steps))
    pictures = []
    for axis in axes:
        curves = [
            _curve(f"{one.airspeed:.3g} m/s", one.steps[axis], 0, k)
            for k, one in enumerate(designs)
            if axis in one.steps
        ]
        picture = charts.chart(curves, f"{axis} after a command of 1", "time, s", "of its command")
        pictures.append(f"<figure><figcaption>{axis}</figcaption>{picture}</figure>")
    return f'{_airspeeds(designs)}<div class="charts">{"".join(pictures)}</div>'


def gusts(designs: Sequence[Frozen]) -> str:
    """Return the responses to a step of each disturbance of its size: all deviations together, and
    all commands.
    """
    names = list(dict.fromkeys(name for one in designs for name in one.gusts))
    pictures = []
    for name in names:
        for part, what in enumerate(("deviations", "commands")):
            curves = [
                _curve(f"{one.airspeed:.3g} m/s", one.gusts[name], part, k)
                for k, one in enumerate(designs)
                if name in one.gusts
            ]
            about = f"all {what} in their sizes after a step of {name}"
            picture = charts.chart(curves, about, "time, s", "of their sizes")
            caption = Markup("<figcaption>{}: {}</figcaption>").format(name, what)
            pictures.append(f"<figure>{caption}{picture}</figure>")
    return f'{_airspeeds(designs)}<div class="charts">{"".join(pictures)}</div>'


def proof(proving: Proving, choices: DesignChoices) -> str:
    """Return what is proven, or how far that is."""
    if proving.running:
        return Markup('<p role="status">under way: {}</p>').format(proving.progress)
    if proving.proof is None:
        if proving.said:
            return Markup('<p class="alarm">Nothing is proven. {}</p>').format(proving.said)
        return "<p>Nothing is proven yet.</p>"
    return _proven(proving.proof, moved=proving.proof.choices != choices)


def _proven(found: Proof, moved: bool) -> str:
    words = Markup("")
    if moved:
        words += Markup(
            '<p class="alarm">This is of other sizes than those that stand above now.</p>'
        )
    style, said = ("green", "proven") if found.verified else ("red", "nothing is proven")
    words += Markup('<p class="lamp {}"><i></i><b>{}</b></p><p>{}</p>').format(
        style, said, found.answer
    )
    words += html_table([("gain", "value", "of"), *found.gains])
    if found.margins:
        words += Markup("<h3>Margins of the LPV controller that flies</h3>")
        words += html_table(found.margins)
        words += Markup('<p class="quiet">{}</p>').format(IN_BRACKETS)
    sentences = Markup("").join(Markup("<li>{}</li>").format(s) for s in found.sentences)
    hypotheses = Markup("").join(Markup("<li>{}</li>").format(s) for s in found.hypotheses)
    return (
        f"{words}<ul>{sentences}</ul>"
        f"<details><summary>What the proof rests on</summary><ul>{hypotheses}</ul></details>"
    )


def html_table(rows: Sequence[Sequence[str]]) -> Markup:
    """Return a table whose first row is its head, in a box that scrolls."""
    if len(rows) < 2:
        return Markup("")
    head = Markup("").join(Markup('<th scope="col">{}</th>').format(cell) for cell in rows[0])
    body = Markup("")
    for row in rows[1:]:
        cells = Markup("").join(Markup("<td>{}</td>").format(cell) for cell in row)
        body += Markup("<tr>{}</tr>").format(cells)
    return Markup(
        '<div class="scroll" tabindex="0"><table><thead><tr>{}</tr></thead><tbody>{}</tbody>'
        "</table></div>"
    ).format(head, body)


def _over(designs: Sequence[Frozen], axis: str, name: str) -> np.ndarray:
    values: list[float] = []
    for one in designs:
        known: Mapping[str, float] = one.measures[axis].values if axis in one.measures else {}
        values.append(known.get(name, math.nan))
    return np.array(values)


def _limit(sheet: object, name: str) -> float:
    for spec in getattr(sheet, "specifications", ()):
        if spec.measure == LIMITS.get(name):
            return float(spec.level_1)
    return math.nan


def _curve(name: str, response: Response, column: int, k: int) -> charts.Curve:
    every = max(len(response.time) // 120, 1)
    return charts.Curve(name, response.time[::every], response.values[::every, column], f"c{k}")


def _airspeeds(designs: Sequence[Frozen]) -> str:
    return charts.legend([(f"{one.airspeed:.3g} m/s", f"c{k}") for k, one in enumerate(designs)])
