"""The air: the tabulated atmosphere, gusts of the asked shape, turbulence with the spectra it
promises.
"""

import numpy as np
import pytest

from symheli.environment import Dryden, Gust, Wind, standard_atmosphere
from symheli.errors import InputError

# U.S. Standard Atmosphere 1976, table 1, by geometric altitude: temperature K, pressure Pa, density
# kg/m^3 (as many digits as printed)
TABLE = {
    -1000: (294.651, 1.1393e5, 1.3470),
    0: (288.150, 1.01325e5, 1.2250),
    1000: (281.651, 8.9876e4, 1.1117),
    5000: (255.676, 5.4048e4, 7.3643e-1),
    10000: (223.252, 2.6500e4, 4.1351e-1),
    15000: (216.650, 1.2112e4, 1.9476e-1),
    20000: (216.650, 5.5293e3, 8.8910e-2),
}


@pytest.mark.parametrize("altitude", TABLE)
def test_the_atmosphere_is_the_tabulated_one(altitude):
    air = standard_atmosphere(altitude)
    np.testing.assert_allclose(
        air[:3], TABLE[altitude], rtol=5e-5
    )  # half of the fifth printed digit


def test_warmer_air_is_thinner_at_the_same_pressure():
    standard, warm = standard_atmosphere(1500), standard_atmosphere(1500, warmer=20)
    assert warm.pressure == standard.pressure
    assert warm.density == pytest.approx(
        standard.density * standard.temperature / (standard.temperature + 20)
    )


@pytest.mark.parametrize(
    ("altitude", "said"),
    [(float("nan"), "finite number of m"), (-3000.0, "feet times"), (65000.0, "feet times")],
)
def test_altitudes_beyond_the_model_are_refused(altitude, said):
    with pytest.raises(InputError, match=said):
        standard_atmosphere(altitude)


def test_a_gust_rises_and_falls_as_one_minus_cosine():
    gust = Gust.over(gradient=10.0, airspeed=5.0, peak=(0.0, 0.0, -3.0), start=1.0)
    assert gust.duration == 4.0
    speeds = gust([0.9, 1.0, 2.0, 3.0, 4.0, 5.0, 5.1])
    np.testing.assert_allclose(speeds[:, 2], [0, 0, -1.5, -3.0, -1.5, 0, 0], atol=1e-15)
    assert not speeds[:, :2].any()


@pytest.mark.slow(but="12.0")
@pytest.mark.parametrize("airspeed", [3.0, 12.0])
def test_the_variance_under_dryden_spectra_is_that_of_the_intensities(airspeed):
    air = Dryden(wind=15.0, altitude=30.0)
    omega = np.linspace(0, 4000.0, 2_000_001)
    area = np.trapezoid(air.spectrum(omega, airspeed), omega, axis=1)
    np.testing.assert_allclose(area, air.intensities**2, rtol=2e-3)  # what lies beyond 4000 rad/s


def test_turbulence_has_its_intensity_correlation_and_spectrum():
    air, dt, speed, n = Dryden(wind=15.0, altitude=30.0), 0.2, 10.0, 100_000
    history = air.history(dt * np.arange(n), speed, seed=3)
    # the relative standard error of a variance is sqrt(2/independent samples), about 2 L/V apart: 3
    # % here
    np.testing.assert_allclose(history.std(axis=0), air.intensities, rtol=0.08)
    frequency = 2 * np.pi * np.fft.rfftfreq(2000, dt)
    density = (
        (np.abs(np.fft.rfft(history.reshape(50, 2000, 3), axis=1)) ** 2).mean(axis=0).T
        * dt
        / (2000 * np.pi)
    )
    band = (frequency > 0.05) & (
        frequency < 2.0
    )  # below the aliases, above the leakage of the mean
    ratio = (density[:, band] / air.spectrum(frequency[band], speed)).mean(axis=1)
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)
    lag = round(air.lengths[0] / speed / dt)
    along = history[:, 0]
    assert np.mean(along[lag:] * along[:-lag]) / along.var() == pytest.approx(
        np.exp(-lag * dt * speed / air.lengths[0]), abs=0.08
    )


@pytest.mark.slow
def test_one_step_and_many_small_ones_have_the_same_covariance():
    """Exact in distance: the correlation over 4 m does not depend on how many samples lie
    between.
    """
    from symheli.environment.turbulence import _second_order

    rng = np.random.default_rng(0)
    ends = np.array(
        [_second_order(np.full(8, 0.1), w)[[0, -1]] for w in rng.standard_normal((5_000, 9, 2))]
    )
    once = np.array(
        [_second_order(np.array([0.8]), w)[[0, -1]] for w in rng.standard_normal((5_000, 2, 2))]
    )
    exact = np.exp(-0.8) * (
        1 - 0.8 / 2
    )  # of (1 + 12 (L W)^2)/(1 + 4 (L W)^2)^2: exp(-x)(1 - x/2), x = distance/(2 L)
    for pairs in (ends, once):
        assert pairs.var(axis=0) == pytest.approx([1, 1], abs=0.08)  # 4 standard errors
        assert np.mean(pairs[:, 0] * pairs[:, 1]) == pytest.approx(exact, abs=0.08)


def test_turbulence_is_frozen_in_the_air_and_follows_its_seed():
    air, time = Dryden(wind=10.0, altitude=20.0), np.arange(0, 10, 0.02)
    hover = air.history(time, 0.0, seed=1)
    assert np.all(hover == hover[0])
    np.testing.assert_array_equal(air.history(time, 5.0, seed=2), air.history(time, 5.0, seed=2))
    assert not np.array_equal(air.history(time, 5.0, seed=2), air.history(time, 5.0, seed=3))
    # the same distances; the small variance of a short step is a difference of large ones, good to
    # 1e-7
    np.testing.assert_allclose(
        air.history(time, 5.0, seed=2), air.history(time / 5, 25.0, seed=2), atol=1e-7
    )


def test_the_lengths_and_intensities_are_those_of_the_handbook():
    air = Dryden(wind=10.0, altitude=1000 * 0.3048)  # at 1000 ft c = 1: isotropic, L_u = h
    np.testing.assert_allclose(air.intensities, [1, 1, 1])
    np.testing.assert_allclose(air.lengths, [304.8, 152.4, 152.4])


def test_wind_adds_its_parts():
    time = np.arange(0, 5, 0.5)
    gust, turbulence = Gust((1.0, 0.0, 0.0), 1.0, 2.0), Dryden(8.0, 20.0)
    wind = Wind((-3.0, 1.0, 0.0), (gust,), turbulence, seed=4)
    np.testing.assert_allclose(
        wind.history(time, 6.0),
        np.array([-3.0, 1.0, 0.0]) + gust(time) + turbulence.history(time, 6.0, 4),
    )
    assert Wind((1.0, 0.0, 0.0)).is_steady
    assert not wind.is_steady


@pytest.mark.parametrize(
    "make",
    [
        lambda: Dryden(5.0, 2.0),
        lambda: Dryden(-1.0, 20.0),
        lambda: Gust((0, 0, 1), 0.0, 0.0),
        lambda: Gust((0, float("nan"), 1), 0.0, 1.0),
        lambda: Gust.over(10.0, 0.0, (0, 0, 1), 0.0),
        lambda: Wind((float("inf"), 0, 0)),
        lambda: Dryden(5.0, 20.0).history([0, 0], 1.0),
        lambda: Dryden(5.0, 20.0).history([0, 1], -1.0),
        lambda: Dryden(5.0, 20.0).spectrum([1.0], 0.0),
    ],
)
def test_nonsense_is_refused(make):
    with pytest.raises(InputError):
        make()
