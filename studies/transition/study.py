"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from studies.controllers.certified import CertifiedControllers, controller_questions
from studies.controllers.designs import Designs, design_questions
from studies.controllers.flown import FlownControllers, fly_controllers
from studies.processes import Processes
from studies.transition.baseline import Baseline, build_baseline
from studies.transition.comparison import Comparison, compare
from studies.transition.effort import Effort
from studies.transition.flights import Flights, fly_transitions
from studies.transition.identified import Identification, identify_axes
from studies.transition.known_kinematics import (
    KnownKinematics,
    identify_with_known_kinematics,
)
from studies.transition.outcome import Outcome
from studies.transition.paper_experiment import PERIOD, PaperExperiments, run_experiments
from studies.transition.proofs import (
    Answer,
    GustProofs,
    LongitudinalProofs,
    Questions,
    RobustProofs,
    ServoProofs,
    gust_questions,
    longitudinal_questions,
    robust_questions,
    servo_questions,
)
from studies.transition.recovery import Recoveries, recover_at
from studies.transition.report import write_report, write_results
from studies.transition.results import to_dict
from studies.transition.stored_stages import (
    NotUsable,
    Stored,
    StoredAnswers,
    StoredStages,
    content_key,
)
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
    computed from the stages it `needs`: at once, or as `Questions` that processes answer.
    """

    name: str
    title: str
    kind: type
    needs: tuple[str, ...]
    compute: Callable[[Study, Effort], Any]
    asks: bool = False


@dataclass(frozen=True)
class Asked:
    """A stage whose questions are being answered."""

    questions: Questions
    answers: Sequence[Future[Answer]]

    @classmethod
    def of(
        cls,
        questions: Questions,
        processes: Processes,
        kept: StoredAnswers | None = None,
        resume: bool = False,
    ) -> Asked:
        """Hand the questions over; answers are `kept`, and with `resume` taken from there."""
        known = kept.load(len(questions.proofs)) if kept is not None and resume else {}
        found = (lambda i, answer: None) if kept is None else kept.save
        return cls(questions, questions.asked(processes, known, found))

    def stored(self) -> Stored:
        """Wait for the answers; `seconds` is the work they were."""
        found = [answer.result() for answer in self.answers]
        bounds = tuple(bound for _, own in found for bound in own)
        return Stored(
            result=self.questions.together(bounds), seconds=sum(seconds for seconds, _ in found)
        )


def run_study(
    vehicle: str = "xcell60",
    out: Path | str = "study",
    quick: bool = False,
    seed: int = 0,
    resume: bool = False,
) -> Study:
    """Run every stage, store it and write results.json after each, and report.html with its figures
    into `out` at the end.

    Proofs that do not need each other run side by side, in a process a core, while the other stages
    are computed here. `resume` takes the stages that an earlier run has stored in `out`, where
    code, libraries, vehicle, effort and seed are the same; others, and those that are damaged, are
    computed again. Progress goes to standard error. An interrupted run leaves its finished stages,
    the proofs that are found and their results; files are whole or absent.
    """
    out, effort = Path(out), Effort.look() if quick else Effort()
    heli = Helicopter.load(vehicle, governor="ideal")
    study = Study(vehicle=vehicle, quick=quick, seed=seed, heli=heli)
    stored = StoredStages(out / STAGES, content_key(heli, effort, seed))
    todo = list(stages(effort))
    for stage in todo[:] if resume else ():
        if (found := _taken(stored, stage)) is not None:
            study = with_stage(study, stage, found)
            todo.remove(stage)
    with Processes() as processes:
        asked: dict[str, Asked] = {}
        while todo:
            ready = [stage for stage in todo if set(stage.needs) <= study.seconds.keys()]
            for stage in ready:
                if stage.asks and stage.name not in asked:
                    questions, kept = stage.compute(study, effort), stored.answers(stage.name)
                    asked[stage.name] = Asked.of(questions, processes, kept, resume)
            stage = next((stage for stage in ready if not stage.asks), ready[0])
            with _shown(stage.title):
                found = asked[stage.name].stored() if stage.asks else computed(stage, study, effort)
            stored.save(stage.name, found)
            stored.answers(stage.name).clear()
            study = with_stage(study, stage, found)
            write_results(study, out)
            todo.remove(stage)
    study = replace(study, complete=True)
    with _shown("Writing figures and report"):
        write_report(study, out)
    return study


def stages(effort: Effort) -> tuple[Stage, ...]:
    """In order: each needs some of those before it."""
    longitudinal = Stage(
        "longitudinal",
        "Proving gains of the longitudinal gust loop (baseline, continuous)",
        LongitudinalProofs,
        (),
        lambda s, effort: longitudinal_questions(_there(s.heli), effort),
        asks=True,
    )
    return (
        Stage(
            "baseline",
            "Model and baseline: trim, linearize, interpolate, LFT",
            Baseline,
            (),
            lambda s, _: build_baseline(_there(s.heli)),
        ),
        Stage(
            "paper_experiment",
            "The paper's experiment, open and closed loop",
            PaperExperiments,
            ("baseline",),
            lambda s, _: run_experiments(_there(s.baseline).nodes, s.seed),
        ),
        Stage(
            "exact_recovery",
            "Exact recovery of A(p), B(p)",
            Recoveries,
            ("baseline",),
            lambda s, _: recover_at(_there(s.baseline).nodes, (0.02, PERIOD), s.seed),
        ),
        Stage(
            "flights",
            "Flying the transitions",
            Flights,
            (),
            lambda s, effort: fly_transitions(
                _there(s.heli), s.seed, effort.ramps, effort.gentle_ramps
            ),
        ),
        Stage(
            "identification",
            "Identifying and scoring",
            Identification,
            ("flights",),
            lambda s, _: identify_axes(_there(s.heli), _there(s.flights)),
        ),
        Stage(
            "comparison",
            "Comparing with the baseline",
            Comparison,
            ("baseline", "flights", "identification"),
            lambda s, _: compare(
                _there(s.heli), _there(s.baseline), _there(s.flights), _there(s.identification)
            ),
        ),
        Stage(
            "known_kinematics",
            "Identifying with known kinematics",
            KnownKinematics,
            ("baseline",),
            lambda s, effort: identify_with_known_kinematics(
                _there(s.heli), s.vehicle, _there(s.baseline), s.seed, effort
            ),
        ),
        Stage(
            "gust",
            "Proving gains of the lateral gust loop (baseline and exact, continuous)",
            GustProofs,
            ("baseline",),
            lambda s, effort: gust_questions(_there(s.heli), _there(s.baseline), effort),
            asks=True,
        ),
        *((longitudinal,) if effort.longitudinal_rates else ()),
        Stage(
            "servo",
            "Proving gains of the servo loop (exact, baseline and identified, 50 Hz)",
            ServoProofs,
            ("baseline", "identification"),
            lambda s, effort: servo_questions(
                _there(s.heli), _there(s.baseline), _there(s.identification), effort
            ),
            asks=True,
        ),
        Stage(
            "robust",
            "Proving gains of the loop with a margin (exact, baseline, identified; 50 Hz)",
            RobustProofs,
            ("baseline", "known_kinematics"),
            lambda s, effort: robust_questions(
                _there(s.heli), _there(s.baseline), _there(s.known_kinematics), effort
            ),
            asks=True,
        ),
        Stage(
            "controllers",
            "Designing controllers from the baseline and from the identified model",
            Designs,
            ("known_kinematics",),
            lambda s, effort: design_questions(
                _there(s.heli), _there(s.known_kinematics).model, s.seed, effort
            ),
            asks=True,
        ),
        Stage(
            "flown_controllers",
            "Flying the controllers",
            FlownControllers,
            ("controllers",),
            lambda s, effort: fly_controllers(
                s.vehicle, _there(s.controllers), range(effort.controller_seeds)
            ),
        ),
        Stage(
            "certified_controllers",
            "Proving gains of the loops that flew (baseline, servos, delay; 50 Hz)",
            CertifiedControllers,
            ("controllers",),
            lambda s, effort: controller_questions(_there(s.controllers), effort),
            asks=True,
        ),
    )


def computed(stage: Stage, study: Study, effort: Effort) -> Stored:
    """Compute a stage here."""
    if stage.asks:
        with Processes(1) as here:
            return Asked.of(stage.compute(study, effort), here).stored()
    begin = time.perf_counter()
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
