"""Constant coefficients ask for no scheduling signal."""

import numpy as np
import pytest
from known_systems import moving

import identification as idn
from symheli import FlightRecord
from symheli.errors import InputError

A = np.array([[0.8, 0.1], [-0.2, 0.7]])
B = np.array([[0.4, -0.3], [0.2, 0.9]])
TANKS = idn.LPVARX(("level", "flow"), ("valve", "pump"), na=1, nb=1, delay=1)


@pytest.fixture(scope="module")
def tanks():
    rng, y = np.random.default_rng(0), np.zeros((300, 2))
    u = rng.normal(size=(300, 2))
    for k in range(1, 300):
        y[k] = A @ y[k - 1] + B @ u[k - 1]
    columns = dict(zip(("level", "flow", "valve", "pump"), np.hstack([y, u]).T, strict=True))
    return FlightRecord.from_arrays(0.5 * np.arange(300), dict.fromkeys(columns, "1"), **columns)


@pytest.mark.parametrize("method", ["ls", "rls", "ridge", "lasso", "riv", "oe", "bj", "armax"])
def test_a_plant_that_nothing_schedules_is_recovered(tanks, method):
    found = idn.fit(TANKS, tanks, method=method)
    # ridge and lasso shrink by what cross-validation finds without noise: nearly nothing
    np.testing.assert_allclose(found.at().A, A, atol=1e-6)
    np.testing.assert_allclose(found.at().B, B, atol=1e-6)


def test_the_model_goes_through_files_recursion_and_reports(tanks, tmp_path):
    found = idn.fit(TANKS, tanks)
    again = idn.model.LPVARXModel.load(found.save(tmp_path / "tanks.json"))
    assert again.structure == TANKS
    np.testing.assert_array_equal(again.simulate(tanks), found.simulate(tanks))
    assert "samples over" not in str(found.excitation)
    assert TANKS.regressor_names == ("level(k-1)", "flow(k-1)", "valve(k-1)", "pump(k-1)")
    history = idn.RecursiveLeastSquares(TANKS).run(tanks)
    np.testing.assert_allclose(history.state.theta, found.theta, atol=1e-6)
    assert idn.scores(found, tanks).free_run["level"] == pytest.approx(100.0)


def test_the_baseline_of_a_scheduled_structure_fits_records_with_and_without_the_signal(tanks):
    speeds = tanks.with_signals({"airspeed": "m/s"}, airspeed=moving(300))
    lpv = idn.LPVARX(
        ("level", "flow"),
        ("valve", "pump"),
        "airspeed",
        na=1,
        nb=1,
        delay=1,
        basis=idn.Polynomial(1, 0.0, 13.0),
    )
    without, with_it = idn.fit(lpv.lti(), tanks), idn.fit(lpv.lti(), speeds)
    np.testing.assert_array_equal(without.theta, with_it.theta)
    np.testing.assert_array_equal(without.simulate(speeds), with_it.simulate(tanks))


def test_what_needs_a_schedule_is_refused_without():
    with pytest.raises(InputError, match="name the signal"):
        idn.LPVARX("y", "u", na=1, nb=1, delay=1, offset_rate=True)
    with pytest.raises(InputError, match="name the signal"):
        idn.LPVARX("y", "u", na=1, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 1.0))
