"""The AH-1S identified from noisy flights, beside what it is."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.ah1s.flight import CalmFlight, Plan, fly, unknown
from evidence.ah1s.servos import servos
from evidence.ah1s.simulator import AH1S, DEFLECTIONS, STATES, STICKS
from evidence.ah1s.trim import GUESS, trim
from evidence.ah1s.truth import SLOWEST, realization
from identification import (
    FilterError,
    InstrumentalVariables,
    KinematicARX,
    KinematicModel,
    Polynomial,
    Product,
    compare_frozen,
    fit,
)
from identification.judge.frozen_models import continuous_poles
from studies.output import columns
from studies.transition.comparison import SCALES
from symheli.flight import AirspeedSchedule, Excitation
from symheli.lpv import LinearModel, series
from symheli.records import FlightRecord

KNOT = 1852 / 3600
FAST = {60: 60 * KNOT, 100: 100 * KNOT}
"""Airspeeds up to which is flown, m/s by knots."""

SPEEDS = {
    60: (SLOWEST, 5.0, 10.0, 15.0, 20.0, 25.0, 60 * KNOT),
    100: (SLOWEST, 5.0, 10.0, 15.0, 20.0, 25.0, 60 * KNOT, 38.0, 45.0, 100 * KNOT),
}
"""Where models are compared, m/s."""

SEEDS = (11, 12, 13)
"""Of excitation and noise; fixed before any result of theirs was seen."""

AMPLITUDE = {"d_lon": 0.10, "d_lat": 0.15, "d_col": 0.06, "d_ped": 0.10}
BAND = (0.05, 2.5)
"""Excitation, parts of the sticks' travel and Hz."""

METHODS: dict[str, Any] = {
    "filter error": FilterError(CalmFlight()),
    "instruments": InstrumentalVariables(CalmFlight()),
    "least squares": "ls",
}
"""Instruments are the same plan flown without noise."""

NOISE_DB, DEGREE = 30.0, 3
STICK_SCALE = 0.1
"""Part of its travel by which a stick is scaled before a nu-gap is taken."""

MARK = 0.15
"""The largest nu-gap wanted."""

SECOND = 50
"""Samples of the predictions that are scored: 1 s."""

SLOW, GENTLE = (0.15, 0.6), 0.3
"""Frequencies (rad/s) between which the phugoid lies, and how fast it may grow or decay (1/s)."""


@dataclass(frozen=True)
class Kind:
    """A structure: what drives it and what it is scheduled on."""

    label: str
    make: Callable[[float, int], KinematicARX]
    deflections: bool

    def at(self, model: KinematicModel, speed: float, record: FlightRecord) -> LinearModel:
        """From sticks, at an airspeed held (m/s)."""
        p = (speed,) if len(model.parameters) == 1 else (speed, 0.0)
        held = model.at(*p)
        return series(servos(record), held) if self.deflections else held


def _as_the_xcell(high: float, degree: int) -> KinematicARX:
    return KinematicARX(
        tuple(map(str, STICKS)), "airspeed_command", basis=Polynomial(degree, 0.0, high)
    )


def _rotor_without_memory(high: float, degree: int) -> KinematicARX:
    return KinematicARX(
        tuple(map(str, DEFLECTIONS)),
        ("airspeed_command", "acceleration_command"),
        basis=Product((Polynomial(degree, 0.0, high), Polynomial(min(degree, 1), -2.0, 2.0))),
        na=1,
        offset_rate=False,
    )


KINDS = (
    Kind("sticks, airspeed (as the X-Cell)", _as_the_xcell, False),
    Kind("deflections, airspeed and acceleration, one lag", _rotor_without_memory, True),
)
"""The first is that of the X-Cell, without a change. The second knows what a stranger would be
told: that sticks act through lags, which are logged behind, that this rotor has no stabilizer bar,
and that trims depend on the acceleration.
"""


def training(knots: int, seed: int, noise_db: float | None = NOISE_DB) -> Plan:
    """Hover to so many knots and back, twice, gently and faster."""
    high = FAST[knots]
    schedule = AirspeedSchedule((high, 0.0) * 2, (0.8, 1.6, 1.6, 0.8), (6.0,) * 4)
    return Plan(schedule, Excitation(AMPLITUDE, band=BAND, seed=seed), noise_db, seed)


def unseen(knots: int, seed: int) -> Plan:
    """Other ramps and another excitation, without noise: what predictions are scored on."""
    high = FAST[knots]
    schedule = AirspeedSchedule((0.8 * high, 0.2 * high, high, 0.0), (1.2,) * 4, (4.0,) * 4)
    return Plan(schedule, Excitation(AMPLITUDE, band=BAND, seed=100 + seed), None, seed)


def truth(speeds: Sequence[float]) -> list[LinearModel]:
    """The simulator's own models at these airspeeds (m/s)."""
    simulator, guess, out = AH1S(), GUESS, []
    for speed in speeds:
        near = trim(simulator, speed, guess=guess)
        guess = unknown(near)
        out.append(realization(simulator, near))
    return out


