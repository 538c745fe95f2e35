"""The short table printed when the study is done."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.controllers import tables as controllers
from studies.transition import gain_tables, tables
from studies.transition.axes import AXES
from studies.transition.conclusions import conclusions
from studies.transition.flights import NOISES

if TYPE_CHECKING:
    from studies.transition.outcome import Outcome


def summary(study: Outcome) -> str:
    """Baseline, identification, comparison and guarantees in about forty lines."""
    if study.baseline is None:
        return "nothing was finished"
    b = study.baseline
    lines = [
        f"Baseline: LFT of order {b.lft.order}, {b.reduced.order} when reduced, equal to the"
        f" polynomial family within {b.lft_error:.0e}; {len(b.unfit)} entries no polynomial fits,"
        f" worst {', '.join(e.name for e in b.unfit[:4])}"
    ]
    for r in study.exact_recovery.runs if study.exact_recovery else ():
        lines.append(
            f"Exact recovery at {r.period:g} s: A(p) within {r.A_error:.0e}, B(p) within"
            f" {r.B_error:.0e}"
        )
    known = study.known_kinematics
    sections = [_marks(study)]
    sections += [table.text() for table in tables.known_kinematics(known)] if known else []
    sections += [*(table.text() for table in gain_tables.every(study.bounds))]
    sections += [
        "\n".join(gain_tables.not_about_the_helicopter(study.bounds)),
        "\n".join(tables.verdicts(study)),
        *(table.text() for table in controllers.every(study)),
        "\n".join(conclusions(study)),
    ]
    return "\n\n".join(["\n".join(lines), *(s for s in sections if s)])


def _marks(study: Outcome) -> str:
    table = tables.Table(
        "Identified on one transition, judged 1 s ahead on another (fit in percent)",
        ["output", "noise-free", "mark", "30 dB", "mark"],
    )
    found = study.identification
    if found is None:
        return ""
    for axis in AXES:
        pair = [found.of(axis, noise).scores for noise in NOISES]
        for output in axis.outputs:
            marks = axis.marks.get(output)
            cells = []
            for k, score in enumerate(pair):
                cells.append(tables.percent(score.ahead[output]))
                cells.append(f">= {marks[k]:.0f}" if marks else "")
            table.rows.append([f"{output} ({axis.name})", *cells])
    return table.text()
