"""The pass marks over many seeds: median and worst."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.transition import accelerating_baseline, axes
from studies.transition.accelerating_baseline import BOTH, MARKS, SCATTER
from studies.transition.axes import AXES
from studies.transition.flights import NOISE_DB, FlightPlan, autopilot_for
from studies.transition.quantities import value
from symheli import Helicopter

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
    def said(self) -> str:
        """The mark as the table shows it."""
        if self.mark is None:
            return ""
        sign = "<=" if self.largest else ">="
        easier = "" if self.scatter is None else f", each within {self.scatter:g}"
        return f"{sign:>4s}{self.mark:5.0f}{easier}{'' if self.passed else '   MISSED'}"


@dataclass(frozen=True)
class Campaign:
    """The rows of a campaign; the first value of each is the default seed's."""

    rows: tuple[Row, ...]
    seeds: int

    @property
    def passed(self) -> bool:
        """Every row meets its mark."""
        return all(row.passed for row in self.rows)

    def summary(self) -> str:
        """A table: default seed, median, worst, mark."""
        lines = [
            f"{'':58s}{'default':>9s}{'median':>9s}{'worst':>9s}{'mark':>9s}   over {self.seeds}"
            " seeds and the default one, percent"
        ]
        for r in self.rows:
            line = f"{r.name:58s}{r.values[0]:9.2f}{r.median:9.2f}{r.worst:9.2f}{r.said}"
            lines.append(line)
        return "\n".join(lines)

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


def run_campaign(seeds: int = 20, vehicle: str = "xcell60") -> Campaign:
    """Fly, identify and judge with the default seed and `seeds` others (new schedules, excitation
    and noise each).
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    autopilot = autopilot_for(heli)
    collected: dict[tuple[str, float, bool], list[float]] = {}
    rivals = accelerating_baseline.baselines(heli)
    predicted: dict[tuple[str, str], list[float]] = {}
    for seed in range(seeds + 1):
        for noise_db in (None, NOISE_DB):
            plan = FlightPlan(seed, noise_db=noise_db)
            training, test = plan.training(heli, autopilot), plan.test(heli, autopilot)
            if noise_db is None:
                for key, fit in accelerating_baseline.fits(rivals, test).items():
                    predicted.setdefault(key, []).append(fit)
            for axis in AXES:
                result = axes.judged(heli, axis, axes.identify(axis, training, "ls"), test)
                label = "noise-free" if noise_db is None else f"{noise_db:g} dB"
                for output, marks in axis.marks.items():
                    key = (
                        f"{output}, 1 s ahead, {label} ({axis.name})",
                        marks[noise_db is not None],
                        False,
                    )
                    collected.setdefault(key, []).append(result.scores.ahead[output])
                if noise_db is None:
                    for speed, miss in result.mode_miss.items():
                        collected.setdefault(
                            (f"{axis.mode} mode at {speed:g} m/s", MODE_MARK, True), []
                        ).append(miss)
        print(f"  seed {seed} of {seeds}", file=sys.stderr, flush=True)
    rows = [Row(name, np.array(v), mark, largest) for (name, mark, largest), v in collected.items()]
    for (model, output), fits in predicted.items():
        name, values = f"{output}, {model}, 1 s ahead", np.array(fits)
        if model == BOTH:
            rows.append(Row(name, values, MARKS[output], scatter=SCATTER))
        else:
            rows.append(Row(name, values, None))
    return Campaign(tuple(rows), seeds)
