"""Proofs over all frequencies: what they rest on, read again, and what they refuse."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_robust_margin import page
from test_several_uncertain_things import RING, two_lags

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling
from symheli.lpv import connect
from symheli.lpv.lft.reduction import reduce_exactly
from synthesis.robust import (
    DynamicBlock,
    covers,
    exact_loop,
    intervals,
    mu_synthesis,
    robust_margin,
    structure,
    upper_bound,
    worst_case_gain,
)
from synthesis.robust.cells import Cell, CellsProof


def lag(dt=None):
    """x' = -x + d + u, v = y = x, dynamics |delta| <= 1/2 from v to d: gain 2, borne twice."""
    model = LinearModel(
        [[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)), ["x"], ["d", "u"], ["v", "y"]
    )
    return LFT.constant(model if dt is None else model.discretize(dt)), [
        DynamicBlock("d", "v", 0.5)
    ]


KINDS = {
    "two dynamics": lambda: robust_margin(two_lags(4.0, 0.25), RING),
    "parameter and dynamics": lambda: robust_margin(page().model, [DynamicBlock("d", "v", 0.5)]),
    "sampled": lambda: robust_margin(*lag(0.1)),
    "gain": lambda: worst_case_gain(*lag()),
    "gain, sampled": lambda: worst_case_gain(*lag(0.1)),
    "late": lambda: robust_margin(lag()[0], [DynamicBlock.of_delay("d", "v", 0.3)]),
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_checks_its_proof_again_and_a_second_writing_agrees(kind):
    found = KINDS[kind]()
    assert found.verified
    assert found.verify()
    assert found.verify(rigorous=True)
    gain = found.proof.performance
    better = {"upper": 0.99 * found.upper} if gain else {"lower": 1.01 * found.lower}
    assert not replace(found, **better).verify()


def forged(proof):
    """Proofs with one thing changed."""
    first, *rest = proof.intervals
    Z, W, G = first.by
    yield "level", proof._replace(level=0.99 * proof.level)
    yield "unit", proof._replace(rows=2 * proof.rows)
    yield "no interval", proof._replace(intervals=())
    yield "a gap", proof._replace(intervals=(first._replace(low=first.low + 1e-3), *rest))
    yield (
        "an end",
        proof._replace(intervals=(*proof.intervals[:-1], proof.intervals[-1]._replace(high=1e9))),
    )
    for name, by in (
        ("negative", (-Z, -W, G)),
        ("zero", (0 * Z, 0 * W, G)),
        ("one", (Z, 2 * W, G)),
        ("not Hermitian", (Z + 1e-3j, W, G)),
        ("nan", (Z * math.nan, W, G)),
    ):
        own = first._replace(by=intervals.Scalings(*by))
        yield name, proof._replace(intervals=(own, *rest))


@pytest.mark.guard
def test_a_proof_with_other_numbers_is_refused():
    whole = structure.loop_of(*lag())
    loop, parts = whole.exact, whole.parts
    proof = robust_margin(*lag()).proof
    assert proof.verified(loop, parts)
    for name, other in forged(proof):
        claim = other.bound
        kept = claim is not None and claim >= proof.bound and other.verified(loop, parts)
        assert not kept, name
    unstable = loop._replace(A=-loop.A)
    assert not proof.verified(unstable, parts)


@pytest.mark.guard
def test_a_proof_for_a_parameter_is_none_for_dynamics():
    """A resonance whose stiffness is uncertain: gain 5.3 of a number, 10.1 of dynamics."""
    model = LinearModel(
        [[0.0, 1.0], [-1.0, -0.2]],
        [[0.0, 0.0], [1.0, 1.0]],
        [[0.1, 0.0], [1.0, 0.0]],
        np.zeros((2, 2)),
        ["a", "b"],
        ["p", "w"],
        ["q", "z"],
    )
    number = LFT.parameter(Scheduling("d", "1", -1.0, 1.0), "q", "p")
    known = worst_case_gain(connect(model, number, inputs=["w"], outputs=["z"]))
    asked = LFT.constant(model), [DynamicBlock("p", "q", 1.0)]
    one, other = (
        structure.loop_of(*own, performance=True).in_rationals for own in (known.asked, asked)
    )
    unit = float(one.B[1, 0])  # a power of two, that of the copies of the parameter
    assert one.C[0, 0] * unit == other.C[0, 0]
    proof = known.proof._replace(
        rows=known.proof.rows / [unit, 1.0], columns=known.proof.columns * [unit, 1.0]
    )
    assert proof.verified(other, proof.parts)
    assert not replace(known, proof=proof, asked=asked).verify()
    cells = CellsProof((Cell((-1.0,), (1.0,), proof),))
    assert not replace(known, proof=cells, asked=asked).verify()
    assert worst_case_gain(*asked).lower > 1.9 * known.upper


@pytest.mark.guard
def test_a_proof_of_a_gain_is_none_of_a_margin():
    """Gains .9 and .001 of two loops apart: the margin is 1.11, not that of the second alone."""
    model = LinearModel(
        -np.eye(2), np.eye(2), np.diag([0.9, 0.001]), np.zeros((2, 2)), "ab", "pw", "qz"
    )
    known = robust_margin(
        LFT.constant(model), [DynamicBlock("p", "q", 1.0), DynamicBlock("w", "z", 1.0)]
    )
    eye, zero = np.eye(2), np.zeros((2, 2))
    every = intervals.Interval(0.0, math.inf, intervals.Scalings(eye, eye, zero))
    proof = known.proof._replace(
        performance=True, level=0.0099, rows=np.ones(2), columns=np.ones(2), intervals=(every,)
    )
    loop = structure.loop_of(*known.asked)
    assert proof.verified(loop.in_rationals, loop.parts)
    assert not replace(known, lower=100.0, proof=proof).verify()


def liar(lie):
    """Return scalings of a solver that says "solved" to anything."""
    rng = np.random.default_rng(1)
    true = upper_bound.scalings_at

    def scalings(M, loop, level, performance):
        nz, nw = M.shape
        found = true(M, loop, level, performance)
        if lie == "garbage":
            draws = [rng.normal(size=s) + 1j * rng.normal(size=s) for s in ((nz, nz), (nw, nw))]
            return intervals.Scalings(*draws, np.zeros((nw, nz), complex))
        if lie == "for nothing":
            return found or intervals.Scalings(*map(np.eye, (nz, nw)), np.zeros((nw, nz)))
        sign = -1.0 if lie == "negative" or found is None else 1.0
        return intervals.Scalings(sign * np.eye(nz), sign * np.eye(nw), np.zeros((nw, nz)))

    return scalings


@pytest.mark.guard
@pytest.mark.parametrize("lie", ["garbage", "negative", "for nothing", "sign"])
def test_a_solver_that_lies_proves_no_margin_and_no_gain(monkeypatch, lie):
    monkeypatch.setattr(upper_bound, "scalings_at", liar(lie))
    margin, gain = robust_margin(*lag()), worst_case_gain(*lag())
    assert margin.lower <= 2.0
    assert gain.upper >= 2.0
    assert margin.verify() == margin.verified
    assert gain.verify() == gain.verified


def integrator():
    """x' = u + w, of which a tenth of u is not known; y = x + n, z = (x, u)."""
    return LinearModel(
        [[0.0]],
        [[1.0, 1.0, 0.0, 1.0]],
        [[0.0], [1.0], [0.0], [1.0]],
        [[0, 0, 0, 0.1], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],
        ["x"],
        ["d", "w", "n", "u"],
        ["v", "z", "cost", "y"],
    )


def designed():
    known = {"order": 0, "iterations": 1}
    return mu_synthesis(integrator(), ["u"], ["y"], [DynamicBlock("d", "v")], **known)


@pytest.mark.guard
@pytest.mark.parametrize("lie", ["garbage", "negative", "for nothing"])
def test_a_solver_that_lies_proves_no_mu(monkeypatch, lie):
    """The least mu of this plant is above 1.4."""
    monkeypatch.setattr(upper_bound, "scalings_at", liar(lie))
    design = designed()
    assert design.mu > 1.4
    assert design.verify() == design.verified


def test_mu_is_proven_of_plant_and_controller_as_given():
    design = designed()
    assert design.verify(rigorous=True)
    K = design.controller
    other = LinearModel(K.A, K.B, 1.2 * K.C, K.D, K.states, K.inputs, K.outputs)
    assert not replace(design, controller=other).verify()
    assert not replace(design, mu=0.999 * design.mu).verify()


def test_a_loop_that_is_stable_by_rounding_alone_is_not_proven():
    """The determinant is 2^-52 to the wrong side of zero, or to the right one."""
    A = np.array([[-1.0, 1.0], [1.0 + 2.0**-52, -1.0]])
    loop = structure.ExactLoop(
        *map(structure.rationals, (A, np.eye(2), np.eye(2), np.zeros((2, 2)))), sampled=False
    )
    assert not loop.transfer.stable
    stable = loop._replace(A=structure.rationals([[-1.0, 1.0], [1.0 - 2.0**-52, -1.0]]))
    assert stable.transfer.stable


def test_units_and_time_far_apart_change_no_proof():
    """The lag of 1e-6 s, its signals 1e8 apart."""
    fast = LinearModel(
        [[-1e6]], [[1e14, 1e6]], [[1e-8], [1.0]], np.zeros((2, 2)), ["x"], ["d", "u"], ["v", "y"]
    )
    found = robust_margin(LFT.constant(fast), [DynamicBlock("d", "v", 0.5)])
    assert found.lower == pytest.approx(2.0, rel=2e-3)
    assert found.verify(rigorous=True)


def test_a_lightly_damped_mode_is_not_passed_over():
    """Damping 1e-9: the peak of 5e8 is as wide as 1e-9 of its frequency."""
    z = 1e-9
    mode = LinearModel(
        [[0.0, 1.0], [-1.0, -2 * z]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        [[0.0]],
        ["p", "v"],
        ["d"],
        ["v"],
    )
    found = robust_margin(LFT.constant(mode), [DynamicBlock("d", "v", 1e-9)])
    assert found.lower == pytest.approx(2.0, rel=2e-3)
    assert found.lower <= 2.0
    assert found.verify(rigorous=True)


def test_the_range_of_a_parameter_is_covered_as_it_is_rounded():
    """Middle and radius of a range far from zero are rounded; its ends count."""
    p = Scheduling("p", "1", 1e9, 1e9 + 1.0000001)
    reach = structure._reach(p)
    assert reach >= 1
    assert p.middle + float(reach) * p.radius >= p.high


def test_weights_that_are_too_small_are_not_shown_to_cover():
    W = covers.delay_weight(0.02)
    low = LinearModel(W.A, W.B, 0.9999 * W.C, 0.9999 * W.D, W.states, W.inputs, W.outputs)
    assert covers.covers_delay(W, 0.02)
    assert not covers.covers_delay(low, 0.02)
    assert not covers.covers_delay(W, 0.0203)
    band, damping = (covers.PositiveRange.of(v, None, "") for v in ((30.0, 42.0), (0.4, 0.8)))
    W = covers.servo_weight(band, damping)
    low = LinearModel(W.A, W.B, 0.95 * W.C, 0.95 * W.D, W.states, W.inputs, W.outputs)
    assert covers.covers_servo(W, band, damping)
    assert not covers.covers_servo(low, band, damping)
    W = covers.lag_weight(band)
    assert covers.covers_lag(W, band)
    assert not covers.covers_lag(W, band._replace(low=29.99))


def test_copies_are_reduced_to_the_last_digit():
    """(p + q)^2 by copies of each entry: fewer copies, the same rational function exactly."""
    p, q = Scheduling("p", "1", -1.0, 1.0), Scheduling("q", "1", -1.0, 1.0)
    lpv = LPVStateSpace.polynomial(
        {(0, 0): [[-3.0]], (2, 0): [[0.3]], (1, 1): [[0.6]], (0, 2): [[0.3]]},
        {(0, 0): [[1.0]]},
        {(0, 0): [[1.0]]},
        {(0, 0): [[0.0]]},
        [p, q],
    )
    lft = lpv.to_lft()
    found = reduce_exactly(lft)
    assert sum(found.sizes) < lft.order
    for delta in ((0.25, -0.75), (1.0, 0.5)):
        values = []
        for M11, M12, M21, sizes in (
            found,
            (*map(structure.rationals, (lft.M11, lft.M12, lft.M21)), lft.sizes),
        ):
            d = structure.rationals(np.repeat(delta, sizes))
            n = len(d)
            inner = exact_loop.inverse(structure.rationals(np.eye(n)) - M11 * d)
            values.append(M21 @ (d[:, None] * (inner @ M12)))
        assert np.array_equal(*values)
