"""After a fit: how certain the coefficients are, what the residuals say, which orders the data
support.
"""

import numpy as np
import pytest
from known_systems import Truth, flown, moving, structure
from scipy.signal import lfilter

from identification import LPVARX, Polynomial, fit, order_scan, residual_analysis, uncertainty
from identification.judge import theil
from symheli.errors import InputError
from symheli.records import FlightRecord

FIR = LPVARX(
    outputs=("y",),
    inputs=("u",),
    scheduling="p",
    na=0,
    nb=1,
    delay=1,
    basis=Polynomial(1, 0.0, 13.0),
)


def fir_record(seed, colour, n=1500):
    """y = (1 + p/13) u(k-1) + coloured noise, with an input as slow as the noise and p slower than
    both.
    """
    rng = np.random.default_rng(seed)
    p, u = (
        6.5 + 6 * np.sin(2 * np.pi * np.arange(n) / 500),
        lfilter([1.0], [1.0, -0.9], rng.standard_normal(n)),
    )
    e = lfilter([1.0], [1.0, -colour], rng.standard_normal(n)) * np.sqrt(1 - colour**2)
    y = 0.3 * e
    y[1:] += (1 + p[:-1] / 13) * u[:-1]
    return FlightRecord.from_arrays(
        0.1 * np.arange(n), {"y": "1", "u": "1", "p": "1"}, y=y, u=u, p=p
    )


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_standard_errors_are_the_scatter_of_repeated_experiments(colour):
    fits, errors, white = [], [], []
    for seed in range(150):
        record = fir_record(seed, colour)
        model = fit(FIR, record)
        u = uncertainty(model, record, lags=60)  # the noise forgets within 30 samples
        fits.append(model.theta[:, 0])
        errors.append(u.standard_errors[:, 0])
        white.append(np.sqrt(np.diagonal(u.white[0, :, 0])))
    scatter = np.std(fits, axis=0, ddof=1)
    # the scatter of 150 fits is known to 6 %; the taper takes a few percent off
    np.testing.assert_allclose(np.mean(errors, axis=0), scatter, rtol=0.25)
    if colour:
        assert np.all(
            np.mean(white, axis=0) < 0.6 * scatter
        )  # the usual formula is too sure of itself


@pytest.mark.slow
def test_bands_hold_the_true_coefficient_functions_as_often_as_they_say():
    p = np.linspace(1.0, 12.0, 5)
    inside = []
    for seed in range(120):
        record = fir_record(seed, 0.0)
        bands = uncertainty(fit(FIR, record), record, lags=5).bands(p)
        for band, truth in zip(bands, (1 + p / 13,), strict=True):
            low, high = band.interval(0.9)
            inside.append((low <= truth) & (truth <= high))
    assert np.mean(inside) == pytest.approx(0.9, abs=0.06)
    assert [(b.output, b.regressor) for b in bands] == [("y", "u(k-1)")]


def test_an_equation_without_a_coefficient_has_no_band_for_it():
    arx = LPVARX(
        ("a", "b"),
        ("u",),
        "p",
        na={"a": {"a": 1, "b": 0}, "b": {"a": 1, "b": 1}},
        nb=1,
        delay=1,
        basis=Polynomial(1, 0.0, 13.0),
    )
    rng = np.random.default_rng(0)
    columns = dict(zip("abu", rng.standard_normal((3, 400)), strict=True)) | {"p": moving(400)}
    record = FlightRecord.from_arrays(0.1 * np.arange(400), dict.fromkeys(columns, "1"), **columns)
    u = uncertainty(fit(arx, record), record)
    assert {(b.output, b.regressor) for b in u.bands([3.0])} == {
        ("a", "a(k-1)"),
        ("a", "u(k-1)"),
        ("b", "a(k-1)"),
        ("b", "b(k-1)"),
        ("b", "u(k-1)"),
    }
    assert np.all(np.isfinite(u.colour))


