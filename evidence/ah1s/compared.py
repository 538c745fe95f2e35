"""The AH-1S identified from noisy flights, beside what it is."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from evidence.ah1s.flight import CalmFlight, Plan, fly, unknown
from evidence.ah1s.simulator import AH1S, LAGS, STATES, STICKS
from evidence.ah1s.trim import GUESS, trim
from evidence.ah1s.truth import SLOWEST, realization
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import Actuators, KinematicARX, Polynomial, compare_frozen, fit
from identification.judge import frozen_stability, structure_bias
from identification.judge.frozen_models import continuous_poles
from identification.methods import FilterError, InstrumentalVariables
from identification.model import KinematicModel
from studies.output import as_json
from studies.setup.axes import ALL
from symheli import LinearModel
from symheli.flight import AirspeedSchedule, Excitation, Servo
from symheli.lpv import BSpline
from symheli.lpv.bases import FunctionSpace
from symheli.records import FlightRecord
from symheli.values.arrays import Array

KNOT = 1852 / 3600
SPEEDS = {
    60: (SLOWEST, 5.0, 10.0, 15.0, 20.0, 25.0, 60 * KNOT),
    100: (SLOWEST, 5.0, 10.0, 15.0, 20.0, 25.0, 60 * KNOT, 38.0, 45.0, 100 * KNOT),
}
"""Where models are compared, m/s by knots."""

FASTEST = {60: 34.0, 100: 52.0}
"""Airspeeds up to which is flown, m/s: a little beyond, so that no model ends where the data do."""

RAMPS = {"slow": (0.4,) * 4, "fast": (0.8, 1.6, 1.6, 0.8)}
"""Accelerations of the four ramps of a flight, m/s^2."""

INNER = (10.0, 20.0, 27.0)
"""Breakpoints of the splines between the ends, m/s."""

AMPLITUDE = {"d_lon": 0.10, "d_lat": 0.15, "d_col": 0.06, "d_ped": 0.10}
BAND = (0.05, 2.5)
"""Excitation, parts of the sticks' travel and Hz."""

METHODS: dict[str, Any] = {
    "filter error": FilterError(CalmFlight()),
    "instruments": InstrumentalVariables(CalmFlight()),
    "least squares": "ls",
}
"""Instruments are the same plan flown without noise."""

NOISE_DB = 30.0
STICK_SCALE = 0.1
"""Part of its travel by which a stick is scaled before a nu-gap is taken."""

MARK = 0.15
"""The largest nu-gap wanted, in the median flight; the worst may have twice as much."""

SECOND = 50
"""Samples of the predictions that are scored: 1 s."""

SLOW, GENTLE = (0.15, 0.6), 0.3
"""Frequencies (rad/s) between which the phugoid lies, and how fast it may grow or decay (1/s)."""


def _as_the_xcell(high: float, constant: bool) -> KinematicARX:
    return KinematicARX(
        tuple(map(str, STICKS)),
        "airspeed_command",
        basis=Polynomial(0 if constant else 3, 0.0, high),
    )


def _known_lags(high: float, constant: bool) -> KinematicARX:
    basis: FunctionSpace = Polynomial(0, 0.0, high)
    if not constant:
        basis = BSpline(3, (0.0, *INNER, high))
    lags = {str(stick): lag(pole) for stick, pole in zip(STICKS, LAGS, strict=True)}
    return KinematicARX(
        tuple(map(str, STICKS)),
        "airspeed_command",
        basis=basis,
        na=1,
        nb=3,
        actuators=Actuators(lags),
    )


STRUCTURES: dict[str, Callable[[float, bool], KinematicARX]] = {
    "as the X-Cell": _as_the_xcell,
    "known lags": _known_lags,
}
"""By name, from the largest airspeed and whether coefficients are constant. The first is that of
the X-Cell, without a change. The second knows what a stranger would be told: the lags of the
controls, and that this rotor has no stabilizer bar, so that one lag of the velocities is enough.
"""


def lag(pole: float) -> Servo:
    """A lag of first order (1/s): a second pole is so fast that it delays by half a millisecond."""
    fast = 2000.0
    together = (pole * fast) ** 0.5
    return Servo(natural_frequency=together, damping=(pole + fast) / (2 * together))


def training(knots: int, ramps: str, seed: int) -> Plan:
    """Hover to the largest airspeed and back, twice."""
    schedule = AirspeedSchedule((FASTEST[knots], 0.0) * 2, RAMPS[ramps], (6.0,) * 4)
    return Plan(schedule, Excitation(AMPLITUDE, band=BAND, seed=seed), NOISE_DB, seed)


def unseen(knots: int, seed: int) -> Plan:
    """Other ramps and another excitation, without noise: what predictions are scored on."""
    high = SPEEDS[knots][-1]
    schedule = AirspeedSchedule((0.8 * high, 0.2 * high, high, 0.0), (1.2,) * 4, (4.0,) * 4)
    return Plan(schedule, Excitation(AMPLITUDE, band=BAND, seed=100 + seed), None, seed)


@functools.cache
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


@dataclass(frozen=True, kw_only=True)
class Judged:
    """One structure fitted to one flight: over the airspeeds nu-gaps, how fast the phugoid grows
    and truly grows (1/s, NaN where there is none); fits 1 s ahead with moving and with constant
    coefficients by output, in percent; how stability is called with its band, and what it is.
    """

    seed: int
    gaps: tuple[float, ...]
    growth: tuple[float, ...]
    true: tuple[float, ...]
    moving: dict[str, float]
    constant: dict[str, float]
    calls: tuple[str, ...]
    stable: tuple[bool, ...]


