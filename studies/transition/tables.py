"""The study's tables as rows of text, shared by the printed summary and the report."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from studies.known_kinematics import models
from studies.known_kinematics.truth import SPEEDS
from studies.setup.axes import ALL, AXES, LATERAL, LATERAL_WITH_COLLECTIVE
from studies.setup.axis_models import FROZEN_SPEEDS, RATES
from studies.setup.flights import NOISES
from studies.transition.campaign import MODE_MARK
from studies.transition.comparison import DRIFT_LEFT_OUT
from studies.transition.known_kinematics import KNOWN, SPLINE
from synthesis.design.loops.loop_measures import MEASURES

LEVEL = 3.0
"""Points between fits that are called level: what another seed changes."""

if TYPE_CHECKING:
    from studies.known_kinematics.rivals import KnownKinematics
    from studies.transition.comparison import ComparedAxis
    from studies.transition.first_look import FirstLook
    from studies.transition.identified import Identification
    from studies.transition.outcome import Outcome
    from studies.transition.real_conditions import RealConditions


@dataclass
class Table:
    """Heading, column names, rows of text, and remarks below; `bold` marks cells (row, column) that
    stand out. A report knows it by `name`; `source` is where results.json has its numbers.
    """

    title: str
    columns: list[str]
    rows: list[list[str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    bold: set[tuple[int, int]] = field(default_factory=set)
    name: str = ""
    source: str = ""

    def text(self) -> str:
        """Aligned plain text."""
        widths = [
            max(len(row[i]) for row in [self.columns, *self.rows]) for i in range(len(self.columns))
        ]
        lines = [self.title]
        for row in [self.columns, *self.rows]:
            first, *rest = (
                cell.ljust(w) if i == 0 else cell.rjust(w)
                for i, (cell, w) in enumerate(zip(row, widths, strict=True))
            )
            lines.append("  " + "  ".join([first, *rest]))
        return "\n".join([*lines, *(f"  {remark}" for remark in self.remarks)])


def diverges(fit: float) -> bool:
    """Whether a fit in percent means nothing any more: an error eleven times the signal.

    >>> diverges(-998.0), diverges(-1000.0), diverges(float("nan"))
    (False, True, True)
    """
    return not math.isfinite(fit) or fit < -999


def percent(number: float) -> str:
    """A fit: one decimal, "diverges" where it means nothing."""
    return "diverges" if diverges(number) else f"{number:.1f}"


def gain(number: float) -> str:
    """A gain with three digits."""
    return "none" if math.isinf(number) else "-" if math.isnan(number) else f"{number:.3g}"


def first_look(look: FirstLook) -> Table:
    """The helicopter by itself, a column an airspeed."""
    shown = look.shown
    table = Table(
        "The helicopter by itself: trim, modes, and margins of a roll hold, over airspeed",
        ["", *(f"{one.trim.airspeed:g} m/s" for one in shown)],
        name="first-look",
        source="baseline.first_look",
    )
    for name, s in (("pitch", "theta"), ("bank", "phi")):
        cells = [f"{math.degrees(one.trim.x[s]):.1f}" for one in shown]
        table.rows.append([f"{name} (deg)", *cells])
    for u, travel in look.travel.items():
        cells = [
            f"{math.degrees(one.trim.u[u]):.1f}{' (stop)' if u in one.trim.on_stops else ''}"
            for one in shown
        ]
        table.rows.append([f"{u} of {math.degrees(travel):.1f} (deg)", *cells])
    table.rows.append(["least stable pole (rad/s)", *(_pole(one.least_stable) for one in shown)])
    for name in RATES:
        table.rows.append([f"{name} (rad/s)", *(_pole(one.modes[name]) for one in shown)])
    for name in ("gain", "phase", "delay"):
        cells = ["" if one.margins is None else one.margins.held.cell(name) for one in shown]
        words, unit, _ = MEASURES[name]
        table.rows.append([f"roll hold: {words} ({unit})", *cells])
    table.remarks.append(
        "Pole: real part, imaginary part; a positive real part grows. The margins of the roll hold"
        " are each alone."
    )
    return table


def _pole(z: complex) -> str:
    return f"{z.real:.2g} ± {abs(z.imag):.2g}i" if abs(z.imag) > 1e-6 else f"{z.real:.2g}"


def interpolation(study: Outcome) -> Table:
    """Entries no polynomial fits."""
    assert study.baseline is not None  # noqa: S101
    kinds = ["polynomial 2", "polynomial 3", "polynomial 4", "polynomial 6", "spline", "linear"]
    table = Table(
        "Entries of A(p), B(p) that no polynomial fits: largest error between the nodes, percent of"
        " the entry's range",
        ["entry", "range (SI)", *kinds],
        name="interpolation",
        source="baseline.entries",
    )
    for entry in study.baseline.unfit:
        table.rows.append(
            [entry.name, f"{entry.span:.3g}", *(f"{entry.percent[k]:.0f}" for k in kinds)]
        )
    kinks = sorted(
        (speed, name) for name, speeds in study.baseline.between.kinks.items() for speed in speeds
    )
    fitted = len(study.baseline.entries) - len(table.rows)
    table.remarks.append(
        f"The other {fitted} varying entries are fitted within 10 % of their range by some degree"
        " up to 6."
    )
    if kinks:
        table.remarks.append(
            "Corners of the model: "
            + ", ".join(f"{speed:.2f} m/s ({name})" for speed, name in kinks)
            + ". No smooth function follows a jump there."
        )
    return table


def experiment(study: Outcome) -> Table:
    """The paper's experiment."""
    table = Table(
        "The paper's experiment: pitch cyclic to one output, na = 3, nb = 1, delay 2, quadratic in"
        " p, p(k) = 6.5 (1 + sin(pi k/3)) m/s, T = 0.11408 s; fit in percent on a fresh record",
        [
            "loop, output",
            "one step",
            "1 s ahead",
            "free run",
            "parameters settled (s)",
            "largest one-step error (std)",
            "at (s)",
            "there p (m/s)",
            "input (std)",
        ],
        name="experiment",
        source="paper_experiment",
    )
    runs = study.paper_experiment.runs if study.paper_experiment else ()
    for e in runs:
        for c in e.channels:
            time, size = c.spikes[0]
            spike = [
                f"{size:.1f}",
                f"{time:.1f}",
                f"{c.spike_airspeed:.1f}",
                f"{c.spike_input:.1f}",
            ]
            table.rows.append(
                [
                    f"{e.loop}, {c.output}",
                    *(percent(v) for v in c.fits.values()),
                    f"{c.settled_after:.0f}",
                    *spike,
                ]
            )
    if runs:
        table.remarks.append(f"A cubic basis is refused: {runs[0].cubic_refused}.")
    return table


