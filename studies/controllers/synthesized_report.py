"""Report on a synthesized controller: sentences, numbers, a page, the files."""

from __future__ import annotations

import datetime
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output import plain
from studies.report.pages import FOLDER, environment
from symheli.values.drawing import BLUE, GREY, ORANGE
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from studies.controllers.synthesized import Synthesized

TABLE, CERTIFICATE, CHOICES, PAGE, NUMBERS = (
    *("controller.json", "certificate.json", "synthesize.toml", "report.html", "numbers.json"),
)
FILES = {
    TABLE: "the table; symheli export controller --model controller.json writes it as C",
    CERTIFICATE: "the proof; symheli verify certificate.json proves it again, exactly",
    CHOICES: "what was asked for",
    NUMBERS: "the numbers of this page",
}
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
    out = [
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
        outside = max(one.outside for one in found.measures)
        faster = max(one.faster for one in found.measures)
        if outside or faster:
            out.append(
                "The flights left what the certificate assumes: the airspeed was outside its range"
                f" for up to {100 * outside:.0f} % of the time, and changed faster for up to"
                f" {100 * faster:.0f} %."
            )
        if len(a.controls) < 4:
            out.append("The other controls were flown by an LQR schedule.")
    return out


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
        "flights": [
            {
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


def page(found: Synthesized) -> str:
    """The report as HTML."""
    from markupsafe import Markup

    from studies.report.drawn import drawn
    from symheli import Helicopter, __version__

    templates = environment()
    a = found.choices
    pictures = []
    if found.flights:
        caption = FLIGHT.format(n=len(found.flights))
        pictures = drawn([("flights", caption, "", flights(found))], a.out / "figures")
    name = Helicopter.load(a.vehicle).vehicle.title if a.vehicle else a.model
    text = templates.get_template("controller.html.j2").render(
        style=Markup((FOLDER / "page.css").read_text(encoding="utf-8")),
        title=f"A controller for {name}",
        date=datetime.date.today().isoformat(),
        version=__version__,
        answer=answer(found),
        sentences=sentences(found),
        gains=gains(found),
        hypotheses=found.sampled.certificate.hypotheses,
        files=FILES,
        pictures=pictures,
        choices=a.text(a.out),
        seconds=found.seconds,
    )
    return text.replace("m/s^2", "m/s²")


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
