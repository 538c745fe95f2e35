"""Labelled arrays and pictures hold the numbers of the values they show, with their units."""

import numpy as np
import pytest
from families import random_lpv

import symheli
from symheli.errors import InputError, UnknownNameError


@pytest.fixture(scope="module")
def family(ideal):
    return symheli.sweep(ideal, [4.0, 6.0, 8.0]).select(["v", "p", "r"], ["d_lat", "d_ped"])


@pytest.fixture
def xr(pd):
    return pytest.importorskip("xarray", reason="needs xarray: pip install 'symheli[labelled]'")


def test_a_frame_has_a_column_an_entry_with_its_unit(family, pd):
    frame = family.to_frame()
    assert frame.index.name == "airspeed"
    np.testing.assert_array_equal(frame["A[p, v]"], family.A[:, 1, 0])
    np.testing.assert_array_equal(frame["B[r, d_ped]"], family.B[:, 2, 1])
    units = frame.attrs["units"]
    assert (units["airspeed"], units["A[v, v]"], units["A[v, r]"]) == ("m/s", "1/s", "m/s/rad")
    assert units["B[p, d_lat]"] == "1/s^2"
    assert frame.shape == (3, 3 * 3 + 3 * 2 + 3 * 3 + 3 * 2)
    # in discrete time x(k+1) has the unit of x
    assert family.discretize(0.02).to_frame().attrs["units"]["A[v, v]"] == "1"


def test_a_dataset_names_every_axis(family, xr):
    data = family.to_xarray()
    assert float(data["A"].sel(airspeed=6.0, equation="p", state="v")) == family.A[1, 1, 0]
    assert float(data["u0"].sel(airspeed=8.0, input="d_ped")) == family.trims[2].u["d_ped"]
    assert data["airspeed"].attrs["units"] == "m/s"
    assert data["equation"].attrs["units"] == ["m/s^2", "rad/s^2", "rad/s^2"]
    assert data["state"].attrs["units"] == ["m/s", "rad/s", "rad/s"]
    assert "x0" not in family.interpolate(degree=1).to_xarray()


def test_a_grid_keeps_its_axes(ideal, xr):
    grid = symheli.steady.sweep_grid(ideal, [4.0, 6.0], acceleration=[-1.0, 0.0, 1.0])
    data = grid.to_xarray()
    found = data["A"].sel(airspeed=6.0, acceleration=1.0, equation="q", state="u")
    assert float(found) == grid[1, 2].A[grid.states.index("q"), 0]
    assert data["acceleration"].attrs["units"] == "m/s^2"
    frame = grid.to_frame()
    assert frame.loc[(6.0, 1.0), "A[q, u]"] == float(found)


def test_an_lpv_model_is_a_frame_of_its_entries_over_its_parameter(family, pd):
    lpv = family.interpolate(degree=2)
    frame = lpv.to_frame()
    assert frame.index.name == "airspeed"
    np.testing.assert_allclose(frame.index, np.linspace(4.0, 8.0, 21), rtol=1e-15)
    np.testing.assert_allclose(frame.loc[6.0, "A[p, v]"], lpv.at(6.0).A[1, 0], rtol=1e-12)
    assert frame.attrs["units"] == family.to_frame().attrs["units"]
    own = lpv.to_frame([5.0, 4.5])  # as they are given
    assert own.index.tolist() == [5.0, 4.5]
    np.testing.assert_allclose(own["B[r, d_ped]"], [lpv.at(v).B[2, 1] for v in (5.0, 4.5)])
    for wrong, said in (([9.0], "9"), ([[4.0, 5.0]], "expected shape"), (["fast"], "numbers")):
        with pytest.raises(InputError, match=said):
            lpv.to_frame(wrong)


def test_an_lpv_model_of_two_parameters_is_a_frame_over_both(ideal, pd):
    lpv = symheli.steady.sweep_grid(ideal, [4.0, 6.0], acceleration=[-1.0, 1.0]).interpolate(
        degree=1
    )
    frame = lpv.to_frame()
    assert frame.index.names == ["airspeed", "acceleration"]
    assert len(frame) == 21**2
    assert frame.attrs["units"]["acceleration"] == "m/s^2"
    at = frame.index[30]
    np.testing.assert_allclose(frame.iloc[30]["A[q, u]"], lpv.at(*at).A[4, 0], rtol=1e-12)
    np.testing.assert_allclose(
        lpv.to_frame([[5.0, 0.5]])["A[q, u]"], lpv.at(5.0, 0.5).A[4, 0], rtol=1e-12
    )
    with pytest.raises(InputError, match="expected shape"):
        lpv.to_frame([5.0, 0.5])


def test_a_grid_is_drawn_a_curve_a_value_of_its_other_axes(ideal):
    grid = symheli.steady.sweep_grid(ideal, [4.0, 6.0, 8.0], acceleration=[-2.0, 0.0, 2.0])
    ax = grid.plot(entries=["A[q, u]", "B[q, d_lon]"])
    curves = [line for line in ax.lines if len(line.get_xdata()) == 3]
    assert len(curves) == 2 * 3
    entry = grid.A[:, :, grid.states.index("q"), 0]
    drawn = np.stack([line.get_ydata() for line in curves[:3]], axis=1)
    np.testing.assert_allclose(drawn, entry / np.abs(entry).max(), rtol=1e-12)
    strengths = [line.get_alpha() for line in curves[:3]]
    assert strengths == sorted(strengths)
    assert ax.get_xlabel() == "airspeed (m/s)"
    assert ax.get_title(loc="left") == "acceleration -2 (pale) to 2 m/s^2"
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert [text.partition(",")[0] for text in legend] == ["A[q", "B[q"]
    assert legend[0].endswith(f"{np.abs(entry).max():.3g} rad/m/s")
    given = ax.figure.add_subplot()
    assert grid.plot(given) is given
    with pytest.raises(UnknownNameError, match="entry"):
        grid.plot(entries=["A[q, q0]"])


