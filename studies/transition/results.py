"""Every number of the report with its unit, as a program would read it."""

from __future__ import annotations

import math
import platform
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from studies.transition.axes import HORIZON
from studies.transition.comparison import FAST
from studies.transition.paper_experiment import PERIOD

if TYPE_CHECKING:
    from studies.transition.baseline import Baseline
    from studies.transition.comparison import Comparison, FrozenComparison
    from studies.transition.guarantees import Bound
    from studies.transition.outcome import Outcome
    from studies.transition.paper_experiment import Experiment


def value(number: float, unit: str) -> dict[str, Any]:
    """{"value", "unit"}; infinite and undefined numbers as the strings "inf", "-inf", "nan" (JSON
    has none).
    """
    number = float(number)
    return {"value": number if math.isfinite(number) else str(number), "unit": unit}


def named(numbers: dict[Any, float], unit: str) -> dict[str, Any]:
    """One `value` a name."""
    return {str(name): value(number, unit) for name, number in numbers.items()}


def to_dict(study: Outcome) -> dict[str, Any]:
    """Nested dictionary of what the study has reached."""
    out: dict[str, Any] = {
        "schema": "symheli study 1",
        "vehicle": study.vehicle,
        "quick": study.quick,
        "seed": study.seed,
        "complete": study.complete,
        "versions": (
            {
                name: version(name)
                for name in ("symheli", "casadi", "numpy", "scipy", "cvxpy", "clarabel")
            }
            | {"python": platform.python_version()}
        ),
        "stage time": named(study.seconds, "s"),
    }
    if study.baseline:
        out["baseline"] = _baseline(study.baseline)
    out["paper experiment"] = {e.loop: _experiment(e) for e in study.experiments}
    out["exact recovery"] = [
        {
            "period": value(r.period, "s"),
            "degree": r.degree,
            "A error": value(r.A_error, "SI"),
            "B error": value(r.B_error, "SI"),
            "misfit of the discrete polynomial fit": value(r.discretization_misfit, "SI"),
        }
        for r in study.recoveries
    ]
    out["flights"] = {
        name: {
            "samples": len(record),
            "period": value(record.dt, "s"),
            "note": record.note,
            "top airspeed": value(record["airspeed"].max(), "m/s"),
        }
        for name, record in study.flights.items()
    }
    out["identification"] = {
        f"{axis}, {noise}": {
            "one step": named(s.one_step, "%"),
            f"{HORIZON:g} s ahead": named(s.one_second, "%"),
            "free run": named(s.free_run, "%"),
            "rotor mode miss by airspeed in m/s": named(s.mode_miss, "%"),
        }
        for (axis, noise), s in study.scores.items()
    }
    out["time of one recursive update"] = named(study.update_times, "s")
    out["rotor mode miss at 30 dB, order 2"] = {
        f"{axis}, {method}": named(misses, "%")
        for (axis, method), misses in study.noisy_modes.items()
    }
    out["first-stage F of the instruments at 30 dB, worst direction"] = named(
        study.first_stage, "1"
    )
    out["comparison"] = {
        f"{axis}, {noise}": _comparison(c) for (axis, noise), c in study.comparisons.items()
    }
    out["frozen comparison"] = {name: _frozen(f) for name, f in study.frozen.items()}
    out["frozen gain of the exact models"] = {
        k: value(v, "(rad/s, rad)/(m/s)" if k == "gust" else "1")
        for k, v in study.exact_frozen.items()
    }
    out["largest frozen gain of the servo loops"] = {
        name: {
            "gain": value(peak.gamma, "1"),
            "airspeed": value(peak.p, "m/s"),
            "frequency": value(peak.omega, "rad/s"),
        }
        for name, peak in study.frozen_peaks.items()
    }
    out["guarantees"] = [bound_to_dict(b) for b in study.bounds]
    return out


