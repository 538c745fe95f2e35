"""The coefficient diagram method reaches its target polynomial, or says why it cannot."""

import mpmath
import numpy as np
import pytest
from scipy import signal

import symheli
import synthesis
from symheli import LinearModel
from symheli.errors import InputError
from synthesis.design.lti.coefficient_diagram import target


def of(numerator, denominator):
    A, B, C, D = signal.tf2ss(numerator, denominator)
    return LinearModel(A, B, C, D, [f"x{i}" for i in range(len(A))], ["u"], ["y"])


def reached(numerator, denominator, K):
    """Characteristic polynomial of u = K y, from that of K in 60 digits: in doubles the check would
    lose more than the design.
    """
    mpmath.mp.dps = 60
    A, B, C, D = (
        mpmath.matrix(np.asarray(M).tolist()) if M.size else None for M in (K.A, K.B, K.C, K.D)
    )
    n = len(K.states)
    order = n + len(denominator) - 1
    values, points = [], [mpmath.expjpi(mpmath.mpf(2 * k) / (order + 1)) for k in range(order + 1)]
    for s in points:
        S = s * mpmath.eye(n) - A if n else None
        answer = D[0] + ((C * mpmath.lu_solve(S, B))[0] if n else 0)
        own = mpmath.det(S) if n else mpmath.mpf(1)
        num, den = (mpmath.polyval([float(v) for v in f], s) for f in (numerator, denominator))
        values.append(own * (den - num * answer))
    # coefficients from the values on the unit circle
    return [
        float(
            mpmath.re(sum(v * s ** (-k) for v, s in zip(values, points, strict=True)) / (order + 1))
        )
        for k in range(order, -1, -1)
    ]


def test_the_standard_form_is_manabes():
    """gamma = 2.5, 2, 2: P = tau^4 s^4 / (2.5^3 2^2 2) + ... (Manabe 1998, eq. 10, written out)."""
    tau = 0.7
    np.testing.assert_allclose(
        target(tau, 4),
        [tau**4 / (2.0 * 2.0**2 * 2.5**3), tau**3 / (2.0 * 2.5**2), tau**2 / 2.5, tau, 1.0],
        rtol=1e-14,
    )
    for order in range(2, 9):  # hardly an overshoot, settled within 3 tau
        t, y = signal.step(([1.0], target(1.0, order)), T=np.linspace(0, 8, 4001))
        assert y.max() < 1.02
        assert np.abs(y[t >= 3.0] - 1).max() < 0.03


def test_the_double_integrator_has_its_closed_form():
    """(l1 s + l0) s^2 + k1 s + k0 = P: K = -(tau s + 1) / (tau^3 s / 12.5 + tau^2 / 2.5)."""
    tau = 0.4
    K = synthesis.designs.coefficient_diagram(of([1.0], [1.0, 0.0, 0.0]), tau)
    b, a = signal.ss2tf(K.A, K.B, K.C, K.D)
    scale = (tau**3 / 12.5) / a[0]
    np.testing.assert_allclose(scale * b[0], [-tau, -1.0], rtol=1e-12)
    np.testing.assert_allclose(scale * a, [tau**3 / 12.5, tau**2 / 2.5], rtol=1e-12)


@pytest.mark.parametrize("integral", [False, True])
@pytest.mark.parametrize("roll_off", [False, True])
def test_the_target_is_reached(integral, roll_off):
    """To 1e-9 of each coefficient, of unstable and nonminimum-phase plants."""
    rng = np.random.default_rng(3)
    plants = [
        ([2.0], [1.0, 3.0]),
        ([1.0, -4.0], [1.0, 2.0, -3.0]),  # a right half plane zero and pole
        *((np.poly(rng.uniform(4, 6, 2)), np.poly(rng.uniform(-3, 1, 3))) for _ in range(3)),
    ]
    for numerator, denominator in plants:
        G = of(numerator, denominator)
        K = synthesis.designs.coefficient_diagram(G, 0.5, integral=integral, roll_off=roll_off)
        n = len(G.states)
        assert len(K.states) == n - 1 + integral + roll_off
        assert not (roll_off and np.any(K.D))
        assert not integral or np.abs(np.linalg.eigvals(K.A)).min() < 1e-9
        wanted = target(0.5, n + len(K.states))
        np.testing.assert_allclose(
            reached(numerator, denominator, K), wanted / wanted[0], rtol=1e-9
        )


@pytest.mark.slow
def test_roll_of_a_helicopter_flies():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    hover = symheli.sweep(heli, [2.0, 3.0], inputs=("d_lat", "v_w"))[0].select(("p", "phi", "b1"))
    plant = synthesis.Plant(
        hover, disturbances=["v_w"], performance=["phi"], controls=["d_lat"], measurements=["phi"]
    ).with_delay(0.02, order=1)
    G = plant.model.at(0.0).select(inputs=["d_lat"], outputs=["phi"])
    made = synthesis.Controller.of(
        plant, synthesis.designs.coefficient_diagram(G, 0.5, roll_off=True), "CDM"
    )
    assert made.certify(search=None).verified
    still = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    record = symheli.fly(heli, still, controller=made.discretize(0.02))
    assert np.abs(record["phi"]).max() < 0.2


def test_what_has_no_design_is_refused_in_words():
    with pytest.raises(InputError, match=r"common factor, or nearly \(near -2"):
        synthesis.designs.coefficient_diagram(of([1.0, 2.0], [1.0, 3.0, 2.0]), 1.0)
    with pytest.raises(InputError, match=r"common factor.*integrator"):
        synthesis.designs.coefficient_diagram(of([1.0, 0.0], [1.0, 3.0, 2.0]), 1.0, integral=True)
    lag = of([1.0], [1.0, 1.0])
    for given, words in (
        ({"G": of([1.0, 0.0], [1.0, 1.0]), "tau": 1.0}, "strictly proper"),
        ({"G": lag.discretize(0.1), "tau": 1.0}, "continuous"),
        ({"G": lag, "tau": 0.0}, "tau"),
        ({"G": of([1.0], [1.0, 1.0, 1.0]), "tau": 1e300}, "proportion"),
        ({"G": lag, "tau": 1.0, "indices": (-1.0,)}, "> 0"),
        ({"G": of([1.0], [1.0, 0, 0, 0]), "tau": 1.0, "indices": (0.9,)}, "not stable"),
    ):
        with pytest.raises(InputError, match=words):
            synthesis.designs.coefficient_diagram(**given)
