"""The bracket as the documentation shows it: one row an acceleration, in Markdown."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from evidence.tables import four_digits, markdown

COLUMNS = {
    "lower": "lower bound",
    "memory": "proven, P(p, lag)",
    "plain": "proven, P(p)",
    "covered": "covered, P(p)",
}


def bracket_table(found: Mapping[str, Any]) -> str:
    """Of what `evidence.bracket.measured.measure` yields: gains, stability where no gain was asked
    for, growth.
    """
    gains = {row["rate"]: row for what, row in found.items() if what.startswith("gain at")}
    shown = [
        key
        for key in COLUMNS
        if key != "covered" or any(math.isfinite(row[key]) for row in gains.values())
    ]
    rows: dict[float, dict[str, str]] = {
        rate: {key: _gain(row[key]) for key in shown} for rate, row in gains.items()
    }
    for what, result in found.items():
        if match := re.fullmatch(r"growth at ([\d.]+) m/s\^2", what):
            growth = (
                f"grows, {result:.6g} a cycle" if isinstance(result, float) else "no growth found"
            )
            rows.setdefault(float(match[1]), {})["lower"] = growth
        elif match := re.fullmatch(r"stable at ([\d.]+) m/s\^2 by (.*)", what):
            key = next(
                (key for key, title in COLUMNS.items() if title == f"proven, {match[2]}"), ""
            )
            if key and float(match[1]) not in gains:
                rows.setdefault(float(match[1]), {})[key] = "stable" if result else "nothing"
    return markdown(
        ["acceleration, m/s²", *(COLUMNS[key] for key in shown)],
        ([f"{rate:g}", *(rows[rate].get(key, "") for key in shown)] for rate in sorted(rows)),
    )


def _gain(value: float) -> str:
    return "" if math.isnan(value) else "nothing" if math.isinf(value) else four_digits(value)
