"""Campaigns: the same numbers wherever they run, nothing finished is lost, a failure is a row."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import CancelledError, Future
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from campaign_trials import DEADLY, PENDULUM, pendulum

from studies import cli
from studies.campaigns.campaign import Campaign, Normal, Uniform
from studies.campaigns.campaign_file import campaign_of, read_campaign
from studies.campaigns.dataset import CampaignDataset
from studies.campaigns.run import columns_of, run
from studies.campaigns.runners import Cluster, Here, InProcesses, Runner, results, runner
from studies.campaigns.summary import table
from studies.campaigns.trial import Trial
from studies.campaigns.trials import NAMES, trial
from symheli.errors import DataWarning, InputError, SymheliError, UnknownNameError

HERE = Path(__file__).parent
PATHS = (str(HERE), str(HERE.parents[1]))
LENGTHS = [0.5, 1.0, 2.0]


def asked(**changes):
    options = {"grid": {"length": LENGTHS, "kind": ["rod", "bob"]}, "draws": 3} | changes
    return Campaign(PENDULUM, **options)


def seeds_of(campaign):
    return {
        (case.parameters["length"], i // 6): case.parameters["seed"]
        for i, case in enumerate(campaign.cases)
        if case.parameters["kind"] == "rod"
    }


@pytest.fixture
def importable(monkeypatch):
    """Workers find the trials of the tests."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(PATHS))


# --- what is declared ----------------------------------------------------------------------------


def test_a_case_has_its_seed_and_draws_from_what_it_is_and_not_from_its_place():
    one = asked(random={}, draws=2)
    other = asked(grid={"kind": ["bob", "rod"], "length": [2.0, 7.0, 0.5]}, draws=4)
    seeds, found = (
        {(c.parameters["length"], c.parameters["kind"], c.parameters["seed"]) for c in x.cases}
        for x in (one, other)
    )
    shared = {s for s in seeds if s[0] != 1.0}
    assert len(shared) == 8
    assert shared <= found
    assert len({seed for *_, seed in found}) == len(other.cases)
    drawn = Campaign(PENDULUM, random={"length": Uniform(1.0, 2.0)}, draws=50)
    more = Campaign(PENDULUM, random={"length": Uniform(1.0, 2.0)}, draws=60)
    lengths = [case.parameters["length"] for case in more.cases]
    assert lengths[:50] == [case.parameters["length"] for case in drawn.cases]
    assert len(set(lengths)) == 60
    assert 1.0 <= min(lengths) < 1.3 < 1.7 < max(lengths) <= 2.0


def test_paired_axes_share_their_draws_and_another_root_has_others():
    paired = asked(paired=["length", "kind"], random={})
    by_draw = [{c.parameters["seed"] for c in paired.cases[i : i + 6]} for i in (0, 6, 12)]
    assert [len(seeds) for seeds in by_draw] == [1, 1, 1]
    assert len(set.union(*by_draw)) == 3
    assert not set(seeds_of(asked()).values()) & set(seeds_of(asked(root=1)).values())


def test_a_normal_parameter_is_drawn_as_it_says():
    many = Campaign(PENDULUM, random={"length": Normal(5.0, 0.5)}, draws=400)
    lengths = np.array([case.parameters["length"] for case in many.cases])
    # four standard errors of a mean and of a deviation
    assert lengths.mean() == pytest.approx(5.0, abs=4 * 0.5 / 20)
    assert lengths.std() == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(800))


def test_parameters_of_a_case_are_drawn_independently_of_each_other():
    def plane(*, x: float = 0.0, y: float = 0.0, seed: int = 0) -> dict[str, float]:
        return {"sum": x + y}

    both = {"x": Normal(0.0, 1.0), "y": Normal(0.0, 1.0)}
    many = Campaign(Trial(plane, {"sum": "1"}), random=both, draws=400)
    x, y = ([case.parameters[name] for case in many.cases] for name in ("x", "y"))
    # four standard errors of the correlation of independent draws
    assert abs(np.corrcoef(x, y)[0, 1]) < 4 / np.sqrt(400)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"grid": {"lenght": [1.0]}}, "did you mean 'length'"),
        ({"grid": {"length": ["long"]}}, "is a float, such as 1.0; got 'long'"),
        ({"grid": {"length": []}}, "needs a list of values"),
        ({"grid": {"kind": "rod"}}, "needs a list of values"),
        ({"grid": {"length": [1.0, 1.0]}}, "are the same"),
        ({"fixed": {"length": 1.0}}, "given twice"),
        ({"paired": ["seed"]}, "unknown axis"),
        ({"draws": 0}, "at least 1"),
        ({"fixed": {"seed": 3}}, "nothing is random"),
    ],
)
def test_what_does_not_fit_is_refused_when_it_is_declared(wrong, message):
    with pytest.raises(InputError, match=message):
        asked(**wrong)


