"""Many nu-gaps at once are those of `nu_gap`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv import nu_gap
from symheli.lpv.tools import LinearModels, nu_gaps
from symheli.values import signals

SCALES = {"input_scale": np.array([0.5, 2.0]), "output_scale": np.array([1.0, 0.2, 3.0])}


def plant(radius, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((5, 5))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    names = [
        signals([f"{kind}{i}" for i in range(n)]) for kind, n in zip("xuy", (5, 2, 3), strict=True)
    ]
    B, C = rng.standard_normal((5, 2)), rng.standard_normal((3, 5))
    return LinearModel(A, B, C, np.zeros((3, 2)), *names, dt=0.02)


def around(model, size, count=20):
    rng = np.random.default_rng(7)
    return LinearModels.of(
        [replace(model, A=model.A + size * rng.standard_normal((5, 5))) for _ in range(count)]
    )


@pytest.mark.slow(only=("0.3-0.9", "0.3-0.9995", "0.3-1.02"))
@pytest.mark.parametrize("radius", [0.9, 0.9995, 1.02])
@pytest.mark.parametrize("size", [1e-4, 1e-2, 0.3])
def test_each_is_the_nu_gap_of_the_pair(radius, size):
    """Poles that cross the circle and gaps of 1 among them. On other frequencies than `nu_gap`'s:
    what lies between two of either is below a percent.
    """
    model = plant(radius)
    others = around(model, size)
    expected = [nu_gap(model, other, **SCALES) for other in others]
    np.testing.assert_allclose(nu_gaps(model, others, **SCALES), expected, rtol=1e-2, atol=1e-7)


def test_gaps_of_one_are_among_them():
    model = plant(0.9)
    found = nu_gaps(model, around(model, 0.3), **SCALES)
    assert np.any(found == 1.0)
    assert np.any(found < 1.0)


def test_models_that_cannot_be_compared_are_refused():
    model = plant(0.9)
    others = around(model, 0.01, 2)
    with pytest.raises(InputError, match="sample period"):
        nu_gaps(model, replace(others, dt=None))
    with pytest.raises(InputError, match="same inputs"):
        nu_gaps(model, others.select(outputs=["y1", "y0", "y2"]))