def test_the_coefficients_of_an_lpv_model_give_it_back(xr):
    lpv, _ = random_lpv()
    data = lpv.to_xarray()
    f = lpv.basis(7.3)
    A = np.tensordot(f, data["A"].values, axes=1)
    np.testing.assert_allclose(A, lpv.at(7.3).A, rtol=1e-12)
    assert data.attrs["basis"] == repr(lpv.basis)


def test_tables_and_maps_and_records(ideal, xr):
    table = symheli.derivatives(symheli.sweep(ideal, [2.0, 8.0]))
    np.testing.assert_array_equal(table.to_frame()["M_q"], table["M_q"])
    assert table.to_xarray()["N_ped"].attrs["units"] == "1/s^2"
    found = symheli.trim_map(ideal, [2.0, 6.0], [0.0, 4.0])
    data, frame = found.to_xarray(), found.to_frame()
    np.testing.assert_array_equal(data["power"], found.power)
    assert data["power"].attrs["units"] == "W"
    assert len(frame) == found.possible.sum() == 3  # no climb at 4 m/s with an airspeed of 2 m/s
    assert frame.loc[(6.0, 4.0), "theta"] == found["theta"][1, 1]
    record = symheli.FlightRecord.from_arrays(
        0.1 * np.arange(4), {"q": "deg/s"}, note="a flight", q=np.arange(4.0)
    )
    data = record.to_xarray()
    np.testing.assert_array_equal(data["q"].sel(time=0.2), record["q"][2])
    assert (data["q"].attrs["units"], data.attrs["title"]) == ("rad/s", "a flight")
    assert record.to_frame().attrs["units"] == {"t": "s", "q": "rad/s"}


def test_a_dataset_can_be_written_as_netcdf_writes_it(family, xr):
    """Attributes are texts, numbers or lists of them, as netCDF has them."""
    data = family.to_xarray()
    for part in (data, *data.variables.values()):
        for value in part.attrs.values():
            each = value if isinstance(value, list) else [value]
            assert all(isinstance(v, str | float | int) for v in each)


def test_what_is_missing_is_said_with_how_to_get_it(family, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "xarray", None)
    for make in (family.to_frame, family.to_xarray):
        with pytest.raises(InputError, match=r"pip install 'symheli\[labelled\]'"):
            make()


# --- pictures -------------------------------------------------------------------------------------


@pytest.fixture
def ax():
    from matplotlib.figure import Figure

    return Figure().subplots()


def drawn(ax):
    """{label: y} of the lines with a label."""
    return {
        line.get_label(): np.asarray(line.get_ydata())
        for line in ax.lines
        if not line.get_label().startswith("_")
    }


def test_entries_are_drawn_by_their_largest_magnitude(family, ax):
    assert family.plot(ax, ["A[p, v]", "C[v, p]"]) is ax
    lines = drawn(ax)
    entry = family.A[:, 1, 0]
    largest = np.abs(entry).max()
    np.testing.assert_allclose(lines[f"A[p, v], {largest:.3g} rad/m/s"], entry / largest)
    assert not np.any(lines["C[v, p], 0 m/rad"])
    assert ax.get_xlabel() == "airspeed (m/s)"
    with pytest.raises(UnknownNameError, match=r"A\[p, v\]"):
        family.plot(ax, ["A[p, vv]"])


def test_a_model_over_p_is_drawn_and_one_of_several_is_refused(ideal, ax):
    lpv, _ = random_lpv()
    assert lpv.plot(ax) is ax
    assert len(drawn(ax)) == 4
    grid = symheli.steady.sweep_grid(ideal, [4.0, 6.0], acceleration=[-1.0, 0.0, 1.0])
    with pytest.raises(InputError, match=r"use \.parameters"):
        grid.interpolate(degree=1).plot(ax)


def test_poles_that_are_not_stable_are_marked(ax):
    spiral = symheli.LinearModel(
        [[0.1, 0], [0, -1]], np.ones((2, 1)), np.eye(2), np.zeros((2, 1)), "ab", "u", "yz"
    )
    spiral.plot(ax)
    lines = {line.get_label(): list(line.get_xdata()) for line in ax.lines}
    assert lines["stable"] == [-1.0]
    assert lines["not stable"] == [0.1]
    assert ax.get_xlabel() == "real part (1/s)"


def test_a_step_response_is_exact_at_its_samples(ax, pd):
    lag = symheli.LinearModel([[-2.0]], [[2.0]], [[3.0]], [[0.5]], ("x",), ("u",), ("y",))
    step = lag.step_response(1.5, samples=31)
    expected = 0.5 + 3 * (1 - np.exp(-2 * step.time))
    np.testing.assert_allclose(step.values[:, 0, 0], expected, rtol=1e-12)
    sampled = lag.discretize(0.05).step_response(1.5)
    np.testing.assert_allclose(sampled.values, step.values, rtol=1e-12)
    np.testing.assert_allclose(sampled.time, step.time, rtol=1e-12)
    assert step.plot(ax) is ax
    np.testing.assert_array_equal(drawn(ax)["y"], step.values[:, 0, 0])
    assert step.to_frame()["y from u"].iloc[-1] == step.values[-1, 0, 0]
    with pytest.raises(InputError, match="duration, s: expected a number > 0"):
        lag.step_response(0.0)
