"""Report on a synthesized controller: sentences, numbers, a page, the files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output import columns, plain
from studies.report.pages import rendered
from symheli import LPVStateSpace
from symheli.values.drawing import BLUE, GREY, ORANGE
from symheli.values.whole_files import write_text
from synthesis.design.loops.loop_measures import MEASURES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from studies.controllers.judged import Judged
    from studies.controllers.synthesized import Synthesized
    from synthesis.sheet.evaluation import SpecificationTable

TABLE, CERTIFICATE, CHOICES, PAGE, NUMBERS = (
    *("controller.json", "certificate.json", "synthesize.toml", "report.html", "numbers.json"),
)
FILES = {
    TABLE: "the table; symheli export controller --model controller.json writes it as C",
    CERTIFICATE: "the proof; symheli verify certificate.json proves it again, exactly",
    CHOICES: "what was asked for",
    NUMBERS: "the numbers of this page",
}
FIRST = 3
"""Entries of the sheet that miss Level 1 and are named in the sentences."""
WINDOW = 6.0
"""Length of a response to a gust, s."""
MARGINS = {
    "gain_margin": MEASURES["gain"],
    "phase_margin": MEASURES["phase"],
    "crossover": MEASURES["crossover"],
    "bandwidth": MEASURES["bandwidth_ads33"],
}
"""Measures of the sheet in the table of margins, and how their columns are headed."""
SHEET = (
    "Design margins of the loops broken at each servo, a mark an airspeed: 0 % is the boundary of"
    " Level 1, -100 % that of Levels 2 and 3."
)
STEPS = "Responses to a command of 1 of each axis, the airspeed held, and the control that flies."
GUSTS = (
    "Responses to a disturbance that steps to its size, in the middle of the range of airspeeds:"
    " the linear loop of the proof."
)
FLIGHT = (
    "The {n} transitions in turbulence, the nonlinear helicopter: airspeed with the commanded one,"
    " attitude, and commands beside their trim."
)


def write(found: Synthesized) -> list[Path]:
    """Write table, certificate, choices, numbers and page into the requested folder."""
    out = found.choices.out
    out.mkdir(parents=True, exist_ok=True)
    written = [found.table.save(out / TABLE)]
    found.sampled.certificate.save(out / CERTIFICATE)
    written += [
        out / CERTIFICATE,
        found.choices.write(out / CHOICES),
        write_text(out / NUMBERS, json.dumps(plain(data(found)), indent=1) + "\n"),
        write_text(out / PAGE, page(found)),
    ]
    return written


def answer(found: Synthesized) -> str:
    """One sentence: what is proven of what flies."""
    a, table = found.choices, found.table
    low, high = a.airspeeds
    flies = f"A table of {len(table.knots)} airspeeds and {table.order} states"
    held = f"from {low:g} to {high:g} m/s and up to {a.acceleration:g} m/s^2"
    if not found.sampled.certificate.verified:
        return f"{flies} was designed; of its loop nothing is proven {held}."
    return f"{flies} keeps a gain of {found.sampled.gamma:.3g}, proven as it flies, {held}."


def sentences(found: Synthesized) -> list[str]:
    """Return further remarks."""
    a = found.choices
    worst = found.sampled.certificate.frozen
    out = [] if found.judged is None else list(_of_sheet(found.judged.table))
    if found.idle:
        out.append(found.idle)
    out += [
        f"{', '.join(a.controls)} from {', '.join(a.measurements)}, every {1000 * a.period:g} ms,"
        f" commands {1000 * a.delay:g} ms late.",
        f"At an airspeed held the gain is {worst:.3g} at worst; what the airspeed's motion costs"
        " and what this form of proof gives away are"
        f" {100 * (found.sampled.gamma / worst - 1):.2g} % more."
        if found.sampled.certificate.verified and math.isfinite(worst)
        else f"The worst gain at an airspeed held is {worst:.3g}.",
    ]
    out.append(
        "The proof is of the model that was fitted over airspeed, its servos linear: what the fit"
        " misses, limits and the drift of the trim are not in it."
    )
    if found.measures:
        speed = max(one.speed for one in found.measures)
        attitude = math.degrees(max(one.attitude for one in found.measures))
        flown = (
            "none was lost"
            if not found.lost
            else f"{found.lost} of {len(found.measures)} were lost"
        )
        out.append(
            f"Flown {len(found.measures)} times through turbulence: {flown}; airspeed error at most"
            f" {speed:.1f} m/s (rms of a flight), bank and pitch within {attitude:.0f} deg."
        )
        kept = sum(not one.left for one in found.measures)
        out.append(
            f"{kept} of {len(found.measures)} flights kept to every hypothesis of the certificate"
            " that a flight shows: range and rate of the airspeed, no control at a stop."
        )
        out += list(_flights_beyond(found))
        if len(a.controls) < 4:
            out.append("The other controls were flown by an LQR schedule.")
    return out


def _flights_beyond(found: Synthesized) -> Iterator[str]:
    """Yield a sentence on each flight that left a hypothesis or exceeded the proven gain."""
    proven = found.sampled.gamma if found.sampled.certificate.verified else math.inf
    for k, one in enumerate(found.measures, 1):
        exceeded = one.ratio > proven
        if exceeded and not one.left:
            yield (
                f"Flight {k} reached {one.ratio:.3g}, above the proven gain, and left no hypothesis"
                " that was looked at: what is nonlinear beside the stops, and the drift of the"
                " trim, is not in the proof."
            )
        elif one.left:
            above = f", reached {one.ratio:.3g}, above the proven gain," if exceeded else ""
            yield f"Flight {k}{above} left the hypotheses: {'; '.join(one.left)}."


def _of_sheet(table: SpecificationTable) -> Iterator[str]:
    """Yield what misses Level 1 first, and the count."""
    from synthesis.sheet.evaluation import boundary, worst

    (name,) = table.controllers
    missed = table.missed(name)
    if missed and table.stable[name].all():
        first = "; ".join(
            f"{r.specification.axis}, {r.specification.name} {worst(r)} {r.specification.unit} at"
            f" {r.at:.3g} {table.parameter.unit} ({boundary(r.specification)})"
            for r in missed[:FIRST]
        )
        more = f"; and {len(missed) - FIRST} more" if len(missed) > FIRST else ""
        yield f"Misses Level 1 of the specification sheet: {first}{more}."
    yield f"Specification sheet at {len(table.at)} airspeeds held: {table.verdict(name)}."


def margins(found: Synthesized) -> list[list[str]]:
    """Return the worst margins and bandwidths over airspeed, a row an axis, each with its Level."""
    return [] if found.judged is None else margin_rows(found.judged.table)


def margin_rows(table: SpecificationTable) -> list[list[str]]:
    """Return the same of a sheet of one controller."""
    from synthesis.sheet.evaluation import worst

    (name,) = table.controllers
    cells: dict[str, dict[str, str]] = {}
    for r in table.reached(name):
        spec = r.specification
        if spec.measure in MARGINS and (r.failure or not math.isnan(r.value)):
            level = 1 if r.margin >= 0 else 2 if r.margin >= -100 else 3
            text = worst(r) + (f" ({level})" if not math.isnan(r.margin) else "")
            cells.setdefault(spec.axis, {}).setdefault(spec.measure, text)
    return [
        ["axis", *(f"{m.words}, {m.unit}" for m in MARGINS.values())],
        *([axis, *(own.get(m, "-") for m in MARGINS)] for axis, own in cells.items()),
    ]


def gains(found: Synthesized) -> list[tuple[str, str, str]]:
    """Return the promised, frozen, proven and simulated gains, each with its meaning."""
    certificate, (median, most) = found.sampled.certificate, found.ratios
    a = found.choices
    low, high = a.airspeeds
    rows = [
        ("promised", found.made.promised, f"the synthesis, of {found.made.order} states"),
        ("frozen", certificate.frozen, "the loop that flies, worst at an airspeed held"),
        (
            "proven",
            certificate.gamma if certificate.verified else math.inf,
            f"the same loop, {low:g} to {high:g} m/s, |dV/dt| <= {a.acceleration:g} m/s^2",
        ),
    ]
    if not math.isnan(most):
        n = len(found.measures)
        rows.append(("flown", most, f"largest energy ratio of {n} flights (median {median:.3g})"))
    return [
        (name, f"{value:.3g}" if math.isfinite(value) else "none", of) for name, value, of in rows
    ]


def text(found: Synthesized, written: list[Path]) -> str:
    """Return the text for the terminal."""
    wrapped = "\n".join(_wrapped(sentences(found)))
    lines = [*_wrapped([answer(found)]), ""]
    lines += [f"  {name:9s} {value:>5s}  {of}" for name, value, of in gains(found)]
    where = f"wrote {', '.join(path.name for path in written)} into {found.choices.out}"
    table = margins(found)
    if table:
        lines += ["", columns(table), "worst over airspeed; in brackets its Level"]
    return "\n".join([*lines, "", wrapped, "", where])


def data(found: Synthesized) -> dict[str, Any]:
    """Return the data for a program."""
    a, certificate, (median, most) = found.choices, found.sampled.certificate, found.ratios
    return {
        "vehicle": a.vehicle,
        "airspeeds": a.airspeeds,
        "acceleration": a.acceleration,
        "promised": found.made.promised,
        "frozen": certificate.frozen,
        "proven": certificate.gamma if certificate.verified else math.inf,
        "verified": certificate.verified,
        "flown": None if math.isnan(most) else {"median": median, "largest": most},
        "states": {"designed": found.made.order, "flown": found.table.order},
        "knots": found.table.knots,
        "misfit_of_the_plant": found.sampled.misfit,
        "met_every_hypothesis": sum(not one.left for one in found.measures),
        "sheet": _sheet(found),
        "flights": [
            {
                "left": one.left,
                "lost": one.lost,
                "energy_ratio": one.ratio,
                "airspeed_error": one.speed,
                "largest_attitude": one.attitude,
                "outside_the_range": one.outside,
                "faster_than_the_rate": one.faster,
            }
            for one in found.measures
        ],
        "hypotheses": certificate.hypotheses,
        "units": {
            "airspeeds": "m/s",
            "acceleration": "m/s^2",
            "airspeed_error": "m/s",
            "largest_attitude": "rad",
        },
        "seconds": found.seconds,
    }


def _sheet(found: Synthesized) -> dict[str, Any] | None:
    """The sheet for a program: verdict, what misses Level 1 first, every entry over airspeed."""
    if found.judged is None:
        return None
    table = found.judged.table
    (name,) = table.controllers
    return {
        "airspeeds": table.at,
        "verdict": table.verdict(name),
        "stable": table.stable[name],
        "missed": [[r.specification.axis, r.specification.name] for r in table.missed(name)],
        "specifications": table.entries(name),
    }


def page(found: Synthesized) -> str:
    """The report as HTML."""
    from studies.report.drawn import drawn
    from symheli import Helicopter

    a = found.choices
    pictures = drawn(list(_figures(found)), a.out / "figures")
    sheet = [("margins", SHEET, "", _of_margins(found))] if found.judged is not None else []
    name = Helicopter.load(a.vehicle).vehicle.title if a.vehicle else a.model
    return rendered(
        "controller.html.j2",
        title=f"A controller for {name}",
        answer=answer(found),
        sentences=sentences(found),
        gains=gains(found),
        sheet=drawn(sheet, a.out / "figures"),
        margins=margins(found),
        missed=_missed(found),
        hypotheses=found.sampled.certificate.hypotheses,
        files=FILES,
        pictures=pictures,
        choices=a.text(a.out),
        seconds=found.seconds,
    )


def _missed(found: Synthesized) -> list[list[str]]:
    """Return a row for each entry of the sheet that misses Level 1, the furthest first."""
    from synthesis.sheet.evaluation import boundary, margin, worst

    if found.judged is None:
        return []
    table = found.judged.table
    return [
        [
            r.specification.axis,
            r.specification.name,
            f"{worst(r)} {r.specification.unit}",
            boundary(r.specification),
            f"{r.at:.3g}",
            margin(r),
        ]
        for r in table.missed(table.controllers[0])
    ]


def _of_margins(found: Synthesized) -> Figure:
    """The design margins of the axes that the controller has, one below the other."""
    from synthesis.sheet.picture import figure_of

    assert found.judged is not None  # noqa: S101 - asked before
    return figure_of(found.judged.table, _axes(found.judged.table))


def _figures(found: Synthesized) -> Iterator[tuple[str, str, str, Figure]]:
    if found.judged is not None and found.judged.steps:
        yield "steps", STEPS, "", steps(found.judged)
    yield "gusts", GUSTS, "", disturbed(found)
    if found.flights:
        yield "flights", FLIGHT.format(n=len(found.flights)), "", flights(found)


def _axes(table: SpecificationTable) -> list[str]:
    """Return the axes of the sheet that the controller has."""
    (name,) = table.controllers
    known = [r.specification for r in table.reached(name) if not math.isnan(r.margin)]
    return list(dict.fromkeys(s.axis for s in known if s.sense and s.kind == "frozen"))


def steps(judged: Judged) -> Figure:
    """Responses to a step of each axis's command, and the control that makes them."""
    import matplotlib.pyplot as plt

    n = len(judged.steps)
    figure, axes = plt.subplots(
        2, n, figsize=(2.2 * n + 0.6, 3.6), sharex=True, squeeze=False, layout="constrained"
    )
    sheet = judged.table.sheet
    for k, (name, each) in enumerate(judged.steps.items()):
        axis = sheet.axes[name]
        for colour, (v, (t, response, control)) in zip(
            (BLUE, GREY, ORANGE), each.items(), strict=False
        ):
            axes[0, k].plot(t, response, color=colour, lw=1.0, label=f"{v:.3g} m/s")
            axes[1, k].plot(t, control, color=colour, lw=1.0)
        axes[0, k].set_title(name, fontsize=9)
        axes[0, k].set_ylabel(f"{axis.response} of its command")
        axes[1, k].set_ylabel(f"{axis.control} of the same")
        axes[1, k].set_xlabel("time (s)")
        for ax in axes[:, k]:
            ax.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=7)
    return figure


