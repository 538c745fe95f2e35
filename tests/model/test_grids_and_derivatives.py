"""Trim maps, derivative tables and families over a second quantity."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

import symheli
from symheli.steady.derivative_table import ROW

SPEEDS = [0.0, 4.0, 9.0]


@pytest.fixture(scope="module")
def level(ideal):
    return symheli.sweep(ideal, SPEEDS)


@pytest.fixture(scope="module")
def envelope(ideal):
    return symheli.trim_map(ideal, [0.0, 5.0, 10.0], [-10.0, -4.0, 0.0, 4.0, 10.0])


def test_a_trim_map_holds_the_trims_of_its_points(ideal, envelope):
    """Reached from neighbours or from hover, the same equilibrium; impossible pairs are empty, not
    wrong.
    """
    assert envelope.possible.tolist() == [
        [False, False, True, False, False],
        [False, True, True, True, False],
        [True] * 5,
    ]
    assert envelope.success[envelope.possible].all()
    for i, speed in enumerate(envelope.airspeeds):
        for j, rate in enumerate(envelope.climb_rates):
            if envelope.possible[i, j] and not envelope.vortex_ring[i, j]:
                alone = symheli.trim(ideal, speed, climb_rate=rate)
                np.testing.assert_allclose(envelope[i, j].u.array, alone.u.array, atol=1e-9)
                assert envelope["d_col"][i, j] == envelope[i, j].u["d_col"]
    assert np.isnan(envelope["theta"][0, 0])
    assert envelope.level_speeds[2, 4] == 0.0


def test_climbing_takes_power_and_descending_gives_it(ideal, envelope):
    """dP/d climb rate is about the weight (8.2 kg g = 80 N) at 10 m/s: energy, less what the flow
    through the disc changes.
    """
    slope = (envelope["power"][2, 3] - envelope["power"][2, 1]) / 8.0
    assert slope == pytest.approx(80.4, rel=0.15)
    values = ideal.compiled("diagnostics")(
        x=envelope[2, 2].x.array, u=envelope[2, 2].u.array, wind=0
    )
    assert envelope["power"][2, 2] == pytest.approx(167.0 * float(values["Q_e"]), rel=1e-12)


def test_vertical_descent_is_flagged_and_level_flight_is_not(envelope):
    assert envelope.vortex_ring[2, 0]
    assert not envelope.vortex_ring[:, 2].any()


def test_a_trim_map_as_csv_reads_back(envelope):
    rows = list(csv.DictReader(io.StringIO(envelope.csv())))
    assert rows[0]["d_col"] == "rad"  # the second line has the units
    assert rows[0]["airspeed"] == "m/s"
    assert len(rows) - 1 == envelope.possible.sum()
    np.testing.assert_array_equal(
        [float(r["theta"]) for r in rows[1:]], envelope["theta"][envelope.possible]
    )


@pytest.mark.parametrize(
    ("speeds", "rates"), [([], [0.0]), ([2.0, 1.0], [0.0]), ([1.0], [0.0, np.nan]), ([1.0], [5.0])]
)
def test_grids_that_cannot_be_are_refused(ideal, speeds, rates):
    with pytest.raises(symheli.errors.InputError):
        symheli.trim_map(ideal, speeds, rates)


def test_failures_are_kept_in_the_map(ideal):
    """1 kW cannot climb at 8 m/s with the engine in the model."""
    heli = symheli.Helicopter(ideal.vehicle, "pi").with_parameters({"drivetrain.max_power": 1000.0})
    found = symheli.trim_map(heli, [10.0], [-2.0, 8.0])
    assert found.success.tolist() == [[True, False]]
    assert np.isnan(found["d_col"][0, 1])


@pytest.mark.slow(but="ideal")
@pytest.mark.parametrize("governor", ["ideal", "pi"])
def test_derivatives_are_those_of_force_and_moment(ideal, governor):
    """Central differences of X .. N by mass and inertia of the body alone, which know no gravity
    and no kinematic term.

    Under "ideal" the rotor is turned with the body: N contains its reaction.
    """
    heli = symheli.Helicopter(ideal.vehicle, governor)
    family = symheli.sweep(heli, [2.0, 6.0], climb_rate=1.0)
    table = symheli.derivatives(family)
    names = heli.diagnostics.name_out()
    body = heli.vehicle.values("body")
    inertia = {
        "X": body["mass"],
        "Y": body["mass"],
        "Z": body["mass"],
        "L": body["Ixx"],
        "M": body["Iyy"],
        "N": body["Izz"],
    }
    for k, point in enumerate(family.trims):
        z = np.concatenate([point.x.array, point.u.array])

        def wrench(z):
            values = heli.numeric("diagnostics")(
                z[: len(heli.states)], z[len(heli.states) :], np.zeros(3)
            )
            return {s: float(values[names.index(s)][0]) / inertia[s] for s in "XYZLMN"}

        for column in ("u", "w", "q", "r", "b1", "d_col", "d_ped"):
            step = np.zeros(len(z))
            step[[*heli.states, *heli.inputs].index(column)] = 1e-5
            plus, minus = wrench(z + step), wrench(z - step)
            for row in ROW.values():
                difference = (plus[row] - minus[row]) / 2e-5
                # rounding 1e-13/1e-5 of forces up to 10 m/s^2, truncation far less
                assert table[f"{row}_{column.removeprefix('d_')}"][k] == pytest.approx(
                    difference, abs=2e-6, rel=1e-6
                )


def test_derivatives_know_their_units_and_nomenclature(level):
    table = symheli.derivatives(level)
    units = {str(name): name.unit for name in table}
    assert units["X_u"] == units["L_p"] == "1/s"
    assert units["X_q"] == "m/s/rad"
    assert units["Z_col"] == "m/s^2/rad"
    assert units["L_v"] == "rad/m/s"
    assert units["N_ped"] == units["L_b1"] == "1/s^2"
    assert units["a1dot_lon"] == "1/s"
    assert "X_theta" not in units  # gravity is no force derivative
    A = level.A
    assert table["L_b1"].tolist() == A[:, 3, 9].tolist()
    assert "Z_col" in str(table)
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows[0][1] == "X_u"
    assert len(rows) == 2 + len(SPEEDS)
    with pytest.raises(symheli.errors.UnknownNameError, match="X_u"):
        table["Xu"]
    with pytest.raises(symheli.errors.InputError, match="continuous"):
        symheli.derivatives(level.discretize(0.02))


@pytest.mark.slow(only="density-values2-<lambda>")
@pytest.mark.parametrize(
    ("name", "values", "variant"),
    [
        ("mass", [7.0, 9.0], lambda h, v: h.with_parameters({"body.mass": v})),
        (
            "rotor_speed",
            [150.0, 175.0],
            lambda h, v: h.with_parameters({"drivetrain.nominal_speed": v}),
        ),
        ("density", [1.0, 1.2], lambda h, v: symheli.Helicopter(h.vehicle, "ideal", density=v)),
        ("altitude", [0.0, 2500.0], lambda h, v: h.at_altitude(v)),
        ("climb_rate", [-1.0, 2.0], lambda h, v: h),
        ("acceleration", [-1.5, 2.0], lambda h, v: h),
    ],
)
def test_a_grid_is_the_family_at_each_value(ideal, name, values, variant):
    speeds = [3.0, 8.0]
    grid = symheli.steady.sweep_grid(ideal, speeds, **{name: values})
    assert grid.A.shape == (2, 2, 10, 10)
    assert grid.axes == ("airspeed", name)
    assert grid.B.shape == (2, 2, 10, 4)
    for j, value in enumerate(values):
        family = symheli.sweep(
            variant(ideal, value),
            speeds,
            **({name: value} if name in ("climb_rate", "acceleration") else {}),
        )
        np.testing.assert_allclose(
            grid.A[:, j], family.A, atol=1e-9
        )  # two Newton iterations from other starts
        np.testing.assert_array_equal(grid.fix(**{name: value}).A, grid.A[:, j])
        np.testing.assert_array_equal(grid[1, j].A, grid.A[1, j])
        assert grid[1, j].point.airspeed == 8.0
    assert not np.allclose(grid.A[:, 0], grid.A[:, 1])


def test_a_grid_is_a_family_over_any_of_its_axes(ideal, tmp_path):
    """With its name and unit, to the file and back with the trims."""
    grid = symheli.steady.sweep_grid(ideal, [3.0, 8.0], mass=[8.0, 9.0])
    family = grid.fix(airspeed=8.0)
    assert (family.parameter, family.parameter.unit) == ("mass", "kg")
    np.testing.assert_array_equal(family.A, grid.A[1])
    assert family.interpolate(degree=1).scheduling.name == "mass"
    for ending in ("json", "npz"):
        back = symheli.LinearFamily.load(family.save(tmp_path / f"mass.{ending}"))
        assert (back.parameter, back.parameter.unit) == ("mass", "kg")
        assert [t.airspeed for t in back.trims] == [8.0, 8.0]
        x0 = family.trims.state(family.states)
        np.testing.assert_array_equal(back.trims.state(back.states), x0)


def test_a_grid_refuses_what_it_does_not_hold(ideal):
    grid = symheli.steady.sweep_grid(ideal, [3.0], mass=[8.0, 9.0])
    with pytest.raises(symheli.errors.InputError, match=r"mass = 8\.5 kg is not on the grid: 8, 9"):
        grid.fix(mass=8.5)
    with pytest.raises(symheli.errors.UnknownNameError, match="mass"):
        grid.fix(mas=8.0)
    with pytest.raises(symheli.errors.InputError, match="needs one of"):
        symheli.steady.sweep_grid(ideal, [3.0])
    with pytest.raises(symheli.errors.InputError, match="density and altitude are one axis"):
        symheli.steady.sweep_grid(ideal, [3.0], density=[1.0], altitude=[0.0])
    with pytest.raises(symheli.errors.InputError, match="increasing"):
        symheli.steady.sweep_grid(ideal, [3.0], mass=[9.0, 8.0])
