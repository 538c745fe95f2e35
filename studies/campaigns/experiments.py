"""Experiments for identification: candidate excitations and airspeed schedules, simulated and
compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from identification import choose_experiments
from identification.design import Experiment, Plan, compare_experiments
from studies.output import columns
from studies.setup.axes import Axis
from studies.setup.flights import AMPLITUDE, TOP, autopilot_for
from symheli import AirspeedSchedule, Excitation, FlightRecord, Helicopter, fly
from symheli.errors import SymheliError
from symheli.flight import Autopilot
from symheli.flight.excitation import Kind
from symheli.progress import tracked

KINDS: tuple[Kind, ...] = ("multisine", "prbs", "chirp")
ACCELERATIONS = (1.0, 3.0)
BANDS = ((0.1, 2.0), (0.1, 5.0))
AMPLITUDES = (0.5, 1.0, 1.5)
"""Factors on the excitation amplitudes of the study."""


@dataclass(frozen=True)
class Candidate:
    """An excitation of the axis's inputs along a transition of peak acceleration `acceleration`
    (m/s^2).
    """

    kind: Kind
    band: tuple[float, float]
    amplitude: float
    acceleration: float

    @property
    def name(self) -> str:
        """Description in words."""
        return (
            f"{self.kind} {self.band[0]:g}-{self.band[1]:g} Hz x{self.amplitude:g},"
            f" {self.acceleration:g} m/s^2"
        )

    @property
    def schedule(self) -> AirspeedSchedule:
        """Hover to the top of the range and back."""
        return AirspeedSchedule.transition(0.0, TOP, self.acceleration, hold=2.0)

    def excitation(self, axis: Axis, seed: int = 0) -> Excitation:
        """Excitation of the axis's inputs alone."""
        amplitude = {name: self.amplitude * AMPLITUDE[name] for name in axis.inputs}
        return Excitation(amplitude, self.kind, self.band, seed)

    def fly(self, heli: Helicopter, axis: Axis, autopilot: Autopilot, seed: int) -> FlightRecord:
        """The simulated flight."""
        excitation = self.excitation(axis, seed)
        return fly(heli, self.schedule, excitation=excitation, controller=autopilot)


@dataclass(frozen=True)
class Comparison:
    """Every candidate that stayed in the air with its information, those lost with the reason, and
    the plan.
    """

    experiments: tuple[Experiment, ...]
    lost: dict[str, str]
    plan: Plan

    def table(self) -> str:
        """Candidates, the most certain first: predicted standard errors against the best, and what
        they exceed.
        """
        best = np.median(self.plan.experiments[0].bounds)
        ranked = sorted(self.experiments, key=lambda e: (not e.allowed, float(np.median(e.bounds))))
        rows = [["candidate", "seconds", "median error", "exceeds"]]
        for e in ranked:
            beyond = ", ".join(f"{signal} {value:.2f}" for signal, value in e.exceeded.items())
            rows.append([e.name, f"{e.duration:.0f}", f"{np.median(e.bounds) / best:.2f}x", beyond])
        lines = [columns([*rows, *([name, "lost"] for name in self.lost)])]
        lines += ["", "fly, in this order:", *(f"  {e.name}" for e in self.plan.experiments)]
        lines.append(
            f"together: median standard error {np.median(self.plan.bounds) / best:.2f} of that of"
            " the first alone"
        )
        return "\n".join(lines)


CANDIDATES = tuple(
    Candidate(*choice) for choice in product(KINDS, BANDS, AMPLITUDES, ACCELERATIONS)
)


def design(
    vehicle: str,
    axis: Axis,
    count: int,
    limits: dict[str, float],
    candidates: Sequence[Candidate] = CANDIDATES,
    seed: int = 0,
) -> Comparison:
    """Fly every candidate and choose `count` of them within `limits` {signal: largest absolute
    value, SI}.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    autopilot = autopilot_for(heli)
    records, lost = {}, {}
    for candidate in tracked("flying candidates", candidates):
        try:
            records[candidate.name] = candidate.fly(heli, axis, autopilot, seed)
        except SymheliError as error:
            lost[candidate.name] = str(error)
    experiments = compare_experiments(axis.structure(), records, limits)
    return Comparison(experiments, lost, choose_experiments(experiments, count))
