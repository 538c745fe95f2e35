"""Output noise: least squares is biased by it, instruments, their refinement and output error are
not; all are exact without it.
"""

import numpy as np
import pytest
from known_systems import Truth, moving, structure
from test_instruments import closed_loop

import identification as idn
from identification.estimators.observer import Observer
from identification.estimators.prediction_error import Residuals
from identification.estimators.refined_instruments import refined_instruments
from identification.model.stretches import contracted, filtered, stretches
from identification.structure.regressors import stacked
from symheli import lpv
from symheli.errors import ConvergenceWarning, InputError
from symheli.records import FlightRecord

TRUE = np.array(
    [[-1.2, 0.4], [0.6, -0.2], [0.5, 0.3]]
)  # monomial coefficients of a_1, a_2, b_1 on p in [0, 1]
ARX = idn.LPVARX(
    "y", "u", "p", na=2, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 1.0), scheduling_at="now"
)


def oscillator(n, seed, *, decibel=10.0, pole=0.0):
    """An open-loop record of TRUE with output noise so many dB below the signal, coloured by 1/(1 -
    pole/q).
    """
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    p, u, x, v = 0.5 + 0.5 * np.sin(0.05 * k), rng.normal(size=n), np.zeros(n), rng.normal(size=n)
    for j in range(2, n):
        a1, a2, b1 = TRUE @ [1.0, p[j]]
        x[j] = -a1 * x[j - 1] - a2 * x[j - 2] + b1 * u[j - 1]
    for j in range(1, n):
        v[j] += pole * v[j - 1]
    y = x + v * np.std(x) / np.std(v) * 10 ** (-decibel / 20)
    return FlightRecord.from_arrays(0.1 * k, dict.fromkeys("yup", "1"), y=y, u=u, p=p)


def errors(method, seeds=(0, 1, 2), pole=0.0):
    out = []
    for seed in seeds:
        found = idn.fit(
            ARX, oscillator(1500, seed, pole=pole), method=method
        ).coefficients.monomial()
        out.append(np.vstack([found.A[:, :, 0, 0], found.B[:, :, 0, 0]]) - TRUE)
    return np.array(out)


@pytest.mark.parametrize("method", ["ls", "ridge", "lasso"])
def test_noise_at_10_db_biases_least_squares_with_or_without_a_penalty(method):
    biased = errors(method)
    # the same in every realization: a bias. Measured 0.30 of a coefficient of 1.2, scatter 0.015
    assert np.abs(biased.mean(axis=0)).max() > 0.2
    assert np.abs(biased.mean(axis=0)).max() > 10 * biased.std(axis=0).max()


@pytest.mark.slow(only="oe")
@pytest.mark.parametrize("method", [idn.methods.InstrumentalVariables("u"), "riv", "oe"])
def test_noise_at_10_db_does_not_bias_instruments_nor_output_error(method):
    # what is left is scatter: up to 0.02 a realization (iv), so the mean of three stays within
    # 0.04; the bias of "ls" is 0.3
    assert np.abs(errors(method).mean(axis=0)).max() < 0.04


def test_refined_instruments_with_white_noise_are_the_output_error_estimate():
    record = oscillator(800, 5)
    refined = idn.fit(ARX, record, method=idn.methods.RefinedInstruments(tolerance=1e-9))
    closest = idn.fit(ARX, record, method=idn.methods.OutputError(initial="measured"))
    assert refined.details["converged"]
    assert closest.details["converged"]
    # both solve (d response / d theta)' (y - response) = 0; they differ in the filter at the first
    # samples only
    np.testing.assert_allclose(refined.theta, closest.theta, atol=2e-3)


@pytest.mark.slow
def test_a_noise_model_finds_the_colour_and_narrows_the_scatter():
    white, coloured = (
        errors("riv", (0, 1, 2), 0.9),
        errors(idn.methods.RefinedInstruments(noise_order=1), (0, 1, 2), 0.9),
    )
    model = idn.fit(
        ARX, oscillator(1500, 0, pole=0.9), method=idn.methods.RefinedInstruments(noise_order=1)
    )
    assert model.details["noise"][0][0] == pytest.approx(
        -0.9, abs=0.03
    )  # scatter of sqrt((1 - 0.81) / 1500) = 0.011
    assert np.linalg.norm(coloured) < 0.9 * np.linalg.norm(
        white
    )  # measured 0.77 on these three records, 0.64 on eight


