"""The specification sheet as a value: axes, boundaries of the levels with their sources, and
Froude scaling.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from symheli.errors import InputError, UnknownNameError
from symheli.values.html_table import as_table
from symheli.values.numbers import positive
from symheli.values.summary import summarized

SMALL_HELICOPTER = Path(__file__).parent / "small_helicopter.toml"

NOT_CONFIRMED = "not confirmed"

EXPONENTS = {"none": 0.0, "time": -0.5, "frequency": 0.5, "speed": -0.5, "length": -1.0}
"""Exponents of N = length of the sheet's vehicle / length of the vehicle at hand, by which a value
scales.
"""


@dataclass(frozen=True, kw_only=True)
class ControlAxis:
    """An axis of control: its loop is broken at `control`, `response` follows its command.

    type "attitude": the response is the attitude; "rate": its integral is. `coupled`: the signal
    that should stay at rest; "": none. `step`: size of a command, in the unit of the response.
    """

    name: str
    control: str
    response: str
    type: Literal["attitude", "rate"] = "attitude"
    coupled: str = ""
    step: float = 1.0

    def __post_init__(self) -> None:
        if self.type not in ("attitude", "rate"):
            raise UnknownNameError("type of axis", str(self.type), ("attitude", "rate"))
        positive(self.step, f"step of the axis {self.name}")


@dataclass(frozen=True, kw_only=True)
class Specification:
    """One required value of one axis: boundaries `level_1` and `level_2` in `unit`, NaN where none
    is known, each with its source.

    `measure` is computed at every frozen model (kind "frozen") or from flights ("flown"). `length`:
    rotor radius for which the numbers hold, m; see `at_length`. `window` (s) and `band` (rad/s):
    what the measure looks at.
    """

    name: str
    axis: str
    measure: str
    unit: str
    source: str
    length: float
    kind: Literal["frozen", "flown"] = "frozen"
    sense: Literal["at least", "at most", ""] = ""
    level_1: float = math.nan
    level_2: float = math.nan
    level_2_by: str = ""
    scaled: str = "none"
    other_task: str = ""
    window: float = 4.0
    band: tuple[float, float] = (0.3, 60.0)

    def __post_init__(self) -> None:
        where = f"{self.axis}, {self.name}"
        if self.scaled not in EXPONENTS:
            raise UnknownNameError(f"scaling of {where}", self.scaled, EXPONENTS)
        if self.kind not in ("frozen", "flown"):
            raise UnknownNameError(f"kind of {where}", self.kind, ("frozen", "flown"))
        if self.sense not in ("at least", "at most", ""):
            raise UnknownNameError(f"sense of {where}", self.sense, ("at least", "at most"))
        positive(self.length, f"length of {where}")
        known = math.isfinite(self.level_1) and math.isfinite(self.level_2)
        if self.sense and not known:
            raise InputError(f"{where}: {self.sense!r} needs level_1 and level_2")
        rising = self.level_1 > self.level_2
        if self.sense and (self.level_1 == self.level_2 or rising != (self.sense == "at least")):
            raise InputError(
                f"{where}: {self.sense!r} level_1 = {self.level_1:g} leaves level_2 ="
                f" {self.level_2:g} on the wrong side"
            )
        if self.source == NOT_CONFIRMED or self.sense:
            return
        raise InputError(f"{where}: an entry with a source needs its boundaries and a sense")

    @property
    def counts(self) -> bool:
        """Whether the entry counts in the mark: its value has a source, for this task."""
        return self.source != NOT_CONFIRMED and not self.other_task

    def design_margin(self, value: float) -> float:
        """Return how far a value is inside Level 1, percent of the width of Level 2: 0 at the
        boundary of Level 1, -100 at that of Level 3, at most 100; NaN without boundaries.
        """
        if not self.sense or math.isnan(value):
            return math.nan
        return min(100.0 * (value - self.level_1) / (self.level_1 - self.level_2), 100.0)

    def at_length(self, length: float) -> Specification:
        """Return the entry for a vehicle of this rotor radius, m, scaled by Froude number: with N =
        own length / `length`, times scale by 1/sqrt(N), frequencies by sqrt(N).
        """
        N = self.length / positive(length, "length")
        factor = N ** EXPONENTS[self.scaled]
        return replace(
            self,
            length=length,
            level_1=self.level_1 * factor,
            level_2=self.level_2 * factor,
            window=self.window / math.sqrt(N),
            band=(self.band[0] * math.sqrt(N), self.band[1] * math.sqrt(N)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """A specification sheet: axes by name, and specifications in the order they are shown, one axis
    after the other.

    Examples
    --------
    >>> from synthesis.sheet.sheet import Sheet
    >>> sheet = Sheet.load()
    >>> delay = sheet.of("heave", "equivalent delay")  # 200 ms of the full-scale helicopter
    >>> print(f"{delay.level_1:.0f} {delay.at_length(delay.length / 4).level_1:.0f} {delay.unit}")
    200 100 ms
    """

    title: str
    axes: Mapping[str, ControlAxis]
    specifications: tuple[Specification, ...]

    __repr__ = summarized
    _repr_html_ = as_table

    @classmethod
    def load(cls, path: str | os.PathLike[str] | None = None) -> Sheet:
        """Read a sheet from a TOML file; None: the packaged one of a small helicopter.

        Raises `InputError` for a file that is no sheet, with the entry that is wrong.
        """
        file = SMALL_HELICOPTER if path is None else Path(path)
        try:
            whole = tomllib.loads(file.read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{file}: {error.strerror or error}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{file}: expected a specification sheet in TOML: {error}") from None
        try:
            axes = {n: ControlAxis(name=n, **own) for n, own in whole.get("axes", {}).items()}
            lengths = whole.get("lengths", {})
            each = [
                _specification(axis, entry, lengths)
                for entry in whole.get("specification", [])
                for axis in entry["axes"]
            ]
        except (TypeError, KeyError, AttributeError) as error:
            raise InputError(f"{file}: an entry of the sheet is wrong: {error}") from None
        if not each:
            raise InputError(f"{file}: expected at least one [[specification]]")
        order = list(dict.fromkeys((*axes, *(s.axis for s in each))))
        each.sort(key=lambda s: order.index(s.axis))
        return cls(title=str(whole.get("title", file.stem)), axes=axes, specifications=tuple(each))

    def of(self, axis: str, name: str) -> Specification:
        """Return one specification; raises `UnknownNameError` for one that is not there."""
        found = {s.name: s for s in self.specifications if s.axis == axis}
        if name not in found:
            raise UnknownNameError(f"specification of {axis}", name, found)
        return found[name]

    def select(self, axes: Sequence[str] | None = None, kind: str | None = None) -> Sheet:
        """Return the sheet with these axes and this kind of entries only."""
        known = dict.fromkeys((*self.axes, *(s.axis for s in self.specifications)))
        for name in axes or ():
            if name not in known:
                raise UnknownNameError("axis", name, known)
        kept = tuple(
            s
            for s in self.specifications
            if (axes is None or s.axis in axes) and (kind is None or s.kind == kind)
        )
        own = {n: a for n, a in self.axes.items() if axes is None or n in axes}
        return replace(self, axes=own, specifications=kept)

    def at_length(self, length: float) -> Sheet:
        """Return the sheet for a vehicle of this rotor radius, m; see
        `Specification.at_length`.
        """
        return replace(self, specifications=tuple(s.at_length(length) for s in self.specifications))


def _specification(axis: str, entry: Mapping[str, Any], lengths: Mapping[str, float]):
    own = {key: value for key, value in entry.items() if key != "axes"}
    for level in ("level_1", "level_2"):
        if isinstance(own.get(level), Mapping):
            own[level] = own[level][axis]
    if isinstance(own["length"], str):
        own["length"] = lengths[own["length"]]
    if "band" in own:
        low, high = own["band"]
        own["band"] = (float(low), float(high))
    return Specification(axis=axis, **own)
