"""State-space models of records as others log them: any units, trims, holes, sensors that do not
move.
"""

from dataclasses import replace

import numpy as np
import pytest
from test_state_space_methods import OMEGA, POINTS, System

import identification as idn
from identification.estimators.state_space_search import Problem
from identification.estimators.state_space_trim import Trim
from identification.estimators.subspace import Piece
from identification.model.state_space_run import StateSpaceRun
from symheli import FlightRecord
from symheli.errors import DataWarning, ExcitationError, InputError

SYSTEM = System.drawn(3, 2, 2, 1, 1)


def changed(record, **columns):
    return record.with_signals(dict.fromkeys(columns, "1"), **columns)


@pytest.mark.parametrize("method", ["oe", "innovations"])
def test_units_of_signals_do_not_change_the_model(method):
    """Steps count as small in the unit of each unknown: a search must not end because one of them
    is a large number.
    """
    sizes = {"y0": 1e6, "y1": 1e-6, "u0": 1e-6, "u1": 1e6}
    record = SYSTEM.record(400, 2, noise=0.1)
    other = changed(record, **{name: size * record[name] for name, size in sizes.items()})
    mine, theirs = (idn.fit(SYSTEM.structure, each, method) for each in (record, other))
    per = np.outer([1e6, 1e-6], [1e6, 1e-6])
    for p in POINTS:
        exact = mine.at(p).frequency_response(OMEGA)
        found = theirs.at(p).frequency_response(OMEGA) / per
        # ends of two searches, which rounding leads apart
        np.testing.assert_allclose(found, exact, atol=1e-4 * np.abs(exact).max())
    np.testing.assert_allclose(theirs.score(other, 1).array, mine.score(record, 1).array, atol=0.01)


@pytest.mark.parametrize("n", [250, 400])
def test_rounding_does_not_choose_the_ridge_of_short_records(n):
    """As many features as windows: what is left and its freedom both vanish with the weight."""
    record = SYSTEM.record(n, 1, noise=0.1)
    beside = changed(record, y0=record["y0"] * (1.0 + 1e-12 * np.arange(n)))
    errors = [
        SYSTEM.error(idn.fit(SYSTEM.structure, each, "subspace")) for each in (record, beside)
    ]
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
    assert max(errors) < 0.1


def test_a_step_that_damping_keeps_short_does_not_end_a_search():
    """The likelihood of two ends that began a rounding error apart."""
    record = SYSTEM.record(400, 1, noise=0.1)
    beside = changed(record, y0=record["y0"] * (1.0 + 1e-12 * np.arange(400)))
    ends = [idn.fit(SYSTEM.structure, each, "innovations") for each in (record, beside)]
    left = [np.linalg.slogdet(found.residual_covariance)[1] for found in ends]
    assert left[0] == pytest.approx(left[1], abs=1e-4)
    assert all(found.details["converged"] for found in ends)


def test_a_filter_that_forgets_nothing_is_no_model():
    """From the right start it leaves small errors of a short record: the information of that start
    made every band vanish.
    """
    system = System.drawn(2, 1, 1, 1, 5)
    found = idn.fit(system.structure, system.record(100, 0, noise=0.1), "innovations")
    stability = idn.judge.frozen_stability(found, POINTS)
    f = system.basis(np.array(POINTS))
    exact = [np.log(np.abs(np.linalg.eigvals(A)).max()) / 0.1 for A in np.tensordot(f, system.A, 1)]
    assert np.all((stability.low <= exact) & (exact <= stability.high))
    A, _, C, _, K = found.run.matrices(found.unknowns)
    assert np.abs(np.linalg.eigvals(np.tensordot(f, A - K @ C, 1))).max() < 1.05


@pytest.mark.parametrize("method", ["oe", "innovations"])
def test_whole_values_far_from_zero_are_taken_up_by_the_offset(method):
    """An airspeed of 100 that moves by 1, a stick at .5: the model of the same signals about 0."""
    system = System.drawn(2, 2, 2, 1, 1)
    record = system.record(250, 2, noise=0.1)
    whole = changed(record, y0=record["y0"] + 100.0, y1=record["y1"] - 30.0, u1=record["u1"] + 0.5)
    structure = replace(system.structure, offset=True)
    mine, theirs = (idn.fit(structure, each, method) for each in (record, whole))
    run, flown = mine.simulate(record), theirs.simulate(whole)
    np.testing.assert_allclose(flown - [100.0, -30.0], run, atol=1e-3)
    bands = [idn.judge.frozen_stability(found, POINTS) for found in (mine, theirs)]
    np.testing.assert_allclose(bands[1].growth, bands[0].growth, rtol=1e-3)
    np.testing.assert_allclose(bands[1].high, bands[0].high, rtol=0.02)