def test_closed_loop_noise_is_kept_out_of_the_refinement_by_the_external_excitation():
    arx, nodes, a = (
        structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0)),
        np.array([2.0, 6.5, 11.0]),
        (1.5, 0.7),
    )
    true = np.stack([-(a[0] + 0.01 * nodes), a[1] + 0.004 * nodes], axis=1)
    record = closed_loop(2500, noise=0.5, seed=2, a=a)
    worst = {
        name: (
            np.abs(
                idn.fit(arx, record, method=method).coefficients.at(nodes).A[:, :, 0, 0] - true
            ).max()
        )
        for name, method in (
            ("ls", "ls"),
            ("iv", idn.methods.InstrumentalVariables("r")),
            ("riv", idn.methods.RefinedInstruments("r")),
        )
    }
    # measured 0.39, 0.028 and 0.005 on this record; over three records iv 0.007 to 0.028, riv 0.001
    # to 0.006
    assert worst["ls"] > 0.2
    assert worst["riv"] < 0.015
    assert worst["riv"] < worst["iv"]


@pytest.mark.slow
@pytest.mark.parametrize("at", ["lag", pytest.param("now", marks=pytest.mark.slow)])
def test_refined_instruments_identify_a_plant_that_is_unstable_in_open_loop(at):
    """Unstable at high p, so that no free run is bounded: an observer driven by what the excitation
    explains stands in for it.
    """
    arx, nodes = (
        structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0), scheduling_at=at),
        np.array([2.0, 6.5, 11.0]),
    )
    true = np.stack([-(1.75 + 0.01 * nodes), 0.80 + 0.004 * nodes], axis=1)
    assert np.abs(np.roots([1.0, -(1.75 + 0.01 * 12.5), 0.80 + 0.004 * 12.5])).max() > 1.01
    found = {idn.methods.InstrumentalVariables("r"): [], idn.methods.RefinedInstruments("r"): []}
    for seed in range(1, 6):
        record = closed_loop(3000, noise=0.5, seed=seed, at=at)
        for method, errors in found.items():
            model = idn.fit(arx, record, method=method)
            errors.append(np.abs(model.coefficients.at(nodes).A[:, :, 0, 0] - true).max())
            assert model.details.get("converged", True)
    # measured over eight records: iv 0.005 to 0.018, riv 0.0006 to 0.0036; least squares is off by
    # 0.28
    iv, riv = found.values()
    assert np.max(riv) < 0.008
    assert np.median(riv) < 0.5 * np.median(iv)


def test_the_poles_of_the_observer_are_those_of_the_plant_mirrored_at_the_unit_circle():
    """Closed form for a constant plant: poles 1.25 and 0.5 become 0.8 and 0.5, white noise of size
    2 white innovations of size 2 * 1.25.
    """
    a1, a2 = np.poly([1.25, 0.5])[1:]
    A = np.tile([[a1, a2]], (4000, 1, 1))
    observer = Observer.of(A, np.array([2.0]))
    poles = np.linalg.eigvals(np.array([[-a1, -a2], [1.0, 0.0]]) - observer.gain[-1] @ -A[-1])
    np.testing.assert_allclose(
        np.sort(poles), [0.5, 0.8], atol=1e-3
    )  # DOUBT is a share of 1e-4 of the noise
    v = 2.0 * np.random.default_rng(0).normal(size=4002)
    error = observer.innovations((v[2:] + a1 * v[1:-1] + a2 * v[:-2])[:, None, None])[100:, 0, 0]
    assert error.std() == pytest.approx(2.5, rel=0.03)  # scatter of 1 / sqrt(2 * 3900) = 0.011
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 0.05  # 3 / sqrt(3900)


def test_while_the_plant_is_stable_the_observer_is_the_simulation():
    rng = np.random.default_rng(1)
    run = stretches(ARX, [oscillator(400, 0)], outputs=True)[0]
    A = run.lag_coefficients(idn.fit(ARX, oscillator(400, 0), method="riv").theta)
    w = rng.normal(size=(len(A), 1, 1))
    observed, simulated = (
        Observer.of(A, np.ones(1)).innovations(w),
        filtered(A, w, np.zeros((2, 1))),
    )
    # the past is taken as measured with noise, which is over after a few periods; then the gain is
    # that of a doubt of 1e-4
    np.testing.assert_allclose(observed[100:], simulated[100:], atol=0.02 * np.abs(simulated).max())


