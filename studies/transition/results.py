"""All numbers of the report with their units for programs, as results.schema.json describes
them.
"""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from studies.known_kinematics.truth import SPEEDS
from studies.output import plain
from studies.report.provenance import provenance
from studies.setup.axis_models import HORIZON
from studies.setup.bounds import unit_of
from studies.setup.certificates import bound_to_dict
from studies.setup.quantities import named, value, values
from studies.transition.comparison import FAST
from studies.transition.held import held_to_dict
from studies.transition.paper_experiment import PERIOD
from studies.transition.saved_proofs import proof_file
from studies.transition.written_controllers import controllers_to_dict

if TYPE_CHECKING:
    from identification.judge import Scores
    from identification.judge.frozen_models import FrozenModels
    from studies.known_kinematics.rivals import KnownKinematics
    from studies.setup.flights import StudyRecords
    from studies.transition.baseline import Baseline
    from studies.transition.comparison import Comparisons
    from studies.transition.first_look import FirstLook
    from studies.transition.identified import Identification
    from studies.transition.outcome import Outcome
    from studies.transition.paper_experiment import OutputResult, PaperExperiment
    from studies.transition.real_conditions import RealConditions
    from studies.transition.recovery import Recovery
    from symheli.values import Signal

SCHEMA = "symheli study 8"
LIBRARIES = ("symheli", "casadi", "numpy", "scipy", "cvxpy", "clarabel")


def to_dict(study: Outcome) -> dict[str, Any]:
    """Return the results computed so far; null where there are none."""
    return {
        "schema": SCHEMA,
        "vehicle": study.vehicle,
        "quick": study.quick,
        "seed": study.seed,
        "effort": plain(asdict(study.effort)),
        "complete": study.complete,
        "horizon": value(HORIZON, "s"),
        "versions": (
            {name: version(name) for name in LIBRARIES} | {"python": platform.python_version()}
        ),
        "provenance": provenance(),
        "stage_time": named(study.seconds, "s"),
        "baseline": study.baseline and _baseline(study.baseline),
        "paper_experiment": (
            study.paper_experiment and [_experiment(e) for e in study.paper_experiment.runs]
        ),
        "exact_recovery": (
            study.exact_recovery and [_recovery(r) for r in study.exact_recovery.runs]
        ),
        "flights": study.flights and _flights(study.flights),
        "identification": study.identification and _identification(study.identification),
        "comparison": study.comparison and _comparison(study.comparison),
        "known_kinematics": study.known_kinematics and _known_kinematics(study.known_kinematics),
        "real_conditions": study.real_conditions and _real_conditions(study.real_conditions),
        "guarantees": _guarantees(study),
        "controllers": controllers_to_dict(study),
        "held": held_to_dict(study),
    }


def _scores(scores: Scores) -> dict[str, Any]:
    return {
        "one_step": named(scores.one_step, "%"),
        "ahead": named(scores.ahead, "%"),
        "free_run": named(scores.free_run, "%"),
    }


def _over_airspeed(miss: Mapping[float, float]) -> dict[str, Any]:
    return {"airspeed": values(miss, "m/s"), "miss": values(miss.values(), "%")}


def _baseline(b: Baseline) -> dict[str, Any]:
    return {
        "nodes": values(b.nodes.airspeeds, "m/s"),
        "kinks": [
            {"name": name, "airspeed": values(speeds, "m/s")}
            for name, speeds in b.between.kinks.items()
        ],
        "lft_order": value(b.lft.order, "1"),
        "lft_order_reduced": value(b.reduced.order, "1"),
        "lft_error": value(b.lft_error, "1"),
        "entries": [
            {
                "name": e.name,
                "range": value(e.span, "SI"),
                "largest_error": {
                    kind.replace(" ", "_"): value(share, "%") for kind, share in e.percent.items()
                },
            }
            for e in b.entries
        ],
        "entries_no_polynomial_fits": [e.name for e in b.unfit],
        "trim": {
            str(name): _trim(b, name) for name in (*b.nodes.states, *b.nodes.trims[0].u.signals)
        },
        "first_look": _first_look(b.look),
    }


