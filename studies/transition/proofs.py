"""What is proven of the closed loops, stage by stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from studies.loops.exact_lateral import ExactLateral
from studies.loops.longitudinal import longitudinal_loop
from studies.transition import guarantees
from studies.transition.axes import LATERAL
from studies.transition.baseline import Baseline
from studies.transition.effort import GLANCE, Effort
from studies.transition.flights import NOISES
from studies.transition.guarantees import Bound
from studies.transition.identified import Identification
from symheli import Helicopter
from synthesis import FrozenGain, frozen_gain


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


def prove_gust(heli: Helicopter, baseline: Baseline, effort: Effort) -> GustProofs:
    """Baseline, and with effort the exact models; continuous time."""
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=False)
    loop = guarantees.gust_loop(baseline.nodes)
    found = [
        *guarantees.bounds(
            "baseline", "gust", loop, effort.gust_rates, effort.gust_segments, effort.search
        ),
        *guarantees.lft_bounds("baseline", "gust", loop),
    ]
    if effort.thorough:
        found += guarantees.memory_bounds(
            "baseline", "gust", loop, effort.gust_rates, effort.search
        )
        exact = ExactLateral.of(heli).loop("gust")
        found += guarantees.bounds(
            "exact", "gust", exact, effort.exact_rates, effort.gust_segments, effort.search
        )
    return GustProofs(bounds=tuple(found), exact_frozen=exact_frozen)


def prove_longitudinal(heli: Helicopter, effort: Effort) -> LongitudinalProofs:
    """Baseline, continuous time."""
    loop = longitudinal_loop(heli)
    found = [
        *guarantees.bounds(
            "baseline",
            "longitudinal",
            loop,
            effort.longitudinal_rates,
            effort.gust_segments,
            GLANCE,
        ),
        *guarantees.lft_bounds("baseline", "longitudinal", loop),
    ]
    return LongitudinalProofs(bounds=tuple(found))


def prove_servo(
    heli: Helicopter, baseline: Baseline, identification: Identification, effort: Effort
) -> ServoProofs:
    """Baseline and identified models, with effort the exact ones; 50 Hz."""
    exact_frozen = guarantees.exact_frozen_gain(baseline.nodes, sampled=True)
    aggressive = identification.of(LATERAL, NOISES[0]).model
    loops = guarantees.servo_loops(
        heli if effort.thorough else None, baseline.nodes, identification.gentle, aggressive
    )
    found, peaks = [], {}
    for name, loop in loops.items():
        peaks[name] = frozen_gain(loop)
        found += guarantees.bounds(
            name, "servo", loop, effort.servo_rates, effort.servo_segments, GLANCE
        )
        if effort.thorough and guarantees.has_lft(loop):
            found += guarantees.lft_bounds(name, "servo", loop)
    return ServoProofs(bounds=tuple(found), exact_frozen=exact_frozen, frozen_peaks=peaks)
