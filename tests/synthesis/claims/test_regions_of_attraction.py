"""Regions of attraction by a given V: known answers, other units, and motions that stay away."""

from fractions import Fraction

import numpy as np
import pytest

from symheli.errors import InputError
from synthesis.claims import PolynomialPlant, RegionClaim, check, region
from synthesis.claims.monomials import added, derivative, monomials, scaled, times, value
from synthesis.claims.polar import bisected, faces, inside

PROVEN, BY_ANOTHER = "proven", "this P does not prove it"
FALSE, OPEN = "the claim is false", "not decided"
CUBIC = PolynomialPlant(["x"], ["-x + x^3"])
REVERSED = PolynomialPlant(["x", "y"], ["-y", "x + (x^2 - 1)*y"])
"""Van der Pol's oscillator backwards: its limit cycle bounds the region of attraction."""


def drake(divided=1):
    """x' = (U - 1) dU/dx, U = (x'A1'A1 x)(x'A2'A2 x), A1 = [1 2; 3 4], A2 = A1 diag(-1, 1): the
    region is {U < 1}, and the largest ball in it |x|^2 <= 1/20, since U <= 400 |x|^4. Source:
    Drake, issue 12876, where a solver returned .067 to .070.
    """
    own = "((x + 2*y)^2 + (3*x + 4*y)^2) * ((-x + 2*y)^2 + (-3*x + 4*y)^2)"
    U = scaled(monomials(own, "xy"), Fraction(1, divided))
    less = added(U, {(0, 0): Fraction(-1)})
    return PolynomialPlant(["x", "y"], [times(less, derivative(U, i)) for i in range(2)])


DRAKE = drake()


@pytest.mark.parametrize(("rho", "expected"), [(0.0499, PROVEN), (0.067, BY_ANOTHER)])
@pytest.mark.parametrize("unit", [Fraction(1), Fraction(10) ** 8, Fraction(1, 10**8)])
@pytest.mark.parametrize("divided", [1, 100])
def test_drakes_ball_is_proven_below_one_twentieth_in_all_units(rho, expected, unit, divided):
    """U/100 has the region |x|^2 <= 1/2."""
    level = Fraction(rho) * (10 if divided == 100 else 1) * unit
    plant = DRAKE if divided == 1 else drake(divided)
    found = region.judged(plant, RegionClaim(f"{unit}*(x^2 + y^2)", level))
    assert found[0] == expected
    if expected == BY_ANOTHER:
        x = found[2].x
        assert x @ x <= float(level / unit) * (1 + 1e-12)


def test_the_level_that_is_true_but_for_its_last_digit_is_not_proven():
    """The double .05 is above 1/20, and the exact check sees it; 1/20 holds equilibria."""
    assert Fraction(0.05) > Fraction(1, 20)
    for rho in (0.05, "1/20"):
        assert region.judged(DRAKE, RegionClaim("x^2 + y^2", rho), 3000)[0] != PROVEN


@pytest.mark.slow
def test_the_level_that_a_solver_returned_is_false_by_a_motion():
    found = check(DRAKE, RegionClaim("x^2 + y^2", 0.067))
    assert (found.answer, found.exact) == (FALSE, False)
    start, end = found.motion.x[0], found.motion.x[-1]
    assert start @ start <= 0.067
    assert np.linalg.norm(end) > 10 * 0.067**0.5


@pytest.mark.slow
def test_the_level_that_v_does_prove_is_found():
    claim = RegionClaim("x^2 + y^2", 0.067)
    assert region.proven_level(DRAKE, claim) == pytest.approx(0.05, rel=2e-3)
    assert region.proven_level(DRAKE, claim) < 0.05


@pytest.mark.parametrize("rho", ["999999/1000000", 0.9999999, 0.5])
def test_a_cubic_is_proven_up_to_its_equilibrium(rho):
    assert check(CUBIC, RegionClaim("x^2", rho)).answer == PROVEN


def test_an_equilibrium_on_the_boundary_makes_a_claim_false_exactly():
    found = check(CUBIC, RegionClaim("x^2", 1.0))
    assert (found.answer, found.exact) == (FALSE, True)
    assert abs(found.motion.x[0, 0]) == 1.0