def test_a_refinement_that_does_not_settle_says_so():
    with pytest.warns(ConvergenceWarning, match="'riv' did not settle: .* needs instruments"):
        model = idn.fit(
            ARX, oscillator(300, 0), method=idn.methods.RefinedInstruments(iterations=1)
        )
    assert not model.details["converged"]


def test_without_noise_refined_instruments_in_closed_loop_are_exact():
    arx = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0))
    record = closed_loop(1500, noise=0.0, seed=4)
    found = idn.fit(arx, record, method=idn.methods.RefinedInstruments("r"))
    np.testing.assert_allclose(found.theta, idn.fit(arx, record).theta, atol=1e-8)


MIMO = dict(
    outputs=("a", "b"),
    inputs=("u", "v"),
    na={"a": {"a": 2, "b": 1}, "b": {"a": 0, "b": 2}},
    nb=((1, 2), (2, 1)),
    delay=((1, 0), (2, 1)),
    offset=True,
    offset_rate=True,
)


@pytest.mark.parametrize("at", ["lag", "now"])
@pytest.mark.parametrize("method", ["riv", "oe", idn.methods.InstrumentalVariables(("u", "v"))])
def test_without_noise_every_method_gives_the_coefficients_of_a_coupled_structure_back(method, at):
    truth = Truth(structure(**MIMO, basis=lpv.BSpline(2, (0.0, 6.0, 13.0)), scheduling_at=at))
    records = [truth.record(moving(350), seed=1), truth.record(moving(250)[::-1].copy(), seed=2)]
    # 1e-8: instruments and trust regions lose a few digits of a condition of 1e3 to 1e4
    np.testing.assert_allclose(
        idn.fit(truth.arx, records, method=method).theta, truth.theta, atol=1e-8
    )


def test_refinement_comes_back_from_a_start_that_diverges():
    truth = Truth(structure(na=2, nb=1))
    record = truth.record(moving(400))
    astray = 0.2 * truth.theta
    astray[0] = -2.5  # y(k) = 2.5 y(k-1) + ...
    (run,) = stretches(truth.arx, [record], outputs=True)
    assert not np.isfinite(run.free_run(astray)).all()
    assert np.isfinite(run.free_run(contracted(truth.arx, astray, [run]))).all()
    found = refined_instruments(truth.arx, [record], None, astray, idn.methods.RefinedInstruments())
    assert found.converged
    np.testing.assert_allclose(found.theta, truth.theta, atol=1e-9)


@pytest.mark.parametrize(
    "method",
    [
        idn.methods.OutputError(),
        idn.methods.OutputError(initial="measured"),
        idn.methods.BoxJenkins(ar=2, ma=1),
        idn.methods.ARMAX(ar=1, ma=2),
    ],
)
def test_sensitivities_are_the_derivatives_of_the_prediction_error(method):
    truth = Truth(structure(**MIMO))
    record = truth.record(moving(90), noise=0.1, noise_seed=50)
    values, t = record.values.copy(), record.time.copy()
    values[30, 0] = values[60, 4] = (
        np.nan
    )  # a measurement, and a scheduling value: the run breaks there
    t[45:] += 9.0
    record = FlightRecord(t, values, record.signals)
    white = isinstance(method, idn.methods.OutputError) and not isinstance(
        method, idn.methods.BoxJenkins
    )
    problem = Residuals(truth.arx, stretches(truth.arx, [record], outputs=not white), method)
    x = problem.start(0.9 * truth.theta)
    exact = problem.jacobian(x)
    h = 1e-6
    differences = np.stack(
        [
            (problem.residuals(x + h * e) - problem.residuals(x - h * e)) / (2 * h)
            for e in np.eye(len(x))
        ],
        axis=1,
    )
    np.testing.assert_allclose(
        exact, differences, atol=1e-7 * np.abs(exact).max()
    )  # central differences: h^2 and 1e-16 / h


