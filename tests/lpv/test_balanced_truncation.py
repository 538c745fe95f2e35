"""Fewer states: what must be kept is kept, and the error reported is the error made."""

import numpy as np
import pytest

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import balanced_truncation, nu_gap

P = Scheduling("p", "1", 0.0, 1.0)


def lti(n=6, seed=0, dt=None, shift=0.0):
    """A random model with poles of real part about -1 (or inside a disk of radius 0.85), moved by
    `shift`.
    """
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    radius = np.abs(np.linalg.eigvals(A)).max()
    A = A / radius * 0.85 if dt else A - (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    A = A + shift * np.eye(n)
    B, C = rng.normal(size=(n, 2)), rng.normal(size=(2, n))
    return LinearModel(
        A,
        B,
        C,
        0.1 * rng.normal(size=(2, 2)),
        tuple(f"x{i}" for i in range(n)),
        ("u", "v"),
        ("y", "z"),
        dt=dt,
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_the_stated_bound_holds_for_both_kinds_of_balance(seed, dt):
    """Enns and Glover: |G - G_r| <= twice the tail, and the same of the coprime factors, whose
    difference is no smaller than the nu-gap; of unstable models too.
    """
    full = lti(seed=seed, dt=dt)
    found = balanced_truncation(full, 4, balance="response")
    omega = np.concatenate([[0.0], np.geomspace(1e-3, np.pi / dt if dt else 1e3, 2000)])
    G, R = (m.frequency_response(omega) for m in (full, found.model))
    error = np.linalg.norm(G - R, 2, axis=(1, 2)).max()
    # below by the frequency grid at most
    assert found.singular_values[4] * (1 - 1e-3) <= error <= found.bound
    assert found.model.is_stable()
    unstable = lti(seed=seed, dt=dt, shift=0.4 if dt is None else 1.1)
    assert not unstable.is_stable()
    factors = balanced_truncation(unstable, 5)
    assert 0 < factors.nu_gap[0] <= factors.bound + 1e-9
    with pytest.raises(InputError, match=r'not stable.*balance="factors"'):
        balanced_truncation(unstable, 4, balance="response")


@pytest.mark.parametrize("shift", [0.0, 0.9])
@pytest.mark.parametrize("order", [2, 4])
def test_nu_gap_stays_below_twice_the_tail_of_the_coprime_factors(order, shift):
    """With s^2 = v^2 / (1 + v^2) the Hankel singular values of the normalised coprime factors:
    Meyer (1990), continuous time.
    """
    full = lti(shift=shift)
    assert full.is_stable() == (shift == 0.0)
    found = balanced_truncation(full, order)
    v = found.singular_values[order:]
    assert found.nu_gap[0] <= 2 * np.sum(v / np.sqrt(1 + v**2)) + 1e-6
    assert found.nu_gap[0] > 1e-3
    assert np.sum(found.model.poles().real > 0) == np.sum(full.poles().real > 0)


def test_the_reported_gap_is_that_of_the_frozen_models():
    full = lti(dt=0.1)
    found = balanced_truncation(full, 4, input_scale=[0.5, 2.0])
    assert found.nu_gap[0] == pytest.approx(nu_gap(full, found.model, input_scale=[0.5, 2.0]))
    omega = np.linspace(0, np.pi / 0.1, 4001)
    G, R = (m.frequency_response(omega) * [0.5, 2.0] for m in (full, found.model))
    error = np.linalg.norm(G - R, 2, axis=(1, 2)).max() / np.linalg.norm(G, 2, axis=(1, 2)).max()
    assert found.error[0] == pytest.approx(error, rel=1e-3)  # two frequency grids


def lpv(dt, unseen=2):
    """Three states that depend on p and `unseen` ones that no input reaches, mixed by a constant
    transformation.
    """
    rng = np.random.default_rng(3)
    n = 3 + unseen
    A0, A1 = np.zeros((n, n)), np.zeros((n, n))
    A0[:3, :3] = [[0.7, 0.3, 0.0], [-0.3, 0.6, 0.1], [0.0, 0.1, 1.02]]  # the last one unstable
    A1[:3, :3] = 0.1 * rng.normal(size=(3, 3))
    A0[3:, 3:] = np.diag(np.linspace(0.2, 0.5, unseen))
    B, C = np.vstack([rng.normal(size=(3, 1)), np.zeros((unseen, 1))]), rng.normal(size=(2, n))
    T = rng.normal(size=(n, n))
    if dt is None:
        A0 -= np.eye(n)
    A = [np.linalg.solve(T, M @ T) for M in (A0, A1)]
    return LPVStateSpace.polynomial(A, [np.linalg.solve(T, B)], [C @ T], [np.zeros((2, 1))], P, dt)


@pytest.mark.parametrize("dt", [None, 0.05])
def test_states_that_no_input_reaches_cost_nothing(dt):
    full = lpv(dt)
    found = full.truncate(3)
    assert found.nu_gap.max() < 1e-6  # the square root of the rounding of Riccati solutions
    assert np.isnan(found.error).any() == (not all(full.at(p).is_stable() for p in found.p))
    assert found.model.basis == full.basis
    for p in (0.0, 0.33, 1.0):
        omega = np.array([0.1, 1.0, 10.0])
        np.testing.assert_allclose(
            found.model.at(p).frequency_response(omega),
            full.at(p).frequency_response(omega),
            rtol=1e-6,
            atol=1e-8,
        )
    with pytest.raises(InputError, match="only 3 of the 5 states can be excited and seen"):
        full.truncate(4)


def test_reduction_does_not_depend_on_units_once_channels_are_scaled():
    full = lpv(0.05)
    other = LPVStateSpace(
        full.basis,
        full.A,
        1e-3 * full.B,
        50 * full.C,
        0.05 * full.D,
        P,
        full.states,
        full.inputs,
        full.outputs,
        0.05,
    )
    first, second = full.truncate(2), other.truncate(2, input_scale=1e3, output_scale=50.0)
    np.testing.assert_allclose(second.nu_gap, first.nu_gap, atol=1e-7)
    assert first.nu_gap.max() > 1e-3


def test_what_cannot_be_reduced_is_refused_in_words():
    full = lpv(0.05)
    for order in (0, 5, 2.0):
        with pytest.raises(InputError, match="order: expected an integer from 1 to 4"):
            full.truncate(order)  # type: ignore[arg-type]
    hidden = LinearModel(
        np.diag([0.5, 1.5, 0.3]),
        [[1.0], [0.0], [1.0]],
        [[1.0, 1.0, 0.0]],
        [[0.0]],
        "abc",
        ("u",),
        ("y",),
        dt=0.1,
    )  # type: ignore[arg-type]
    with pytest.raises(InputError, match="not stabilisable and detectable"):
        balanced_truncation(hidden, 1)