def test_a_trial_says_what_it_lacks():
    def lacking(length):
        return {}

    with pytest.raises(InputError, match="give length a default"):
        Trial(lacking, {"x": "1"})
    for taken in ("seconds", "length"):
        with pytest.raises(InputError, match="is already a name in the dataset"):
            Trial(pendulum, {taken: "s"})


def test_a_file_declares_the_same_campaign(tmp_path):
    file = tmp_path / "pendulums.toml"
    file.write_text(
        textwrap.dedent("""
        trial = "campaign_trials:PENDULUM"
        draws = 3
        paired = ["kind"]
        [grid]
        kind = ["rod", "bob"]
        [random]
        length = { low = 1, high = 2.0 }
        """)
    )
    said = asked(grid={"kind": ["rod", "bob"]}, random={"length": Uniform(1, 2)}, paired=["kind"])
    assert read_campaign(file, allow_code=True).cases == said.cases
    for wrong, message in {
        "trial = 'pendulums'": "unknown trial 'pendulums'",
        "trial = 'campaign_trials:NONE'": "cannot be imported",
        "trial = 'campaign_trials:pendulum'": "is no Trial",
        "draws = 3": "the trial is missing",
        "trial = 'gain'\ngird = 3": "did you mean 'grid'",
        "trial = 'gain'\ngrid = 3": "is a table",
        "trial = 'gain'\n[random]\nrate = 3": "drawn evenly",
        "trial = ": "cannot be read as TOML",
    }.items():
        file.write_text(wrong)
        with pytest.raises(InputError, match=message) as error:
            read_campaign(file, allow_code=True)
        assert str(file) in str(error.value)


@pytest.mark.parametrize("name", NAMES)
def test_every_trial_that_has_a_name_says_what_it_gives(name):
    found = trial(name)
    assert found.quantities
    assert len(campaign_of({"trial": name}).cases) == 1


