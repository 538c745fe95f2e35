"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from studies.transition.baseline import Baseline, build_baseline
from studies.transition.comparison import Comparison, compare
from studies.transition.effort import Effort
from studies.transition.flights import Flights, fly_transitions
from studies.transition.identified import Identification, identify_axes
from studies.transition.outcome import Outcome
from studies.transition.paper_experiment import PERIOD, PaperExperiments, run_experiments
from studies.transition.proofs import (
    GustProofs,
    LongitudinalProofs,
    ServoProofs,
    prove_gust,
    prove_longitudinal,
    prove_servo,
)
from studies.transition.recovery import Recoveries, recover_at
from studies.transition.report import write_report, write_results
from studies.transition.results import to_dict
from studies.transition.stored_stages import NotUsable, Stored, StoredStages, content_key
from studies.transition.summary import summary
from symheli import Helicopter

T = TypeVar("T")
STAGES = "stages"
"""Folder of the stored stages."""


class Study(Outcome):
    """An `Outcome` that can tell what it found."""

    def summary(self) -> str:
        """The short table printed at the end."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Every number of the report with its unit."""
        return to_dict(self)


@dataclass(frozen=True)
class Stage:
    """What fills one field of an `Outcome`: its title, the type of its result, and how it is
    computed from what is there.
    """

    name: str
    title: str
    kind: type
    compute: Callable[[Study, Effort], Any]


def run_study(
    vehicle: str = "xcell60",
    out: Path | str = "study",
    quick: bool = False,
    seed: int = 0,
    resume: bool = False,
) -> Study:
    """Run every stage, store it and write results.json after each, and report.html with its figures
    into `out` at the end.

    `resume` takes the stages that an earlier run has stored in `out`, where code, libraries,
    vehicle, effort and seed are the same; others, and those that are damaged, are computed again.
    Progress goes to standard error. An interrupted run leaves its finished stages and their
    results; files are whole or absent.
    """
    out, effort = Path(out), Effort.look() if quick else Effort()
    heli = Helicopter.load(vehicle, governor="ideal")
    study = Study(vehicle=vehicle, quick=quick, seed=seed, heli=heli)
    stored = StoredStages(out / STAGES, content_key(heli, effort, seed))
    for stage in stages(effort):
        found = _taken(stored, stage) if resume else None
        if found is None:
            found = computed(stage, study, effort)
            stored.save(stage.name, found)
        study = with_stage(study, stage, found)
        write_results(study, out)
    study = replace(study, complete=True)
    with _shown("Writing figures and report"):
        write_report(study, out)
    return study


def stages(effort: Effort) -> tuple[Stage, ...]:
    """In order: each needs those before it."""
    longitudinal = Stage(
        "longitudinal",
        "Proving gains of the longitudinal gust loop (baseline, continuous)",
        LongitudinalProofs,
        lambda s, effort: prove_longitudinal(_there(s.heli), effort),
    )
    return (
        Stage(
            "baseline",
            "Model and baseline: trim, linearize, interpolate, LFT",
            Baseline,
            lambda s, _: build_baseline(_there(s.heli)),
        ),
        Stage(
            "paper_experiment",
            "The paper's experiment, open and closed loop",
            PaperExperiments,
            lambda s, _: run_experiments(_there(s.baseline).nodes, s.seed),
        ),
        Stage(
            "exact_recovery",
            "Exact recovery of A(p), B(p)",
            Recoveries,
            lambda s, _: recover_at(_there(s.baseline).nodes, (0.02, PERIOD), s.seed),
        ),
        Stage(
            "flights",
            "Flying the transitions",
            Flights,
            lambda s, effort: fly_transitions(
                _there(s.heli), s.seed, effort.ramps, effort.gentle_ramps
            ),
        ),
        Stage(
            "identification",
            "Identifying and scoring",
            Identification,
            lambda s, _: identify_axes(_there(s.heli), _there(s.flights)),
        ),
        Stage(
            "comparison",
            "Comparing with the baseline",
            Comparison,
            lambda s, _: compare(
                _there(s.heli), _there(s.baseline), _there(s.flights), _there(s.identification)
            ),
        ),
        Stage(
            "gust",
            "Proving gains of the lateral gust loop (baseline and exact, continuous)",
            GustProofs,
            lambda s, effort: prove_gust(_there(s.heli), _there(s.baseline), effort),
        ),
        *((longitudinal,) if effort.longitudinal_rates else ()),
        Stage(
            "servo",
            "Proving gains of the servo loop (exact, baseline and identified, 50 Hz)",
            ServoProofs,
            lambda s, effort: prove_servo(
                _there(s.heli), _there(s.baseline), _there(s.identification), effort
            ),
        ),
    )


def computed(stage: Stage, study: Study, effort: Effort) -> Stored:
    """Compute a stage, and say so."""
    begin = time.perf_counter()
    with _shown(stage.title):
        result = stage.compute(study, effort)
    return Stored(result=result, seconds=time.perf_counter() - begin)


def with_stage(study: Study, stage: Stage, found: Stored) -> Study:
    """The study with one stage more."""
    seconds = {**study.seconds, stage.name: found.seconds}
    return replace(study, **{stage.name: found.result}, seconds=seconds)


def _taken(stored: StoredStages, stage: Stage) -> Stored | None:
    """A stored stage, or None with the reason said."""
    try:
        found = stored.load(stage.name, stage.kind)
    except NotUsable as reason:
        print(f"  {reason}: computed again", file=sys.stderr, flush=True)
        return None
    if found is not None:
        words = f"taken from {stored.folder} ({found.seconds:.1f} s when computed)"
        print(f"  {stage.title}: {words}", file=sys.stderr, flush=True)
    return found


@contextmanager
def _shown(title: str) -> Iterator[None]:
    """Title while it runs, time when done."""
    live = sys.stderr.isatty()
    print(f"  {title} ...", end="" if live else "\n", file=sys.stderr, flush=True)
    begin = time.perf_counter()
    yield
    took = time.perf_counter() - begin
    print(
        f"\r  {title} ... {took:.1f} s" if live else f"    {took:.1f} s",
        file=sys.stderr,
        flush=True,
    )


def _there(thing: T | None) -> T:
    assert thing is not None, "stages run in order"  # noqa: S101
    return thing
