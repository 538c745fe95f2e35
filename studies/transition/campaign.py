"""The pass marks over many seeds: median and worst."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.transition import axes
from studies.transition.axes import AXES
from studies.transition.flights import NOISE_DB, FlightPlan, autopilot_for
from studies.transition.results import value
from symheli import Helicopter

MODE_MARK = 3.0
"""Percent by which a noise-free frozen rotor mode may miss the exact one."""


@dataclass(frozen=True)
class Row:
    """One quantity over the seeds, in percent; `mark` is the pass mark, `largest` whether it bounds
    from above.
    """

    name: str
    values: np.ndarray
    mark: float
    largest: bool = False

    @property
    def worst(self) -> float:
        """The value nearest to failing."""
        return float(self.values.max() if self.largest else self.values.min())

    @property
    def passed(self) -> bool:
        """The worst value meets the mark."""
        return self.worst <= self.mark if self.largest else self.worst >= self.mark


@dataclass(frozen=True)
class Campaign:
    """The rows of a campaign; the first value of each is the default seed's."""

    rows: tuple[Row, ...]
    seeds: int

    @property
    def passed(self) -> bool:
        """Every row meets its mark on every seed."""
        return all(row.passed for row in self.rows)

    def summary(self) -> str:
        """A table: default seed, median, worst, mark."""
        lines = [
            f"{'':58s}{'default':>9s}{'median':>9s}{'worst':>9s}{'mark':>9s}   over {self.seeds}"
            " seeds and the default one, percent"
        ]
        for r in self.rows:
            sign = "<=" if r.largest else ">="
            verdict = "" if r.passed else "   MISSED"
            lines.append(
                f"{r.name:58s}{r.values[0]:9.2f}{np.median(r.values):9.2f}{r.worst:9.2f}{sign:>4s}{r.mark:5.0f}{verdict}"
            )
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Every value with its unit."""
        return {
            r.name: {
                "values": {"value": r.values.tolist(), "unit": "%"},
                "median": value(float(np.median(r.values)), "%"),
                "worst": value(r.worst, "%"),
                "mark": value(r.mark, "%"),
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
    for seed in range(seeds + 1):
        for noise_db in (None, NOISE_DB):
            plan = FlightPlan(seed, noise_db=noise_db)
            training, test = plan.training(heli, autopilot), plan.test(heli, autopilot)
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
    return Campaign(
        tuple(
            Row(name, np.array(v), mark, largest) for (name, mark, largest), v in collected.items()
        ),
        seeds,
    )
