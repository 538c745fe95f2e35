"""Physics that needs no oracle: symmetries of the rotor, signs of the decided forms."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import symheli
from symheli.components import AirMotion, Flow
from symheli.components.main_rotor import evaluate
from symheli.physics import inflow

TURNS = np.linspace(0.0, 2 * np.pi, 13)


@pytest.fixture(scope="module")
def rotor(ideal):
    """(velocity, rates, flapping a1 b1, cyclic d_lon d_lat, collective) -> force, moment, flapping
    rates of the main rotor alone.
    """
    par = SimpleNamespace(**ideal.vehicle.values("main_rotor"), printed=frozenset(), smoothing=0.0)

    def effect(velocity, rates, flapping, cyclic, d_col=0.0985):
        controls = {"d_col": d_col, "d_lon": cyclic[0], "d_lat": cyclic[1]}
        own = {"a1": flapping[0], "b1": flapping[1]}
        found = evaluate(
            par, AirMotion(*velocity, *rates, 167.0, 1.225), controls, own, Flow(inflow.solve)
        )
        return (
            np.array(found.force, float),
            np.array(found.moment, float),
            np.array([found.rates["a1"], found.rates["b1"]], float),
        )

    return effect


def turned(vector, chi):
    """(forward, right) turned to the right by chi, rad."""
    x, y = vector
    return np.array([x * math.cos(chi) - y * math.sin(chi), x * math.sin(chi) + y * math.cos(chi)])


def leaning(a1, b1):
    """Where the disc leans, (forward, right): X = -T a1, Y = T b1."""
    return np.array([-a1, b1])


def flapping(lean):
    return -lean[0], lean[1]


@pytest.mark.parametrize("chi", TURNS)
def test_hovering_rotor_looks_the_same_after_a_turn_about_its_shaft(rotor, chi):
    """Velocity in the disc, body rates, flapping and cyclic turned together: force, moment and
    flapping rates turn with them.
    """
    rng = np.random.default_rng(int(100 * chi))
    velocity, rates, lean, cyclic = (
        rng.normal(size=2) * 5,
        rng.normal(size=2),
        rng.normal(size=2) * 0.05,
        rng.normal(size=2) * 0.05,
    )
    force, moment, speed = rotor([*velocity, 0.0], [*rates, 0.3], flapping(lean), flapping(cyclic))
    force_t, moment_t, speed_t = rotor(
        [*turned(velocity, chi), 0.0],
        [*turned(rates, chi), 0.3],
        flapping(turned(lean, chi)),
        flapping(turned(cyclic, chi)),
    )
    np.testing.assert_allclose(force_t, [*turned(force[:2], chi), force[2]], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        moment_t, [*turned(moment[:2], chi), moment[2]], rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        leaning(*speed_t), turned(leaning(*speed), chi), rtol=1e-12, atol=1e-11
    )


def test_disc_leans_against_the_motion(rotor):
    """The decided sign of db1/dmu_v: moving in any direction the hovering disc leans back from
    it.
    """
    for chi in TURNS:
        _, _, speed = rotor(
            [*turned([0.5, 0.0], chi), 0.0], [0.0, 0.0, 0.0], (0.0, 0.0), (0.0, 0.0)
        )
        assert leaning(*speed) @ turned([1.0, 0.0], chi) < 0


@pytest.mark.parametrize("seed", range(5))
def test_main_rotor_is_mirror_symmetric(rotor, seed):
    """Mirroring v, p, r, b1, d_lat mirrors Y, L, b1' and leaves X, Z, M, a1'; r plays no part."""
    rng = np.random.default_rng(seed)
    u, w, q = rng.normal(size=3) * [6, 1, 0.5]
    v, p, r = rng.normal(size=3) * [2, 0.5, 0.5]
    (a1, d_lon), (b1, d_lat) = rng.normal(size=2) * 0.03, rng.normal(size=2) * 0.03

    def side(sign):
        return rotor(
            [u, sign * v, w], [sign * p, q, sign * r], (a1, sign * b1), (d_lon, sign * d_lat)
        )

    for (right, left), mirror in zip(
        zip(side(1.0), side(-1.0), strict=True), ([1, -1, 1], [-1, 1, -1], [1, -1]), strict=True
    ):
        np.testing.assert_allclose(right * mirror, left, rtol=1e-13, atol=1e-15)


@pytest.mark.slow(but="pi")
def test_compiled_and_interpreted_functions_agree(heli):
    point = symheli.trim(heli, 7.0)
    x, u = point.x.array + 0.01, point.u.array
    np.testing.assert_allclose(
        np.array(heli.compiled("rhs")(x, u, np.zeros(3))),
        np.array(heli.rhs(x, u, np.zeros(3))),
        rtol=1e-13,
        atol=1e-13,
    )  # same operations in the same order without contraction: rounding only
