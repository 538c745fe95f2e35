"""How much of the airspeed range the LFT tests can prove, beside a Lyapunov function that varies
with the airspeed.

An LFT test lets the airspeed jump. Shrinking the range until the test succeeds shows what that
assumption costs.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import synthesis
from evidence.tables import DOCS, keep, markdown, parsed
from studies.loops.lateral import lateral_loop
from studies.loops.longitudinal import longitudinal_loop
from studies.output import as_json, columns, progress
from symheli import Helicopter, LPVStateSpace, Scheduling
from synthesis.analysis import LowerBoundSearch, Status

TESTS = ("small gain", "D", "DG")
"""Full blocks are left out: for one parameter they prove what D/G scalings prove, which
`tests/synthesis` checks.
"""

RATE = 3.0
"""Acceleration (m/s^2) at which a varying P(p) is asked for the whole range."""

MIDDLES = (2.0, 4.0, 6.5, 10.0)
"""Airspeeds (m/s) about which a range is grown."""

NARROW = ((0.0, 0.5), (0.0, 1.0), (0.0, 1.5), (5.5, 7.5), (3.0, 10.0))
"""Ranges (m/s) on which the gains are compared."""


class Reach(NamedTuple):
    """The largest range [low, high] m/s found on which `test` succeeds, and the first wider one on
    which it failed.
    """

    test: str
    low: float
    high: float
    failed: tuple[float, float] | None


def on(loop: LPVStateSpace, low: float, high: float) -> LPVStateSpace:
    """The loop on a narrower range (m/s)."""
    s = loop.scheduling
    return loop.with_scheduling(Scheduling(s.name, s.unit, low, high, s.rate))


def proven(loop: LPVStateSpace, test: str) -> bool:
    """Whether this LFT test proves stability of the loop on its whole range."""
    return synthesis.analysis.lft_stability(loop.to_lft().reduce(1e-12), test, search=None).verified


def grows(loop: LPVStateSpace, search: LowerBoundSearch | None = None) -> bool:
    """Whether a jumping airspeed is found along which the state grows: no test can succeed then."""
    return (
        synthesis.stability(
            loop, math.inf, search=search or LowerBoundSearch(seconds=math.inf)
        ).status
        is Status.GROWING
    )


def largest(
    test: str,
    widen: Callable[[float], tuple[float, float]],
    succeeds: Callable[[float, float], bool],
    width: float,
) -> Reach:
    """Bisection over a half-range or upper end in (0, width], to 1 % of it or 0.01 m/s; ranges are
    nested, so it is monotone.
    """
    if succeeds(*widen(width)):
        return Reach(test, *widen(width), None)
    good, bad = 0.0, width
    while bad - good > max(0.01, 0.01 * good):
        trial = 0.5 * (good + bad)
        good, bad = (trial, bad) if succeeds(*widen(trial)) else (good, trial)
    low, high = widen(good)
    return Reach(test, low, high, widen(bad))


def from_hover(loop: LPVStateSpace, test: str) -> Reach:
    """The largest [low end of the loop, V] that this LFT test proves."""
    s = loop.scheduling
    return largest(
        test,
        lambda v: (s.low, s.low + v),
        lambda a, b: proven(on(loop, a, b), test),
        s.high - s.low,
    )


def about(loop: LPVStateSpace, middle: float, test: str) -> Reach:
    """The largest [middle - h, middle + h] that this LFT test proves."""
    s = loop.scheduling
    return largest(
        test,
        lambda h: (middle - h, middle + h),
        lambda a, b: proven(on(loop, a, b), test),
        min(middle - s.low, s.high - middle),
    )


def growing_from_hover(loop: LPVStateSpace, search: LowerBoundSearch | None = None) -> Reach:
    """Where the search stops finding a jumping airspeed in [low end, V] along which the state
    grows: `failed` is the least such range.
    """
    s = loop.scheduling
    return largest(
        "no growth found",
        lambda v: (s.low, s.low + v),
        lambda a, b: not grows(on(loop, a, b), search),
        s.high - s.low,
    )


def gains(loop: LPVStateSpace, low: float, high: float) -> dict[str, Any]:
    """The gain that each test, and P(p) at `RATE`, proves on [low, high] m/s (else its status), and
    the largest frozen one.
    """
    narrow = on(loop, low, high)
    lft = narrow.to_lft().reduce(1e-12)
    varying = synthesis.l2_gain(narrow, RATE, search=LowerBoundSearch(seconds=math.inf))
    certificates: dict[str, Any] = {
        test: synthesis.lft_gain(lft, test, search=None) for test in synthesis.analysis.SCALINGS
    }
    certificates[f"P(p) at {RATE:g} m/s^2"] = varying
    found = {test: c.gamma if c.verified else c.status.name for test, c in certificates.items()}
    return {**found, "lower bound at that rate": varying.lower, "frozen": varying.frozen}


def measure(
    loop: LPVStateSpace,
    middles: tuple[float, ...] = MIDDLES,
    narrow: tuple[tuple[float, float], ...] = NARROW,
) -> Iterator[tuple[str, Any]]:
    """(name, result) of everything the page shows for one loop, as it is found."""
    s = loop.scheduling
    yield "order", {"LFT": loop.to_lft().order, "reduced": loop.to_lft().reduce(1e-12).order}
    for low, high in (*narrow, (s.low, s.high)):
        yield f"gains on [{low:g}, {high:g}] m/s", gains(loop, low, high)
    yield "whole range, jumping airspeed", {"grows": grows(loop)}
    for test in TESTS:
        yield f"from the low end, {test}", from_hover(loop, test)._asdict()
    yield "from the low end, growth", growing_from_hover(loop)._asdict()
    for middle in middles:
        for test in TESTS:
            yield f"about {middle:g} m/s, {test}", about(loop, middle, test)._asdict()


def main() -> None:
    """Print everything, for both loops of the X-Cell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="the lateral loop, grown from hover only"
    )
    parser.add_argument("--json", action="store_true", help="print what a program would read")
    options = parsed(parser, "lft.md")
    heli = Helicopter.load("xcell60", governor="ideal")
    loops = {"lateral": lateral_loop(heli)} | (
        {} if options.quick else {"longitudinal": longitudinal_loop(heli)}
    )
    found: dict[str, dict[str, Any]] = {}
    for name, loop in loops.items():
        found[name] = {}
        for what, result in measure(loop, *(((), ()) if options.quick else (MIDDLES, NARROW))):
            progress(f"{name}: {what}: {_words(result)}")
            found[name][what] = result
    rows = [
        [f"{name}: {what}", _words(result)]
        for name, results in found.items()
        for what, result in results.items()
    ]
    print(as_json(found) if options.json else columns(rows, left=2))
    if options.write:
        keep(
            DOCS / "lft.md",
            "reach",
            "\n\n".join(tables(loop, results) for loop, results in found.items()),
        )