def test_uncertainty_is_refused_where_it_would_mislead():
    record = fir_record(0, 0.0)
    model = fit(structure(), record)
    with pytest.raises(InputError, match="lags"):
        uncertainty(model, record, lags=10_000)
    short = FlightRecord(record.time[:12], record.values[:12], record.signals)
    with pytest.raises(InputError, match="say nothing"):
        uncertainty(model, short)


def test_residuals_of_the_true_structure_are_white_and_those_of_a_smaller_one_are_not():
    truth = Truth(structure(), seed=3, size=1.5)
    record = truth.record(moving(3000), noise=0.05)
    good = residual_analysis(fit(structure(), record), record)
    assert np.all(good.portmanteau > 0.01)
    assert good.outside[0] < 0.1
    assert good.inputs_outside[0, 0] < 0.1
    poor = residual_analysis(fit(structure(nb=1, na=1), record), record)
    assert poor.portmanteau[0] < 1e-6
    assert "coloured" in str(poor)
    assert "white" in str(good)


def test_static_dependence_fitted_to_a_system_with_dynamic_dependence_leaves_coloured_residuals():
    arx = structure(na=1, nb=1)
    p, u = moving(2000), np.random.default_rng(1).standard_normal(2000)
    # the coefficient depends on p(k) - p(k-1) too
    y = np.zeros(2000)
    for k in range(1, 2000):
        y[k] = (0.5 + 0.02 * p[k - 1] + 0.15 * (p[k] - p[k - 1])) * y[k - 1] + u[k - 1]
    record = FlightRecord.from_arrays(
        0.1 * np.arange(2000), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    model = fit(arx, record)
    assert model.score(record, horizon=1)["y"] < 90
    exact = flown(
        arx, [lambda q: np.array([[-0.5 - 0.02 * q]])], [lambda q: np.array([[1.0]])], p, u[:, None]
    )
    assert fit(arx, exact).score(exact, horizon=1)["y"] == pytest.approx(100.0)


def test_theils_shares_add_up_and_name_the_cause():
    rng = np.random.default_rng(2)
    y = rng.standard_normal(4000)
    for guess, cause in (
        (y + 1.0, "bias"),
        (0.5 * y, "variance"),
        (y + 0.3 * rng.standard_normal(4000), "covariance"),
    ):
        t = theil(y, guess)
        assert t.bias + t.variance + t.covariance == pytest.approx(1.0)
        assert getattr(t, cause) > 0.9
    assert theil(y, y).coefficient == 0.0
    with pytest.raises(InputError, match="two finite arrays"):
        theil(y, y[:-1])


def test_an_order_scan_finds_the_order_and_degree_that_made_the_data():
    arx = structure(na=2, nb=2, basis=Polynomial(1, 0.0, 13.0))
    truth = Truth(arx, seed=5, size=1.6)
    train, test = (
        truth.record(moving(1500), noise=0.1),
        truth.record(moving(1200)[200:], noise=0.1, seed=7),
    )
    scan = order_scan(arx, train, test, orders=(1, 2, 3), degrees=(0, 1, 2), horizon=5)
    best = scan.best("bic")
    assert (best.na, best.degree) == (2, 1)
    assert scan.best("ahead").na >= 2
    assert len(str(scan).splitlines()) == 2 + 9
    with pytest.raises(InputError, match="by:"):
        scan.best("luck")


def test_structures_the_data_cannot_determine_are_listed_with_the_reason():
    k = np.arange(400)
    arx, u = structure(), np.random.default_rng(0).standard_normal((400, 1))
    record = flown(
        arx,
        [lambda q: np.array([[0.1]])] * 2,
        [lambda q: np.array([[1.0]])] * 2,
        6.5 + 6 * np.sin(np.pi * k / 3),
        u,
    )
    scan = order_scan(arx, record, record, orders=(2,), degrees=(2, 3), horizon=5)
    assert not scan.trials[0].refused
    assert "3 distinct values" in scan.trials[1].refused
    assert "refused" in str(scan)
