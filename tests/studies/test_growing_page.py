"""report.html stands from the beginning of a study, says what is to come, and ends as it would be
written in one go.
"""

from __future__ import annotations

import html
import re
import shlex
import time
from dataclasses import replace
from functools import partial

import pytest

from benchmarks.gantt import drawn as drawn_schedule
from studies import cli
from studies.campaigns.runners import Here
from studies.processes import Processes
from studies.report import drawn
from studies.transition import report, results, study
from studies.transition.configuration import Configuration
from studies.transition.recovery import Recoveries
from studies.transition.schedule import Call, Schedule, Span
from studies.transition.stages import SHORT, SOON, STAGES, Stage, urgencies
from symheli.errors import AccuracyError
from symheli.progress import _listener

RELOADS = '<meta http-equiv="refresh"'
FIRST = ("baseline", "paper_experiment")
TRIMS, DESIGNS = "pitch (deg)", "Designing controllers"


def nothing(paper_experiment):
    """In place of the last stages."""
    return Recoveries(runs=())


def three(last):
    """The stages of the study that are quick, and one more."""
    first = [stage for stage in STAGES if stage.name in FIRST]
    return *first, Stage("exact_recovery", DESIGNS, last)


@pytest.fixture
def pages(monkeypatch):
    """Every page of a study of three stages in this process, whose figures have no pixels, in the
    order in which they were written.
    """
    written, page = [], study.write_page

    def noted(*given):
        path = page(*given)
        written.append(path.read_text(encoding="utf-8"))
        return path

    monkeypatch.setattr(study, "stages", lambda effort: three(nothing))
    monkeypatch.setattr(study, "Processes", Here)
    monkeypatch.setattr(study, "write_page", noted)
    files = dict.fromkeys(("png", "svg", "pdf"), b"picture")
    monkeypatch.setattr(drawn, "_files", lambda figure: files)
    monkeypatch.setattr(results, "provenance", lambda: {"date": "today"})
    return written


def listed(page, words):
    """The titles below this heading of the part on the run."""
    found = re.search(rf"<b>{words}</b></p>\s*<ul>(.*?)</ul>", page, re.DOTALL)
    return re.findall("<li>(.*?)</li>", found[1]) if found else []


def quick(out):
    return Configuration.of({"quick": True, "out": out})


def test_trims_are_on_the_page_before_the_designs_begin(pages, tmp_path):
    done = study.run_study(quick(tmp_path))
    assert TRIMS not in pages[0]
    assert len(listed(pages[0], "Under way") + listed(pages[0], "Still to come")) == 3
    first = next(page for page in pages if TRIMS in page)
    assert any(page for page in pages if 'id="figure-trim"' in page and DESIGNS in page)
    assert listed(first, "Still to come")[-1] == DESIGNS
    assert re.search(r"The study is running, about \d+ s left\.", first)
    assert first.index(TRIMS) < first.index('id="section-question"')
    assert all(RELOADS in page for page in pages[:-1])
    assert RELOADS not in pages[-1]
    assert "under-way" not in pages[-1]
    whole = report.write_report(done, tmp_path / "in one go")
    assert whole.read_text(encoding="utf-8") == pages[-1]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (KeyboardInterrupt(), "The study was interrupted."),
        (AccuracyError("no digits\nare left."), f"The study was stopped: {DESIGNS}: no digits are"),
    ],
    ids=["interrupted", "failed"],
)
def test_a_page_says_why_its_study_ended_and_its_command_goes_on(
    pages, tmp_path, monkeypatch, error, words
):
    def broken(paper_experiment):
        raise error

    with monkeypatch.context() as once:
        once.setattr(study, "stages", lambda effort: three(broken))
        with pytest.raises(type(error)):
            study.run_study(quick(tmp_path))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert words in page
    assert TRIMS in page
    assert RELOADS not in page
    assert listed(page, "Not finished") == [DESIGNS]
    command = re.search(r"<code>(symheli study .*?)</code>", page)[1]
    pages.clear()
    assert cli.main(shlex.split(html.unescape(command))[1:]) == 0
    assert "under-way" not in pages[-1]
    assert TRIMS in pages[0]  # the stored stages are shown at once


