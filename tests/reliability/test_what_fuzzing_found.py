"""Inputs that once ended in another exception, in NaN without a word or in no answer at all."""

import math
from dataclasses import replace

import good_files
import numpy as np
import pytest
from damaged_files import damaged
from scipy.io import savemat

import identification as idn
import symheli
import synthesis
from identification.estimators.block_banded import Whitening
from symheli import LinearModel, lpv
from symheli.errors import (
    AccuracyError,
    DataWarning,
    ExcitationError,
    InputError,
    SolverError,
    UnknownNameError,
)
from symheli.lpv.tools import LinearModels
from symheli.values import plain_file
from symheli.values.text_file import text_of
from synthesis.design.plant.refusals import levels_above
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.program.interruptible import no_panic

T = np.arange(0.0, 4.0, 0.02)
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def record():
    u, y = RNG.uniform(-1, 1, 120), np.zeros(120)
    for k in range(1, 120):
        y[k] = 0.5 * y[k - 1] + u[k - 1] + 0.01 * RNG.standard_normal()
    return symheli.FlightRecord.from_arrays(
        0.1 * np.arange(120), dict.fromkeys("yup", "1"), y=y, u=u, p=np.sin(np.arange(120))
    )


@pytest.fixture(scope="module")
def model(record):
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))
    return idn.fit(arx, record)


@pytest.mark.parametrize("degree", [math.nan, math.inf, 1.5, 2.0, True, -1])
def test_a_degree_is_a_whole_number(degree):
    with pytest.raises(InputError, match="degree: expected a whole number"):
        idn.Polynomial(degree, 0.0, 1.0)


@pytest.mark.parametrize("seed", [math.nan, -1, 0.5])
def test_a_seed_is_a_whole_number(seed):
    for make in (
        lambda: symheli.Wind(seed=seed),
        lambda: symheli.Excitation({"d_lon": 0.01}, seed=seed),
        lambda: symheli.environment.Dryden(wind=5.0, altitude=50.0).history(T, 5.0, seed),
        lambda: symheli.FlightPlan(symheli.AirspeedSchedule.transition(4.0, 5.0), seed=seed),
    ):
        with pytest.raises(InputError, match="seed"):
            make()


@pytest.mark.parametrize("time", [[], [0.0], [0.0, 0.0], [1.0, 0.5], [0.0, math.nan], 3.0])
def test_an_excitation_wants_increasing_times(time):
    with pytest.raises(InputError, match="time"):
        symheli.Excitation({"d_lon": 0.01})(np.asarray(time))


@pytest.mark.parametrize("band", [(0.1,), (0.1, 1.0, 5.0), ()])
def test_a_band_has_two_ends(band):
    with pytest.raises(InputError, match="band"):
        symheli.Excitation({"d_lon": 0.01}, band=band)


def test_a_period_is_finite():
    with pytest.raises(InputError, match="period"):
        symheli.Excitation({"d_lon": 0.01}, period=math.nan)


def test_laps_are_counted():
    with pytest.raises(InputError, match="laps"):
        symheli.AirspeedSchedule.transition(0.0, 13.0, laps=-(10**30))


def test_a_wind_has_three_components():
    with pytest.raises(InputError, match="north, east, down"):
        symheli.steady.FlightCondition(5.0, wind=(0.0, 0.0))


def test_noise_in_decibels_is_a_number_that_can_be_raised_to():
    schedule = symheli.AirspeedSchedule.transition(4.0, 5.0)
    with pytest.raises(InputError, match="noise_db"):
        symheli.FlightPlan(schedule, noise_db=-5e15)


