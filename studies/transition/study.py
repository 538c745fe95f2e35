"""The main job: from the helicopter's equations to certified gains, on the baseline and on the
identified model.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from studies.loops.exact_lateral import ExactLateral
from studies.loops.longitudinal import longitudinal_loop
from studies.transition import axes, guarantees
from studies.transition.axes import ALL, AXES, LATERAL, LATERAL_WITH_COLLECTIVE, LONGITUDINAL, Axis
from studies.transition.baseline import build_baseline
from studies.transition.comparison import compare, compare_frozen
from studies.transition.effort import GLANCE, Effort
from studies.transition.flights import FlightPlan, autopilot_for
from studies.transition.outcome import Outcome
from studies.transition.paper_experiment import PERIOD, run_experiment
from studies.transition.recovery import recover
from studies.transition.report import write_report, write_results
from studies.transition.results import to_dict
from studies.transition.summary import summary
from symheli import Helicopter
from synthesis import frozen_gain


class Study(Outcome):
    """An `Outcome` that can tell what it found."""

    def summary(self) -> str:
        """The short table printed at the end."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Every number of the report with its unit."""
        return to_dict(self)


def run_study(
    vehicle: str = "xcell60", out: Path | str = "study", quick: bool = False, seed: int = 0
) -> Study:
    """Run every stage, write results.json after each, and report.html with its figures into `out`
    at the end.

    Progress goes to standard error. An interrupted run leaves the results of its finished stages;
    files are whole or absent.
    """
    out = Path(out)
    study = Study(vehicle, quick, seed)
    effort = Effort.look() if quick else Effort()
    for title, stage in _stages(study, effort):
        with _shown(title, study.seconds):
            stage()
        write_results(study, out)
    study.complete = True
    with _shown("Writing figures and report", study.seconds):
        write_report(study, out)
    return study


def _stages(study: Study, effort: Effort) -> Iterator[tuple[str, Any]]:
    yield "Model and baseline: trim, linearize, interpolate, LFT", lambda: _baseline(study)
    yield "The paper's experiment, open and closed loop", lambda: _paper(study)
    yield "Exact recovery of A(p), B(p)", lambda: _recovery(study)
    yield "Flying the transitions", lambda: _fly(study, effort)
    yield "Identifying and scoring", lambda: _identify(study)
    yield "Comparing with the baseline", lambda: _compare(study)
    yield (
        "Proving gains of the lateral gust loop (baseline and exact, continuous)",
        lambda: _prove_gust(study, effort),
    )
    if effort.longitudinal_rates:
        yield (
            "Proving gains of the longitudinal gust loop (baseline, continuous)",
            lambda: _prove_longitudinal(study, effort),
        )
    yield (
        "Proving gains of the servo loop (exact, baseline and identified, 50 Hz)",
        lambda: _prove_servo(study, effort),
    )


@contextmanager
def _shown(title: str, seconds: dict[str, float]) -> Iterator[None]:
    """Title while it runs, time when done."""
    live = sys.stderr.isatty()
    print(f"  {title} ...", end="" if live else "\n", file=sys.stderr, flush=True)
    begin = time.perf_counter()
    yield
    seconds[title] = time.perf_counter() - begin
    print(
        f"\r  {title} ... {seconds[title]:.1f} s" if live else f"    {seconds[title]:.1f} s",
        file=sys.stderr,
        flush=True,
    )


def _need(thing: Any) -> Any:
    assert thing is not None, "stages run in order"  # noqa: S101
    return thing


def _baseline(study: Study) -> None:
    study.heli = Helicopter.load(study.vehicle, governor="ideal")
    study.baseline = build_baseline(study.heli)


def _paper(study: Study) -> None:
    family = _need(study.baseline).nodes
    study.experiments = [run_experiment(family, closed, study.seed) for closed in (False, True)]


def _recovery(study: Study) -> None:
    study.recoveries = [
        recover(_need(study.baseline).nodes, period, seed=study.seed) for period in (0.02, PERIOD)
    ]


def _fly(study: Study, effort: Effort) -> None:
    heli = _need(study.heli)
    autopilot = autopilot_for(heli)
    clean = FlightPlan(study.seed, ramps=effort.ramps)
    for name, plan in (("noise-free", clean), ("30 dB", clean.noisy())):
        study.flights[f"training, {name}"] = plan.training(heli, autopilot)
        study.flights[f"test, {name}"] = plan.test(heli, autopilot)
    study.flights["gentle"] = clean.gentle(heli, autopilot, effort.gentle_ramps)


