"""Inputs that once ended in another exception, in NaN without a word or in no answer at all."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from damaged_files import damaged, ulog_of
from scipy.io import savemat

import identification as idn
import symheli
import synthesis
from symheli.errors import AccuracyError, DataWarning, InputError, SolverError, UnknownNameError
from symheli.lpv import LinearModel
from symheli.values import plain_file
from symheli.values.text_file import text_of
from synthesis.design.back_off import levels_above
from synthesis.program.panic import no_panic
from synthesis.worst.frozen import norm

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
        lambda: symheli.Dryden(wind=5.0, altitude=50.0).history(T, 5.0, seed),
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
        symheli.FlightCondition(5.0, wind=(0.0, 0.0))


def test_noise_in_decibels_is_a_number_that_can_be_raised_to():
    schedule = symheli.AirspeedSchedule.transition(4.0, 5.0)
    with pytest.raises(InputError, match="noise_db"):
        symheli.FlightPlan(schedule, noise_db=-5e15)


def test_a_sample_of_a_billion_years_is_refused_and_not_begun(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    x0 = np.tile(point.x.array, (2, 1))
    for dt in (4.3e16, 1e300):
        with pytest.raises(InputError, match="steps"):
            symheli.simulate_batch(ideal, x0, [point.u.array] * 2, dt=dt)


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
    basis = idn.BSpline(2, (0.0, 0.5, 1.0))
    for order in (math.nan, math.inf, 1.5, -1):
        with pytest.raises(InputError, match="derivative"):
            basis([0.5], order)
    assert not basis([0.5], 10**12).any()


@pytest.mark.parametrize("dt", [0.0, -1.0, 1e-300, math.nan, math.inf])
def test_lags_need_a_sample_period(dt):
    with pytest.raises(InputError, match="dt"):
        idn.LaggedSignals("u").instrument_lags(dt, 1, 1)


def test_counts_of_the_judges_are_whole(model, record):
    for judge in (
        lambda n: idn.residual_analysis(model, record, lags=n),
        lambda n: idn.slow_modes(model, record, points=n),
        lambda n: idn.choose_experiments((), n),
    ):
        for count in (math.nan, 0, 1.5):
            with pytest.raises(InputError, match="whole number"):
                judge(count)


def test_an_output_that_is_none_is_named():
    found = SimpleNamespace(scheduled=SimpleNamespace(outputs=("q", "theta")))
    with pytest.raises(UnknownNameError, match="did you mean 'theta'"):
        idn.AgainstConstant.pays(found, "thetax")  # type: ignore[arg-type]


def test_iterations_are_counted():
    for make in (
        lambda n: idn.RefinedInstruments(iterations=n),
        lambda n: idn.OutputError(evaluations=n),
    ):
        with pytest.raises(InputError, match="whole number"):
            make(math.nan)


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
            synthesis.bandwidth(lag, points=points)
    p = symheli.Scheduling("p", "1", 0.0, 1.0)
    lpv = symheli.LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    for points in (0, -1):
        with pytest.raises(InputError, match="points"):
            synthesis.frozen_gain(lpv, points=points)
    with pytest.raises(InputError, match="tolerance"):
        synthesis.frozen_box_gain(lpv.to_lft(), tolerance=math.nan)


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
    path.write_bytes(ulog_of(T).replace(b"timestamp;", b"tilestamp;"))
    with pytest.warns(DataWarning, match="damaged"), pytest.raises(InputError, match="armed"):
        symheli.FlightRecord.from_ulog(path, {"q": ("rates", "xyz[1]", "rad/s")}, dt=0.02)


def test_a_miss_is_that_of_a_finite_pole(model):
    for pole in (math.nan, math.inf, 0.0):
        with pytest.raises(InputError, match="pole"):
            idn.pole_miss(model.at(0.0), pole)


def test_a_fit_is_that_of_measurements_that_can_be_squared():
    for y in (math.inf, -1e300):
        with pytest.raises(InputError, match="mark bad samples"):
            idn.fit_percent([1.0, 2.0, y], [1.0, 2.0, 3.0])
    assert idn.fit_percent([1.0, 2.0], [1.0, 1e300]) == -math.inf


def test_scores_have_a_name_a_column():
    y = np.arange(5.0)[:, None]
    for names in ([], ["y", "y"]):
        with pytest.raises(InputError, match="outputs"):
            idn.Scores.of(y, names, one_step=y, ahead=y, free_run=y)


@pytest.mark.parametrize("lags", [{"nb": 1.5}, {"nb": math.nan}, {"na": (1,) * 12}])
def test_lags_of_a_vehicle_are_counted(lags):
    given = {"nb": 1, **lags}
    with pytest.raises(InputError, match=r"na:|nb:"):
        idn.KinematicARX(("d",), "p", basis=idn.Polynomial(0, 0.0, 1.0), **given)


def test_designs_refuse_what_they_cannot_mean():
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    for design in (
        lambda: synthesis.ncf(lag, W1=0.0),
        lambda: synthesis.ncf(lag, W2=-0.0),
        lambda: synthesis.ncf(lag, back_off=1e300),
        lambda: synthesis.mixed_sensitivity(lag, 1.0, 1.0, back_off=1e300),
        lambda: synthesis.h2(lag, ["u"], ["y", "y"]),
        lambda: synthesis.bandwidth(lag, band=(1.0,)),  # type: ignore[arg-type]
        lambda: synthesis.Search(levels=math.nan),  # type: ignore[arg-type]
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


def test_a_constant_parameter_has_no_growth_in_a_cycle():
    """It was NaN, and nothing said so."""
    p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    lag = symheli.LPVStateSpace.polynomial([[[-1.5]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    found = synthesis.lower_bound(lag)
    assert (found.trajectory, found.growth) == (None, None)