def scores(study: Outcome, noise: str) -> Table:
    """Return the table of identified models on the validation transition."""
    table = Table(
        "Identified LPV-ARX (order 3, quadratic in p, 50 Hz) on a transition it has not seen,"
        f" {noise}: fit in percent",
        ["model, output", "one step", "1 s ahead", "free run", "mark (1 s)"],
        name=f"scores-{NOISES.index(noise)}",
        source="identification.models",
    )
    for one in study.identification.axes if study.identification else ():
        if one.noise != noise:
            continue
        for output in one.axis.outputs:
            mark = one.axis.marks.get(output)
            wanted = f"{mark[NOISES.index(noise)]:.0f}" if mark and one.axis in AXES else ""
            fits = (percent(fit[output]) for fit in one.scores.by_horizon.values())
            table.rows.append([f"{one.axis.name}: {output}", *fits, wanted])
    return table


def modes(study: Outcome) -> Table:
    """Frozen rotor modes."""
    table = Table(
        "Frozen rotor modes: distance of the identified eigenvalue to the exact one, percent (mark"
        f" {MODE_MARK:g}, noise-free)",
        ["axis, data", *(f"{v:g} m/s" for v in FROZEN_SPEEDS)],
        name="modes",
        source="identification",
    )
    found = study.identification
    if found is None:
        return table
    for one in found.axes:
        if one.axis in AXES:
            cells = (f"{one.mode_miss[v]:.2f}" for v in FROZEN_SPEEDS)
            table.rows.append([f"{one.axis.name}, {one.noise}", *cells])
    words = {"ls": "least squares", "iv": "instrumental variables"}
    for one in found.noisy_modes:
        cells = (f"{one.miss[v]:.2f}" for v in FROZEN_SPEEDS)
        table.rows.append([f"{one.axis.name}, 30 dB, order 2, {words[one.method]}", *cells])
    table.remarks.append(
        "Noise fed back through the autopilot biases least squares; more lags hide it, the"
        " excitation as instrument removes it from the rotor modes."
    )
    weakest = ", ".join(f"{F:.2g} ({axis})" for axis, F in found.first_stage.items())
    table.remarks.append(
        "In the direction they explain worst, the slow motion, these instruments have a"
        f" first-stage F of {weakest}: below 10 they are weak, and what they say there is"
        " nearly as biased as least squares."
    )
    return table


