"""Responses with coherence from records, and which experiment to fly."""

import numpy as np
import pytest
from known_systems import moving, structure
from scipy.signal import lfilter

from identification import choose_experiments, fit, frequency_response, uncertainty
from identification.design import compare_experiments
from identification.judge.frequency_response import FrequencyResponse
from symheli import LinearModel
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord

DT = 0.02


def plant():
    """Two lightly damped modes, two inputs, cross-coupled."""
    A = np.array([[0.0, 1, 0, 0], [-16, -1.2, 2, 0], [0, 0, 0, 1], [1, 0, -64, -3.0]])
    B = np.array([[0.0, 0], [10, 1], [0, 0], [2, 30]])
    C = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
    return LinearModel(A, B, C, np.zeros((2, 2)), ("x1", "x2", "x3", "x4"), ("a", "b"), ("y", "z"))


def flown(n=12_000, noise=0.0, coupling=0.3, seed=0):
    rng = np.random.default_rng(seed)
    u = lfilter([1.0], [1.0, -0.8], rng.standard_normal((n, 2)), axis=0)
    u[:, 1] += coupling * u[:, 0]
    model, x, y = plant().discretize(DT), np.zeros(4), np.empty((n, 2))
    for k in range(n):
        y[k] = model.C @ x
        x = model.A @ x + model.B @ u[k]
    y += noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return FlightRecord.from_arrays(
        DT * np.arange(n),
        dict.fromkeys(("a", "b", "y", "z"), "1"),
        a=u[:, 0],
        b=u[:, 1],
        y=y[:, 0],
        z=y[:, 1],
    )


def test_the_response_of_a_known_plant_comes_back_though_its_inputs_move_together():
    response = frequency_response(flown(), ("y", "z"), ("a", "b"), window=20.0, band=(1.0, 15.0))
    truth = plant().discretize(DT).frequency_response(response.omega)
    error = np.abs(response.G - truth) / np.abs(truth)
    assert np.median(error[:, 0, 0]) < 0.03
    assert np.median(error[:, 1, 1]) < 0.03
    # as uncertain as it says, within a factor: what leaks between windows is no noise
    assert np.all(response.multiple[:, 0] > 0.9)
    assert np.all(response.mismatch(plant().discretize(DT))[[0, 1], [0, 1]] < 50)
    wrong = plant().discretize(DT)
    wrong = LinearModel(
        wrong.A, 3 * wrong.B, wrong.C, wrong.D, wrong.states, wrong.inputs, wrong.outputs, wrong.dt
    )
    assert np.all(response.mismatch(wrong)[[0, 1], [0, 1]] > 100)


def static(noise, seed=0, n=6000):
    """y = 2 a + b + noise: nothing for a window to smear."""
    rng = np.random.default_rng(seed)
    a, b, e = rng.standard_normal((3, n))
    b += 0.5 * a
    return FlightRecord.from_arrays(
        DT * np.arange(n), dict.fromkeys("aby", "1"), a=a, b=b, y=2 * a + b + noise * e
    )


def test_coherence_falls_and_the_random_error_grows_with_noise_as_they_say():
    r = [
        frequency_response(static(2.0, seed), ("y",), ("a", "b"), window=5.0) for seed in range(20)
    ]
    errors = np.array([(np.abs(one.G[:, 0, 0]) / 2 - 1) / one.random_error[:, 0, 0] for one in r])
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(
        1.0, rel=0.25
    )  # asymptotic in the number of windows
    # a with b taken off has the variance 1/(1 + 0.25): 4 x 0.8 against noise of 4
    assert np.mean([one.coherence[:, 0, 0] for one in r]) == pytest.approx(3.2 / 7.2, abs=0.05)
    quiet = frequency_response(static(0.1), ("y",), ("a", "b"), window=5.0)
    assert np.median(quiet.random_error) < 0.2 * np.median(r[0].random_error)
    assert quiet.multiple.min() > 0.98


