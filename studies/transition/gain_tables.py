"""Gains of the closed loops against permitted acceleration as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from studies.setup.bounds import FORMS, SIZES, Bound, proven, rate_text
from studies.transition.tables import Table, gain
from synthesis.analysis import Status

CHANNELS = {
    "gust": (
        "Lateral gust (m/s) to yaw rate and roll (rad/s, rad) under attitude hold, continuous time"
    ),
    "longitudinal": (
        "Longitudinal and vertical gusts (m/s) to pitch rate and pitch (rad/s, rad) under attitude"
        " hold, continuous time"
    ),
    "servo": (
        "Disturbances at roll cyclic ({d_lat} rad) and pedal ({d_ped} rad) to yaw rate ({r} rad/s)"
        " and roll ({phi} rad), 50 Hz".format(**SIZES)
    ),
    "robust": (
        "The same disturbances and outputs in the loop with a margin (sideways velocity and roll to"
        " roll cyclic, yaw rate to pedal), 50 Hz"
    ),
}


def guarantee(found: Sequence[Bound], channel: str) -> Table:
    """Gain against permitted acceleration: attained, and proven by each form; tests that let the
    airspeed jump hold at every acceleration.
    """
    own = [b for b in found if b.channel == channel]
    gains = [b for b in own if b.certificate.kind == "l2 gain"]
    forms = [form for form in FORMS if any(b.form == form for b in gains)]
    table = Table(
        CHANNELS[channel],
        ["model", "acceleration", "stable", "frozen", "attained", *forms],
        name=f"gain-{channel}",
        source="guarantees.bounds",
    )
    for model in dict.fromkeys(b.model for b in gains):
        jumping = {b.form: b for b in gains if b.model == model and math.isinf(b.rate)}
        for rate in sorted({b.rate for b in gains if b.model == model}):
            here = {**jumping, **{b.form: b for b in gains if (b.model, b.rate) == (model, rate)}}
            now = [b for b in own if (b.model, b.rate) == (model, rate)]
            attained = max(b.certificate.lower for b in now if b.certificate.kind == "l2 gain")
            frozen = next(iter(here.values())).certificate.frozen
            cells = [gain(proven(here[form])) if form in here else "" for form in forms]
            table.rows.append(
                [
                    model,
                    rate_text(rate),
                    _stable(now, jumping),
                    "unstable" if math.isinf(frozen) else gain(frozen),
                    "grows" if math.isinf(attained) else gain(attained),
                    *cells,
                ]
            )
    table.remarks.append(
        "Attained: the gain of a computed airspeed history, no bound can be smaller; none: nothing"
        " proven; blank: not tried."
    )
    return table


def not_about_the_helicopter(found: Sequence[Bound]) -> list[str]:
    """Gains proven of an interpolated or identified model that a computed airspeed history of the
    exact models exceeds, a sentence each.
    """
    gains = [b for b in found if b.certificate.kind == "l2 gain"]
    out = []
    for exact in (b for b in gains if b.model == "exact"):
        others = [
            b
            for b in gains
            if b.model != "exact" and (b.channel, b.rate) == (exact.channel, exact.rate)
        ]
        attained = exact.certificate.lower
        for model in dict.fromkeys(b.model for b in others):
            least = min(proven(b) for b in others if b.model == model)
            if least < attained and gain(least) != gain(
                attained
            ):  # what no digit shown tells apart says nothing either way
                who = (
                    "the exact models, frozen,"
                    if exact.rate == 0
                    else "computed airspeed histories of the exact models"
                )
                reached = (
                    "make their state grow" if math.isinf(attained) else f"reach {gain(attained)}"
                )
                out.append(
                    f"{exact.channel.capitalize()} channel, {rate_text(exact.rate)}: {gain(least)}"
                    f" is proven of the {model} model, and {who} {reached}: that proof says nothing"
                    " of the helicopter."
                )
    return out


def every(found: Sequence[Bound]) -> list[Table]:
    """One table a channel that has bounds."""
    return [
        guarantee(found, channel)
        for channel in CHANNELS
        if any(b.channel == channel for b in found)
    ]


def _stable(now: list[Bound], jumping: dict[str, Bound]) -> str:
    statuses = {b.certificate.status for b in now}
    if Status.UNSTABLE in statuses:
        return "no, even frozen"
    if any(math.isinf(b.certificate.lower) for b in now):
        return "no, it grows"
    return (
        "proven" if any(b.certificate.verified for b in (*now, *jumping.values())) else "not proven"
    )
