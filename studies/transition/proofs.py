"""What is proven of the closed loops, stage by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

from studies.known_kinematics.robust_loop import FORM, robust_loop
from studies.loops.exact_lateral import ExactLateral
from studies.loops.longitudinal import longitudinal_loop
from studies.loops.robust_lateral import FEEDBACK
from studies.processes import Processes
from studies.transition import guarantees
from studies.transition.axes import LATERAL
from studies.transition.baseline import Baseline
from studies.transition.effort import GLANCE, Effort
from studies.transition.flights import NOISES, TOP
from studies.transition.guarantees import PERIOD, Bound, Proof
from studies.transition.identified import Identification
from studies.transition.known_kinematics import KnownKinematics
from symheli import Helicopter
from synthesis import Spline, frozen_gain
from synthesis.worst.frozen import FrozenGain


@dataclass(frozen=True, kw_only=True)
class GustProofs:
    """Of the lateral gust loop; `exact_frozen` is the frozen gain of the exact linearizations."""

    bounds: tuple[Bound, ...]
    exact_frozen: float


@dataclass(frozen=True, kw_only=True)
class LongitudinalProofs:
    """Of the longitudinal gust loop."""

    bounds: tuple[Bound, ...]


@dataclass(frozen=True, kw_only=True)
class ServoProofs:
    """Of the servo loop at 50 Hz; `frozen_peaks` says where the frozen gain of each model is
    largest.
    """

    bounds: tuple[Bound, ...]
    exact_frozen: float
    frozen_peaks: Mapping[str, FrozenGain]


@dataclass(frozen=True, kw_only=True)
class RobustProofs:
    """Of the loop with a margin at 50 Hz."""

    bounds: tuple[Bound, ...]


Answer = tuple[float, list[Any]]
"""What was found, after the seconds it took."""

Question = Callable[[], list[Any]]
"""What a process can answer: a `functools.partial`; of a proof the answers are bounds."""


@dataclass(frozen=True)
class Questions:
    """Proofs or designs that need nothing of each other, and what their answers become together;
    those of `long` take longest and go first.
    """

    proofs: Sequence[Question]
    together: Callable[[tuple[Any, ...]], Any]
    long: Sequence[Question] = ()

    def asked(
        self,
        processes: Processes,
        known: Mapping[int, Answer],
        found: Callable[[int, Answer], object],
    ) -> list[Future[Answer]]:
        """An answer to come for each proof, at once for those that are `known` by position;
        `found` is called with every new one.
        """
        order = [self.proofs.index(proof) for proof in self.long]
        order += [i for i in range(len(self.proofs)) if i not in order]
        open_ones = [i for i in order if i not in known]
        answers = processes.submit([partial(_timed, self.proofs[i]) for i in open_ones])
        for i, answer in zip(open_ones, answers, strict=True):
            answer.add_done_callback(partial(_told, found, i))
        new = dict(zip(open_ones, answers, strict=True))
        return [new[i] if i in new else _known(known[i]) for i in range(len(self.proofs))]


def _told(found: Callable[[int, Answer], object], i: int, answer: Future[Answer]) -> None:
    if not answer.cancelled() and answer.exception() is None:
        found(i, answer.result())


def _known(answer: Answer) -> Future[Answer]:
    future: Future[Answer] = Future()
    future.set_result(answer)
    return future


def gust_questions(heli: Helicopter, baseline: Baseline, effort: Effort) -> Questions:
    """About the baseline, and with effort the exact models; continuous time."""
    loop, form = guarantees.gust_loop(baseline.nodes), Spline(segments=effort.gust_segments)
    baseline_proofs = guarantees.bounds(
        "baseline", "gust", loop, effort.gust_rates, form, effort.search
    )
    asked = [*baseline_proofs, *guarantees.lft_bounds("baseline", "gust", loop)]
    long: list[Proof] = []
    if effort.thorough:
        long = guarantees.memory_bounds("baseline", "gust", loop, effort.gust_rates, effort.search)
        asked += long
        exact = ExactLateral.of(heli).loop("gust")
        asked += guarantees.bounds("exact", "gust", exact, effort.exact_rates, form, effort.search)
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=False)
    return Questions(
        asked, lambda bounds: GustProofs(bounds=bounds, exact_frozen=exact_frozen), long[::-1]
    )


def longitudinal_questions(heli: Helicopter, effort: Effort) -> Questions:
    """About the baseline, continuous time."""
    loop, channel = longitudinal_loop(heli), "longitudinal"
    form = Spline(segments=effort.gust_segments)
    asked = guarantees.bounds("baseline", channel, loop, effort.longitudinal_rates, form, GLANCE)
    asked += guarantees.lft_bounds("baseline", channel, loop)
    return Questions(asked, lambda bounds: LongitudinalProofs(bounds=bounds))


def servo_questions(
    heli: Helicopter, baseline: Baseline, identification: Identification, effort: Effort
) -> Questions:
    """About the baseline and the identified models, with effort the exact ones; 50 Hz."""
    aggressive = identification.of(LATERAL, NOISES[0]).model
    loops = guarantees.servo_loops(
        heli if effort.thorough else None, baseline.nodes, identification.gentle, aggressive
    )
    asked: list[Proof] = []
    form = Spline(segments=effort.servo_segments)
    for name, loop in loops.items():
        asked += guarantees.bounds(name, "servo", loop, effort.servo_rates, form, GLANCE)
        if effort.thorough and guarantees.has_lft(loop):
            asked += guarantees.lft_bounds(name, "servo", loop)
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=True)
    peaks = {name: frozen_gain(loop) for name, loop in loops.items()}
    return Questions(
        asked,
        lambda bounds: ServoProofs(bounds=bounds, exact_frozen=exact_frozen, frozen_peaks=peaks),
    )


def robust_questions(
    heli: Helicopter, baseline: Baseline, known: KnownKinematics, effort: Effort
) -> Questions:
    """About the estimate, the baseline, with effort the exact models and every model that the
    flights allow; 50 Hz.
    """
    channel, rates = "robust", effort.robust_rates
    allowed = robust_loop(known.model)
    loops = {
        "baseline": guarantees.servo_loop(guarantees.sampled_baseline(baseline.nodes), FEEDBACK),
        guarantees.ESTIMATE: allowed.nominal,
    }
    long: list[Proof] = []
    if effort.every_model:
        long = guarantees.allowed_bounds(channel, allowed, rates, FORM)
    if effort.thorough:
        exact = ExactLateral.of(heli, 0.0, TOP).loop("inputs", PERIOD, FEEDBACK)
        loops = {"exact": guarantees.scaled(exact)} | loops
    asked: list[Proof] = []
    for name, loop in loops.items():
        asked += guarantees.bounds(name, channel, loop, rates, effort.robust_form, GLANCE)
    if effort.thorough:
        asked += guarantees.lft_bounds("baseline", channel, loops["baseline"])
    asked += long
    return Questions(asked, lambda bounds: RobustProofs(bounds=bounds), long)


def _timed(proof: Proof) -> Answer:
    begin = time.perf_counter()
    found = proof()
    return time.perf_counter() - begin, found
