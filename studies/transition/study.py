"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from studies.processes import Processes
from studies.transition.configuration import KEPT, Configuration
from studies.transition.effort import Effort
from studies.transition.outcome import Outcome
from studies.transition.proofs import Answer, Questions
from studies.transition.report import write_report, write_results
from studies.transition.results import to_dict
from studies.transition.selection import Selection
from studies.transition.stages import Stage, stages
from studies.transition.stored_stages import (
    NotUsable,
    Stored,
    StoredAnswers,
    StoredStages,
    loaded,
    stored_stages,
)
from studies.transition.summary import summary
from symheli.progress import Task, task, tracked

LONG = 2.5
"""So many others count as one of those questions that take longest: they go on beside the others,
so that less is in front of us than their time.
"""
REPORT = 10.0
"""Of figures and report, which keep one core busy, s."""


class Study(Outcome):
    """An `Outcome` that can tell what it found."""

    def summary(self) -> str:
        """The short table printed at the end."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Every number of the report with its unit."""
        return to_dict(self)


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

    @property
    def share(self) -> float:
        """Of the work, as far as the questions are answered."""
        whole = done = 0
        for proof, answer in zip(self.questions.proofs, self.answers, strict=True):
            work = LONG if any(proof is long for long in self.questions.long) else 1
            whole += work
            done += work * answer.done()
        return done / whole if whole else 1.0

    def stored(self, told: Callable[[], object] = lambda: None) -> Stored:
        """Wait for the answers; `seconds` is the work they were. Each is `told`."""
        found = []
        for answer in tracked("answers", self.answers):
            found.append(answer.result())
            told()
        bounds = tuple(bound for _, own in found for bound in own)
        return Stored(
            result=self.questions.together(bounds), seconds=sum(seconds for seconds, _ in found)
        )


def run_study(
    configuration: Configuration,
    *,
    resume: bool = False,
    only: Iterable[str] = (),
    since: str = "",
) -> Study:
    """Run every stage, store it and write results.json after each, and report.html with its figures
    into the folder at the end, beside study.toml with what was asked for.

    Proofs that do not need each other run side by side, in a process a core, while the other stages
    are computed here. `resume` takes the stages that an earlier run has stored in the folder, where
    code, libraries, vehicle, seed and what they read of the effort are the same; others, and those
    that are damaged, are computed again. Stages may run alone (`only`), or `since` one of them:
    what they need is taken as it is stored, and computed where it is not. An interrupted run leaves
    its finished stages, the proofs that are found and their results; files are whole or absent.
    """
    out, effort = configuration.out, configuration.effort
    every = stages(effort)
    selection = Selection.of(every, only, since)
    heli = loaded(configuration)
    study = Study(
        vehicle=configuration.vehicle,
        quick=configuration.quick,
        seed=configuration.seed,
        effort=effort,
        heli=heli,
    )
    stored = stored_stages(configuration, every, heli)
    configuration.write(out / KEPT)
    for stage in every:
        if resume or stage.name not in selection.again:
            found = _taken(stored, stage)
            study = study if found is None else with_stage(study, stage, found)
    run = _Run(stored, resume, selection.open(every, study.seconds))
    with task("study", run.cost, percent=True) as whole:
        study = run.finish(study, whole)
        study = replace(study, complete={stage.name for stage in every} <= study.seconds.keys())
        with _shown("Writing figures and report"):
            write_report(study, out)
        whole.to(run.cost)
    return study


@dataclass(frozen=True)
class _Run:
    """Stages to compute, and where they are stored."""

    stored: StoredStages
    resume: bool
    todo: Sequence[Stage]

    @property
    def cost(self) -> float:
        """Of all, the report too, s."""
        return REPORT + sum(stage.cost for stage in self.todo)

    def finish(self, study: Study, whole: Task) -> Study:
        """All of them, each as soon as what it needs is there; questions wait for other stages to
        be computed.
        """
        todo, asked = list(self.todo), dict[str, Asked]()

        def tell() -> None:
            whole.to(self._done(todo, asked))

        with Processes() as processes:
            while todo:
                ready = [stage for stage in todo if set(stage.needs) <= study.seconds.keys()]
                for stage in ready:
                    if stage.asks and stage.name not in asked:
                        questions = stage.found(study, study.effort)
                        kept = self.stored.answers(stage.name)
                        asked[stage.name] = Asked.of(questions, processes, kept, self.resume)
                stage = next((stage for stage in ready if not stage.asks), ready[0])
                with task(stage.title):
                    found = (
                        asked[stage.name].stored(tell)
                        if stage.asks
                        else computed(stage, study, study.effort)
                    )
                work = " of work" if stage.asks else ""
                _say(f"{stage.title}: {found.seconds:.1f} s{work}")
                self.stored.save(stage.name, found)
                self.stored.answers(stage.name).clear()
                study = with_stage(study, stage, found)
                write_results(study, self.stored.folder.parent)
                todo.remove(stage)
                tell()
        return study

    def _done(self, todo: Sequence[Stage], asked: dict[str, Asked]) -> float:
        """Of the cost of all, what is not in front of us."""
        left = (
            stage.cost * (1 - (asked[stage.name].share if stage.name in asked else 0.0))
            for stage in todo
        )
        return max(0.0, self.cost - REPORT - sum(left))


def computed(stage: Stage, study: Study, effort: Effort) -> Stored:
    """Compute a stage here."""
    if stage.asks:
        with Processes(1) as here:
            return Asked.of(stage.found(study, effort), here).stored()
    begin = time.perf_counter()
    result = stage.found(study, effort)
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
        _say(f"{reason}: not taken")
        return None
    if found is not None:
        _say(f"{stage.title}: taken from {stored.folder} ({found.seconds:.1f} s when computed)")
    return found


@contextmanager
def _shown(title: str) -> Iterator[None]:
    """The time it took, when done; meanwhile a task."""
    begin = time.perf_counter()
    with task(title):
        yield
    _say(f"{title}: {time.perf_counter() - begin:.1f} s")


def _say(sentence: str) -> None:
    print(f"  {sentence}", file=sys.stderr, flush=True)
