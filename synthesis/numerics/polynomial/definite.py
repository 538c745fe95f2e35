"""Negative definiteness of a polynomial matrix on its whole box, by Bernstein coefficients, halving
the box where they are inconclusive.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import integers, nearest, positive_definite
from synthesis.numerics.polynomial.matrix import PolynomialMatrix

MAX_BOXES = 4000
"""Largest number of boxes examined; beyond it the answer is "not shown"."""


def negative_definite(F: PolynomialMatrix, cells: int = MAX_BOXES) -> bool:
    """Check in floating point, all boxes of a generation at once; False also where `cells` boxes
    were not enough.
    """
    m, spent = len(F.box), 0
    waiting = F.coefficients[None]
    while len(waiting):
        spent += len(waiting)
        if spent > cells or not np.all(np.isfinite(waiting)):
            return False
        flat = waiting.reshape(len(waiting), -1, *waiting.shape[-2:])
        values = np.linalg.eigvalsh(flat)
        limit = -20 * F.shape[0] * np.finfo(float).eps * np.abs(values).max(axis=2)
        below = values[..., -1] < limit
        if not np.all(
            below.reshape(len(waiting), *waiting.shape[1 : m + 1])[
                (slice(None), *_corners(waiting.shape[1 : m + 1]))
            ]
        ):
            return False
        waiting = waiting[~below.all(axis=1)]
        if len(waiting):
            waiting = _halves(waiting, m)
    return True


def negative_definite_exactly(F: PolynomialMatrix, cells: int = MAX_BOXES) -> bool:
    """Check in exact arithmetic, of coefficients that are rationals; only their lower triangles are
    read.
    """
    return first_miss(F, cells) is None


class Miss(NamedTuple):
    """A `point` where a matrix is not negative definite or, not `certain`, was not shown to be."""

    point: tuple[Any, ...]
    certain: bool


def first_miss(F: PolynomialMatrix, cells: int = MAX_BOXES) -> Miss | None:
    """Return where F is not negative definite, in exact arithmetic; None: nowhere on its box."""
    m, spent = len(F.box), 0
    # a positive factor changes nothing, and integers are halved without divisions
    waiting = [(integers(-F.coefficients), F.box)]
    while waiting:
        spent += 1
        G, box = waiting.pop()
        middle = tuple((a + b) / 2 for a, b in box)
        if spent > cells:
            return Miss(middle, False)
        numbers = nearest(G)
        # a check in floating point that fails saves the exact one
        promising = bool(np.all(np.linalg.eigvalsh(_normalised(numbers))[..., 0] > 0))
        if promising and positive_definite(G):
            continue
        for corner in product((0, -1), repeat=m):
            if not positive_definite(G[corner]):
                return Miss(tuple(box[i][k] for i, k in enumerate(corner)), True)
        if max(G.shape[:m], default=1) <= 2:
            continue  # every coefficient is a value at a corner
        curvature = _curvature(numbers[None], m)[0]
        if curvature.max() == 0.0:
            return Miss(middle, False)
        axis = int(np.argmax(curvature))
        (a, b), c = box[axis], middle[axis]
        for part, ends in zip(_bisect(G, axis), ((a, c), (c, b)), strict=True):
            waiting.append((part, (*box[:axis], ends, *box[axis + 1 :])))
    return None


def _normalised(F: Array) -> Array:
    """Return matrices (..., n, n) scaled to a diagonal of -1 where it is negative, so that rounding
    does not depend on units.
    """
    size = np.sqrt(np.abs(np.diagonal(F, axis1=-2, axis2=-1)))
    size = np.where(size > 0, size, 1.0)
    return F / size[..., :, None] / size[..., None, :]


def _corners(shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(None, None, max(n - 1, 1)) for n in shape)


def _curvature(c: Array, m: int) -> Array:
    """Return the deviation (boxes, m) of the coefficients from an affine function along each
    parameter, which halving reduces.
    """
    out = np.zeros((len(c), m))
    for i in range(m):
        if c.shape[i + 1] > 2:
            out[:, i] = np.abs(np.diff(c, n=2, axis=i + 1)).reshape(len(c), -1).max(axis=1)
    return out


def _halves(c: Array, m: int) -> Array:
    """Return both halves of every box, along the axis in which the coefficients are most curved."""
    curvature = _curvature(c, m)
    best = np.argmax(curvature, axis=1)
    out = []
    for axis in range(m):
        own = c[(best == axis)]
        if len(own):
            out += _bisect(own, axis + 1)
    return np.concatenate(out)


def _bisect(c: Array, axis: int) -> list[Array]:
    """Apply de Casteljau's algorithm at the middle of one axis. Of integers the coefficients are
    those of a polynomial 2^degree times as large, so that they stay integers.
    """
    row = np.moveaxis(c, axis, 0)
    degree, whole = len(row) - 1, c.dtype == object
    left, right = [], []
    for k in range(degree + 1):
        factor = 2 ** (degree - k) if whole else 0.5**k
        left.append(row[0] * factor)
        right.append(row[-1] * factor)
        row = row[1:] + row[:-1]
    return [np.moveaxis(np.stack(part), 0, axis) for part in (left, right[::-1])]
