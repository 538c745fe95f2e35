"""A criterion: a value beside its threshold, and whether it is met; tables of criteria."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from symheli.values.aligned import columns

Verdict = Literal["fit", "not fit", "not known"]

PRINTED: dict[Verdict, str] = {"fit": "met", "not fit": "violated", "not known": "not known"}
"""The verdict on one criterion as it is printed."""


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One criterion of a verdict, a row of its table; `str()` is a sentence.

    Parameters
    ----------
    name : str
        What is judged.
    value, threshold : float
        In the unit of the name; NaN where the data give no value.
    verdict : {"fit", "not fit", "not known"}
        "fit" where the criterion is met, "not fit" where it is violated, "not known" where the data
        say too little for either.
    source : str
        Of the threshold.
    where : str
        At which point or signal the value was found, or why there is none.
    truth : float, optional
        The same against the true models, where they were given.
    decides : bool
        Whether the verdict of the whole asks for it; otherwise it informs.
    sense : {"at most", "at least"}
        On which side of the threshold the value has to be.

    Examples
    --------
    >>> row = idn.judge.Criterion(
    ...     name="TIC", value=0.1, threshold=0.25, verdict="fit", source="book")
    >>> row.verdict
    'fit'
    >>> print(row)
    TIC is 0.1, at most 0.25: met
    """

    name: str
    value: float
    threshold: float
    verdict: Verdict
    source: str = ""
    where: str = ""
    truth: float | None = None
    decides: bool = True
    sense: Literal["at most", "at least"] = "at most"

    @property
    def limit(self) -> str:
        """The threshold in words."""
        return f"{self.sense} {_number(self.threshold)}"

    def __str__(self) -> str:
        value = "has no value" if np.isnan(self.value) else f"is {_number(self.value)}"
        where = f" ({self.where})" if self.where else ""
        return f"{self.name} {value}, {self.limit}{where}: {PRINTED[self.verdict]}"


def judged(
    name: str, value: float, threshold: float, otherwise: Verdict = "not fit", **more: Any
) -> Criterion:
    """The criterion that is "fit" on its side of the threshold, `otherwise` beyond, and "not known"
    for NaN; `more`: its other fields.
    """
    met = value >= threshold if more.get("sense") == "at least" else value <= threshold
    verdict: Verdict = "not known" if np.isnan(value) else "fit" if met else otherwise
    return Criterion(name=name, value=value, threshold=threshold, verdict=verdict, **more)


def missed(criteria: Iterable[Criterion]) -> tuple[str, ...]:
    """A sentence for each criterion that decides and is not "fit"."""
    return tuple(str(row) for row in criteria if row.decides and row.verdict != "fit")


def verdict_of(criteria: Iterable[Criterion]) -> Verdict:
    """The worst of those that decide: one "not fit", then one "not known"."""
    found = {row.verdict for row in criteria if row.decides}
    return "not fit" if "not fit" in found else "not known" if "not known" in found else "fit"


def table(criteria: Iterable[Criterion], indent: str = "") -> str:
    """One line a criterion, under a head; columns without an entry are left out, and a verdict that
    only informs stands in brackets.
    """
    cells = [
        {
            "criterion": row.name,
            "value": _number(row.value),
            "threshold": row.limit,
            "truth": "" if row.truth is None else _number(row.truth),
            "verdict": PRINTED[row.verdict] if row.decides else f"({PRINTED[row.verdict]})",
            "where": row.where,
            "source": row.source,
        }
        for row in criteria
    ]
    head = [name for name in cells[0] if any(row[name] for row in cells)] if cells else []
    rows = columns([head, *([row[name] for name in head] for row in cells)], left=len(head))
    return textwrap.indent(rows, indent)


def concluded(criteria: Sequence[Criterion]) -> str:
    """The table, and the verdict of the whole below it."""
    return f"{table(criteria)}\nverdict: {verdict_of(criteria)}"


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else "-" if np.isnan(value) else f"{value:.3g}"
