"""Calibration of physical parameters: exact recovery, honest deviations, refusals."""

import numpy as np
import pytest

import identification as idn
import symheli
from symheli.errors import InputError

BLADES = ["chord", "lift_slope", "profile_drag"]
KNOWN = ["body.Ixx", "body.Iyy", "main_rotor.bar_lock_number"]


@pytest.fixture(scope="module")
def flown(ideal):
    """A quarter of a minute with every axis excited, at 30 dB and without noise."""
    schedule = symheli.AirspeedSchedule.transition(2.0, 6.0, acceleration=2.0, hold=2.0)
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 8.0, 0.02)
    shaken = symheli.Excitation(
        {"d_lon": 0.015, "d_lat": 0.01, "d_col": 0.01, "d_ped": 0.015}, "multisine", (0.1, 4.0), 1
    )
    plan = {"controller": lqr, "excitation": shaken}
    return {
        "clean": symheli.fly(ideal, schedule, **plan),
        "noisy": symheli.fly(ideal, schedule, noise_db=30.0, seed=1, **plan),
    }


@pytest.fixture(scope="module")
def wrong(ideal):
    return ideal.with_parameters({"body.Ixx": 0.27, "body.Iyy": 0.25, KNOWN[2]: 1.1})


@pytest.mark.slow
def test_without_noise_parameters_come_back(ideal, wrong, flown):
    """With the steps of the flight itself the equations are the same to rounding; the priors pull
    by the square of noise over prior.
    """
    found = idn.calibrate(wrong, flown["clean"], KNOWN, window=1.0, step=0.005)
    truth = [ideal.parameters[name] for name in KNOWN]
    np.testing.assert_allclose(found.values, truth, rtol=1e-5)
    assert found.converged
    assert found.determined.all()


@pytest.mark.slow
def test_noise_leaves_errors_of_the_stated_size(ideal, wrong, flown):
    found = idn.calibrate(wrong, flown["noisy"], KNOWN)
    errors = found.values - [ideal.parameters[name] for name in KNOWN]
    assert np.all(np.abs(errors) < 4 * found.deviations)  # 1 in 5000 each, were they Gaussian
    assert np.all(found.deviations < 0.05 * found.values)
    assert max(map(abs, found.whiteness.values())) < 0.1  # 3 standard deviations of 1/sqrt(n)


@pytest.mark.slow
def test_a_missing_measurement_is_no_error(ideal, wrong, flown):
    record, rng = flown["noisy"], np.random.default_rng(0)
    q = np.where(rng.random(len(record)) < 0.3, np.nan, record["q"])
    holes = record.select([s for s in record.signals if s != "q"]).with_signals({"q": "rad/s"}, q=q)
    found = idn.calibrate(wrong, holes, KNOWN)
    errors = found.values - [ideal.parameters[name] for name in KNOWN]
    assert np.all(np.abs(errors) < 4 * found.deviations)


@pytest.mark.slow
def test_what_a_flight_does_not_tell_stays_at_the_prior(wrong, flown):
    """Where the governor is ideal no motion depends on the engine; the areas of a surface and their
    lift slope enter as a product.
    """
    names = ["drivetrain.max_power", *(f"main_rotor.{n}" for n in BLADES), *KNOWN]
    found = idn.calibrate(wrong, flown["noisy"], names)
    prior = wrong.parameters[names[0]]
    assert found.values[0] == pytest.approx(prior, rel=1e-9)
    assert found.deviations[0] == pytest.approx(found.prior_deviations[0], rel=1e-6)
    assert not found.determined[:4].any()
    assert found.tied["main_rotor.chord"] in {f"main_rotor.{n}" for n in BLADES}
    assert f"only together with {found.tied['main_rotor.chord']}" in str(found)


@pytest.mark.slow
def test_the_file_keeps_the_deviations_and_they_are_the_next_prior(wrong, flown, tmp_path):
    found = idn.calibrate(wrong, flown["noisy"], KNOWN)
    again = symheli.Helicopter.load(found.save(tmp_path / "mine.toml"), governor="ideal")
    assert again.parameters["body.Ixx"] == found.values[0]
    assert again.vehicle.quantities["body.Ixx"].deviation == pytest.approx(found.deviations[0])
    assert again.vehicle.quantities["body.mass"].deviation == 0.0
    second = idn.calibrate(again, flown["noisy"], KNOWN)
    np.testing.assert_allclose(second.prior_deviations, found.deviations, rtol=1e-12)
    # the same flight twice: half the variance, from two equal pieces of information
    np.testing.assert_allclose(second.deviations, found.deviations / np.sqrt(2), rtol=0.2)


