"""Suggestion of a command that identifies a model from a log, and of missing information."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studies.log.flown import COARSE, SERVING, UNRESOLVED
from symheli.logs.format import own_clocks
from symheli.logs.meaning import CONTROLS, Guess
from symheli.logs.segments import MIN_DURATION
from symheli.logs.survey import Survey

AXES = (
    ("lon", ("q", "theta")),
    ("lat", ("p", "phi")),
    ("ped", ("r",)),
    ("col", ("w",)),
)
"""Inputs and what they drive, the best first."""

SLOW = 0.03
"""s: samples closer than this, or than those of the input, are averaged to about this; three lags
then reach over what a helicopter does, not over noise.
"""

SLOWEST = 0.2
"""s: an input that is logged more seldom, and moves faster than that shows, tells nothing."""


@dataclass(frozen=True)
class Suggestion:
    """Sentences on what is `missing`; the words of a `command`, and the signal `map` it needs, None
    where nothing can be suggested or no map is needed; `refused`: which of the sentences is why
    there is no command.
    """

    missing: tuple[str, ...]
    map: str | None = None
    command: tuple[str, ...] | None = None
    refused: str = ""


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
    timed = found.clock or found.step or own_clocks(found.format)
    if axis is None or not timed:
        least = ("a clock", "an input") if set(CONTROLS) & there.keys() == set() else ("a clock",)
        why = next((m for m in missing if m.startswith((*least, "angular rates"))), "")
        return Suggestion(missing, refused=why or "no output that an input drives moves")
    control, outputs = axis
    scheduling = (
        ["airspeed"] if "airspeed" in there else ["u", "v"] if {"u", "v"} <= there.keys() else []
    )
    step = dt or (found.clock.step if found.clock else found.step) or 0.0
    by_map, means = own_clocks(found.format), SLOW
    if by_map and not found.serving and found.segments:
        why = f"flight: no segment of {MIN_DURATION:g} s in the air; --segments all overrides"
        return Suggestion((*missing, why), refused=why)
    if by_map:
        steps = {n: found.motions[there[n].column].step or 0.0 for n in (*outputs, control)}
        step = dt or float(f"{steps[outputs[0]]:.2g}")
        means = max(SLOW, step)
        fast = [n for n in steps if found.unresolved[there[n].column] > UNRESOLVED]
        if control in fast and steps[control] > COARSE * means:
            if steps[control] > SLOWEST:
                why = f"{control} more often: {_too_slow(control, steps)}"
                return Suggestion((*missing, why), refused=why)
            means = steps[control]
            missing += (
                f"{control} more often: {_too_slow(control, steps)}; the model gets its steps",
            )
        late = [y for y in outputs[1:] if y in fast and steps[y] > COARSE * means]
        outputs = [y for y in outputs if y not in late]
        missing += tuple(f"{y} more often: {_too_slow(y, steps)}; it is left out" for y in late)
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
    if not by_map and 0 < len(found.serving) < len(found.segments):
        command += ["--segments", SERVING]
    if (together := int(means / step + 0.01)) > 1:
        command += ["--decimate", str(together)]
    return Suggestion(missing, content, tuple(command))


def _too_slow(name: str, steps: Mapping[str, float]) -> str:
    return f"it moves faster than its {1 / steps[name]:.2g} Hz resolve"


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
    unitless = [g for g in used if found.units[g.column] is None]
    return [*out, *(["--units", *(f"{g.column}={g.unit}" for g in unitless)] if unitless else [])]


def _map(used: list[Guess], found: Survey, dt: float) -> str:
    """A signal map with these columns."""
    lines = [f"dt = {dt:g}", "[signals]"]
    for guess in used:
        unit = "" if found.units[guess.column] else f', unit = "{guess.unit}"'
        lines.append(f'{guess.signal} = {{ column = "{guess.column}"{unit} }}')
    return "\n".join(lines)


def _missing(found: Survey, there: Mapping[str, Guess]) -> tuple[str, ...]:
    sentences = []
    if found.clock is None and not own_clocks(found.format):
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
