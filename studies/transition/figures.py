"""The figures of the report: functions from results to matplotlib figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.controllers.figure import RATIOS, SEEDS, energy_ratios, seeds
from studies.known_kinematics import models
from studies.known_kinematics.truth import SPEEDS
from studies.report.drawn import Drawn, drawn
from studies.setup.flights import NOISES
from studies.transition.comparison import FAST
from studies.transition.guarantees import curves
from studies.transition.known_kinematics import CUBIC, KNOWN, TWO_INPUTS
from symheli.values.drawing import BLUE, GREEN, GREY, INK, ORANGE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from identification.judge.frozen_models import FrozenModels
    from studies.known_kinematics.rivals import KnownKinematics
    from studies.setup.flights import StudyRecords
    from studies.transition.baseline import Baseline
    from studies.transition.comparison import ComparedAxis
    from studies.transition.outcome import Outcome
    from studies.transition.paper_experiment import PaperExperiment
    from synthesis.certify.questions.gain_curve import GainCurve

DEGREES = 180 / math.pi

CAPTION = {
    "trim": "Trim along the transition. Dotted lines: corners of the model.",
    "interpolation": (
        "Entries of A(p): exact linearizations (dots) and their interpolations. M_u and M_w jump"
        " where a limit of the horizontal tail or the edge of the wake is crossed (dotted lines):"
        " no polynomial follows."
    ),
    "convergence": (
        "Counterpart of the paper's figures 1, 3 and 5, {} loop: the 12 parameters of each output"
        " as the recursion runs, each divided by the largest final value of its coefficient"
        " function."
    ),
    "outputs": (
        "Counterpart of the paper's figures 2, 4 and 6, {} loop: system and one-step prediction on"
        " a fresh record; below, the error. Triangles: the largest errors (spikes)."
    ),
    "flights": "The flight that is identified, and the transition that judges (noise-free).",
    "prediction": "{}: 1 s ahead on the unseen transition (noise-free).",
    "frozen": (
        "{} with airspeed held: poles from hover (pale) to 12.5 m/s (dark), response at 7 m/s,"
        " nu-gap to the exact model (1: a mode is stable in one and unstable in the other); dotted:"
        " the chordal distance above {:g} rad/s, where slow modes do not decide. Identified poles"
        " without a counterpart belong to lags the plant does not need."
    ),
    "gaps": (
        "nu-gap to the exact model with the airspeed held, from the same noisy flights. Thin black:"
        " the stability margin of either lateral loop; a model above it is of no use to that loop."
    ),
    "gain": (
        "What the rate is worth: L2 gain of the gust loops against permitted acceleration, from"
        " frozen to an airspeed that jumps, as the LFT tests let it. Triangles: the"
        " worst airspeed history found, on the linear model and not in flight, attains it. Grey:"
        " neither a gain is proven nor growth found."
    ),
    "energy-ratios": RATIOS,
    "seeds": SEEDS,
}

SOURCE = {
    "trim": "baseline.trim",
    "interpolation": "baseline.entries",
    "convergence": "paper_experiment",
    "outputs": "paper_experiment",
    "flights": "flights",
    "prediction": "comparison.predictions",
    "frozen": "comparison.frozen",
    "gaps": "known_kinematics.models",
    "gain": "guarantees.bounds",
    "energy-ratios": "controllers.flights",
    "seeds": "controllers.flights",
}
"""Where results.json has the numbers that each kind of figure shows, or those of the stage that a
record was flown in.
"""

STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.3,
    "axes.grid": True,
    "grid.color": "#e6e9ec",
    "grid.linewidth": 0.6,
    "figure.constrained_layout.use": True,
}

SHOWN = {
    "trim": ("baseline",),
    "interpolation": ("baseline",),
    "convergence": ("paper_experiment",),
    "outputs": ("paper_experiment",),
    "flights": ("flights",),
    "prediction": ("comparison",),
    "frozen": ("comparison",),
    "gaps": ("known_kinematics",),
    "gain": ("gust", "longitudinal"),
    "energy-ratios": ("flown_controllers", "certified_controllers"),
    "seeds": ("flown_controllers",),
}
"""The stages whose results each kind of figure shows."""


@dataclass(frozen=True)
class Picture:
    """A figure that a study has reached: its name, its caption, where results.json has its numbers,
    the stages whose results it shows, and how it is made of these.
    """

    name: str
    caption: str
    source: str
    stages: tuple[str, ...]
    make: Callable[[], Figure]


def drawn_in(out: Path, picture: Picture) -> Drawn:
    """Write a figure below `out`, in three kinds of file, and return that of the page."""
    import matplotlib

    matplotlib.use("Agg")
    with matplotlib.rc_context(STYLE):
        given = picture.name, picture.caption, picture.source, picture.make()
        return drawn([given], out / "figures")[0]


def figures(study: Outcome) -> Iterator[Picture]:
    """Everything the study has reached."""
    if b := study.baseline:
        yield _picture("trim", partial(trim, b))
        yield _picture("interpolation", partial(entries, b))
    for e in study.paper_experiment.runs if study.paper_experiment else ():
        yield _picture("convergence", partial(convergence, e), f"convergence-{e.loop}", e.loop)
        yield _picture("outputs", partial(outputs, e), f"outputs-{e.loop}", e.loop)
    if study.flights:
        yield _picture("flights", partial(flights, study.flights))
    if study.comparison:
        for c in study.comparison.predictions:
            if c.noise == NOISES[0]:
                name = c.axis.name
                yield _picture("prediction", partial(prediction, c), f"prediction-{name}", name)
        for f in study.comparison.frozen:
            words = f.axis.name, f.found.fast
            yield _picture("frozen", partial(frozen, f.found), f"frozen-{f.axis.name}", *words)
    if study.known_kinematics:
        yield _picture("gaps", partial(gaps, study.known_kinematics))
    if found := curves(study.bounds):
        yield _picture("gain", partial(gain_curves, found), "gain-against-rate")
    if (flown := study.flown_controllers) and flown.flown:
        yield _picture("energy-ratios", partial(energy_ratios, flown, study.certified_controllers))
        yield _picture("seeds", partial(seeds, flown))


def _picture(kind: str, make: Callable[[], Figure], name: str = "", *words: object) -> Picture:
    return Picture(name or kind, CAPTION[kind].format(*words), SOURCE[kind], SHOWN[kind], make)


def _subplots(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> tuple[Figure, np.ndarray]:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(rows, columns, figsize=(width, height), squeeze=False, **options)
    return figure, axes


def _kinks(ax: Any, baseline: Baseline) -> None:
    for speeds in baseline.between.kinks.values():
        for speed in speeds:
            ax.axvline(speed, color=GREY, linewidth=0.8, linestyle=":")


def trim(baseline: Baseline) -> Figure:
    """Attitude and controls against airspeed."""
    family = baseline.nodes
    figure, axes = _subplots(1, 4, 11, 2.4, sharex=True)
    for ax, name, where in zip(
        axes[0], ("theta", "phi", "d_col", "d_ped"), ("x", "x", "u", "u"), strict=True
    ):
        ax.plot(
            family.airspeeds, [DEGREES * getattr(t, where)[name] for t in family.trims], color=BLUE
        )
        ax.set_title(f"{name} (deg)")
        ax.set_xlabel("airspeed (m/s)")
        _kinks(ax, baseline)
    return figure


def entries(b: Baseline) -> Figure:
    """Four entries of A: exact and interpolated."""
    figure, axes = _subplots(1, 4, 11, 2.8)
    fine = np.linspace(b.nodes.airspeeds[0], b.nodes.airspeeds[-1], 400)
    cubic, sextic, spline = (
        b.lpv[k].matrices(fine).A for k in ("polynomial 3", "polynomial 6", "spline")
    )
    for ax, (row, column, title) in zip(
        axes[0],
        (("q", "u", "M_u"), ("q", "w", "M_w"), ("v", "v", "Y_v"), ("r", "v", "N_v")),
        strict=True,
    ):
        i, j = b.nodes.states.index(row), b.nodes.states.index(column)  # type: ignore[arg-type]
        ax.plot(
            b.between.airspeeds, b.between.A[:, i, j], ".", color=INK, markersize=3, label="exact"
        )
        ax.plot(fine, cubic[:, i, j], color=BLUE, label="cubic")
        ax.plot(fine, sextic[:, i, j], color=GREEN, label="degree 6", linewidth=1)
        ax.plot(fine, spline[:, i, j], color=ORANGE, label="spline", linewidth=1)
        ax.set_title(f"{title} ({'1/(m s)' if row in 'qr' else '1/s'})")
        ax.set_xlabel("airspeed (m/s)")
        _kinks(ax, b)
    axes[0][0].legend()
    return figure


def convergence(e: PaperExperiment) -> Figure:
    """Parameters over time, one panel an output."""
    figure, axes = _subplots(1, 3, 11, 2.8, sharex=True)
    for ax, c in zip(axes[0], e.channels, strict=True):
        powers = 13.0 ** np.tile(
            np.arange(3), 4
        )  # a coefficient of p^k counts by its contribution at 13 m/s
        shown = c.parameters * powers
        size = np.abs(shown[-1].reshape(4, 3)).max(axis=1).repeat(3)
        for k, name in enumerate(c.parameter_names):
            ax.plot(
                c.time,
                shown[:, k] / size[k],
                color=(BLUE, ORANGE, GREEN, RED)[k // 3],
                linestyle=("-", "--", ":")[k % 3],
                label=name,
                linewidth=1,
            )
        ax.set_ylim(-2.5, 2.5)
        ax.set_title(f"{c.output} (settled after {c.settled_after:.0f} s)")
        ax.set_xlabel("time (s)")
    axes[0][0].set_ylabel("parameter, scaled")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside right center", ncols=1)
    return figure


def outputs(e: PaperExperiment) -> Figure:
    """System and one-step prediction over the fresh record, with the error below."""
    figure, axes = _subplots(2, 3, 11, 3.8, sharex=True, height_ratios=(2, 1))
    for column, c in enumerate(e.channels):
        guess = c.model.predict(e.test, 1)[:, 0]
        top, bottom = axes[0][column], axes[1][column]
        top.plot(e.test.time, e.test[c.output], color=INK, label="system", linewidth=1)
        top.plot(
            e.test.time, guess, color=ORANGE, label="model, one step", linewidth=0.9, linestyle="--"
        )
        bottom.plot(e.test.time, e.test[c.output] - guess, color=RED, linewidth=0.8)
        for t, _ in c.spikes:
            k = int(np.argmin(np.abs(e.test.time - t)))
            bottom.plot(t, e.test[c.output][k] - guess[k], "v", color=INK, markersize=4)
        top.margins(y=0.18)
        top.set_title(
            f"{c.output}: one step {c.fits['one step']:.0f} %, 1 s {c.fits['1 s']:.0f} %, free run"
            f" {c.fits['free run']:.0f} %"
        )
        bottom.set_xlabel("time (s)")
    axes[0][0].legend(loc="upper right", ncols=2)
    axes[1][0].set_ylabel("error")
    return figure


def flights(flown: StudyRecords) -> Figure:
    """Airspeed, attitude and inputs of training and test."""
    figure, axes = _subplots(3, 2, 11, 4.6, sharex="col", width_ratios=(2.2, 1))
    shown = {"training": flown.training[NOISES[0]], "test": flown.test[NOISES[0]]}
    for column, (name, record) in enumerate(shown.items()):
        axes[0][column].plot(record.time, record["airspeed"], color=BLUE, label="airspeed")
        axes[0][column].plot(
            record.time,
            record["airspeed_command"],
            color=ORANGE,
            linestyle="--",
            label="command",
            linewidth=1,
        )
        axes[0][column].set_title(f"{name}: airspeed (m/s)")
        for signal, colour in (("theta", BLUE), ("phi", ORANGE)):
            axes[1][column].plot(
                record.time, DEGREES * record[signal], color=colour, label=signal, linewidth=0.9
            )
        axes[1][column].set_title("attitude (deg)")
        for signal, colour in (
            ("d_lon", BLUE),
            ("d_lat", ORANGE),
            ("d_col", GREEN),
            ("d_ped", RED),
        ):
            axes[2][column].plot(
                record.time, DEGREES * record[signal], color=colour, label=signal, linewidth=0.6
            )
        axes[2][column].set_title("inputs (deg)")
        axes[2][column].set_xlabel("time (s)")
    for row in axes:
        row[1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def prediction(compared: ComparedAxis) -> Figure:
    """1 s ahead predictions of each output."""
    c = compared.found
    figure, axes = _subplots(len(c.outputs), 1, 11, 1.55 * len(c.outputs), sharex=True)
    chosen = [
        p
        for p in c.predictions
        if p.name in ("LPV-ARX, two inputs", "LPV-ARX, other inputs measured", "baseline, cubic")
    ]
    for k, (ax, output) in enumerate(zip(axes[:, 0], c.outputs, strict=True)):
        ax.plot(c.record.time, c.record[output], color=INK, label="flight", linewidth=1.5)
        for p, colour in zip(
            chosen, (BLUE, GREEN, ORANGE) if len(chosen) == 3 else (BLUE, ORANGE), strict=True
        ):
            ax.plot(
                c.record.time,
                p.ahead[:, k],
                color=colour,
                linewidth=1,
                label=f"{p.name}: {p.scores.ahead[output]:.0f} %",
            )
        unit = c.record.signals[c.record.signals.index(output)].unit
        low, high = c.record[output].min(), c.record[output].max()
        ax.set_ylim(low - 0.4 * (high - low), high + 0.4 * (high - low))
        ax.set_ylabel(f"{output} ({unit})")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1, 0].set_xlabel("time (s)")
    return figure


def frozen(f: FrozenModels) -> Figure:
    """Poles, frequency response and nu-gap."""
    figure, axes = _subplots(1, 3, 12, 3.2)
    baseline, identified = f["baseline"], f["identified"]
    shade = np.linspace(0.25, 1.0, len(f.points))
    for name, stack, colour, marker in (
        ("exact", f.reference.poles, INK, "o"),
        ("baseline", baseline.poles, ORANGE, "+"),
        ("identified", identified.poles, BLUE, "x"),
    ):
        for k, poles in enumerate(stack):
            shown = poles[(np.imag(poles) >= 0) & (np.real(poles) > -12) & (np.imag(poles) < 30)]
            label = name if k == len(stack) - 1 else None
            axes[0][0].plot(
                np.real(shown),
                np.imag(shown),
                marker,
                color=colour,
                markersize=4.5,
                fillstyle="none",
                alpha=shade[k],
                label=label,
            )
    axes[0][0].axvline(0, color=GREY, linewidth=0.8)
    axes[0][0].set_xlabel("real (rad/s)")
    axes[0][0].set_title("poles, imaginary part (rad/s)")
    axes[0][0].legend(loc="center left")
    for name, model, colour in (
        ("exact", f.reference, INK),
        ("baseline", baseline, ORANGE),
        ("identified", identified, BLUE),
    ):
        axes[0][1].loglog(
            f.omega,
            model.response,
            color=colour,
            label=name,
            linestyle="--" if name == "baseline" else "-",
            linewidth=2.4 if name == "exact" else 1.2,
        )
    axes[0][1].set_title(f"|{f.channel[1]}/{f.channel[0]}| at {f.responses_at:g} m/s (1/s)")
    axes[0][1].set_xlabel("frequency (rad/s)")
    axes[0][1].legend()
    axes[0][2].plot(f.points, baseline.gap, "+-", color=ORANGE, label="baseline")
    axes[0][2].plot(f.points, identified.gap, "x-", color=BLUE, label="identified")
    axes[0][2].plot(
        f.points, baseline.distance, "+:", color=ORANGE, label=f"baseline, above {FAST:g} rad/s"
    )
    axes[0][2].plot(
        f.points, identified.distance, "x:", color=BLUE, label=f"identified, above {FAST:g} rad/s"
    )
    axes[0][2].set_ylim(0, 1.05)
    axes[0][2].set_title("nu-gap to the exact model")
    axes[0][2].set_xlabel("airspeed (m/s)")
    axes[0][2].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def gaps(found: KnownKinematics) -> Figure:
    """nu-gap over airspeed, an axis a panel, beside the margins of the lateral loops."""
    figure, axes = _subplots(1, 2, 11, 3.6, sharey=True)
    shown = {
        CUBIC: (ORANGE, "+-"),
        TWO_INPUTS: (RED, "x-"),
        KNOWN[models.CONSTANT]: (GREY, "s-"),
        KNOWN[models.ALONE]: (GREEN, "o-"),
        KNOWN[models.BOTH]: (BLUE, "o-"),
        found.rivals[-1].name: (INK, "--"),
    }
    for ax, axis in zip(axes[0], ("lateral", "longitudinal"), strict=True):
        for name, (colour, style) in shown.items():
            ax.semilogy(
                SPEEDS, found.of(name).gaps[axis], style, color=colour, label=name, markersize=3
            )
        ax.set_title(f"nu-gap, {axis}")
        ax.set_xlabel("airspeed (m/s)")
    for style, (loop, margin) in zip((":", "-."), found.margins.items(), strict=True):
        axes[0][0].semilogy(
            SPEEDS, margin, style, color=INK, linewidth=1, label=f"margin of the {loop}"
        )
    axes[0][0].set_ylim(1e-3, 1.1)
    legend = axes[0][0].get_legend_handles_labels()
    axes[0][1].legend(*legend, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def gain_curves(curves: list[GainCurve]) -> Figure:
    """Gain against rate, one panel a loop."""
    figure, axes = _subplots(
        1, len(curves), 7.5 if len(curves) == 1 else 11.5, 4.2, width_ratios=(1.5, 1)[: len(curves)]
    )
    for ax, curve in zip(axes[0], curves, strict=True):
        curve.plot(ax)
    return figure
