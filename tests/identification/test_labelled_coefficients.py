"""Identified models and measured responses as labelled arrays and pictures."""

import numpy as np
import pytest
from known_vehicles import Vehicle

import identification as idn
from symheli import FlightRecord
from symheli.errors import UnknownNameError


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    p, u = np.sin(0.05 * np.arange(800)), rng.uniform(-1, 1, 800)
    y = np.zeros(800)
    for k in range(1, 800):
        y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1]
    units = {"y": "rad/s", "u": "rad", "p": "m/s"}
    return FlightRecord.from_arrays(0.1 * np.arange(800), units, y=y, u=u, p=p)


@pytest.fixture(scope="module")
def model(record):
    basis = idn.Polynomial(1, -1.0, 1.0)
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis, offset=True)
    return idn.fit(arx, record)


def test_coefficients_stand_beside_their_regressor_with_units(model, pd):
    frame = model.to_frame()
    assert list(frame.index) == list(model.structure.regressor_names)
    np.testing.assert_array_equal(frame["y"], model.theta[:, 0])
    assert frame.attrs["units"]["y"] == "rad/s"
    units = frame.attrs["regressor_units"]
    assert [units[name] for name in frame.index] == ["rad/s"] * 2 + ["rad"] * 2 + ["1"] * 2


def test_a_dataset_says_which_functions_and_which_period(model, pd):
    pytest.importorskip("xarray", reason="needs xarray: pip install 'symheli[labelled]'")
    data = model.to_xarray()
    name = model.structure.regressor_names[2]
    assert float(data["theta"].sel(output="y", regressor=name)) == model.theta[2, 0]
    assert data.attrs == {"basis": repr(model.structure.basis), "dt": 0.1, "method": "ls"}
    assert data["regressor"].attrs["units"][2] == "rad"


def test_a_model_with_known_kinematics_shows_its_aerodynamics(pd):
    vehicle = Vehicle(degree=1, na={"p": 1}, nb={"d_lon": 1, "d_lat": 1, "d_col": 1, "d_ped": 1})
    found = idn.fit(vehicle.kin, vehicle.record(400, sensors=np.full(8, 1e-3)))
    frame = found.to_frame()
    np.testing.assert_array_equal(frame.to_numpy(), found.theta)
    assert len(repr(found)) <= 1000


def test_a_measured_response_is_drawn_with_its_error(record, pd):
    from matplotlib.figure import Figure

    found = idn.frequency_response(record, ["y"], ["u"], window=10.0, band=(1.0, 5.0))
    ax = Figure().subplots()
    assert found.plot(ax) is ax
    (line,) = ax.lines
    np.testing.assert_allclose(line.get_ydata(), np.abs(found.G[:, 0, 0]))
    assert line.get_label() == "y from u, 1/s"
    assert ax.get_xlabel() == "frequency (rad/s)"
    frame = found.to_frame()
    np.testing.assert_array_equal(frame["y from u"], found.G[:, 0, 0])
    np.testing.assert_array_equal(frame["coherence of y from u"], found.coherence[:, 0, 0])
    assert frame.attrs["units"]["omega"] == "rad/s"


def test_a_history_is_drawn_as_its_coefficients_settle(record):
    basis = idn.Polynomial(1, -1.0, 1.0)
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis)
    history = idn.RecursiveLeastSquares(arx).run(record)
    ax = history.plot()
    *curves, _ = ax.lines
    assert len(curves) == history.coefficients.shape[1] == len(history.regressor_names)
    for curve, along in zip(curves, history.coefficients[:, :, 0].T, strict=True):
        np.testing.assert_allclose(curve.get_ydata(), along / along[-1], rtol=1e-12)
        assert curve.get_ydata()[-1] == 1.0
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    last = history.coefficients[-1, 2, 0]
    assert legend[2] == f"{history.regressor_names[2]}, {last:.3g}"
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        "time (s)",
        "coefficients of y by their last value",
    )
    given = ax.figure.add_subplot()
    assert history.plot(given, regressors=history.regressor_names[:1]) is given
    assert len(given.lines) == 2
    with pytest.raises(UnknownNameError, match="output"):
        history.plot(output="q")
    with pytest.raises(UnknownNameError, match="regressor"):
        history.plot(regressors=["y(k-7)"])


def test_a_history_with_known_kinematics_is_drawn():
    vehicle = Vehicle(degree=1, na={"p": 1}, nb={"d_lon": 1, "d_lat": 1, "d_col": 1, "d_ped": 1})
    data = vehicle.record(400, sensors=np.full(8, 1e-3))
    history = idn.RecursiveLeastSquares(vehicle.kin).run(data)
    ax = history.plot(output=str(history.outputs[1]))
    assert len(ax.lines) == 1 + len(history.regressor_names)
    assert ax.get_legend() is None  # more curves than a legend holds


def test_bands_wait_to_be_shown(record, model):
    import matplotlib.pyplot as plt

    axes = idn.uncertainty(model, record).plot()
    assert [plt.figure(n) for n in plt.get_fignums()] == [axes[0].figure]
