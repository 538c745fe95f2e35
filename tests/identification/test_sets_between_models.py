"""Sets of models that lie between two, in a range of wind, tight where they are used."""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import Vehicle

import identification as idn
from identification.model.excited_directions import excited_directions
from identification.model.flown_in import CONDITIONS
from identification.model.kinematic_realization import covering
from identification.model.matrix_ellipsoid import spectral_radius
from symheli.errors import InputError

OUTPUTS, INPUTS = ("v", "p", "r", "phi"), ("d_lat", "d_ped")
AT = 4.0


@pytest.fixture(scope="module")
def models():
    """Two vehicles of one structure, as if `FilterError` had found them."""
    vehicle = Vehicle(na=1, nb=1)
    record = vehicle.record(400, seed=1)
    sizes = 1e-3 * np.abs(vehicle.theta.T) + 1e-6
    covariance = np.einsum("ia,ij,ab->iajb", sizes**2, np.eye(6), np.eye(len(vehicle.theta)))

    def of(factor):
        model = vehicle.model(record, factor * vehicle.theta)
        known = replace(
            model.aerodynamics, covariance=covariance, method="filter error", least_squares=False
        )
        return replace(model, aerodynamics=known)

    return of(1.0), of(1.1)


def perturbed(every, *ends):
    """The set's model with its single deltas at these shares of the bound."""
    delta = np.zeros(every.shape)
    for place, end in zip(every.places[1:], ends, strict=True):
        delta[place] = end * every.bound
    return every.perturbed(delta).at(AT)


def test_the_ends_of_a_set_between_two_models_are_the_models(models):
    every = models[0].uncertain(0.95, OUTPUTS, INPUTS, other=models[1])
    assert [tuple(part[:2]) for part in every.parts] == [every.parts[0][:2], *[(1, 1)] * 3]
    for end, model in zip((-1.0, 1.0), models, strict=True):
        found, own = perturbed(every, end, end, end), model.at(AT, outputs=OUTPUTS, inputs=INPUTS)
        # both models have one trim: only the coefficients differ; polynomials are fitted to 1e-9
        np.testing.assert_allclose(found.A, own.A, atol=1e-8)
        np.testing.assert_allclose(found.B, own.B, atol=1e-8)


def test_a_head_wind_is_a_slower_trim_over_ground(models):
    """The other route: the trim itself flown at another velocity, airspeed kept as parameter."""
    model, wind = models[0], (1.0, 3.0)
    every = model.uncertain(0.95, OUTPUTS, INPUTS, head_wind=wind)
    points = np.linspace(0.0, 10.0, 5)
    y = model.structure.basis(points) @ model.trim
    for end, speed in zip((-1.0, 1.0), wind, strict=True):
        slower = y.copy()
        slower[:, 0] -= speed * np.cos(y[:, 7])
        slower[:, 1] -= speed * np.sin(y[:, 7]) * np.sin(y[:, 6])
        slower[:, 2] -= speed * np.sin(y[:, 7]) * np.cos(y[:, 6])
        trim = model.structure.basis.fit(points, slower)
        own = replace(model, trim=trim).at(AT, outputs=OUTPUTS, inputs=INPUTS)
        found = perturbed(every, end)
        # cos of the trim is no polynomial of degree one: the second route errs by its square
        np.testing.assert_allclose(found.A, own.A, atol=2e-4)
        assert np.abs(own.A - model.at(AT, outputs=OUTPUTS, inputs=INPUTS).A).max() > 0.01
        np.testing.assert_allclose(found.B, own.B, atol=2e-4)


def test_what_covers_two_covariances_is_at_least_each_and_at_most_their_sum():
    rng = np.random.default_rng(0)
    parts = []
    for scale in (1.0, 3.0):
        root = rng.normal(size=(6, 6)) * scale
        parts.append((root @ root.T).reshape(2, 3, 2, 3))
    found = covering(parts).reshape(6, 6)
    for part in parts:
        assert np.linalg.eigvalsh(found - part.reshape(6, 6)).min() > -1e-8
    assert np.linalg.eigvalsh(sum(parts).reshape(6, 6) - found).min() > -1e-8
    assert covering(parts[:1]) == pytest.approx(parts[0])


@pytest.mark.parametrize("draws", [0, 4000])
def test_an_emphasized_ellipsoid_keeps_its_probability_and_is_tight_where_asked(draws):
    n, m, probability = 12, 3, 0.9
    P = np.einsum("ij,ab->iajb", np.eye(m), np.eye(n))
    S = np.zeros((n, n))
    S[0, 0] = 1.0
    found = idn.model.matrix_ellipsoid(P, probability, draws=draws, emphasis=S)
    errors = np.random.default_rng(5).normal(size=(4000, n, m))
    assert found.contains(errors).mean() > probability - 0.015  # three deviations of 4000 draws
    edge = np.zeros((n, m))
    edge[0, 0] = 1.0
    ball = idn.model.matrix_ellipsoid(P, probability, draws=draws)
    steps = np.arange(0.1, 20.0, 0.1)
    reach = [one.contains(steps[:, None, None] * edge).sum() for one in (found, ball)]
    assert reach[0] < 0.85 * reach[1]
    assert ball.bound <= spectral_radius(n, m, probability) * (1 + 1e-12)


def test_a_set_made_for_a_loop_excites_less_where_the_loop_does(models):
    wide = models[0].uncertain(0.95, OUTPUTS, INPUTS, draws=2000)
    loop = wide.feedback({("d_lat", "phi"): -0.3, ("d_ped", "r"): -0.02})
    tight = models[0].uncertain(0.95, OUTPUTS, INPUTS, draws=2000, tight_for=loop)
    again = tight.feedback({("d_lat", "phi"): -0.3, ("d_ped", "r"): -0.02})
    before, after = (
        np.linalg.eigvalsh(excited_directions(one))[-1] * one.bound**2 for one in (loop, again)
    )
    assert after < before


def test_a_set_says_what_its_flights_were_flown_in(models):
    source = models[0].uncertain(0.95, OUTPUTS, INPUTS, head_wind=(-1.0, 2.0)).source
    for name in CONDITIONS:
        assert f"{name}: unknown" in source
    assert "head wind of -1 to 2 m/s" in source


def test_sets_that_make_no_sense_are_refused(models):
    with pytest.raises(InputError, match="least, largest"):
        models[0].uncertain(0.95, OUTPUTS, INPUTS, head_wind=(2.0, 1.0))
    other = Vehicle(na=2, nb=1)
    model = other.model(other.record(400, seed=1))
    known = replace(
        model.aerodynamics,
        covariance=np.zeros((6, len(other.theta)) * 2),
        method="filter error",
        least_squares=False,
    )
    with pytest.raises(InputError, match="same structure"):
        models[0].uncertain(0.95, OUTPUTS, INPUTS, other=replace(model, aerodynamics=known))
    with pytest.raises(InputError, match="positive semidefinite"):
        idn.model.matrix_ellipsoid(np.eye(4).reshape(2, 2, 2, 2), 0.9, emphasis=-np.eye(2))
