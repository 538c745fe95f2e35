"""Suggestion of a command that identifies a model from a log, and of missing information."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from symheli.logs.format import OWN_CLOCKS
from symheli.logs.meaning import CONTROLS, Guess
from symheli.logs.survey import Survey

AXES = (
    ("lon", ("q", "theta")),
    ("lat", ("p", "phi")),
    ("ped", ("r",)),
    ("col", ("w",)),
)
"""What drives what, the best first."""

SLOW = 0.03
"""s: samples closer than this, or than those of the input, are averaged to about this; three lags
then reach over what a helicopter does, not over noise.
"""

COARSE = 1.5
"""Times that step: an output sampled more seldom would be made of samples that are still to come,
and is left out.
"""


@dataclass(frozen=True)
class Suggestion:
    """Sentences on what is `missing`; the words of a `command`, and the signal `map` it needs, None
    where nothing can be suggested or no map is needed.
    """

    missing: tuple[str, ...]
    map: str | None = None
    command: tuple[str, ...] | None = None


def suggestion(
    found: Survey, *, dt: float | None = None, signal_map: Path | None = None
) -> Suggestion:
    """Return the missing information, and a command where outputs and inputs are guessed; `dt` (s)
    and `signal_map` as given by the user.
    """
    there = found.moving
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
        return Suggestion(missing)
    control, outputs = axis
    scheduling = (
        ["airspeed"] if "airspeed" in there else ["u", "v"] if {"u", "v"} <= there.keys() else []
    )
    step = dt or (found.clock.step if found.clock else found.step) or 0.0
    by_map, means = found.format in OWN_CLOCKS, SLOW
    if by_map:
        steps = {n: found.motions[there[n].column].step or 0.0 for n in (*outputs, control)}
        step = dt or float(f"{steps[outputs[0]]:.2g}")
        means = max(SLOW, steps[control])
        late = [y for y in outputs[1:] if steps[y] > COARSE * max(means, step)]
        outputs = [y for y in outputs if y not in late]
        missing += tuple(
            f"{y} more often: {1 / steps[y]:.2g} Hz tells less than the input's"
            f" {1 / max(means, step):.2g} Hz, it is left out"
            for y in late
        )
    used = [there[name] for name in (*outputs, control, *scheduling)]
    named = {g.signal: g.signal if by_map else g.column for g in used}
    command = ["symheli", "identify", str(found.log)]
    content = None
    if by_map:
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
    if found.flight is not None:
        start = _beginning(found, used) if by_map else 0.0
        command += ["--start", f"{max(found.flight.start - start, 0.0):.4g}"]
        command += ["--stop", f"{found.flight.stop - start:.4g}"]
    if (together := int(means / step + 0.01)) > 1:
        command += ["--decimate", str(together)]
    return Suggestion(missing, content, tuple(command))


def _beginning(found: Survey, used: list[Guess]) -> float:
    """Return the instant from which all columns with clocks of their own are known."""
    return max(found.motions[guess.column].start or 0.0 for guess in used)


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
        sentences.append(f"a clock: give the time between rows, --dt SECONDS{hint}")
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
