"""What the study says, in sentences: where scheduling pays, what recursion costs, what the LFT
loses, what a certificate from flights is worth, which controller flies best.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from studies.controllers.tables import conclusions as flown
from studies.marks import models
from studies.marks.guarantee import PROBABILITY, verdict
from studies.transition.guarantees import ALLOWED, CONSTANT, ESTIMATE, LFT_TESTS, proven, rate_text
from studies.transition.known_kinematics import CUBIC, KNOWN, LOOPS, SPLINE, TWO_INPUTS
from studies.transition.tables import gain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from studies.transition.guarantees import Bound
    from studies.transition.known_kinematics import KnownKinematics, Rival
    from studies.transition.outcome import Outcome

LEVEL = 3.0
"""Points between fits that are called level: what another seed changes."""


def conclusions(study: Outcome) -> list[str]:
    """One sentence or two each, of what the study has reached."""
    out: list[str] = []
    if (found := study.known_kinematics) is not None:
        out += [_scheduling(found), _acceleration(found), _feedback(found), _recursion(found)]
    return [*out, *_lft(study), *certificates(study), *flown(study)]


def certificates(study: Outcome) -> list[str]:
    """What the proofs for the loop with a margin are about: a sentence for each acceleration."""
    own = [b for b in study.bounds if b.channel == "robust" and b.certificate.kind == "l2 gain"]
    out = []
    for rate in sorted({b.rate for b in own}):
        told = list(_told([b for b in own if b.rate == rate]))
        if told:
            out.append(f"Loop with a margin, {rate_text(rate)}: {'; '.join(told)}.")
    return out


def _told(own: list[Bound]) -> Iterator[str]:
    by_model = {b.model: b for b in own if b.form not in (CONSTANT, *LFT_TESTS)}
    exact, allowed, estimate = (by_model.get(name) for name in ("exact", ALLOWED, ESTIMATE))
    if allowed is not None:
        yield (
            f"for every model that the flights allow ({100 * PROBABILITY:g} %) a gain of"
            f" {gain(proven(allowed))} is proven"
        )
    if estimate is not None:
        yield f"for the estimate alone {gain(proven(estimate))}"
    if exact is not None:
        truth = proven(exact), exact.certificate.lower
        yield f"for the exact models {gain(truth[0])}, and {gain(truth[1])} is flown"
        words = {
            "holds": "holds for the helicopter",
            "fails": "FAILS for the helicopter",
            "undecided": "is neither confirmed nor refuted by the exact models",
            "no certificate": "could not be given",
        }
        if allowed is not None:
            said = words[verdict(proven(allowed), *truth)]
            yield f"the certificate from the flights {said}"
        if estimate is not None:
            said = words[verdict(proven(estimate), *truth)]
            yield f"that of the estimate alone {said}, and nothing in it could tell"


def _scheduling(found: KnownKinematics) -> str:
    constant, alone = (found.of(KNOWN[kind]) for kind in (models.CONSTANT, models.ALONE))
    return (
        "Where scheduling pays: moving coefficients instead of constant ones change the 1 s fit of"
        f" this helicopter by {_differences(alone, constant)}. Where the rotor has no stabilizer"
        " bar it is tens of points in nearly every output (AH-1S: docs/ah1s.md, python -m"
        " studies.ah1s --knots 60; not run here)."
    )


def _acceleration(found: KnownKinematics) -> str:
    base = _differences(found.of(SPLINE[models.BOTH]), found.of(SPLINE[models.ALONE]))
    own = _differences(found.of(KNOWN[models.BOTH]), found.of(KNOWN[models.ALONE]))
    return (
        f"Acceleration as second parameter changes the baseline's 1 s fit by {base}. With known"
        f" kinematics and the rate of the airspeed in the trim it changes the fit by {own}."
    )


def _feedback(found: KnownKinematics) -> str:
    names = TWO_INPUTS, KNOWN[models.CONSTANT], KNOWN[models.BOTH]
    arx, constant, both = (found.of(name).gaps["lateral"].max() for name in names)
    least = {loop: margin.min() for loop, margin in found.margins.items()}
    hold, margin = (least[name] for name in LOOPS)
    return (
        "For feedback prediction is no measure: the worst lateral nu-gap is"
        f" {arx:.2f} with LPV-ARX, {constant:.2f} with known kinematics and constant coefficients,"
        f" {both:.3f} with two parameters. The attitude hold has a stability margin of"
        f" {hold:.3f} and the other loop one of {margin:.2f}: {_within(both, hold, margin)}"
    )


def _within(gap: float, hold: float, margin: float) -> str:
    if gap < hold:
        return "the model is close enough for either."
    if gap < margin:
        return "the model is close enough for the second, not for the first."
    return "the model is close enough for neither."


def _recursion(found: KnownKinematics) -> str:
    share = 100 * found.update_time / found.model.dt
    return (
        "What the recursion costs: one update of all coefficients with known kinematics took"
        f" {1e6 * found.update_time:.2g} us of processor time, {share:.2g} % of the sample period."
        " It is least squares; what noise in the loop does to these only the batch methods undo."
    )


def _lft(study: Outcome) -> Iterator[str]:
    found = study.known_kinematics
    if found is not None:
        cubic, spline = (found.of(name) for name in (CUBIC, SPLINE[models.ALONE]))
        yield (
            "What the LFT loses by being polynomial is little: its worst nu-gap with the airspeed"
            f" held is {max(g.max() for g in cubic.gaps.values()):.3f}, and its 1 s fits are within"
            f" {max(abs(cubic.ahead[y] - spline.ahead[y]) for y in cubic.ahead):.0f} points of the"
            " spline's."
        )
    for channel, loop in (
        ("gust", "gusts under the attitude hold"),
        ("robust", "the loop with a margin"),
    ):
        own = [b for b in study.bounds if (b.channel, b.model) == (channel, "baseline")]
        tests = [proven(b) for b in own if b.form in LFT_TESTS]
        slow = [b for b in own if 0 < b.rate < math.inf and b.certificate.verified]
        if tests and slow:
            last = max(slow, key=lambda b: (b.rate, -b.certificate.gamma))
            least = min(tests)
            yield (
                f"What it loses by letting the airspeed jump, {loop}: its tests prove"
                f" {'nothing' if math.isinf(least) else 'a gain of ' + gain(least)}, where"
                f" {gain(last.certificate.gamma)} is proven up to {rate_text(last.rate)}."
            )


def _differences(one: Rival, other: Rival) -> str:
    """ "+21 (v), -4 (r) points, by at most 3 for u, p"."""
    change = {y: one.ahead[y] - other.ahead[y] for y in one.ahead}
    ranked = sorted(change, key=lambda y: -abs(change[y]))
    moved = [f"{change[y]:+.0f} ({y})" for y in ranked if abs(change[y]) > LEVEL]
    level = [y for y in change if abs(change[y]) <= LEVEL]
    parts = [f"{', '.join(moved)} points"] if moved else []
    parts += [f"at most {LEVEL:g} points for {', '.join(level)}"] if level else []
    return ", by ".join(parts)