def test_a_sample_of_a_billion_years_is_refused_and_not_begun(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    x0 = np.tile(point.x.array, (2, 1))
    for dt in (4.3e16, 1e300):
        with pytest.raises(InputError, match="steps"):
            symheli.integrate.simulate_batch(ideal, x0, [point.u.array] * 2, dt=dt)


def test_rows_outside_a_record_are_refused(record):
    for keep in (np.full(120, math.nan), np.ones(3, bool), np.ones((120, 1), bool), [500]):
        with pytest.raises(InputError, match="rows"):
            record.rows(keep)


def test_a_horizon_beyond_the_record_predicts_nothing_at_once(model, record):
    """A trillion steps were walked through."""
    for hold in (False, True):
        assert np.isnan(model.predict(record, 10**12, hold_p=hold)).all()


def test_an_order_of_a_trillion_lags_is_refused_at_once():
    with pytest.raises(InputError, match="from 0 to"):
        idn.LPVARX("y", "u", "p", na=10**12, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))


def test_derivatives_of_a_basis_have_an_order():
    basis = lpv.BSpline(2, (0.0, 0.5, 1.0))
    for order in (math.nan, math.inf, 1.5, -1):
        with pytest.raises(InputError, match="derivative"):
            basis([0.5], order)
    assert not basis([0.5], 10**12).any()


@pytest.mark.parametrize("dt", [0.0, -1.0, 1e-300, math.nan, math.inf])
def test_lags_need_a_sample_period(dt):
    with pytest.raises(InputError, match="dt"):
        idn.structure.LaggedSignals("u").instrument_lags(dt, 1, 1)


def test_counts_of_the_judges_are_whole(model, record):
    for judge in (
        lambda n: idn.residual_analysis(model, record, lags=n),
        lambda n: idn.judge.slow_modes(model, record, points=n),
        lambda n: idn.choose_experiments((), n),
    ):
        for count in (math.nan, 0, 1.5):
            with pytest.raises(InputError, match="whole number"):
                judge(count)


def test_a_verdict_is_on_an_output_of_models_that_can_differ(model, record):
    """KeyError for a name that is none, ValueError for a structure that is itself constant."""
    found = idn.judge.compare_constant(model.structure, *record.split(0.7))
    constant = idn.judge.compare_constant(model.structure.lti(), *record.split(0.7))
    for ask in (
        idn.judge.against_constant.AgainstConstant.pays,
        idn.judge.against_constant.AgainstConstant.verdict_on,
    ):
        with pytest.raises(UnknownNameError, match="unknown output 'yx'; did you mean 'y'"):
            ask(found, "yx")
        with pytest.raises(InputError, match="basis of degree 1"):
            ask(constant, "y")


def test_iterations_are_counted():
    simulator = symheli.flight.SimulatedFlight(symheli.Helicopter.load("xcell60", governor="ideal"))
    for make in (
        lambda n: idn.methods.RefinedInstruments(iterations=n),
        lambda n: idn.methods.OutputError(evaluations=n),
        lambda n: idn.methods.FilterError(simulator, steps=n),
    ):
        for count in (math.nan, 1.5, 0):
            with pytest.raises(InputError, match="whole number"):
                make(count)


@pytest.mark.parametrize("back_off", [-1e300, 0.5, math.nan, 1.6e16, ()])
def test_a_level_above_the_optimum_is_near_it(back_off):
    """1.6e16 made Clarabel panic, which is no `Exception`."""
    with pytest.raises(InputError, match="back_off"):
        levels_above(back_off)


def test_a_panic_of_a_solver_is_an_error_of_this_project():
    panic = type("PanicException", (BaseException,), {})
    with pytest.raises(SolverError, match="index out of bounds"), no_panic():
        raise panic("index out of bounds")
    with pytest.raises(KeyboardInterrupt), no_panic():
        raise KeyboardInterrupt


def test_grids_and_tolerances_of_the_analysis_are_checked():
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    for points in (math.nan, 0, 1.5):
        with pytest.raises(InputError, match="points"):
            synthesis.analysis.attitude_bandwidth(lag, points=points)
    p = symheli.Scheduling("p", "1", 0.0, 1.0)
    lpv = symheli.LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    for points in (0, -1):
        with pytest.raises(InputError, match="points"):
            synthesis.frozen_gain(lpv, points=points)
    for tolerance in (math.nan, 0.0, 1.0, 1e300):
        with pytest.raises(InputError, match="tolerance"):
            synthesis.analysis.frozen_box_gain(lpv.to_lft(), tolerance=tolerance)
        with pytest.raises(InputError, match="tolerance"):
            synthesis.frozen_gain(lpv, tolerance=tolerance)


