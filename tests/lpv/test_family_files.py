"""Families of matrices travel as plain files, and what is wrong with one is said."""

import json

import numpy as np
import pytest

import symheli
from symheli.errors import InputError
from symheli.lpv import LinearFamily, LinearGrid

BY_HAND = {
    "schema": "symheli linear models",
    "version": 1,
    "axes": [{"name": "airspeed", "unit": "m/s", "values": [0, 10]}],
    "states": {"v": "m/s", "p": "rad/s"},
    "inputs": ["d_lat"],
    "A": [[[-0.1, 0], [-0.2, -3]], [[-0.2, 0], [-0.4, -4]]],
    "B": [[[0], [50]], [[0], [60]]],
}


@pytest.fixture(scope="module")
def family(ideal):
    return symheli.sweep(ideal, [6.0, 8.0, 10.0]).select(["v", "p", "r"], ["d_lat", "d_ped"])


def same(one, other):
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for group in ("states", "inputs", "outputs"):
        assert getattr(one, group) == getattr(other, group)
        assert [s.unit for s in getattr(one, group)] == [s.unit for s in getattr(other, group)]
    assert one.dt == other.dt


@pytest.mark.parametrize("ending", ["json", "npz"])
def test_a_family_comes_back_to_the_last_bit_with_its_trims(family, tmp_path, ending):
    for made in (family, family.discretize(0.02)):
        back = LinearFamily.load(made.save(tmp_path / f"family.{ending}"))
        same(back, made)
        np.testing.assert_array_equal(back.airspeeds, made.airspeeds)
        assert dict(back.kinks) == dict(made.kinks) != {}
        for part in ("state", "rate"):
            np.testing.assert_array_equal(
                getattr(back.trims, part)(made.states), getattr(made.trims, part)(made.states)
            )
        np.testing.assert_array_equal(back.trims.input(made.inputs), made.trims.input(made.inputs))
        assert [t.airspeed for t in back.trims] == [t.airspeed for t in made.trims]


@pytest.mark.parametrize("ending", ["json", "npz"])
def test_a_grid_comes_back_and_is_no_family(ideal, tmp_path, ending):
    grid = symheli.sweep_grid(ideal, [6.0, 8.0], acceleration=[-1.0, 0.0, 1.0])
    path = grid.save(tmp_path / f"grid.{ending}")
    back = LinearGrid.load(path)
    same(back, grid)
    assert back.axes == grid.axes
    assert back.trim(1, 2).x["theta"] == grid.trim(1, 2).x["theta"]
    with pytest.raises(InputError, match=r"airspeed .*acceleration .*LinearGrid\.load"):
        LinearFamily.load(path)


def test_a_file_written_by_hand_needs_names_a_and_b(tmp_path):
    path = tmp_path / "hand.json"
    path.write_text(json.dumps(BY_HAND))
    family = LinearFamily.load(path)
    assert family.outputs == family.states == ("v", "p")
    assert family.inputs[0].unit == "rad"
    np.testing.assert_array_equal(family.C, np.tile(np.eye(2), (2, 1, 1)))
    assert not np.any(family.D)
    assert not len(family.trims)
    assert family.interpolate(degree=1).at(5.0).A[1, 0] == pytest.approx(-0.3, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema": "another"}, "expected a file of 'symheli linear models', got 'another'"),
        ({"version": 2}, "version 2 of the format, this reads 1"),
        ({"A": "none"}, "A: expected numbers"),
        ({"A": BY_HAND["A"][:1]}, r"A: expected shape \(2, 2, 2\), got \(1, 2, 2\)"),
        ({"B": [[[0], [np.inf]], [[0], [60]]]}, "B: entry .* is inf"),
        ({"states": "v p"}, "states: expected {name: unit}"),
        ({"axes": [{"name": "airspeed"}]}, "axes: expected {name, unit, values}"),
        ({"axes": []}, "expected values for each of the axes"),
        ({"outputs": {"phi": "rad"}}, "C: missing"),
        ({"kinks": [7.0]}, "kinks: expected"),
        ({"x0": [[0, 0]], "u0": [[0], [0]]}, "x0: expected shape"),
        ({"dt": -0.1}, "dt: expected a number > 0"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, change, said):
    path = tmp_path / "hand.json"
    path.write_text(json.dumps({**BY_HAND, **change}))
    with pytest.raises(InputError, match=said) as error:
        LinearFamily.load(path).interpolate(degree=1)
    assert str(path) in str(error.value) or "dt" in change


def test_a_missing_or_damaged_file_is_refused(tmp_path, family):
    with pytest.raises(InputError, match="cannot be read"):
        LinearFamily.load(tmp_path / "none.json")
    for name in ("broken.json", "broken.npz"):
        (tmp_path / name).write_bytes(b"{")
        with pytest.raises(InputError, match="not a whole file"):
            LinearFamily.load(tmp_path / name)
    without = {k: v for k, v in BY_HAND.items() if k != "B"}
    (tmp_path / "b.json").write_text(json.dumps(without))
    with pytest.raises(InputError, match="B: missing"):
        LinearFamily.load(tmp_path / "b.json")
    with pytest.raises(InputError, match=r"ends in \.json or \.npz"):
        family.save(tmp_path / "family.mat")