def of_seed(structure: str, ramps: str, knots: int, method: str, seed: int) -> Judged:
    """Fly, identify, compare."""
    record, test = fly(training(knots, ramps, seed)), fly(unseen(knots, seed))
    speeds, make = SPEEDS[knots], STRUCTURES[structure]
    exact = truth(speeds)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # slow modes and weak instruments are judged here
        model, constant = (
            fit(make(FASTEST[knots], still), record, method=METHODS[method])
            for still in (False, True)
        )
        bias = structure_bias(model, record, CalmFlight(), dict(zip(speeds, exact, strict=True)))
    held = [model.at(speed) for speed in speeds]
    beside = compare_frozen(
        {"model": dict(zip(speeds, held, strict=True))},
        dict(zip(speeds, exact, strict=True)),
        scales=ALL.sizes | dict.fromkeys(map(str, STICKS), STICK_SCALE),
    )
    return Judged(
        seed=seed,
        gaps=tuple(beside["model"].gap.tolist()),
        growth=tuple(phugoid(one).real for one in held),
        true=tuple(phugoid(one).real for one in exact),
        moving=_fits(model, test),
        constant=_fits(constant, test),
        calls=frozen_stability(model, speeds, bias=bias).calls,
        stable=tuple(one.is_stable() for one in exact),
    )


def _fits(model: KinematicModel, test: FlightRecord) -> dict[str, float]:
    return {str(s): v for s, v in model.score(test, SECOND).items()}


def tables(knots: int, found: Sequence[Judged]) -> str:
    """Nu-gaps and phugoids by airspeed, and what scheduling pays by output, in Markdown."""
    gaps = np.array([one.gaps for one in found])
    true, growth = (np.array([getattr(one, name) for one in found]) for name in ("true", "growth"))
    worst = gaps.max(axis=1)
    reached = np.median(worst) <= MARK and worst.max() <= 2 * MARK
    right, unstable = _called(found)
    by_airspeed = [
        ["nu-gap, median", *(f"{g:.2f}" for g in np.median(gaps, axis=0))],
        ["nu-gap, worst", *(f"{g:.2f}" for g in gaps.max(axis=0))],
        ["phugoid, 1/s", *map(_rate, true.T)],
        ["identified, median", *map(_rate, growth.T)],
    ]
    by_output = [
        [label, *(f"{fit:.0f}" for fit in np.median(fits, axis=0))]
        for label, fits in (
            ("moving coefficients", [list(one.moving.values()) for one in found]),
            ("constant coefficients", [list(one.constant.values()) for one in found]),
        )
    ]
    return "\n\n".join(
        [
            f"Worst nu-gap of a flight over the airspeeds: median {np.median(worst):.2f} (mark"
            f" {MARK}), worst {worst.max():.2f} (seed {found[int(worst.argmax())].seed}):"
            f" {'met' if reached else 'MISSED'}. The phugoid is called unstable in {unstable}"
            f" places where it is, and called right in {right}. {_with_bands(found)}",
            markdown(["m/s", *(f"{speed:.0f}" for speed in SPEEDS[knots])], by_airspeed),
            markdown(["fits 1 s ahead, %", *map(str, STATES)], by_output),
        ]
    )


def _rate(rates: Array) -> str:
    """The median of those there are."""
    found = rates[np.isfinite(rates)]
    return f"{np.median(found):+.3f}" if len(found) else "none"


def _called(found: Sequence[Judged]) -> tuple[str, str]:
    """How often stability of the phugoid is called right, and called unstable where it is."""
    pairs = [
        (true > 0, growth > 0)
        for one in found
        for true, growth in zip(one.true, one.growth, strict=True)
    ]
    unstable = [called for is_so, called in pairs if is_so]
    right = sum(is_so == called for is_so, called in pairs)
    return f"{right} of {len(pairs)}", f"{sum(unstable)} of {len(unstable)}"


def _with_bands(found: Sequence[Judged]) -> str:
    """How often stability is called rightly, wrongly and not known with its band."""
    names = {True: "stable", False: "unstable"}
    pairs = [
        (call, names[is_so])
        for one in found
        for call, is_so in zip(one.calls, one.stable, strict=True)
    ]
    unknown = sum(call == "not known" for call, _ in pairs)
    right = sum(call == true for call, true in pairs)
    return (
        f"With the bands of `frozen_stability`, the bias of the structure in them, it is right in"
        f" {right} places, wrong in {len(pairs) - right - unknown}, not known in {unknown} of"
        f" {len(pairs)}."
    )


def main() -> None:
    """Print the tables of one structure and kind of flight, and keep them."""
    parser = parser_of(__doc__, "11-13")
    parser.add_argument("--structure", choices=tuple(STRUCTURES), default="known lags")
    parser.add_argument("--ramps", choices=tuple(RAMPS), default="slow")
    parser.add_argument("--knots", type=int, choices=tuple(SPEEDS), default=60)
    parser.add_argument("--method", choices=tuple(METHODS), default="filter error")
    options = parsed(parser, "identified.md", timed=False)
    structure, ramps, knots, method = (
        getattr(options, name) for name in ("structure", "ramps", "knots", "method")
    )
    calls = [partial(of_seed, structure, ramps, knots, method, s) for s in seeds_of(options)]
    found = list(over_seeds(options, calls))
    text = tables(knots, found)
    print(as_json([vars(one) for one in found]) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", f"AH-1S {structure} {ramps} {knots} kt", text)
