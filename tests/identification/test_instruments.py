"""Closed-loop noise biases least squares; the external excitation does not know the noise."""

import warnings

import numpy as np
import pytest
from known_systems import structure

import identification as idn
from identification.estimators.first_stage import first_stage
from symheli.errors import DataWarning, ExcitationError, InputError
from symheli.records import FlightRecord

GAIN = 0.35


def closed_loop(n, *, noise, seed, at="lag", a=(1.75, 0.80)):
    """A plant held by u = r - GAIN y_measured; the noise is on the measurement and so goes round
    the loop. Unstable at high p.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    p = 6.5 + 6.0 * np.sin(0.021 * k)
    r = rng.choice([-1.0, 1.0], n).repeat(3)[:n]
    e = noise * rng.normal(size=n)
    true, y, u = np.zeros(n), np.zeros(n), np.zeros(n)
    for j in range(n):
        if j >= 2:
            q = p[j - 1] if at == "lag" else p[j]
            q2 = p[j - 2] if at == "lag" else p[j]
            true[j] = (
                (a[0] + 0.01 * q) * true[j - 1]
                - (a[1] + 0.004 * q2) * true[j - 2]
                + (0.5 + 0.02 * q) * u[j - 1]
            )
        y[j] = true[j] + e[j]
        u[j] = r[j] - GAIN * y[j]
    return FlightRecord.from_arrays(0.05 * k, dict.fromkeys("yurp", "1"), y=y, u=u, r=r, p=p)


def errors(method, *, at, seeds=(1, 2, 3)):
    arx = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0), scheduling_at=at)
    nodes = np.array([2.0, 6.5, 11.0])
    true = np.stack([-(1.75 + 0.01 * nodes), 0.80 + 0.004 * nodes], axis=1)
    out = []
    for seed in seeds:
        found = idn.fit(
            arx, closed_loop(6000, noise=0.5, seed=seed, at=at), method=method
        ).coefficients.at(nodes)
        out.append(found.A[:, :, 0, 0] - true)
    return np.array(out)


@pytest.mark.parametrize("at", ["lag", "now"])
def test_least_squares_is_badly_biased_by_closed_loop_noise_and_instruments_are_not(at):
    biased, unbiased = errors("ls", at=at), errors(idn.methods.InstrumentalVariables("r"), at=at)
    # the same sign and size in every realization: a bias, not scatter. Measured 0.28 with a scatter
    # of 0.008; A_1 is about 1.8
    assert np.abs(biased.mean(axis=0)).max() > 0.2
    assert np.abs(biased.mean(axis=0)).max() > 10 * biased.std(axis=0).max()
    # what is left is scatter: 0.003 a realization at 6000 samples, so the mean of three stays
    # within 0.01
    assert np.abs(unbiased.mean(axis=0)).max() < 0.01


def test_without_noise_instruments_give_the_exact_coefficients():
    arx = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0), offset=True, offset_rate=True)
    record = closed_loop(1500, noise=0.0, seed=4)
    exact, found = (
        idn.fit(arx, record),
        idn.fit(arx, record, idn.methods.InstrumentalVariables("r")),
    )
    # projecting on instruments loses a few digits of a condition of 1e3
    np.testing.assert_allclose(found.theta, exact.theta, atol=1e-8)


def test_too_few_or_blind_instruments_are_refused():
    arx = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0))
    record = closed_loop(800, noise=0.1, seed=5)
    with pytest.raises(ExcitationError, match="at least as many"):
        idn.fit(
            arx,
            record,
            idn.methods.InstrumentalVariables(idn.structure.LaggedSignals("r", window=0.1, lags=2)),
        )
    silent = record.with_signals({"r": "1"}, r=np.zeros(800))
    with pytest.raises(ExcitationError, match="do not determine"):
        idn.fit(arx, silent, idn.methods.InstrumentalVariables("r"))
    with pytest.raises(InputError, match="window"):
        idn.structure.LaggedSignals(("r",), window=-1.0)
    with pytest.raises(InputError, match="expected names of signals of the record"):
        idn.methods.InstrumentalVariables(7.0)
    with pytest.raises(InputError, match="expected names of signals"):
        idn.methods.InstrumentalVariables(())


def test_what_instruments_leave_of_the_bias_is_foreseen_by_their_strength():
    """The louder the noise, the less of the output the excitation explains: F falls, and below 10
    the bias of least squares is back.
    """
    arx, true = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0)), np.array([-1.815, 0.826])
    left, F = [], []
    for noise in (0.5, 2.0, 5.0, 20.0):
        record = closed_loop(6000, noise=noise, seed=1)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            model = idn.fit(arx, record, idn.methods.InstrumentalVariables("r"))
        biased = idn.fit(arx, record).coefficients.at(6.5).A.ravel() - true
        left.append(
            float((model.coefficients.at(6.5).A.ravel() - true) @ biased / (biased @ biased))
        )
        F.append(model.details["first_stage_F"])
        weak = [str(w.message) for w in said if w.category is DataWarning]
        assert len(weak) == (F[-1] < 10)
        assert all(
            "the instruments are weak (first-stage F" in text and model.details["weakest"] in text
            for text in weak
        )
    assert F == sorted(F, reverse=True)
    assert F[0] > 100
    assert F[-1] < 2  # 1 is what chance explains
    assert left[0] < 0.02  # strong: measured 0.003 of the bias of least squares
    assert left[2] > 0.08  # weak: 0.13
    assert left[3] > 0.4  # hardly any: 0.5


def test_the_first_stage_is_the_f_statistic_of_one_regressor_and_of_the_worst_combination():
    rng = np.random.default_rng(3)
    Z, own = rng.standard_normal((300, 4)), np.ones((300, 1))
    x = np.column_stack(
        [Z @ rng.standard_normal(4), Z @ rng.standard_normal(4)]
    ) + rng.standard_normal((300, 2))
    Q = np.linalg.qr(np.hstack([Z, own]))[0]

    def F(column):
        """The textbook's: restricted against unrestricted sum of squares."""
        full, bare = (
            np.sum((column - A @ np.linalg.lstsq(A, column, rcond=None)[0]) ** 2)
            for A in (np.hstack([Z, own]), own)
        )
        return (bare - full) / 4 / (full / 295)

    one = first_stage(np.hstack([x[:, :1], own]), Q, ("x", "1"), np.array([False, True]))
    assert one.F == pytest.approx(F(x[:, 0]))
    both = first_stage(np.hstack([x, own]), Q, ("x", "z", "1"), np.array([False, False, True]))
    angles = np.linspace(0, np.pi, 2001)
    # the best of 2000 directions is within 1e-5 of the least
    assert both.F == pytest.approx(
        min(F(np.cos(a) * x[:, 0] + np.sin(a) * x[:, 1]) for a in angles), rel=1e-4
    )
    assert (
        first_stage(
            np.hstack([Z[:, :2], own]), Q, ("x", "z", "1"), np.array([False, False, True])
        ).F
        > 1e9
    )


