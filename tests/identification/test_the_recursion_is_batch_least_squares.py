"""At every sample a recursion's coefficients are those of batch least squares on the same weighted
rows, whatever p has done so far.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_systems import Truth, structure
from problems_recursions_solve import EPS, Rows, problem

import identification as idn
from identification.design.determined import determined_columns, largest
from identification.recursive import kernel
from identification.recursive.kernel import configuration as at
from identification.structure.regressors import regression
from symheli import FlightRecord, lpv

WAYS = {
    "all": idn.forgetting.Constant(1.0),
    "constant": idn.forgetting.Constant(0.97),
    "no floor": idn.forgetting.Constant(0.95, floor=0.0),
    "variable": idn.forgetting.Variable(200, 20),
    "directional": idn.forgetting.Directional(0.9),
    "directional, loud or not": idn.forgetting.Directional(0.8, quiet=0.0),
}
LOW, HIGH = 0.0, 13.0


@st.composite
def scheduling(draw, samples):
    """p (samples,) in [0, 1]: creeping away from rest, stepping, resting, returning, jumping a
    little or far, or always moving.
    """
    k, kind = (
        np.arange(samples),
        draw(
            st.sampled_from(["creeping", "stepping", "resting", "returning", "jumping", "moving"])
        ),
    )
    start, step, at_sample = (
        draw(st.floats(0, 1)),
        10.0 ** draw(st.floats(-12, 0)),
        draw(st.integers(5, samples // 2)),
    )
    match kind:
        case "creeping":
            p = start + step * np.maximum(k - at_sample, 0)
        case "stepping":
            levels = draw(st.lists(st.floats(0, 1), min_size=2, max_size=6))
            p = np.array(levels)[np.minimum(k // 15, len(levels) - 1)]
        case "resting":
            p = np.full(samples, start)
        case "returning":
            p = start + np.where(k // 20 % 2 == 1, step * np.sin(0.2 * k), 0.0)
        case "jumping":
            p = start + step * (k >= at_sample)
        case _:
            p = 0.5 + 0.5 * np.sin(draw(st.floats(0.01, 0.5)) * k)
    return np.where(
        p < 1e-60, 0.0, np.clip(p, 0.0, 1.0)
    )  # regressors whose squares underflow are not there


@st.composite
def experiments(draw, small=False):
    """A structure and a record of it: degree or knots, orders, one output or two (with a regressor
    each or shared), gaps, noise.
    """
    two = draw(st.booleans()) and not small
    n = draw(st.integers(40, 60 if small else 120))
    knots = (LOW, LOW + 0.3 * (HIGH - LOW), HIGH)
    if small:
        basis = idn.Polynomial(draw(st.integers(0, 2)), LOW, HIGH)
    elif draw(st.booleans()):
        basis = idn.Polynomial(draw(st.integers(0, 6)), LOW, HIGH)
    elif draw(st.booleans()):
        basis = lpv.BSpline(draw(st.integers(1, 3)), knots)
    else:
        basis = lpv.Product(
            (idn.Polynomial(draw(st.integers(0, 2)), LOW, HIGH), idn.Polynomial(1, LOW, HIGH)), None
        )
    names = ("p",) if basis.dimension == 1 else ("p", "q")
    na = draw(st.integers(1, 2 if small else 4))
    arx = structure(
        outputs=("a", "b") if two else ("a",),
        scheduling=names if len(names) > 1 else "p",
        basis=basis,
        delay=draw(st.integers(0, 1)),
        na={"a": na, "b": 1} if two and draw(st.booleans()) else na,
        nb=draw(st.integers(1, 2)),
        offset=draw(st.booleans()),
        offset_rate=draw(st.booleans()),
        scheduling_at=draw(st.sampled_from(["lag", "now"])),
    )
    p = np.column_stack([LOW + (HIGH - LOW) * draw(scheduling(n)) for _ in names])
    noise = draw(st.sampled_from([0.0, 1e-6, 0.03, 0.3]))
    seed = draw(st.integers(0, 10**6))
    record = Truth(arx, seed=seed).record(p if len(names) > 1 else p[:, 0], noise=noise, seed=seed)
    if draw(st.booleans()):
        values = record.values.copy()
        values[draw(st.lists(st.integers(10, n - 1), max_size=3))] = np.nan
        record = type(record)(record.time, values, record.signals)
    return arx, regression(arx, record)


def compare(arx, data, forgetting, checks):
    """At `checks` instants, on the rows so far and on the next."""
    rls = idn.RecursiveLeastSquares(arx, forgetting)
    online, size = rls.online(), largest(arx.basis)
    groups = [(arx.regressors(g), list(g.outputs)) for g in arx.groups]
    problems = [
        problem(len(columns), len(outputs), forgetting, size) for columns, outputs in groups
    ]
    when = (
        set(np.linspace(2, len(data.phi) - 2, checks).astype(int)) if len(data.phi) > 4 else set()
    )
    for k, (phi, y) in enumerate(zip(data.phi, data.y, strict=True)):
        online.absorb(phi, y)
        state = online.state
        for g, ((columns, outputs), one) in enumerate(zip(groups, problems, strict=True)):
            one.absorb(phi[columns], y[outputs], state._header(at.FACTOR)[g])
            if k in when:
                at_one_instant(one, state, columns, outputs, data, k)
                if isinstance(one, Rows):
                    left = state.factors[g][len(columns) :, len(columns) :]
                    np.testing.assert_allclose(
                        left.T @ left, one.residual, rtol=1e-6, atol=1e-8 * np.sum(data.y**2)
                    )


def at_one_instant(one, state, columns, outputs, data, k):
    best, theta, solved = (
        one.theta,
        state.theta[np.ix_(columns, outputs)],
        state.solve(as_it_stands=True)[np.ix_(columns, outputs)],
    )
    assert np.isfinite(state.memory).all()
    spread = data.y[:, outputs].std(axis=0)
    rows, root = one.rows
    for found in (theta, solved):
        assert (root[:, None] * np.abs(rows @ (found - best)) <= 1e-8 * spread).all()
    # the next row, over all directions where all are called determined, else over those that stand
    # well out of what is pretended
    scale, values, V = one.spectrum
    known = np.ones(len(values), bool) if state.determined else values > 1e-5
    if known.any():
        error = V[known].T @ (V[known] @ (scale[:, None] * (theta - best)))
        condition = values.max() / values[known].min()
        y = data.y[: k + 1, outputs]
        residual = np.linalg.norm(root[-len(y) :, None] * (y - rows @ best), axis=0)
        coefficients = np.linalg.norm(scale[:, None] * best, axis=0)
        # perturbation of least squares (Higham, Accuracy and Stability, theorem 20.1): 100
        # roundings times the condition, and where the next row leaves the span of those seen, times
        # its square and the residual
        allowed = 1e-8 * spread + 100 * EPS * np.linalg.norm(data.phi[k + 1][columns] / scale) * (
            condition * coefficients + condition**2 * residual
        )
        assert (np.abs((data.phi[k + 1][columns] / scale) @ error) <= allowed).all()


@pytest.mark.slow
@settings(max_examples=60, deadline=None, derandomize=True)
@given(experiments(), st.sampled_from(["all", "constant", "no floor", "variable"]))
def test_coefficients_are_those_of_the_weighted_rows_with_what_keeps_them_awake(experiment, way):
    compare(*experiment, WAYS[way], checks=5)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(experiments(small=True), st.sampled_from(["directional", "directional, loud or not"]))
@pytest.mark.slow
def test_directional_forgetting_is_its_information_in_fifty_digits(experiment, way):
    compare(*experiment, WAYS[way], checks=3)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(experiments(), st.sampled_from(["all", "constant", "no floor", "variable"]))
def test_the_same_on_records_nobody_chose(experiment, way):
    compare(*experiment, WAYS[way], checks=8)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(experiments(small=True), st.sampled_from(["directional", "directional, loud or not"]))
def test_directional_forgetting_on_records_nobody_chose(experiment, way):
    compare(*experiment, WAYS[way], checks=4)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(experiments())
def test_batch_and_recursion_call_the_same_records_determined(experiment):
    """From both sides of the limit: steps of p of 1e-12 to 1 of its range."""
    arx, data = experiment
    online = idn.RecursiveLeastSquares(arx).online()
    for phi, y in zip(data.phi, data.y, strict=True):
        online.absorb(phi, y)
    batch = all(
        determined_columns(data.phi[:, arx.regressors(g)], arx.basis).all() for g in arx.groups
    )
    assert online.determined == batch


@pytest.mark.parametrize("outputs", [1, 5, 9])
def test_a_plant_at_rest_that_starts_to_move_leaves_nothing_that_is_no_number(outputs):
    """Once, rounding that was left of a sample explained whole taught further rows, each 1e-16 of
    the last, down to where 1/f overflows.
    """
    names, rng = tuple("abcdefghi"[:outputs]), np.random.default_rng(2)
    arx = structure(
        outputs=names, inputs=("u", "v"), na=1, nb=1, basis=idn.Polynomial(3, 0.0, 13.0)
    )
    A, B = (
        0.5 * np.eye(outputs) + 0.1 * rng.standard_normal((outputs, outputs)) / outputs,
        0.02 * rng.standard_normal((outputs, 2)),
    )
    y, online = np.zeros(outputs), idn.RecursiveLeastSquares(arx).online()
    for p in rng.uniform(0, 13, 200):
        u = rng.standard_normal(2)
        online.update(y, u, p)
        assert np.isfinite(online.state.memory).all()
        y = A @ y + B @ u * (1 + 0.05 * p)
    # outputs of 0.1: what is pretended of the coefficients, 32 eps samples, leaves less than this
    assert np.abs(online.state.residual_covariance).max() < 1e-16


def creeping(arx, samples=400, rate=1e-4, noise=0.0):
    """At rest for a quarter, then away at `rate` m/s a sample: columns become known one after
    another.
    """
    p = 3.0 + rate * np.maximum(np.arange(samples) - samples // 4, 0) ** 1.5
    return Truth(arx).record(np.minimum(p, 13.0), noise=noise)


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("degree", [2, 4])
def test_an_airspeed_that_creeps_away_from_rest_does_not_run_away(degree, noise):
    """Coefficients once moved along the gain from a point that did not solve the factor:
    predictions off by 1e24, called determined.
    """
    arx = structure(basis=idn.Polynomial(degree, 0.0, 13.0), na=3)
    record = creeping(arx, rate=3e-3, noise=noise)
    batch, recursive = (idn.fit(arx, record, method=method) for method in ("ls", "rls"))
    data = regression(arx, record)
    np.testing.assert_allclose(
        data.phi @ recursive.theta, data.phi @ batch.theta, rtol=0, atol=1e-8 * data.y.std()
    )
    history = idn.RecursiveLeastSquares(arx).run(record)
    assert history.state.determined
    np.testing.assert_allclose(
        data.phi @ history.state.theta, data.phi @ batch.theta, rtol=0, atol=1e-8 * data.y.std()
    )


@pytest.mark.slow
@pytest.mark.skipif(
    kernel.compiled_kernel("double") is None,
    reason="twenty thousand samples want the compiled kernel",
)
def test_rounding_along_the_gain_does_not_add_up():
    """p hardly moves for 20000 samples: 5e-9 of the output unless the coefficients are solved anew
    in time, 8e-11 as it is.
    """
    arx = structure(basis=idn.Polynomial(4, 0.0, 13.0), na=3)
    record = Truth(arx).record(3.0 + 1.3e-4 * np.sin(0.2 * np.arange(20000)), noise=0.3)
    state, data = idn.RecursiveLeastSquares(arx).run(record).state, regression(arx, record)
    apart = state.theta - state.solve(as_it_stands=True)
    assert np.abs(data.phi @ apart).max() < 1e-9 * data.y.std()


@pytest.mark.parametrize(("degree", "seconds"), [(3, 47.0), (4, 65.0)])
def test_where_data_hardly_tell_coefficients_apart_the_recursion_is_the_batch(degree, seconds):
    """Airspeed stands for 40 s and creeps at 0.05 m/s^2: scaled condition 3e6 to 5e6. What was
    pretended, "coefficient 0" with the weight of 32 eps samples, moved the coefficients by 2e-4 to
    1.5e-3 of a standard deviation; no digit was lost to rounding, about eps times the condition.
    """
    time = 0.02 * np.arange(int(seconds / 0.02))
    V, rng = 5 + 0.05 * np.maximum(time - 40.0, 0.0), np.random.default_rng(0)
    u, e, y = *rng.standard_normal((2, len(time))), np.zeros(len(time))
    for k, v in enumerate(V[1:] / 20.0, start=1):
        b = 1 - 0.3 * v + 0.2 * v**2
        y[k] = (0.6 + 0.2 * v - 0.1 * v**2) * y[k - 1] + b * u[k - 1] + 0.01 * e[k]
    record = FlightRecord.from_arrays(time, {"y": "1", "u": "1", "V": "m/s"}, y=y, u=u, V=V)
    arx = idn.LPVARX("y", "u", "V", na=1, nb=1, delay=1, basis=idn.Polynomial(degree, 0.0, 20.0))
    batch, history = idn.fit(arx, record).theta, idn.RecursiveLeastSquares(arx).run(record)
    state, n = history.state, arx.n_regressors
    assert state.determined
    R = state.factor[:n, :n]
    deviation = np.linalg.norm(np.linalg.inv(R), axis=1) * np.sqrt(state.residual_covariance[0, 0])
    condition = np.linalg.cond(R / np.linalg.norm(R, axis=0))
    assert 1e6 < condition < 1e7

    def apart(theta):
        return np.max(np.abs(np.asarray(theta) - batch)[:, 0] / deviation)

    # coefficients of some hundred standard deviations, each of two solutions right to eps times
    # condition
    rounding = 2 * np.finfo(float).eps * condition * np.max(np.abs(batch[:, 0]) / deviation)
    assert apart(state.solve()) < rounding
    assert apart(idn.fit(arx, record, method="rls").theta) < rounding
    # the coefficients on the way keep what is pretended, and say how much that is
    assert apart(state.theta) == pytest.approx(state.pretended, rel=1e-3)
    assert 1e-4 < state.pretended < 1e-2


def test_a_corrupted_estimate_is_not_returned(monkeypatch):
    from symheli.errors import AccuracyError

    arx = structure()
    record = creeping(arx, rate=3e-3, noise=0.03)
    from identification.estimators import least_squares

    exact = least_squares.least_squares_by_group
    monkeypatch.setattr(
        least_squares, "least_squares_by_group", lambda *args: exact(*args) * (1 + 1e-8)
    )
    with pytest.raises(AccuracyError, match=r"not orthogonal to .*not the least-squares ones"):
        idn.fit(arx, record)
