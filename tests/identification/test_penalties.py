"""Ridge and lasso: the optimum they promise, checked by what defines it."""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from identification.estimators.lasso import lasso_path
from identification.estimators.ridge import GRID
from identification.structure.regressors import regression
from symheli import lpv
from symheli.errors import ExcitationError


def noisy(n=300, **over):
    truth = Truth(structure(**over))
    return truth, truth.record(moving(n), noise=0.3, noise_seed=50)


def test_ridge_without_weight_is_least_squares_and_with_all_weight_the_lti_fit():
    truth, record = noisy(outputs=("a", "b"), na={"a": 2, "b": 1})
    free, none = (
        idn.fit(truth.arx, record),
        idn.fit(truth.arx, record, idn.methods.Ridge(weight=0.0)),
    )
    np.testing.assert_allclose(none.theta, free.theta, atol=1e-10)
    lti = idn.fit(truth.arx.lti(), record).coefficients.at(4.0)
    flat = idn.fit(truth.arx, record, idn.methods.Ridge(weight=1e8)).coefficients
    for p in (0.0, 13.0):
        for found, constant in zip(flat.at(p), lti, strict=True):
            np.testing.assert_allclose(
                found, constant, atol=1e-6
            )  # 1e-8 of the data left against the penalty, times a few
    zero = idn.fit(truth.arx, record, idn.methods.Ridge(weight=1e8, towards="zero"))
    assert np.abs(zero.theta).max() < 1e-6


@pytest.mark.parametrize("towards", ["constant", "zero"])
def test_ridge_does_not_care_how_the_functions_are_written_nor_about_units(towards):
    truth, record = noisy(basis=idn.Polynomial(1, 0.0, 13.0))
    options = idn.methods.Ridge(weight=0.1, towards=towards)
    hats, own = (
        lpv.PiecewiseLinear((0.0, 13.0)),
        lpv.UserFunctions((np.ones_like, lambda p: 1e3 * p), 0.0, 13.0),
    )
    fits = [
        idn.fit(structure(basis=b), record, options).predict(record, 1)
        for b in (truth.arx.basis, hats, own)
    ]
    np.testing.assert_allclose(fits[1], fits[0], atol=1e-9)
    np.testing.assert_allclose(fits[2], fits[0], atol=1e-9)
    units = dict.fromkeys(("y", "u", "p"), "1")
    scaled = type(record).from_arrays(
        record.time, units, y=1e3 * record["y"], u=1e-3 * record["u"], p=record["p"]
    )
    other = idn.fit(truth.arx, scaled, options).predict(scaled, 1)
    np.testing.assert_allclose(1e-3 * other, fits[0], atol=1e-9)


def test_cross_validated_weight_is_the_best_of_a_brute_force_search():
    truth, record = noisy(60)
    model = idn.fit(truth.arx, record, method="ridge")
    data = regression(truth.arx, record)
    # the penalty from its definition: for orthonormal polynomials the variance over p is the sum of
    # squares but for the constant one
    m, size = len(data.phi), truth.arx.basis.size
    P = np.zeros((data.phi.shape[1],) * 2)
    for j in range(0, len(P), size):
        P[j : j + size, j : j + size] = (
            np.diag([0.0] + [1.0] * (size - 1))
            * np.sum(data.phi[:, j : j + size] ** 2)
            / (size * m)
        )

    def score(weight):
        H = data.phi @ np.linalg.solve(data.phi.T @ data.phi + m * weight * P, data.phi.T)
        error = data.y[:, 0] - H @ data.y[:, 0]
        return m * error @ error / (m - np.trace(H)) ** 2

    (chosen,) = model.details["weight"]
    # within the tolerance of the search (0.01 decades) the score is flat
    assert score(chosen) <= min(score(w) for w in 10.0 ** np.linspace(GRID[0], GRID[-1], 400)) * (
        1 + 1e-6
    )


