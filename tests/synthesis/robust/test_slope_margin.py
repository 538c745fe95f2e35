"""Functions of bounded slope: closed forms, what each class of multipliers adds, and simulation."""

import math
from dataclasses import replace

import control
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from synthesis.robust import slope, slope_margin

SEARCH = 2e-3
"""The search ends a part in a thousand below what is not proven, or below the limit."""


def plant(numerator, denominator):
    """A transfer function under negative feedback: v = -G d."""
    found = control.ss(control.tf(numerator, denominator))
    return LinearModel.from_control(-1 * found, inputs=["d"], outputs=["v"])


def resonant():
    """Three modes, drawn once among twelve plants: one where each class of multipliers counts."""
    numerator = [1.8, 1.32, 0.36, -1.21]
    modes = ((0.7, 0.25), (1.21, 0.54), (0.72, 0.15))
    denominator = np.ones(1)
    for w, z in modes:
        denominator = np.polymul(denominator, [1, 2 * z * w, w * w])
    return plant(numerator, denominator)


def test_the_circle_criterion_and_that_of_popov_in_closed_form():
    """1/(s + 1)^3: the least real part is -1/4, at w = 1; Popov's reaches the limit 8 of a gain."""
    lags = plant([1], [1, 3, 3, 1])
    circle, popov = (slope_margin(lags, "d", "v", each) for each in ("circle", "Popov"))
    assert circle.slope == pytest.approx(4.0, rel=SEARCH)
    assert popov.slope == pytest.approx(8.0, rel=SEARCH)
    assert circle.slope < 4.0
    assert popov.slope < 8.0
    assert circle.limit == pytest.approx(8.0, rel=1e-6)
    assert circle.popov == 0.0
    assert not np.any(popov.causal)


def test_each_class_of_multipliers_is_larger_than_the_one_before():
    model = resonant()
    found = [
        slope_margin(model, "d", "v", *asked)
        for asked in (("circle",), ("Popov",), ("Zames-Falb",))
    ]
    odd = slope_margin(model, "d", "v", odd=True)
    slopes = [each.slope for each in (*found, odd)]
    assert slopes == sorted(slopes)
    assert slopes[1] > 1.5 * slopes[0]
    assert slopes[2] > 1.3 * slopes[1]
    assert 1.01 * slopes[2] < slopes[3] < odd.limit


@pytest.mark.parametrize("odd", [False, True])
def test_the_multiplier_is_what_it_must_be(odd):
    """The real part over a fine grid, from the transfer function; the integral of |h| below 1."""
    model = resonant()
    found = slope_margin(model, "d", "v", odd=odd)
    assert found.verify(rigorous=True)
    omega = np.r_[0.0, np.geomspace(1e-3, 1e3, 20001)]
    F = 1 / found.slope - model.frequency_response(omega)[:, 0, 0]
    assert np.all(np.real(found.multiplier(omega) * F) > 0)
    weights = np.r_[found.causal.ravel(), found.ahead.ravel()]
    assert np.abs(weights).sum() < 1
    assert odd or np.all(weights >= 0)


@pytest.mark.slow
def test_a_loop_of_the_slope_found_decays():
    """A dead zone, a saturation and a soft stop, each of that slope at its steepest."""
    model = resonant()
    k = 0.9 * slope_margin(model, "d", "v").slope  # at the margin it takes long
    for phi in (
        lambda v: k * np.clip(v, -1.0, 0.3),
        lambda v: k * (v - np.clip(v, -0.2, 0.5)),
        lambda v: k * np.maximum(v, 0.2 * v),
    ):

        def slope(t, x, phi=phi):
            return model.A @ x + model.B[:, 0] * phi(float((model.C @ x).item()))

        x0 = np.full(len(model.A), 3.0)
        end = solve_ivp(slope, (0.0, 400.0), x0, rtol=1e-6, atol=1e-8).y[:, -1]
        assert np.linalg.norm(end) < 0.01 * np.linalg.norm(x0)


def test_a_loop_that_no_slope_reaches_and_one_without_limit():
    none = LinearModel([[-1.0]], [[1.0]], [[0.0]], [[0.0]], ["x"], ["d"], ["v"])
    infinite = slope_margin(none, "d", "v")
    assert (infinite.slope, infinite.limit) == (math.inf, math.inf)
    lag = slope_margin(plant([1], [1, 1]), "d", "v")
    assert lag.slope > 1e5
    assert lag.limit == math.inf


MISSED = """
561.4738689574035 -734.1838091183005 -428.6633570333954 -213.2011148620911
53.04480103578124 350.4676419872083 609.7445998665382 -896.9974845263846
-344.0292439687711 -164.02394003618184 79.98645372402324 501.7878474895997
125.40877231353505 -145.7334711464954 -119.07415198179156 -60.761774976203725
7.770548288020008 55.58581324647251 -190.8003903088374 322.0508125362968
59.299404544659374 24.66463377346277 -34.360879691145136 -206.41421179433024
2039.5158505277604 -2616.4348237160934 -1617.0295773284784 -803.0244245958968
181.63587917796394 1214.6749980129657 105.39081228324852 -287.83162473465933
102.03210320000203 60.5786436142563 43.59048514012416 247.623338267347
3.960279064501449e-10 6.505572854951972e-08 -1.2189817960499097e-08
-4.634102120802915e-08 -2.9579468502010894e-08 9.68027815735774e-08 27.163838680621282
-2.6271417321822503 27.1703310115021 3.3079950033059973 -8.244329070292107
4.035953407054847
"""
"""A (6, 6), b (6,) and c (6,) of a loop about which a crossing is missed."""