def _baseline(b: Baseline) -> dict[str, Any]:
    return {
        "nodes": {"value": b.nodes.airspeeds.tolist(), "unit": "m/s"},
        "kinks": {
            name: {"value": list(speeds), "unit": "m/s"} for name, speeds in b.between.kinks.items()
        },
        "LFT order": value(b.lft.order, "1"),
        "LFT order, reduced exactly": value(b.reduced.order, "1"),
        "LFT error, relative": value(b.lft_error, "1"),
        "entries": {
            e.name: {
                "range": value(e.span, "SI"),
                "largest error in percent of the range": named(e.percent, "%"),
            }
            for e in b.entries
        },
        "entries no polynomial fits": [e.name for e in b.unfit],
        "trim": {
            str(name): {
                "value": [t.x[name] if name in t.x else t.u[name] for t in b.nodes.trims],
                "unit": name.unit,
            }
            for name in (*b.nodes.states, *b.nodes.trims[0].u.signals)
        },
    }


def _experiment(e: Experiment) -> dict[str, Any]:
    return {
        "period": value(PERIOD, "s"),
        "cubic basis refused because": e.cubic_refused,
        "outputs": {
            c.output: {
                "fit": named(c.fits, "%"),
                "parameters settled after": value(c.settled_after, "s"),
                "final parameters, powers of p in m/s": dict(
                    zip(c.parameter_names, map(float, c.parameters[-1]), strict=True)
                ),
                "largest one-step errors": [
                    {"time": value(t, "s"), "standard deviations": value(size, "1")}
                    for t, size in c.spikes
                ],
                "airspeed at the largest error": value(c.spike_airspeed, "m/s"),
                "input behind the largest error, in its standard deviations": value(
                    c.spike_input, "1"
                ),
            }
            for c in e.channels
        },
    }


def _comparison(c: Comparison) -> dict[str, Any]:
    return {
        p.name: {
            "one step": named(p.one_step, "%"),
            f"{HORIZON:g} s ahead": named(p.one_second, "%"),
            "free run": named(p.free_run, "%"),
        }
        for p in c.predictors
    }


def _frozen(f: FrozenComparison) -> dict[str, Any]:
    def poles(stack: tuple[Any, ...]) -> list[Any]:
        return [[[float(z.real), float(z.imag)] for z in row] for row in stack]

    return {
        "airspeeds": {"value": f.airspeeds.tolist(), "unit": "m/s"},
        "poles [real, imaginary]": {
            "exact": poles(f.exact_poles),
            "baseline": poles(f.baseline_poles),
            "identified": poles(f.identified_poles),
            "unit": "rad/s",
        },
        f"{f.axis.mode} mode miss": {
            "baseline": f.mode_miss_baseline.tolist(),
            "identified": f.mode_miss_identified.tolist(),
            "unit": "%",
        },
        f"largest chordal distance to the exact model above {FAST:g} rad/s": {
            "baseline": f.fast_baseline.tolist(),
            "identified": f.fast_identified.tolist(),
            "unit": "1",
        },
        "nu-gap to the exact model": {
            "baseline": f.gap_baseline.tolist(),
            "identified": f.gap_identified.tolist(),
            "unit": "1",
        },
    }


def bound_to_dict(b: Bound) -> dict[str, Any]:
    """One certificate."""
    c = b.certificate
    unit = "1" if b.channel == "servo" else "(rad/s, rad)/(m/s)"
    return {
        "model": b.model,
        "channel": b.channel,
        "kind": c.kind,
        "form": b.form,
        "permitted acceleration": value(b.rate, "m/s^2"),
        "proven gain": value(c.gamma, unit),
        "lower bound": value(c.lower, unit),
        "frozen gain": value(c.frozen, unit),
        "status": c.status.value,
        "verified": c.verified,
        "solver": c.solver,
        "time": value(sum(c.seconds), "s"),
        "hypotheses": list(c.hypotheses),
    }
