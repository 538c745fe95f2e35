"""Regions of attraction with known answers, and what is refused."""

import json
import math
from fractions import Fraction

import casadi
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from symheli.errors import InputError
from synthesis.regions import RegionOfAttraction, region_of_attraction

x, y, z = sympy.symbols("x y z")
CUBIC = {x: -x + x**3}
VAN_DER_POL = {x: -y, y: x - (1 - x**2) * y}
P = np.array([[1.5, -0.5], [-0.5, 1.0]])
"""A'P + PA = -I of its linearization."""
BALL = x**2 + y**2


def drake(scale=1):
    """x' = (U - 1) grad U, U a product of two quadratic forms: Drake's issue 12876. U < 1 is the
    region; on |x| = 1, U is 884 t^2 - 584 t + 100 with t = sin^2, at most 400: the largest ball has
    |x|^2 = 1/20.
    """
    A = sympy.Matrix([[1, 2], [3, 4]])
    B, X = A * sympy.diag(-1, 1), sympy.Matrix([x, y])
    U = (X.T * A.T * A * X)[0] * (X.T * B.T * B * X)[0] / scale
    return {v: (U - 1) * sympy.diff(U, v) for v in (x, y)}


@pytest.mark.parametrize(
    ("scale", "V", "truth"),
    [
        (1, BALL, Fraction(1, 20)),
        (100, BALL, Fraction(1, 2)),
        (1, 10**8 * BALL, Fraction(10**8, 20)),
        (1, BALL / 10**8, Fraction(1, 20 * 10**8)),
    ],
    ids=["U", "U/100", "V 1e8", "V 1e-8"],
)
def test_the_largest_ball_of_drakes_example_is_a_twentieth(scale, V, truth):
    found = region_of_attraction(drake(scale), V)
    assert found.verify()
    # the search stops 1e-5 below the ceiling; the ceiling is nudged outwards from the truth
    assert truth * (1 - Fraction(2, 10**5)) < Fraction(found.level) < truth
    assert truth <= Fraction(found.ceiling) < truth * (1 + Fraction(1, 10**6))


@pytest.mark.parametrize(
    ("f", "V", "truth"),
    [
        (CUBIC, x**2, 1.0),
        # dV/dt = 0 at y^2 = x^2 / (x - 1), nearest at x = 3/2
        ({x: -x + y**2, y: -y}, BALL, 6.75),
        # dV/dt = 0 where 2 x^3 y = x^2 + y^2
        ({x: -x + 2 * x**2 * y, y: -y}, BALL, 8 / (3 * math.sqrt(3))),
        # |xyz| <= (|x|^2/3)^(3/2)
        ({x: -x + y * z, y: -y + x * z, z: -z + x * y}, x**2 + y**2 + z**2, 3.0),
    ],
    ids=["cubic", "square", "quartic", "three states"],
)
def test_levels_are_those_of_closed_forms(f, V, truth):
    found = region_of_attraction(f, V)
    assert found.verify()
    assert truth * (1 - 2e-5) < found.level < truth
    assert truth * (1 - 1e-12) < found.ceiling < truth * (1 + 1e-6)


def test_van_der_pol_has_the_level_that_its_own_equations_give():
    def falls(r, u):
        a, b = r * u
        return np.dot(2 * P @ (r * u), [-b, a - (1 - a**2) * b])

    levels = []
    for angle in np.linspace(0.0, np.pi, 4001):
        u = np.array([np.cos(angle), np.sin(angle)])
        if falls(10.0, u) > 0:
            r = brentq(falls, 1e-3, 10.0, args=(u,))
            levels.append(r**2 * u @ P @ u)
    found = region_of_attraction(VAN_DER_POL)
    assert found.verify()
    assert found.level == pytest.approx(min(levels), rel=3e-5)  # 1e-5 below it, and the grid
    assert found.level == pytest.approx(2.3045, rel=1e-4)


def test_units_of_states_and_time_move_nothing():
    a, b, time = 1e4, 1e-4, 1e8
    f = {x: time * -b * y / a, y: time * (a * x - (1 - (a * x) ** 2) * b * y) / b}
    V = 1.5 * (a * x) ** 2 - a * b * x * y + (b * y) ** 2
    usual = region_of_attraction(VAN_DER_POL, P)
    assert region_of_attraction(f, V).level == pytest.approx(usual.level, rel=1e-9)


def test_motions_from_the_border_tend_to_zero():
    found = region_of_attraction(VAN_DER_POL)
    for angle in np.linspace(0, 2 * np.pi, 9)[:-1]:
        u = np.array([np.cos(angle), np.sin(angle)])
        start = u * np.sqrt(found.level / (u @ P @ u)) * (1 - 1e-12)
        assert found.contains(start)
        assert not found.contains(1.001 * start)
        run = solve_ivp(lambda _, s: [-s[1], s[0] - (1 - s[0] ** 2) * s[1]], (0, 60), start)
        assert np.all(np.diff(found.values(run.y.T)) < 1e-6)
        assert np.linalg.norm(run.y[:, -1]) < 1e-3


