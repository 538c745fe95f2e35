"""Where scheduling pays: LPV beside LTI models of the same order, identified from transitions in
wind and noise.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification import AgainstConstant, against_constant
from identification.judge.against_constant import HORIZONS, PAYS
from identification.judge.scores import percent
from studies.transition.axes import ALL, LATERAL, LONGITUDINAL
from studies.transition.flights import NOISE_DB, FlightPlan, autopilot_for
from symheli import Helicopter

AXES = (LONGITUDINAL, LATERAL, ALL)
CONDITIONS = {
    "still air, no noise": FlightPlan(),
    "still air, 30 dB of sensor noise": FlightPlan(noise_db=NOISE_DB),
    "breeze and turbulence, 30 dB of sensor noise": FlightPlan(noise_db=NOISE_DB, windy=True),
}


@dataclass(frozen=True)
class Line:
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
    seeds: int, vehicle: str, conditions: Mapping[str, FlightPlan] = CONDITIONS
) -> Iterator[Line]:
    """In each condition fly with the default seed and `seeds` others, fit, and judge on another
    transition.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    autopilot = autopilot_for(heli)
    for condition, plan in conditions.items():
        found: dict[str, list[AgainstConstant]] = {axis.name: [] for axis in AXES}
        for seed in range(seeds + 1):
            flown = replace(plan, seed=seed)
            training, test = flown.training(heli, autopilot), flown.test(heli, autopilot)
            for axis in AXES:
                found[axis.name].append(against_constant(axis.structure(), training, test))
            print(f"  {condition}: seed {seed} of {seeds}", file=sys.stderr, flush=True)
        yield from (
            _line(condition, axis.name, output, found[axis.name])
            for axis in AXES
            for output in axis.outputs
        )


def _line(condition: str, axis: str, output: str, runs: list[AgainstConstant]) -> Line:
    def over_seeds(model: int) -> dict[str, np.ndarray]:
        found = [scores.by_horizon for run in runs if (scores := run.models[model].held_out)]
        return {h: np.array([fits[h][output] for fits in found]) for h in HORIZONS}

    return Line(
        condition, axis, output, over_seeds(0), over_seeds(1), sum(run.pays(output) for run in runs)
    )


def table(lines: Sequence[Line]) -> str:
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
                f"scheduling pays: more than {PAYS:g} point better 1 s ahead and not worse in free"
                " run, on how many of them"
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
    lines: Sequence[Line], over: Callable[[np.ndarray], Any], end: Callable[[Line], str]
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


def data(lines: Sequence[Line]) -> list[dict[str, Any]]:
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