def tables(loop: str, results: dict[str, Any]) -> str:
    """The gains proven of one loop, range by range, and the largest ranges that each test proves
    stable, in Markdown.
    """
    proven_gains = {
        what.removeprefix("gains on "): found
        for what, found in results.items()
        if what.startswith("gains on ")
    }
    reached: dict[str, dict[str, str]] = {}
    for what, found in results.items():
        if "test" in found:
            where, test = what.rsplit(", ", 1)
            reached.setdefault(where, {})[test] = _range(found)
    return "\n\n".join(
        _table(title, rows)
        for title, rows in ((f"{loop}: gain on", proven_gains), (f"{loop}: stable", reached))
        if rows
    )


def _table(title: str, rows: dict[str, dict[str, Any]]) -> str:
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    return markdown(
        [title, *names],
        ([what, *(_word(row.get(name, "")) for name in names)] for what, row in rows.items()),
    )


def _range(found: dict[str, Any]) -> str:
    if found["test"] == "no growth found":
        return f"from {found['failed'][1]:.3g} m/s" if found["failed"] else "none found"
    return f"{found['low']:.3g} - {found['high']:.3g} m/s"


def _words(result: dict[str, Any]) -> str:
    return ", ".join(f"{key} {_word(value)}" for key, value in result.items() if key != "test")


def _word(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{value[0]:.3g}, {value[1]:.3g}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