def _first_look(look: FirstLook) -> dict[str, Any]:
    return {
        "answer": look.answer,
        "travel": named({u: math.degrees(t) for u, t in look.travel.items()}, "deg"),
        "stopped": [
            {"airspeed": value(v, "m/s"), "controls": list(names)}
            for v, names in look.stopped.items()
        ],
        "airspeeds": [
            {
                "airspeed": value(one.trim.airspeed, "m/s"),
                "attitude": named(
                    {s: math.degrees(one.trim.x[s]) for s in ("theta", "phi")}, "deg"
                ),
                "controls": named(
                    {str(u): math.degrees(one.trim.u[u]) for u in one.trim.u.signals}, "deg"
                ),
                "least_stable": _pole(one.least_stable),
                "modes": {name: _pole(z) for name, z in one.modes.items()},
                "roll_hold": one.margins
                and {
                    "stable": one.margins.hold.stable,
                    "gain": value(one.margins.hold.gain[1], "1"),
                    "phase": value(math.degrees(one.margins.hold.phase), "deg"),
                    "delay": value(1000 * one.margins.hold.delay, "ms"),
                },
            }
            for one in look.shown
        ],
    }


def _pole(z: complex) -> dict[str, Any]:
    return {"real": value(z.real, "rad/s"), "imaginary": value(z.imag, "rad/s")}


def _trim(b: Baseline, name: Signal) -> dict[str, Any]:
    """A state or input at the trim of every node."""
    return values((t.x[name] if name in t.x else t.u[name] for t in b.nodes.trims), name.unit)


def _experiment(e: PaperExperiment) -> dict[str, Any]:
    return {
        "loop": e.loop,
        "period": value(PERIOD, "s"),
        "cubic_basis_refused_because": e.cubic_refused,
        "outputs": [_channel(c) for c in e.channels],
    }


def _channel(c: OutputResult) -> dict[str, Any]:
    one, ahead, free = c.fits.values()
    return {
        "output": c.output,
        "one_step": value(one, "%"),
        "ahead": value(ahead, "%"),
        "free_run": value(free, "%"),
        "settled_after": value(c.settled_after, "s"),
        "parameters": [
            {"name": name, "value": float(number)}
            for name, number in zip(c.parameter_names, c.parameters[-1], strict=True)
        ],
        "largest_errors": [
            {"time": value(t, "s"), "standard_deviations": value(size, "1")} for t, size in c.spikes
        ],
        "airspeed_at_largest_error": value(c.spike_airspeed, "m/s"),
        "input_before_largest_error": value(c.spike_input, "1"),
    }


def _recovery(r: Recovery) -> dict[str, Any]:
    return {
        "period": value(r.period, "s"),
        "degree": r.degree,
        "a_error": value(r.A_error, "SI"),
        "b_error": value(r.B_error, "SI"),
        "discretization_misfit": value(r.discretization_misfit, "SI"),
    }


def _flights(flights: StudyRecords) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "samples": len(record),
            "period": value(record.dt, "s"),
            "note": record.note,
            "top_airspeed": value(record["airspeed"].max(), "m/s"),
        }
        for name, record in flights.named().items()
    ]


def _identification(found: Identification) -> dict[str, Any]:
    return {
        "models": [
            {
                "axis": one.axis.name,
                "noise": one.noise,
                **_scores(one.scores),
                "rotor_mode": _over_airspeed(one.mode_miss),
            }
            for one in found.axes
        ],
        "update_time": [
            {"axis": axis, "time": value(seconds, "s")}
            for axis, seconds in found.update_times.items()
        ],
        "noisy_rotor_modes": [
            {"axis": one.axis.name, "method": one.method, "rotor_mode": _over_airspeed(one.miss)}
            for one in found.noisy_modes
        ],
        "first_stage_f": [
            {"axis": axis, "weakest_direction": value(F, "1")}
            for axis, F in found.first_stage.items()
        ],
    }


