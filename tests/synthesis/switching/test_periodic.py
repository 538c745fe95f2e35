"""Gains of models that move in a known periodic way: harmonic transfer functions, closed forms of
models at rest, forged files.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from synthesis.checker import report
from synthesis.numerics.linear.norm import norm
from synthesis.switching import PeriodicGain, periodic_gain
from synthesis.switching.periodic import _turning
from synthesis.switching.periodic_inequality import Half, inequalities


def spring(low=-1.0, high=1.0):
    """y'' + y' + (1 + 2.5 p) y = f."""
    p = Scheduling("p", "1", low, high)
    A = [[0, 1], [-1 - 2.5 * p.symbol, -1]]
    return LPVStateSpace.from_expressions(A, [[0], [1]], [[1, 0]], [[0]], p)


def harmonic(p, omega, most=14):
    """The gain of a truncated harmonic transfer function of the spring, written down anew."""
    still, moved = np.array([[0.0, 1.0], [-1.0, -1.0]]), np.array([[0.0, 0.0], [-2.5, 0.0]])
    mean, a, b = p
    up = 0.5 * complex(a, -b) * moved
    span, best = range(-most, most + 1), 0.0
    for w in np.linspace(0.0, 0.5 * omega, 200):
        rows = [
            [
                1j * (w + i * omega) * np.eye(2) - still - mean * moved
                if i == j
                else -up
                if i == j + 1
                else -up.conj()
                if i == j - 1
                else np.zeros((2, 2))
                for j in span
            ]
            for i in span
        ]
        eye = np.eye(len(span))
        found = np.kron(eye, [[1.0, 0.0]]) @ np.linalg.solve(
            np.block(rows), np.kron(eye, [[0], [1]])
        )
        best = max(best, np.linalg.norm(found, 2))
    return best


@pytest.mark.parametrize(("p", "omega"), [((0.0, 1.0, 0.0), 3.0), ((0.1, -0.2, 0.3), 0.7)])
def test_the_gain_is_that_of_the_harmonic_transfer_function(p, omega):
    found = periodic_gain(spring(), {"p": p}, omega, harmonics=6)
    truth = harmonic(p, omega)
    assert found.verified
    # frequencies of two grids
    assert_allclose(found.lower, truth, rtol=1e-3)
    # six harmonics, sixteen parts of each half: within a hundredth
    assert truth * (1 - 1e-9) <= found.gamma <= 1.01 * truth


def test_a_motion_without_harmonics_is_a_model_at_rest():
    found = periodic_gain(spring(), {"p": (0.2, 0.0, 0.0)}, 1.0, harmonics=0)
    at = spring().at(0.2)
    assert_allclose(found.gamma, norm(at.A, at.B, at.C, at.D, None)[0], rtol=1e-5)
    decay = np.linalg.eigvals(at.A).real.max()
    assert_allclose(found.multiplier, math.exp(2 * math.pi * decay), rtol=1e-6)


def test_a_wider_range_of_the_model_plays_no_part():
    one, other = (periodic_gain(m, {"p": (0.0, 1.0, 0.0)}, 3.0) for m in (spring(), spring(-9, 4)))
    assert_allclose(one.gamma, other.gamma, rtol=1e-6)


def test_the_polynomials_are_the_functions_of_the_angle():
    own, rng = _turning(spring(), {"p": (0.1, 0.8, 0.3)}, 3.0), np.random.default_rng(0)
    terms = rng.normal(size=(5, 2, 2))
    terms = terms + terms.transpose(0, 2, 1)
    for side in (1, -1):
        half = Half(side, 0.0)
        first, falls = inequalities(
            own, [half.known(M) for M in terms], half.known(7.0 * np.eye(1)), half
        )
        for q in (-0.9, 0.2, 0.7):
            angle = 2 * np.arctan(q) + (0.0 if side == 1 else np.pi)
            p = 0.1 + 0.8 * np.cos(angle) + 0.3 * np.sin(angle)
            A, B, C = spring().at(p).A, np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
            waves = [(np.cos(k * angle), np.sin(k * angle), k) for k in (1, 2)]
            P = terms[0] + sum(terms[2 * k - 1] * c + terms[2 * k] * s for c, s, k in waves)
            rate = 3 * sum(k * (terms[2 * k] * c - terms[2 * k - 1] * s) for c, s, k in waves)
            F = np.block([[P @ A + A.T @ P + rate + C.T @ C, P @ B], [B.T @ P, -7 * np.eye(1)]])
            e = 1 + q**2
            assert_allclose(first([q]) / e**2, -P, atol=1e-12)
            assert_allclose(falls([q]) / e**3, F, atol=1e-12)


def test_stability_needs_no_channels_and_instability_is_seen():
    bare = spring().select(inputs=[], outputs=[])
    assert periodic_gain(bare, {"p": (0.0, 1.0, 0.0)}, 3.0, harmonics=3).verified
    wide = spring(-3.0, 3.0).select(inputs=[], outputs=[])
    pumped = periodic_gain(wide, {"p": (0.0, 3.0, 0.0)}, 2.0)
    assert not pumped.verified
    assert pumped.multiplier > 1
    assert "not stable" in str(pumped)


@pytest.mark.guard
def test_the_checker_proves_what_is_saved_and_no_forged_number(tmp_path, capsys):
    found = periodic_gain(spring(), {"p": (0.0, 1.0, 0.0)}, 3.0, harmonics=3)
    path = found.save(tmp_path / "gain.json")
    assert report.main([str(path)]) == 0
    assert found.claim in capsys.readouterr().out
    assert PeriodicGain.load(path).gamma == found.gamma
    content = json.loads(path.read_text())
    forged = [content | {"gamma": 0.999 * found.lower}, content | {"omega": 1.0}]
    for name, place, value in (
        ("A", -1, -0.2), ("P", 0, -1.0), ("motion", 1, 2.0), ("ranges", 0, -3.0), ("B", 1, 9.0)
    ):  # fmt: skip
        other = json.loads(json.dumps(content))
        other[name]["array"][place] = value
        forged.append(other)
    for other in forged:
        file = tmp_path / "forged.json"
        file.write_text(json.dumps(other))
        assert report.main([str(file)]) != 0
        capsys.readouterr()


def test_a_motion_of_another_form_is_refused():
    with pytest.raises(UnknownNameError, match="known: p"):
        periodic_gain(spring(), {"q": (0.0, 1.0, 0.0)}, 3.0)
    with pytest.raises(InputError, match="expected one of p"):
        periodic_gain(spring(), {}, 3.0)
    with pytest.raises(InputError, match="continuous time"):
        periodic_gain(spring().discretize(0.1), {"p": (0.0, 1.0, 0.0)}, 3.0)
    with pytest.raises(InputError, match="the model holds on"):
        periodic_gain(spring(), {"p": (0.0, 2.0, 0.0)}, 3.0)


def test_a_gain_below_zero_and_a_p_that_is_not_symmetric_prove_nothing():
    found = periodic_gain(spring(), {"p": (0.0, 1.0, 0.0)}, 3.0, harmonics=3)
    assert found.verify()
    assert not replace(found, gamma=-found.gamma).verify()
    P = found.P.copy()
    P[0, 0, 1] -= 1.0
    assert not replace(found, P=P).verify()
