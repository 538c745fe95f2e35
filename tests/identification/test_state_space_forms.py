"""The two exact realizations, with p moving."""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from symheli.errors import InputError
from symheli.lpv import CubicSpline, Polynomial, Product
from symheli.lpv.tools import simulate

TWO = dict(
    basis=Product((Polynomial(2, 0.0, 13.0), Polynomial(1, -2.0, 2.0)), total_degree=2),
    scheduling=("p", "q"),
)
CASES = {
    "shifted, three lags": (
        "shifted",
        dict(outputs=("a", "b"), inputs=("u", "v"), na=3, nb=1, delay=2),
    ),
    "shifted, order one": ("shifted", dict(outputs=("a", "b"), inputs=("u",), na=1, nb=1, delay=1)),
    "shifted, inputs reach further": ("shifted", dict(na=1, nb=3, delay=1)),
    "shifted, feedthrough": (
        "shifted",
        dict(outputs=("a", "b"), inputs=("u", "v"), na=2, nb=2, delay=0),
    ),
    "shifted, spline": ("shifted", dict(basis=CubicSpline((0.0, 3.0, 8.0, 13.0)))),
    "shifted, inputs only": ("shifted", dict(na=0, nb=2, delay=0)),
    "direct, three lags": (
        "direct",
        dict(outputs=("a", "b"), inputs=("u", "v"), na=3, nb=1, delay=2, scheduling_at="now"),
    ),
    "direct, feedthrough": ("direct", dict(na=2, nb=3, delay=0, scheduling_at="now")),
    "direct, static": ("direct", dict(na=0, nb=1, delay=0, scheduling_at="now")),
    "shifted, two parameters": ("shifted", dict(na=2, nb=2, delay=1, **TWO)),
    "shifted, two parameters, feedthrough": ("shifted", dict(na=2, nb=2, delay=0, **TWO)),
    "direct, two parameters": ("direct", dict(na=2, nb=2, scheduling_at="now", **TWO)),
    "direct, a spline and a polynomial": (
        "direct",
        dict(
            basis=Product((CubicSpline((0.0, 3.0, 8.0, 13.0)), Polynomial(1, -2.0, 2.0))),
            scheduling=("p", "q"),
            scheduling_at="now",
        ),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_realization_responds_as_the_difference_equation_however_p_moves(case):
    route, over = CASES[case]
    truth = Truth(structure(**over), size=0.8)
    two = truth.arx.basis.dimension == 2
    p = np.column_stack([moving(400), 2 * np.sin(0.7 * np.arange(400))]) if two else moving(200)
    record = truth.record(p, noise=0.1)
    model = idn.fit(truth.arx, record)
    free = model.simulate(record)
    lpv = model.to_state_space(route)
    p = record.columns(truth.arx.parameters) if two else record["p"]
    u, m = record.columns(truth.arx.inputs), truth.arx.memory
    x0 = _state_at(lpv, record, m, p, u) if lpv.states else np.zeros(0)
    _, y = simulate(lpv, p[m:], u[m:], x0)
    # 1e-10: rounding through a stable recursion of 200 steps and, with feedthrough, an exact
    # interpolation at 5 nodes
    np.testing.assert_allclose(y, free[m:], atol=1e-10)


def _state_at(lpv, record, m, p, u):
    """The state at sample m that explains the measured past: found by running the realization from
    an unknown state at 0.
    """
    measured = record.columns(lpv.outputs)
    if lpv.states[0].endswith("_lag1") or any("_lag" in s for s in lpv.states):
        return np.array(
            [record[s.rsplit("_lag", 1)[0]][m - int(s.rsplit("_lag", 1)[1])] for s in lpv.states]
        )
    # observer form x(k+1) = F x(k) + G u(k) + correction: with y measured, x_i(k+1) = x_{i+1}(k) -
    # A_i y + B_i u, all but x_1 shift out
    ny, order = len(lpv.outputs), len(lpv.states) // len(lpv.outputs)
    x = np.zeros(len(lpv.states))
    for k in range(m):
        A, B, C, D = lpv.matrices(p[k])
        x = A @ x + B @ u[k] + A[:, :ny] @ (measured[k] - C @ x - D @ u[k])
    assert order <= m
    return x


@pytest.mark.parametrize("at", ["lag", "now"])
@pytest.mark.parametrize("delay", [0, 1])
def test_the_frozen_model_has_the_frequency_response_of_the_frozen_coefficients(at, delay):
    truth = Truth(
        structure(outputs=("a", "b"), inputs=("u",), na=2, nb=2, delay=delay, scheduling_at=at)
    )
    model = idn.fit(truth.arx, truth.record(moving(200)))
    omega = np.array([0.3, 4.0, 20.0])
    z, values = np.exp(1j * omega * model.dt), truth.coefficients.at(4.0)
    for frozen_model in (model.at(4.0), model.to_state_space().at(4.0)):
        for k, response in enumerate(frozen_model.frequency_response(omega)):
            left = np.eye(2) + sum(values.A[i] * z[k] ** -(i + 1) for i in range(2))
            right = sum(values.B[j] * z[k] ** -float(j + delay) for j in range(2))
            np.testing.assert_allclose(response, np.linalg.solve(left, right), atol=1e-9)


def test_the_wrong_route_is_refused_never_returned():
    for at, wrong in (("lag", "direct"), ("now", "shifted")):
        truth = Truth(structure(scheduling_at=at))
        model = idn.fit(truth.arx, truth.record(moving(200)))
        with pytest.raises(InputError, match="wrong for coefficients"):
            model.to_state_space(wrong)
    with pytest.raises(InputError, match="route"):
        model.to_state_space("canonical")


def test_order_one_keeps_names_and_units_and_observer_form_is_minimal():
    truth = Truth(structure(outputs=("theta", "u"), inputs=("d_lon",), na=3, nb=1, delay=2))
    model = idn.fit(truth.arx, truth.record(moving(300)))
    lpv = model.to_state_space()
    assert len(lpv.states) == 3 * 2
    assert lpv.states[:2] == ("theta", "u")
    frozen = lpv.at(5.0)
    observability = np.vstack([frozen.C @ np.linalg.matrix_power(frozen.A, i) for i in range(6)])
    assert np.linalg.matrix_rank(observability) == 6
    assert lpv.dt == model.dt