@pytest.mark.slow
def test_a_study_that_never_began_its_designs_promises_no_proof(full):
    """Where a controller stands and its proof does not yet."""
    own = replace(full, vehicle="my.toml", certified_controllers=None, flown_controllers=None)
    assert "is not proven yet" in " ".join([*report.of_the_vehicle(own), report.answer(own)])


@pytest.mark.parametrize("processes", [Here, partial(Processes, 1)], ids=["here", "processes"])
def test_what_is_most_urgent_begins_first(processes):
    begun, answers = [], []
    with processes() as executor:
        schedule = Schedule(executor, begun.append, count=1)

        def more(found):
            answers.append(found.result)
            if found.result == 3:
                put("after", 9.0, partial(pow, 3, 2))

        def put(title, urgency, work, here=False):
            schedule.put(Call(title=title, urgency=urgency, work=work, then=more, here=here))

        put("last", 1.0, partial(pow, 1, 1))
        put("first", 3.0, partial(pow, 3, 1))
        put("middle", 2.0, partial(pow, 2, 1))
        put("own", 2.5, partial(pow, 5, 1), here=True)
        schedule.run()
    assert sorted(answers) == [1, 2, 3, 5, 9]
    assert [span.title for span in begun if span.here] == ["own"]
    away = [span.title for span in sorted(begun, key=lambda one: one.begin) if not span.here]
    assert away[0] == "first"
    assert away.index("after") < away.index("last")
    assert all(span.begin <= span.end <= time.time() for span in begun)


def watched_by():
    return _listener.get()


def test_a_process_does_not_write_its_progress_over_that_of_the_study():
    found = []
    with Processes(1) as executor:
        schedule = Schedule(executor, lambda _: None)
        then = found.append
        schedule.put(Call(title="a call", urgency=1.0, work=watched_by, then=then))
        schedule.run()
    assert [one.result for one in found] == [None]  # without a listener it raises LookupError


def test_a_failure_is_that_of_its_call_and_ends_the_run():
    schedule = Schedule(Here(), lambda _: None, count=1)
    schedule.put(Call(title="a root", urgency=1.0, work=partial(int, "x"), then=print))
    with pytest.raises(ValueError, match="invalid literal"):
        schedule.run()
    assert schedule.failed == "a root"


def test_the_longest_chain_is_the_most_urgent_and_short_stages_follow():
    def stage(name, cost, *needs):
        made = {"a": lambda: 0, "b": lambda a: 0, "c": lambda b: 0}
        return Stage(name, name, made["abc"[len(needs)]], (0.0, cost))

    every = stage("a", 5.0), stage("b", 7.0, "a"), stage("c", SHORT, "a", "b"), stage("d", 3.0)
    assert urgencies(every, True) == {
        "a": 12.0 + SHORT,
        "b": max(7.0 + SHORT, 0.0),
        "c": SOON * (12.0 + SHORT),
        "d": 3.0,
    }


def test_a_drawn_schedule_says_when_a_call_ran_and_how_busy_the_cores_were():
    spans = [
        Span("a design", 10.0, 20.0, 9.0, False),
        Span("a design", 25.0, 30.0, 5.0, False),
        Span("a page", 10.0, 11.0, 1.0, True),
    ]
    design, page, last = drawn_schedule(spans, 10.0, 30.0).splitlines()
    bar = design.split("|")[1]
    assert (bar[0], bar[len(bar) * 5 // 8], bar[-1]) == ("#", " ", "#")
    assert design.endswith("14.0 s")
    assert page.split("|")[1].strip() == "=" * (len(bar) // 20 + 1)
    assert (
        last == "20.0 s on the wall; 15.0 s of the processor in 3 calls, 0.75 cores on the average"
    )
