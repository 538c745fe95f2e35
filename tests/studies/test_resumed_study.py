"""A study that was stopped goes on from its stored stages, and from none that is not what it would
compute.
"""

from __future__ import annotations

import json
from dataclasses import fields, replace
from functools import cache, partial, wraps
from pathlib import Path

import pytest

from studies.campaigns.runners import Here
from studies.setup import stored_stages
from studies.setup.questions import Questions
from studies.setup.stored_stages import NotUsable, Stored, StoredStages, content_key
from studies.transition import stages, study
from studies.transition.configuration import Configuration
from studies.transition.effort import Effort
from studies.transition.outcome import Outcome
from studies.transition.recovery import Recoveries
from studies.transition.stage_keys import stage_keys
from symheli import Helicopter
from symheli.errors import InputError
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

FIRST = ("baseline", "paper_experiment", "exact_recovery")
"""The stages that are quick."""


def run(out, *, resume=False, **entries):
    """A quick study into this folder."""
    asked = Configuration.of({"quick": True, "out": out, **entries})
    return study.run_study(asked, resume=resume)


@cache
def vehicle(name):
    return Helicopter.load(name, governor="ideal")


def helicopter(configuration):
    """That of a run, which every run of these tests takes."""
    return vehicle(configuration.vehicle)


@pytest.fixture
def short(monkeypatch):
    """A study of the first stages only, in this process and without figures; what is computed is
    counted.
    """
    counted, whole = [], study.stages

    def counting(stage):
        @wraps(stage.compute)
        def compute(**given):
            counted.append(stage.name)
            return stage.compute(**given)

        return replace(stage, compute=compute)

    def first(effort):
        return tuple(counting(stage) for stage in whole(effort) if stage.name in FIRST)

    monkeypatch.setattr(study, "stages", first)
    monkeypatch.setattr(study, "loaded", helicopter)
    monkeypatch.setattr(study, "Processes", Here)
    monkeypatch.setattr(study, "figures", lambda _: ())
    return counted


def alone(monkeypatch):
    """Stages that find no results of a study: in this process, and nothing is written of them."""
    monkeypatch.setattr(study, "Processes", Here)
    for name in ("write_page", "write_results"):
        monkeypatch.setattr(study, name, lambda *_: None)
    monkeypatch.setattr(study, "figures", lambda _: ())


@pytest.fixture
def stopped(short, tmp_path, monkeypatch):
    """The folder of a study that was interrupted in its third stage."""

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as once:
        once.setattr(stages, "recover_at", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path)
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
    assert sorted(p.name for p in stopped.iterdir()) == [
        "report.html",
        "results.json",
        "stages",
        "study.toml",
    ]
    assert sorted(p.name for p in (stopped / "stages").iterdir()) == [
        "baseline.stage",
        "paper_experiment.stage",
    ]


def test_it_goes_on_with_the_stage_that_was_interrupted(stopped, short, capsys):
    before = results(stopped)
    done = run(stopped, resume=True)
    assert short == ["exact_recovery"]
    after = results(stopped)
    assert after["complete"]
    for key in ("baseline", "paper_experiment"):
        assert after[key] == before[key]
        assert after["stage_time"][key] == before["stage_time"][key]
    assert max(run.A_error for run in done.exact_recovery.runs) < 1e-9
    assert capsys.readouterr().err.count("taken from") == 2


@pytest.mark.slow
def test_without_being_asked_it_begins_anew(stopped, short):
    run(stopped)
    assert tuple(short) == FIRST


def test_the_whole_study_takes_from_a_look_what_reads_nothing_of_the_effort(stopped, short):
    assert run(stopped, resume=True, quick=False).complete
    assert short == ["exact_recovery"]


@pytest.mark.slow(but="{'seed': 1}")
@pytest.mark.parametrize("other", [{"seed": 1}, {"vehicle": "xcell_kahn_hudson"}], ids=str)
def test_stages_of_another_seed_or_vehicle_are_computed_again(stopped, short, capsys, other):
    run(stopped, resume=True, **other)
    assert tuple(short) == FIRST
    said = capsys.readouterr().err
    assert said.count("of another version, vehicle, effort or seed: not taken") == 2


@pytest.mark.slow
def test_stages_of_other_code_are_computed_again(stopped, short, monkeypatch):
    monkeypatch.setattr(stored_stages, "code_digest", lambda: "another day")
    run(stopped, resume=True)
    assert tuple(short) == FIRST


