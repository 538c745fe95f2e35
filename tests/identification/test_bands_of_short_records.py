"""Bands of short records with coloured residuals hold the truth about as often as they say:
repeated experiments, counted.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification import LPVARX, Polynomial, fit, uncertainty
from symheli.records import FlightRecord

ARX = LPVARX("y", "u", "p", na=0, nb=1, delay=1, basis=Polynomial(1, 0.0, 13.0), offset=True)
P = np.array([2.0, 6.5, 11.0])
EXPERIMENTS = 200


def experiment(samples, noise, slow, seed):
    """y = (1 + 0.1 p) u(k-1) + 0.3 + 0.02 p + e, e and u of first order with these poles."""
    rng = np.random.default_rng(seed)
    u, e = (
        lfilter([1.0], [1.0, -pole], rng.standard_normal(samples + 200))[200:]
        for pole in (slow, noise)
    )
    p = 6.5 + 6 * np.sin(6 * np.pi * np.arange(samples) / samples)
    y = 0.5 * np.sqrt(1 - noise**2) * e
    y[1:] += (1 + 0.1 * p[:-1]) * u[:-1] / u.std() + 0.3 + 0.02 * p[:-1]
    return FlightRecord.from_arrays(
        0.05 * np.arange(samples), dict.fromkeys("yup", "1"), y=y, u=u / u.std(), p=p
    )


def coverage(samples, noise, slow, experiments=EXPERIMENTS):
    """How often 95 % bands hold the input's coefficient and the offset, over experiments and three
    p.
    """
    held = []
    for seed in range(experiments):
        record = experiment(samples, noise, slow, seed)
        bands = uncertainty(fit(ARX, record), record).bands(P)
        for band, truth in zip(bands, (1 + 0.1 * P, 0.3 + 0.02 * P), strict=True):
            low, high = band.interval(0.95)
            held.append(np.mean((low <= truth) & (truth <= high)))
    return np.array(held).reshape(experiments, 2).mean(axis=0)


def test_a_short_coloured_record_is_not_too_sure_of_itself():
    """Normal bands of the same standard errors hold 80 %; 60 experiments are known to 3 %."""
    assert coverage(300, 0.8, 0.8, 60).min() > 0.88


@pytest.mark.slow
@pytest.mark.parametrize(
    ("samples", "noise", "slow", "least"),
    [
        (150, 0.8, 0.8, 0.90),
        (1000, 0.0, 0.0, 0.93),
    ],
)
def test_bands_hold_the_truth_as_often_as_the_guide_says(samples, noise, slow, least):
    """Two rows of the table of docs/identification.md. Each share is known to about 2 %."""
    held = coverage(samples, noise, slow)
    print(
        f"\n{samples:5d} samples, noise {noise:4.2f}, input {slow:4.2f}: coefficient"
        f" {100 * held[0]:.0f} %, offset {100 * held[1]:.0f} %"
    )
    assert held.min() > least
