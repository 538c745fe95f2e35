"""The covariance a fit keeps: what it is for each method, and that coefficients scatter so."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from known_systems import Truth, moving, structure
from known_vehicles import Vehicle
from scipy.stats import chi2

import identification as idn
from identification.judge import coefficient_covariance
from identification.model.symmetric_root import symmetric_root
from identification.structure.regressors import stacked
from symheli.errors import InputError
from symheli.records import FlightRecord

SAME = structure(outputs=("a", "b"), inputs=("u",), na=1, nb=1, basis=idn.Polynomial(1, 0.0, 13.0))
OTHER = replace(SAME, na={"a": {"a": 1, "b": 0}, "b": 1})  # equations with their own regressors
MIXING = np.array([[0.3, 0.0], [0.2, 0.1]])


def record_of(truth, seed, n=400):
    """Outputs by the coefficients of `truth`, driven by white equation errors that the two outputs
    share in part.
    """
    rng, p = np.random.default_rng(seed), moving(n)
    u, e, y = rng.normal(size=(n, 1)), rng.normal(size=(n, 2)) @ MIXING.T, np.zeros((n, 2))
    values = truth.coefficients.at(p)
    for k in range(1, n):
        y[k] = e[k] - values.A[k - 1, 0] @ y[k - 1] + values.B[k - 1, 0] @ u[k - 1]
    columns = dict(zip(("a", "b", "u", "p"), np.column_stack([y, u, p]).T, strict=True))
    return FlightRecord.from_arrays(0.1 * np.arange(n), dict.fromkeys(columns, "1"), **columns)


@pytest.mark.parametrize("method", ["ls", "rls"])
def test_of_least_squares_it_is_sigma_kron_the_inverse_of_phi_phi(method):
    record = record_of(Truth(SAME), 0)
    model, data = idn.fit(SAME, record, method), stacked(SAME, [record])
    n, error = SAME.n_regressors, data.y - data.phi @ model.theta
    sigma = error.T @ error / (len(error) - n)
    expected = np.kron(sigma, np.linalg.inv(data.phi.T @ data.phi))
    assert model.covariance.shape == (2, n, 2, n)
    np.testing.assert_allclose(
        model.covariance.reshape(2 * n, 2 * n), expected, rtol=1e-8, atol=1e-10 * expected.max()
    )


@pytest.mark.parametrize("method", ["ls", "rls"])
def test_equations_with_their_own_regressors_have_the_covariance_of_their_solutions(method):
    """theta = M vec(e) with M of each equation its pseudo-inverse: M (sigma (x) 1) M'."""
    record = record_of(Truth(OTHER), 0)
    model, data = idn.fit(OTHER, record, method), stacked(OTHER, [record])
    n, free = OTHER.n_regressors, OTHER.free
    error = data.y - data.phi @ model.theta
    left = np.sqrt(len(error) - free.sum(axis=0))
    sigma = error.T @ error / np.outer(left, left)
    M = np.zeros((2, n, len(error)))
    for y in range(2):
        M[y, free[:, y]] = np.linalg.pinv(data.phi[:, free[:, y]])
    expected = np.einsum("yz,yik,zjk->yizj", sigma, M, M)
    assert not free.all()
    np.testing.assert_allclose(model.covariance, expected, rtol=1e-8, atol=1e-10 * expected.max())
    known = idn.uncertainty(model, record)
    np.testing.assert_allclose(known.white, model.covariance, rtol=1e-8, atol=1e-14)
    assert known.covariance.shape == model.covariance.shape


@pytest.mark.slow(but="same regressors")
@pytest.mark.parametrize("arx", [SAME, OTHER], ids=["same regressors", "own regressors"])
def test_coefficients_of_200_records_scatter_as_it_says(arx):
    """The errors e' P^-1 e of r coefficients are chi-squared with r degrees of freedom, their sum
    over 200 records with 200 r: between its quantiles at 1e-4 and 1 - 1e-4, widened by 3 %. So
    are those of the differences between the equations, which hang on the blocks between them.

    P holds an estimate of the covariance of two residuals from 393 degrees of freedom, which makes
    the mean larger by 3/390 (the mean of an inverse Wishart matrix), and lagged outputs are not
    independent of the noise before them, which moves mean and variance by the order of 6/400 of
    themselves: 3 % in all.
    """
    truth, records, n = Truth(arx), 200, arx.n_regressors
    free, both = arx.free.T.reshape(-1), arx.free.all(axis=1)
    together, apart = 0.0, 0.0
    for seed in range(records):
        model = idn.fit(arx, record_of(truth, seed))
        off, P = model.theta - truth.theta, model.covariance
        every = P.reshape(2 * n, 2 * n)[np.ix_(free, free)]
        together += _square(off.T.reshape(-1)[free], every)
        between = P[0, :, 0] + P[1, :, 1] - P[0, :, 1] - P[1, :, 0]
        apart += _square((off[:, 0] - off[:, 1])[both], between[np.ix_(both, both)])
    for total, freedom in ((together, free.sum()), (apart, both.sum())):
        low, high = chi2.ppf([1e-4, 1 - 1e-4], records * freedom)
        assert 0.97 * low < total < 1.03 * high