@pytest.mark.slow(but="foreign")
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
    run(stopped, resume=True)
    assert tuple(short) == ("baseline", "exact_recovery")
    assert "baseline.stage is damaged" in capsys.readouterr().err
    short.clear()
    run(stopped, resume=True)
    assert not short  # what was computed again was stored again


def test_a_stage_under_the_name_of_another_is_refused(tmp_path):
    stored = StoredStages(tmp_path, {"baseline": "key", "servo": "another key"})
    stored.save("baseline", Stored(result=Recoveries(runs=()), seconds=1.0))
    assert stored.load("baseline").seconds == 1.0
    assert stored.load("servo") is None
    stored.path("baseline").rename(stored.path("servo"))
    with pytest.raises(NotUsable, match="is of another stage"):
        stored.load("servo")


def test_the_key_is_that_of_the_content(ideal, pi):
    own = content_key(ideal, "xcell60", 0)
    assert own == content_key(ideal, "xcell60", 0)
    others = (pi, "xcell60", 0), (ideal, "my.toml", 0), (ideal, "xcell60", 1)
    assert len({own, *(content_key(*other) for other in others)}) == 4


def test_the_digest_of_the_code_is_that_of_the_packaged_vehicles_too(monkeypatch):
    """One of them simulates the flights that another is identified from."""
    before, read = stored_stages.code_digest.__wrapped__(), Path.read_bytes

    def changed(path):
        return read(path) + (b"# a change" if path.suffix == ".toml" else b"")

    monkeypatch.setattr(Path, "read_bytes", changed)
    assert stored_stages.code_digest.__wrapped__() != before


AFTER_KINEMATICS = {"robust", "controllers", "flown_controllers", "certified_controllers"}


