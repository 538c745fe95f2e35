"""The lateral loop closed from both sides: gain and stability against permitted acceleration,
proven above, and the gain of computed trajectories below.

P(p) is the ordinary proof; P(p, lag) remembers where the airspeed came from; the lower bound is an
explicit airspeed and gust. Of the interpolated model, of the exact one, or, on the servo channel,
of the identified models beside both.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import synthesis
from evidence.bracket.servo import curves_of, found_of, measure_servo, text_of
from evidence.bracket.table import bracket_table
from evidence.figures import save
from evidence.tables import DOCS, keep, parsed
from studies.loops.exact_lateral import ExactLateral
from studies.loops.lateral import lateral_loop
from studies.output import as_json, columns, progress
from symheli import Helicopter, LPVStateSpace, UncertainStateSpace
from symheli.lpv.bases import Polynomial
from symheli.values.arrays import Array
from synthesis.analysis import LowerBoundSearch
from synthesis.certify.questions.gain_curve import GainCurve
from synthesis.certify.statement.forms import LyapunovForm
from synthesis.forms import HigherOrder, LaggedParameter, Spline

SLOW = LaggedParameter(1.2, segments=12, grading=1.5, across_segments=4, across_degree=2)
FAST = LaggedParameter(0.6, segments=12, grading=1.5, across_segments=4, across_degree=3)
FASTEST = LaggedParameter(0.5, segments=12, grading=1.5, across_segments=6, across_degree=3)
FURTHEST = LaggedParameter(0.45, segments=12, grading=1.5, across_segments=8, across_degree=3)
"""The faster the airspeed turns round, the shorter the lag that tells most, and the finer P has to
be across.
"""

GAINS = {
    0.01: SLOW,
    0.1: SLOW,
    0.3: SLOW,
    1.0: SLOW,
    2.0: FAST,
    3.0: FAST,
    3.5: FAST,
    4.0: FAST,
    4.5: FAST,
    5.0: FAST,
    6.0: FASTEST,
}
"""Accelerations (m/s^2) at which gains are bracketed, and the memory that proves them."""

FEWER = {rate: GAINS[rate] for rate in (0.1, 1.0, 3.0, 4.5, 6.0)}
"""Those of the exact model."""

STABLE = {
    "P(p)": (Spline(), (4.5, 5.0)),
    "V of degree four": (HigherOrder(2, segments=4), (6.0, 6.5)),
    "P(p, lag)": (FURTHEST, (7.1, 7.2)),
}
"""Forms of V, and accelerations (m/s^2) at which each is tried: the second is beyond it."""

STABLE_EXACT = {"P(p)": (Spline(), (4.0, 4.5)), "P(p, lag)": (FURTHEST, (6.5, 7.0))}
"""The same for the exact model."""

GROWING = (7.5, 7.52, 7.54, 7.6)
"""Accelerations (m/s^2) at which growth is looked for."""

COVER = Spline(segments=16)
"""The P(p) that covers a remainder; on 32 segments the solver fails where it matters."""


class Bracket(NamedTuple):
    """Gains at one acceleration (m/s^2): of a computed trajectory (no bound is smaller), proven
    with a memory, proven with P(p); inf: nothing proven, or growth.

    `covered`: proven with P(p) for every model within the remainder; NaN: there is none.
    """

    rate: float
    lower: float
    memory: float
    plain: float
    exact: bool
    covered: float = math.nan

    @property
    def gap(self) -> float:
        """Best proven gain over the one of a computed trajectory."""
        return min(self.memory, self.plain) / self.lower


def bracket(
    loop: LPVStateSpace,
    rate: float,
    form: LyapunovForm,
    search: LowerBoundSearch | None = None,
    missed: Array | None = None,
) -> Bracket:
    """The gain at one acceleration from both sides; `exact`: the better proof, and that of the
    cover, pass rational arithmetic.
    """
    plain = synthesis.l2_gain(loop, rate, search=None)
    memory = synthesis.l2_gain(
        loop,
        rate,
        form=form,
        search=search or LowerBoundSearch(seconds=math.inf),
        solver="CLARABEL",
    )
    better = min(plain, memory, key=lambda c: c.gamma)
    covered, proof = math.nan, None
    if missed is not None and plain.verified:
        around = UncertainStateSpace.covering(loop, missed)
        proof = synthesis.l2_gain(around, rate, form=COVER, search=None)
        covered = proof.gamma
    exact = better.verify(rigorous=True) and (
        proof is None or math.isinf(covered) or proof.verify(rigorous=True)
    )
    return Bracket(rate, memory.lower, memory.gamma, plain.gamma, exact, covered)


def proves(loop: LPVStateSpace, rate: float, form: LyapunovForm) -> bool:
    """Whether this form of V proves stability at this acceleration, in exact arithmetic."""
    return synthesis.stability(loop, rate, form=form, search=None, solver="CLARABEL").verify(
        rigorous=True
    )


def measure(
    loop: LPVStateSpace,
    gains: Mapping[float, LyapunovForm],
    stable: dict[str, Any],
    missed: Array | None = None,
) -> Iterator[tuple[str, Any]]:
    """(what, result) of everything the page shows, as it is found."""
    yield "gain, frozen", synthesis.frozen_gain(loop).gain
    jump = synthesis.l2_gain(loop, math.inf)
    tests = {"constant P": jump.gamma}
    if isinstance(loop.basis, Polynomial):
        lft = loop.to_lft().reduce(1e-12)
        tests |= {
            f"LFT {name}": synthesis.lft_gain(lft, name, search=None).gamma
            for name in synthesis.analysis.SCALINGS
        }
    yield "airspeed jumps", {"lower": jump.lower, **tests}
    for rate in GROWING:
        found = synthesis.lower_bound(loop, rate)
        yield f"growth at {rate:g} m/s^2", found.growth if math.isinf(found.gain) else "none found"
    for rate, form in gains.items():
        found = bracket(loop, rate, form, missed=missed)
        yield f"gain at {rate:g} m/s^2", {**found._asdict(), "gap": found.gap}
    for name, (form, rates) in stable.items():
        for rate in rates:
            yield f"stable at {rate:g} m/s^2 by {name}", proves(loop, rate, form)


def curve(found: dict[str, Any], title: str) -> GainCurve:
    """What was found as a curve."""
    rows = [row for what, row in found.items() if what.startswith("gain at")]
    lower = {row["rate"]: row["lower"] for row in rows}
    for rate in GROWING:
        if isinstance(found.get(f"growth at {rate:g} m/s^2"), float):
            lower[rate] = math.inf
    tests = dict(found["airspeed jumps"])
    lower |= {0.0: found["gain, frozen"], math.inf: tests.pop("lower")}
    proven = {
        form: {row["rate"]: row[key] for row in rows}
        for form, key in (("P(p, lag)", "memory"), ("P(p)", "plain"))
    }
    return GainCurve(title, "(rad/s, rad)/(m/s)", found["gain, frozen"], lower, proven, tests)


def main() -> None:
    """Print the bracket of the X-Cell's lateral loop."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--model", choices=("interpolated", "exact", "identified"), default="interpolated"
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="growth, the gain at 3 m/s^2 and P(p) only; identified: fewer accelerations",
    )
    parser.add_argument("--json", action="store_true", help="print what a program would read")
    parser.add_argument(
        "--figure", type=Path, metavar="FILE", help="draw gain against acceleration"
    )
    options = parsed(parser, "gains.md")
    heli = Helicopter.load("xcell60", governor="ideal")
    if options.model == "identified":
        bounds = measure_servo(heli, options.quick)
        found, text, curves = found_of(bounds), text_of(bounds), curves_of(bounds)
        table = f"```text\n{text}\n```"
    else:
        found = _measured(heli, exact=options.model == "exact", quick=options.quick)
        text = columns([[what, _words(result)] for what, result in found.items()], left=2)
        table = bracket_table(found)
        curves = [curve(found, f"Lateral: gust to yaw rate and roll, {options.model} model")]
    print(as_json(found) if options.json else text)
    if options.write:
        keep(DOCS / "gains.md", options.model, table)
    if options.figure:
        save([one.plot for one in curves], options.figure)


def _measured(heli: Helicopter, *, exact: bool, quick: bool) -> dict[str, Any]:
    """Everything about the gust loop of the exact or the interpolated model, with progress."""
    found: dict[str, Any] = {}
    gains, stable, missed = (FEWER, STABLE_EXACT, None) if exact else (GAINS, STABLE, None)
    if exact:
        models = ExactLateral.of(heli)
        loop = models.loop()
        missed = models.missed(loop)
        found["largest entry missed, SI"] = float(np.abs(missed).max())
    else:
        loop = lateral_loop(heli)
    if quick:
        gains, stable = {3.0: GAINS[3.0]}, {"P(p)": stable["P(p)"]}
    for what, result in measure(loop, gains, stable, missed):
        progress(f"{what}: {_words(result)}")
        found[what] = result
    return found


def _words(result: Any) -> str:
    if isinstance(result, dict):
        return ", ".join(f"{key} {_words(value)}" for key, value in result.items() if key != "rate")
    return f"{result:.6g}" if isinstance(result, float) else str(result)
