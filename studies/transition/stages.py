"""The stages of the study: what each finds, and from what."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, TypeVar, cast

from studies.controllers.certified import CertifiedControllers, controller_questions
from studies.controllers.designs import Designs, design_questions
from studies.controllers.flown import FlownControllers, fly_controllers
from studies.transition.baseline import Baseline, build_baseline
from studies.transition.comparison import Comparison, compare
from studies.transition.effort import Effort
from studies.transition.flights import Flights, fly_transitions
from studies.transition.identified import Identification, identify_axes
from studies.transition.known_kinematics import (
    KnownKinematics,
    identify_with_known_kinematics,
)
from studies.transition.outcome import Outcome
from studies.transition.paper_experiment import PERIOD, PaperExperiments, run_experiments
from studies.transition.proofs import (
    GustProofs,
    LongitudinalProofs,
    RobustProofs,
    ServoProofs,
    gust_questions,
    longitudinal_questions,
    robust_questions,
    servo_questions,
)
from studies.transition.recovery import Recoveries, recover_at

T = TypeVar("T")


@dataclass(frozen=True)
class Stage:
    """What fills one field of an `Outcome`: its title, the type of its result, and how it is
    computed from the stages it `needs` and the entries of the effort it `reads`: at once, or as
    `Questions` that processes answer.

    `cost` is about the work in seconds, for the remaining time.
    """

    name: str
    title: str
    kind: type
    needs: tuple[str, ...]
    compute: Callable[[Outcome, Effort], Any]
    reads: tuple[str, ...] = ()
    asks: bool = False
    cost: float = 1.0

    def found(self, outcome: Outcome, effort: Effort) -> Any:
        """What it computes, or its questions. Nothing is there but vehicle, seed, what it `needs`
        and what it `reads`: for the rest its result would not be computed again.
        """
        known = ("vehicle", "seed", "heli", *self.needs)
        given = SimpleNamespace(**{name: getattr(outcome, name) for name in known})
        asked = SimpleNamespace(**{name: getattr(effort, name) for name in self.reads})
        return self.compute(cast(Outcome, given), cast(Effort, asked))


def stages(effort: Effort) -> tuple[Stage, ...]:
    """In order: each needs some of those before it. Costs were measured in the study and its look,
    which takes a fraction.
    """
    segments, thorough = sum(effort.gust_segments), effort.thorough
    longitudinal = Stage(
        "longitudinal",
        "Proving gains of the longitudinal gust loop (baseline, continuous)",
        LongitudinalProofs,
        (),
        lambda s, effort: longitudinal_questions(_there(s.heli), effort),
        reads=("longitudinal_rates", "gust_segments"),
        asks=True,
        cost=1 + 0.25 * segments * len(effort.longitudinal_rates),
    )
    return (
        Stage(
            "baseline",
            "Model and baseline: trim, linearize, interpolate, LFT",
            Baseline,
            (),
            lambda s, _: build_baseline(_there(s.heli)),
            cost=0.2,
        ),
        Stage(
            "paper_experiment",
            "The paper's experiment, open and closed loop",
            PaperExperiments,
            ("baseline",),
            lambda s, _: run_experiments(_there(s.baseline).nodes, s.seed),
            cost=0.2,
        ),
        Stage(
            "exact_recovery",
            "Exact recovery of A(p), B(p)",
            Recoveries,
            ("baseline",),
            lambda s, _: recover_at(_there(s.baseline).nodes, (0.02, PERIOD), s.seed),
            cost=0.1,
        ),
        Stage(
            "flights",
            "Flying the transitions",
            Flights,
            (),
            lambda s, effort: fly_transitions(
                _there(s.heli), s.seed, effort.ramps, effort.gentle_ramps
            ),
            reads=("ramps", "gentle_ramps"),
            cost=0.2,
        ),
        Stage(
            "identification",
            "Identifying and scoring",
            Identification,
            ("flights",),
            lambda s, _: identify_axes(_there(s.heli), _there(s.flights)),
            cost=0.08 * effort.ramps,
        ),
        Stage(
            "comparison",
            "Comparing with the baseline",
            Comparison,
            ("baseline", "flights", "identification"),
            lambda s, _: compare(
                _there(s.heli), _there(s.baseline), _there(s.flights), _there(s.identification)
            ),
            cost=2,
        ),
        Stage(
            "known_kinematics",
            "Identifying with known kinematics",
            KnownKinematics,
            ("baseline",),
            lambda s, effort: identify_with_known_kinematics(
                _there(s.heli), s.vehicle, _there(s.baseline), s.seed, effort
            ),
            reads=("aggressive", "gentle_flight"),
            cost=0.1 * effort.aggressive + 22 * effort.gentle_flight,
        ),
        Stage(
            "gust",
            "Proving gains of the lateral gust loop (baseline and exact, continuous)",
            GustProofs,
            ("baseline",),
            lambda s, effort: gust_questions(_there(s.heli), _there(s.baseline), effort),
            reads=("gust_rates", "gust_segments", "exact_rates", "thorough", "search"),
            asks=True,
            cost=2
            + 0.27 * segments * _limits(effort.gust_rates + effort.exact_rates * thorough)
            + 80 * thorough,
        ),
        *((longitudinal,) if effort.longitudinal_rates else ()),
        Stage(
            "servo",
            "Proving gains of the servo loop (exact, baseline and identified, 50 Hz)",
            ServoProofs,
            ("baseline", "identification"),
            lambda s, effort: servo_questions(
                _there(s.heli), _there(s.baseline), _there(s.identification), effort
            ),
            reads=("servo_rates", "servo_segments", "thorough"),
            asks=True,
            cost=2 + 1.6 * sum(effort.servo_segments) * _limits(effort.servo_rates),
        ),
        Stage(
            "robust",
            "Proving gains of the loop with a margin (exact, baseline, identified; 50 Hz)",
            RobustProofs,
            ("baseline", "known_kinematics"),
            lambda s, effort: robust_questions(
                _there(s.heli), _there(s.baseline), _there(s.known_kinematics), effort
            ),
            reads=("robust_rates", "robust_form", "every_model", "thorough"),
            asks=True,
            cost=1 + (5 + 16 * effort.every_model + 10 * thorough) * _limits(effort.robust_rates),
        ),
        Stage(
            "controllers",
            "Designing controllers from the baseline and from the identified model",
            Designs,
            ("known_kinematics",),
            lambda s, effort: design_questions(
                _there(s.heli), _there(s.known_kinematics).model, s.seed, effort
            ),
            reads=("certified_controllers", "design_points"),
            asks=True,
            cost=37 + 0.4 * effort.design_points + 16 * effort.certified_controllers,
        ),
        Stage(
            "flown_controllers",
            "Flying the controllers",
            FlownControllers,
            ("controllers",),
            lambda s, effort: fly_controllers(
                s.vehicle, _there(s.controllers), range(effort.controller_seeds)
            ),
            reads=("controller_seeds",),
            cost=0.3 * effort.controller_seeds,
        ),
        Stage(
            "certified_controllers",
            "Proving gains of the loops that flew (baseline, servos, delay; 50 Hz)",
            CertifiedControllers,
            ("controllers",),
            lambda s, effort: controller_questions(_there(s.controllers), effort),
            reads=("certified_controllers", "first_certificate"),
            asks=True,
            cost=1
            + 21 * (effort.first_certificate or effort.certified_controllers)
            + 85 * effort.certified_controllers,
        ),
    )


def _limits(rates: tuple[float, ...]) -> int:
    """How many of the rates are limits: proofs of a P that moves."""
    return sum(0 < rate < math.inf for rate in rates)


def _there(thing: T | None) -> T:
    assert thing is not None, "stages run in order"  # noqa: S101
    return thing
