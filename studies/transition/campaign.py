"""The pass marks over many seeds: median and worst."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies.campaigns.campaign import Campaign
from studies.campaigns.run import columns_of
from studies.campaigns.runners import Runner
from studies.campaigns.trials import marks
from studies.output import columns
from studies.setup.accelerating_baseline import ALONE, BOTH, MARKS, SCATTER
from studies.setup.axes import AXES
from studies.setup.axis_models import FROZEN_SPEEDS
from studies.setup.flights import NOISES
from studies.setup.quantities import value

MODE_MARK = 3.0
"""Percent by which a noise-free frozen rotor mode may miss the exact one."""


@dataclass(frozen=True)
class Row:
    """One quantity over the seeds, in percent; `mark` is the pass mark (None: shown only),
    `largest` whether it bounds from above.

    Every value has to meet the mark. With `scatter` the median has to, and every value a mark that
    is so many points easier.
    """

    name: str
    values: np.ndarray
    mark: float | None
    largest: bool = False
    scatter: float | None = None

    @property
    def worst(self) -> float:
        """The value nearest to failing."""
        return float(self.values.max() if self.largest else self.values.min())

    @property
    def median(self) -> float:
        """The value in the middle."""
        return float(np.median(self.values))

    @property
    def passed(self) -> bool:
        """The worst value meets the mark; with scatter the median does, and the worst nearly."""
        if self.mark is None:
            return True
        sign = -1.0 if self.largest else 1.0
        short = sign * (self.mark - self.worst)  # points by which the worst misses
        if self.scatter is None:
            return short <= 0
        return short <= self.scatter and sign * (self.mark - self.median) <= 0

    @property
    def words(self) -> tuple[str, str]:
        """The mark as the table shows it, and whether it is missed."""
        if self.mark is None:
            return "", ""
        easier = "" if self.scatter is None else f", each within {self.scatter:g}"
        sign = "<=" if self.largest else ">="
        return f"{sign} {self.mark:.0f}{easier}", "" if self.passed else "MISSED"


@dataclass(frozen=True)
class MarksOverSeeds:
    """The rows over all seeds; the first value of each is the default seed's."""

    rows: tuple[Row, ...]
    seeds: int

    @property
    def passed(self) -> bool:
        """Every row meets its mark."""
        return all(row.passed for row in self.rows)

    def summary(self) -> str:
        """A table: default seed, median, worst, mark."""
        head = f"percent, over {self.seeds} seeds and the default one"
        rows = [["", "default", "median", "worst", "mark", ""]]
        for r in self.rows:
            numbers = r.values[0], r.median, r.worst
            rows.append([r.name, *(f"{number:.2f}" for number in numbers), *r.words])
        return f"{head}\n{columns(rows)}"

    def to_dict(self) -> dict[str, Any]:
        """Every value with its unit."""
        return {
            r.name: {
                "values": {"value": r.values.tolist(), "unit": "%"},
                "median": value(r.median, "%"),
                "worst": value(r.worst, "%"),
                "mark": None if r.mark is None else value(r.mark, "%"),
                "scatter": None if r.scatter is None else value(r.scatter, "%"),
                "passed": r.passed,
            }
            for r in self.rows
        }


def run_campaign(
    seeds: int = 20,
    vehicle: str = "xcell60",
    *,
    on: Runner,
    path: Path | None = None,
) -> MarksOverSeeds:
    """Simulate, identify and validate with the default seed and `seeds` others (new schedules,
    excitation and noise each); a case is a seed, stored in the dataset at `path` and computed only
    once.
    """
    campaign = Campaign(marks.TRIAL, grid={"seed": range(seeds + 1)}, fixed={"vehicle": vehicle})
    return MarksOverSeeds(tuple(_rows(columns_of(campaign, on, path))), seeds)


def _rows(found: Mapping[str, np.ndarray]) -> Iterator[Row]:
    for noisy, noise in enumerate(NOISES):
        for axis in AXES:
            for output, limits in axis.marks.items():
                name = marks.ahead(axis, output, noise)
                yield Row(name, found[name], limits[noisy])
            for name in () if noisy else (marks.of_mode(axis, v) for v in FROZEN_SPEEDS):
                yield Row(name, found[name], MODE_MARK, largest=True)
    for model, limits, scatter in ((BOTH, MARKS, SCATTER), (ALONE, {}, None)):
        for output in MARKS:
            name = marks.of_baseline(model, output)
            yield Row(name, found[name], limits.get(output), scatter=scatter)