@pytest.mark.parametrize("method", [idn.methods.OutputError(), idn.methods.BoxJenkins(ar=1)])
def test_settled_initial_outputs_leave_the_gradient_of_the_others(method):
    """Kaufman's Jacobian is not that of the projected errors, but their gradient is the same."""
    truth = Truth(structure(**MIMO))
    record = truth.record(moving(120), noise=0.1, noise_seed=51)
    t = record.time.copy()
    t[40:] += 9.0
    t[80:] += 9.0
    record = FlightRecord(t, record.values, record.signals)
    white = not isinstance(method, idn.methods.BoxJenkins)
    problem = Residuals(truth.arx, stretches(truth.arx, [record], outputs=not white), method)
    x = problem.settled(problem.start(0.95 * truth.theta))
    full = problem.jacobian(x).T @ problem.residuals(x)
    np.testing.assert_allclose(full[problem.first :], 0.0, atol=1e-9)

    def cost(own):
        there = problem.settled(np.concatenate([own, x[problem.first :]]))
        return 0.5 * np.sum(problem.residuals(there) ** 2)

    h, own = 1e-6, x[: problem.first]
    slopes = [(cost(own + h * e) - cost(own - h * e)) / (2 * h) for e in np.eye(len(own))]
    gradient = problem.reduced_jacobian(x).T @ problem.residuals(x)
    np.testing.assert_allclose(gradient, slopes, atol=1e-6 * np.abs(gradient).max())


def test_output_error_bridges_missing_outputs_and_finds_where_each_stretch_starts():
    truth = Truth(structure(na=2, nb=1))
    record = truth.record(moving(400))
    values = record.values.copy()
    values[:2, 0] = np.nan  # the initial outputs of the first stretch were never measured
    values[50:55, 0] = np.nan
    holed = FlightRecord(record.time, values, record.signals)
    model = idn.fit(truth.arx, holed, method="oe")
    np.testing.assert_allclose(model.theta, truth.theta, atol=1e-8)
    np.testing.assert_allclose(model.details["simulation_covariance"], [[0.0]], atol=1e-14)


@pytest.mark.parametrize("option", ["forgetting", "instruments", "options"])
def test_an_option_beside_the_method_is_refused(option):
    with pytest.raises(TypeError, match=f"unexpected keyword argument '{option}'"):
        idn.fit(ARX, oscillator(100, 0), "ridge", **{option: 0.9})


def test_a_new_estimator_is_a_subclass_and_nothing_else():
    class Nothing(idn.methods.Method):
        """Every coefficient zero."""

        shorthand = "nothing"
        needs_excitation = False

        def estimate(self, arx, records, data):
            return idn.methods.Estimate(
                theta=np.zeros((arx.n_regressors, arx.ny)),
                details={"rows": len(data.phi)},
                remarks=(ConvergenceWarning("nothing to settle"),),
            )

    record = oscillator(100, 0)
    for method in ("nothing", Nothing()):
        with pytest.warns(ConvergenceWarning, match="nothing to settle") as said:
            model = idn.fit(ARX, record, method)
        assert said[0].filename == __file__
        assert model.method == "nothing"
        assert model.details["rows"] == model.rows_used
        # the residuals of a model of zeros are the outputs
        y = stacked(ARX, [record]).y
        np.testing.assert_allclose(model.residual_covariance * (len(y) - ARX.n_regressors), y.T @ y)


def test_forgetting_is_an_option_of_the_recursion():
    record = oscillator(600, 0)
    batch = idn.fit(ARX, record)
    np.testing.assert_allclose(
        idn.fit(ARX, record, idn.methods.Recursion()).theta, batch.theta, atol=1e-9
    )
    for forgetting in (
        0.98,
        idn.forgetting.Constant(0.98),
        idn.forgetting.Variable(),
        idn.forgetting.Directional(0.9),
    ):
        found = idn.fit(ARX, record, idn.methods.Recursion(forgetting))
        history = idn.RecursiveLeastSquares(ARX, forgetting).run(record)
        assert np.abs(found.theta - batch.theta).max() > 1e-3
        np.testing.assert_allclose(found.theta, history.model.theta, atol=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda: idn.methods.Ridge(weight=-1.0),
        lambda: idn.methods.Ridge(towards="one"),
        lambda: idn.methods.Lasso(weight=1.5),
        lambda: idn.methods.RefinedInstruments(iterations=0),
        lambda: idn.methods.OutputError(initial="guessed"),
        lambda: idn.methods.OutputError(tolerance=0.0),
    ],
)
def test_options_out_of_range_are_refused_when_made(make):
    with pytest.raises(InputError, match="expected"):
        make()


def test_rows_that_the_methods_share_are_counted_alike():
    record = oscillator(300, 0)
    used = {
        m: idn.fit(ARX, record, method=m).rows_used for m in ("ls", "ridge", "lasso", "riv", "oe")
    }
    assert set(used.values()) == {len(stacked(ARX, [record]).phi)}
