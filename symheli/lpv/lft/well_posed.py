"""Is the parameter loop invertible everywhere in the box?"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from symheli.lpv.lft.model import LFT
from symheli.values.arrays import Array


class WellPosedness(NamedTuple):
    """`holds`: I - M11 Delta is invertible in the whole box (True: proven in floating point),
    False: it is singular at `where` {parameter: physical value}, None: not decided within the cells
    allowed, nearest trouble at `where`.
    """

    holds: bool | None
    where: dict[str, float]


def well_posed(lft: LFT, boxes: int) -> WellPosedness:
    """Bisect the box until every cell is proven, or one is found where the determinant changes
    sign.

    About the middle c of a cell with half-widths r, I - M11 Delta is invertible where the Perron
    root of
    |(I - M11 C)^-1 M11| R is below one.
    """
    m, sizes = len(lft.blocks), lft.sizes
    sign = np.linalg.slogdet(np.eye(lft.order))[0]
    cells = [(np.zeros(m), np.ones(m))]
    for _ in range(boxes):
        if not cells:
            return WellPosedness(True, {})
        middle, half = cells.pop(0)
        corners = [
            middle,
            *(middle + half * np.array(signs) for signs in product((-1.0, 1.0), repeat=m)),
        ]
        for delta in corners:
            here = np.linalg.slogdet(np.eye(lft.order) - lft.M11 * np.repeat(delta, sizes))[0]
            if here != sign:
                return WellPosedness(False, _physical(lft, _crossing(lft, delta, sizes)))
        reach = _perron(lft, np.repeat(middle, sizes), np.repeat(half, sizes))
        if reach < 1 - 1e-9:
            continue
        widest = int(np.argmax(half))
        step = np.zeros(m)
        step[widest] = half[widest] / 2
        smaller = half.copy()
        smaller[widest] /= 2
        cells += [(middle - step, smaller), (middle + step, smaller)]
    return WellPosedness(None, _physical(lft, cells[0][0])) if cells else WellPosedness(True, {})


def _perron(lft: LFT, middle: Array, half: Array) -> float:
    try:
        E = np.linalg.solve(np.eye(lft.order) - lft.M11 * middle, lft.M11)
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.abs(np.linalg.eigvals(np.abs(E) * half)).max(initial=0.0))


def _crossing(lft: LFT, delta: Array, sizes: tuple[int, ...]) -> Array:
    """Return the point at which the determinant changes sign on the way from the middle of the box
    to delta.
    """
    low, high = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (low + high)
        positive = (
            np.linalg.slogdet(np.eye(lft.order) - lft.M11 * np.repeat(t * delta, sizes))[0] > 0
        )
        low, high = (t, high) if positive else (low, t)
    return high * delta


def _physical(lft: LFT, delta: Array) -> dict[str, float]:
    return {
        s.name: float(s.middle + s.radius * d) for s, d in zip(lft.parameters, delta, strict=True)
    }