@pytest.mark.parametrize(
    ("change", "reached"),
    [
        ({"servo_rates": (0.0, 3.1)}, {"servo"}),
        ({"exact_rates": (0.0, 1.0)}, {"gust"}),
        ({"search": replace(LowerBoundSearch(), nodes=99)}, {"gust"}),
        ({"longitudinal_rates": (0.0, 3.1)}, {"longitudinal"}),
        ({"gust_segments": (16, 32)}, {"gust", "longitudinal"}),
        ({"robust_form": Spline(segments=(9,))}, {"robust"}),
        ({"controller_seeds": 21}, {"flown_controllers"}),
        ({"design_points": 13}, AFTER_KINEMATICS - {"robust"}),
        ({"aggressive": 100.0}, {"known_kinematics", "real_conditions"} | AFTER_KINEMATICS),
        ({"gentle_flight": False}, {"known_kinematics"} | AFTER_KINEMATICS),
        ({"ramps": 11}, {"flights", "identification", "comparison", "servo"}),
        ({"thorough": False}, {"gust", "servo", "robust"}),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_changed_entry_changes_the_keys_of_the_stages_it_reaches(change, reached):
    def keys(effort):
        return stage_keys(stages.stages(effort), "content", effort)

    before, after = keys(Effort()), keys(replace(Effort(), **change))
    assert {name for name in before if before[name] != after[name]} == reached
    assert not before.keys() ^ after.keys()


def test_what_the_files_of_tubes_hold_decides_the_flights_that_are_compared(tmp_path):
    file = tmp_path / "tube.json"
    effort = replace(Effort(), tubes=(str(file),))
    with pytest.raises(InputError, match="cannot be read"):
        stage_keys(stages.stages(effort), "content", effort)
    found = []
    for text in ("one", "another"):
        file.write_text(text)
        found.append(stage_keys(stages.stages(effort), "content", effort))
    assert {n for n in found[0] if found[0][n] != found[1][n]} == {"flown_controllers"}


def test_every_entry_of_the_effort_is_read_by_a_stage_and_all_keys_differ():
    every = stages.stages(Effort())
    assert {name for stage in every for name in stage.reads} == {f.name for f in fields(Effort)}
    keys = stage_keys(every, "content", Effort())
    assert len(set(keys.values())) == len(every)
    assert not set(keys.values()) & set(stage_keys(every, "other code", Effort()).values())


def test_a_stage_is_given_what_its_parameters_name_and_nothing_else():
    def servo(vehicle, seed, baseline, servo_rates):
        return vehicle, seed, baseline, servo_rates

    stage = stages.Stage("servo", "A stage", servo)
    assert (stage.needs, stage.reads) == (("baseline",), ("servo_rates",))
    outcome = Outcome(vehicle="xcell60", quick=False, seed=3)
    assert stage.call(outcome, Effort())() == ("xcell60", 3, None, Effort().servo_rates)


def test_the_stages_need_earlier_ones_alone():
    there = set()
    for stage in stages.STAGES:
        assert set(stage.needs) <= there
        there.add(stage.name)
    assert there <= {f.name for f in fields(Outcome)}


def test_one_rate_changed_in_the_file_computes_only_what_it_touches(tmp_path, monkeypatch):
    """`robust` needs `servo`, `flights` neither: results are those of the file, whatever the folder
    holds.
    """
    computed = []

    def flights(ramps):
        computed.append("flights")
        return (ramps,)

    def servo(servo_rates):
        computed.append("servo")
        return (servo_rates,)

    def robust(servo):
        computed.append("robust")
        return ((), servo[0])

    every = tuple(stages.Stage(f.__name__, f.__name__, f) for f in (flights, servo, robust))
    monkeypatch.setattr(study, "stages", lambda effort: every)
    monkeypatch.setattr(study, "loaded", helicopter)
    alone(monkeypatch)
    file = tmp_path / "my.toml"

    def again(entries):
        file.write_text(f'out = "."\n[effort]\n{entries}\n')
        computed.clear()
        done = study.run_study(Configuration.read(file, {}), resume=True)
        return sorted(computed), (done.flights, done.servo, done.robust)

    first = (5,), ((0.0, 3.0),), ((), (0.0, 3.0))
    assert again("ramps = 5\nservo_rates = [0, 3]") == (["flights", "robust", "servo"], first)
    assert again("ramps = 5\nservo_rates = [0, 3]") == ([], first)
    # an entry that none of them reads
    assert again("ramps = 5\nservo_rates = [0, 3]\ngust_rates = [0, 2]") == ([], first)
    other = (5,), ((0.0, 4.0),), ((), (0.0, 4.0))
    assert again("ramps = 5\nservo_rates = [0, 4]") == (["robust", "servo"], other)
    assert again("ramps = 6\nservo_rates = [0, 4]") == (["flights"], ((6,), *other[1:]))
    # what was stored for the first file is gone, and is not taken for it
    assert again("ramps = 5\nservo_rates = [0, 3]") == (["flights", "robust", "servo"], first)


@pytest.mark.slow
def test_the_command_says_how_to_go_on(short, tmp_path, monkeypatch, capsys):
    from studies import cli

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as once:
        once.setattr(stages, "run_experiments", interrupted)
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

    def gust():
        return Questions([partial(question, k) for k in range(3)], lambda bounds: bounds)

    stage = stages.Stage("gust", "Three questions", gust)
    monkeypatch.setattr(study, "stages", lambda effort: (stage,))
    alone(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path)
    assert asked == [0, 1, 2]
    assert sorted(p.name for p in (tmp_path / "stages").iterdir()) == [
        "gust-0.stage",
        "gust-1.stage",
    ]
    done = run(tmp_path, resume=True)
    assert asked == [0, 1, 2, 2]
    assert done.gust == (0, 1, 2)
    assert [p.name for p in (tmp_path / "stages").iterdir()] == ["gust.stage"]


@pytest.mark.slow
def test_a_stage_whose_file_is_removed_is_computed_again_alone(stopped, short):
    run(stopped, resume=True)
    short.clear()
    (stopped / "stages" / "paper_experiment.stage").unlink()
    assert run(stopped, resume=True).complete
    assert short == ["paper_experiment"]


@pytest.mark.slow
def test_what_was_asked_for_is_kept_and_asks_for_the_same(short, tmp_path):
    asked = Configuration.of(
        {"quick": True, "seed": 2, "out": tmp_path, "effort": {"ramps": 7, "search": {"nodes": 50}}}
    )
    study.run_study(asked)
    again = Configuration.read(tmp_path / "study.toml", {})
    assert again == asked
    assert results(tmp_path)["effort"]["ramps"] == 7
    assert results(tmp_path)["effort"]["gust_rates"][-1] == "inf"
    short.clear()
    study.run_study(again, resume=True)
    assert not short


@pytest.mark.slow
def test_the_last_line_says_where_the_report_is(short, tmp_path, capsys):
    from studies import cli

    assert cli.main(["study", "--quick", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"report: {tmp_path / 'report.html'}"
