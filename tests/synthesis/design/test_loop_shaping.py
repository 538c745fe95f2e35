"""Loop shaping: the margin is what it says, and weights stand where they belong."""

import numpy as np
import pytest
from design_plants import named, random_plant

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv import stability_margin
from synthesis import hinf
from synthesis.design.plant.generalized import Generalized
from synthesis.designs import mixed_sensitivity, ncfsyn
from synthesis.numerics.linear.norm import norm


def plant(seed, dt=None):
    """Controls to measurements of a random plant."""
    model, u, y = random_plant(seed, dt)
    return model.select(inputs=u, outputs=y)


def lead(gain, dt=None):
    return LinearModel([[0.5 if dt else -1.0]], [[1.0]], [[gain]], [[2.0]], ["s"], ["i"], ["o"], dt)


@pytest.mark.parametrize("seed", range(10))
def test_gamma_is_the_inverse_of_the_margin_of_the_loop(seed):
    """Against `stability_margin`, which takes it from the model and the controller on a grid."""
    G = plant(seed, 0.1)
    design = ncfsyn(G)
    assert 1 / design.hinf_norm == pytest.approx(stability_margin(G, design.controller), rel=1e-6)
    assert design.optimum <= design.hinf_norm <= 1.01 * design.optimum * (1 + 1e-6)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(10))
def test_the_closed_form_is_the_optimum_of_the_four_block_problem(seed, dt):
    G = plant(seed, dt)
    nu, ny, nx = len(G.inputs), len(G.outputs), len(G.A)
    four = named(
        G.A,
        np.hstack([np.zeros((nx, ny)), G.B, G.B]),
        np.vstack([np.zeros((nu, nx)), G.C, G.C]),
        np.block(
            [
                [np.zeros((nu, ny + nu)), np.eye(nu)],
                [np.eye(ny), G.D, G.D],
                [np.eye(ny), G.D, G.D],
            ]
        ),
        nu,
        ny,
        dt,
    )
    assert hinf(*four).optimum == pytest.approx(ncfsyn(G).optimum, rel=1e-6)


def test_the_weights_are_in_the_controller():
    """W1 K W2 around the plant keeps W2 G W1 stable, with the gain of the shaped loop."""
    G = plant(3)
    whole = ncfsyn(G, lead(3.0), 0.2)
    K = whole.controller
    assert (K.inputs, K.outputs) == (G.outputs, G.inputs)
    bare = ncfsyn(G, W2=0.2)
    assert bare.optimum != pytest.approx(whole.optimum, rel=1e-3)
    closed = Generalized.of(
        LinearModel(
            G.A,
            np.hstack([G.B, G.B]),
            np.vstack([G.C, G.C]),
            np.block([[G.D, G.D], [G.D, G.D]]),
            G.states,
            (*(f"d_{u}" for u in G.inputs), *G.inputs),
            (*(f"z_{y}" for y in G.outputs), *G.outputs),
        ),
        G.inputs,
        G.outputs,
    ).closed(K.A, K.B, K.C, K.D)
    assert norm(*closed)[0] < np.inf


def test_mixed_sensitivity_is_the_gain_of_its_three_functions():
    """S, K S and T made of responses, frequency by frequency."""
    G = plant(6)
    design = mixed_sensitivity(G, lead(2.0), 0.3, [0.1] * len(G.outputs))
    omega = np.geomspace(1e-3, 1e3, 300)
    P, K, W = (m.frequency_response(omega) for m in (G, design.controller, lead(2.0)))
    S = np.linalg.inv(np.eye(len(G.outputs)) - P @ K)
    weighted = np.concatenate([W * S, 0.3 * K @ S, 0.1 * P @ K @ S], axis=1)
    np.testing.assert_allclose(
        weighted, design.loop.frequency_response(omega), atol=1e-7 * design.hinf_norm
    )
    assert np.linalg.norm(weighted, 2, axis=(1, 2)).max() <= design.hinf_norm * (1 + 1e-7)
    assert design.loop.outputs[0] == f"S_{G.outputs[0]}"


def test_weights_that_do_not_fit_are_refused():
    G = plant(3, 0.1)
    with pytest.raises(InputError, match=r"W1: its sample period is None s, the model's 0.1 s"):
        ncfsyn(G, lead(1.0))
    with pytest.raises(InputError, match=r"W2: expected a weight of"):
        mixed_sensitivity(G, 1.0, [1.0] * (len(G.inputs) + 1))
    with pytest.raises(InputError, match="expected a number or a system"):
        mixed_sensitivity(G, "high")
    with pytest.raises(InputError, match="expected a weight on the outputs or the controls"):
        mixed_sensitivity(G, None)
    with pytest.raises(InputError, match="back_off"):
        ncfsyn(G, back_off=0.9)
