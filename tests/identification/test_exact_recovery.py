"""Noise-free data give the coefficients back, whatever the number of inputs and outputs."""

import numpy as np
import pytest
from known_systems import Truth, flown, moving, moving_box, structure

import identification as idn
from symheli import lpv
from symheli.errors import ExcitationError, InputError

# 1e-9: the condition of these regressors stays below 1e4, and rounding enters at 1e-16 of signals
# of size 1-10
EXACT = dict(rtol=0, atol=1e-9)

SHAPES = {
    "siso": dict(outputs=("y",), inputs=("u",)),
    "simo": dict(outputs=("theta", "w", "u"), inputs=("d_lon",)),
    "timo": dict(outputs=("theta", "w", "u"), inputs=("d_lon", "d_col")),
    "mimo": dict(outputs=("v", "r"), inputs=("d_lat", "d_ped"), na=2, nb=2, delay=0),
    "offsets": dict(outputs=("theta", "u"), inputs=("d_lon",), offset=True, offset_rate=True),
    "one output of the past only": dict(inputs=(), nb=0, offset=True, na=1),
    "miso": dict(outputs=("theta",), inputs=("d_lon", "d_col"), delay=0),
    "orders by equation": dict(
        outputs=("theta", "u"),
        inputs=("d_lon",),
        na={"theta": 3, "u": 1},
        nb={"theta": 1, "u": 2},
        offset=True,
    ),
    "orders by input": dict(
        outputs=("v", "r"),
        inputs=("d_lat", "d_ped"),
        na=1,
        nb={"d_lat": 1, "d_ped": 2},
        delay={"d_lat": 0, "d_ped": 2},
    ),
    "orders by signal": dict(
        outputs=("v", "r"),
        inputs=("d_lat", "d_ped"),
        na={"v": {"v": 2, "r": 0}, "r": {"v": 1, "r": 3}},
        nb=[[1, 2], [0, 1]],
        delay=[[0, 1], [1, 3]],
        offset=True,
        offset_rate=True,
    ),
}

ONE, SEVERAL = moving(400), moving_box(600)
BASES = {
    "legendre 3": (idn.Polynomial(3, 0.0, 13.0), ONE),
    "cubic b-spline": (lpv.BSpline(3, (0.0, 4.0, 9.0, 13.0)), ONE),
    "hats": (lpv.PiecewiseLinear((0.0, 5.0, 13.0)), ONE),
    "spline": (lpv.CubicSpline((0.0, 4.0, 9.0, 13.0)), ONE),
    "brought along": (
        lpv.UserFunctions((np.ones_like, np.cos, lambda p: 1 / (1 + p)), 0.0, 13.0),
        ONE,
    ),
    "tensor product": (
        lpv.Product((idn.Polynomial(1, 0.0, 13.0), idn.Polynomial(2, 0.9, 1.3))),
        SEVERAL,
    ),
    "total degree": (
        lpv.Product((idn.Polynomial(2, 0.0, 13.0), idn.Polynomial(2, 0.9, 1.3)), total_degree=2),
        SEVERAL,
    ),
    "mixed product": (
        lpv.Product((lpv.BSpline(2, (0.0, 6.0, 13.0)), idn.Polynomial(1, 0.9, 1.3))),
        SEVERAL,
    ),
}


@pytest.mark.parametrize("method", ["ls", "rls"])
@pytest.mark.parametrize("at", ["lag", "now"])
@pytest.mark.parametrize("shape", SHAPES)
def test_noise_free_record_gives_the_coefficients_back(shape, at, method):
    truth = Truth(structure(**SHAPES[shape], scheduling_at=at))
    model = idn.fit(truth.arx, truth.record(moving(400)), method=method)
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


@pytest.mark.parametrize(("at", "method"), [("lag", "rls"), ("now", "ls")])
@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("shape", ["offsets", "orders by signal"])
def test_whatever_the_basis_the_coefficients_the_predictions_and_the_free_run_come_back(
    shape, basis, at, method
):
    functions, p = BASES[basis]
    truth = Truth(
        structure(
            **SHAPES[shape],
            basis=functions,
            scheduling=("p", "q")[: functions.dimension],
            scheduling_at=at,
        )
    )
    record = truth.record(p)
    model = idn.fit(truth.arx, record, method=method)
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)
    # 1e-8: a free run gathers errors of the coefficients of 1e-9 over a few time constants
    measured, m = record.columns(truth.arx.outputs), truth.arx.memory
    np.testing.assert_allclose(model.simulate(record)[m:], measured[m:], atol=1e-8)
    np.testing.assert_allclose(
        model.predict(record, horizon=7)[m + 6 :], measured[m + 6 :], atol=1e-8
    )