def test_windows_that_see_the_same_input_share_the_noise_of_their_overlap():
    """An input that repeats in every half window has one phase in all of them, so that the errors
    of neighbours, correlated by 1/6, add up: the deviation is sqrt(4/3) times that of independent
    windows. 30 records of 20 lines each: what they say of it is right within 3 %.
    """
    half, n = 125, 6000
    t = DT * np.arange(n)
    lines = np.arange(1, 21)
    rng = np.random.default_rng(0)
    phases = rng.uniform(0, 2 * np.pi, len(lines))
    u = np.cos(2 * np.pi * np.outer(t, lines / (half * DT)) + phases).sum(axis=1)
    errors = []
    for _ in range(30):
        record = FlightRecord.from_arrays(
            t, dict.fromkeys("uy", "1"), u=u, y=u + 2.0 * rng.standard_normal(n)
        )
        found = frequency_response(record, ("y",), ("u",), window=2 * half * DT)
        at = np.searchsorted(found.omega, 2 * np.pi * lines / (half * DT) - 1e-6)
        errors.append(np.abs(found.G[at, 0, 0] - 1.0) / found.deviation[at, 0, 0])
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    ("coherence", "weight"), [(0.6, 0.51), (0.8, 0.76), (0.9, 0.88), (1.0, 1.0)]
)
def test_the_mismatch_weighs_by_the_coherence_as_published(coherence, weight):
    """W = (1.58 (1 - exp(-gamma^2)))^2 is 0.51 at gamma^2 = 0.6 and 1 at 1; half the gain at every
    frequency costs 20 W 6.02^2.
    """
    shape = (5, 1, 1)
    measured = FrequencyResponse(
        omega=np.arange(1.0, 6.0),
        G=np.full(shape, 0.5 + 0j),
        coherence=np.full(shape, coherence),
        multiple=np.ones((5, 1)),
        deviation=np.zeros(shape),
        freedom=np.full(5, 10.0),
        outputs=("y",),
        inputs=("u",),
    )
    model = LinearModel(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], (), ("u",), ("y",), DT
    )
    assert measured.mismatch(model, 0.5)[0, 0] == pytest.approx(
        20 * weight * (20 * np.log10(2)) ** 2, rel=0.01
    )  # two digits


def test_gaps_are_not_bridged_and_inputs_that_move_together_are_refused():
    record = flown(6000)
    values = record.values.copy()
    values[3000, 0] = np.nan
    holed = FlightRecord(record.time, values, record.signals)
    G = frequency_response(holed, ("y",), ("a", "b"), window=10.0, band=(2.0, 6.0)).G
    assert np.all(np.isfinite(G))
    same = FlightRecord(record.time, record.values[:, [0, 0, 2, 3]], record.signals)
    with pytest.raises(ExcitationError, match="move together"):
        frequency_response(same, ("y",), ("a", "b"), window=10.0)
    with pytest.raises(ExcitationError, match="shorten the window"):
        frequency_response(record, ("y",), ("a",), window=500.0)
    with pytest.raises(InputError, match="no frequency"):
        frequency_response(record, ("y",), ("a",), window=10.0, band=(0.01, 0.02))


def in_closed_loop(seed, noise=0.5, n=9000):
    """The plant under u = r - K y with noise that the feedback brings to its inputs."""
    rng = np.random.default_rng(seed)
    model, K = plant().discretize(DT), np.array([[-2.0, 0.4], [0.3, -3.0]])
    r = lfilter([1.0], [1.0, -0.8], rng.standard_normal((n, 2)), axis=0)
    e = lfilter([0.2], [1.0, -0.9], noise * rng.standard_normal((n, 2)), axis=0)
    x, u, y = np.zeros(4), np.empty((n, 2)), np.empty((n, 2))
    for k in range(n):
        y[k] = model.C @ x + e[k]
        u[k] = r[k] + K @ y[k]
        x = model.A @ x + model.B @ u[k]
    columns = dict(zip("abyzrs", np.hstack([u, y, r]).T, strict=True))
    return FlightRecord.from_arrays(DT * np.arange(n), dict.fromkeys(columns, "1"), **columns)


def test_references_take_off_the_bias_of_feedback_and_the_bands_hold_the_truth():
    """Over 12 records: where noise is fed back the estimate from the inputs alone is off by more
    than its band says, that by the references is not.
    """
    truth, inside, alone = plant().discretize(DT), [], []
    for seed in range(12):
        record = in_closed_loop(seed)
        for references, held in ((("r", "s"), inside), ((), alone)):
            found = frequency_response(
                record, "yz", "ab", window=(40.0, 20.0), band=(1.0, 15.0), references=references
            )
            off = np.abs(found.G - truth.frequency_response(found.omega))
            held.append((off <= found.radius())[found.usable].mean())
    # 95 % of some 90 frequencies and 4 responses, correlated: three percent either way, and two
    # for the curvature of modes of damping .15 within a window's resolution
    assert 0.9 < np.mean(inside) < 0.98
    assert np.mean(alone) < 0.75


