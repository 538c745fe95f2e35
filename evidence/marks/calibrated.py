"""How near a calibrated vehicle comes to the one that flew: from flights of one X-Cell, starting
from the numbers of another.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import calibrate
from studies.known_kinematics.flights import aggressive
from studies.known_kinematics.models import PAIRS
from studies.known_kinematics.truth import FrozenAxes, Truth
from studies.output import as_json
from studies.setup.flights import autopilot_for
from symheli import Helicopter
from symheli.errors import DataWarning, TrimError
from symheli.values.arrays import Array

ELSEWHERE = 0.3
"""Largest relative error of the start where the other vehicle has no number of its own."""

WITHIN = 2.5
"""Standard deviations within which a determined parameter is expected."""

KINDS = ("before", "gaps")
LIMITS = {"nu-gap": 0.03, "within": 0.95}


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Of one seed. `gaps`, `before`: worst nu-gap by axis of the calibrated vehicle and of the
    start (1 where it cannot hover); `errors`: of the determined parameters, in their standard
    deviations.
    """

    seed: int
    gaps: dict[str, float]
    before: dict[str, float]
    errors: Array
    steps: int
    converged: bool


def start_of(heli: Helicopter, other: Helicopter, seed: int) -> Helicopter:
    """The structure of `heli` with the published numbers of `other`, and its own, wrong by up to
    30 %, where that has none.
    """
    rng = np.random.default_rng(seed)
    changes = {}
    for name, own in heli.vehicle.quantities.items():
        if name.startswith("controls.") or name.endswith(".blades"):
            continue
        theirs = other.vehicle.quantities.get(name)
        off = own.value * (1.0 + rng.uniform(-ELSEWHERE, ELSEWHERE))
        changes[name] = theirs.value if theirs and not theirs.assumed else off
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return heli.with_parameters(changes)


def of_seed(seed: int, truth: str = "xcell60") -> Marks:
    """Fly, calibrate, judge."""
    heli, other = (Helicopter.load(name, governor="ideal") for name in (truth, PAIRS[truth]))
    flight = symheli.fly(heli, aggressive(seed, autopilot_for(heli)))
    start = start_of(heli, other, seed)
    found = calibrate(start, flight)
    exact = Truth.of(heli)
    true = heli.parameters.array[[heli.parameters.signals.index(p) for p in found.parameters]]
    errors = (found.values - true) / found.deviations
    models: dict[str, FrozenAxes] = {"calibrated": Truth.of(found.heli).models}
    with contextlib.suppress(TrimError):  # some starts do not even hover
        models["start"] = Truth.of(start).models
    gaps = {
        name: {axis: float(one["model"].gap.max()) for axis, one in exact.compare(m).items()}
        for name, m in models.items()
    }
    return Marks(
        seed=seed,
        gaps=gaps["calibrated"],
        before=gaps.get("start", dict.fromkeys(gaps["calibrated"], 1.0)),
        errors=errors[found.determined],
        steps=found.steps,
        converged=found.converged,
    )


def table(truth: str, marks: Sequence[Marks]) -> str:
    """Median and worst of every mark over the seeds."""
    rows = []
    for axis in marks[0].gaps:
        before, after = (np.array([getattr(m, kind)[axis] for m in marks]) for kind in KINDS)
        k = int(after.argmax())
        rows.append(
            (
                axis,
                f"{np.median(before):.3f}",
                f"{np.median(after):.5f}",
                f"{after[k]:.5f} ({marks[k].seed})",
            )
        )
    errors = np.concatenate([m.errors for m in marks])
    share = float(np.mean(np.abs(errors) <= WITHIN))
    counts = [len(m.errors) for m in marks]
    worst = max(m.gaps["all axes"] for m in marks)
    median = float(np.median([m.gaps["all axes"] for m in marks]))
    verdict = "met" if median <= LIMITS["nu-gap"] and share >= LIMITS["within"] else "MISSED"
    return "\n".join(
        [
            f"Flights of {truth}, start from {PAIRS[truth]}, {len(marks)} seeds from"
            f" {marks[0].seed} to {marks[-1].seed}; worst nu-gap over airspeed.",
            "",
            markdown(("axes", "start, median", "calibrated, median", "worst (seed)"), rows),
            "",
            f"Parameters called determined: {min(counts)} to {max(counts)} a flight; {share:.1%} of"
            f" {len(errors)} lie within {WITHIN:g} standard deviations of the truth, their errors"
            f" have a root mean square of {np.sqrt(np.mean(errors**2)):.2f} deviations, the largest"
            f" {np.abs(errors).max():.1f}. All searches converged:"
            f" {'yes' if all(m.converged for m in marks) else 'no'}.",
            f"Marks: nu-gap in all axes {LIMITS['nu-gap']:g} (median {median:.4f}, worst"
            f" {worst:.4f}), {LIMITS['within']:.0%} within {WITHIN:g} deviations: {verdict}.",
        ]
    )


def main() -> None:
    """Print the marks of a vehicle, and keep them in docs/identified.md."""
    parser = parser_of(__doc__, "0-20")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    options = parsed(parser, "identified.md", timed=False)
    calls = [partial(of_seed, seed, options.truth) for seed in seeds_of(options)]
    marks = list(over_seeds(options, calls))
    text = table(options.truth, marks)
    print(as_json([vars(m) for m in marks]) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", f"{options.truth} calibrated", text)


if __name__ == "__main__":
    from evidence.marks import (
        calibrated,  # under its own name: its results are handed on and stored by it
    )

    calibrated.main()