def test_a_model_of_several_parameters_freezes():
    functions, p = BASES["total degree"]
    truth = Truth(structure(outputs=("a", "b"), basis=functions, scheduling=("p", "q"), delay=0))
    model = idn.fit(truth.arx, truth.record(p))
    values, z, omega = truth.coefficients.at([4.0, 1.2]), np.exp(0.1j * 3.0), np.array([3.0])
    left = np.eye(2) + sum(values.A[i] * z ** -(i + 1.0) for i in range(2))
    right = sum(values.B[j] * z ** -float(j) for j in range(2))
    np.testing.assert_allclose(
        model.at(4.0, 1.2).frequency_response(omega)[0], np.linalg.solve(left, right), **EXACT
    )
    with pytest.raises(InputError, match="expected 2 along the last axis"):
        model.at(4.0)
    with pytest.raises(InputError, match="expected one value of p"):
        model.at([4.0, 5.0], [1.2, 1.2])


def test_several_parameters_that_move_together_are_refused():
    functions, p = BASES["total degree"]
    arx = structure(basis=functions, scheduling=("p", "q"))
    tied = np.column_stack([p[:, 0], 0.9 + 0.03 * p[:, 0]])
    with pytest.raises(ExcitationError, match=r"rank \d+ of 24.*while p, q moves"):
        idn.fit(arx, Truth(arx).record(tied))


@pytest.mark.parametrize("method", ["ls", "rls"])
def test_the_papers_structure_is_recovered_from_the_papers_parameter_trajectory(method):
    """na=3, one input coefficient at lag 2, quadratic in p, p from sin(pi k/3): Budiyono and
    Sutarto, eqs 13-15.
    """
    arx = structure(
        outputs=("theta", "w", "u"), inputs=("d_lon",), na=3, nb=1, delay=2, scheduling_at="now"
    )
    truth = Truth(arx)
    p = 6.5 * (1 + np.sin(np.pi * np.arange(500) / 3))
    model = idn.fit(arx, truth.record(p), method=method)
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)
    assert model.excitation.distinct == 3


def test_a_discrete_polynomial_system_with_its_state_as_output_comes_back_exactly():
    """x(k+1) = A(p(k)) x(k) + B(p(k)) u(k) is the order-1 structure with coefficients at the
    lag.
    """
    rng = np.random.default_rng(3)
    A0, A1, A2 = 0.4 * rng.uniform(-1, 1, (3, 4, 4)) / [[[1.0]], [[13.0]], [[169.0]]]
    B0, B1 = rng.uniform(-1, 1, (2, 4, 2)) / [[[1.0]], [[13.0]]]

    def A(p):
        return A0 + p * A1 + p**2 * A2

    def B(p):
        return B0 + p * B1

    arx = structure(
        outputs=("u", "w", "q", "theta"), inputs=("d_lon", "d_col"), na=1, nb=1, delay=1
    )
    p = moving(600)
    record = flown(arx, [lambda q: -A(q)], [B], p, rng.normal(size=(600, 2)))
    lpv = idn.fit(arx, record).to_state_space()
    assert lpv.states == arx.outputs
    for q in (0.0, 4.2, 13.0):
        np.testing.assert_allclose(lpv.at(q).A, A(q), **EXACT)
        np.testing.assert_allclose(lpv.at(q).B, B(q), **EXACT)


def test_coefficients_read_as_monomials_in_physical_units():
    arx = structure(na=1, nb=1)
    record = flown(
        arx,
        [lambda p: np.array([[-0.5 - 0.03 * p + 0.002 * p**2]])],
        [lambda p: np.array([[1 - 0.05 * p]])],
        moving(),
        _noise(700),
    )
    found = idn.fit(arx, record).coefficients.monomial()
    np.testing.assert_allclose(found.A[0, :, 0, 0], [-0.5, -0.03, 0.002], **EXACT)
    np.testing.assert_allclose(found.B[0, :, 0, 0], [1, -0.05, 0], **EXACT)


def test_two_records_are_fitted_together_without_reaching_from_one_to_the_other():
    truth = Truth(structure())
    model = idn.fit(
        truth.arx, [truth.record(moving(80), seed=1), truth.record(moving(90)[::-1].copy(), seed=2)]
    )
    assert model.rows_used == 80 + 90 - 2 * truth.arx.memory
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


def test_missing_samples_and_gaps_cost_rows_but_not_exactness():
    truth = Truth(structure())
    record = truth.record(moving(300))
    values = record.values.copy()
    values[50, 0] = values[120, 1] = values[200, 2] = np.nan
    time = record.time.copy()
    time[150:] += 5.0
    holed = type(record)(time, values, record.signals)
    for method in ("ls", "rls"):
        model = idn.fit(truth.arx, holed, method=method)
        # y missing: itself and two lags; u: two lags (delay 1); p: all terms at lags 1, 2; two
        # starts of two samples
        assert model.rows_dropped == 3 + 2 + 2 + 4
        np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


def _noise(n):
    return np.random.default_rng(9).normal(size=(n, 1))
