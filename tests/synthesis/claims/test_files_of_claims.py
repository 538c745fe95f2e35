"""Plants and claims from JSON, NPZ and MAT files, and damaged ones."""

import json
from dataclasses import fields

import numpy as np
import pytest
from scipy.io import savemat

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, SymheliError
from synthesis import Certificate
from synthesis.claims import (
    GridPlant,
    LimitedPlant,
    LyapunovClaim,
    ProvenClaim,
    RegionClaim,
    TerminalClaim,
    VertexPlant,
    check,
    read_claim,
    read_plant,
)

RNG = np.random.default_rng(0)
STACK = RNG.normal(size=(3, 2, 2)) - 3 * np.eye(2)
INTO, OUT = RNG.normal(size=(3, 2, 1)), RNG.normal(size=(3, 1, 2))


def as_json(content, path):
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in content.items()}
    path.write_text(json.dumps(plain))
    return path


def as_npz(content, path):
    np.savez(path, **{k: v for k, v in content.items() if v is not None})
    return path


def as_mat(content, path):
    """As MATLAB has it: the models along the last axis, vectors as rows, numbers 1 x 1."""
    turned = {
        k: np.moveaxis(v, 0, -1) if isinstance(v, np.ndarray) and v.ndim == 3 else v
        for k, v in content.items()
    }
    savemat(path, {k: v for k, v in turned.items() if v is not None})
    return path


WRITERS = {"json": as_json, "npz": as_npz, "mat": as_mat}


def same(one, other):
    return all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b
        for a, b in ((getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    )


@pytest.mark.parametrize("suffix", WRITERS)
def test_the_three_formats_hold_the_same_plants_and_claims(suffix, tmp_path):
    write = WRITERS[suffix]
    system = {"A": STACK, "B": INTO, "C": OUT}
    p = np.array([0.0, 1.0, 3.0])
    plants = [
        (VertexPlant(**system), system),
        (VertexPlant(STACK, dt=0.5), {"A": STACK, "dt": 0.5}),
        (GridPlant(p, **system, rate=2.0), {"p": p, **system, "rate": 2.0}),
        (
            LimitedPlant(STACK, INTO, H_x=np.eye(2), h_x=[1.0, 2.0]),
            {"A": STACK, "B": INTO, "H_x": np.eye(2), "h_x": np.array([1.0, 2.0])},
        ),
    ]
    for k, (plant, content) in enumerate(plants):
        assert same(plant, read_plant(write(content, tmp_path / f"plant{k}.{suffix}")))
    P = np.stack([np.eye(2)] * 3)
    claims = [
        (LyapunovClaim("l2 gain", P, 2.0), {"claim": "l2 gain", "P": P, "gamma": 2.0}),
        (LyapunovClaim("stability", np.eye(2), K=np.ones((1, 2))),
         {"claim": "stability", "P": np.eye(2), "K": np.ones((1, 2))}),
        (RegionClaim("x^2", 0.5), {"claim": "region of attraction", "V": "x^2", "rho": 0.5}),
        (TerminalClaim(K=np.ones((1, 2)), P=np.eye(2), level=1.0),
         {"claim": "terminal set", "K": np.ones((1, 2)), "P": np.eye(2), "level": 1.0}),
    ]  # fmt: skip
    for k, (claim, content) in enumerate(claims):
        assert same(claim, read_claim(write(content, tmp_path / f"claim{k}.{suffix}")))


def test_polynomials_of_matlab_are_cells_of_texts(tmp_path):
    f = np.array(["-y", "x + (x^2 - 1)*y"], dtype=object)
    savemat(tmp_path / "field.mat", {"states": np.array(["x", "y"], dtype=object), "f": f})
    plant = read_plant(tmp_path / "field.mat")
    assert plant.states == ("x", "y")
    assert check(plant, RegionClaim("1.5*x^2 - x*y + y^2", 2.0)).proven


def test_a_stack_that_could_be_read_both_ways_is_refused_until_the_axis_is_said(tmp_path):
    two = RNG.normal(size=(2, 2, 2))
    with pytest.raises(InputError, match="first or the last; add the key 'axis'"):
        read_plant(as_json({"A": two}, tmp_path / "a.json"))
    first = read_plant(as_json({"A": two, "axis": "first"}, tmp_path / "a.json"))
    last = read_plant(as_json({"A": two, "axis": "last"}, tmp_path / "a.json"))
    assert np.array_equal(first.A, two)
    assert np.array_equal(last.A, np.moveaxis(two, -1, 0))


BAD_PLANTS = {
    "expected the key A": {"B": [[1]]},
    "unknown keys Z": {"A": [[1]], "Z": 1},
    "N x n x n or n x n x N": {"A": np.zeros((2, 3, 4)).tolist()},
    "expected numbers": {"A": [["one"]]},
    "must be a finite number": {"A": [[1e999]]},
    "dt": {"A": [[1]], "dt": -1},
    "rate": {"A": [[[1]], [[2]]], "p": [0, 1], "rate": "fast", "axis": "first"},
    "p: expected": {"A": [[[1]], [[2]]], "p": [0, 1, 2], "axis": "first"},
    "needs A and B": {"A": [[1]], "x_max": [1]},
    "not both": {"A": [[1]], "B": [[1]], "x_max": [1], "H_x": [[1]], "h_x": [1]},
    "f: expected": {"states": ["x"], "f": ["x", "x"]},
    "axis": {"A": [[[1]], [[2]]], "axis": "middle"},
}
BAD_CLAIMS = {
    "claim: expected one of": {"P": [[1]]},
    "the key P is missing": {"claim": "stability"},
    "the key gamma is missing": {"claim": "l2 gain", "P": [[1]]},
    "gamma: expected a number": {"claim": "l2 gain", "P": [[1]], "gamma": "big"},
    "unknown keys gamma": {"claim": "stability", "P": [[1]], "gamma": 1},
    "the key rho": {"claim": "region of attraction", "V": "x"},
    "the key K": {"claim": "terminal set"},
}


@pytest.mark.parametrize("said", BAD_PLANTS)
def test_a_plant_that_is_none_is_told_with_its_file(said, tmp_path):
    with pytest.raises(InputError, match=rf"plant\.json: .*{said}"):
        read_plant(as_json(BAD_PLANTS[said], tmp_path / "plant.json"))


@pytest.mark.parametrize("said", BAD_CLAIMS)
def test_a_claim_that_is_none_is_told_with_its_file(said, tmp_path):
    with pytest.raises(InputError, match=rf"claim\.json: .*{said}"):
        read_claim(as_json(BAD_CLAIMS[said], tmp_path / "claim.json"))


@pytest.mark.parametrize("name", ["x.json", "x.npz", "x.mat"])
def test_damaged_files_are_told(name, tmp_path):
    for content in (b"", b"{", b"\x00" * 200, b"[1]", b"PK\x03\x04" + b"\x00" * 40):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name):
            read_plant(tmp_path / name)
    with pytest.raises(InputError, match="cannot be read"):
        read_plant(tmp_path / f"no{name}")
    with pytest.raises(InputError, match="expected a file"):
        read_plant(tmp_path / "x.txt")


