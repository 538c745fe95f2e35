"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from studies.controllers.designs import Designs
from studies.processes import Processes
from studies.report.drawn import Drawn
from studies.setup.questions import Question, Questions
from studies.setup.stored_stages import STAGES, NotUsable, Stored, StoredStages, content_key
from studies.transition.configuration import KEPT, Configuration
from studies.transition.effort import Effort
from studies.transition.figures import drawn_in, figures
from studies.transition.outcome import Outcome
from studies.transition.report import REPORT, write_page, write_results
from studies.transition.results import to_dict
from studies.transition.schedule import Call, Schedule, Span, timed
from studies.transition.stage_keys import loaded, stage_keys
from studies.transition.stages import SOON, Stage, stages, urgencies
from studies.transition.summary import summary
from studies.transition.under_way import UnderWay
from symheli import Helicopter
from symheli.errors import InputError, SymheliError
from symheli.integrate.side_by_side import workers_of
from symheli.progress import Task, task

FIRST = "baseline"
"""The stage with which the page begins."""
WARY = 10.0
"""Seconds of work before which the speed of this machine says little."""


class Study(Outcome):
    """An `Outcome` that can tell what it found."""

    def summary(self) -> str:
        """The short table printed at the end."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Every number of the report with its unit."""
        return to_dict(self)


