"""What a run of the study found."""

from __future__ import annotations

from dataclasses import dataclass, field

from identification import LPVARXModel
from studies.transition.axes import Scores
from studies.transition.baseline import Baseline
from studies.transition.comparison import Comparison, FrozenComparison
from studies.transition.guarantees import Bound
from studies.transition.paper_experiment import Experiment
from studies.transition.recovery import Recovery
from symheli import FlightRecord, Helicopter
from synthesis import FrozenGain


@dataclass
class Outcome:
    """Everything a run found, stage by stage; what is not reached yet is None or empty."""

    vehicle: str
    quick: bool
    seed: int
    heli: Helicopter | None = None
    baseline: Baseline | None = None
    experiments: list[Experiment] = field(default_factory=list)
    recoveries: list[Recovery] = field(default_factory=list)
    flights: dict[str, FlightRecord] = field(default_factory=dict)
    models: dict[str, LPVARXModel] = field(default_factory=dict)
    scores: dict[tuple[str, str], Scores] = field(default_factory=dict)
    """Keys (axis name, "noise-free" or "30 dB")."""
    noisy_modes: dict[tuple[str, str], dict[float, float]] = field(default_factory=dict)
    """Mode misses (percent, by airspeed) of order-2 models of the noisy flight: keys (axis name,
    method).
    """
    first_stage: dict[str, float] = field(default_factory=dict)
    """First-stage F of the instruments in the direction they explain worst, by axis."""
    update_times: dict[str, float] = field(default_factory=dict)
    """Seconds of one recursive update, by axis."""
    comparisons: dict[tuple[str, str], Comparison] = field(default_factory=dict)
    frozen: dict[str, FrozenComparison] = field(default_factory=dict)
    bounds: list[Bound] = field(default_factory=list)
    frozen_peaks: dict[str, FrozenGain] = field(default_factory=dict)
    """Where the frozen gain of each servo loop is largest."""
    exact_frozen: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    complete: bool = False
