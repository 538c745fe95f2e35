"""From coefficients to what is made of them: draws, frequency responses, pictures."""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from identification.judge.coefficient_covariance import covariances
from symheli.errors import InputError
from symheli.records import FlightRecord

TWO = structure(
    outputs=("a", "b"),
    inputs=("u",),
    na={"a": 2, "b": 1},
    nb=1,
    basis=idn.Polynomial(1, 0.0, 13.0),
    offset=True,
)
OMEGA = np.array([0.5, 4.0, 15.0])


def noisy(truth, seed, n=600, mixing=((1.0, 0.0), (0.8, 0.6))):
    """A record whose two equations have correlated noise: their outputs, driven by the
    coefficients, and a fit of it.
    """
    rng, p, arx = np.random.default_rng(seed), moving(n), truth.arx
    u, e, y = (
        rng.normal(size=(n, arx.nu)),
        0.3 * rng.normal(size=(n, arx.ny)) @ np.transpose(mixing),
        np.zeros((n, arx.ny)),
    )
    values = truth.coefficients.at(p)
    for k in range(arx.memory, n):
        y[k] = e[k] + values.c[k - 1]
        y[k] -= sum(values.A[k - i, i - 1] @ y[k - i] for i in arx.output_lags)
        y[k] += sum(values.B[k - lag, j] @ u[k - lag] for j, lag in enumerate(arx.input_lags))
    columns = dict(zip((*arx.outputs, *arx.inputs, "p"), np.column_stack([y, u, p]).T, strict=True))
    record = FlightRecord.from_arrays(0.1 * np.arange(n), dict.fromkeys(columns, "1"), **columns)
    return idn.fit(arx, record), record


def test_the_covariance_is_its_double_sum():
    rng, lags = np.random.default_rng(0), 4
    runs, n = [slice(0, 3), slice(3, 40)], TWO.n_regressors  # one shorter than the lags
    phi, error = rng.normal(size=(40, n)), rng.normal(size=(40, 2))
    joint, _, freedom = covariances(TWO, phi, error, runs, lags)
    R = {}
    for lag in range(-lags, lags + 1):
        pairs = [
            (k, k + lag)
            for r in runs
            for k in range(r.start, r.stop)
            if r.start <= k + lag < r.stop
        ]
        R[lag] = (
            sum(np.outer(error[a], error[b]) for a, b in pairs) / 40 * (1 - abs(lag) / (lags + 1))
        )
    left = {}  # what share of the noise the fit leaves in the residuals
    for i, j in ((0, 0), (1, 1), (0, 1), (1, 0)):
        a, b = (next(TWO.regressors(g) for g in TWO.groups if y in g.outputs) for y in (i, j))
        X, Z = phi[:, a], phi[:, b]
        middle = sum(
            R[q - k][i, j] * np.outer(X[k], Z[q])
            for r in runs
            for k in range(r.start, r.stop)
            for q in range(r.start, r.stop)
            if abs(q - k) <= lags
        )
        if i == j:
            left[i] = 1 - np.trace(np.linalg.inv(X.T @ X) @ middle) / np.sum(error[:, i] ** 2)
            independent = 40 / sum((R[lag][i, i] / R[0][i, i]) ** 2 for lag in R) * left[i]
            assert freedom[i] == pytest.approx(1 / (1 / independent + lags / 60))
        expected = (
            np.linalg.inv(X.T @ X) @ middle @ np.linalg.inv(Z.T @ Z) / np.sqrt(left[i] * left[j])
        )
        # 1e-12 of the largest entry: two orders of summation, condition below 100
        np.testing.assert_allclose(
            joint[i][np.ix_(a, [j], b)][:, 0],
            expected,
            rtol=0,
            atol=1e-12 * max(np.abs(joint).max(), 1),
        )


