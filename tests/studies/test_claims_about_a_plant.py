"""`symheli verify CLAIM --plant FILE`: answers, exit statuses, JSON, and proofs that are saved."""

import json

import pytest

from studies import cli
from symheli import LinearFamily, LinearModel
from synthesis.checker import report

SENAME = {"A": [[[0, 1], [-1, -2]], [[0, 1], [-100, -20]]], "axis": "first"}


@pytest.fixture
def files(tmp_path):
    def file(name, content):
        path = tmp_path / name
        path.write_text(json.dumps(content))
        return str(path)

    return file


def run(capsys, *arguments):
    status = cli.main(["verify", *arguments])
    return status, *capsys.readouterr()


def test_a_proof_is_told_saved_and_verified_by_both_programs(files, tmp_path, capsys):
    plant = files("plant.json", {"states": ["x"], "f": ["-x + x^3"]})
    claim = files("claim.json", {"claim": "region of attraction", "V": "x^2", "rho": 0.9})
    proof = str(tmp_path / "proof.json")
    status, out, _ = run(capsys, claim, "--plant", plant, "--save", proof)
    assert status == 0
    assert out.startswith("proven (in exact arithmetic)")
    assert f"written: {proof}" in out
    assert run(capsys, proof)[0] == 0
    assert report.main([proof]) == 0


def test_what_is_not_proven_ends_with_one_and_says_where(files, capsys):
    plant = files("plant.json", SENAME)
    claim = files("claim.json", {"claim": "stability", "P": [[2, 1], [1, 1]]})
    status, out, _ = run(capsys, claim, "--plant", plant)
    assert status == 1
    assert out.startswith("this P does not prove it")
    assert "vertex 2" in out


def test_several_claims_and_json(files, capsys):
    plant = files("plant.json", {"A": [[-1.0]], "B": [[1.0]], "C": [[1.0]]})
    gains = [files(f"{g}.json", {"claim": "l2 gain", "P": [[1.0]], "gamma": g}) for g in (1.1, 0.9)]
    status, out, _ = run(capsys, *gains, "--plant", plant, "--json")
    found = json.loads(out)
    assert status == 1
    assert not found["proven"]
    assert [c["answer"] for c in found["claims"]] == ["proven", "the claim is false"]
    status, out, _ = run(capsys, gains[0], "--plant", plant, "--json")
    assert (status, json.loads(out)["answer"]) == (0, "proven")


def test_a_model_of_a_family_is_a_plant_too(files, tmp_path, capsys):
    speeds = (0.0, 0.5, 1.0)
    models = [
        LinearModel([[-1.0 - v]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"]) for v in speeds
    ]
    family = LinearFamily.from_models(speeds, models)
    path = family.save(tmp_path / "family.json")
    claim = files("claim.json", {"claim": "l2 gain", "P": [[1.0]], "gamma": 1.01})
    arguments = (claim, "--plant", str(path), "--degree", "1")
    assert run(capsys, *arguments)[0] == 0


def test_options_that_do_not_fit_are_refused(files, capsys):
    plant = files("plant.json", SENAME)
    claim = files("claim.json", {"claim": "stability", "P": [[2, 1], [1, 1]]})
    for arguments, said in (
        ((claim, "--plant", plant, "--model", plant), "not both"),
        ((claim, claim, "--plant", plant, "--save", "x.json"), "one proof"),
        ((claim, "--save", "x.json"), "give --plant FILE"),
        ((claim, "--plant", "nothing.json"), "cannot be read"),
        ((claim,), "schema"),
    ):
        status, _, err = run(capsys, *arguments)
        assert status not in (0, 1) or err
        assert said in err
