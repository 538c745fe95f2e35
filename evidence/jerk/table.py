"""The gains as the documentation shows them: one row an acceleration, in Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping

from evidence.jerk.flown import Fastest
from evidence.jerk.gains import Cell, Loop
from evidence.tables import markdown


def jerk_table(loop: Loop) -> str:
    """Proven gain of every acceleration and jerk, the lower bound in brackets, beside P(V)."""
    cells = {(c.acceleration, c.jerk): c for c in loop.cells}
    jerks = sorted({jerk for _, jerk in cells})
    heads = [
        "acceleration, m/s²",
        *(f"jerk {jerk:g} m/s³" if math.isfinite(jerk) else "any jerk" for jerk in jerks),
        "P(V), same knots",
        "P(V), knots chosen",
    ]
    rows = [
        [
            f"{a:g}",
            *(_cell(cells[a, jerk]) if (a, jerk) in cells else "" for jerk in jerks),
            _gain(loop.same_knots[a], "nothing"),
            _gain(loop.chosen_knots[a], "nothing"),
        ]
        for a in sorted({a for a, _ in cells})
    ]
    return markdown(heads, rows)


def table_of_flights(flown: Mapping[str, Fastest]) -> str:
    """How fast the airspeed of each flight changes."""
    return markdown(
        ["flight", "largest \\|dV/dt\\|, m/s²", "largest \\|d²V/dt²\\|, m/s³"],
        ([name, f"{f.acceleration:.2f}", f"{f.jerk:.2f}"] for name, f in flown.items()),
    )


def _cell(cell: Cell) -> str:
    return f"{_gain(cell.proven, 'nothing')} ({_gain(cell.lower, 'grows')})"


def _gain(value: float, infinite: str) -> str:
    # three digits: the fourth depends on the processor
    return infinite if math.isinf(value) else f"{value:#.3g}".rstrip(".")
