"""Negative results of a run of the study, and failed computations: two tables, each row with its
reason and its place in results.json.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from studies.controllers.flown import WINDS
from studies.setup.axes import AXES
from studies.setup.bounds import rate_text
from studies.setup.flights import NOISES
from studies.transition.campaign import MODE_MARK
from studies.transition.gain_tables import not_about_the_helicopter
from studies.transition.tables import Table, diverges, percent
from synthesis.analysis import Status

if TYPE_CHECKING:
    from studies.setup.bounds import Bound
    from studies.transition.outcome import Outcome

NEGATIVE = (
    "A negative result is an answer, not an error: something was tried and does not hold, for the"
    " reason that is given."
)
FAILED = (
    "A failed computation gave no answer: a solver broke off, or its result did not pass a check."
)

KINDS = {
    "model": "entries or bases that no model of this form fits",
    "target": "targets missed",
    "prediction": "free runs worse than the mean of the flight",
    "certificate": "gains without a certificate",
    "controller": "controllers not found",
    "flight": "controllers that lost flights",
}
"""Kinds of negative results, as they are counted."""


class Finding(NamedTuple):
    """A finding, its reason, its path in results.json, and its kind among `KINDS`; `failed` where
    the computation broke off without a result.
    """

    what: str
    why: str
    path: str
    kind: str
    failed: bool = False


def shortfalls(study: Outcome) -> list[Finding]:
    """Return all negative results, and all failures."""
    return [
        *_models(study),
        *_marks(study),
        *_predictions(study),
        *_proofs(study),
        *_controllers(study),
    ]


def negative_results(study: Outcome) -> Table:
    """A row each."""
    rows = [row for row in shortfalls(study) if not row.failed]
    return _table("Negative results, and why", rows, "shortfalls")


def failures(study: Outcome) -> Table:
    """A row each; none where nothing broke off."""
    rows = [row for row in shortfalls(study) if row.failed]
    return _table("What failed, and why", rows, "failures")


def counted(study: Outcome) -> list[str]:
    """Return the number of negative results, by kind, and the failures, in sentences."""
    found = shortfalls(study)
    kinds = Counter(row.kind for row in found if not row.failed)
    out = []
    if kinds:
        each = ", ".join(f"{KINDS[kind]}: {number}" for kind, number in kinds.items())
        number = sum(kinds.values())
        out.append(f"{number} negative result{'s' if number > 1 else ''} ({each}). {NEGATIVE}")
    failed = [row for row in found if row.failed]
    out += [f"Failed: {row.what} {row.why}" for row in failed]
    out.append(FAILED if failed else "No computation failed.")
    return out


def _table(title: str, rows: Sequence[Finding], name: str) -> Table:
    columns = ["what", "why", "results.json"]
    return Table(title, columns, [[row.what, row.why, row.path] for row in rows], name=name)


def _models(study: Outcome) -> Iterator[Finding]:
    if study.baseline is not None and (unfit := study.baseline.unfit):
        names = ", ".join(e.name for e in unfit[:4])
        yield Finding(
            f"No polynomial up to degree 6 fits {len(unfit)} entries of A(p), B(p) within 10 % of"
            f" their range, worst {names}.",
            "They jump where the model has a corner (a limit of the tail, the edge of the wake);"
            " the spline and the exact models are kept beside the polynomial.",
            "baseline.entries_no_polynomial_fits",
            "model",
        )
    refused: dict[str, list[str]] = {}
    for run in study.paper_experiment.runs if study.paper_experiment else ():
        refused.setdefault(run.cubic_refused, []).append(run.loop)
    for why, which in refused.items():
        yield Finding(
            f"A cubic basis is refused in the published experiment, {' and '.join(which)} loop.",
            f"{why[:1].upper()}{why[1:]}.",
            "paper_experiment",
            "model",
        )


def _marks(study: Outcome) -> Iterator[Finding]:
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
                yield Finding(
                    f"Targets missed 1 s ahead, {axis.name}, {noise}: {', '.join(missed)}.",
                    "One flight, one seed; symheli campaign gives the median of many.",
                    "identification.models",
                    "target",
                )
        worst = max(found.of(axis, NOISES[0]).mode_miss.values())
        if not worst <= MODE_MARK:
            yield Finding(
                f"The frozen rotor mode, {axis.name}, is missed by {worst:.1f} %, wanted"
                f" {MODE_MARK:g}.",
                "Noise-free: the structure has too few lags for it.",
                "identification.models",
                "target",
            )


def _predictions(study: Outcome) -> Iterator[Finding]:
    for one in study.comparison.predictions if study.comparison else ():
        lost: dict[str, list[str]] = {}
        for p in one.found.predictions:
            for y in one.axis.outputs:
                if diverges(p.scores.free_run[y]) or p.scores.free_run[y] < 0:
                    lost.setdefault(p.name, []).append(y)
        if lost:
            each = "; ".join(f"{name}: {', '.join(ys)}" for name, ys in lost.items())
            yield Finding(
                f"In free run worse than the mean of the flight, {one.axis.name}, {one.noise}:"
                f" {each}.",
                "Slow modes with hardly any damping turn a small error of a pole into a drift.",
                "comparison.predictions",
                "prediction",
            )


class _Unproven(NamedTuple):
    """Gains of one model that were not proven, all for one reason."""

    path: str
    channel: str
    model: str
    why: str
    failed: bool
    tests: tuple[str, ...]


def _unproven(study: Outcome) -> Iterator[_Unproven]:
    proofs = study.certified_controllers.bounds if study.certified_controllers else ()
    for path, bounds in (("guarantees.bounds", study.bounds), ("controllers.bounds", proofs)):
        alike: dict[tuple[str, str, str, bool], list[str]] = {}
        for b in bounds:
            if b.certificate.kind == "l2 gain" and not b.certificate.verified:
                test = f"{b.form} ({rate_text(b.rate)})"
                alike.setdefault((b.channel, b.model, *_why(b, bounds)), []).append(test)
        yield from (_Unproven(path, *key, tuple(tests)) for key, tests in alike.items())


def without_certificate(study: Outcome) -> list[str]:
    """A sentence for each reason for which certificates were not found, with the models."""
    models: dict[str, list[str]] = {}
    for one in _unproven(study):
        if not one.failed:
            models.setdefault(one.why, []).append(f"{one.model} ({one.channel})")
    return [f"No certificate found for {', '.join(m)}: {w}" for w, m in models.items()]


def _proofs(study: Outcome) -> Iterator[Finding]:
    for one in _unproven(study):
        what = "The proof of a gain failed" if one.failed else "No certificate of a gain"
        heading = f"{what}, {one.channel} channel, {one.model}: {', '.join(one.tests)}."
        yield Finding(heading, _capital(one.why), one.path, "certificate", one.failed)
    for sentence in not_about_the_helicopter(study.bounds):
        why = "The model differs from the helicopter by more than this loop's margin."
        yield Finding(sentence, why, "guarantees.bounds", "certificate")


def _why(b: Bound, bounds: Sequence[Bound]) -> tuple[str, bool]:
    """Return why there is no certificate, by the result of any search among the same airspeeds, and
    whether the solver failed.
    """
    c, same = b.certificate, (b.channel, b.model, b.rate)
    attained = max(o.certificate.lower for o in bounds if (o.channel, o.model, o.rate) == same)
    if c.status is Status.UNSTABLE or math.isinf(c.frozen):
        return "the loop is unstable at an airspeed held.", False
    if math.isinf(attained):
        return "a computed airspeed history makes the state grow: there is nothing to prove.", False
    if c.status is Status.FAILED:
        return f"{c.status.value}.", True
    if math.isinf(b.rate):
        return "conservative: an airspeed that jumps is allowed.", False
    return f"{c.status.value}.", False


def _controllers(study: Outcome) -> Iterator[Finding]:
    for design in study.controllers.designs if study.controllers else ():
        if design.controller is None:
            what = "The design failed" if design.failed else "No controller"
            yield Finding(
                f"{what}: {design.name}.",
                f"{design.reason.removesuffix('.')}.",
                "controllers.designs",
                "controller",
                design.failed,
            )
    if (found := study.flown_controllers) is None:
        return
    for wind in WINDS:
        for one in found.at(wind):
            if one.lost:
                yield Finding(
                    f"{one.name} lost {one.lost} of {found.seeds} flights in gusts of"
                    f" {one.gust:.1f} m/s.",
                    "The gusts took it outside what its model and its travel allow.",
                    "controllers.flights",
                    "flight",
                )


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