@pytest.mark.slow
def test_hidden_rotor_states_are_estimated_too(pi):
    schedule = symheli.AirspeedSchedule.transition(2.0, 4.0, acceleration=2.0, hold=2.0)
    lqr = symheli.flight.gain_scheduled_lqr(pi, 0.0, 8.0, 0.02)
    shaken = symheli.Excitation({"d_lat": 0.01, "d_col": 0.02}, "multisine", (0.1, 4.0), 1)
    flight = symheli.fly(pi, schedule, controller=lqr, excitation=shaken, noise_db=40.0)
    flight = flight.select([s for s in flight.signals if s not in ("Om", "om_i", "a1", "b1")])
    wrong = pi.with_parameters({"body.Ixx": 0.25})
    found = idn.calibrate(wrong, flight, ["body.Ixx"])
    assert found.values[0] == pytest.approx(pi.parameters["body.Ixx"], rel=0.03)


@pytest.mark.slow
def test_wind_leaves_residuals_that_are_not_white(ideal, flown):
    schedule = symheli.AirspeedSchedule.transition(2.0, 6.0, acceleration=2.0, hold=2.0)
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 8.0, 0.02)
    air = symheli.Wind((0, 0, 0), turbulence=symheli.environment.Dryden(8.0, 30.0), seed=1)
    gusty = symheli.fly(ideal, schedule, controller=lqr, wind=air, noise_db=30.0)
    with pytest.warns(symheli.errors.DataWarning, match="no white noise: wind"):
        found = idn.calibrate(ideal, gusty, KNOWN[:1])
    assert max(found.whiteness.values()) > 0.5
    assert "The residuals of" in str(found)


@pytest.mark.slow
def test_a_steady_wind_is_estimated_beside_the_parameters(ideal, wrong):
    """3 m/s from ahead: without the wind the residuals tell, with it they are white and the
    parameters right.
    """
    schedule = symheli.AirspeedSchedule.transition(2.0, 6.0, acceleration=2.0, hold=2.0)
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 8.0, 0.02)
    shaken = symheli.Excitation({"d_lon": 0.015, "d_lat": 0.01}, "multisine", (0.1, 4.0), 1)
    flight = symheli.fly(
        ideal,
        schedule,
        controller=lqr,
        excitation=shaken,
        wind=symheli.Wind((-3.0, 0.0, 0.0)),
        noise_db=30.0,
    )
    found = idn.calibrate(wrong, flight, KNOWN, gust=3.0)
    errors = found.values - [ideal.parameters[name] for name in KNOWN]
    assert np.all(np.abs(errors) < 4 * found.deviations)
    assert not found.coloured


@pytest.mark.slow(only="change4-as long as a window")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": ["body.weight"]}, "unknown parameter 'body.weight'"),
        ({"parameters": ["density"]}, "density is not calibrated"),
        ({"parameters": ["controls.d_lon"]}, "controls.d_lon is not calibrated"),
        ({"window": 0.0}, "window"),
        ({"window": 1e4}, "as long as a window"),
        ({"rounds": 0}, "rounds"),
        ({"gust": -1.0}, "gust"),
    ],
)
def test_bad_arguments_are_refused(ideal, flown, change, message):
    with pytest.raises(InputError, match=message):
        idn.calibrate(ideal, flown["clean"], **{"parameters": KNOWN, **change})


def test_bad_records_are_refused(ideal, flown):
    record = flown["clean"]
    with pytest.raises(InputError, match="no d_ped: calibration needs the deflection"):
        idn.calibrate(ideal, record.select([s for s in record.signals if s != "d_ped"]))
    with pytest.raises(InputError, match="share none of the outputs"):
        idn.calibrate(ideal, record.select(["d_lon", "d_lat", "d_col", "d_ped", "a1"]))
    with pytest.raises(InputError, match="no flights"):
        idn.calibrate(ideal, [])
    with pytest.raises(InputError, match="sample periods"):
        idn.calibrate(ideal, [record, record.decimate(2)], KNOWN)
    with pytest.raises(InputError, match="calibrate\\(heli, records\\)"):
        idn.calibrate(record, ideal)


@pytest.mark.slow
def test_a_search_that_is_cut_short_says_so(wrong, flown):
    with (
        pytest.warns(symheli.errors.ConvergenceWarning, match="allow more rounds"),
        pytest.warns(symheli.errors.DataWarning, match="no white noise"),
    ):
        found = idn.calibrate(wrong, flown["noisy"], KNOWN, rounds=1)
    assert "had not converged" in str(found)
