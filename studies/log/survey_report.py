"""Report of a survey of a log with a suggested command, as text and as data."""

from __future__ import annotations

import shlex
from dataclasses import asdict
from typing import Any

from studies.log.suggestion import Suggestion
from studies.output import columns
from symheli.logs.format import own_clocks
from symheli.logs.survey import Survey
from symheli.values.units import to_si

MOST = 12
"""Segments that are printed."""

LISTED = 60
"""Names of other columns that are printed."""


def text(found: Survey, hint: Suggestion) -> str:
    """Return content, motion, missing information, and a command to copy."""
    moving = [name for name, motion in found.motions.items() if motion.moves]
    used = {guess.column for guess in found.guesses.values()}
    others = [name for name in moving if name not in used]
    still = [name for name, motion in found.motions.items() if not motion.moves]
    parts = [
        f"{found.log.name} ({found.format}): {len(found.motions)} columns of numbers,"
        f" {len(moving)} of them move",
        *_clock_text(found),
        "",
    ]
    if found.guesses:
        parts += [
            "what these columns seem to be (a guess, used only where you say so):",
            _table(found),
            *_airspeed(found),
        ]
    else:
        parts.append("no column has a name that says what it is")
    if len(found.segments) > 1:
        parts += ["", "segments (s on the log's clock):", *_segments(found)]
    if others:
        parts += ["", f"other columns that move: {_listed(others)}"]
    if still:
        parts.append(f"columns that stay where they are: {_listed(still)}")
    if hint.missing:
        parts += ["", "missing:", *(f"  - {sentence}" for sentence in hint.missing)]
    if hint.command is None:
        parts += ["", "to identify, name --outputs, --inputs and --scheduling (docs/identify.md)"]
    else:
        parts += ["", "to identify, check the guess and copy:", "", *_copy(hint)]
    return "\n".join(parts)


def data(found: Survey, hint: Suggestion) -> dict[str, Any]:
    """Return the same for a program; the command as the words of a shell."""
    by_column = {guess.column: guess for guess in found.guesses.values()}
    return {
        "log": found.log.name,
        "format": found.format,
        "identified": False,
        "time": None if found.clock is None else asdict(found.clock),
        "suggested_step": found.step,
        "columns": [
            {
                "name": name,
                "unit": found.units[name],
                "guess": asdict(by_column[name]) if name in by_column else None,
                **asdict(motion),
            }
            for name, motion in found.motions.items()
        ],
        "segments": [{**asdict(s), "serves": s in found.serving} for s in found.segments],
        "missing": list(hint.missing),
        "refused": hint.refused,
        "suggested_map": hint.map,
        "suggested_command": None if hint.command is None else list(hint.command),
    }


def _clock_text(found: Survey) -> list[str]:
    if own_clocks(found.format):
        return ["  every column has the clock of its message; they are brought to one step, dt"]
    if found.clock is None:
        return ["  no column is its time"]
    clock = found.clock
    source = f"column {clock.column} [{clock.unit}]" if clock.column else "its own clock"
    even = "" if clock.even else ", unevenly (--dt resamples)"
    number = f"{clock.gaps} gap{'' if clock.gaps == 1 else 's'}"
    gaps = f"{number}, the longest {clock.longest:.3g} s" if clock.gaps else "without a gap"
    return [
        f"  time: {source}, {clock.duration:.5g} s in steps of {clock.step:.4g} s"
        f" ({1 / clock.step:.4g} Hz){even}, {gaps}"
    ]


def _table(found: Survey) -> str:
    rows = [["signal", "column", "unit", "by", "rate", "missing", "from", "to", "varies by"]]
    for guess in found.guesses.values():
        motion = found.motions[guess.column]
        step = motion.step or (found.clock.step if found.clock else None)
        numbers = (
            [f"{v:.4g}" for v in (motion.low, motion.high, motion.deviation)]
            if motion.moves
            else [f"{motion.low:.4g}", "", "stays"]
        )
        rows.append(
            [
                guess.signal,
                guess.column,
                guess.unit,
                guess.why,
                f"{1 / step:.3g} Hz" if step else "?",
                str(motion.missing),
                *numbers,
            ]
        )
    return "\n".join(f"  {line}" for line in columns(rows, left=4).splitlines())


def _segments(found: Survey) -> list[str]:
    """Return the longest segments, in order of time, with a mark at those that serve."""
    kept = sorted(found.segments, key=lambda one: one.start - one.stop)[:MOST]
    rows = [
        [
            str(number),
            f"{one.start:.2f}",
            f"{one.stop:.2f}",
            one.what,
            one.ends,
            "yes" if one in found.serving else "no",
        ]
        for number, one in enumerate(found.segments, 1)
        if one in kept
    ]
    more = len(found.segments) - len(rows)
    head = ["", "from", "to", "state", "ends:", "serves"]
    lines = [f"  {line.rstrip()}" for line in columns([head, *rows], left=6).splitlines()]
    return lines + ([f"  and {more} shorter ones (--json)"] if more else [])


def _airspeed(found: Survey) -> list[str]:
    """Return the range of the airspeed, m/s, which a schedule can cover."""
    guess = found.guesses.get("airspeed")
    if guess is None or not found.motions[guess.column].moves:
        return []
    factor, motion = to_si(guess.unit)[0], found.motions[guess.column]
    return [
        f"  airspeed covers {factor * motion.low:.3g} to {factor * motion.high:.3g} m/s, mean"
        f" {factor * motion.mean:.3g}"
    ]


def _listed(names: list[str]) -> str:
    """Names, or where there are many, what stands before their point with how many each has."""
    if len(names) > LISTED:
        groups: dict[str, int] = {}
        for name in names:
            group = name.rpartition(".")[0] or name
            groups[group] = groups.get(group, 0) + 1
        names = [f"{group} ({n})" if n > 1 else group for group, n in groups.items()]
    more = f", and {len(names) - LISTED} more (--json)" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def _copy(hint: Suggestion) -> list[str]:
    """Return the map, if one is needed, and the command, for a shell."""
    line = shlex.join(hint.command or ())
    if hint.map is None:
        return [line]
    return ["cat > aircraft.toml <<'END'", *hint.map.splitlines(), "END", line]