def disturbed(found: Synthesized) -> Figure:
    """Responses of the loop that is proven to a step of each disturbance of its size: deviations
    and commands in theirs, in the middle of the range of airspeeds.
    """
    import matplotlib.pyplot as plt

    a, loop = found.choices, found.sampled.loop
    assert isinstance(loop, LPVStateSpace)  # noqa: S101 - certified without a cover
    names = list(a.sizes_of_disturbances)
    at = loop.at(0.5 * sum(a.airspeeds)).select(inputs=names)
    made = at.step_response(WINDOW)
    figure, axes = plt.subplots(
        2,
        len(names),
        figsize=(2.2 * len(names) + 1.0, 4.2),
        sharex=True,
        sharey="row",
        squeeze=False,
        layout="constrained",
    )
    n = len(a.measurements)
    for k, name in enumerate(names):
        for row, part in enumerate((range(n), range(n, n + len(a.controls)))):
            for i in part:
                label = list(a.sizes_of_performance)[i]
                axes[row, k].plot(made.time, made.values[:, i, k], lw=0.9, label=label)
            axes[row, k].grid(alpha=0.3)
        axes[0, k].set_title(name, fontsize=9)
        axes[1, k].set_xlabel("time (s)")
    for row, label in enumerate(("deviations / size", "commands / size")):
        axes[row, 0].set_ylabel(label)
        axes[row, -1].legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def flights(found: Synthesized) -> Figure:
    """Three panels over time: airspeed, attitude, commands."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, figsize=(7.5, 6.0), sharex=True, layout="constrained")
    for k, flown in enumerate(found.flights):
        column = flown.columns()
        t = np.arange(flown.kept) * flown.plan.dt
        first = k == 0
        axes[0].plot(t, column["airspeed"], color=BLUE, lw=0.8, label="flown" if first else None)
        for y, colour in (("phi", BLUE), ("theta", ORANGE)):
            label = y if first else None
            axes[1].plot(t, np.degrees(column[y]), color=colour, lw=0.8, label=label)
        for i, u in enumerate(found.choices.controls):
            moved = np.degrees(column[f"{u}_command"] - column[f"{u}_reference"])
            label = u if first else None
            axes[2].plot(t, moved, color=f"C{i}", lw=0.6, label=label)
        if first:
            axes[0].plot(t, column["airspeed_command"], color=GREY, ls="--", label="commanded")
    for ax, label in zip(
        axes, ("airspeed (m/s)", "attitude (deg)", "commands, less trim (deg)"), strict=True
    ):
        ax.set_ylabel(label)
        ax.legend(loc="upper right", fontsize=8, ncols=4)
        ax.grid(alpha=0.3)
    axes[-1].set_xlabel("time (s)")
    return figure


def _wrapped(sentences: list[str]) -> Iterator[str]:
    import textwrap

    for sentence in sentences:
        yield from textwrap.wrap(sentence, 98)
