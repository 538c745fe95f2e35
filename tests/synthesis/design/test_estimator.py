"""Estimators as state feedback of the transposed plant, of unstable plants, and proven."""

import numpy as np
import pytest
from scheduled_plants import spring

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import Plant, estimator, state_feedback

BACK_OFF = 1.02


def heave(pole=0.5, rate=0.5, noise=0.1):
    """w' = (pole + .3p) w + gust + 2 d_col, estimated from a noisy reading of it and of a lag."""
    model = LPVStateSpace.polynomial(
        [[[pole, 0], [1.0, -1]], [[0.3, 0], [0, 0]]],
        [[[1, 0, 2], [0, 0, 0]]],
        [[[1, 0], [0.5, 1]]],
        [[[0, 0, 0], [0, noise, 0.5]]],
        Scheduling("p", "1", 0.0, 1.0, rate=rate),
        states=["w", "lag"],
        inputs=["gust", "noise", "d_col"],
        outputs=["z", "y"],
    )
    return Plant(
        model,
        disturbances=["gust", "noise"],
        performance=["z"],
        controls=["d_col"],
        measurements=["y"],
    )


def transposed(plant):
    """Disturbances become performance, measurements controls; all states are measured."""
    model = plant.model
    nw, nz, n = len(plant.disturbances), len(plant.performance), len(model.states)
    A, C1, C2 = (np.swapaxes(M, 1, 2) for M in (model.A, model.C[:, :nz], model.C[:, nz:]))
    B1 = np.swapaxes(model.B[:, :, :nw], 1, 2)
    D11, D21 = (np.swapaxes(M, 1, 2) for M in (model.D[:, :nz, :nw], model.D[:, nz:, :nw]))
    K = len(A)
    show = np.zeros((K, n, n))
    show[0] = np.eye(n)
    D = np.concatenate(
        [np.concatenate([D11, D21], axis=2), np.zeros((K, n, nz + len(plant.measurements)))], axis=1
    )
    states = [f"x{i}" for i in range(n)]
    dual = LPVStateSpace(
        model.basis,
        A,
        np.concatenate([C1, C2], axis=2),
        np.concatenate([B1, show], axis=1),
        D,
        model.parameters,
        states,
        [*plant.performance, *plant.measurements],
        [*plant.disturbances, *(f"{x}_shown" for x in states)],
        model.dt,
    )
    return Plant(
        dual,
        disturbances=list(plant.performance),
        performance=list(plant.disturbances),
        controls=list(plant.measurements),
        measurements=[f"{x}_shown" for x in states],
    )


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 0.5])
@pytest.mark.parametrize("plant", [spring, heave])
def test_it_is_state_feedback_of_the_transposed_plant(plant, rate):
    """-dY/dt and dX/dt differ in sign, and rates are limited both ways: the same least gain."""
    made = estimator(plant(), rate, back_off=BACK_OFF)
    dual = state_feedback(transposed(plant()), rate, back_off=BACK_OFF)
    assert made.promised == pytest.approx(dual.promised, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("pole", [-1.0, 0.5])
def test_the_error_is_proven_whether_the_plant_is_stable_or_not(pole):
    made = estimator(heave(pole), back_off=BACK_OFF)
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * (1 + 1e-4)  # of functions fitted to the gains
    for p in (0.0, 0.4, 1.0):
        assert made.error.at(p).is_stable()


@pytest.mark.slow
def test_the_error_does_not_depend_on_the_control():
    """Plant and estimator side by side, at one p: from d_col to z minus its estimate is nothing."""
    plant, p, omega = heave(), 0.4, np.array([0.3, 2.0])
    made = estimator(plant)
    G = plant.model.at(p).frequency_response(omega)
    F = made.model.at(p).frequency_response(omega)
    z = [str(s) for s in plant.model.inputs].index("d_col")
    estimate = F[:, :, :1] @ G[:, 1:, [z]] + F[:, :, 1:]
    np.testing.assert_allclose(G[:, :1, [z]], estimate, atol=1e-10)
    # and from gust and noise it is what the model of the error says
    E = made.error.at(p).frequency_response(omega)
    np.testing.assert_allclose(G[:, :1, :2] - F[:, :, :1] @ G[:, 1:, :2], E, atol=1e-10)


def test_of_a_constant_plant_the_gain_is_known():
    """x' = -x + w1, y = x + w2, z = x: the Riccati equation of the least gain g has a solution as
    long as a^2 + c^2 >= 1/g^2 with a = -1, c = 1.
    """
    model = LinearModel(
        [[-1.0]], [[1, 0]], [[1], [1]], [[0, 0], [0, 1]], ["x"], ["w1", "w2"], ["z", "y"]
    )
    plant = Plant(model, disturbances=["w1", "w2"], performance=["z"], measurements=["y"])
    assert estimator(plant, back_off=BACK_OFF).promised / BACK_OFF == pytest.approx(
        1 / np.sqrt(2), rel=1e-5
    )


@pytest.mark.slow
def test_a_sampled_estimator_is_proven():
    made = estimator(heave(-1.0).sampled(0.1))
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma <= made.promised * (1 + 1e-4)


def test_in_discrete_time_x_stands_still():
    with pytest.raises(InputError, match="in discrete time X cannot depend on p"):
        estimator(heave().sampled(0.1), X=1)