def run_study(
    configuration: Configuration,
    *,
    resume: bool = False,
    watch: Callable[[Span], object] = lambda _: None,
) -> Study:
    """Run every stage, store it and write results.json and report.html after each, with the figures
    of the stages that have ended, into the folder of the run, beside study.toml with what was asked
    for.

    A process a core computes stages, proofs, designs and figures, those of the longest chain first;
    the baseline, which the page begins with, is computed here. `resume` takes the stages that an
    earlier run has stored in the folder, where code, libraries, vehicle, seed and what they read of
    the effort are the same; others, and those that are damaged, are computed again. An interrupted
    run leaves its finished stages, the proofs that are found and their results, and a page that
    says so; files are whole or absent. `watch` is called with each call that has ended.
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
    whole = sum(one.cost[study.quick] for one in every if one.name not in study.seconds)
    with task("study", whole or None, percent=True) as progress:
        processes = Processes()
        schedule = Schedule(processes, watch)
        run = _Run(study, out, stored, resume, progress, every, schedule)
        try:
            with processes:
                return run.finish()
        except BaseException as error:
            run.stopped(error)
            raise


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
    """A study under way: what was found, `every` stage and those still `todo`, the answers to their
    questions and the `share` of each that is done, figures that are drawn (None: to be drawn).
    """

    study: Study
    out: Path
    stored: StoredStages
    resume: bool
    progress: Task
    every: Sequence[Stage]
    schedule: Schedule
    todo: dict[str, Stage] = field(init=False)
    answers: dict[str, dict[int, Stored]] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)
    pictures: dict[str, Drawn | None] = field(default_factory=dict)
    stale: bool = True

    def __post_init__(self) -> None:
        self.begun_with = frozenset(self.study.seconds)
        self.todo = {one.name: one for one in self.every if one.name not in self.begun_with}
        self.cost = {one.name: one.cost[self.study.quick] for one in self.every}
        self.urgency = urgencies(self.every, self.study.quick)

    def finish(self) -> Study:
        """Compute every stage as soon as what it needs is there, and draw what it shows."""
        self._draw()
        self._begin()
        self._write_page()
        self.schedule.run(self._show)
        self.study = replace(self.study, complete=True)
        write_results(self.study, self.out)
        write_page(self.study, self.out, self._drawn)
        return self.study

    def stopped(self, error: BaseException) -> None:
        """Write a page that says why the run ends here, where the disk takes one."""
        if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
            reason = "The study was interrupted."
        else:
            at = self.schedule.failed
            words = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            reason = f"The study was stopped: {at and f'{at}: '}{words}."
        with suppress(SymheliError):
            self._write_page(reason)

    def _begin(self) -> None:
        """Put the stages that have what they need."""
        for stage in [*self.todo.values()]:
            if stage.name not in self.answers and self.study.seconds.keys() >= {*stage.needs}:
                self.answers[stage.name] = {}
                here = stage.asks or stage.name == FIRST
                work = stage.call(self.study, self.study.effort)
                self._put(stage, work, partial(self._found, stage), here)

    def _put(
        self, stage: Stage, work: Question, then: Callable[[Stored], None], here: bool = False
    ) -> None:
        urgency = self.urgency[stage.name]
        call = Call(title=stage.title, urgency=urgency, work=work, then=then, here=here)
        self.schedule.put(call)

    def _found(self, stage: Stage, found: Stored) -> None:
        """Keep the result of a stage, or ask its questions but for those with a stored answer."""
        questions = found.result
        if not isinstance(questions, Questions):
            self._keep(stage, found)
            return
        count = len(questions.proofs)
        known = self.stored.parts(stage.name, count) if self.resume else {}
        self.answers[stage.name] = known
        for i in questions.order:
            if i not in known:
                then = partial(self._answered, stage, questions, i)
                self._put(stage, questions.proofs[i], then)
        if len(known) == count:
            self._together(stage, questions)

    def _answered(self, stage: Stage, questions: Questions, i: int, answer: Stored) -> None:
        self.stored.save(stage.name, answer, i)
        self.answers[stage.name][i] = answer
        self._note(stage, len(self.answers[stage.name]) / len(questions.proofs))
        if len(self.answers[stage.name]) == len(questions.proofs):
            self._together(stage, questions)

    def _together(self, stage: Stage, questions: Questions) -> None:
        each = [answer for _, answer in sorted(self.answers[stage.name].items())]
        result = questions.together(tuple(bound for one in each for bound in one.result))
        self._keep(stage, Stored(result=result, seconds=sum(one.seconds for one in each)))

    def _keep(self, stage: Stage, found: Stored) -> None:
        """Store the result of a stage, write the results so far, and go on with what it allows."""
        _print(f"{stage.title}: {found.seconds:.1f} s of work")
        self.stored.save(stage.name, found)
        self.study = with_stage(self.study, stage, found)
        del self.todo[stage.name]
        write_results(self.study, self.out)
        self._begin()
        self._draw()
        self._note(stage, 1.0)
        if stage.name == FIRST:
            _print(f"{self.out / REPORT} shows trims and stability; it grows as stages end")

    def _note(self, stage: Stage, share: float) -> None:
        """Note that so much of a stage is done."""
        self.share[stage.name], self.stale = share, True

    def _show(self) -> None:
        """Show how far the run is, on the page and as progress."""
        self._write_page()
        done = sum(part * self.cost[name] for name, part in self.share.items())
        self.progress.to(done, "; ".join(self._titles[0]))

    def _draw(self) -> None:
        """Put the figures whose stages have ended, to be drawn soon; those of the first here."""
        for one in figures(self.study):
            if one.name not in self.pictures and self.todo.keys().isdisjoint(one.stages):
                self.pictures[one.name] = None
                call = Call(
                    title=f"Drawing {one.name}",
                    urgency=max((self.urgency[name] for name in self.todo), default=0.0) * SOON,
                    work=partial(drawn_in, self.out, one),
                    then=self._painted,
                    here=one.stages == (FIRST,),
                )
                self.schedule.put(call)

    def _write_page(self, stopped: str = "") -> None:
        """Write the page as far as it is, where it says something new."""
        if not self.stale and not stopped:
            return
        working, coming = self._titles
        page = UnderWay(
            working=working,
            coming=coming,
            again=shlex.join(["symheli", "study", str(self.out / KEPT), "--resume"]),
            left=self._left(),
            stopped=stopped,
        )
        write_page(self.study, self.out, self._drawn, page)
        self.stale = False

    @property
    def _titles(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Stages under way, and those to come."""
        now = self.schedule.titles
        titles = [stage.title for stage in self.todo.values()]
        return tuple(t for t in titles if t in now), tuple(t for t in titles if t not in now)

    def _left(self) -> float:
        """About the time that is left, s: work over processes, at least the longest chain; at the
        speed of the stages that this run has finished, the more of them the more it counts.
        """
        left = {name: self.cost[name] * (1 - self.share.get(name, 0.0)) for name in self.todo}
        chains = (self.urgency[name] - self.cost[name] + rest for name, rest in left.items())
        ended = self.study.seconds.keys() - self.begun_with
        spent = sum(self.study.seconds[name] for name in ended)
        pace = (WARY + spent) / (WARY + sum(self.cost[name] for name in ended))
        return pace * max(sum(left.values()) / workers_of(None), *chains, 0.0)

    @property
    def _drawn(self) -> dict[str, Drawn]:
        return {name: one for name, one in self.pictures.items() if one is not None}

    def _painted(self, found: Stored) -> None:
        self.pictures[found.result.name], self.stale = found.result, True


def computed(stage: Stage, study: Study, effort: Effort) -> Stored:
    """Compute a stage here, its questions one after the other."""
    found = timed(stage.call(study, effort))
    if not isinstance(found.result, Questions):
        return found
    return timed(
        lambda: found.result.together(tuple(b for proof in found.result.proofs for b in proof()))
    )


def with_stage(study: Study, stage: Stage, found: Stored) -> Study:
    """The study with one stage more; the times of the stages are in the order of the results."""
    each = {**study.seconds, stage.name: found.seconds}
    seconds = {f.name: each[f.name] for f in fields(Outcome) if f.name in each}
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


def _print(sentence: str) -> None:
    print(f"  {sentence}", file=sys.stderr, flush=True)