def test_a_text_file_with_flipped_bytes_is_refused(tmp_path):
    """A vehicle file with one bit changed ended in UnicodeDecodeError."""
    path = tmp_path / "vehicle.toml"
    path.write_bytes(b'title = "\xe1"')
    with pytest.raises(InputError, match="UTF-8"):
        symheli.Helicopter.load(path)
    with pytest.raises(InputError, match="No such file"):
        text_of(tmp_path / "none")


def test_a_number_replaced_by_nan_in_a_saved_file_is_refused(tmp_path):
    """NaN is read by Python's JSON and ended in ValueError where the digest was made."""
    path = plain_file.write(tmp_path / "one.json", "one", {"value": 1.5})
    path.write_text(path.read_text(encoding="utf-8").replace("1.5", "NaN"), encoding="utf-8")
    with pytest.raises(InputError, match="NaN is no number"):
        plain_file.read(path, "one")


@pytest.mark.parametrize("seed", [123, 297])
def test_a_damaged_mat_file_is_refused_before_scipy_reads_it(tmp_path, seed):
    """SciPy ended the process with a segmentation fault."""
    savemat(tmp_path / "log.mat", {"t": T[:40], "q": np.sin(T[:40]), "u": 0.1 * T[:40]})
    path = tmp_path / "damaged.mat"
    path.write_bytes(damaged((tmp_path / "log.mat").read_bytes(), seed)[1])
    with pytest.raises(InputError, match="save it once more"):
        symheli.FlightRecord.from_mat(path, time="t", units={"q": "rad/s", "u": "1"})


def test_a_topic_of_a_ulog_without_time_stamps_is_left_out_and_said(tmp_path):
    """One flipped bit in the name of the field ended in KeyError."""
    pytest.importorskip("pyulog")
    path = tmp_path / "log.ulg"
    path.write_bytes(good_files.ulog_of(T).replace(b"timestamp;", b"tilestamp;"))
    with pytest.warns(DataWarning, match="damaged"), pytest.raises(InputError, match="armed"):
        symheli.FlightRecord.from_ulog(path, {"q": ("rates", "xyz[1]", "rad/s")}, dt=0.02)


def test_a_miss_is_that_of_a_finite_pole(model):
    for pole in (math.nan, math.inf, 0.0):
        with pytest.raises(InputError, match="pole"):
            idn.judge.pole_distance(model.at(0.0), pole)


def test_a_fit_is_that_of_measurements_that_can_be_squared():
    for y in (math.inf, -1e300):
        with pytest.raises(InputError, match="mark bad samples"):
            idn.judge.fit_percent([1.0, 2.0, y], [1.0, 2.0, 3.0])
    assert idn.judge.fit_percent([1.0, 2.0], [1.0, 1e300]) == -math.inf


def test_scores_have_a_name_a_column():
    y = np.arange(5.0)[:, None]
    for names in ([], ["y", "y"]):
        with pytest.raises(InputError, match="outputs"):
            idn.judge.Scores.of(y, names, one_step=y, ahead=y, free_run=y)
    for horizon in (math.nan, 0.0, -1.0, math.inf):
        with pytest.raises(InputError, match="horizon"):
            idn.judge.Scores.of(y, ["y"], one_step=y, ahead=y, free_run=y, horizon=horizon)


@pytest.mark.parametrize(
    "lags", [{"na": 1.5}, {"na": math.nan}, {"nb": 1.5}, {"nb": math.nan}, {"na": (1,) * 12}]
)
def test_lags_of_a_vehicle_are_counted(lags):
    given = {"nb": 1, **lags}
    with pytest.raises(InputError, match=r"na:|nb:"):
        idn.KinematicARX(("d",), "p", basis=idn.Polynomial(0, 0.0, 1.0), **given)


