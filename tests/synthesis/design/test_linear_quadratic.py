"""LQR and LQG of any plant: closed forms, two routes to the same gains, flown as all others."""

import math

import numpy as np
import pytest
from scipy import linalg

import symheli
import synthesis
from symheli import LinearModel, TableController
from symheli.errors import InputError, SynthesisError
from symheli.export import write_controller
from symheli.flight.autopilot import SCALE, UNMEASURED, gain_scheduled_lqr
from symheli.steady.airspeed_sweep import design_family
from synthesis.design.lti.h2 import h2_norm

CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")


def plant_of(A, B, dt=None, C=None):
    """A plant whose states are measured, or C of them, with controls alone."""
    n, nu = len(A), np.shape(B)[1]
    C = np.eye(n) if C is None else np.asarray(C, float)
    x, u, y = (
        [f"{letter}{i}" for i in range(k)] for letter, k in (("x", n), ("u", nu), ("y", len(C)))
    )
    model = LinearModel(A, B, C, np.zeros((len(C), nu)), x, u, y, dt)
    return synthesis.Plant(model, controls=u, measurements=y)


def random_plant(seed):
    """Three states, two controls and measurements, every channel disturbed and priced, over p."""
    rng = np.random.default_rng(seed)
    A = np.stack([rng.normal(size=(3, 3)), 0.3 * rng.normal(size=(3, 3))])
    B = np.hstack([rng.normal(size=(3, 3)), np.zeros((3, 2)), rng.normal(size=(3, 2))])
    C = np.vstack([rng.normal(size=(3, 3)), np.zeros((2, 3)), rng.normal(size=(2, 3))])
    D = np.zeros((7, 7))
    D[3:5, 5:], D[5:, 3:5] = np.eye(2), 0.3 * np.eye(2)
    w, z = [f"w{i}" for i in range(5)], [f"z{i}" for i in range(5)]
    model = symheli.LPVStateSpace.polynomial(
        A=A,
        B=B[None],
        C=C[None],
        D=D[None],
        scheduling=symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.1),
        states=["x0", "x1", "x2"],
        inputs=[*w, "u0", "u1"],
        outputs=[*z, "y0", "y1"],
    )
    return synthesis.Plant(model, w, z, ["u0", "u1"], ["y0", "y1"])


def test_the_double_integrator_has_its_closed_form():
    """x1'' = u, cost q x1^2 + r u^2: u = -sqrt(q/r) x1 - sqrt(2 sqrt(q/r)) x2."""
    cart = plant_of([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]])
    K = synthesis.lqr(cart, Q={"x0": 9.0}, R={"u0": 0.25}).at(0.0)
    np.testing.assert_allclose(K.D, [[-6.0, -math.sqrt(12.0)]], rtol=1e-12)


def test_a_mixed_weight_is_a_regulator_of_the_plant_with_a_feedback_in_it():
    """x'Qx + 2x'Nu + u'Ru with v = u + R^-1 N'x has no mixed term (Anderson and Moore, 3.4)."""
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    root = rng.normal(size=(5, 5))
    whole = root @ root.T
    Q, N, R = whole[:3, :3], whole[:3, 3:], whole[3:, 3:]
    inside = np.linalg.solve(R, N.T)
    mixed = synthesis.lqr(plant_of(A, B), Q=Q, R=R, N=N).at(0.0).D
    plain = synthesis.lqr(plant_of(A - B @ inside, B), Q=Q - N @ inside, R=R).at(0.0).D
    np.testing.assert_allclose(mixed, plain - inside, rtol=1e-9)
    X = linalg.solve_continuous_are(A, B, Q, R, s=N)  # SciPy's, another algorithm
    np.testing.assert_allclose(mixed, -np.linalg.solve(R, B.T @ X + N.T), rtol=1e-9)


