"""p(k) or p(k - lag): the wrong one leaves a residual, and the report says so."""

from dataclasses import replace

import numpy as np
import pytest
from known_systems import flown, structure

import identification as idn
from symheli.records import FlightRecord

A1, A2, B1 = (
    np.array([-0.9, 0.35, 0.15]),
    np.array([0.45, -0.2, 0.1]),
    np.array([0.8, -0.5, 0.3]),
)  # of 1, p, p^2 on [-1, 1]


def dynamic(n=900, noise=0.0):
    """y(k) + a1(p(k-1)) y(k-1) + a2(p(k-2)) y(k-2) = b1(p(k-1)) u(k-1): nine coefficients, p
    fast.
    """
    rng = np.random.default_rng(7)
    arx = structure(na=2, nb=1, basis=idn.Polynomial(2, -1.0, 1.0))
    p = 0.6 * np.sin(0.35 * np.pi * np.arange(n)) + 0.3 * rng.uniform(-1, 1, n)

    def of(c):
        return lambda q: np.array([[np.polynomial.polynomial.polyval(q, c)]])

    return arx, flown(arx, [of(A1), of(A2)], [of(B1)], p, rng.uniform(-1, 1, (n, 1)), noise=noise)


@pytest.mark.parametrize("method", ["ls", "rls"])
def test_the_nine_coefficients_of_a_system_with_dynamic_dependence_come_back(method):
    arx, record = dynamic()
    model = idn.fit(arx, record, method=method)
    found = model.coefficients.monomial()
    np.testing.assert_allclose(found.A[:, :, 0, 0], [A1, A2], atol=1e-9)
    np.testing.assert_allclose(found.B[0, :, 0, 0], B1, atol=1e-9)
    report = idn.judge.dependence_report(model, record)
    assert report.residual[0] < 1e-12
    assert report.dynamic == (False,)
    assert "nothing left to explain" in str(report)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_static_model_of_it_leaves_a_residual_and_the_report_says_why(noise):
    arx, record = dynamic(noise=noise)
    static = structure(na=2, nb=1, basis=arx.basis, scheduling_at="now")
    report = idn.judge.dependence_report(idn.fit(static, record), record)
    assert report.residual[0] > 0.05
    assert report.explained[0] > 0.5
    assert report.dynamic == (True,)
    assert 'do NOT depend on p as the structure says; try scheduling_at="lag"' in str(report)


def two_states(n=900, coupling=0.0):
    """x1+ = -a1(p) x1 + (1 + coupling p) x2 + b1(p) u, x2+ = -a2(p) x1, y = x1: every matrix at
    p(k), stepped as it stands.

    Without coupling, eliminating x2 gives the system of `dynamic`: y(k) depends on p(k-1) and
    p(k-2) though no matrix knows the past. Source of the remark: Toth, Abbas and Werner (2012), On
    the state-space realization of LPV input-output models, IEEE Trans. CST 20.
    """
    rng = np.random.default_rng(11)
    p, u = (
        0.6 * np.sin(0.35 * np.pi * np.arange(n)) + 0.3 * rng.uniform(-1, 1, n),
        rng.uniform(-1, 1, n),
    )
    a1, a2, b1 = (np.polynomial.polynomial.polyval(p, c) for c in (A1, A2, B1))
    x, y = np.zeros(2), np.zeros(n)
    for k in range(n):
        y[k] = x[0]
        x = (
            np.array([[-a1[k], 1.0 + coupling * p[k]], [-a2[k], 0.0]]) @ x
            + np.array([b1[k], 0.0]) * u[k]
        )
    return FlightRecord.from_arrays(0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p)


def test_a_static_state_space_model_has_dynamic_dependence_as_input_output_model():
    arx, record = structure(na=2, nb=1, basis=idn.Polynomial(2, -1.0, 1.0)), two_states()
    found = idn.fit(arx, record).coefficients.monomial()
    np.testing.assert_allclose(found.A[:, :, 0, 0], [A1, A2], atol=1e-9)
    np.testing.assert_allclose(found.B[0, :, 0, 0], B1, atol=1e-9)
    static = idn.judge.dependence_report(idn.fit(replace(arx, scheduling_at="now"), record), record)
    assert static.residual[0] > 0.05
    assert static.dynamic == (True,)
    assert "do NOT depend on p as the structure says" in str(static)


def test_where_the_state_is_hidden_behind_moving_coefficients_both_models_leave_a_residual():
    """With coupling a_2 depends on p(k-1) and p(k-2) together: no structure of one instant a
    coefficient is exact, and none pretends.
    """
    record = two_states(coupling=0.6)
    for at in ("lag", "now"):
        arx = structure(na=2, nb=1, basis=idn.Polynomial(2, -1.0, 1.0), scheduling_at=at)
        report = idn.judge.dependence_report(idn.fit(arx, record), record)
        assert report.residual[0] > 0.02
        assert report.dynamic == (True,)
        assert "dependence on several instants at once" in str(report)


def test_the_right_model_of_noisy_data_is_not_suspected():
    arx, record = dynamic(noise=0.1)
    report = idn.judge.dependence_report(idn.fit(arx, record), record)
    # 1 % of the rows are explained by 9 more regressors by chance; significant in one of a thousand
    # records
    assert report.dynamic == (False,)
    assert report.criteria[0].verdict == "fit"
    assert report.explained[0] < report.chance[0] < 0.1
    assert "do NOT depend" not in str(report)
    assert report.probability[0] > 1e-3