def test_the_covariance_moves_with_the_trim():
    """As many outputs as states: the trim of the states is the only one."""
    system = System.drawn(2, 2, 2, 1, 1)
    structure = replace(system.structure, offset=True, feedthrough=True)
    found = idn.fit(structure, system.record(300, 2, noise=0.1), "subspace")
    trim, size = Trim(np.array([3.0, -2.0]), np.array([0.5, 1.0])), found.run.size
    e = np.random.default_rng(0).normal(size=size)
    of_e = replace(found, covariance=np.outer(e, e).reshape(1, size, 1, size))
    moved = [replace(found, unknowns=found.unknowns + h * e) for h in (-1e-5, 1e-5)]
    before, after = (trim.back(each).unknowns for each in moved)
    slope = (after - before) / 2e-5
    variances = np.diagonal(trim.back(of_e).covariance[0, :, 0])
    np.testing.assert_allclose(variances, slope**2, rtol=1e-5, atol=1e-8)


def test_whole_values_without_an_offset_are_told():
    record = SYSTEM.record(300, 2, noise=0.1)
    with pytest.warns(DataWarning, match="offset=True, or subtract its trim"):
        idn.fit(SYSTEM.structure, changed(record, y0=record["y0"] + 100.0), "subspace")


def test_outputs_that_are_never_there_together_are_found():
    record = SYSTEM.record(600, 0)
    even = np.arange(600) % 2 == 0
    apart = changed(
        record, y0=np.where(even, record["y0"], np.nan), y1=np.where(even, np.nan, record["y1"])
    )
    found = idn.fit(SYSTEM.structure, apart, idn.methods.OutputError(tolerance=1e-13))
    assert SYSTEM.error(found) < 1e-6


@pytest.mark.parametrize("method", ["subspace", "oe", "innovations"])
@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"y1": np.nan}, "y1 has no values"),
        ({"u0": np.nan}, "u0 has no values"),
        ({"p": np.nan}, "p has no values"),
        ({"y0": 3.0, "y1": 0.0}, "y0, y1: no output moves"),
    ],
)
def test_signals_that_say_nothing_are_named(columns, says, method):
    record = SYSTEM.record(200, 0, noise=0.1)
    filled = {name: np.full(200, value) for name, value in columns.items()}
    with pytest.raises(ExcitationError, match=says):
        idn.fit(SYSTEM.structure, changed(record, **filled), method)


@pytest.mark.parametrize("method", ["oe", "innovations"])
def test_an_output_that_does_not_move_leaves_the_others_as_they_are(method, recwarn):
    record = changed(SYSTEM.record(300, 0, noise=0.1), y1=np.zeros(300))
    found = idn.fit(SYSTEM.structure, record, method)
    assert found.score(record, 1)["y0"] > 90.0
    assert not [str(w.message) for w in recwarn if issubclass(w.category, RuntimeWarning)]


def test_fewer_values_than_unknowns_are_refused():
    with pytest.raises(ExcitationError, match="cannot determine 42 unknowns"):
        idn.fit(SYSTEM.structure, SYSTEM.record(20, 0, noise=0.1), "innovations")


def test_a_response_that_is_real_has_a_region_on_the_real_axis():
    """At frequency 0 and at half the sampling frequency: 1.96 deviations, not 2.45."""
    found = idn.fit(SYSTEM.structure, SYSTEM.record(250, 0, noise=0.1), "oe")
    regions = idn.judge.response_regions(found, [0.0], [0.0, np.pi / found.dt])
    assert regions.contains(regions.centre).all()
    for deviations, inside in ((1.9, True), (2.0, False), (-1.9, True)):
        beside = regions.centre.real + deviations * regions.width
        assert (regions.contains(beside) == inside).all()
    assert not regions.contains(regions.centre + 0.1j * regions.width).any()
    with pytest.raises(InputError, match="expected shape"):
        regions.contains(np.ones((2, 2)))


def test_advice_for_a_covariance_is_of_the_method_of_states():
    found = idn.fit(SYSTEM.structure, SYSTEM.record(250, 0, noise=0.1), "subspace")
    for judged in (
        lambda: idn.judge.response_regions(found, [0.0], [1.0]),
        lambda: idn.judge.frozen_stability(found, [0.0]),
    ):
        with pytest.raises(InputError, match='fit by "oe" or "innovations"'):
            judged()


def test_a_scan_leaves_out_trials_without_a_fit():
    """A difference equation of one lag has a free run of three samples, one of three lags none."""
    system = System.drawn(2, 1, 1, 1, 5)
    training, test = system.record(300, 0, noise=0.1), system.record(300, 1, noise=0.1)
    scan = idn.order_scan(
        system.structure.regression, training, test.rows(slice(0, 4)), orders=(4, 1), degrees=(1,)
    )
    assert scan.best("one_step").na == 1
    with pytest.raises(InputError, match="validation records are too short"):
        scan.best("ahead")


