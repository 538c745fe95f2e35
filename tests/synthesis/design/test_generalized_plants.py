"""The algebra of generalized plants, one model or many."""

import control
import numpy as np
import pytest
from design_plants import random_plant

from symheli.errors import InputError, UnknownNameError
from synthesis.design.plant.generalized import Channels, Generalized


def controller(rng, nu, ny, order=2):
    return (
        rng.standard_normal((order, order)),
        rng.standard_normal((order, ny)),
        rng.standard_normal((nu, order)),
        0.3 * rng.standard_normal((nu, ny)),
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_loop_is_the_linear_fractional_transformation(seed):
    model, u, y = random_plant(seed)
    P, K = Generalized.of(model, u, y), controller(np.random.default_rng(seed), len(u), len(y))
    A, B, C, D = P.closed(*K)
    theirs = control.ss(*P.joined).lft(control.ss(*K))
    s = 0.3 + 0.7j
    ours = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    np.testing.assert_allclose(ours, np.atleast_2d(theirs(s)), rtol=1e-9)


def test_a_family_is_closed_model_by_model():
    model, u, y = random_plant(1)
    P = Generalized.of(model, u, y)
    rng = np.random.default_rng(0)
    family = P._replace(A=P.A + 0.1 * rng.standard_normal((4, *P.A.shape)))
    K = [controller(rng, len(u), len(y)) for _ in range(4)]
    stacked = family.closed(*(np.stack(parts) for parts in zip(*K, strict=True)))
    for k in range(4):
        one = P._replace(A=family.A[k]).closed(*K[k])
        for M, N in zip(stacked, one, strict=True):
            np.testing.assert_allclose(M[k] if M.ndim == 3 else M, N, atol=1e-12)


def test_the_dual_of_the_dual_and_of_a_loop():
    """Transposing plant and controller transposes the loop."""
    model, u, y = random_plant(2)
    P, K = Generalized.of(model, u, y), controller(np.random.default_rng(2), len(u), len(y))
    for M, N in zip(P.dual.dual, P, strict=True):
        np.testing.assert_array_equal(M, N)
    A, B, C, D = P.closed(*K)
    At, Bt, Ct, Dt = P.dual.closed(K[0].T, K[2].T, K[1].T, K[3].T)
    for M, N in ((A.T, At), (C.T, Bt), (B.T, Ct), (D.T, Dt)):
        np.testing.assert_allclose(M, N, atol=1e-12)


def test_splitting_what_was_joined():
    P = Generalized.of(*random_plant(3))
    again = Generalized.split(*P.joined, P.B2.shape[1], len(P.C2))
    for M, N in zip(again, P, strict=True):
        np.testing.assert_array_equal(M, N)


def test_channels_are_the_rest_unless_named():
    model, u, y = random_plant(4)
    names = Channels.of(model, u, y)
    assert names.disturbances == tuple(s for s in model.inputs if s not in u)
    assert names.performance == tuple(s for s in model.outputs if s not in y)
    few = Channels.of(model, u, y, performance=[*y, "z1"])
    assert few.performance == (*y, "z1")
    assert Generalized.between(model, few).C1.shape[0] == len(y) + 1


def test_names_and_loops_that_cannot_be_are_refused():
    model, u, y = random_plant(5)
    with pytest.raises(UnknownNameError, match="unknown input 'd_lonn'"):
        Channels.of(model, ["d_lonn"], y)
    with pytest.raises(UnknownNameError, match="unknown output"):
        Channels.of(model, u, ["theta"])
    with pytest.raises(InputError, match="disturbances: none is left"):
        Channels.of(model, model.inputs, y)
    with pytest.raises(InputError, match="both a control and a disturbance"):
        Channels.of(model, u, y, disturbances=["w1", u[0]])
    P = Generalized.of(model, u, y)
    one = P._replace(D22=np.ones(P.D22.shape))
    A, B, C, D = controller(np.random.default_rng(0), len(u), len(y))
    D = np.zeros(D.shape)
    D[0, 0] = 1.0
    with pytest.raises(InputError, match="not well posed"):
        one.closed(A, B, C, D)