def test_pickles_in_npz_are_not_opened(tmp_path):
    np.savez(tmp_path / "x.npz", A=np.array([{}], dtype=object))
    with pytest.raises(InputError, match="damaged"):
        read_plant(tmp_path / "x.npz")


def test_a_proof_is_saved_and_proven_again_and_a_stronger_one_is_not(tmp_path):
    found = check(VertexPlant([[-1.0]]), LyapunovClaim("decay rate", [[1.0]], 0.5))
    path = found.save(tmp_path / "proof.json")
    assert ProvenClaim.load(path).verified
    content = json.loads(path.read_text())
    content["claim"]["bound"] = 1.5
    path.write_text(json.dumps(content))
    assert not ProvenClaim.load(path).verified
    content["plant"]["type"] = "nothing"
    path.write_text(json.dumps(content))
    with pytest.raises(SymheliError, match="expected a claim"):
        ProvenClaim.load(path)
    refused = check(VertexPlant([[1.0]]), LyapunovClaim("stability", [[1.0]]))
    with pytest.raises(InputError, match="only a proof is saved"):
        refused.save(path)


def lag():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    return LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)


def test_a_p_about_a_model_is_a_certificate(tmp_path):
    found = check(lag(), LyapunovClaim("l2 gain", [[1.0]], 1.001))
    assert found.proven
    assert Certificate.load(found.save(tmp_path / "gain.json")).verify(rigorous=True)
    assert check(lag(), LyapunovClaim("l2 gain", [[1.0]], 0.99)).answer == "the claim is false"
    moving = LyapunovClaim("stability", [[[1.0]], [[3.0]]], p=[0.0, 1.0])
    assert check(lag(), moving).proven  # 2 (1 + p)(1 + 2 p) > 0.5 * 2
    steep = LyapunovClaim("stability", [[[1.0]], [[6.0]]], p=[0.0, 1.0])
    assert check(lag(), steep).answer == "this P does not prove it"  # 2 < 0.5 * 5 at p = 0


def test_a_linear_model_is_one_vertex():
    model = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    assert check(model, LyapunovClaim("l2 gain", [[1.0]], 1.001)).proven
    assert not check(model, LyapunovClaim("l2 gain", [[1.0]], 0.999)).proven


def test_points_of_p_are_refused_where_they_have_no_meaning():
    claim = LyapunovClaim("stability", [[[1.0]], [[3.0]]], p=[0.0, 1.0])
    with pytest.raises(InputError, match="for a model"):
        check(VertexPlant([[[-1.0]], [[-2.0]]], dt=1.0), claim)
    with pytest.raises(InputError, match="give p"):
        check(lag(), LyapunovClaim("stability", [[[1.0]], [[3.0]]]))
    with pytest.raises(InputError, match="close the loop"):
        check(lag(), LyapunovClaim("stability", [[1.0]], K=[[1.0]]))