@pytest.mark.slow
def test_response_errors_are_the_scatter_of_repeated_experiments():
    truth = Truth(TWO, size=1.2)
    exact = idn.model.LPVARXModel(
        structure=TWO,
        theta=truth.theta,
        dt=0.1,
        outputs=TWO.outputs,
        inputs=TWO.inputs,
        scheduling="p",
        residual_covariance=np.eye(2),
        rows_used=1,
    )
    G = exact.at(6.0).frequency_response(OMEGA)
    errors, claimed = [], []
    for seed in range(150):
        model, record = noisy(truth, seed)
        band = idn.uncertainty(model, record, lags=5).frequency_response(6.0, OMEGA)
        np.testing.assert_allclose(band.G, model.at(6.0).frequency_response(OMEGA), rtol=1e-9)
        errors.append(np.abs(band.G - G) ** 2)
        claimed.append(band.standard_error**2)
    # the root mean square of 150 draws is known to 4-6 %, the taper and 28 lost degrees of freedom
    # add some
    np.testing.assert_allclose(
        np.sqrt(np.mean(claimed, axis=0)), np.sqrt(np.mean(errors, axis=0)), rtol=0.2
    )


def test_draws_scatter_as_the_covariance_says_and_reach_the_state_space_form():
    model, record = noisy(Truth(TWO, size=1.2), 1)
    known = idn.uncertainty(model, record, lags=5)
    drawn = known.draws(1500, seed=3)
    flat = np.array([m.theta.T.reshape(-1) for m in drawn])
    square = known.covariance.reshape((flat.shape[1],) * 2)
    sigma = np.sqrt(np.maximum(np.diagonal(square), np.finfo(float).tiny))
    # correlations of 1500 draws are known to 0.026; four of those
    np.testing.assert_allclose(
        np.cov(flat.T) / np.outer(sigma, sigma), square / np.outer(sigma, sigma), atol=0.11
    )
    assert not np.any(flat[:, ~TWO.free.T.reshape(-1)])
    responses = np.array(
        [m.to_state_space().at(6.0).frequency_response(OMEGA) for m in drawn[:500]]
    )
    scatter = np.sqrt(
        np.mean(np.abs(responses - known.frequency_response(6.0, OMEGA).G) ** 2, axis=0)
    )
    np.testing.assert_allclose(
        scatter, known.frequency_response(6.0, OMEGA).standard_error, rtol=0.15
    )  # 500 draws: 3 %, and curvature
    np.testing.assert_array_equal(known.draws(2, seed=3)[1].theta, known.draws(5, seed=3)[1].theta)
    with pytest.raises(InputError, match="count: expected"):
        known.draws(0)


def test_correlated_noise_correlates_the_coefficients_of_two_equations():
    """With all noise shared, ignoring it between equations would be off by as much as the response
    error itself.
    """
    shared = structure(
        outputs=("a", "b"), inputs=("u",), na=1, nb=1, basis=idn.Polynomial(0, 0.0, 13.0)
    )
    model, record = noisy(Truth(shared), 2, mixing=((1.0, 0.0), (1.0, 0.0)))
    joint = idn.uncertainty(model, record, lags=1).covariance
    assert joint[0, 2, 1, 2] == pytest.approx(
        np.sqrt(joint[0, 2, 0, 2] * joint[1, 2, 1, 2]), rel=1e-6
    )


def test_bands_become_a_picture_with_a_panel_a_coefficient():
    pytest.importorskip("matplotlib")
    model, record = noisy(Truth(TWO), 1)
    known = idn.uncertainty(model, record)
    panels = known.plot(0.9)
    assert set(panels) == {ax for ax in panels[0].figure.axes if ax.get_visible()}
    assert [ax.get_title(loc="left") for ax in panels] == [
        f"{b.regressor} in {b.output}" for b in known.bands([1.0])
    ]
    low, high = known.bands([0.0])[0].interval(0.9)
    edge = panels[0].collections[0].get_paths()[0].vertices
    assert {round(float(v), 9) for v in (low[0], high[0])} <= {
        round(float(v), 9) for v in edge[edge[:, 0] == 0.0][:, 1]
    }
    with pytest.raises(InputError, match="level"):
        known.plot(95)