def test_designs_refuse_what_they_cannot_mean():
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    for design in (
        lambda: synthesis.designs.ncfsyn(lag, W1=0.0),
        lambda: synthesis.designs.ncfsyn(lag, W2=-0.0),
        lambda: synthesis.designs.ncfsyn(lag, back_off=1e300),
        lambda: synthesis.designs.mixed_sensitivity(lag, 1.0, 1.0, back_off=1e300),
        lambda: synthesis.h2(lag, ["u"], ["y", "y"]),
        lambda: synthesis.analysis.attitude_bandwidth(lag, band=(1.0,)),  # type: ignore[arg-type]
        lambda: synthesis.analysis.LowerBoundSearch(levels=math.nan),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError, match="expected"):
            design()


@pytest.mark.parametrize("gain", [5e-324, 1e-300, 1e-200, 1.0, 1e200, 1e300])
def test_margins_of_an_integrator_are_those_of_any_units(gain):
    """k/s: 90 deg at k rad/s, a disk of 2, whatever the unit of time. The squares of k left the
    range of numbers: an infinite phase at 1e-200, an exception of NumPy at 5e-324 and 1e300.
    """
    integrator = LinearModel([[0.0]], [[1.0]], [[gain]], [[0.0]], ["x"], ["u"], ["y"])
    found = synthesis.margins(integrator)
    assert (found.phase, found.disk) == pytest.approx((math.pi / 2, 2.0))
    assert found.crossover == pytest.approx((gain,))
    assert found.delay == pytest.approx(math.pi / 2 / gain)
    assert synthesis.disk_margin(integrator) == pytest.approx(2.0)


def test_a_response_beyond_the_range_of_numbers_is_refused():
    with pytest.raises(AccuracyError, match="other units"):
        norm(np.diag([-1.0, -5e-324]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))