def _square(error, covariance):
    return error @ np.linalg.solve(covariance, error)


def test_fit_keeps_what_each_method_gives():
    record = record_of(Truth(SAME), 1)
    for method in ("ls", "rls"):
        assert idn.fit(SAME, record, method).covariance is not None
    for method in (
        idn.methods.Recursion(0.99),  # coefficients that move
        idn.methods.Ridge(1e-3),
        idn.methods.Lasso(),
        idn.methods.InstrumentalVariables("u"),
        idn.methods.RefinedInstruments(iterations=2),
        idn.methods.OutputError(evaluations=3),
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # weak or unsettled
            assert idn.fit(SAME, record, method).covariance is None

    class Own(idn.methods.Method):
        shorthand = "own"

        def estimate(self, arx, records, data):
            n = arx.n_regressors
            P = np.arange(4.0 * n * n).reshape(2, n, 2, n)
            return idn.methods.Estimate(theta=np.zeros((n, 2)), covariance=P)

    n = SAME.n_regressors
    found = idn.fit(SAME, record, Own()).covariance
    np.testing.assert_array_equal(found, np.arange(4.0 * n * n).reshape(2, n, 2, n))
    assert not found.flags.writeable


def test_it_has_the_layout_of_all_coefficients_together():
    model = idn.fit(SAME, record_of(Truth(SAME), 2))
    n = SAME.n_regressors
    for shape in ((2, n, n), (n, 2, n, 2)):
        with pytest.raises(InputError, match="covariance: expected shape"):
            replace(model, covariance=np.zeros(shape))
    for drawn in idn.uncertainty(model, record_of(Truth(SAME), 2)).draws(2):
        assert drawn.covariance is None  # a draw is no estimate


def test_without_a_sample_to_spare_nothing_is_known_of_the_residuals():
    record = record_of(Truth(SAME), 3, n=SAME.n_regressors + 1)
    assert len(stacked(SAME, [record]).phi) == SAME.n_regressors
    assert idn.fit(SAME, record).covariance is None


@pytest.mark.slow
def test_known_kinematics_have_that_of_their_regression_and_it_is_no_proof_by_least_squares():
    """Noise of the sensors biases least squares, and its covariance does not know."""
    vehicle, sensors = Vehicle(na=1, nb=1), np.array([0.02] * 3 + [0.005] * 3 + [0.002] * 2)
    record = vehicle.record(800, seed=0, sensors=sensors)
    model = idn.fit(vehicle.kin, record)
    n = model.structure.n_regressors
    assert model.covariance.shape == (6, n, 6, n)
    assert model.covariance is model.aerodynamics.covariance
    with pytest.raises(InputError, match="no covariance that holds for noise in the regressors"):
        model.uncertain()
    flown = idn.methods.InstrumentalVariables(vehicle.without_noise(seed=0))
    by_instruments = idn.fit(vehicle.kin, record, flown)
    assert by_instruments.covariance.shape == (6, n, 6, n)
    assert by_instruments.uncertain().probability == 0.95
    assert idn.fit(vehicle.kin, record, "ridge").covariance is None


def test_draws_do_not_depend_on_the_signs_of_eigenvectors(monkeypatch):
    rng, plain = np.random.default_rng(0), np.linalg.eigh
    M = rng.normal(size=(5, 3))
    covariance = M @ M.T
    root = symmetric_root(covariance)
    # three of five directions have a variance: the root is exact to rounding of its square root
    np.testing.assert_allclose(root @ root, covariance, atol=1e-12)

    def turned(matrix):
        values, vectors = plain(matrix)
        return values, vectors * [1, -1, 1, -1, -1]

    arguments = (np.zeros((5, 1)), covariance.reshape(1, 5, 1, 5), np.ones((5, 1), bool), 4, 1)
    before = coefficient_covariance.drawn(*arguments)
    monkeypatch.setattr(np.linalg, "eigh", turned)
    np.testing.assert_allclose(coefficient_covariance.drawn(*arguments), before, rtol=0, atol=1e-12)
