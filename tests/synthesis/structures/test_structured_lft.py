"""Structured designs of LFT plants: closed forms, refusals, and a published robust design."""

import numpy as np
import published_h3 as h3
import pytest

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import Polynomial, connect
from synthesis import Plant, hinf, output_feedback, structured
from synthesis.structures import TunableController, design

P = Scheduling("p", "1", 1.0, 3.0)


def rational():
    """x' = -x/p + w + u, z = (x, u), y = x, p in [1, 3]."""
    model = LFT.from_expressions(
        [[-1 / P.symbol]],
        [[1, 1]],
        [[1], [0], [1]],
        [[0, 0], [0, 1], [0, 0]],
        [P],
        inputs=["w", "u"],
        outputs=["x", "cost", "y"],
    )
    return Plant(model, ["w"], ["x", "cost"], ["u"], ["y"])


@pytest.fixture(scope="module")
def made():
    return structured(rational(), TunableController.pid(rational()), starts=1)


def test_the_gain_is_the_best_for_the_worst_parameter(made):
    """u = k x: the gain sqrt(1 + k^2)/(1/p - k) is largest for p = 3 and least there for k = -3:
    sqrt(10)/(10/3).
    """
    assert made.gains["u_y_P"][0] == pytest.approx(-3.0, rel=1e-3)
    assert made.promised == pytest.approx(3 / np.sqrt(10), rel=1e-6)
    assert "over p constant" in str(made)


def test_the_loop_is_an_lft_and_its_gain_is_proven_where_p_jumps(made):
    loop = made.closed()
    assert isinstance(loop, LFT)
    k = made.gains["u_y_P"][0]
    one = loop.at(2.0)
    assert one.A.item() == pytest.approx(-0.5 + k)
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma == pytest.approx(made.promised, rel=1e-3)
    with pytest.raises(InputError, match="worst_case_gain"):
        made.certify(0.0)


def test_other_designs_of_such_a_plant_are_refused_in_words():
    for other in (output_feedback, hinf):
        with pytest.raises(InputError, match="structured"):
            other(rational())
    with pytest.raises(InputError, match="connect"):
        rational().weighted({"x": 2.0})
    with pytest.raises(InputError, match="connect"):
        Plant(rational().model, ["w"], ["x", "u"], ["u"], ["y"])
    with pytest.raises(InputError, match="basis"):
        structured(rational(), TunableController.pid(rational(), basis=Polynomial(1, 1.0, 3.0)))


def test_a_range_may_be_narrowed():
    narrow = rational().with_scheduling(Scheduling("p", "1", 1.0, 2.0))
    assert narrow.box == ((1.0, 2.0),)


def test_a_controller_of_free_order_takes_every_controller():
    plant = rational()
    free = TunableController.of_order(plant, 2)
    rng = np.random.default_rng(0)
    gains = dict(zip((g.name for g in free.gains), rng.standard_normal(9), strict=True))
    K = free.controller(gains, [P]).at(2.0)
    np.testing.assert_allclose(K.A[0], [gains["A_1_1"], gains["A_1_2"]], rtol=1e-14)
    np.testing.assert_allclose(K.B.ravel(), [gains["B_1_y"], gains["B_2_y"]], rtol=1e-14)
    np.testing.assert_allclose(K.C[0], [gains["C_u_1"], gains["C_u_2"]], rtol=1e-14)
    assert K.D.item() == pytest.approx(gains["D_u_y"], rel=1e-14)
    with pytest.raises(InputError, match="order"):
        TunableController.of_order(plant, -1)


def test_a_feedthrough_that_moves_is_refused_before_the_search(monkeypatch):
    def searched(*_):
        raise AssertionError("the search began")

    monkeypatch.setattr(design._StructureSearch, "run", searched)
    model = LPVStateSpace.polynomial(
        [[[-1.0]]],
        [[[1.0, 1.0]]],
        [[[1.0], [0.0], [1.0]]],
        [[[0, 0], [0, 1], [0, 0]], [[0, 0], [0, 0], [0, 1]]],
        P,
        inputs=["w", "u"],
        outputs=["x", "cost", "y"],
    )
    plant = Plant(model, ["w"], ["x", "cost"], ["u"], ["y"])
    with pytest.raises(InputError, match="feedthrough"):
        structured(plant, TunableController.pid(plant))


@pytest.mark.slow
def test_two_states_undercut_a_published_robust_design():
    """Schwenkel et al.: 37.46863. Here 36.95, of two states, by three starts."""
    from synthesis.robust import worst_case_gain

    plant = Plant(h3.plant(), ["w1", "w2"], ["z1", "z2"], ["u1", "u2"], ["y"])
    made = structured(plant, TunableController.of_order(plant, 2), starts=3)
    assert made.promised < 37.1 < h3.PUBLISHED
    found = worst_case_gain(made.closed(), cells=32)
    assert found.verified
    assert found.upper < made.promised * (1 + 2e-3)
    K = made.model.at(*np.mean(h3.RANGES, axis=1))
    assert isinstance(K, LinearModel)
    loop = connect(h3.plant(), K, inputs=["w1", "w2"], outputs=["z1", "z2"])
    assert loop.at(*found.p).is_stable()