def test_the_campaigns_of_the_page_can_be_run(tmp_path):
    page = (HERE.parents[1] / "docs" / "campaigns.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```toml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    for k, text in enumerate(shown):
        file = tmp_path / f"{k}.toml"
        file.write_text(text, encoding="utf-8")
        assert len(read_campaign(file).cases) > 1
    assert len(shown) == 3


# --- what is kept --------------------------------------------------------------------------------


def test_a_failed_case_is_a_row_with_its_reason(tmp_path):
    campaign = asked(grid={"length": [1.0, -1.0]}, draws=2)
    with Here() as here:
        dataset = run(campaign, tmp_path / "c.zarr", here)
        assert dataset.finished.all()
        assert dataset.reasons == dict.fromkeys((1, 3), "ValueError: no pendulum is -1 m long")
        assert np.isfinite(dataset["period"]).tolist() == [True, False] * 2
        assert "failed: 2 x ValueError" in table(campaign, dataset)
        with pytest.raises(SymheliError, match=r"2 of 4 cases failed; the first, .*no pendulum"):
            columns_of(campaign, here)


def test_numbers_a_trial_does_not_declare_are_a_failure(tmp_path):
    odd = Trial(pendulum, {"perod": "s"})
    with Here() as here:
        dataset = run(Campaign(odd), tmp_path / "c.zarr", here)
    assert "unknown quantity 'period'; did you mean 'perod'" in dataset.reasons[0]


def test_a_second_run_computes_only_what_is_missing_and_a_larger_one_only_what_is_new(tmp_path):
    path = tmp_path / "c.zarr"
    with Here() as here:
        run(asked(), path, here)
        stamps = {p: p.stat().st_mtime_ns for p in (path / "values").glob("[0-9]*")}
        larger = asked(draws=4, grid={"kind": ["bob", "rod"], "length": [3.0, *LENGTHS]})
        dataset = run(larger, path, here)
    assert len(stamps) == 18
    assert all(p.stat().st_mtime_ns == stamp for p, stamp in stamps.items())
    assert len(dataset) == len(larger.cases) == 32
    with Here() as here:
        fresh = run(larger, tmp_path / "fresh.zarr", here)
    np.testing.assert_array_equal(
        dataset["period"][dataset.rows_of(larger.cases)],
        fresh["period"][fresh.rows_of(larger.cases)],
    )


def test_failed_cases_are_computed_again_only_where_asked(tmp_path):
    folder = tmp_path / "calls"
    folder.mkdir()
    campaign = Campaign(PENDULUM, grid={"length": [-1.0, 1.0]})
    for again, calls in ((False, 2), (False, 0), (True, 1)):
        counting = Counting()
        run(campaign, tmp_path / "c.zarr", counting, again=again)
        assert counting.calls == calls


class Counting(Here):
    calls = 0

    def submit(self, fn, /, *args, **kwargs):
        self.calls += 1
        return super().submit(fn, *args, **kwargs)


def test_other_campaigns_and_other_files_are_not_mixed_in(tmp_path):
    path, mine = tmp_path / "c.zarr", tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    other = Trial(pendulum, {"period": "min", "bob": "kg"})
    with Here() as here:
        run(asked(), path, here)
        with pytest.raises(InputError, match="holds cases of campaign_trials:pendulum, not of"):
            run(Campaign(DEADLY), path, here)
        with pytest.raises(InputError, match="with other parameters or quantities"):
            run(Campaign(other), path, here)
        with pytest.raises(InputError, match="exists and does not hold a campaign"):
            run(asked(), mine, here)
    assert [p.name for p in mine.iterdir()] == ["thesis.tex"]
    with pytest.raises(InputError, match="not a dataset of a campaign"):
        CampaignDataset(mine)
    with pytest.raises(UnknownNameError, match="did you mean 'period'"):
        CampaignDataset(path)["perod"]


def test_cases_of_other_code_are_said_to_be(tmp_path, monkeypatch):
    with Here() as here:
        run(asked(draws=1), tmp_path / "c.zarr", here)
        monkeypatch.setattr("studies.campaigns.run.code_digest", lambda: "0" * 64)
        with pytest.warns(DataWarning, match="6 cases there were computed by other code"):
            run(asked(), tmp_path / "c.zarr", here)


def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path, monkeypatch):
    path, fsync, calls = tmp_path / "c.zarr", os.fsync, []

    def full(handle):
        calls.append(handle)
        if len(calls) > 8:
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", full)
    with Here() as here, pytest.raises(SymheliError, match="the disk is full"):
        run(asked(), path, here)
    monkeypatch.undo()
    there = CampaignDataset(path).finished
    assert 0 < there.sum() < 18
    with Here() as here:
        dataset = run(asked(), path, here)
        whole = run(asked(), tmp_path / "whole.zarr", here)
    np.testing.assert_array_equal(dataset["period"], whole["period"])


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with Here() as here, pytest.raises(SymheliError, match="cannot be written"):
        run(asked(), tmp_path / "file" / "c.zarr", here)


@pytest.mark.slow
def test_the_dataset_is_read_by_xarray_and_pandas(tmp_path, pd):
    pytest.importorskip("zarr", reason="needs zarr: pip install 'symheli[campaigns]'")
    xarray = pytest.importorskip("xarray")
    campaign = asked(grid={"length": [*LENGTHS, -1.0], "kind": ["rod", "bob"]})
    with Here() as here:
        dataset = run(campaign, tmp_path / "c.zarr", here)
    opened = xarray.open_zarr(tmp_path / "c.zarr")
    assert set(opened.coords) == {"length", "kind", "seed", "quantity", "unit"}
    assert opened["values"].sel(quantity="period").unit == "s"
    named = opened["values"].to_dataset("quantity")
    np.testing.assert_array_equal(named["period"], dataset["period"])
    medians = named["period"].compute().groupby("length").median()
    # T = 2 pi sqrt(l / g), its scatter half that of g, 1 %: medians of six within 2 %
    expected = 2 * np.pi * np.sqrt(np.array(LENGTHS) / 9.81)
    np.testing.assert_allclose(medians.sel(length=LENGTHS), expected, rtol=0.02)
    np.testing.assert_array_equal(opened["reason"] != "", np.isnan(dataset["period"]))
    own = dataset.to_xarray()
    assert own["period"].attrs["units"] == "s"
    frame = dataset.to_frame()
    assert list(frame) == ["length", "kind", "seed", "period", "bob", "seconds", "reason"]
    assert frame.groupby("kind")["bob"].count().to_dict() == {"bob": 9, "rod": 0}