def _identify(study: Study) -> None:
    heli = _need(study.heli)
    for noise in ("noise-free", "30 dB"):
        training, test = study.flights[f"training, {noise}"], study.flights[f"test, {noise}"]
        for axis in (LONGITUDINAL, LATERAL, LATERAL_WITH_COLLECTIVE, ALL):
            # MIMO by batch least squares: the same numbers as the recursion, which is shown on the
            # two-input axes
            model = axes.identify(axis, training, "rls" if axis in AXES else "ls")
            study.models[f"{axis.name}, {noise}"] = model
            study.scores[axis.name, noise] = axes.scores(heli, axis, model, test)
    study.update_times = {
        axis.name: axes.update_time(axis, study.flights["training, 30 dB"]) for axis in (*AXES, ALL)
    }
    for axis in AXES:
        for method in ("ls", "iv"):
            model = axes.identify(axis, study.flights["training, 30 dB"], method, order=2)
            study.noisy_modes[axis.name, method] = axes.mode_misses(heli, model, axis.mode)
        study.first_stage[axis.name] = model.details["first_stage_F"]  # of "iv", the last
    study.models["lateral, gentle"] = axes.identify(
        LATERAL, study.flights["gentle"], "rls", order=2
    )


def _compare(study: Study) -> None:
    lpv = _need(study.baseline).lpv
    baselines = {
        "baseline, cubic": (lpv["polynomial 3"], True),
        "baseline, cubic, trim drift left out": (lpv["polynomial 3"], False),
        "baseline, spline": (lpv["spline"], True),
    }
    for noise in ("noise-free", "30 dB"):
        for axis in AXES:
            identified = {
                name: study.models[f"{which.name}, {noise}"]
                for name, which in _rivals(axis).items()
            }
            study.comparisons[axis.name, noise] = compare(
                axis, identified, baselines, study.flights[f"test, {noise}"]
            )
    for axis in AXES:
        speeds = [0.5, 1.0, 2.0, 3.0, 4.0, 5.5, 7.0, 8.5, 10.0, 11.5, 12.5]
        study.frozen[axis.name] = compare_frozen(
            _need(study.heli),
            axis,
            study.models[f"{axis.name}, noise-free"],
            lpv["polynomial 3"],
            speeds,
        )


def _rivals(axis: Axis) -> dict[str, Axis]:
    rivals = {"LPV-ARX, two inputs": axis}
    if axis is LATERAL:
        rivals["LPV-ARX, other inputs measured"] = LATERAL_WITH_COLLECTIVE
    return rivals | {"LPV-ARX, MIMO": ALL}


def _prove_gust(study: Study, effort: Effort) -> None:
    family = _need(study.baseline).nodes
    study.exact_frozen["gust"] = guarantees.exact_frozen_gain(family, sampled=False)
    loop = guarantees.gust_loop(family)
    study.bounds += guarantees.bounds(
        "baseline", "gust", loop, effort.gust_rates, effort.gust_segments, effort.search
    )
    study.bounds += guarantees.lft_bounds("baseline", "gust", loop)
    if effort.thorough:
        study.bounds += guarantees.memory_bounds(
            "baseline", "gust", loop, effort.gust_rates, effort.search
        )
        exact = ExactLateral.of(_need(study.heli)).loop("gust")
        study.bounds += guarantees.bounds(
            "exact", "gust", exact, effort.exact_rates, effort.gust_segments, effort.search
        )


def _prove_longitudinal(study: Study, effort: Effort) -> None:
    loop = longitudinal_loop(_need(study.heli))
    study.bounds += guarantees.bounds(
        "baseline", "longitudinal", loop, effort.longitudinal_rates, effort.gust_segments, GLANCE
    )
    study.bounds += guarantees.lft_bounds("baseline", "longitudinal", loop)


def _prove_servo(study: Study, effort: Effort) -> None:
    family = _need(study.baseline).nodes
    study.exact_frozen["servo"] = guarantees.exact_frozen_gain(family, sampled=True)
    gentle, aggressive = (
        study.models["lateral, gentle"],
        study.models[f"{LATERAL.name}, noise-free"],
    )
    for name, loop in guarantees.servo_loops(
        _need(study.heli) if effort.thorough else None, family, gentle, aggressive
    ).items():
        study.frozen_peaks[name] = frozen_gain(loop)
        study.bounds += guarantees.bounds(
            name, "servo", loop, effort.servo_rates, effort.servo_segments, GLANCE
        )
        if effort.thorough and guarantees.has_lft(loop):
            study.bounds += guarantees.lft_bounds(name, "servo", loop)