def phugoid(model: LinearModel) -> complex:
    """The fastest growing (or slowest decaying) pole (1/s) of those that turn slowly; NaN where
    there is none.
    """
    s = continuous_poles(model)
    slow = s[(np.imag(s) > SLOW[0]) & (np.imag(s) < SLOW[1]) & (np.abs(np.real(s)) < GENTLE)]
    return complex(max(slow, key=lambda pole: pole.real, default=complex(np.nan, np.nan)))


@dataclass(frozen=True)
class Judged:
    """One structure fitted to one flight: nu-gaps and phugoids over the airspeeds, 1 s fits with
    moving and with constant coefficients by output.
    """

    kind: Kind
    seed: int
    gaps: tuple[float, ...]
    phugoids: tuple[complex, ...]
    moving: dict[str, float]
    constant: dict[str, float]


def judge(kind: Kind, knots: int, seed: int, exact: Sequence[LinearModel], method: Any) -> Judged:
    """Fly, identify, compare."""
    record, test = fly(training(knots, seed)), fly(unseen(knots, seed))
    high = FAST[knots]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # slow modes and weak instruments are judged here
        model = fit(kind.make(high, DEGREE), record, method=method)
        constant = fit(kind.make(high, 0), record, method=method)
    held = [kind.at(model, speed, record) for speed in SPEEDS[knots]]
    beside = compare_frozen(
        {"model": dict(zip(SPEEDS[knots], held, strict=True))},
        dict(zip(SPEEDS[knots], exact, strict=True)),
        scales=SCALES | dict.fromkeys(map(str, STICKS), STICK_SCALE),
    )
    return Judged(
        kind,
        seed,
        tuple(beside["model"].gap.tolist()),
        tuple(map(phugoid, held)),
        {str(s): v for s, v in model.score(test, SECOND).items()},
        {str(s): v for s, v in constant.score(test, SECOND).items()},
    )


def tables(knots: int, method: str, exact: Sequence[LinearModel], found: Sequence[Judged]) -> str:
    """Gaps, phugoids and what scheduling pays, a line a flight."""
    speeds = [f"{speed:.0f}" for speed in SPEEDS[knots]]
    lines = [f"hover to {knots} kt, {NOISE_DB:g} dB noise, {method}", ""]
    for kind in dict.fromkeys(one.kind for one in found):
        mine = [one for one in found if one.kind is kind]
        worst = max(max(one.gaps) for one in mine)
        rows = [["seed", *(f"{s} m/s" for s in speeds)]]
        rows += [[str(one.seed), *(f"{gap:.2f}" for gap in one.gaps)] for one in mine]
        verdict = "reached" if worst <= MARK else "missed"
        lines += [f"{kind.label}: nu-gap, worst {worst:.2f} (mark {MARK}: {verdict})"]
        lines += [columns(rows, left=1), "  phugoid, 1/s"]
        rows = [["", *(f"{s} m/s" for s in speeds)], ["true", *map(_pole, map(phugoid, exact))]]
        rows += [[str(one.seed), *map(_pole, one.phugoids)] for one in mine]
        lines += [columns(rows, left=1), f"  {_called(exact, mine)}"]
        rows = [["1 s fit, percent", *map(str, STATES)]]
        for label, part in (("moving", "moving"), ("constant", "constant")):
            fits = np.median([list(getattr(one, part).values()) for one in mine], axis=0)
            rows.append([label, *(f"{fit:.0f}" for fit in fits)])
        lines += [columns(rows, left=1), ""]
    return "\n".join(lines)


def _pole(s: complex) -> str:
    return "none" if np.isnan(s.real) else f"{s.real:+.3f}{s.imag:+.2f}j"


def _called(exact: Sequence[LinearModel], found: Sequence[Judged]) -> str:
    """How often stability of the phugoid is called right."""
    right = [
        (phugoid(one).real > 0) == (pole.real > 0)
        for judged in found
        for one, pole in zip(exact, judged.phugoids, strict=True)
    ]
    unstable = [
        pole.real > 0
        for judged in found
        for one, pole in zip(exact, judged.phugoids, strict=True)
        if phugoid(one).real > 0
    ]
    return (
        f"called unstable in {sum(unstable)} of {len(unstable)} places where it is; called right in"
        f" {sum(right)} of {len(right)}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--knots", type=int, nargs="+", choices=tuple(FAST), default=tuple(FAST))
    parser.add_argument("--method", choices=tuple(METHODS), default="filter error")
    arguments = parser.parse_args()
    method = METHODS[arguments.method]
    for knots in arguments.knots:
        exact = truth(SPEEDS[knots])
        found = [
            judge(kind, knots, seed, exact, method) for kind in KINDS for seed in arguments.seeds
        ]
        print(tables(knots, arguments.method, exact, found), flush=True)