@pytest.mark.slow
def test_a_constant_parameter_has_no_growth_in_a_cycle():
    """It was NaN, and nothing said so."""
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    lag = symheli.LPVStateSpace.polynomial([[[-1.5]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    found = synthesis.lower_bound(lag)
    assert (found.trajectory, found.growth) == (None, None)


def test_frozen_models_are_compared_below_the_fastest_frequency(model):
    """No frequency was left to compare: ValueError of an empty maximum."""
    p = symheli.Scheduling("p", "1", -1.0, 1.0)
    lag = symheli.LPVStateSpace.polynomial(
        [[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p, states=["y"], inputs=["u"], outputs=["y"]
    )
    models = {"baseline": lag, "identified": model}
    asked = {"mode": {0.0: -1.0}, "scales": {"y": 1.0, "u": 1.0}, "channel": ("u", "y")}
    for fast in (1e300, math.inf, math.nan, 0.81 * math.pi / model.dt):
        with pytest.raises(InputError, match="fast: expected at most"):
            idn.compare_frozen(models, {0.0: lag.at(0.0)}, **asked, fast=fast)


@pytest.fixture(scope="module")
def slow_plant():
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    lag = symheli.LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [[[1.0, 1.0]]], [[[1.0]]], [[[0.0, 0.0]]], p, inputs=["w", "u"]
    )
    return synthesis.Plant(
        lag, disturbances=["w"], performance=lag.outputs, controls=["u"], measurements=lag.outputs
    )


@pytest.fixture(scope="module")
def sampled_plant():
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    lag = symheli.LPVStateSpace.polynomial(
        [[[0.9]], [[0.3]]],
        [[[0.1, 0.1]]],
        [[[1.0]]],
        [[[0.0, 0.0]]],
        p,
        dt=0.1,
        inputs=["w", "u"],
        outputs=["y"],
    )
    return synthesis.Plant(
        lag, disturbances=["w"], performance=["y"], controls=["u"], measurements=["y"]
    )


@pytest.mark.parametrize("order", [math.nan, math.inf, 1.5, 0, 11])
def test_a_delay_has_an_order(slow_plant, order):
    for delayed in (
        slow_plant.with_delay,
        lambda t, order: symheli.lpv.tools.pade_delay("u", t, order),
    ):
        with pytest.raises(InputError, match="order"):
            delayed(0.1, order=order)


@pytest.mark.parametrize("samples", [math.nan, math.inf, 1.5, 0, True])
def test_a_delay_in_samples_is_counted(samples):
    with pytest.raises(InputError, match="samples: expected a whole number"):
        symheli.lpv.tools.sample_delay("u", samples, 0.1)


@pytest.mark.parametrize("tolerance", [1e-300, 0.0, -1.0, 1.0, math.nan, math.inf])
def test_how_far_a_proof_reaches_is_found_to_a_tolerance(slow_plant, tolerance):
    """1e-300 was bisected to, a proof each time."""
    with pytest.raises(InputError, match="tolerance"):
        synthesis.analysis.proven_around(slow_plant, {("u", "y1"): -1.0}, 0.5, tolerance=tolerance)


@pytest.mark.parametrize("size", [1e100, -1e300, 1.7e308])
def test_residuals_that_cannot_be_squared_are_refused(model, record, size):
    """Coefficients of 1e300 made NaN of the share that p explains, and of standard errors."""
    large = replace(model, theta=np.full(model.theta.shape, size))
    for judge in (idn.judge.dependence_report, idn.uncertainty, idn.judge.slow_modes):
        with pytest.raises(InputError, match="residuals of"):
            judge(large, record)


def test_records_that_determine_nothing_say_nothing_of_certainty(model, record):
    """LinAlgError, where nothing moved; standard errors made of rounding, where p did not."""
    y, u, p = record["y"], record["u"], np.zeros(len(record))
    rest = record.with_signals(dict.fromkeys("yup", "1"), y=p, u=p, p=p)
    held = record.with_signals(dict.fromkeys("yup", "1"), y=y, u=u, p=p)
    for one in (rest, held):
        for judge in (idn.uncertainty, idn.judge.slow_modes):
            with pytest.raises(ExcitationError, match="distinct values"):
                judge(model, one)


@pytest.mark.parametrize("count", [math.nan, -1, 1.5, 1e300])
def test_samples_of_a_fit_are_counted(model, count):
    for which in ("rows_used", "rows_dropped"):
        with pytest.raises(InputError, match=which):
            replace(model, **{which: count})


@pytest.mark.parametrize("window", [1e16, 1e300, 1.7e308])
def test_a_window_beyond_the_record_is_refused_at_once(record, window):
    """NumPy was asked for an array of that size, or for the integer of infinity."""
    with pytest.raises(ExcitationError, match="longer than every record"):
        idn.frequency_response(record, ["y"], ["u"], window=window)


@pytest.mark.parametrize("seconds", [4e16, 12.0, 0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["horizon", "window"])
def test_a_model_is_judged_over_a_horizon_and_windows_within_the_record(
    model, record, name, seconds
):
    """11.9 s of record: what lies beyond gave NaN for Theil's coefficient and for J."""
    within = {"horizon": 1.0, "window": 4.0, name: seconds}
    with pytest.raises(InputError, match=rf"{name}: .* up to 11\.9 of the longest record"):
        idn.fit_for_control(
            model, record, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0}, **within
        )


def test_a_short_record_is_judged_as_far_as_it_goes(model, record):
    """Shorter than the usual window of 8 s: what that would tell is not known."""
    short = record.rows(slice(0, 60))
    found = idn.fit_for_control(model, short, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0})
    assert (found["J"].verdict, found["TIC"].verdict) == ("not known", "fit")


def test_theils_coefficient_is_that_of_numbers_that_can_be_squared():
    """1e300 beside 1 counted as rounding, a perfect prediction; nothing at all as NaN."""
    for y, guess in (([1.0, 2.0], [1e300, 2.0]), ([1e300, 2.0], [1.0, 2.0]), ([], [])):
        with pytest.raises(InputError, match="two finite arrays"):
            idn.judge.theil(np.array(y), np.array(guess))


def test_a_listener_can_be_called():
    """TypeError in the middle of the work that was told of."""
    with pytest.raises(InputError, match="listener"), symheli.progress.watched("progress"):  # type: ignore[arg-type]
        pytest.fail("entered")


@pytest.mark.parametrize("error", [1.0, 1e16, 1e300])
def test_a_reading_is_wrong_by_the_range_at_most(sampled_plant, error):
    """LinAlgError at 1e300; a reading beyond the range counts as its end, so that all of these are
    one. u = -(1 + 3 p) y is wrong by at most 3 y.
    """
    nothing, through, p = np.zeros((0, 0)), np.zeros((0, 1)), sampled_plant.parameters[0]
    gain = symheli.LPVStateSpace.polynomial(
        [nothing],
        [through],
        [np.zeros((1, 0))],
        [[[-1.0]], [[-3.0]]],
        p,
        inputs=["y"],
        outputs=["u"],
    )
    wrong = synthesis.analysis.with_scheduling_error(sampled_plant, gain, error)
    _, B, C, _ = wrong.model.matrices(0.5)
    assert abs(float(C[1, 0] * B[0, 1])) == pytest.approx(0.1 * 3.0)


def test_an_empty_archive_of_models_is_refused(tmp_path):
    """EOFError of NumPy."""
    (tmp_path / "family.npz").write_bytes(b"")
    with pytest.raises(InputError, match="not a whole file"):
        symheli.LinearFamily.load(tmp_path / "family.npz")


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("duration/.zarray", b'{"shape": [2'),
        ("duration/.zarray", b'{"shape": [2], "chunks": [[]], "dtype": "<f8", "fill_value": 0}'),
        ("time/.zarray", b'{"shape": [3], "chunks": [3], "dtype": "|O", "fill_value": null}'),
        (
            "values/.zarray",
            b'{"shape": [9, 3, 2], "chunks": [1, 3, 2], "dtype": "<f8", "fill_value": "NaN"}',
        ),
    ],
)
def test_a_damaged_description_of_flights_is_refused(tmp_path, file, content):
    """JSONDecodeError, TypeError, or seven flights more than there were."""
    path = next(one for one in good_files.folders(tmp_path) if one.entry == "flights").path
    (path / file).write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        symheli.flight.FlightDataset(path)


def test_damaged_parameters_of_a_campaign_are_refused_and_damaged_descriptions_said_anew(tmp_path):
    campaign = next(one for one in good_files.folders(tmp_path) if one.entry == "campaign")
    (campaign.path / "values" / ".zarray").write_bytes(b"{")
    assert campaign.read(campaign.path)["period"][:2].tolist() == [1.4, 2.0]
    cases = campaign.path / "cases.json"
    cases.write_bytes(cases.read_bytes().replace(b"0.5", b"0.7"))
    with pytest.raises(InputError, match="digest"):
        campaign.read(campaign.path)


def test_a_reason_that_is_no_text_is_refused(tmp_path):
    """ValueError of a character beyond the last one."""
    campaign = next(one for one in good_files.folders(tmp_path) if one.entry == "campaign")
    reason = campaign.path / "reason" / "2"
    reason.write_bytes(b"\xff" * len(reason.read_bytes()))
    with pytest.raises(InputError, match="not a text file"):
        campaign.read(campaign.path)


def test_gusts_are_forgotten_however_far_apart_the_samples_are():
    """inf exp(-inf), NaN, at 1e300 m/s; what lies 1000 lengths apart is white already."""
    gust = symheli.environment.Dryden(wind=5.0, altitude=50.0)
    far, farther = (gust.history(T, speed, 1) for speed in (1e12, 1.7e308))
    np.testing.assert_array_equal(far, farther)
    assert np.all(np.isfinite(far))


def test_information_of_an_experiment_is_finite():
    """LinAlgError where experiments were chosen among."""
    for factor, seconds in ((np.full((2, 2), np.nan), 1.0), (np.eye(2)[:1], 1.0), (np.eye(2), 0.0)):
        with pytest.raises(InputError, match=r"factor|duration"):
            idn.design.Experiment("one", seconds, factor, {})


@pytest.mark.slow
def test_trims_are_numbers_with_controls_on_their_stops_or_not(ideal):
    """NaN was carried on, as true."""
    trims = symheli.steady.trim_batch(ideal, airspeed=[4.0, 5.0])
    for name in ("x", "u", "xdot", "residual", "wind", "density", "torque"):
        for wrong in (np.full(getattr(trims, name).shape, np.nan), np.zeros((1, 1))):
            with pytest.raises(InputError, match=name):
                replace(trims, **{name: wrong})
    for name in ("on_stops", "vortex_ring"):
        with pytest.raises(InputError, match=f"{name}: expected truth values"):
            replace(trims, **{name: np.full(getattr(trims, name).shape, np.nan)})


@pytest.mark.parametrize("shape", [(0, 2, 1, 2), (1, 2, 2), (2, 2, 2, 2)])
def test_a_covariance_is_that_of_the_coefficients(model, record, shape):
    with pytest.raises(InputError, match="covariance: expected shape"):
        idn.fit_for_control(
            model,
            record,
            {("u", "y"): -0.1},
            scales={"y": 1.0, "u": 1.0},
            covariance=np.zeros(shape),
            window=4.0,
            horizon=1.0,
        )


@pytest.mark.parametrize("seconds", [1e8, 5.6e16, 1e300])
def test_a_flight_of_a_billion_samples_is_refused_and_not_begun(ideal, seconds):
    schedule = symheli.AirspeedSchedule((5.0,), (1.0,), (0.5,), start=4.0, lead=seconds)
    with pytest.raises(InputError, match="samples"):
        symheli.fly(ideal, schedule)


def test_an_operating_point_has_an_airspeed(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    for speed in (math.nan, math.inf):
        with pytest.raises(InputError, match="airspeed"):
            replace(point, airspeed=speed)


@pytest.mark.slow
def test_the_misfit_of_a_table_is_a_number(ideal):
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 4.0, dt=0.02, points=3)
    table = symheli.TableController.of(lqr.scheduled_controller.model, 5)
    for misfit in (math.nan, -1.0):
        with pytest.raises(InputError, match="misfit"):
            replace(table, misfit=misfit)


def test_noise_that_cannot_be_weighed_is_refused():
    """Gusts of 3e10 m/s ended in LinAlgError."""
    ones = np.ones((5, 2, 1))
    for large in (1e40, math.inf):
        with pytest.raises(AccuracyError, match="check their units"):
            Whitening.of([([np.tile(np.eye(2), (5, 1, 1))], np.ones(2)), ([ones], [large])])


@pytest.mark.parametrize("scale", [5e-324, 1e-300, 1e-160, 1.0, 1e160, 1e300])
def test_a_norm_is_that_of_any_units(scale):
    """1/(s^2 + s + 1): 2/sqrt(3) at sqrt(1/2). Squares of 1e-160 made a singular matrix."""
    A, B, C = np.array([[-1.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[scale, 0]])
    gain, omega = norm(A, B, C, np.zeros((1, 1)))
    assert (gain, omega) == pytest.approx((2 / math.sqrt(3) * scale, math.sqrt(0.5)), rel=1e-6)


@pytest.mark.parametrize("size", [5e-324, 1e-300, 1e-160, 1e160, 1e300])
def test_designs_refuse_weights_that_cannot_be_squared(size):
    """LinAlgError and OverflowError; the least H2 norm of a plant of 1e300 was 0."""
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    with pytest.raises(InputError, match=r"other units|whose square underflows"):
        synthesis.designs.mixed_sensitivity(lag, 1.0, size)
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, size], [0.0, 1.0, 0.0]])
    B, C = np.array([[1.0, 0.0, 3.0]]), np.array([[1.0], [0.0], [2.0]])
    plant = LinearModel([[0.0]], B, C, D, ["x"], ["w1", "w2", "u"], ["z1", "z2", "y"])
    for design in (synthesis.hinf, synthesis.h2):
        with pytest.raises(InputError, match=r"other units|price of u"):
            design(plant, ["u"], ["y"])