def comparison(compared: ComparedAxis) -> Table:
    """Return the comparison of predictions, 1 s ahead and in free run."""
    outputs, predictions = compared.axis.outputs, compared.found.predictions
    table = Table(
        f"{compared.axis.name}, {compared.noise}: one step / 1 s ahead / free run on the unseen"
        " transition, fit in percent (in bold the best 1 s ahead of those that diverge at no"
        " horizon)",
        ["predictor", *outputs],
        name=f"{compared.axis.name}-{NOISES.index(compared.noise)}",
        source="comparison.predictions",
    )
    for p in predictions:
        fits = p.scores.by_horizon.values()
        cells = (" / ".join(percent(fit[y]) for fit in fits) for y in outputs)
        table.rows.append([p.name, *cells])
    for j, y in enumerate(outputs):
        sound = {
            i: p.scores.ahead[y]
            for i, p in enumerate(predictions)
            if not any(diverges(fit[y]) for fit in p.scores.by_horizon.values())
        }
        if sound:
            table.bold.add((max(sound, key=sound.__getitem__), j + 1))
    return table


def verdicts(study: Outcome) -> list[str]:
    """One sentence an output: who wins 1 s ahead, by how much."""
    out = []
    for c in study.comparison.predictions if study.comparison else ():
        predictions, sentences = c.found.predictions, []
        identified = [p.name for p in predictions if p.identified]
        baselines = [p.name for p in predictions if not p.identified and p.name != DRIFT_LEFT_OUT]
        for y in c.axis.outputs:
            one, two = (c.found.best(y, names).scores.ahead[y] for names in (identified, baselines))
            who = "the identified model" if one > two else "the baseline"
            verdict = "level" if abs(one - two) < 1 else f"{who} by {abs(one - two):.1f} points"
            sentences.append(f"{y}: {verdict}")
        out.append(f"{c.axis.name}, {c.noise}, 1 s ahead: " + "; ".join(sentences) + ".")
    return out


def findings(study: Outcome) -> list[str]:
    """Return findings of the identification and of the proofs, in sentences."""
    found = study.identification
    out = [] if found is None else [_other_inputs(found), _real_time(found)]
    for name, peak in study.servo.frozen_peaks.items() if study.servo else ():
        if math.isfinite(peak.gain):
            out.append(
                f"Servo channel, {name}: the largest frozen gain is at {peak.p:.1f} m/s and"
                f" {peak.omega:.2g} rad/s."
            )
    gentle = {
        b.model: b.certificate
        for b in study.bounds
        if b.channel == "servo" and b.rate == 0 and b.certificate.kind == "l2 gain"
    }
    for name, c in gentle.items():
        if name.startswith("identified"):
            verdict = (
                f"stable at every frozen airspeed, frozen gain {gain(c.frozen)}"
                if c.verified
                else "not stable at every frozen airspeed: nothing can be proven"
            )
            out.append(
                f"Attitude hold around the {name.replace('identified, ', 'model of the ')}:"
                f" {verdict}."
            )
    return out


def _other_inputs(found: Identification) -> str:
    """Return the benefit of measuring all inputs for the lateral axis."""
    plain, rich = (
        found.of(axis, NOISES[0]).scores.ahead for axis in (LATERAL, LATERAL_WITH_COLLECTIVE)
    )
    change = ", ".join(f"{rich[y] - plain[y]:+z.0f} points for {y}" for y in LATERAL.outputs)
    return (
        "Measuring the other inputs too (collective and pitch cyclic drive yaw through the rotor"
        f" torque) changes the 1 s fit by {change}."
    )


