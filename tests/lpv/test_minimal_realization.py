"""States that count at no p are left out, and the response stays."""

import control
import numpy as np
import pytest
from families import random_lpv

from symheli import LFT, LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv import minimal_realization, parallel, series

OMEGA = np.array([0.05, 0.7, 9.0])


def padded(model, seed, unreached=2, unseen=1):
    """The same response with states that no input reaches, and others that no output shows, mixed
    by a constant change of coordinates.
    """
    rng = np.random.default_rng(seed)
    k, n, m = model.B.shape
    more = unreached + unseen
    A, B, C = np.zeros((k, n + more, n + more)), np.zeros((k, n + more, m)), []
    A[:, :n, :n], B[:, :n] = model.A, model.B
    A[:, :, n : n + unreached] = rng.normal(size=(k, n + more, unreached))
    A[:, n : n + unreached, :n] = A[:, n : n + unreached, n + unreached :] = 0
    A[:, n + unreached :] = rng.normal(size=(k, unseen, n + more))
    B[:, n + unreached :] = rng.normal(size=(k, unseen, m))
    A[:, :n, n + unreached :] = 0
    A[:, n : n + unreached, n + unreached :] = 0
    A[:, n : n + unreached, :n] = 0
    C = np.concatenate([model.C, rng.normal(size=(k, model.C.shape[1], unreached))], axis=2)
    C = np.concatenate([C, np.zeros((k, model.C.shape[1], unseen))], axis=2)
    T = np.linalg.qr(rng.normal(size=(n + more, n + more)))[0]
    names = tuple(f"x{i}" for i in range(n + more))
    return LPVStateSpace(
        model.basis,
        T @ A @ T.T,
        T @ B,
        C @ T.T,
        model.D,
        model.parameters,
        names,
        model.inputs,
        model.outputs,
        model.dt,
    )


@pytest.mark.parametrize("seed", range(3))
def test_what_was_added_is_left_out_and_the_response_stays(seed):
    model = random_lpv(2, nx=3, ny=2, seed=seed)[0]
    found = minimal_realization(padded(model, seed))
    assert len(found.states) == 3
    for p in np.linspace(model.scheduling.low, model.scheduling.high, 4):
        np.testing.assert_allclose(
            found.at(p).frequency_response(OMEGA),
            model.at(p).frequency_response(OMEGA),
            rtol=1e-8,
            atol=1e-10,
        )


def test_of_a_linear_model_as_many_states_remain_as_python_control_leaves():
    pytest.importorskip("slycot")  # an older python-control removes states by it alone
    lag = LinearModel.from_control(control.ss(control.tf([1], [1, 3, 2])))
    both = series(lag, LinearModel.from_control(control.ss(control.tf([1, 1], [1, 5]))))
    reference = control.minreal(both.to_control(), verbose=False)
    found = minimal_realization(both)
    assert len(found.states) == reference.nstates == 2
    np.testing.assert_allclose(
        found.frequency_response(OMEGA), both.frequency_response(OMEGA), rtol=1e-9
    )
    assert minimal_realization(lag) is lag
    assert len(minimal_realization(parallel(lag, lag)).states) == 2


def test_other_models_are_refused_with_what_to_do():
    lag = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
    with pytest.raises(InputError, match=r"LFT has \.reduce"):
        minimal_realization(LFT.constant(lag))
    with pytest.raises(InputError, match="tolerance"):
        minimal_realization(lag, tolerance=2.0)
