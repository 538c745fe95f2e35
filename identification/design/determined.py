"""Coefficients that the data determine: one rule for a batch of regressors and for the factor of a
recursion.
"""

from __future__ import annotations

import numpy as np

from identification.design.tall_factors import triangular
from symheli.lpv.bases import FunctionSpace
from symheli.values.arrays import Array

PRIOR = 32.0
"""Prior information of a recursion without persistent excitation: this many eps samples, with a
regressor at its largest, of coefficient 0.
"""

MIN_INFORMATION_RATIO = 1000.0
"""Ratio of the information of the data to the prior above which a coefficient is determined."""


def determined(d: Array, energy: Array, fed: Array, beyond: float = MIN_INFORMATION_RATIO) -> Array:
    """Return the mask (n,) of the columns of a regressor matrix that are independent of those
    before.

    `d` (n,) is the squared distance of each column from that span (the squared diagonal of the
    triangular factor), `energy` (n,) its squared length, both by the weights of the samples; `fed`
    (n,) is what of `d` is only pretended. A column is determined where d exceeds eps energy (below,
    rounding decides: the distance is then 1.5e-8 of the length, in double precision) and `beyond`
    fed. Columns are taken in the order of the structure, so that of several that depend on each
    other the first ones are determined.

    The dtype of `d` says the precision. The same rule stands in rls.c, `is_known`.
    """
    return (d > np.finfo(d.dtype).eps * energy) & (d > beyond * fed)


def determined_columns(phi: Array, basis: FunctionSpace) -> Array:
    """The rule for a batch of regressors phi (m, n), signal after signal each times the functions
    of `basis`.

    As a recursion applies it that forgets nothing: samples weigh the same.
    """
    m, n = phi.shape
    size = largest(basis)
    signals = (np.abs(phi).max(axis=0, initial=0.0).reshape(-1, basis.size) / size).max(axis=1)
    peak = np.outer(signals, size).reshape(-1)
    scaled = phi / np.where(peak > 0, peak, 1.0)
    diagonal = np.diagonal(triangular(scaled)) if m else np.zeros(0)
    d = np.pad(diagonal**2, (0, n - len(diagonal)))
    return determined(d, np.sum(scaled**2, axis=0), PRIOR * np.finfo(float).eps * (peak > 0))


def largest(basis: FunctionSpace) -> Array:
    """Return the largest magnitude (n,) of each function of a basis, on a grid over its range; 1
    for one that is zero there.
    """
    points = 257 if basis.dimension == 1 else max(round(4096 ** (1 / basis.dimension)), 2)
    axes = np.meshgrid(
        *(np.linspace(low, high, points) for low, high in basis.ranges), indexing="ij"
    )
    values = (
        np.abs(basis(axes[0] if basis.dimension == 1 else np.stack(axes, axis=-1)))
        .reshape(-1, basis.size)
        .max(axis=0)
    )
    return np.where(values > 0, values, 1.0)
