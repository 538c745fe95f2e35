"""Families of matrices travel as plain files, and what is wrong with one is said."""

import json

import numpy as np
import pytest

import symheli
from symheli import LinearFamily, LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.export import write_family_mat
from symheli.values import NamedVector, OperatingPoint, Signal, signals

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
def test_a_family_over_two_axes_comes_back_and_has_no_single_parameter(ideal, tmp_path, ending):
    grid = symheli.steady.sweep_grid(ideal, [6.0, 8.0], acceleration=[-1.0, 0.0, 1.0])
    path = grid.save(tmp_path / f"grid.{ending}")
    back = LinearFamily.load(path)
    same(back, grid)
    assert back.axes == grid.axes
    assert back[1, 2].point.x["theta"] == grid[1, 2].point.x["theta"]
    with pytest.raises(InputError, match=r"over airspeed, acceleration.*fix\(acceleration=-1\)"):
        back.parameter  # noqa: B018


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


MACH = (0.5, 0.6, 0.7, 0.9)


def over_mach(speed=lambda mach: None):
    """Trims x0 = M^2, u0 = -M of something that is no helicopter."""
    alpha, fin = signals(["alpha"], {"alpha": "rad"}), signals(["fin"], {"fin": "rad"})
    models = [
        LinearModel(
            [[-mach]],
            [[2.0 * mach]],
            [[1.0]],
            [[0.0]],
            alpha,
            fin,
            alpha,
            point=OperatingPoint(
                NamedVector(alpha, [mach**2]),
                NamedVector(fin, [-mach]),
                NamedVector(alpha, [0.0]),
                speed(mach),
            ),
        )
        for mach in MACH
    ]
    return LinearFamily.from_models(MACH, models, parameter=Signal("Mach", "1"))


@pytest.mark.parametrize("ending", ["json", "npz"])
def test_trims_over_any_parameter_need_no_airspeed(tmp_path, ending):
    """From the points by files to a model that simulates and predicts about x0(p), u0(p)."""
    made = over_mach()
    back = LinearFamily.load(made.save(tmp_path / f"mach.{ending}"))
    assert [t.airspeed for t in back.trims] == [None] * 4
    assert "about" not in str(back[0])
    lpv = back.interpolate("polynomial", degree=1)
    np.testing.assert_allclose(lpv.trim.state(0.8), [0.64], atol=1e-12)  # by a cubic spline
    np.testing.assert_allclose(lpv.trim.input(0.8), [-0.8], atol=1e-12)
    drift = lpv.with_trim_drift()
    assert (drift.inputs[-1], drift.inputs[-1].unit) == ("drift_Mach", "1/s")
    # held at the trim it stays there; along a motion of p the trim drifts by -2 M dM/dt
    p = np.full(50, 0.8)
    rest = lpv.predict(p, np.full((50, 1), -0.8), np.full((50, 1), 0.64), dt=0.01)
    np.testing.assert_allclose(rest.free_run()[1:], 0.64, atol=1e-12)
    moving = np.linspace(0.6, 0.8, 50)
    u = -moving[:, None]
    push = lpv.predict(moving, u, moving[:, None] ** 2, dt=0.01).push[:-1, 0]
    rate = (moving[1] - moving[0]) / 0.01
    np.testing.assert_allclose(push, -2 * moving[:-1] * rate * 0.01, rtol=0.01)
    assert LPVStateSpace.load(lpv.save(tmp_path / "lpv.json")).scheduling == lpv.scheduling


def test_an_airspeed_that_a_trim_has_is_kept_and_never_taken_from_another_unit(tmp_path):
    back = LinearFamily.load(over_mach(lambda mach: 340.0 * mach).save(tmp_path / "mach.json"))
    assert [t.airspeed for t in back.trims] == [340.0 * mach for mach in MACH]
    knots = {**BY_HAND, "x0": [[0, 0]] * 2, "u0": [[0]] * 2}
    knots["axes"] = [{"name": "airspeed", "unit": "kt", "values": [0, 10]}]
    (tmp_path / "kt.json").write_text(json.dumps(knots))
    slow = LinearFamily.load(tmp_path / "kt.json")
    assert [t.airspeed for t in slow.trims] == pytest.approx([0.0, 18520 / 3600])


def test_what_is_over_airspeed_refuses_a_family_over_something_else(ideal, tmp_path):
    made = over_mach()
    for call in (
        lambda: symheli.flight.StitchedModel.from_family(made),
        lambda: symheli.derivatives(made),
        lambda: symheli.sweep(ideal, MACH, start=made),
        lambda: write_family_mat(made, tmp_path / "mach.mat", "over Mach"),
    ):
        with pytest.raises(InputError, match=r"over airspeed in m/s, .* over Mach \(1\)"):
            call()


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
