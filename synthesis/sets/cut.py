"""A two-dimensional cut of an invariant set, with the limits there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.drawing import BLUE, GREY, RED, axes_of, label, plain
from symheli.values.signal import indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from synthesis.sets.invariant_set import InvariantSet

POINTS = 361
"""Points of the border."""
CLOSE = 0.99
"""Part of the largest share of a limit from which on a limit counts as binding too."""
ROOM = 1.3
"""Size of the picture over that of the cut."""


def plot_cut(
    found: InvariantSet, first: str, second: str, p: Sequence[float], ax: Axes | None
) -> Axes:
    """See `InvariantSet.cut`."""
    if not found.verified:
        raise InputError(f"there is no set to draw: {found.why}")
    i, j = indices([first, second], found.shape.states, "state")
    if i == j:
        raise InputError(f"expected two states, got {first} twice")
    P = np.linalg.inv(found.gramian(*p))[np.ix_([i, j], [i, j])]
    angle = np.linspace(0, 2 * np.pi, POINTS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    border = np.linalg.solve(np.linalg.cholesky(P).T, circle)
    ax = axes_of(ax, 5.0, 4.5)
    ax.fill(*border, color=BLUE, alpha=0.15)
    ax.plot(*border, color=BLUE)
    size = ROOM * np.abs(border).max(axis=1)
    ax.set_xlim(-size[0], size[0])
    ax.set_ylim(-size[1], size[1])
    seen = {
        limit.signal: (limit.bound, found.row(limit, *p)[[i, j]])
        for limit in found.statement.limits
    }
    reached = {name: np.abs(row @ border).max() / bound for name, (bound, row) in seen.items()}
    binding = [name for name, part in reached.items() if part > CLOSE * max(reached.values())]
    for name, (bound, row) in seen.items():
        _line(ax, row, bound, size, RED if name in binding else GREY)
    most = max(reached.values())
    ax.set_title(f"binds: {', '.join(binding)} ({most:.0%} of the limit)", fontsize="medium")
    ax.set_xlabel(label(found.shape.states[i]))
    ax.set_ylabel(label(found.shape.states[j]))
    return plain(ax)


def _line(ax: Axes, row: np.ndarray, bound: float, size: np.ndarray, colour: str) -> None:
    """Draw row x = +-bound across the picture; nothing where the limit does not see the cut."""
    if not np.any(row):
        return
    normal = row / (row @ row)
    along = np.array([-row[1], row[0]]) / np.hypot(*row) * 4 * np.hypot(*size)
    for side in (-bound, bound):
        ends = np.stack([side * normal - along, side * normal + along])
        ax.plot(*ends.T, color=colour, linewidth=1.0, scalex=False, scaley=False)