class NoiseFreeFlight:
    """The same plan flown by a plant that is not quite the true one, and without noise."""

    def instrument_signals(self, record, names):
        twin = closed_loop(len(record), noise=0.0, seed=6, a=(1.7, 0.78))
        np.testing.assert_array_equal(twin["r"], record["r"])  # the excitation is the same
        return twin.columns(names)

    def instrument_lags(self, dt, first, memory):
        return tuple(range(first, memory + 1))


def test_a_simulated_flight_is_a_source_of_instruments():
    arx = structure(nb=1, basis=idn.Polynomial(1, 0.0, 13.0))
    record, nodes = closed_loop(6000, noise=0.5, seed=6), np.array([2.0, 6.5, 11.0])
    true = np.stack([-(1.75 + 0.01 * nodes), 0.80 + 0.004 * nodes], axis=1)
    off = {
        name: np.abs(idn.fit(arx, record, method).coefficients.at(nodes).A[:, :, 0, 0] - true).max()
        for name, method in (
            ("ls", "ls"),
            ("iv", idn.methods.InstrumentalVariables(NoiseFreeFlight())),
        )
    }
    assert off["ls"] > 0.2
    assert off["iv"] < 0.02


def test_a_source_of_instruments_with_another_number_of_samples_is_refused():
    class Short(NoiseFreeFlight):
        def instrument_signals(self, record, names):
            return super().instrument_signals(record, names)[1:]

        def __str__(self):
            return "of a short flight"

    with pytest.raises(InputError, match=r"of a short flight: expected shape \(800, any"):
        idn.fit(
            structure(nb=1),
            closed_loop(800, noise=0.1, seed=6),
            idn.methods.InstrumentalVariables(Short()),
        )
