"""Identified models and families of matrices from files: certified, judged and exported."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

import identification
import symheli
import synthesis
from studies.loops.lateral import lateral_loop


@pytest.fixture(scope="module")
def family_file(tmp_path_factory, ideal):
    family = symheli.sweep(ideal, np.linspace(4.0, 9.0, 6))
    return family.save(tmp_path_factory.mktemp("family") / "family.json")


ROLL = ("--states", "v,p,r,phi,b1", "--feedback", "d_lat=phi:-0.02")


@pytest.mark.slow
def test_a_family_from_a_file_is_certified_as_the_vehicle_it_came_from(answer, family_file, ideal):
    got = answer(
        *("certify", "--model", family_file, *ROLL, "--rate", 0),
        *("--inputs", "d_lat,d_ped", "--outputs", "r,phi"),
    )
    loop = lateral_loop(ideal, 4.0, 9.0, "inputs", points=6)
    assert got["verified"]
    assert got["frozen"] == pytest.approx(synthesis.frozen_gain(loop).gain, rel=1e-6)
    assert "d_lat = -0.02 phi" in got["loop"]


def test_margins_of_a_family_from_a_file_are_those_of_its_models(answer, family_file, run):
    got = answer("margins", "--model", family_file, *ROLL, "--points", 2)
    family = symheli.LinearFamily.load(family_file).select(["v", "p", "r", "phi", "b1"])
    model = family.interpolate(degree=3).at(9.0)
    own = synthesis.margins(synthesis.analysis.open_loop(model, {("d_lat", "phi"): -0.02}, "d_lat"))
    assert got["values"] == [4.0, 9.0]
    assert got["margins"]["d_lat"][1]["phase"] == pytest.approx(own.phase, rel=1e-9)
    assert got["units"]["parameter"] == "m/s"
    status, _, err = run("margins", "--model", family_file)
    assert status == 1
    assert "--feedback" in err


@pytest.mark.slow
def test_identified_models_from_files_are_certified_and_exported(answer, run, tmp_path):
    rng = np.random.default_rng(0)
    p, u = 0.5 + 0.5 * np.sin(0.05 * np.arange(600)), rng.uniform(-1, 1, 600)
    y = np.zeros(600)
    for k in range(1, 600):
        y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1]
    record = symheli.FlightRecord.from_arrays(
        0.1 * np.arange(600), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    basis = identification.Polynomial(1, 0.0, 1.0)
    arx = identification.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis)
    path = identification.fit(arx, record).save(tmp_path / "model.json")
    got = answer("certify", "--model", path, "--rate", 0)
    # y(k) = a y(k-1) + u(k-1): the gain at zero frequency is 1/(1 - a), a = 0.8 at p = 1
    assert got["frozen"] == pytest.approx(5.0, rel=1e-6)
    assert got["verified"]
    held = answer("certify", "--model", path, "--rate", 0, "--feedback", "u=y:-0.3")
    assert held["frozen"] == pytest.approx(2.0, rel=1e-6)  # a = 0.5
    found = answer("margins", "--model", path, "--feedback", "u=y:-0.3", "--points", 2)
    # a - 1.8/0.3 u = -1: the loop is lost where the gain reaches (1 + 0.5)/0.3 at p = 0
    assert found["margins"]["u"][0]["gain"][1] == pytest.approx(5.0, rel=1e-6)
    assert answer("export", "mat", "--model", path, "--out", tmp_path / "m.mat")["written"]
    assert answer("export", "model", "--model", path, "--out", tmp_path / "c")["written"]
    status, _, err = run("certify", "--model", path, "--states", "y")
    assert status == 1
    assert "selects states of a family" in err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("certify", "--states", "v"), "give --model FILE"),
        (("certify", "--model", "FAMILY", "--channel", "gust"), "--channel"),
        (("margins", "--controller", "t.json"), "symheli specs xcell60 --controller t.json"),
        (("export", "c", "--model", "FAMILY"), "c is written for a vehicle"),
        (("export", "model", "--model", "FAMILY"), "cannot be exported as C"),
        (("certify", "--model", "nowhere.json"), "No such file"),
    ],
)
def test_what_a_model_from_a_file_cannot_be_asked_is_said(run, family_file, options, said):
    status, _, err = run(*(family_file if o == "FAMILY" else o for o in options))
    assert status == 1
    assert said in err


def test_another_file_is_no_model(run, tmp_path):
    path = tmp_path / "other.json"
    for content in ('{"schema": "another"}', "[1, 2]", "nothing"):
        path.write_text(content)
        status, _, err = run("certify", "--model", path)
        assert status == 1
        assert "LinearFamily.save" in err


def test_a_family_becomes_a_matlab_file(answer, family_file, tmp_path):
    written = answer("export", "mat", "--model", family_file, "--out", tmp_path / "f.mat")
    assert [Path(file).name for file in written["written"]] == [
        *("f.mat", "load_symheli.m", "symheli_at.m")
    ]
    content = loadmat(tmp_path / "f.mat")
    family = symheli.LinearFamily.load(family_file)
    np.testing.assert_array_equal(content["A"][:, :, 2], family.A[2])


@pytest.mark.slow
def test_many_certificates_are_verified_at_once(answer, run, tmp_path):
    proven, not_proven = tmp_path / "proven.json", tmp_path / "not.json"
    assert answer("certify", "--rate", 0, "--airspeeds", 4, 9, "--save", proven)["proof"] == str(
        proven
    )
    status, _, _ = run("certify", "--lft", "small gain", "--stability", "--save", not_proven)
    assert status == 1
    got = answer("verify", proven, proven)
    assert got["exact"]
    assert [p["file"] for p in got["proofs"]] == [str(proven)] * 2
    status, out, _ = run("verify", proven, not_proven)
    assert status == 1
    assert f"{proven}: proven in exact arithmetic" in out
    assert f"{not_proven}: not proven" in out
