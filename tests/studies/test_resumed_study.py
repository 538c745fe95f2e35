"""A study that was stopped goes on from its stored stages, and from none that is not what it would
compute.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import pytest

from studies.processes import Processes
from studies.transition import study
from studies.transition.effort import Effort
from studies.transition.proofs import Questions
from studies.transition.recovery import Recoveries
from studies.transition.stored_stages import NotUsable, Stored, StoredStages, content_key

FIRST = ("baseline", "paper_experiment", "exact_recovery")
"""The stages that are quick."""


@pytest.fixture
def short(monkeypatch):
    """A study of the first stages only, without pictures; what is computed is counted."""
    counted, whole = [], study.stages

    def counting(stage):
        def compute(*arguments):
            counted.append(stage.name)
            return stage.compute(*arguments)

        return replace(stage, compute=compute)

    def first(effort):
        return tuple(counting(stage) for stage in whole(effort) if stage.name in FIRST)

    monkeypatch.setattr(study, "stages", first)
    monkeypatch.setattr(study, "write_report", study.write_results)
    return counted


@pytest.fixture
def stopped(short, tmp_path, monkeypatch):
    """The folder of a study that was interrupted in its third stage."""

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as once:
        once.setattr(study, "recover_at", interrupted)
        with pytest.raises(KeyboardInterrupt):
            study.run_study(out=tmp_path, quick=True)
    short.clear()
    return tmp_path


def results(folder):
    return json.loads((folder / "results.json").read_text())


def test_an_interrupted_study_leaves_whole_results_of_its_finished_stages(stopped):
    found = results(stopped)
    assert not found["complete"]
    assert found["baseline"]["lft_order"]["value"] == 45
    assert [run["loop"] for run in found["paper_experiment"]] == ["open", "closed"]
    assert found["exact_recovery"] is None
    assert sorted(p.name for p in stopped.iterdir()) == ["results.json", "stages"]
    assert sorted(p.name for p in (stopped / "stages").iterdir()) == [
        "baseline.stage",
        "paper_experiment.stage",
    ]


def test_it_goes_on_with_the_stage_that_was_interrupted(stopped, short, capsys):
    before = results(stopped)
    done = study.run_study(out=stopped, quick=True, resume=True)
    assert short == ["exact_recovery"]
    after = results(stopped)
    assert after["complete"]
    for key in ("baseline", "paper_experiment"):
        assert after[key] == before[key]
        assert after["stage_time"][key] == before["stage_time"][key]
    assert max(run.A_error for run in done.exact_recovery.runs) < 1e-9
    assert capsys.readouterr().err.count("taken from") == 2


def test_without_being_asked_it_begins_anew(stopped, short):
    study.run_study(out=stopped, quick=True)
    assert tuple(short) == FIRST


@pytest.mark.parametrize(
    ("other", "again"),
    [({"seed": 1}, FIRST), ({"quick": False}, FIRST), ({"vehicle": "xcell_kahn_hudson"}, FIRST)],
)
def test_stages_of_another_seed_effort_or_vehicle_are_computed_again(
    stopped, short, capsys, other, again
):
    study.run_study(**{"out": stopped, "quick": True, "resume": True, **other})
    assert tuple(short) == again
    said = capsys.readouterr().err
    assert said.count("is of another version, vehicle, effort or seed: computed again") == 2


def test_stages_of_other_code_are_computed_again(stopped, short, monkeypatch):
    from studies.transition import stored_stages

    monkeypatch.setattr(stored_stages, "code_digest", lambda: "another day")
    study.run_study(out=stopped, quick=True, resume=True)
    assert tuple(short) == FIRST


@pytest.mark.parametrize("damage", ["cut", "changed", "emptied", "foreign"])
def test_a_damaged_stage_is_computed_again_and_said(stopped, short, capsys, damage):
    path = stopped / "stages" / "baseline.stage"
    content = path.read_bytes()
    path.write_bytes(
        {
            "cut": content[: len(content) // 2],
            "changed": content[:-1] + bytes([content[-1] ^ 1]),
            "emptied": b"",
            "foreign": b"a note to myself\n",
        }[damage]
    )
    study.run_study(out=stopped, quick=True, resume=True)
    assert tuple(short) == ("baseline", "exact_recovery")
    assert "baseline.stage is damaged" in capsys.readouterr().err
    short.clear()
    study.run_study(out=stopped, quick=True, resume=True)
    assert not short  # what was computed again was stored again


def test_a_stage_under_the_name_of_another_is_refused(tmp_path):
    stored = StoredStages(tmp_path, "key")
    stored.save("baseline", Stored(result=Recoveries(runs=()), seconds=1.0))
    assert stored.load("baseline", Recoveries).seconds == 1.0
    assert stored.load("servo", Recoveries) is None
    with pytest.raises(NotUsable, match="holds another stage"):
        stored.load("baseline", Effort)


def test_the_key_is_that_of_the_content(ideal, pi):
    own = content_key(ideal, Effort(), 0)
    assert own == content_key(ideal, Effort(), 0)
    others = (pi, Effort(), 0), (ideal, Effort.look(), 0), (ideal, Effort(), 1)
    assert len({own, *(content_key(*other) for other in others)}) == 4


def test_the_command_says_how_to_go_on(short, tmp_path, monkeypatch, capsys):
    from studies import cli

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as once:
        once.setattr(study, "run_experiments", interrupted)
        assert cli.main(["study", "--quick", "--out", str(tmp_path)]) == 130
    assert "--resume goes on from there" in capsys.readouterr().err
    short.clear()
    assert cli.main(["study", "--quick", "--out", str(tmp_path), "--resume", "--json"]) == 0
    assert short == ["paper_experiment", "exact_recovery"]
    assert json.loads(capsys.readouterr().out)["complete"]


def test_proofs_that_were_found_are_not_proven_again(tmp_path, monkeypatch):
    """A stage of questions that is stopped keeps its answers; the next run asks the others."""
    asked = []

    def question(k):
        asked.append(k)
        if k == 2 and asked.count(2) == 1:
            raise KeyboardInterrupt
        return [k]

    stage = study.Stage(
        "gust",
        "Three questions",
        tuple,
        (),
        lambda *_: Questions([partial(question, k) for k in range(3)], lambda bounds: bounds),
        asks=True,
    )
    monkeypatch.setattr(study, "stages", lambda effort: (stage,))
    monkeypatch.setattr(study, "Processes", lambda: Processes(1))
    for name in ("write_report", "write_results"):
        monkeypatch.setattr(study, name, lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        study.run_study(out=tmp_path, quick=True)
    assert asked == [0, 1, 2]
    assert sorted(p.name for p in (tmp_path / "stages").iterdir()) == [
        "gust-0.stage",
        "gust-1.stage",
    ]
    done = study.run_study(out=tmp_path, quick=True, resume=True)
    assert asked == [0, 1, 2, 2]
    assert done.gust == (0, 1, 2)
    assert [p.name for p in (tmp_path / "stages").iterdir()] == ["gust.stage"]