def test_intervals_of_random_cubics_are_proven_up_to_their_nearest_root():
    """x' = -x (1 - x/a)(1 + x/b): the region of V = x^2 is x^2 < min(a, b)^2."""
    rng = np.random.default_rng(0)
    for _ in range(4):
        a, b = (Fraction(int(v), 16) for v in rng.integers(1, 400, 2))
        plant = PolynomialPlant("x", [f"-x*(1 - x/({a}))*(1 + x/({b}))"])
        least = min(a, b) ** 2
        levels = (Fraction(98, 100) * least, Fraction(102, 100) * least)
        found = [region.judged(plant, RegionClaim("x^2", level))[0] for level in levels]
        assert found == [PROVEN, BY_ANOTHER]


@pytest.mark.slow
def test_an_ellipse_in_the_limit_cycle_is_proven_and_a_larger_one_false():
    V = "1.5*x^2 - x*y + y^2"
    assert check(REVERSED, RegionClaim(V, 2.0)).answer == PROVEN
    found = check(REVERSED, RegionClaim(V, 10.0))
    assert found.answer == FALSE
    assert np.linalg.norm(found.motion.x[-1]) > 10


def test_motions_from_a_proven_region_fall_as_runge_and_kutta_see_it():
    claim = RegionClaim("1.5*x^2 - x*y + y^2", 2.2)
    assert check(REVERSED, claim).answer == PROVEN
    V, f = claim.function(REVERSED.states), REVERSED.fields

    def rate(x):
        return np.array([value(own, list(x)) for own in f], dtype=float)

    for angle in np.linspace(0, 6, 7):
        x = np.array([np.cos(angle), np.sin(angle)])
        x = x * np.sqrt(2.2 / float(value(V, list(x))))
        levels = [2.2]
        for _ in range(40):
            k = 0.05
            a = rate(x)
            b = rate(x + k / 2 * a)
            c = rate(x + k / 2 * b)
            x = x + k / 6 * (a + 2 * b + 2 * c + rate(x + k * c))
            levels.append(float(value(V, list(x))))
        assert np.all(np.diff(levels) < 0)


def test_where_v_only_does_not_rise_nothing_is_decided():
    """x'' = -x - x': dV/dt = -2 y^2, negative semidefinite; the claim is true by LaSalle."""
    plant = PolynomialPlant(["x", "y"], ["y", "-x - y"])
    found = check(plant, RegionClaim("x^2 + y^2", 1.0))
    assert found.answer == OPEN
    assert "is not looked at" in found.reason or "semidefinite" in found.reason
    assert check(plant, RegionClaim("3*x^2 + 2*x*y + 2*y^2", 1.0)).answer == PROVEN


def test_a_motion_that_escapes_is_told_from_one_that_returns():
    """x' = -x + x^3 from V = 1.5 escapes; a linear motion that first rises 60-fold comes back."""
    found = check(CUBIC, RegionClaim("x^2", 1.5), refute=True)
    assert found.answer == FALSE
    stable = PolynomialPlant(["x", "y"], ["-x + 400*y", "-y"])
    assert check(stable, RegionClaim("x^2 + y^2", 1.0)).answer == BY_ANOTHER
    turning = PolynomialPlant(["x", "y"], ["y", "-x"])
    assert check(turning, RegionClaim("x^2 + 2*y^2", 1.0)).answer == FALSE


@pytest.mark.slow
def test_an_orbit_that_never_returns_contradicts_a_claim():
    """A centre with a weak cubic pull outwards: r' = r^3/10, no equilibrium but zero."""
    plant = PolynomialPlant(["x", "y"], ["y + x*(x^2 + y^2)/10", "-x + y*(x^2 + y^2)/10"])
    found = check(plant, RegionClaim("x^2 + y^2", 1.0))
    assert (found.answer, found.exact) == (FALSE, False)


def test_too_many_coefficients_are_not_begun_with():
    states = [f"x{i}" for i in range(12)]
    plant = PolynomialPlant(states, [f"-{s} + {s}^3" for s in states])
    found = check(plant, RegionClaim(" + ".join(f"{s}^2" for s in states), 0.5), refute=False)
    assert found.answer == OPEN
    assert "too many" in found.reason


