"""What a log holds and how it could be identified: for somebody who has only the file."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.output import Output, columns
from symheli.logs.column import Column, forward
from symheli.logs.contents import Contents
from symheli.logs.meaning import CONTROLS, Guess, guesses, moves, plain_name
from symheli.values.sample_period import JITTER, USUAL
from symheli.values.units import to_si

GAP = 1.5
"""Two samples further apart than this many median steps have a gap between them."""

CLOCKS = ("t", "time", "timestamp", "timeus", "timems", "timestampus", "timestampms", "stamp")
"""Plain names of columns that may be the time."""

AXES = (
    ("lon", ("q", "theta")),
    ("lat", ("p", "phi")),
    ("ped", ("r",)),
    ("col", ("w",)),
)
"""What drives what, the best first."""

LISTED = 60
"""Names of other columns that are printed."""

WINDOW = 25
"""Rows over which an angle is held against its rate: the noise of the rate averages out."""

SLOW = 0.03
"""s: samples closer than this are averaged to about this; three lags then reach over what a
helicopter does, not over noise.
"""

OWN_CLOCKS = ("ulog", "dataflash")
"""Formats in which every topic or message has its own rate, read by a map."""


@dataclass(frozen=True)
class Clock:
    """The time of a log: the column that counts it ("" where the columns have clocks of their own)
    in `unit`; median step, gaps, the longest step and the duration, all in s.
    """

    column: str
    unit: str
    step: float
    even: bool
    gaps: int
    longest: float
    duration: float


@dataclass(frozen=True)
class Motion:
    """How much a column moves: samples and those missing, range, mean and standard deviation in the
    unit it is guessed or declared to have, its own median step (s).
    """

    samples: int
    missing: int
    low: float
    high: float
    mean: float
    deviation: float
    moves: bool
    step: float | None


@dataclass(frozen=True)
class Survey:
    """What was found; `step` is the sample period that is suggested where the log has no clock."""

    log: Path
    format: str
    clock: Clock | None
    step: float | None
    motions: Mapping[str, Motion]
    units: Mapping[str, str | None]
    guesses: Mapping[str, Guess]
    missing: tuple[str, ...]
    map: str | None
    command: tuple[str, ...] | None


def survey(
    log: Path,
    contents: Contents,
    *,
    time: str | None = None,
    time_unit: str = "s",
    dt: float | None = None,
    signal_map: Path | None = None,
) -> Survey:
    """Look at every column of `contents`; `time` (in `time_unit`), `dt` (s) and `signal_map` as
    somebody has said already.
    """
    clock, name = None, time
    held = dict(contents.columns)
    if all(column.time is None for column in held.values()):
        name, unit = (time, time_unit) if time in held else _time_of(held)
        if name is not None:
            stamps = to_si(unit)[0] * held.pop(name).values
            held = {
                n: Column(stamps, c.values, c.unit)
                for n, c in held.items()
                if len(c.values) == len(stamps)
            }
            clock = _clock(name, unit, stamps)
    elif contents.format not in OWN_CLOCKS:
        stamps = next(iter(held.values())).time
        clock = None if stamps is None else _clock("", "s", stamps)
    guessed = guesses(held, contents.format)
    step = contents.step if dt is None else dt
    if step is None and clock is None and contents.format not in OWN_CLOCKS:
        step = _step_of(held, guessed)
    found = Survey(
        log,
        contents.format,
        clock,
        step,
        {n: _motion(c) for n, c in held.items()},
        {n: c.unit for n, c in held.items()},
        guessed,
        (),
        None,
        None,
    )
    return _suggested(found, dt, signal_map)


def answer(found: Survey) -> Output:
    """As text and as data."""
    return Output(text(found), data(found))


def text(found: Survey) -> str:
    """What is there, what moves, what is missing, and a command to copy."""
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
    if others:
        parts += ["", f"other columns that move: {_listed(others)}"]
    if still:
        parts.append(f"columns that stay where they are: {_listed(still)}")
    if found.missing:
        parts += ["", "missing:", *(f"  - {sentence}" for sentence in found.missing)]
    if found.command is None:
        parts += ["", "to identify, name --outputs, --inputs and --scheduling (docs/identify.md)"]
    else:
        parts += ["", "to identify, check the guess and copy:", "", *_copy(found)]
    return "\n".join(parts)


def data(found: Survey) -> dict[str, Any]:
    """The same for a program; the command as the words of a shell."""
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
        "missing": list(found.missing),
        "suggested_map": found.map,
        "suggested_command": None if found.command is None else list(found.command),
    }


# --- looking -------------------------------------------------------------------------------------


def _time_of(held: Mapping[str, Column]) -> tuple[str | None, str]:
    """The column that probably is the time and its unit: by name, and steps that fit; (None, "s")
    where none does.
    """
    for name, column in sorted(held.items(), key=lambda item: item[0] not in ("t", "time")):
        plain, _ = plain_name(name)
        values = column.values
        if plain not in CLOCKS or len(values) < 2 or not np.all(np.diff(values) > 0):
            continue
        step = float(np.median(np.diff(values)))
        declared = column.unit if column.unit and to_si(column.unit)[1] == "s" else None
        for unit in [declared] if declared else ["s", "ms", "us", "ns"]:
            if declared or USUAL[0] <= to_si(unit)[0] * step <= USUAL[1]:
                return name, unit
    return None, "s"


def _clock(name: str, unit: str, stamps: np.ndarray) -> Clock:
    stamps = stamps[forward(stamps)]
    steps = np.diff(stamps)
    step = float(np.median(steps))
    inside = steps[steps <= GAP * step]
    return Clock(
        name,
        unit,
        step,
        bool(np.ptp(inside) <= JITTER * step),
        int(np.sum(steps > GAP * step)),
        float(steps.max()),
        float(stamps[-1] - stamps[0]),
    )


def _motion(column: Column) -> Motion:
    known = column.values[np.isfinite(column.values)]
    step = None
    if column.time is not None and np.sum(forward(column.time)) > 1:
        step = float(np.median(np.diff(column.time[forward(column.time)])))
    shown = known if len(known) else np.array([np.nan])
    return Motion(
        samples=len(column.values),
        missing=len(column.values) - len(known),
        low=float(shown.min()),
        high=float(shown.max()),
        mean=float(shown.mean()),
        deviation=float(shown.std()),
        moves=moves(column.values),
        step=step,
    )


def _step_of(held: Mapping[str, Column], guessed: Mapping[str, Guess]) -> float | None:
    """The sample period (s) by which an angle follows its rate; None where they do not say."""
    for rate, angle in (("q", "theta"), ("p", "phi")):
        if rate in guessed and angle in guessed:
            w, a = (
                to_si(guessed[n].unit)[0] * held[guessed[n].column].values for n in (rate, angle)
            )
            moved = a[WINDOW:] - a[:-WINDOW]
            turned = np.cumsum(np.append(0.0, 0.5 * (w[1:] + w[:-1])))  # NaN from there on
            mean = turned[WINDOW:] - turned[:-WINDOW]
            good = np.isfinite(moved) & np.isfinite(mean)
            moved, mean = moved[good], mean[good]
            if len(mean) and np.any(mean) and np.any(moved):
                step = float(moved @ mean / (mean @ mean))
                agree = moved @ mean / np.sqrt((moved @ moved) * (mean @ mean))
                if agree > 0.5 and USUAL[0] <= step <= USUAL[1]:
                    return step
    return None


# --- suggesting ----------------------------------------------------------------------------------


def _suggested(found: Survey, dt: float | None, signal_map: Path | None) -> Survey:
    """With what is missing, and a command where outputs and inputs are guessed."""
    there = {s: g for s, g in found.guesses.items() if found.motions[g.column].moves}
    missing = _missing(found, there)
    axis = next(
        (
            (control, outputs)
            for control, wanted in AXES
            if control in there and (outputs := [y for y in wanted if y in there])
        ),
        None,
    )
    timed = found.clock or found.step or found.format in OWN_CLOCKS
    if axis is None or not timed:
        return replace(found, missing=missing)
    control, outputs = axis
    scheduling = (
        ["airspeed"] if "airspeed" in there else ["u", "v"] if {"u", "v"} <= there.keys() else []
    )
    used = [there[name] for name in (*outputs, control, *scheduling)]
    step = dt or (found.clock.step if found.clock else found.step) or 0.0
    by_map = found.format in OWN_CLOCKS
    named = {g.signal: g.signal if by_map else g.column for g in used}
    command = ["symheli", "identify", str(found.log)]
    content = None
    if by_map:
        steps = [found.motions[there[n].column].step or 0.0 for n in (*outputs, control)]
        step = dt or float(f"{max(steps):.2g}")
        content = _map(used, found, step)
        command += ["--map", "aircraft.toml"]
    elif signal_map is not None:
        command += ["--map", str(signal_map)]
    else:
        command += _reading(found, used, dt)
    command += ["--outputs", ",".join(named[y] for y in outputs), "--inputs", named[control]]
    if len(scheduling) == 1:
        command += ["--scheduling", named["airspeed"]]
    elif scheduling:
        command += ["--scheduling-from", ",".join(named[s] for s in scheduling)]
    else:
        command += ["--degree", "0"]
    if (means := int(SLOW / step + 1e-9)) > 1:
        command += ["--decimate", str(means)]
    return replace(found, missing=missing, map=content, command=tuple(command))


def _reading(found: Survey, used: list[Guess], dt: float | None) -> list[str]:
    """Options by which a log without a map is read."""
    out = []
    if found.clock is None:
        out += ["--dt", f"{found.step:.4g}"]
    else:
        if found.clock.column not in ("", "t", "time"):
            out += ["--time", found.clock.column]
        if found.clock.unit != "s":
            out += ["--time-unit", found.clock.unit]
        if dt or not found.clock.even:
            out += ["--dt", f"{dt or found.clock.step:.3g}"]
    told = [g for g in used if found.units[g.column] is None]
    return [*out, *(["--units", *(f"{g.column}={g.unit}" for g in told)] if told else [])]


def _map(used: list[Guess], found: Survey, dt: float) -> str:
    """A signal map with these columns."""
    lines = [f"dt = {dt:g}", "[signals]"]
    for guess in used:
        unit = "" if found.units[guess.column] else f', unit = "{guess.unit}"'
        lines.append(f'{guess.signal} = {{ column = "{guess.column}"{unit} }}')
    return "\n".join(lines)


def _missing(found: Survey, there: Mapping[str, Guess]) -> tuple[str, ...]:
    sentences = []
    if found.clock is None and found.format not in OWN_CLOCKS:
        hint = (
            f"; angles against rates, or positions against velocities, suggest {found.step:.4g} s"
            if found.step
            else ""
        )
        sentences.append(f"a clock: say how far apart the rows are, --dt SECONDS{hint}")
    if not {"p", "q", "r"} & there.keys():
        sentences.append("angular rates p, q, r: what an identification best predicts")
    if not {"phi", "theta"} & there.keys():
        sentences.append("attitude phi, theta")
    if not set(CONTROLS) & there.keys():
        sentences.append(
            "an input that moves: a stick, or what goes to the swashplate (called lon, lat, col or"
            " ped here)"
        )
    if "airspeed" not in there and not {"u", "v"} <= there.keys():
        sentences.append("airspeed, or velocities to make it of: without it the model is LTI")
    elif "airspeed" in there and _ground(there["airspeed"]):
        sentences.append(
            f"airspeed: {there['airspeed'].column} is speed over ground, wind is not in it"
        )
    return tuple(sentences)


def _ground(guess: Guess) -> bool:
    return any(word in guess.column.lower() for word in ("gps", "ground"))


# --- printing ------------------------------------------------------------------------------------


def _clock_text(found: Survey) -> list[str]:
    if found.format in OWN_CLOCKS:
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


def _airspeed(found: Survey) -> list[str]:
    """Its range in m/s: what a schedule can cover."""
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


def _copy(found: Survey) -> list[str]:
    """For a shell: the map, if one is needed, and the command."""
    line = shlex.join(found.command or ())
    if found.map is None:
        return [line]
    return ["cat > aircraft.toml <<'END'", *found.map.splitlines(), "END", line]
