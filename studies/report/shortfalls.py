"""What failed in a run of the study, and why: one table, with where results.json has it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from studies.controllers.flown import WINDS
from studies.transition.axes import AXES
from studies.transition.campaign import MODE_MARK
from studies.transition.flights import NOISES
from studies.transition.gain_tables import not_about_the_helicopter
from studies.transition.guarantees import rate_text
from studies.transition.tables import Table, diverges, percent
from synthesis import Status

if TYPE_CHECKING:
    from studies.transition.guarantees import Bound
    from studies.transition.outcome import Outcome

Row = tuple[str, str, str]
"""What, why, path in results.json."""


def shortfalls(study: Outcome) -> Table:
    """A row each; none where nothing failed."""
    found = [
        *_models(study),
        *_marks(study),
        *_predictions(study),
        *_proofs(study),
        *_controllers(study),
    ]
    return Table(
        "What failed, and why",
        ["what", "why", "results.json"],
        [list(row) for row in found],
        name="shortfalls",
    )


def _models(study: Outcome) -> Iterator[Row]:
    if study.baseline is not None and (unfit := study.baseline.unfit):
        names = ", ".join(e.name for e in unfit[:4])
        yield (
            f"No polynomial up to degree 6 fits {len(unfit)} entries of A(p), B(p) within 10 % of"
            f" their range, worst {names}.",
            "They jump where the model has a corner (a limit of the tail, the edge of the wake);"
            " the spline and the exact models are kept beside the polynomial.",
            "baseline.entries_no_polynomial_fits",
        )
    refused: dict[str, list[str]] = {}
    for run in study.paper_experiment.runs if study.paper_experiment else ():
        refused.setdefault(run.cubic_refused, []).append(run.loop)
    for why, which in refused.items():
        yield (
            f"A cubic basis is refused in the published experiment, {' and '.join(which)} loop.",
            f"{why[:1].upper()}{why[1:]}.",
            "paper_experiment",
        )


def _marks(study: Outcome) -> Iterator[Row]:
    if (found := study.identification) is None:
        return
    for axis in AXES:
        for k, noise in enumerate(NOISES):
            one = found.of(axis, noise)
            missed = [
                f"{y} ({percent(one.scores.ahead[y])} %, wanted {mark[k]:.0f})"
                for y, mark in axis.marks.items()
                if not one.scores.ahead[y] >= mark[k]
            ]
            if missed:
                yield (
                    f"Marks missed 1 s ahead, {axis.name}, {noise}: {', '.join(missed)}.",
                    "One flight, one seed; symheli campaign tells the median of many.",
                    "identification.models",
                )
        worst = max(found.of(axis, NOISES[0]).mode_miss.values())
        if not worst <= MODE_MARK:
            yield (
                f"The frozen rotor mode, {axis.name}, is missed by {worst:.1f} %, wanted"
                f" {MODE_MARK:g}.",
                "Noise-free: the structure has too few lags for it.",
                "identification.models",
            )


def _predictions(study: Outcome) -> Iterator[Row]:
    for one in study.comparison.predictions if study.comparison else ():
        lost: dict[str, list[str]] = {}
        for p in one.found.predictions:
            for y in one.axis.outputs:
                if diverges(p.scores.free_run[y]) or p.scores.free_run[y] < 0:
                    lost.setdefault(p.name, []).append(y)
        if lost:
            each = "; ".join(f"{name}: {', '.join(ys)}" for name, ys in lost.items())
            yield (
                f"In free run worse than the mean of the flight, {one.axis.name}, {one.noise}:"
                f" {each}.",
                "Slow modes with hardly any damping turn a small error of a pole into a drift.",
                "comparison.predictions",
            )


def _proofs(study: Outcome) -> Iterator[Row]:
    proofs = study.certified_controllers.bounds if study.certified_controllers else ()
    for path, bounds in (("guarantees.bounds", study.bounds), ("controllers.bounds", proofs)):
        failed: dict[tuple[str, str, str], list[Bound]] = {}
        for b in bounds:
            if b.certificate.kind == "l2 gain" and not b.certificate.verified:
                failed.setdefault((b.channel, b.model, _why(b, bounds)), []).append(b)
        for (channel, model, why), some in failed.items():
            tests = ", ".join(f"{b.form} ({rate_text(b.rate)})" for b in some)
            yield f"No gain proven, {channel} channel, {model}: {tests}.", why, path
    for sentence in not_about_the_helicopter(study.bounds):
        why = "The model differs from the helicopter by more than this loop's margin."
        yield sentence, why, "guarantees.bounds"


def _why(b: Bound, bounds: Sequence[Bound]) -> str:
    """By what any search among the same airspeeds has found."""
    c, same = b.certificate, (b.channel, b.model, b.rate)
    attained = max(o.certificate.lower for o in bounds if (o.channel, o.model, o.rate) == same)
    if c.status is Status.UNSTABLE or math.isinf(c.frozen):
        return "The loop is unstable at an airspeed held."
    if math.isinf(attained):
        return "A computed airspeed history makes the state grow: there is nothing to prove."
    if math.isinf(b.rate):
        return "Conservative: an airspeed that jumps is allowed."
    return f"{str(c.status.value).capitalize()}."


def _controllers(study: Outcome) -> Iterator[Row]:
    for design in study.controllers.designs if study.controllers else ():
        if design.controller is None:
            yield f"No controller: {design.name}.", f"{design.reason}.", "controllers.designs"
    if (found := study.flown_controllers) is None:
        return
    for wind in WINDS:
        for one in found.at(wind):
            if one.lost:
                yield (
                    f"{one.name} lost {one.lost} of {found.seeds} flights in gusts of"
                    f" {one.gust:.1f} m/s.",
                    "The gusts took it outside what its model and its travel allow.",
                    "controllers.flights",
                )
