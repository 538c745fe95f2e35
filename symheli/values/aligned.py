"""Tables as plain text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from symheli.values.signal import Signal


def columns(rows: list[list[str]], left: int = 1, gap: str = "  ") -> str:
    """Rows of text as aligned columns, the first `left` flush left, the others flush right."""
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(max(map(len, rows)))]
    lines = (
        gap.join(
            c.ljust(w) if i < left else c.rjust(w)
            for i, (c, w) in enumerate(zip(row, widths, strict=False))
        )
        for row in rows
    )
    return "\n".join(line.rstrip() for line in lines)


def matrix(values: np.ndarray, rows: Sequence[Signal], of: Sequence[Signal]) -> str:
    """A matrix with the names of its rows and columns."""
    lines = zip(rows, values + 0.0, strict=True)  # no -0
    body = [[str(r), *(f"{v:.5g}" for v in line)] for r, line in lines]
    return columns([["", *map(str, of)], *body])


def vector(values: np.ndarray, names: Sequence[Signal]) -> list[list[str]]:
    """A row a signal: its name, value and unit, angles in degrees too."""
    return [
        [str(s), f"{v:.6g}", s.unit, _degrees(float(v), s.unit)]
        for s, v in zip(names, values, strict=True)
    ]


def _degrees(value: float, unit: str) -> str:
    if unit not in ("rad", "rad/s"):
        return ""
    return f"{math.degrees(value):.3f} {unit.replace('rad', 'deg')}"
