"""Benefit of scheduling: LPV and LTI models of the same order, identified from transitions in wind
and noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.judge.against_constant import HORIZONS, PAYS
from identification.judge.scores import percent
from studies.campaigns.campaign import Campaign
from studies.campaigns.run import columns_of
from studies.campaigns.runners import Runner
from studies.campaigns.trials.pays import AXES, MODELS, TRIAL, fit_of, paying
from studies.setup.axes import Axis
from studies.setup.flights import NOISE_DB, TransitionPlan
from symheli.progress import tracked

CONDITIONS = {
    "still air, no noise": TransitionPlan(),
    "still air, 30 dB of sensor noise": TransitionPlan(noise_db=NOISE_DB),
    "breeze and turbulence, 30 dB of sensor noise": TransitionPlan(noise_db=NOISE_DB, windy=True),
}


@dataclass(frozen=True)
class OutputFits:
    """One output of one axis in one condition: fits in percent by horizon (seeds,), LPV and LTI; on
    how many seeds scheduling pays.
    """

    condition: str
    axis: str
    output: str
    lpv: dict[str, np.ndarray]
    lti: dict[str, np.ndarray]
    pays: int

    @property
    def seeds(self) -> int:
        """Number of flights."""
        return len(self.lpv[HORIZONS[0]])


def where_scheduling_pays(
    seeds: int,
    vehicle: str,
    conditions: Mapping[str, TransitionPlan] = CONDITIONS,
    *,
    on: Runner,
    path: Path | None = None,
) -> Iterator[OutputFits]:
    """In each condition fly with the default seed and `seeds` others, fit, and judge on another
    transition; a case is the flights of a seed, kept in the dataset at `path` where one is given.
    """
    for condition, plan in tracked("conditions", conditions.items()):
        fixed = {
            "vehicle": vehicle,
            "noise_db": math.inf if plan.noise_db is None else plan.noise_db,
            "windy": plan.windy,
            "ramps": plan.ramps,
        }
        campaign = Campaign(TRIAL, grid={"seed": range(seeds + 1)}, fixed=fixed)
        found = columns_of(campaign, on, path)
        yield from (
            _line(condition, axis, output, found) for axis in AXES for output in axis.outputs
        )


def _line(condition: str, axis: Axis, output: str, found: Mapping[str, np.ndarray]) -> OutputFits:
    lpv, lti = ({h: found[fit_of(axis, output, h, model)] for h in HORIZONS} for model in MODELS)
    return OutputFits(
        condition, axis.name, output, lpv, lti, int(found[paying(axis, output)].sum())
    )


def table(lines: Sequence[OutputFits]) -> str:
    """Medians over the seeds, LPV / LTI; then the worst of them, each model on the flight it does
    worst on.
    """
    head = "".join(f"{h:>20s}" for h in HORIZONS)
    return "\n".join(
        [
            (
                f"held-out fit in percent, LPV / LTI of the same order, median of {lines[0].seeds}"
                " pairs of flights"
            ),
            (
                f"scheduling pays: more than {PAYS:g} point better 1 s ahead or in free run, and"
                " worse in neither, on how many of them"
            ),
            f"{'':10s}{head}{'pays':>10s}",
            *_rows(lines, np.median, lambda line: f"{line.pays:7d}/{line.seeds}"),
            "",
            f"the same, worst of {lines[0].seeds} pairs of flights",
            f"{'':10s}{head}",
            *_rows(lines, np.min, lambda _: ""),
        ]
    )


def _rows(
    lines: Sequence[OutputFits], over: Callable[[np.ndarray], Any], end: Callable[[OutputFits], str]
) -> Iterator[str]:
    group = ("", "")
    for line in lines:
        if (line.condition, line.axis) != group:
            if line.condition != group[0]:
                yield line.condition
            group = line.condition, line.axis
            yield f" {line.axis}"
        cells = "".join(
            f"{percent(float(over(line.lpv[h]))):>10s} /{percent(float(over(line.lti[h]))):>8s}"
            for h in HORIZONS
        )
        yield f"  {line.output:8s}{cells}{end(line)}"


def data(lines: Sequence[OutputFits]) -> list[dict[str, Any]]:
    """Every fit of every seed."""
    return [
        {
            "condition": line.condition,
            "axis": line.axis,
            "output": line.output,
            "pays": line.pays,
            "seeds": line.seeds,
            "unit": "%",
            "lpv": {h: v.tolist() for h, v in line.lpv.items()},
            "lti": {h: v.tolist() for h, v in line.lti.items()},
        }
        for line in lines
    ]
