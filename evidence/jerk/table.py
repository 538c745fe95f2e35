"""The gains as the documentation shows them: one row an acceleration, in Markdown."""

from __future__ import annotations

import math

from evidence.jerk.gains import Cell, Loop


def jerk_table(loop: Loop) -> str:
    """Proven gain of every acceleration and jerk, the flown one in brackets, beside P(V)."""
    cells = {(c.acceleration, c.jerk): c for c in loop.cells}
    jerks = sorted({jerk for _, jerk in cells})
    heads = [
        "acceleration, m/s²",
        *(f"jerk {jerk:g} m/s³" if math.isfinite(jerk) else "any jerk" for jerk in jerks),
        "P(V), same knots",
        "P(V), knots chosen",
    ]
    lines = [heads, ["---"] * len(heads)]
    for a in sorted({a for a, _ in cells}):
        lines.append(
            [
                f"{a:g}",
                *(_cell(cells[a, jerk]) if (a, jerk) in cells else "" for jerk in jerks),
                _gain(loop.same_knots[a], "nothing"),
                _gain(loop.chosen_knots[a], "nothing"),
            ]
        )
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(cell: Cell) -> str:
    return f"{_gain(cell.proven, 'nothing')} ({_gain(cell.flown, 'grows')})"


def _gain(value: float, infinite: str) -> str:
    return infinite if math.isinf(value) else f"{value:#.4g}".rstrip(".")
