"""The stages of the study: functions whose parameters name all that they are computed from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from inspect import Parameter, signature
from typing import Any

from studies.controllers.certified import controller_questions
from studies.controllers.covered import proven
from studies.controllers.designs import Designs, design_questions
from studies.controllers.flown import FlownControllers, fly_controllers
from studies.setup.flights import fly_transitions
from studies.setup.questions import Questions
from studies.transition.baseline import Baseline, build_baseline
from studies.transition.comparison import compare
from studies.transition.effort import Effort
from studies.transition.identified import identify_axes
from studies.transition.known_kinematics import identify_with_known_kinematics
from studies.transition.outcome import Outcome
from studies.transition.paper_experiment import PERIOD, PaperExperiments, run_experiments
from studies.transition.proofs import (
    gust_questions,
    longitudinal_questions,
    robust_questions,
    servo_questions,
)
from studies.transition.real_conditions import identify_under_real_conditions
from studies.transition.recovery import Recoveries, recover_at

ENTRIES = frozenset(f.name for f in fields(Effort))
GIVEN = ("vehicle", "seed", "heli")
"""What every stage may be computed from, besides entries of the effort and earlier stages."""


@dataclass(frozen=True)
class Stage:
    """A function that fills the field `name` of an `Outcome`; `title` is its name in progress
    messages.

    Its parameters without default are entries of the effort, earlier stages, or `GIVEN`: nothing
    else can decide its result. It may return `Questions`, which processes answer. `cost` is about
    its work in the whole study and in the quick one, s of processor: by it stages are put in order.
    """

    name: str
    title: str
    compute: Callable[..., Any]
    cost: tuple[float, float] = (1.0, 1.0)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters on which the result depends."""
        each = signature(self.compute).parameters.values()
        return tuple(p.name for p in each if p.default is Parameter.empty)

    @property
    def reads(self) -> tuple[str, ...]:
        """The entries of the effort among them."""
        return tuple(name for name in self.parameters if name in ENTRIES)

    @property
    def needs(self) -> tuple[str, ...]:
        """The earlier stages among them."""
        return tuple(name for name in self.parameters if name not in ENTRIES | {*GIVEN})

    @property
    def asks(self) -> bool:
        """Whether it says that it returns `Questions`, which is little work by itself."""
        return signature(self.compute).return_annotation == Questions.__name__

    def call(self, outcome: Outcome, effort: Effort) -> Callable[[], Any]:
        """Return the call of its result, or of its questions, with all that it is computed from."""
        sources = {name: effort if name in ENTRIES else outcome for name in self.parameters}
        given = {name: getattr(source, name) for name, source in sources.items()}
        return partial(self.compute, **given)


def paper_experiment(baseline: Baseline, seed: int) -> PaperExperiments:
    """The published experiment, open and closed loop."""
    return run_experiments(baseline.nodes, seed)


def exact_recovery(baseline: Baseline, seed: int) -> Recoveries:
    """A(p), B(p) from exact data, at two sample periods."""
    return recover_at(baseline.nodes, (0.02, PERIOD), seed)


def flown_controllers(
    vehicle: str, controllers: Designs, controller_seeds: int, tubes: tuple[str, ...]
) -> FlownControllers:
    """Every controller flown with so many seeds, and compared with the tubes in these files."""
    return fly_controllers(vehicle, controllers, range(controller_seeds), proven(tubes))


STAGES = (
    Stage("baseline", "Model and baseline: trim, linearize, interpolate, LFT", build_baseline),
    Stage(
        "gust",
        "Proving gains of the lateral gust loop (baseline and exact, continuous)",
        gust_questions,
        (50, 4),
    ),
    Stage(
        "longitudinal",
        "Proving gains of the longitudinal gust loop (baseline, continuous)",
        longitudinal_questions,
        (15, 4),
    ),
    Stage("paper_experiment", "The paper's experiment, open and closed loop", paper_experiment),
    Stage("exact_recovery", "Exact recovery of A(p), B(p)", exact_recovery),
    Stage("flights", "Flying the transitions", fly_transitions),
    Stage("identification", "Identifying and scoring", identify_axes),
    Stage(
        "servo",
        "Proving gains of the servo loop (exact, baseline and identified, 50 Hz)",
        servo_questions,
        (58, 2),
    ),
    Stage("comparison", "Comparing with the baseline", compare, (2, 2)),
    Stage(
        "known_kinematics",
        "Identifying with known kinematics",
        identify_with_known_kinematics,
        (18, 7),
    ),
    Stage(
        "real_conditions",
        "Identifying through servos, delay and governor",
        identify_under_real_conditions,
        (5, 3),
    ),
    Stage(
        "robust",
        "Proving gains of the loop with a margin (exact, baseline, identified; 50 Hz)",
        robust_questions,
        (50, 11),
    ),
    Stage(
        "controllers",
        "Designing controllers from the baseline and from the identified model",
        design_questions,
        (100, 100),
    ),
    Stage(
        "certified_controllers",
        "Proving gains of the loops that flew (baseline, servos, delay; 50 Hz)",
        controller_questions,
        (300, 20),
    ),
    Stage("flown_controllers", "Flying the controllers", flown_controllers, (6, 3)),
)
"""In the order in which results.json names them, what a stage needs before it."""


SHORT, SOON = 2.0, 0.9
"""Seconds of a stage that is not kept waiting, and its urgency over the largest: the longest chain
goes first, then what gives the page more to show soon.
"""


def urgencies(every: Sequence[Stage], quick: bool) -> dict[str, float]:
    """By stage the work from its beginning to the end of what waits for it longest, s; more for a
    short one.
    """
    out: dict[str, float] = {}
    for stage in reversed(every):
        after = (out[other.name] for other in every if stage.name in other.needs)
        out[stage.name] = stage.cost[quick] + max(after, default=0.0)
    soon = SOON * max(out.values())
    short = {stage.name for stage in every if stage.cost[quick] <= SHORT}
    return {name: max(own, soon) if name in short else own for name, own in out.items()}


def stages(effort: Effort) -> tuple[Stage, ...]:
    """Return the stages that this effort requests."""
    return tuple(s for s in STAGES if s.name != "longitudinal" or effort.longitudinal_rates)