def _real_time(found: Identification) -> str:
    """Return the fraction of the sample period that an update takes."""
    each = ", ".join(
        f"{1e6 * seconds:.2g} us ({name})" for name, seconds in found.update_times.items()
    )
    share = 100 * found.update_times[ALL.name] / found.of(ALL, NOISES[0]).model.dt
    if share >= 50:
        return (
            f"One recursive update took {each} of processor time, {share:.0f} % of the sample"
            " period with all outputs."
        )
    return (
        f"One recursive update took {each} of processor time; with {len(ALL.outputs)} outputs and"
        f" {ALL.structure().n_regressors} regressors each that is {share:.2g} % of the sample"
        " period: the recursion is not too heavy for real time."
    )


def known_kinematics(found: KnownKinematics) -> list[Table]:
    """Return the comparison of predictions, and of models for feedback."""
    outputs = list(found.rivals[0].ahead)
    fits = Table(
        "1 s ahead on the unseen transition, against its states without noise: fit in percent",
        ["model", *outputs],
        [[r.name, *(percent(r.ahead[y]) for y in outputs)] for r in found.rivals if r.ahead],
        name="known-fits",
        source="known_kinematics.models",
    )
    axes, speeds = list(found.rivals[0].gaps), list(found.rivals[0].static)
    held = Table(
        "Airspeed held at 27 points from hover to 13 m/s: worst nu-gap to the exact model / at how"
        " many points its stability differs; static gain of the lateral loop over the exact one",
        ["model", *axes, *(f"static, {v:g} m/s" for v in speeds)],
        name="known-held",
        source="known_kinematics.models",
    )
    for r in found.rivals:
        gaps = (f"{r.gaps[a].max():.3f} / {r.unlike[a]}" if a in r.gaps else "" for a in axes)
        static = (f"{r.static[v]:.2f}" if v in r.static else "" for v in speeds)
        held.rows.append([r.name, *gaps, *static])
    held.remarks.append("Blank: the model has no such axis.")
    margins = ", ".join(
        f"{margin.min():.3f} at {SPEEDS[margin.argmin()]:g} m/s ({loop})"
        for loop, margin in found.margins.items()
    )
    held.remarks.append(
        f"Least stability margin b(P, C) of the lateral loops around the exact models: {margins}."
        " A model is of use to a loop where its nu-gap is well below."
    )
    return [fits, held]


def real_conditions(real: RealConditions) -> Table:
    """Return what one flight under real conditions gave."""
    table = Table(
        "From the commands of one flight: worst nu-gap of all axes to the exact model, of 27"
        " airspeeds held, and the delay",
        ["flight", "nu-gap", "delay found, s", "true, s"],
        name="real-conditions",
        source="real_conditions",
    )
    if real.gap is None or real.found is None:
        table.remarks.append(f"No model: {real.reason}")
        return table
    delays = " ± ".join(f"{seconds:.4f}" for seconds in real.found)
    table.rows.append([real.about, f"{real.gap.max():.3f}", delays, f"{real.delay:.4f}"])
    table.remarks.append(
        f"Instruments flown in {real.simulator}. Other conditions (late commands and sensors,"
        " 25 Hz, wind, turbulence, noise, half a flight) are counted over many seeds in"
        " docs/identified.md: python -m evidence.marks.conditions."
    )
    return table


def scheduling(found: KnownKinematics) -> Table:
    """Return the benefit of scheduling: one model minus another, output by output."""
    outputs = list(found.rivals[0].ahead)
    table = Table(
        "What moving coefficients are worth: change of the fit 1 s ahead, in points",
        ["instead of", "model", *outputs],
        name="scheduling",
        source="known_kinematics.models",
    )
    for title, one, other in (
        ("constant coefficients (LTI)", models.ALONE, models.CONSTANT),
        ("airspeed alone", models.BOTH, models.ALONE),
    ):
        table.rows.append([title, KNOWN[one], *_changes(found, KNOWN[one], KNOWN[other])])
    one, other = SPLINE[models.BOTH], SPLINE[models.ALONE]
    table.rows.append(["airspeed alone", one, *_changes(found, one, other)])
    table.remarks.append(
        f"A difference of less than {LEVEL:g} points is what another seed changes. Where the rotor"
        " has no stabilizer bar scheduling is worth tens of points in nearly every output (AH-1S,"
        " docs/identified.md, not run here)."
    )
    return table


def _changes(found: KnownKinematics, one: str, other: str) -> list[str]:
    a, b = found.of(one).ahead, found.of(other).ahead
    return [f"{round(a[y] - b[y]):+d}" for y in a]
