"""Data sets of the field: their command on small made data."""

import re

import numpy as np
import pytest
import scipy.io
from scipy.signal import lfilter

import identification as idn
from evidence import field
from evidence.field import DATA, FILES, KNOWN_SAMPLES, Way, error_of, identified, states, table
from evidence.learnt_map import filtered_input, splines
from symheli.errors import InputError


def _lpv(seed, n=600):
    rng, k = np.random.default_rng(seed), np.arange(n)
    u, p = rng.normal(size=n), np.sin(0.05 * k + seed)
    y = np.zeros(n)
    for i in range(1, n):
        y[i] = (0.6 + 0.3 * p[i - 1]) * y[i - 1] + u[i - 1]
    return field.recorded(1.0, u=u, y=y + 0.01 * rng.normal(size=n), p=p)


def test_the_degree_is_chosen_and_the_test_error_is_the_noise():
    training, test = _lpv(1), _lpv(2)
    over = ("p", -1.0, 1.0)
    way = Way("states", (*states((1,)), *states((1, 2), over)))
    found = identified(way, training, test)
    assert found.structure.basis.size == 2
    assert found.test == pytest.approx(0.01, rel=0.1)
    assert found.percent > 99.0
    constant = identified(Way("constant", states((1, 2))), training, test)
    assert constant.test > 20.0 * found.test
    assert field.described(found.structure).endswith("2 functions")


def test_outputs_behind_the_known_samples_do_not_enter_a_free_run():
    training, test = _lpv(1), _lpv(2)
    model = idn.fit(states((1,), ("p", -1.0, 1.0))[0], training)
    other = np.where(np.arange(len(test)) < KNOWN_SAMPLES, test["y"], 7.0)
    changed = test.with_signals({"y": "1"}, y=other)
    assert np.array_equal(field.free_run(model, test), field.free_run(model, changed))
    assert error_of(model, changed) > 5.0


def test_candidates_that_the_data_do_not_determine_are_said():
    training = _lpv(1).with_signals({"u": "1"}, u=np.zeros(600))
    with pytest.raises(InputError, match="determine none of its structures"):
        identified(Way("still", states((1,))), training, training)


def test_the_input_of_a_nonlinearity_between_filters_is_found():
    u = lfilter([0.6], [1.0, -0.8], np.random.default_rng(1).normal(size=1500))
    front = lfilter([0.0, 0.05], np.poly([0.7, 0.7 + 0.37j, 0.7 - 0.37j]).real, u)
    y = lfilter([0.02], np.poly([0.8, 0.9 + 0.16j, 0.9 - 0.16j]).real, np.tanh(front))
    record = field.recorded(1.0, u=u, y=y)
    learnt = filtered_input(record, splines(5))(record)["v"]
    assert abs(np.corrcoef(learnt, front)[0, 1]) > 0.999
    assert abs(np.corrcoef(learnt, u)[0, 1]) < 0.9


def test_a_missing_file_is_said_with_its_address(tmp_path, monkeypatch):
    def unreachable(*_, **__):
        raise OSError("no network")

    monkeypatch.setattr("urllib.request.urlopen", unreachable)
    with pytest.raises(InputError, match=r"wiener-hammerstein\.mat is not in .*LPV_SysId"):
        DATA["wiener-hammerstein"].load(tmp_path)


def test_files_are_read_into_training_and_test(tmp_path, monkeypatch):
    def made(file, folder):
        path = folder / file.name
        if "gyroscope" in file.name:
            p = np.tile([1.0, 40.0, 0.1], (30, 1))
            scipy.io.savemat(path, {"exp_u": np.ones((30, 1)), "exp_p": p, "exp_y": np.eye(30, 1)})
        else:
            ramp = np.arange(188000.0)[:, None]
            scipy.io.savemat(path, {"uBenchMark": ramp, "yBenchMark": -ramp})
        return path

    monkeypatch.setattr(field, "fetched", made)
    training, _ = DATA["gyroscope"].load(tmp_path)
    assert training.dt == pytest.approx(0.01)
    assert (training["w"][0], training["sine"][0], training["y"][0]) == (40.0, 0.1, 1.0)
    training, test = DATA["wiener-hammerstein"].load(tmp_path)
    assert (len(training), len(test)) == (100000, 78800)
    assert (training["u"][0], test["y"][0]) == (5200.0, -105200.0)


def test_a_table_has_the_published_errors_beside_the_measured_ones(monkeypatch, tmp_path):
    small = field.DataSet(
        "Made",
        "mV",
        1000.0,
        lambda _: (_lpv(1), _lpv(2)),
        (Way("states", states((1,), ("p", -1.0, 1.0))),),
        (("another", 12.0, 99.0),),
    )
    monkeypatch.setitem(DATA, "made", small)
    text = table("made", list(field.rows("made", tmp_path)))
    assert "in mV" in text
    assert re.search(
        r"\| states \| order 1, 2 functions \| 600 \| [\d.]+ \| (9|10|11)\.\d+ \|", text
    )
    assert "| published: another |  |  |  | 12.00 | 99.00 |  |" in text


def test_files_have_a_commit_and_a_checksum():
    for file in FILES.values():
        assert (len(file.commit), len(file.sha256)) == (40, 64)