def test_a_function_of_degree_four_grows_beyond_the_quadratic_one():
    f = {x: -x + 2 * x**2 * y, y: -y}
    small, large = region_of_attraction(f), region_of_attraction(f, degree=4)
    assert large.verify()
    assert large.V.degree == 4
    rng = np.random.default_rng(0)
    points = rng.uniform(-4, 4, (4000, 2))
    inside = [np.mean(r.values(points) <= r.level) for r in (small, large)]
    assert inside[1] > 2 * inside[0]
    assert np.all(
        points.prod(axis=1)[large.values(points) <= large.level] < 1
    )  # x y < 1: the truth


@pytest.mark.parametrize(
    "f", [{x: -(x**3) - y, y: x - y**3}, {x: -x, y: -(y**3)}], ids=["cubes", "one cube"]
)
def test_where_dv_dt_is_negative_everywhere_all_levels_are_proven(f, tmp_path):
    found = region_of_attraction(f, BALL)
    assert found.verify()
    assert found.level == math.inf
    assert RegionOfAttraction.load(found.save(tmp_path / "all.json")).level == math.inf


def test_casadi_and_sympy_say_the_same():
    s = casadi.SX.sym("s", 2)
    f = [-s[1], s[0] - (1 - s[0] ** 2) * s[1]]
    function = casadi.Function("f", [s], [casadi.vertcat(*f)])
    m = casadi.MX.sym("m", 2)
    folded = casadi.Function("f", [m], [function(m)])
    V = casadi.Function("V", [s], [1.5 * s[0] ** 2 - s[0] * s[1] + s[1] ** 2])
    usual = region_of_attraction(VAN_DER_POL, P)
    for found in (
        region_of_attraction(function, V),
        region_of_attraction(f, s.T @ P @ s, states=s),
        region_of_attraction(folded),
        region_of_attraction(list(VAN_DER_POL.values()), P, states=[x, y]),
    ):
        assert [p.terms for p in found.f] == [p.terms for p in usual.f]
        assert (found.level, found.verified) == (usual.level, True)


def test_floats_are_the_rationals_that_they_are_and_rationals_stay():
    found = region_of_attraction({x: -0.1 * x - sympy.Rational(1, 3) * x**3}, x**2)
    assert found.f[0].terms == {(1,): -Fraction(0.1), (3,): Fraction(-1, 3)}
    assert found.level == math.inf


@pytest.mark.parametrize(
    ("f", "V", "why"),
    [
        ({x: x + x**3}, x**2, "as close to 0"),
        (CUBIC, x**2 - x**4, "positive definite"),
        ({x: y, y: -x}, None, "0 everywhere"),
        ({x: y, y: -x - y}, BALL, "no level passes"),
    ],
    ids=["unstable", "V has two signs", "a centre", "semidefinite"],
)
def test_what_is_not_so_is_not_proven(f, V, why, tmp_path):
    found = region_of_attraction(f, V)
    assert not found.verified
    assert not found.verify()
    assert why in found.why
    assert found.level == 0
    assert not found.contains([0.0] * len(found.states))
    with pytest.raises(InputError, match="only a proven region"):
        found.save(tmp_path / "none.json")


S = casadi.SX.sym("s", 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (({x: -sympy.sin(x)},), "Taylor polynomial"),
        (({x: -x / (1 + x**2)},), "Taylor polynomial"),
        (({x: -sympy.sqrt(2) * x},), "numbers as coefficients"),
        (({x: -x + y},), "numbers as coefficients"),
        ((casadi.Function("f", [S], [-casadi.sin(S)]),), "'sin'"),
        ((casadi.Function("f", [S], [-S / (1 + S)]),), "'div'"),
        (({x: 1 - x},), "must be 0 at 0"),
        ((CUBIC, 1 + x**2), r"V\(0\) must be 0"),
        ((CUBIC, [[1.0, 0.0]]), "expected shape"),
        (([-x],), "with states="),
        ((3.0,), "with states="),
    ],
)
def test_other_input_is_refused_with_what_to_do(arguments, message):
    with pytest.raises(InputError, match=message):
        region_of_attraction(*arguments)
    with pytest.raises(InputError, match="even"):
        region_of_attraction(CUBIC, degree=3)


def test_a_file_says_what_was_proven(tmp_path):
    found = region_of_attraction(CUBIC, x**2)
    again = RegionOfAttraction.load(found.save(tmp_path / "region.json"))
    assert (again.claim, again.conditions, again.level) == (
        found.claim,
        found.conditions,
        found.level,
    )
    assert again.ceiling == found.ceiling
    content = json.loads((tmp_path / "region.json").read_text())
    content["point"]["array"] = [0.5]
    (tmp_path / "region.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="negative there"):
        RegionOfAttraction.load(tmp_path / "region.json")


@pytest.mark.parametrize("text", [
    "__import__('pathlib').Path('touched').touch()", "x.diff()", "9**9**9**9", "x**1000000000",
    "x if x else x", "lambda: x", "q",
])  # fmt: skip
def test_a_text_is_read_as_a_polynomial_and_nothing_in_it_runs(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    x = sympy.Symbol("x", real=True)
    assert region_of_attraction({x: "-x + x^3/4"}, "x**2").verified
    with pytest.raises(InputError, match="polynomial"):
        region_of_attraction({x: text})
    with pytest.raises(InputError, match="polynomial"):
        region_of_attraction({x: -x}, text)
    assert not list(tmp_path.iterdir())
