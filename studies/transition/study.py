"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from studies.controllers.designs import Designs
from studies.processes import Processes
from studies.setup.questions import Questions
from studies.setup.stored_stages import STAGES, NotUsable, Stored, StoredStages, content_key
from studies.transition.configuration import KEPT, Configuration
from studies.transition.effort import Effort
from studies.transition.outcome import Outcome
from studies.transition.report import write_report, write_results
from studies.transition.results import to_dict
from studies.transition.stage_keys import loaded, stage_keys
from studies.transition.stages import Stage, stages
from studies.transition.summary import summary
from symheli import Helicopter
from symheli.errors import InputError
from symheli.progress import Task, task, tracked

REPORT = 10.0
"""Time of figures and report, which keep one core busy, s."""


class Study(Outcome):
    """An `Outcome` that can tell what it found."""

    def summary(self) -> str:
        """The short table printed at the end."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Every number of the report with its unit."""
        return to_dict(self)


def run_study(configuration: Configuration, *, resume: bool = False) -> Study:
    """Run every stage, store it and write results.json after each, and report.html with its figures
    into the folder at the end, beside study.toml with what was asked for.

    Proofs and designs run side by side, in a process a core, while the other stages are computed
    here. `resume` takes the stages that an earlier run has stored in the folder, where code,
    libraries, vehicle, seed and what they read of the effort are the same; others, and those that
    are damaged, are computed again. An interrupted run leaves its finished stages, the proofs that
    are found and their results; files are whole or absent.
    """
    out, effort = configuration.out, configuration.effort
    heli, every = loaded(configuration), stages(effort)
    study = Study(
        vehicle=configuration.vehicle,
        quick=configuration.quick,
        seed=configuration.seed,
        effort=effort,
        heli=heli,
    )
    stored = stored_of(configuration, heli, every)
    configuration.write(out / KEPT)
    for stage in every if resume else ():
        if (found := _taken(stored, stage)) is not None:
            study = with_stage(study, stage, found)
    todo = [stage for stage in every if stage.name not in study.seconds]
    whole = REPORT + sum(stage.cost[study.quick] for stage in todo)
    with task("study", whole, percent=True) as progress:
        with Processes() as processes:
            study = _Run(study, stored, resume, processes, progress).finish(todo)
        with _shown("Writing figures and report"):
            write_report(study, out)
        progress.to(whole)
    return study


def designs_of(folder: Path) -> tuple[Configuration, Designs]:
    """Return what a run was asked for, and its controllers, from its folder.

    Raises `InputError` where it has none yet, `NotUsable` for those of another version.
    """
    configuration = replace(Configuration.read(folder / KEPT, {}), out=folder)
    every = stages(configuration.effort)
    found = stored_of(configuration, loaded(configuration), every).load("controllers")
    if found is None:
        raise InputError(
            f"{folder} has no finished controllers; symheli study --out {folder} makes them"
        )
    return configuration, found.result


def stored_of(
    configuration: Configuration, heli: Helicopter, every: Sequence[Stage]
) -> StoredStages:
    """Return the stored stages of a run."""
    content = content_key(heli, configuration.vehicle, configuration.seed)
    keys = stage_keys(every, content, configuration.effort)
    return StoredStages(configuration.out / STAGES, keys)


@dataclass
class _Run:
    """A study under way: what was found, and the questions that are being answered."""

    study: Study
    stored: StoredStages
    resume: bool
    processes: Executor
    progress: Task
    done: float = 0.0
    running: dict[str, tuple[Stage, Questions, list[Future[Stored]]]] = field(default_factory=dict)

    def finish(self, todo: Sequence[Stage]) -> Study:
        """Every stage in order; questions are answered meanwhile, and awaited where another stage
        needs them, or at the end.
        """
        for stage in todo:
            for name in stage.needs:
                self._await(name)
            with task(stage.title):
                begin = time.perf_counter()
                result = stage.found(self.study, self.study.effort)
                seconds = time.perf_counter() - begin
            if isinstance(result, Questions):
                self.running[stage.name] = stage, result, self._submitted(stage, result)
            else:
                self._keep(stage, Stored(result=result, seconds=seconds))
        for name in list(self.running):
            self._await(name)
        return replace(self.study, complete=True)

    def _submitted(self, stage: Stage, questions: Questions) -> list[Future[Stored]]:
        """An answer to come for each question, at once for those that are stored; every new one is
        stored when it is there.
        """
        count = len(questions.proofs)
        known = self.stored.parts(stage.name, count) if self.resume else {}
        answers: dict[int, Future[Stored]] = {}
        for i in questions.order:
            if i in known:
                answers[i] = Future()
                answers[i].set_result(known[i])
            else:
                answers[i] = self.processes.submit(timed, questions.proofs[i])
                answers[i].add_done_callback(partial(self._store, stage.name, i))
        return [answers[i] for i in range(count)]

    def _store(self, name: str, i: int, answer: Future[Stored]) -> None:
        if not answer.cancelled() and answer.exception() is None:
            self.stored.save(name, answer.result(), i)

    def _await(self, name: str) -> None:
        """Wait for the answers to the questions of a stage, if there are any."""
        if name not in self.running:
            return
        stage, questions, answers = self.running.pop(name)
        cost, found = stage.cost[self.study.quick], []
        with task(stage.title):
            for k, answer in enumerate(tracked("answers", answers)):
                found.append(answer.result())
                self.progress.to(self.done + cost * (k + 1) / len(answers))
        result = questions.together(tuple(bound for one in found for bound in one.result))
        self._keep(stage, Stored(result=result, seconds=sum(one.seconds for one in found)))

    def _keep(self, stage: Stage, found: Stored) -> None:
        """Store the result of a stage, and write the results so far."""
        _print(f"{stage.title}: {found.seconds:.1f} s of work")
        self.stored.save(stage.name, found)
        self.study = with_stage(self.study, stage, found)
        write_results(self.study, self.stored.folder.parent)
        self.done += stage.cost[self.study.quick]
        self.progress.to(self.done)


def timed(work: Callable[[], Any]) -> Stored:
    """Return the result of a function, and its time."""
    begin = time.perf_counter()
    result = work()
    return Stored(result=result, seconds=time.perf_counter() - begin)


def computed(stage: Stage, study: Study, effort: Effort) -> Stored:
    """Compute a stage here, its questions one after the other."""
    found = timed(lambda: stage.found(study, effort))
    if not isinstance(found.result, Questions):
        return found
    return timed(
        lambda: found.result.together(tuple(b for proof in found.result.proofs for b in proof()))
    )


def with_stage(study: Study, stage: Stage, found: Stored) -> Study:
    """The study with one stage more."""
    seconds = {**study.seconds, stage.name: found.seconds}
    return replace(study, **{stage.name: found.result}, seconds=seconds)


def _taken(stored: StoredStages, stage: Stage) -> Stored | None:
    """Return a stored stage, or None with the reason printed."""
    try:
        found = stored.load(stage.name)
    except NotUsable as reason:
        _print(f"{reason}: not taken")
        return None
    if found is not None:
        _print(f"{stage.title}: taken from {stored.folder} ({found.seconds:.1f} s when computed)")
    return found


@contextmanager
def _shown(title: str) -> Iterator[None]:
    """The time it took, when done; meanwhile a task."""
    begin = time.perf_counter()
    with task(title):
        yield
    _print(f"{title}: {time.perf_counter() - begin:.1f} s")


def _print(sentence: str) -> None:
    print(f"  {sentence}", file=sys.stderr, flush=True)