def test_ridge_predicts_better_than_least_squares_where_the_data_bear_fewer_coefficients():
    gains = []
    for seed in range(6):
        truth = Truth(structure(na=1, nb=1, basis=idn.Polynomial(1, 0.0, 13.0)), seed=seed)
        rich = structure(na=3, nb=3, basis=idn.Polynomial(2, 0.0, 13.0))
        short = truth.record(moving(45), noise=0.5, seed=seed, noise_seed=50 + seed)
        fresh = truth.record(moving(400), noise=0.5, seed=99, noise_seed=98)
        ls, penalised = idn.fit(rich, short), idn.fit(rich, short, method="ridge")
        gains.append(float(penalised.score(fresh, 1)["y"]) - float(ls.score(fresh, 1)["y"]))
    assert np.mean(gains) > 5.0  # percent of fit; 18 coefficients on 42 samples


def test_ridge_fits_where_least_squares_must_refuse_and_says_what_the_data_lack():
    truth = Truth(structure(basis=idn.Polynomial(3, 0.0, 13.0)))
    record = truth.record(6.5 * (1 + np.sin(np.pi * np.arange(200) / 3)), noise=0.1, noise_seed=50)
    with pytest.raises(ExcitationError, match="distinct values"):
        idn.fit(truth.arx, record)
    model = idn.fit(truth.arx, record, method="ridge")
    assert model.excitation is not None
    assert "needs 4" in model.excitation.reason
    with pytest.raises(ExcitationError, match="data and penalty do not determine"):
        idn.fit(truth.arx, record, idn.methods.Ridge(weight=0.0))


def test_every_corner_of_the_lasso_path_meets_the_optimality_conditions():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(80, 12)) @ rng.normal(
        size=(12, 12)
    )  # correlated: coefficients leave again on the way
    X /= np.sqrt(np.mean(X**2, axis=0))
    y = X[:, [1, 4]] @ [2.0, -1.0] + 0.5 * rng.normal(size=80)
    prices, path = lasso_path(X, y)
    assert prices[-1] == pytest.approx(0.0, abs=1e-12)
    leaves = 0
    for price, b, before in zip(prices, path, np.vstack([path[:1], path[:-1]]), strict=True):
        correlation = X.T @ (y - X @ b) / len(y)
        assert np.abs(correlation).max() <= price + 1e-10
        np.testing.assert_allclose(correlation[b != 0], price * np.sign(b[b != 0]), atol=1e-10)
        leaves += bool(np.any((before != 0) & (b == 0)))
    assert leaves > 0
    np.testing.assert_allclose(path[-1], np.linalg.lstsq(X, y, rcond=None)[0], atol=1e-9)


def test_lasso_keeps_what_is_there_and_drops_what_is_not():
    """Order 1 and degree 1, looked for among order 3 and degree 3; one true coefficient is 190
    times smaller than another.
    """
    truth = Truth(structure(na=1, nb=1, basis=idn.Polynomial(1, 0.0, 13.0)), seed=4)
    rich = structure(na=3, nb=3, basis=idn.Polynomial(3, 0.0, 13.0))
    p = moving(600)
    for noise, tolerance in ((0.0, 1e-9), (0.05, 0.02)):
        record = truth.record(p, noise=noise, noise_seed=50)
        model = idn.fit(rich, record, method="lasso")
        found = model.coefficients
        true = truth.coefficients
        np.testing.assert_allclose(found.A[0, :2], true.A[0], atol=tolerance)
        np.testing.assert_allclose(found.B[0, :2], true.B[0], atol=tolerance)
        assert (
            model.details["kept"][0] <= 4
        )  # the true ones; with noise the small one may be missed
        assert np.count_nonzero(model.theta) == model.details["kept"][0]


def test_lasso_at_the_ends_of_the_path():
    truth, record = noisy()
    none = idn.fit(truth.arx, record, idn.methods.Lasso(weight=1.0))
    assert not none.theta.any()
    full = idn.fit(truth.arx, record, idn.methods.Lasso(weight=0.0, refit=False))
    np.testing.assert_allclose(full.theta, idn.fit(truth.arx, record).theta, atol=1e-8)
