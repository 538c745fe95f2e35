"""Conclusions of the study, in short sentences from its numbers: the answer first, its basis after
it; long lists are tables.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from studies.controllers.design_choices import RATE
from studies.controllers.designs import BASELINE, LFT
from studies.controllers.flown import WINDS
from studies.known_kinematics import models
from studies.known_kinematics.robust_loop import PROBABILITY, verdict
from studies.setup.bounds import CONSTANT, LFT_TESTS, proven, rate_text
from studies.transition.controller_tables import hypotheses
from studies.transition.guarantees import ALLOWED, ESTIMATE, gain_curve
from studies.transition.known_kinematics import CUBIC, KNOWN, LOOPS, SPLINE, TWO_INPUTS
from studies.transition.tables import LEVEL, gain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from studies.known_kinematics.rivals import KnownKinematics
    from studies.setup.bounds import Bound
    from studies.transition.outcome import Outcome
    from synthesis.certify.questions.gain_curve import GainCurve

CHEAP = 0.1
"""Share by which a gain that is proven for any rate may exceed the frozen one for the rate to
matter little.
"""

STUDIED = "xcell60"
"""The vehicle of the published model; of another one its own questions come first."""

LOOP_NAMES = {
    "gust": "the lateral loop under attitude hold",
    "longitudinal": "the longitudinal loop under attitude hold",
    "robust": "the lateral loop with a margin",
}
"""By channel."""

GAIN_OF = {
    "gust": "yaw rate and roll (rad/s, rad) by a lateral gust (m/s)",
    "longitudinal": "pitch rate and pitch (rad/s, rad) by gusts (m/s)",
    "robust": "outputs of 0.1 by inputs of 0.01 and 0.02",
}
"""By channel: what the gain of its loop is of."""


def of_its_own(study: Outcome) -> bool:
    """Whether this is another vehicle than the study was made for."""
    return study.vehicle != STUDIED


def question(study: Outcome) -> str:
    """Return the main question of the study and its answer."""
    if of_its_own(study):
        return "Does it hover, where does it trim, is it stable, and can a controller be certified?"
    return (
        "Is an LFT enough for a helicopter between hover and 13 m/s, or must the rate of the"
        " airspeed be bounded (LPV)?"
    )


def answer(study: Outcome) -> str:
    """The answer in a sentence or two; empty where nothing was reached that gives one."""
    if not of_its_own(study):
        return " ".join(_where_lft_is_enough(study))
    look = [] if study.baseline is None else [study.baseline.look.answer]
    return " ".join([*look, *_first_controller(study)])


def of_the_vehicle(study: Outcome) -> list[str]:
    """The helicopter by itself, and a first controller for it."""
    if study.baseline is None:
        return list(_first_controller(study))
    look = study.baseline.look
    first = [] if of_its_own(study) else [look.answer]
    own = [] if of_its_own(study) else list(_first_controller(study))
    return [*first, *look.sentences(), *own]


def _first_controller(study: Outcome) -> Iterator[str]:
    """The LPV controller from the baseline: promised, proven, flown."""
    found = study.controllers
    made = found and next((d for d in found.designs if d.name == BASELINE), None)
    if not made:
        return
    if made.controller is None:
        yield f"A first controller was not found: {made.reason}."
        return
    proofs, flown = study.certified_controllers, study.flown_controllers
    proof = math.inf if proofs is None else proofs.gain(BASELINE)
    proven = (
        f"proven for a gain of {gain(proof)} at up to {RATE:g} m/s^2"
        if math.isfinite(proof)
        else f"not proven{' yet' if proofs is None else ''} (frozen gain {gain(made.frozen)})"
    )
    sentence = f"A first controller of {made.order} states, behind servos and delay at 50 Hz, is"
    flights = (
        [one for wind in WINDS for one in flown.at(wind) if one.name == BASELINE] if (flown) else []
    )
    if not flights:
        yield f"{sentence} {proven}."
        return
    lost, count = sum(one.lost for one in flights), sum(len(one.flights) for one in flights)
    losses = "lost none of" if not lost else f"lost {lost} of"
    yield f"{sentence} {proven} and {losses} {count} flights in turbulence."


def abstract(study: Outcome) -> list[str]:
    """Return the abstract: methods and results."""
    return [*_answer(study), *_models(study), *_flights(study), *_limits(study)]


def conclusions(study: Outcome) -> list[str]:
    """Return recommendations, and their basis."""
    return [
        *_where_lft_is_enough(study),
        *_models(study),
        *_acceleration(study),
        *_recursion(study),
        *certificates(study)[-1:],
        *_controllers(study),
    ]


def loops(study: Outcome) -> dict[str, GainCurve]:
    """Return the proofs of the baseline of each loop, by channel."""
    return {
        channel: gain_curve(study.bounds, "baseline", channel, name)
        for channel, name in LOOP_NAMES.items()
        if any(
            (b.model, b.channel, b.certificate.kind) == ("baseline", channel, "l2 gain")
            for b in study.bounds
        )
    }


def _answer(study: Outcome) -> Iterator[str]:
    """LFT or LPV, loop by loop."""
    for channel, curve in loops(study).items():
        if math.isinf(curve.frozen):
            yield f"In {curve.title} no gain can be proven: it is unstable at an airspeed held."
            continue
        rate, most = curve.fastest
        bounded = (
            f"an LPV certificate proves a gain of {gain(most)} ({GAIN_OF[channel]}) for every"
            f" acceleration up to {rate:g} m/s^2"
            if rate > 0 and math.isfinite(most)
            else ""
        )
        tried = bool(set(curve.jumping) & set(LFT_TESTS))
        least = min(curve.jumping.values(), default=math.inf)
        if tried and math.isfinite(least):
            more = f"{gain(least)} for an airspeed that jumps, {_more(least, curve.frozen)}"
            excess = f"{more} than the frozen {gain(curve.frozen)}"
            if _cheap(curve):
                yield f"In {curve.title} the LFT is enough: its tests prove a gain of {excess}."
            else:
                also = f"; {bounded}" if bounded else ""
                yield f"In {curve.title} the LFT tests prove a gain of {excess}{also}."
        elif tried:
            never = (
                ", and none can: an airspeed that jumps makes the state grow"
                if math.isinf(curve.lower.get(math.inf, 0.0))
                else ""
            )
            sentence = f"In {curve.title} no LFT test proves anything{never}"
            yield (
                f"{sentence}; {bounded} (frozen {gain(curve.frozen)})."
                if bounded
                else (f"{sentence}.")
            )
        elif bounded:
            yield f"In {curve.title} {bounded} (frozen {gain(curve.frozen)})."


def _cheap(curve: GainCurve) -> bool:
    """Whether what is proven for an airspeed that jumps is near the frozen gain."""
    return min(curve.jumping.values()) <= (1 + CHEAP) * curve.frozen


def _more(one: float, other: float) -> str:
    return f"{100 * (one / other - 1):.2g} % more"


def _where_lft_is_enough(study: Outcome) -> Iterator[str]:
    """Yield when to use which model."""
    tried = {c: v for c, v in loops(study).items() if set(v.jumping) & set(LFT_TESTS)}
    if not tried:
        return
    enough, costly, needs = [], [], []
    for curve in tried.values():
        least = min(curve.jumping.values())
        kind = needs if math.isinf(least) else enough if _cheap(curve) else costly
        kind.append(curve.title)
    if enough:
        yield (
            f"Take the LFT for {' and '.join(enough)}: what it proves for any rate is within"
            f" {100 * CHEAP:g} % of the frozen gain, so the rate of the airspeed does not matter."
        )
    if costly:
        yield (
            f"For {' and '.join(costly)} either will do: the LFT proves a gain for any rate, more"
            f" than {100 * CHEAP:g} % above the frozen one."
        )
    if needs:
        yield (
            f"Take an LPV model with a bounded rate for {' and '.join(needs)}: under the LFT's"
            " assumption, an airspeed that may jump, nothing is proven there."
        )


def _models(study: Outcome) -> Iterator[str]:
    """Yield the error of the LFT as a model, and that of identification."""
    found = study.known_kinematics
    if found is None:
        return
    cubic, spline = (found.of(name) for name in (CUBIC, SPLINE[models.ALONE]))
    lost = max(abs(cubic.ahead[y] - spline.ahead[y]) for y in cubic.ahead)
    yield (
        "As a model the LFT loses little by being polynomial: its worst nu-gap with the airspeed"
        f" held is {max(g.max() for g in cubic.gaps.values()):.3f}, and its fits 1 s ahead are"
        f" within {lost:.0f} points of the spline's."
    )
    names = TWO_INPUTS, KNOWN[models.CONSTANT], KNOWN[models.BOTH]
    arx, constant, both = (found.of(name).gaps["lateral"].max() for name in names)
    least = {loop: margin.min() for loop, margin in found.margins.items()}
    hold, margin = (least[name] for name in LOOPS)
    yield (
        f"Identified from {sum(found.flown.values()):.0f} s of noisy flight, the worst lateral"
        f" nu-gap is {arx:.2f} with LPV-ARX, {constant:.2f} with known kinematics and constant"
        f" coefficients (LTI), {both:.3f} with scheduled ones. The attitude hold has a margin of"
        f" {hold:.3f}, the other loop one of {margin:.2f}: {_within(both, hold, margin)}"
    )


def _within(gap: float, hold: float, margin: float) -> str:
    if gap < hold:
        return "the last model is close enough for either."
    if gap < margin:
        return "the last model is close enough for the second, not for the first."
    return "the last model is close enough for neither."


def _flights(study: Outcome) -> Iterator[str]:
    """Yield the ranking of the controllers in flight."""
    found = study.flown_controllers
    if found is None or not found.flown:
        return
    best = [found.ranked(wind)[0] for wind in WINDS if found.ranked(wind)]
    if not best:
        yield "Every controller lost flights in turbulence of every size."
        return
    names = list(dict.fromkeys(one.name for one in best))
    wins = ", ".join(
        f"{name} ({', '.join(f'{one.gust:.1f}' for one in best if one.name == name)} m/s)"
        for name in names
    )
    yield (
        f"Flown {found.seeds} times in gusts of each size, the least median energy ratio was that"
        f" of {wins}."
    )


def _limits(study: Outcome) -> Iterator[str]:
    """Yield the limits of the certificates."""
    if study.flown_controllers is not None and study.flown_controllers.flown:
        yield hypotheses(study.flown_controllers)


def _acceleration(study: Outcome) -> Iterator[str]:
    """Yield the benefit of scheduling on acceleration in prediction."""
    found = study.known_kinematics
    if found is None:
        return
    moving, base, own = (
        _change(found, family[one], family[other])
        for family, one, other in (
            (KNOWN, models.ALONE, models.CONSTANT),
            (SPLINE, models.BOTH, models.ALONE),
            (KNOWN, models.BOTH, models.ALONE),
        )
    )
    yield f"Moving coefficients instead of constant ones change the fit 1 s ahead by {moving}."
    yield (
        f"Acceleration as second parameter changes that of the baseline by {base}; with known"
        f" kinematics by {own}."
    )


def _change(found: KnownKinematics, one: str, other: str) -> str:
    a, b = found.of(one).ahead, found.of(other).ahead
    moved = [y for y in a if abs(a[y] - b[y]) > LEVEL]
    if not moved:
        return f"at most {LEVEL:g} points in any output"
    most = max(a, key=lambda y: abs(a[y] - b[y]))
    return (
        f"more than {LEVEL:g} points in {len(moved)} of {len(a)} outputs, the most by"
        f" {a[most] - b[most]:+z.0f} ({most})"
    )


def _recursion(study: Outcome) -> Iterator[str]:
    found = study.known_kinematics
    if found is not None:
        share = 100 * found.update_time / found.model.dt
        yield (
            f"One recursive update of all coefficients took {1e6 * found.update_time:.2g} us,"
            f" {share:.2g} % of the sample period: recursion is affordable in flight."
        )


def _controllers(study: Outcome) -> Iterator[str]:
    """Yield the benefit of bounded rates in flight, and the proofs of the simulated loops."""
    found, proofs = study.flown_controllers, study.certified_controllers
    if found is None:
        return
    yield from _flights(study)
    pairs = [
        (lft.ratio, lpv.ratio)
        for wind in WINDS
        for lft in found.at(wind)
        for lpv in found.at(wind)
        if (lft.name, lpv.name) == (LFT, BASELINE)
        if not (lft.lost or lpv.lost)
    ]
    if pairs:
        change = [100 * (lpv / lft - 1) for lft, lpv in pairs]
        yield (
            "Designed from the same baseline, LPV flew with an energy ratio"
            f" {min(change):+z.0f} to {max(change):+z.0f} % from the LFT's, over the sizes of the"
            " gusts: in flight the bounded rate decides little."
            if max(map(abs, change)) < 100 * CHEAP
            else "Designed from the same baseline, LPV flew with an energy ratio"
            f" {min(change):+z.0f} to {max(change):+z.0f} % from the LFT's, over the sizes of the"
            " gusts."
        )
    if proofs is not None and proofs.bounds:
        names = list(dict.fromkeys(b.model for b in proofs.bounds))
        held = [name for name in names if math.isfinite(proofs.gain(name))]
        over = [name for name in held if found.exceeded(name, proofs.gain(name)) is not None]
        sentence = f"Gains are proven of {len(held)} of {len(names)} loops that fly"
        yield (
            f"{sentence}; a flight exceeded that of {', '.join(over)}."
            if over
            else (f"{sentence}; no flight exceeded one of them.")
        )
    yield from _limits(study)


def certificates(study: Outcome) -> list[str]:
    """Return the statements of the proofs for the loop with a margin: a sentence for each
    acceleration.
    """
    own = [b for b in study.bounds if b.channel == "robust" and b.certificate.kind == "l2 gain"]
    out = []
    for rate in sorted({b.rate for b in own}):
        statements = list(_statements([b for b in own if b.rate == rate]))
        if statements:
            out.append(f"Loop with a margin, {rate_text(rate)}: {'; '.join(statements)}.")
    return out


def _statements(own: list[Bound]) -> Iterator[str]:
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
        yield f"for the exact models {gain(truth[0])}, and {gain(truth[1])} is attained"
        words = {
            "holds": "holds for the helicopter",
            "fails": "FAILS for the helicopter",
            "undecided": "is neither confirmed nor refuted by the exact models",
            "no certificate": "could not be given",
        }
        if allowed is not None:
            answer = words[verdict(proven(allowed), *truth)]
            yield f"the certificate from the flights {answer}"
        if estimate is not None:
            answer = words[verdict(proven(estimate), *truth)]
            yield f"that of the estimate alone {answer}, and nothing in it could tell"