def test_a_delay_is_predicted_over():
    """Two samples of delay: the gain of the plant without delay on the state two samples on,
    A^2 x + A B u(k-2) + B u(k-1).
    """
    A, B = np.array([[1.0, 0.1], [0.05, 1.0]]), np.array([[0.005], [0.1]])
    plain = plant_of(A, B, 0.1)
    made = synthesis.lqr(plain.with_delay(0.2), Q=np.diag([1.0, 0.2, 0, 0]), R={"u0": 0.3})
    F = synthesis.lqr(plain, Q=np.diag([1.0, 0.2]), R={"u0": 0.3}).at(0.0).D
    K = made.at(0.0)
    assert made.order == 2
    x, own, older, newer = np.array([0.7, -0.2]), np.zeros(2), 0.0, 0.0  # no command before
    for _ in range(20):
        u = float((K.C @ own + K.D @ x)[0])
        ahead = A @ A @ x + (A @ B * older + B * newer)[:, 0]
        assert u == pytest.approx(float((F @ ahead)[0]), rel=1e-9, abs=1e-12)
        own = K.A @ own + K.B @ x
        x, older, newer = A @ x + B[:, 0] * older, newer, u
    assert np.abs(np.linalg.eigvals(made.closed().at(0.0).A)).max() < 1


def test_return_differences_of_a_regulator_are_at_least_one():
    """Kalman's inequality |1 + L(j omega)| >= 1 at every frequency, for one control."""
    rng = np.random.default_rng(4)
    A, B = rng.normal(size=(4, 4)), rng.normal(size=(4, 1))
    F = synthesis.lqr(plant_of(A, B), Q=np.eye(4), R=np.eye(1)).at(0.0).D
    for omega in np.logspace(-3, 3, 61):
        L = -F @ np.linalg.solve(1j * omega * np.eye(4) - A, B)
        assert abs(1 + L[0, 0]) >= 1 - 1e-9  # rounding


@pytest.mark.slow(but="None")
@pytest.mark.parametrize("dt", [None, 0.1])
def test_lqg_at_every_p_is_the_h2_optimum(dt):
    plant = random_plant(1)
    plant = plant if dt is None else plant.sampled(dt)
    made = synthesis.lqg(plant)
    assert made.misfit < 1e-3
    for p in (0.0, 0.37, 1.0):
        best = synthesis.h2(plant.model.at(p), plant.controls, plant.measurements).optimum
        reached = h2_norm(made.closed().at(p))
        assert best * (1 - 1e-9) <= reached <= best * (1 + 1e-4)  # of second order in the misfit
    straight = synthesis.lqg(plant, [0.0, 0.37, 1.0])
    assert h2_norm(straight.closed().at(0.37)) == pytest.approx(
        synthesis.h2(plant.model.at(0.37), plant.controls, plant.measurements).optimum, rel=1e-9
    )


def test_given_intensities_are_those_of_the_plant():
    plant = random_plant(2)
    P = plant.at(0.5)
    cost = {"Q": P.C1.T @ P.C1, "R": P.D12.T @ P.D12}
    made = synthesis.lqg(plant, [0.0, 0.5, 1.0], **cost, W=P.B1 @ P.B1.T, V=P.D21 @ P.D21.T)
    own = synthesis.lqg(plant, [0.0, 0.5, 1.0])
    for part in "ABCD":
        ours, theirs = (getattr(K.at(0.5), part) for K in (made, own))
        np.testing.assert_allclose(ours, theirs, atol=1e-8 * np.abs(theirs).max(initial=0.0))


