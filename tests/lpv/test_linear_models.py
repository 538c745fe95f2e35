"""Linear models and families: reduction, sampling and interpolation against independent routes."""

import numpy as np
import pytest
from scipy.linalg import expm

import symheli
from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.values import Signal, signals


def random_model(nx=4, nu=2, ny=2, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((nx, nx)) - 3 * np.eye(nx)
    names = [signals(f"{c}{i}" for i in range(n)) for c, n in (("x", nx), ("u", nu), ("y", ny))]
    return LinearModel(
        A,
        rng.standard_normal((nx, nu)),
        rng.standard_normal((ny, nx)),
        rng.standard_normal((ny, nu)),
        *names,
    )


@pytest.fixture(scope="module")
def family(request):
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    return symheli.sweep(heli, [2.0, 4.0, 6.0, 8.0, 10.0])


def test_zero_order_hold_is_the_matrix_exponential():
    model, dt = random_model(), 0.07
    discrete = model.discretize(dt)
    block = expm(np.block([[model.A, model.B], [np.zeros((2, 6))]]) * dt)
    np.testing.assert_allclose(discrete.A, block[:4, :4], atol=1e-14)
    np.testing.assert_allclose(discrete.B, block[:4, 4:], atol=1e-14)
    assert discrete.dt == dt
    with pytest.raises(InputError, match="already discrete"):
        discrete.discretize(dt)


def test_python_control_keeps_names_and_answers_the_same():
    model, omega = random_model(), np.array([0.3, 2.0, 9.0])
    system = model.to_control()
    assert system.state_labels == ["x0", "x1", "x2", "x3"]
    response = np.moveaxis(np.asarray(system(1j * omega)), -1, 0)
    np.testing.assert_allclose(model.frequency_response(omega), response, rtol=1e-10)
    back = LinearModel.from_control(system)
    np.testing.assert_array_equal(back.A, model.A)
    assert back.inputs == model.inputs


def test_select_orders_rows_and_columns_by_name(family):
    model = family[1]
    part = model.select(states=["theta", "q"], inputs=["d_col"])
    i, j = model.states.index("theta"), model.states.index("q")
    np.testing.assert_array_equal(part.A, model.A[np.ix_([i, j], [i, j])])
    assert part.states == ("theta", "q")
    assert part.outputs == ("q", "theta")  # those that are left, in the order they had
    assert part.states[1].unit == "rad/s"
    with pytest.raises(UnknownNameError, match="did you mean 'theta'"):
        model.select(states=["tetha"])


def test_residualized_states_settle_at_once_the_slow_response_is_kept(family):
    slow = family.residualize(["a1", "b1"])
    for k in range(len(family)):
        model, i = family[k], [family.states.index(s) for s in ("a1", "b1")]
        kept = [s for s in range(10) if s not in i]
        schur = (
            model.A[np.ix_(kept, kept)]
            - model.A[np.ix_(kept, i)]
            @ np.linalg.inv(model.A[np.ix_(i, i)])
            @ model.A[np.ix_(i, kept)]
        )
        np.testing.assert_allclose(slow.A[k], schur, atol=1e-10)
        # equal steady gain: the transfer function at s = 0 does not know which derivatives were set
        # to zero
        full, reduced = model.frequency_response([0.0]), slow[k].frequency_response([0.0])
        keep = [model.outputs.index(y) for y in slow.outputs]
        np.testing.assert_allclose(
            reduced[0], full[0][keep], rtol=1e-8, atol=1e-8 * np.abs(full).max()
        )


def test_residualizing_states_that_do_not_settle_is_refused(family):
    with pytest.raises(InputError, match="do not settle"):
        family.select(states=["u", "w", "q", "theta"]).residualize(["theta"])
    with pytest.raises(InputError, match="continuous"):
        family.discretize(0.02).residualize(["a1"])


@pytest.mark.parametrize(("kind", "degree"), [("spline", 3), ("linear", 1), ("polynomial", 4)])
def test_interpolation_reproduces_the_nodes(family, kind, degree):
    lpv = family.interpolate(kind, degree)
    for k, speed in enumerate(family.airspeeds):
        np.testing.assert_allclose(lpv.at(speed).A, family.A[k], atol=1e-9)
    assert np.abs(lpv.residuals.A).max() < 1e-9
    x0 = np.array([[t.x[s] for s in family.states] for t in family.trims])
    np.testing.assert_allclose(lpv.trim.state(family.airspeeds), x0, atol=1e-12)


def test_residuals_of_a_coarse_fit_are_fit_minus_family(family):
    lpv = family.interpolate("polynomial", 1)
    for k, speed in enumerate(family.airspeeds):
        np.testing.assert_allclose(lpv.residuals.A[k], lpv.at(speed).A - family.A[k], atol=1e-12)


def test_interpolation_names_what_it_cannot_do(family):
    with pytest.raises(UnknownNameError, match="interpolation kind"):
        family.interpolate("cubic")
    with pytest.raises(InputError, match="needs 6 values of each parameter, got 5"):
        family.interpolate("polynomial", 5)


def test_models_and_families_cannot_be_changed_and_check_their_shapes(family):
    for array in (
        family.A,
        family[0].B,
        family.airspeeds,
        family.interpolate().A,
        family.trims[0].x.array,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    mine = np.eye(2)
    model = LinearModel(
        mine, np.ones((2, 1)), mine, np.zeros((2, 1)), signals("ab"), signals("u"), signals("ab")
    )
    mine[:] = 7
    np.testing.assert_array_equal(model.A, np.eye(2))
    with pytest.raises(InputError, match=r"B: expected shape \(2, 1\), got \(1, 2\)"):
        LinearModel(
            np.eye(2),
            np.ones((1, 2)),
            np.eye(2),
            np.zeros((2, 1)),
            signals("ab"),
            signals("u"),
            signals("ab"),
        )
    with pytest.raises(InputError, match=r"entry \(0, 0\) is nan"):
        LinearModel(
            np.full((1, 1), np.nan), [[1]], [[1]], [[0]], signals("a"), signals("u"), signals("y")
        )


def test_a_signal_is_its_name_and_knows_its_unit():
    import pickle

    q = Signal("q")
    assert (q, q.unit) == ("q", "rad/s")
    assert Signal("q", "deg/s").unit == "deg/s"
    assert pickle.loads(pickle.dumps(Signal("q", "deg/s"))).unit == "deg/s"
    assert Signal("unknown").unit == "1"
    with pytest.raises(InputError, match="repeated: a"):
        signals(["a", "b", "a"])


def test_a_family_may_be_over_any_parameter(tmp_path):
    """Two parameters, silently, where a loop was closed with a plant over "v"."""
    models = [random_model(seed=s) for s in range(4)]
    speed = Signal("v", "km/h")
    family = symheli.LinearFamily.from_models([8.0, 9.0, 10.0, 12.0], models, parameter=speed)
    for one in (family, family.select(inputs=["u0"]), family.discretize(0.1)):
        (parameter,) = one.interpolate(degree=2).parameters
        assert (parameter.name, parameter.unit) == ("v", "km/h")
    again = symheli.LinearFamily.load(family.save(tmp_path / "family.json"))
    assert (again.parameter, again.parameter.unit) == ("v", "km/h")
    np.testing.assert_array_equal(again.A, family.A)
    swept = symheli.LinearFamily.from_models([1.0, 2.0, 3.0, 4.0], models)
    assert swept.interpolate(degree=2).parameters[0].name == "airspeed"