def test_short_stretches_have_a_short_past():
    """Nine samples between gaps, where the usual past takes thirteen."""
    system = System.drawn(2, 1, 1, 1, 5)
    record = system.record(300, 0)
    pieces = record.rows(np.arange(300) % 10 > 0)
    found = idn.fit(system.structure, pieces, idn.methods.OutputError(tolerance=1e-13))
    assert system.error(found) < 1e-6
    with pytest.raises(ExcitationError, match="a shorter past"):
        idn.fit(system.structure, pieces, idn.methods.Subspace(past=12))


@pytest.mark.parametrize(
    ("noise", "method", "says"),
    [
        (0.1, "oe", "the inputs tell 2 numbers at most, the matrices have 4"),
        (0.0, "innovations", "2 of 8 directions of the matrices do not show"),
    ],
)
def test_one_sine_does_not_tell_two_states(noise, method, says):
    n, rng = 600, np.random.default_rng(0)
    A, x, y, u = np.array([[0.8, 0.3], [-0.3, 0.8]]), np.zeros(2), np.zeros(n), np.zeros(n)
    for k in range(n):
        y[k], u[k] = x[0] + noise * rng.normal(), np.sin(0.3 * k)
        x = A @ x + np.array([0.2, 1.0]) * u[k]
    record = FlightRecord.from_arrays(0.1 * np.arange(n), {"y": "1", "u": "1"}, y=y, u=u)
    with pytest.warns(DataWarning, match=says):
        idn.fit(idn.StateSpace("y", "u", order=2), record.rows(slice(200, n)), method)


def test_errors_of_a_free_run_that_are_correlated_count_so():
    """Beside the sum over all pairs of samples; one output is missing at times."""
    system = System.drawn(2, 1, 2, 1, 1)
    record = system.record(100, 0, noise=0.3)
    y = record.columns(["y0", "y1"]).copy()
    y[::7, 1] = np.nan
    pieces = [
        Piece(y[part], record.columns(["u0"])[part], record["p"][part])
        for part in (slice(0, 60), slice(60, 100))
    ]
    problem = Problem(StateSpaceRun(system.structure), pieces)
    matrices = problem.run.unknowns(system.A, system.B, system.C, np.zeros((2, 0)), system.K)
    z, size = np.append(matrices, np.zeros(4)), problem.run.size
    errors, slopes, pairs, exact = problem.errors(z), [], np.zeros((11, 2, 2)), 0.0
    for i, (piece, e) in enumerate(zip(pieces, errors, strict=True)):
        along = np.concatenate(
            [part for _, part in problem.run.slopes(matrices, problem.along(z, i))]
        )
        wide = np.zeros((*along.shape[:2], len(z)))
        wide[:, :, np.r_[0:size, problem.own(i)]] = along * np.isfinite(piece.y)[:, :, None]
        slopes.append(wide / problem.scale[:, None])
        for lag in range(-5, 6):
            for k in range(max(-lag, 0), min(len(e), len(e) - lag)):
                pairs[lag + 5] += np.outer(e[k], e[k + lag]) / 100
    for own in slopes:
        for lag in range(-5, 6):
            R = pairs[lag + 5] * (1.0 - abs(lag) / 6.0)
            for k in range(max(-lag, 0), min(len(own), len(own) - lag)):
                exact = exact + own[k].T @ R @ own[k + lag]
    np.testing.assert_allclose(problem.correlated(z), exact, atol=1e-9 * np.abs(exact).max())


@pytest.mark.slow
def test_bands_of_a_free_run_hold_with_gusts():
    """Noise of the states colours what a free run leaves: white residuals would give 86 %."""
    system = System.drawn(2, 1, 1, 1, 5)
    system = replace(system, K=5.0 * system.K)
    exact, held = system.responses()[:, ::6], []
    for seed in range(20):
        record = system.record(600, seed, noise=0.5)
        found = idn.fit(system.structure, record, idn.methods.OutputError(evaluations=400))
        held.append(idn.judge.response_regions(found, POINTS, OMEGA[::6]).contains(exact).mean())
    assert 0.9 < np.mean(held) < 0.99


def test_a_free_run_of_what_grows_is_warned_of():
    """It would call the plant stable: the closest free run of a loop is no model of its plant."""
    n, rng = 600, np.random.default_rng(0)
    y, u, x = np.zeros(n), np.zeros(n), 0.0
    for k in range(n):
        y[k] = x + 0.05 * rng.normal()
        u[k] = rng.choice([-1.0, 1.0]) - 1.0 * y[k]
        x = 1.06 * x + 0.2 * u[k]
    record = FlightRecord.from_arrays(0.1 * np.arange(n), {"y": "1", "u": "1"}, y=y, u=u)
    structure = idn.StateSpace("y", "u", order=1)
    with pytest.warns(DataWarning) as told:
        idn.fit(structure, record, "oe")
    assert "modes that grow by 0.0" in str(told[0].message)
    found = idn.fit(structure, record, "innovations")
    assert idn.judge.frozen_stability(found, [0.0]).calls == ("unstable",)