@pytest.mark.parametrize("vehicle", ["xcell60", "xcell_kahn_hudson"])
def test_the_gains_of_the_study_are_its_special_case(vehicle):
    """On the sampled models without flapping, at the airspeeds of its table. The study's own stands
    in `symheli.flight`, which knows nothing of synthesis, and is softened until it is stable behind
    servos.
    """
    heli = symheli.Helicopter.load(vehicle, governor="ideal")
    pilot = gain_scheduled_lqr(heli, 0.0, 8.0, 0.02, 3)
    family = design_family(heli, pilot.airspeeds)
    family = family.residualize([s for s in UNMEASURED if s in family.states])
    for k, K in enumerate(pilot.gains):
        one = family[k].discretize(0.02)
        n = len(one.states)
        seen = LinearModel(
            one.A, one.B, np.eye(n), np.zeros((n, 4)), one.states, CONTROLS, one.states, 0.02
        )
        made = synthesis.lqr(
            synthesis.Plant(seen, controls=CONTROLS, measurements=one.states),
            Q={s: SCALE[s] ** -2 for s in one.states},
            R=dict.fromkeys(CONTROLS, 1e4),
        )
        np.testing.assert_allclose(made.at(0.0).D, -K, atol=1e-9 * np.abs(K).max())


def lateral_designs(heli):
    """An LQR and an LQG of the lateral axis over airspeed, behind a delay, with their orders."""
    family = symheli.sweep(heli, np.linspace(0, 8, 5), inputs=("d_lat", "v_w"))
    lateral = family.select(("v", "p", "phi", "b1")).interpolate("polynomial", 2, rate=1.0)
    measured = ("v", "p", "phi")
    plant = (
        synthesis.Plant(lateral, ["v_w"], [*measured, "d_lat"], ["d_lat"], measured)
        .with_delay(0.02, order=1)
        .weighted({"v_w": 2.0, "v": 0.5, "p": 0.5, "phi": 5.0, "d_lat": 100.0})
    )
    noisy = plant.with_noise({"v": 0.3, "p": 0.03, "phi": 0.01})
    return (synthesis.lqr(plant), 2), (synthesis.lqg(noisy), 5)


@pytest.mark.slow
def test_it_is_the_same_object_as_every_other_design(tmp_path):
    """Sampled, in a table, in C, and flown."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    for made, order in lateral_designs(heli):
        assert made.order == order
        sampled = made.discretize(0.02)
        table = TableController.of(sampled, 5)
        assert write_controller(table, tmp_path / f"lq{order}")
        hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
        for flown in (sampled, table):
            record = symheli.fly(heli, hover, controller=flown)
            assert np.abs(record["phi"]).max() < 0.2


@pytest.mark.slow
def test_schedules_are_proven_as_they_fly():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    for made, _ in lateral_designs(heli):
        assert made.certify(1.0, search=None).verified
        assert made.discretize(0.02).certify(1.0, search=None).verified


def test_what_does_not_fit_is_refused_in_words():
    unstable = plant_of([[1.0, 1.0], [0.0, 1.0]], [[0.0], [1.0]], C=[[1.0, 0.0]])
    with pytest.raises(SynthesisError, match="not measured cannot be computed"):
        synthesis.lqr(unstable, Q={"x0": 1.0}, R={"u0": 1.0})
    cart = plant_of([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]])
    for given, words in (
        ({"Q": {"x0": 1.0}}, "both Q and R"),
        ({"Q": {"x0": 1.0}, "R": {"u0": 0.0}}, "R positive definite"),
        ({"Q": {"x0": -1.0}, "R": {"u0": 1.0}}, "positive semidefinite"),
        ({"Q": np.eye(3), "R": {"u0": 1.0}}, r"expected shape \(2, 2\)"),
        ({"Q": [[1, 1], [0, 1]], "R": [[1]]}, "symmetric"),
        ({}, "no performance"),
    ):
        with pytest.raises(InputError, match=words):
            synthesis.lqr(cart, **given)
    twice = plant_of([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], C=[[1, 0], [2, 0]])
    with pytest.raises(InputError, match="linearly independent"):
        synthesis.lqr(twice, Q={"x0": 1.0}, R={"u0": 1.0})
    stuck, some = plant_of([[1.0]], [[0.0]]), random_plant(0)
    with pytest.raises(SynthesisError, match="cannot stabilise"):
        synthesis.lqr(stuck, Q=[[1.0]], R=[[1.0]])
    with pytest.raises(InputError, match="both W and V"):
        synthesis.lqg(some, W=np.eye(3))