@pytest.fixture
def declared(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pendulums.toml").write_text(
        'trial = "campaign_trials:PENDULUM"\n[grid]\nlength = [1.0, -1.0]\nkind = ["rod", "bob"]\n'
    )
    return ["campaign", "pendulums.toml", "--allow-code", "--workers", "1"]


def test_the_command_runs_a_file_and_shows_medians_and_failures(declared, capsys):
    assert cli.main([*declared, "--show", "period"]) == 0
    out = capsys.readouterr().out
    rows = [line.split() for line in out.splitlines()[1:7]]
    assert rows[0] == ["length", "kind", "cases", "period"]
    assert rows[2][:3] == ["1.0", "rod", "1/1"]
    assert 1.9 < float(rows[2][3]) < 2.1
    assert rows[4][:3] == ["-1.0", "rod", "0/1"]
    assert "failed: 2 x ValueError: no pendulum is -1 m long" in out
    assert "every case: pendulums.zarr" in out
    assert cli.main([*declared, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == 2
    assert found["cases"][0]["parameters"]["length"] == 1.0
    assert found["units"] == {"period": "s", "bob": "kg", "seconds": "s"}


def test_a_campaign_of_which_nothing_came_fails(declared):
    Path("pendulums.toml").write_text(
        'trial = "campaign_trials:PENDULUM"\n[fixed]\nlength = -1.0\n'
    )
    assert cli.main(declared) == 1


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--seeds", "3"], "apply to the built-in campaign"),
        (["--show", "perod"], "did you mean 'period'"),
    ],
)
def test_options_that_do_not_belong_to_a_file_are_refused(declared, more, message, capsys):
    assert cli.main([*declared, *more]) == 1
    assert message in capsys.readouterr().err
    assert cli.main(["campaign", "--again"]) == 1


# --- where it runs -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster():
    """Of two workers, which find the trials of the tests."""
    pytest.importorskip("distributed", reason="needs dask: pip install 'symheli[campaigns]'")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(PATHS))
        with Cluster.local(2) as on:
            yield on


def same_numbers(tmp_path, on):
    with Here() as here:
        expected = run(asked(), tmp_path / "here.zarr", here).values[:, :-1]
    found = run(asked(), tmp_path / "there.zarr", on).values[:, :-1]
    np.testing.assert_array_equal(found, expected)


def deaths(tmp_path, on, count):
    """Eight cases, under the fourth of which so many processes end; reasons of those that fail."""
    folder = tmp_path / "calls"
    folder.mkdir()
    fixed = {"folder": str(folder), "deaths": count}
    campaign = Campaign(DEADLY, grid={"number": range(8)}, fixed=fixed)
    dataset = run(campaign, tmp_path / "deaths.zarr", on)
    assert dataset.finished.all()
    good = [k for k in range(8) if k not in dataset.reasons]
    np.testing.assert_array_equal(dataset["square"][good], np.square(good))
    return dataset.reasons


@pytest.mark.slow
def test_a_cluster_gives_the_numbers_of_one_process(tmp_path, cluster):
    same_numbers(tmp_path, cluster)


@pytest.mark.slow
def test_a_worker_killed_under_a_case_costs_nothing(tmp_path, cluster):
    assert not deaths(tmp_path, cluster, 1)


@pytest.mark.slow
def test_a_case_that_ends_every_worker_is_a_row_with_its_reason(tmp_path, cluster):
    assert [(k, why[:12]) for k, why in deaths(tmp_path, cluster, 99).items()] == [
        (3, "KilledWorker")
    ]


@pytest.mark.slow
def test_workers_fly_and_identify_the_numbers_of_one_process(tmp_path, cluster):
    declared = {
        "trial": "identification",
        "grid": {"order": [2, 3]},
        "random": {"noise_db": {"low": 20.0, "high": 40.0}},
        "fixed": {"ramps": 2, "axis": "lateral"},
    }
    with Here() as here:
        one, many = (
            run(campaign_of(declared), tmp_path / f"{kind}.zarr", on).values[:, :-1]
            for kind, on in (("here", here), ("cluster", cluster))
        )
    assert np.isfinite(one).any(axis=1).all()
    np.testing.assert_array_equal(many, one)


@pytest.mark.slow
def test_processes_do_the_same_without_a_cluster(tmp_path, importable):
    with InProcesses(2) as on:
        same_numbers(tmp_path, on)
        assert not deaths(tmp_path, on, 1)
    (tmp_path / "again").mkdir()
    with InProcesses(2) as on:
        assert "has ended" in deaths(tmp_path / "again", on, 99)[3]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["Cluster.local"])
