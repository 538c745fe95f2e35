"""Hundreds of trims side by side: those found one at a time, whatever is computed beside them."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest

import symheli
from symheli.steady.equations import SteadyEquations, steady_equations
from symheli.steady.newton import TOLERANCE
from symheli.values.operating_points import OperatingPoints

SPEEDS = np.linspace(0.0, 20.0, 29)
JUMP = "jump as the flow turns at the disc"


def one_after_another(heli, conditions):
    """States and inputs (N, nx + 4) of `trim`, each started from the one before."""
    point, rows = None, []
    for condition in conditions:
        point = symheli.trim(heli, **condition, start=point)
        rows.append([*point.x.array, *point.u.array])
    return np.array(rows)


def airframe(name):
    heli = symheli.Helicopter.load(
        "xcell_kahn_hudson" if name == "other" else "xcell60",
        governor="pi" if name == "pi" else "ideal",
        printed=("horizontal_tail_lift",) if name == "printed" else (),
        smoothing=0.01 if name == "smoothed" else 0.0,
    )
    changes = {"body.mass": 9.5, "density": 1.0, "drivetrain.nominal_speed": 160.0}
    if name == "scaled":
        return heli.scaled(3.0)
    return heli.with_parameters(changes) if name == "changed" else heli


AIRFRAMES = ("ideal", "pi", "other", "printed", "smoothed", "scaled", "changed")
ASKED = (
    {},
    {"acceleration": 2.0},
    {"acceleration": -2.0, "climb_rate": 0.5},
    {"sideslip": 1.0},
    {"wind": (-3.0, 2.0, 0.5)},
    {"turn_rate": 0.2},
)


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
@pytest.mark.parametrize(
    ("name", "asked"),
    [  # every airframe, and every condition once
        pytest.param(*(name, asked), id=f"{'-'.join(asked) or 'level'}-{name}")
        for i, name in enumerate(AIRFRAMES)
        for j, asked in enumerate(ASKED)
        if j == i % len(ASKED)
    ],
)
def test_a_batch_holds_the_trims_found_one_after_another(name, asked):
    """Eight at a time from one that is eight airspeeds away, the same branch as from the next."""
    heli, speeds = airframe(name), SPEEDS[SPEEDS >= 0.5] if "climb_rate" in asked else SPEEDS
    found = symheli.steady.trim_batch(heli, speeds, **asked)
    expected = one_after_another(heli, [{"airspeed": v, **asked} for v in speeds])
    # each is solved to 1e-9 in its accelerations, to 1e-13 where Newton's last step is taken
    np.testing.assert_allclose(np.hstack([found.x, found.u]), expected, rtol=1e-9, atol=1e-9)
    assert found.success.all()


def test_conditions_may_jump_about(pi):
    rng = np.random.default_rng(4)
    speeds = rng.uniform(0.0, 18.0, 60)
    climb, push = speeds * rng.uniform(-0.2, 0.2, 60), rng.uniform(-3.0, 3.0, 60)
    winds = rng.uniform(-3.0, 3.0, (60, 3)) * [1.0, 1.0, 0.2]
    found = symheli.steady.trim_batch(pi, speeds, climb_rate=climb, acceleration=push, wind=winds)
    for k in range(0, 60, 7):
        alone = symheli.trim(
            pi, speeds[k], climb_rate=climb[k], acceleration=push[k], wind=winds[k]
        )
        np.testing.assert_allclose(found.x[k], alone.x.array, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.u[k], alone.u.array, rtol=1e-9, atol=1e-9)
        assert str(found[k].condition) == str(alone.condition)


@pytest.mark.slow(but="ideal")
def test_the_residual_of_every_trim_holds_in_the_equations_with_their_numbers_written_in(heli):
    """`Helicopter.rhs` is another function than the one the batch solved."""
    found = symheli.steady.trim_batch(heli, SPEEDS, acceleration=1.5)
    for point in found:
        xdot = np.array(heli.rhs(point.x.array, point.u.array, point.wind.array)).ravel()
        np.testing.assert_allclose(xdot, point.xdot.array, atol=1e-11)
        theta, phi = point.x["theta"], point.x["phi"]
        push = [np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi) * np.sin(theta)]
        xdot[:3] -= 1.5 * np.array(push)
        assert np.abs(xdot).max() < TOLERANCE


@pytest.mark.slow(but="ideal")
def test_a_trim_has_the_same_bits_whatever_is_computed_beside_it(heli):
    near = symheli.steady.trim_batch(heli, SPEEDS[:13])
    speeds = SPEEDS[:13] + 0.2
    together = symheli.steady.trim_batch(heli, speeds, start=near)
    backwards = np.arange(13)[::-1]
    turned = symheli.steady.trim_batch(heli, speeds[backwards], start=near[backwards])
    for k in range(13):
        alone = symheli.steady.trim_batch(heli, speeds[k], start=near[k])
        for name in ("x", "u", "xdot", "residual", "wind", "torque"):
            expected = getattr(alone, name)[0]
            np.testing.assert_array_equal(getattr(together, name)[k], expected)
            np.testing.assert_array_equal(getattr(turned, name)[12 - k], expected)


def test_a_linear_model_has_the_same_bits_whatever_is_computed_beside_it(ideal):
    family = symheli.sweep(ideal, SPEEDS[:9])
    again = symheli.sweep(ideal, SPEEDS[:9], start=family)
    few = symheli.sweep(
        ideal,
        SPEEDS[3:5],
        start=symheli.LinearFamily.from_models(SPEEDS[3:5], [family[3], family[4]]),
    )
    np.testing.assert_array_equal(few.A, again.A[3:5])
    np.testing.assert_array_equal(few.B, again.B[3:5])


def test_linear_models_of_a_sweep_are_those_of_linearize(heli):
    inputs = ["d_col", "v_w", "d_lat", "u_w"]
    family = symheli.sweep(heli, SPEEDS, inputs=inputs)
    for k, point in enumerate(family.trims):
        alone = symheli.linearize(heli, point, inputs=inputs)
        for name in "ABCD":
            expected = getattr(alone, name)
            # both exact: fused and separate roundings of up to a hundred products
            np.testing.assert_allclose(
                getattr(family, name)[k], expected, rtol=1e-12, atol=1e-12 * abs(expected).max()
            )
    assert family.inputs == tuple(inputs)
    assert [s.unit for s in family.inputs] == ["rad", "m/s", "rad", "m/s"]


def test_linear_models_are_the_derivative_with_the_numbers_written_in(pi):
    """`Helicopter.jacobian` takes no parameters and knows nothing of trims."""
    family = symheli.sweep(pi, [0.0, 3.0, 9.0, 14.0], acceleration=1.0)
    for k, point in enumerate(family.trims):
        A, B, _ = pi.jacobian(point.x.array, point.u.array, point.wind.array)
        np.testing.assert_allclose(family.A[k], A, rtol=1e-11, atol=1e-11 * abs(family.A[k]).max())
        np.testing.assert_allclose(family.B[k], B, rtol=1e-11, atol=1e-11 * abs(family.B[k]).max())


@pytest.mark.filterwarnings("ignore::symheli.errors.CompilerWarning")
def test_without_a_compiler_the_same_trims_and_models(monkeypatch):
    speeds, asked = SPEEDS[::3], {"acceleration": -1.0}
    heli = symheli.Helicopter.load("xcell60", governor="pi")
    fast, fast_grid = (
        symheli.sweep(heli, speeds, **asked),
        symheli.steady.sweep_grid(heli, [2.0, 6.0], mass=[7.5, 9.0], acceleration=[-1.0, 2.0]),
    )
    monkeypatch.setattr("symheli.steady.equations.library", lambda source, name: None)
    heli = symheli.Helicopter.load("xcell60", governor="pi")
    slow, slow_grid = (
        symheli.sweep(heli, speeds, **asked),
        symheli.steady.sweep_grid(heli, [2.0, 6.0], mass=[7.5, 9.0], acceleration=[-1.0, 2.0]),
    )
    assert steady_equations(heli).machine_code is None
    for a, b in ((fast, slow), (fast_grid, slow_grid)):
        np.testing.assert_allclose(a.A, b.A, rtol=1e-9, atol=1e-9 * np.abs(a.A).max())
        np.testing.assert_allclose(a.B, b.B, rtol=1e-9, atol=1e-9 * np.abs(a.B).max())
    np.testing.assert_allclose(fast.trims.x, slow.trims.x, rtol=1e-9, atol=1e-9)
    assert fast.kinks.keys() == slow.kinks.keys()
    for name, found in fast.kinks.items():
        np.testing.assert_allclose(found, slow.kinks[name], atol=1e-6)


def test_one_trim_and_its_linear_model_wait_for_no_compiler(monkeypatch):
    def compiled(*_):
        pytest.fail("a compiler was started")

    monkeypatch.setattr("symheli.steady.equations.library", compiled)
    monkeypatch.setattr("symheli.helicopter.compiled", compiled)
    heli = symheli.Helicopter.load("xcell60", governor="pi")
    assert symheli.linearize(heli, symheli.trim(heli, 6.0, climb_rate=1.0)).A.shape == (12, 12)


def test_a_trim_from_the_command_line_loads_no_scipy():
    """Half of what a person waits for were libraries that one trim does not need."""
    code = (
        "import sys; from studies.cli import main; main(['trim', '--airspeed', '10']);"
        " print([m for m in ('scipy', 'symheli.lpv', 'matplotlib', 'cvxpy') if m in sys.modules])"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert said.strip().endswith("[]")


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_one_that_fails_among_many_says_so_and_harms_no_other(ideal):
    speeds = [5.0, 60.0, 6.0, 61.0, *np.linspace(7.0, 12.0, 20)]
    with pytest.raises(symheli.errors.TrimError, match="no trim at 60 m/s") as caught:
        symheli.steady.trim_batch(ideal, speeds)
    assert caught.value.result.airspeed == 60.0
    found = symheli.steady.trim_batch(ideal, speeds, throw=False)
    assert found.success.tolist() == [True, False, True, False] + [True] * 20
    assert (found.attainable <= found.success).all()
    assert not found[1].success
    good = np.delete(np.arange(24), [1, 3])
    alone = symheli.steady.trim_batch(ideal, np.array(speeds)[good])
    np.testing.assert_allclose(found.x[good], alone.x, atol=1e-9)


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_the_first_may_fail(ideal):
    found = symheli.steady.trim_batch(ideal, [60.0, 5.0, 6.0], throw=False)
    assert found.success.tolist() == [False, True, True]


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_flags_of_a_batch_are_those_of_its_points(ideal):
    """The stops of a control, and a rotor in its own wake."""
    found = symheli.steady.trim_batch(ideal, [4.0, 4.0, 8.0], climb_rate=[0.0, -4.0, 0.0])
    assert found.vortex_ring.tolist() == [False, True, False]
    assert [p.vortex_ring for p in found] == found.vortex_ring.tolist()
    short = ideal.with_parameters({"controls.d_ped": 0.19})
    found = symheli.steady.trim_batch(short, [0.0, 6.0, 18.0])
    expected = [symheli.trim(short, v).on_stops for v in (0.0, 6.0, 18.0)]
    assert [point.on_stops for point in found] == expected
    assert expected[0] == ("d_ped",)
    assert found.attainable.tolist() == [not stops for stops in expected]


def test_the_air_of_an_altitude_is_that_of_a_trim(pi):
    found = symheli.steady.trim_batch(pi, [3.0, 9.0], altitude=1500.0)
    alone = symheli.trim(pi, 9.0, altitude=1500.0)
    np.testing.assert_allclose(found.x[1], alone.x.array, atol=1e-9)
    assert found[1].density == alone.density
    assert str(found[1].condition) == str(alone.condition)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"airspeed": [2.0, -1.0]}, "airspeed must be >= 0"),
        ({"airspeed": [2.0, np.nan]}, "airspeed: entry"),
        ({"airspeed": [2.0, 3.0], "climb_rate": [0.0, 4.0]}, "exceeds the airspeed of 3"),
        ({"airspeed": [2.0, 3.0], "acceleration": [0.0, 1.0, 2.0]}, "arrays of one length"),
        ({"airspeed": [2.0, 3.0], "wind": [1.0, 2.0]}, "wind: expected shape"),
        ({"airspeed": [2.0, 3.0], "turn_rate": 0.1, "wind": (1, 0, 0)}, "turn in wind"),
    ],
)
def test_conditions_that_are_none_are_refused(ideal, asked, said):
    with pytest.raises(symheli.errors.InputError, match=said):
        symheli.steady.trim_batch(ideal, **asked)


def test_starts_that_do_not_fit_are_refused(ideal, pi):
    with pytest.raises(symheli.errors.InputError, match="trim this helicopter"):
        symheli.steady.trim_batch(ideal, [2.0, 3.0], start=symheli.trim(pi, 2.0))
    with pytest.raises(symheli.errors.InputError, match="expected a start for each of 2"):
        symheli.steady.trim_batch(
            ideal, [2.0, 3.0], start=symheli.steady.trim_batch(ideal, [1.0, 2.0, 3.0])
        )


def test_no_condition_is_an_empty_batch(ideal):
    found = symheli.steady.trim_batch(ideal, [])
    assert len(found) == 0
    assert list(found) == []


def test_a_family_crosses_a_process_border_with_its_trims(ideal):
    family = symheli.sweep(ideal, SPEEDS[:5])
    there = pickle.loads(pickle.dumps(family))
    np.testing.assert_array_equal(there.trims[2].x.array, family.trims[2].x.array)
    np.testing.assert_array_equal(there[2].A, family.A[2])


def test_nobody_changes_a_trim_behind_the_back_of_a_family(ideal):
    family = symheli.sweep(ideal, SPEEDS[:5])
    for array in (family.trims.x, family.trims.u, family.trims.switches[JUMP], family.A):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_a_grid_over_two_more_axes_is_the_sweep_at_each_pair(ideal):
    masses, pushes, speeds = [7.5, 9.0], [-2.0, 0.0, 2.0], [3.0, 8.0, 12.0]
    grid = symheli.steady.sweep_grid(ideal, speeds, mass=masses, acceleration=pushes)
    assert grid.axes == ("airspeed", "acceleration", "mass")
    for i, push in enumerate(pushes):
        for j, mass in enumerate(masses):
            heavy = ideal.with_parameters({"body.mass": mass})
            family = symheli.sweep(heavy, speeds, acceleration=push)
            np.testing.assert_allclose(grid.A[:, i, j], family.A, atol=1e-9)
            np.testing.assert_allclose(
                grid[2, i, j].point.x.array, family.trims[2].x.array, atol=1e-9
            )
            assert grid[2, i, j].point.condition.acceleration == push


def test_kinks_lie_where_the_trims_change_sides(heli):
    """To 1e-6 m/s: the function named has its two signs at trims found alone on either side."""
    family = symheli.sweep(heli, np.linspace(0.0, 13.0, 27))
    assert len(family.kinks) >= 3
    for name, speeds in family.kinks.items():
        for speed in speeds:
            sides = [symheli.trim(heli, speed + step) for step in (-1.1e-6, 1.1e-6)]
            values = [heli.switches(p.x.array, p.u.array, p.wind.array)[name] for p in sides]
            assert values[0] * values[1] < 0


def test_a_kink_at_a_jump_is_where_the_trims_before_it_end(ideal):
    """Braking at 4 m/s^2 the wake turns at the disc: from there on there is no trim for a while."""
    family = symheli.sweep(ideal, np.linspace(5.0, 14.0, 23), acceleration=-4.0)
    (edge,) = family.kinks[JUMP]
    before = family.trims[int(np.searchsorted(family.airspeeds, edge)) - 1]

    def there(speed):
        return symheli.trim(ideal, speed, acceleration=-4.0, start=before, throw=False).success

    assert there(edge - 2e-6)
    assert not there(edge + 2e-6)
    assert not there(edge + 0.01)
    assert there(edge + 0.05)
    # what else the jump moves across its switch is at the same airspeed
    np.testing.assert_allclose(family.kinks["horizontal tail flow"], [edge], atol=2e-6)


def test_the_batch_compiles_once_for_all_airframes_of_one_arrangement(ideal, monkeypatch):
    symheli.sweep(ideal, [3.0, 4.0])
    monkeypatch.setattr(
        SteadyEquations, "_program", lambda self, name: pytest.fail("compiled anew")
    )
    symheli.sweep(ideal.scaled(2.0), [3.0, 4.0])
    symheli.steady.sweep_grid(ideal, [3.0], mass=[8.0, 9.0])
    symheli.steady.sweep_grid(ideal, [3.0], altitude=[0.0, 1000.0])


def test_tables_of_a_batch_are_those_of_its_points(ideal):
    found = symheli.steady.trim_batch(ideal, SPEEDS[:7], acceleration=1.0)
    listed = OperatingPoints.of(list(found))
    states, inputs = ["theta", "u", "b1"], ["d_col", "v_w", "d_lat"]
    np.testing.assert_array_equal(found.state(states), listed.state(states))
    np.testing.assert_array_equal(found.rate(states), listed.rate(states))
    np.testing.assert_array_equal(found.input(inputs), listed.input(inputs))
    with pytest.raises(symheli.errors.UnknownNameError, match="theta"):
        found.state(["thet"])


def test_a_sweep_in_wind_is_the_linearization_in_wind():
    """At the trim of the velocity through the air, over ground slower by the head wind."""
    heli, wind = symheli.Helicopter.load("xcell60", governor="ideal"), (-3.0, 0.0, 0.0)
    family = symheli.sweep(heli, [2.0, 6.0], wind=wind)
    for speed, found in zip([2.0, 6.0], family.A, strict=True):
        own = symheli.linearize(heli, symheli.trim(heli, speed, wind=wind)).A
        np.testing.assert_allclose(found, own, atol=1e-6 * np.abs(own).max())
    still = symheli.sweep(heli, [2.0, 6.0])
    turn = family.A[:, 1, 5] - still.A[:, 1, 5]  # dv'/dr is minus the velocity over ground
    np.testing.assert_allclose(turn, 3.0 * np.cos(still.trims[0].x["theta"]), atol=0.01)