@pytest.mark.parametrize("size", [0.0, -1.0, 1e-300, 1e300])
def test_gaps_are_those_of_channels_in_some_scale(size):
    """0 and 1e300 made NaN of the responses, and ValueError of their winding number."""
    lag = LinearModel([[0.5]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"], 0.1)
    many = LinearModels.of([lag])
    for scales in ({"input_scale": size}, {"output_scale": size}):
        for gap in (
            lambda **s: symheli.lpv.nu_gap(lag, lag, **s),
            lambda **s: symheli.lpv.tools.nu_gaps(lag, many, **s),
            lambda **s: symheli.lpv.tools.chordal_distance(lag, lag, [1.0], **s),
            lambda **s: symheli.lpv.stability_margin(lag, {("u", "y"): -0.1}, **s),
        ):
            with pytest.raises(InputError, match="scale"):
                gap(**scales)


@pytest.mark.parametrize("band", [(0.3,), (0.3, 1.0, 2.0), ()])
def test_a_model_is_judged_over_a_band_of_two_ends(model, record, band):
    with pytest.raises(InputError, match="band"):
        idn.fit_for_control(
            model,
            record,
            {("u", "y"): -0.1},
            scales={"y": 1.0, "u": 1.0},
            window=4.0,
            horizon=1.0,
            band=band,
        )


@pytest.mark.parametrize("dt", [5e-324, 1e-300])
def test_an_autopilot_samples_at_a_pace_of_the_plant(ideal, dt):
    with pytest.raises(InputError, match="dt = "):
        symheli.flight.gain_scheduled_lqr(ideal, 0.0, 4.0, dt=dt, points=2)


def test_no_flights_are_refused(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    with pytest.raises(InputError, match="N >= 1"):
        symheli.integrate.simulate_batch(ideal, np.zeros((0, 10)), [point.u.array] * 2, dt=0.02)


@pytest.mark.parametrize("A", [1.0, np.zeros((2, 2)), np.zeros((0, 3, 3))])
def test_matrices_of_models_stand_in_a_row(A):
    """TypeError of a number that has no length."""
    with pytest.raises(InputError, match="A: expected shape"):
        LinearModels(A, [[[1.0]]], [[[1.0]]], [[[0.0]]], ["x"], ["u"], ["y"])


@pytest.mark.parametrize("group", ["controls", "measurements"])
def test_designs_want_channels_of_every_group(slow_plant, group):
    bare = replace(slow_plant, **{group: ()})
    for design in (
        lambda: synthesis.multiobjective(bare, synthesis.objectives.L2()),
        lambda: synthesis.output_feedback(bare),
    ):
        with pytest.raises(InputError, match=f"the plant has no {group}"):
            design()


def test_certificates_are_of_models_that_can_be_squared():
    """ValueError of an infinite Gramian."""
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    A = np.full((2, 1, 1), -1e300)
    fast = symheli.LPVStateSpace.polynomial(A, [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    for analysis in (synthesis.stability, synthesis.l2_gain):
        with pytest.raises(InputError, match="other units"):
            analysis(fast, search=None)


def test_a_horizon_is_a_number_of_samples(model, record):
    """OverflowError of the integer of infinity."""
    with pytest.raises(InputError, match="number of samples"):
        idn.scores(replace(model, dt=5e-324), record)
