"""LPV models as files: every number and name comes back, and a damaged file says so."""

import json

import numpy as np
import pytest

import symheli
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial, Product, UserFunctions
from symheli.lpv.bases import Patches

SPEED = Scheduling("V", "m/s", 0.0, 10.0, rate="a")
ACCELERATION = Scheduling("a", "m/s^2", -2.0, 2.0)
BASES = (
    Polynomial(3, 0.0, 10.0),
    BSpline(2, (0.0, 4.0, 10.0)),
    PiecewiseLinear((0.0, 3.0, 10.0)),
    CubicSpline((0.0, 2.0, 5.0, 10.0)),
    Patches(1, (0.0, 5.0, 10.0)),
    Product((Polynomial(1, 0.0, 10.0), Polynomial(2, -2.0, 2.0))),
)


def random(basis, states=("p", "phi"), dt=None):
    rng, n = np.random.default_rng(0), len(states)
    shapes = (n, n), (n, 1), (2, n), (2, 1)
    several = (SPEED, ACCELERATION)
    one = (Scheduling("V", "m/s", 0.0, 10.0, 0.1),)
    return LPVStateSpace(
        basis,
        *(rng.standard_normal((basis.size, *shape)) for shape in shapes),
        several if basis.dimension == 2 else one,
        states,
        ("d_lat",),
        ("p", symheli.values.Signal("z", "rad/s^2")),
        dt,
    )


def same(one, other):
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for group in ("states", "inputs", "outputs"):
        assert [(str(s), s.unit) for s in getattr(one, group)] == [
            (str(s), s.unit) for s in getattr(other, group)
        ]
    assert (one.basis, one.parameters, one.dt) == (other.basis, other.parameters, other.dt)


@pytest.mark.parametrize("basis", BASES, ids=lambda basis: type(basis).__name__)
def test_a_model_comes_back_to_the_last_bit(basis, tmp_path):
    for made in (random(basis), random(basis, states=()), random(basis, dt=0.02)):
        same(LPVStateSpace.load(made.save(tmp_path / "model.json")), made)


def test_with_its_trim_and_what_it_was_fitted_to(ideal, tmp_path):
    made = symheli.sweep(ideal, [2.0, 5.0, 8.0, 11.0]).interpolate(degree=2, rate=1.0)
    back = LPVStateSpace.load(made.save(tmp_path / "model.json"))
    same(back, made)
    np.testing.assert_array_equal(back.trim.state(6.3), made.trim.state(6.3))
    np.testing.assert_array_equal(back.trim.input(6.3), made.trim.input(6.3))
    for one, other in zip(back.residuals, made.residuals, strict=True):
        np.testing.assert_array_equal(one, other)


def test_functions_are_given_anew(tmp_path):
    basis = UserFunctions((np.ones_like, np.sin), 0.0, 10.0, ("one", "sine"))
    path = random(basis).save(tmp_path / "model.json")
    same(LPVStateSpace.load(path, basis), random(basis))
    with pytest.raises(InputError, match=r"functions one, sine are not in the file"):
        LPVStateSpace.load(path)


def test_a_file_that_is_not_whole_says_so(tmp_path):
    path = random(BASES[0]).save(tmp_path / "model.json")
    text = path.read_text("utf-8")
    for damaged, said in (
        (text[: len(text) // 2], "not a whole file"),
        (text.replace('"V"', '"W"'), "does not match its digest"),
        (text.replace('"version": 1', '"version": 2'), "version 2 of the format"),
        (json.dumps({"schema": "another"}), "expected a file of 'symheli LPV state space'"),
    ):
        path.write_text(damaged, "utf-8")
        with pytest.raises(InputError, match=said):
            LPVStateSpace.load(path)
    with pytest.raises(InputError, match="No such file"):
        LPVStateSpace.load(tmp_path / "none.json")
