"""Where scheduling pays: LPV beside LTI models of the same order, identified from transitions in
wind and noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from identification import AgainstConstant, against_constant
from identification.judge.against_constant import HORIZONS, PAYS
from identification.judge.scores import percent
from studies.output import progress
from studies.processes import Processes
from studies.transition.axes import ALL, LATERAL, LONGITUDINAL, Axis
from studies.transition.flights import NOISE_DB, FlightPlan, autopilot_for
from symheli import Helicopter
from symheli.flight import Autopilot

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
    transition; the flights of a seed in a process.
    """
    with Processes() as processes:
        asked = {
            condition: processes.submit(
                [partial(_of_seed, vehicle, replace(plan, seed=k)) for k in range(seeds + 1)]
            )
            for condition, plan in conditions.items()
        }
        for condition, answers in asked.items():
            found: list[_Run] = []
            for seed, answer in enumerate(answers):
                found.append(answer.result())
                progress(f"  {condition}: seed {seed} of {seeds}")
            yield from (
                _line(condition, axis, output, found) for axis in AXES for output in axis.outputs
            )


@dataclass(frozen=True)
class _Pair:
    """Fits of one axis in percent by horizon and output, LPV and LTI; the outputs for which
    scheduling pays.
    """

    lpv: Mapping[str, Mapping[str, float]]
    lti: Mapping[str, Mapping[str, float]]
    pays: frozenset[str]

    @classmethod
    def of(cls, found: AgainstConstant) -> _Pair:
        lpv, lti = (one.held_out.by_horizon for one in found.models if one.held_out is not None)
        return cls(lpv, lti, frozenset(str(y) for y in lpv[HORIZONS[0]] if found.pays(str(y))))


_Run = Mapping[str, _Pair]
"""Of one seed, by axis."""


def _of_seed(vehicle: str, plan: FlightPlan) -> _Run:
    """Fly, fit, judge."""
    heli, autopilot = _flown(vehicle)
    training, test = plan.training(heli, autopilot), plan.test(heli, autopilot)
    found = {
        axis.name: against_constant(axis.structure(), training, test, trim="moving")
        for axis in AXES
    }
    return {name: _Pair.of(one) for name, one in found.items()}


@cache
def _flown(vehicle: str) -> tuple[Helicopter, Autopilot]:
    """The helicopter and its autopilot, once a process."""
    heli = Helicopter.load(vehicle, governor="ideal")
    return heli, autopilot_for(heli)


def _line(condition: str, axis: Axis, output: str, runs: Sequence[_Run]) -> Line:
    pairs = [run[axis.name] for run in runs]
    return Line(
        condition,
        axis.name,
        output,
        {h: np.array([pair.lpv[h][output] for pair in pairs]) for h in HORIZONS},
        {h: np.array([pair.lti[h][output] for pair in pairs]) for h in HORIZONS},
        sum(output in pair.pays for pair in pairs),
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