def test_composite_windows_take_the_shortest_that_holds_sixteen_periods():
    record = flown(6000)
    both = frequency_response(record, "yz", "ab", window=(20.0, 5.0), band=(1.0, 40.0))
    assert np.all(np.diff(both.omega) > 0)
    turn = 16 * 2 * np.pi / 5.0
    for length, band in ((20.0, (1.0, turn)), (5.0, (turn, 40.0))):
        one = frequency_response(record, "yz", "ab", window=length, band=band)
        own = (both.omega >= band[0] - 1e-9) & (both.omega < band[1] - 1e-9)
        same = np.isin(one.omega, both.omega[own])
        np.testing.assert_allclose(both.G[own], one.G[same], rtol=1e-12)
        np.testing.assert_allclose(both.deviation[own], one.deviation[same], rtol=1e-12)


def test_references_that_cannot_serve_are_refused():
    record = in_closed_loop(0, n=3000)
    with pytest.raises(InputError, match="too few for 2 inputs"):
        frequency_response(record, "yz", "ab", window=10.0, references="r")
    still = record.with_signals({"c": "1"}, c=np.zeros(len(record)))
    with pytest.raises(ExcitationError, match="references move together, or not at all"):
        frequency_response(still, "yz", "ab", window=10.0, references="rc")
    with pytest.raises(InputError, match="at least one length"):
        frequency_response(record, "yz", "ab", window=())
    with pytest.raises(InputError, match="probability"):
        frequency_response(record, "yz", "ab", window=10.0).radius(1.5)


def candidate(u, p):
    n = len(p)
    y = np.zeros(n)
    for k in range(2, n):
        y[k] = (1.2 - 0.02 * p[k - 1]) * y[k - 1] - 0.5 * y[k - 2] + u[k - 1]
    return FlightRecord.from_arrays(0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p)


def candidates(n=800):
    k, rng = np.arange(n), np.random.default_rng(0)
    noise = rng.choice([-1.0, 1.0], n)
    return {
        "one sine": candidate(np.sin(0.3 * k), moving(n)),
        "switching, slow p": candidate(noise, np.linspace(5, 6, n)),
        "switching, moving p": candidate(noise, moving(n)),
        "switching, too large": candidate(5 * noise, moving(n)),
    }


def test_the_experiment_that_moves_everything_tells_most_and_limits_are_kept():
    found = compare_experiments(structure(), candidates(), {"u": 2.0})
    assert [e.name for e in found if not e.allowed] == ["switching, too large"]
    plan = choose_experiments(found, 2)
    assert plan.experiments[0].name == "switching, moving p"
    assert np.all(
        plan.bounds <= plan.experiments[0].bounds * (1 + 1e-9)
    )  # more data never know less
    sine = next(e for e in found if e.name == "one sine")
    assert np.median(sine.bounds) > 5 * np.median(plan.experiments[0].bounds)


def test_bounds_are_the_standard_errors_a_fit_reports():
    records = candidates()
    (one,) = compare_experiments(structure(), {"x": records["switching, moving p"]}, {})
    record = records["switching, moving p"]
    rng = np.random.default_rng(1)
    noisy = FlightRecord(
        record.time,
        record.values + np.array([0.1, 0, 0]) * rng.standard_normal(record.values.shape),
        record.signals,
    )
    model = fit(structure(), noisy)
    white = np.sqrt(np.diagonal(uncertainty(model, noisy).white[0, :, 0]))
    scale = np.sqrt(model.residual_covariance[0, 0])
    np.testing.assert_allclose(
        one.bounds * scale, white, rtol=0.15
    )  # the noise moves the regressors a little


def test_an_experiment_that_leaves_coefficients_open_says_so_and_none_allowed_is_refused():
    still = {
        "constant p": candidate(np.random.default_rng(0).standard_normal(300), np.full(300, 5.0))
    }
    (one,) = compare_experiments(structure(), still, {})
    assert np.all(np.isinf(one.bounds))
    with pytest.raises(ExcitationError, match="no candidate keeps its limits"):
        choose_experiments(compare_experiments(structure(), still, {"u": 1e-3}), 1)