FALSE = """
-228.8303662069894 161.68342647194507 207.79437094313658 151.47374375822776
-108.11424520084978 -137.99615099550593 -369.8824513402789 262.1940694921607
336.20386683796403 2.6316747928444805e-09 -2.736736738222838e-09 4.9978190103217025e-09
-52.33184161614663 45.519809390357665 50.452043440656105
"""
"""The same of three states: a mode damped by 8e-6, whose crossing was missed too."""


def mixed(numbers, n):
    A, b, c = np.split(np.array(numbers.split(), float), [n * n, n * n + n])
    return LinearModel(
        A.reshape(n, n), b[:, None], c[None], [[0.0]], [f"x{i}" for i in range(n)], ["d"], ["v"]
    )


def circle_bound(model):
    """1/max Re G of 50 digits, about the lightly damped modes."""
    mp = mpmath.mp.clone()
    mp.dps = 50
    A, b, c = (mp.matrix(M.tolist()) for M in (model.A, model.B, model.C))
    most = mp.mpf(0)
    for pole in mp.eig(A, left=False, right=False):
        for k in [*np.linspace(-6, 6, 121), *np.geomspace(6, 1e5, 60), *-np.geomspace(6, 1e5, 60)]:
            w = abs(mp.im(pole)) + k * mp.re(pole)
            G = (c * mp.lu_solve(mp.mpc(0, w) * mp.eye(A.rows) - A, b))[0]
            most = max(most, mp.re(G))
    return float(1 / most)


@pytest.mark.parametrize(("numbers", "n"), [(MISSED, 6), (FALSE, 3)])
def test_lightly_damped_modes_in_mixed_coordinates_are_not_missed(numbers, n):
    """The slopes were 990,164 and 1.7e13: a crossing was not taken for imaginary."""
    model = mixed(numbers, n)
    found, bound = slope_margin(model, "d", "v", "circle", odd=True), circle_bound(model)
    assert 0.998 * bound < found.slope < bound
    assert found.verified
    assert found.verify(rigorous=True)
    assert "proven" in str(found)
    proof = found.proof._replace(slope=1.003 * bound)
    assert not proof.verified()
    assert not replace(found, proof=proof, slope=proof.slope).verify()


@pytest.mark.guard
@pytest.mark.parametrize(
    "forged",
    [
        lambda p: {"slope": 1.02 * p.slope},
        lambda p: {"slope": -p.slope},
        lambda p: {"slope": math.nan},
        lambda p: {"causal": 3 * p.causal, "ahead": 3 * p.ahead},
        lambda p: {"causal": -p.causal, "ahead": -p.ahead},
        lambda p: {"poles": -p.poles},
        lambda p: {"popov": p.popov + 1e3},
        lambda p: {"A": p.A + 2 * np.eye(len(p.A))},
        lambda p: {"d": 0.1},
        lambda p: {"criterion": "circle"},
        lambda p: {"criterion": "any"},
    ],
)
def test_a_proof_with_other_numbers_is_refused(forged):
    proof = slope_margin(resonant(), "d", "v").proof
    assert proof.verified()
    assert not proof._replace(**forged(proof)).verified()


@pytest.mark.parametrize("lie", ["garbage", "negative", "nothing", "too large"])
def test_a_solver_that_lies_proves_no_slope(monkeypatch, lie):
    """What it returns is solved, it says; the true limit of the circle criterion is 4."""
    rng = np.random.default_rng(3)
    true = slope.optimize.linprog

    def liar(*arguments, **options):
        found = true(*arguments, **options)
        if found.x is not None:
            x = {"garbage": rng.normal(size=len(found.x)), "negative": -found.x}
            found.x = x.get(lie, 0 * found.x if lie == "nothing" else 5 * found.x)
        found.x = np.ones(len(arguments[0])) if found.x is None else found.x
        found.x[-1] = 1.0
        return found

    monkeypatch.setattr(slope.optimize, "linprog", liar)
    monkeypatch.setattr(slope, "ROUNDS", 2)
    lags = plant([1], [1, 3, 3, 1])
    assert slope_margin(lags, "d", "v", "circle").slope < 4.0
    found = slope_margin(lags, "d", "v", odd=True)
    assert found.slope < found.limit
    assert found.slope == 0.0 or found.verify(rigorous=True)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"criterion": "Nyquist"}, UnknownNameError, "Zames-Falb"),
        ({"output": "w"}, UnknownNameError, "output"),
        ({"model": plant([1], [1, -1])}, InputError, "stable continuous"),
        ({"model": plant([1], [1, 1]).discretize(0.1)}, InputError, "stable continuous"),
        ({"model": plant([1, 0], [1, 1])}, InputError, "no feedthrough"),
        ({"model": 1.0}, InputError, "expected a LinearModel"),
    ],
)
def test_bad_input_is_refused_in_words(given, error, words):
    asked = {"model": resonant(), "input": "d", "output": "v", **given}
    with pytest.raises(error, match=words):
        slope_margin(**asked)
