"""Proofs of the closed loops, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studies.known_kinematics.rivals import KnownKinematics
from studies.known_kinematics.robust_loop import FORM, robust_loop
from studies.loops.exact_lateral import ExactLateral
from studies.loops.longitudinal import longitudinal_loop
from studies.loops.robust_lateral import FEEDBACK
from studies.setup.axes import LATERAL
from studies.setup.bounds import PERIOD, Bound
from studies.setup.flights import NOISES, TOP
from studies.setup.questions import Questions
from studies.transition import guarantees
from studies.transition.baseline import Baseline
from studies.transition.effort import GLANCE
from studies.transition.guarantees import Proof
from studies.transition.identified import Identification
from symheli import Helicopter
from synthesis import frozen_gain
from synthesis.analysis import LowerBoundSearch
from synthesis.certify.lower_bounds.frozen import FrozenGain
from synthesis.forms import Spline


@dataclass(frozen=True, kw_only=True)
class GustProofs:
    """Proofs of the lateral gust loop; `exact_frozen` is the frozen gain of the exact
    linearizations.
    """

    bounds: tuple[Bound, ...]
    exact_frozen: float


@dataclass(frozen=True, kw_only=True)
class LongitudinalProofs:
    """Proofs of the longitudinal gust loop."""

    bounds: tuple[Bound, ...]


@dataclass(frozen=True, kw_only=True)
class ServoProofs:
    """Proofs of the servo loop at 50 Hz; `frozen_peaks` are the airspeeds of the largest frozen
    gain of each model.
    """

    bounds: tuple[Bound, ...]
    exact_frozen: float
    frozen_peaks: Mapping[str, FrozenGain]


@dataclass(frozen=True, kw_only=True)
class RobustProofs:
    """Proofs of the loop with a margin at 50 Hz."""

    bounds: tuple[Bound, ...]


def gust_questions(
    heli: Helicopter,
    baseline: Baseline,
    gust_rates: Sequence[float],
    gust_segments: tuple[int, ...],
    exact_rates: Sequence[float],
    thorough: bool,
    search: LowerBoundSearch,
) -> Questions:
    """About the baseline, with `thorough` the exact models too; continuous time."""
    loop, form = guarantees.gust_loop(baseline.nodes), Spline(segments=gust_segments)
    baseline_proofs = guarantees.bounds("baseline", "gust", loop, gust_rates, form, search)
    proofs = [*baseline_proofs, *guarantees.lft_bounds("baseline", "gust", loop)]
    long: list[Proof] = []
    if thorough:
        long = guarantees.memory_bounds("baseline", "gust", loop, gust_rates, search)
        proofs += long
        exact = ExactLateral.of(heli).loop("gust")
        proofs += guarantees.bounds("exact", "gust", exact, exact_rates, form, search)
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=False)
    return Questions(
        proofs, lambda bounds: GustProofs(bounds=bounds, exact_frozen=exact_frozen), long[::-1]
    )


def longitudinal_questions(
    heli: Helicopter, longitudinal_rates: Sequence[float], gust_segments: tuple[int, ...]
) -> Questions:
    """About the baseline, continuous time."""
    loop, channel = longitudinal_loop(heli), "longitudinal"
    form = Spline(segments=gust_segments)
    proofs = guarantees.bounds("baseline", channel, loop, longitudinal_rates, form, GLANCE)
    proofs += guarantees.lft_bounds("baseline", channel, loop)
    return Questions(proofs, lambda bounds: LongitudinalProofs(bounds=bounds))


def servo_questions(
    heli: Helicopter,
    baseline: Baseline,
    identification: Identification,
    servo_rates: Sequence[float],
    servo_segments: tuple[int, ...],
    thorough: bool,
) -> Questions:
    """About the baseline and the identified models, with `thorough` the exact ones too; 50 Hz."""
    aggressive = identification.of(LATERAL, NOISES[0]).model
    loops = guarantees.servo_loops(
        heli if thorough else None, baseline.nodes, identification.gentle, aggressive
    )
    proofs: list[Proof] = []
    form = Spline(segments=servo_segments)
    for name, loop in loops.items():
        proofs += guarantees.bounds(name, "servo", loop, servo_rates, form, GLANCE)
        if thorough and guarantees.has_lft(loop):
            proofs += guarantees.lft_bounds(name, "servo", loop)
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=True)
    peaks = {name: frozen_gain(loop) for name, loop in loops.items()}
    return Questions(
        proofs,
        lambda bounds: ServoProofs(bounds=bounds, exact_frozen=exact_frozen, frozen_peaks=peaks),
    )


def robust_questions(
    heli: Helicopter,
    baseline: Baseline,
    known_kinematics: KnownKinematics,
    robust_rates: Sequence[float],
    robust_form: Spline,
    every_model: bool,
    thorough: bool,
) -> Questions:
    """About the estimate and the baseline, with `thorough` the exact models and with `every_model`
    all models that the flights allow; 50 Hz.
    """
    channel, rates = "robust", robust_rates
    allowed = robust_loop(known_kinematics.model)
    loops = {
        "baseline": guarantees.servo_loop(guarantees.sampled_baseline(baseline.nodes), FEEDBACK),
        guarantees.ESTIMATE: allowed.nominal,
    }
    long: list[Proof] = []
    if every_model:
        long = guarantees.allowed_bounds(channel, allowed, rates, FORM)
    if thorough:
        exact = ExactLateral.of(heli, 0.0, TOP).loop("inputs", PERIOD, FEEDBACK)
        loops = {"exact": guarantees.scaled(exact)} | loops
    proofs: list[Proof] = []
    for name, loop in loops.items():
        proofs += guarantees.bounds(name, channel, loop, rates, robust_form, GLANCE)
    if thorough:
        proofs += guarantees.lft_bounds("baseline", channel, loops["baseline"])
    proofs += long
    return Questions(proofs, lambda bounds: RobustProofs(bounds=bounds), long)