def test_a_killed_campaign_goes_on_where_it_was(tmp_path, importable, kind):
    if kind != "Here":
        pytest.importorskip("distributed", reason="needs dask: pip install 'symheli[campaigns]'")
    calls, path = tmp_path / "calls", tmp_path / "c.zarr"
    calls.mkdir()
    fixed = {"folder": str(calls), "pause": 0.05}
    script = f"""
        from campaign_trials import DEADLY
        from studies.campaigns.campaign import Campaign
        from studies.campaigns.run import run
        from studies.campaigns.runners import Cluster, Here

        if __name__ == "__main__":
            campaign = Campaign(DEADLY, grid={{"number": range(400)}}, fixed={fixed!r})
            with {kind}({"" if kind == "Here" else 2}) as on:
                run(campaign, {str(path)!r}, on)
    """
    file = tmp_path / "script.py"
    file.write_text(textwrap.dedent(script))
    process = subprocess.Popen([sys.executable, file], stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 60
        while len(list((path / "values").glob("[0-9]*"))) < 5:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    kept = CampaignDataset(path)
    there = np.flatnonzero(kept.finished)
    assert 5 <= len(there) < 400
    np.testing.assert_array_equal(kept["square"][there], np.square(there))
    time.sleep(0.5)  # workers end with whom they work for
    before = set(os.listdir(calls))
    again = Campaign(
        DEADLY, grid={"number": range(int(there.max()) + 3)}, fixed=fixed | {"pause": 0.0}
    )
    assert not {case.key for case in again.cases} & {case.key for case in kept.cases}
    same = Campaign(DEADLY, grid={"number": range(int(there.max()) + 3)}, fixed=fixed)
    with Here() as here:
        dataset = run(same, path, here)
    assert dataset.finished[: len(same.cases)].all()
    new = {int(name.split("-")[0]) for name in set(os.listdir(calls)) - before}
    assert not new & set(there.tolist())


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    pytest.importorskip("distributed", reason="needs dask: pip install 'symheli[campaigns]'")
    monkeypatch.setattr("studies.campaigns.runners.SCHEDULER_TIMEOUT", 0.2)
    with pytest.raises(InputError, match=r"no scheduler .* answers at 'tcp://127\.0\.0\.1:9'"):
        runner(scheduler="tcp://127.0.0.1:9")


def test_the_workers_of_a_scheduler_that_is_there_are_asked(importable):
    distributed = pytest.importorskip("distributed", reason="needs dask")
    with distributed.LocalCluster(
        n_workers=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
    ) as there:
        with runner(scheduler=there.scheduler_address) as on:
            assert columns_of(asked(draws=1), on)["period"].shape == (6,)
        assert there.scheduler.status.name == "running"  # it is not ours to end


def test_a_scheduler_that_is_gone_is_said():
    class Gone(Runner):
        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with Gone() as gone, pytest.raises(SymheliError, match="the scheduler has stopped") as error:
        columns_of(asked(), gone)
    assert isinstance(error.value.__cause__, CancelledError)


def test_without_dask_processes_go_on_and_it_is_said(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with runner(2) as on:
        assert isinstance(on, InProcesses)
        said = capsys.readouterr().err
        assert "needs distributed: pip install 'symheli[campaigns]'" in said
        assert "in 2 processes of this machine" in said
    with runner(1) as on:
        assert isinstance(on, Here)
    with pytest.raises(InputError, match=r"symheli\[campaigns\]"):
        runner(scheduler="tcp://127.0.0.1:9")


def test_what_another_process_cannot_find_is_refused():
    def own():
        return {}

    with InProcesses(2) as on, pytest.raises(InputError, match="define its function in a module"):
        columns_of(Campaign(Trial(own, {"x": "1"})), on)


def test_results_come_in_the_order_of_the_calls():
    class Backwards(Runner):
        """The last of six calls is done first."""

        window = 6

        def __init__(self):
            self.calls = []

        def submit(self, fn, /, *args, **kwargs):
            self.calls.append((Future(), partial(fn, *args, **kwargs)))
            if len(self.calls) == 6:
                for future, call in reversed(self.calls):
                    future.set_result(call())
            return self.calls[-1][0]

    assert list(results(Backwards(), [partial(pow, 2, k) for k in range(6)])) == [
        1,
        2,
        4,
        8,
        16,
        32,
    ]
    with Here() as on, pytest.raises(ValueError, match="invalid literal"):
        list(results(on, [partial(int, "x")]))