def _comparison(found: Comparisons) -> dict[str, Any]:
    return {
        "predictions": [
            {
                "axis": one.axis.name,
                "noise": one.noise,
                "predictor": p.name,
                "identified": p.identified,
                **_scores(p.scores),
            }
            for one in found.predictions
            for p in one.found.predictions
        ],
        "frozen": [
            {"axis": one.axis.name, "mode": one.axis.mode, **_frozen(one.found)}
            for one in found.frozen
        ],
    }


def _frozen(f: FrozenModels) -> dict[str, Any]:
    def poles(stack: Iterable[Any]) -> list[list[dict[str, float]]]:
        return [[{"real": float(z.real), "imag": float(z.imag)} for z in row] for row in stack]

    baseline, identified = f["baseline"], f["identified"]
    return {
        "airspeed": values(f.points, "m/s"),
        "poles": {
            "exact": poles(f.reference.poles),
            "baseline": poles(baseline.poles),
            "identified": poles(identified.poles),
            "unit": "rad/s",
        },
        "mode_miss": _both(baseline.miss, identified.miss, "%"),
        "chordal_distance": {
            "from_frequency": value(FAST, "rad/s"),
            **_both(baseline.distance, identified.distance, "1"),
        },
        "nu_gap": _both(baseline.gap, identified.gap, "1"),
    }


def _both(baseline: Iterable[float], identified: Iterable[float], unit: str) -> dict[str, Any]:
    return {"baseline": values(baseline, unit), "identified": values(identified, unit)}


def _known_kinematics(found: KnownKinematics) -> dict[str, Any]:
    return {
        "training_flights": [
            {"name": name, "duration": value(seconds, "s")} for name, seconds in found.flown.items()
        ],
        "simulator": found.simulator,
        "airspeed": values(SPEEDS, "m/s"),
        "models": [
            {
                "name": rival.name,
                "ahead": named(rival.ahead, "%"),
                "axes": [
                    {
                        "axis": axis,
                        "nu_gap": values(gaps, "1"),
                        "airspeeds_of_other_stability": value(rival.unlike[axis], "1"),
                    }
                    for axis, gaps in rival.gaps.items()
                ],
                "static_gain": {
                    "airspeed": values(rival.static, "m/s"),
                    "share_of_exact": values(rival.static.values(), "1"),
                },
            }
            for rival in found.rivals
        ],
        "margins": [
            {"loop": loop, "margin": values(margins, "1")}
            for loop, margins in found.margins.items()
        ],
        "update_time": value(found.update_time, "s"),
    }


def _real_conditions(real: RealConditions) -> dict[str, Any]:
    delay = {"true": value(real.delay, "s")}
    if real.found is not None:
        found, deviation = real.found
        delay |= {"found": value(found, "s"), "deviation": value(deviation, "s")}
    return {
        "flight": real.about,
        "simulator": real.simulator,
        "airspeed": values(SPEEDS, "m/s"),
        "nu_gap": values(() if real.gap is None else real.gap, "1"),
        "delay": delay,
        "reason": real.reason,
    }


def _guarantees(study: Outcome) -> dict[str, Any]:
    return {
        "exact_frozen_gain": {
            channel: value(found, unit_of(channel)) for channel, found in study.exact_frozen.items()
        },
        "servo_frozen_peaks": [
            {
                "model": name,
                "gain": value(peak.gain, "1"),
                "airspeed": value(peak.p, "m/s"),
                "frequency": value(peak.omega, "rad/s"),
            }
            for name, peak in (study.servo.frozen_peaks.items() if study.servo else ())
        ],
        "bounds": [bound_to_dict(b, proof_file(b)) for b in study.bounds],
    }