@pytest.mark.parametrize("text", ["1e999999999*x", "x^60*x", "1e-999999999*x"])
def test_numbers_and_degrees_that_are_too_large_are_refused_at_once(text):
    with pytest.raises(InputError, match=r"finite number|degree"):
        PolynomialPlant(["x"], [text])


def test_a_set_that_is_not_bounded_is_not_decided():
    """V = x^2 y^2 + ...: {V <= 1} goes to infinity along an axis."""
    found = check(PolynomialPlant(["x", "y"], ["-x", "-y"]), RegionClaim("x^2*y^2", 1.0))
    assert found.answer == OPEN
    assert "unbounded" in found.reason


def test_a_second_component_of_the_set_is_no_region():
    """V = x^2 (x - 3)^2 + x^2/10 is positive; {V <= 1} is an interval about 0 and one about 3."""
    found = check(PolynomialPlant("x", ["-x"]), RegionClaim("x^2*(x - 3)^2 + x^2/10", 1.0))
    assert found.answer != PROVEN
    assert check(PolynomialPlant("x", ["-x"]), RegionClaim("x^2*(x - 3)^2 + x^2/10", 0.5)).proven


def test_every_ray_crosses_a_face_of_the_box():
    """Both sides of every axis: on each face the polynomial in (t, r) is F at that point."""
    F, seen = monomials("x^3*y - 2*x*y^2 + y", ["x", "y"]), set()
    for face in faces(2):
        own = inside(F, face, lowered=False)
        for t in ((Fraction(0), Fraction(1)), (Fraction(1), Fraction(1))):
            corner = tuple(-int(v == 1) for v in t)
            x = face.point(t, [Fraction(1)] * 2)
            assert (own[corner] > 0) == (value(F, x) > 0)
            seen.add(tuple(x))
    assert len(seen) == 4
    assert [tuple(face) for face in faces(2)] == [(0, -1), (0, 1), (1, -1), (1, 1)]


def test_halves_of_one_variable_stay_exact_integers():
    """Entries beyond 64 bits were once wrapped around, and a false level was believed."""
    c = np.array([2**70 + 1, -(2**71), 3], dtype=object)
    left, right = bisected(c, 0)
    assert left.tolist() == [4 * (2**70 + 1), 2 * (1 - 2**70), 1 + 3 - 3 * 2**70]
    assert right.tolist() == [1 + 3 - 3 * 2**70, 2 * (3 - 2**71), 12]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("__import__('os')", "is no polynomial"),
        ("z", "no state"),
        ("1/x", "divided by a number"),
        ("x^0.5", "whole"),
        ("x^99", "power from 0"),
        ("x +", "no polynomial"),
        ("sin(x)", "is no polynomial"),
        ("1 + x", r"f\(0\)"),
    ],
)
def test_texts_that_are_no_vector_field_are_refused(text, said):
    with pytest.raises(InputError, match=said):
        PolynomialPlant("x", [text])


def test_wrong_levels_and_functions_are_refused():
    with pytest.raises(InputError, match="rho"):
        RegionClaim("x^2", -1)
    with pytest.raises(InputError, match=r"V\(0\)"):
        check(CUBIC, RegionClaim("1 + x^2", 0.5))


@pytest.mark.parametrize(
    "f",
    [
        ["-x + 10000*y", "-y - y^3"],  # goes out 3700 times as far and comes back
        ["y - x/100000000 - x^3/100000000", "-y - y^3"],  # goes out and creeps back
    ],
)
def test_a_motion_that_comes_back_late_does_not_contradict_a_claim(f):
    """y decays by itself, and x by itself: every motion tends to zero."""
    found = check(PolynomialPlant(["x", "y"], f), RegionClaim("x^2 + y^2", 1))
    assert found.answer == "this P does not prove it"


def test_a_motion_that_circles_contradicts_a_claim():
    circle = PolynomialPlant(["x", "y"], ["y + x*(x^2+y^2-1)*(4-x^2-y^2)",
                                          "-x + y*(x^2+y^2-1)*(4-x^2-y^2)"])  # fmt: skip
    found = check(circle, RegionClaim("x^2 + y^2", 1.5))
    assert (found.answer, found.exact) == ("the claim is false", False)
