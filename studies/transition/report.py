"""report.html, the figures and results.json: whole files or none."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.report.drawn import Drawn
from studies.report.equations import EQUATIONS
from studies.report.labels import Labels
from studies.report.pages import environment, source, superscript
from studies.report.references import REFERENCES
from studies.setup.axes import AXES
from studies.transition import controller_tables as controllers
from studies.transition import gain_tables, tables
from studies.transition.conclusions import (
    abstract,
    answer,
    certificates,
    conclusions,
    of_its_own,
    of_the_vehicle,
    question,
)
from studies.transition.guarantees import curves
from studies.transition.results import to_dict
from studies.transition.saved_proofs import linked_proofs, save_proofs
from studies.transition.shortfalls import (
    FAILED,
    NEGATIVE,
    failures,
    negative_results,
    without_certificate,
)
from symheli.progress import tracked
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from identification.model import LPVARXModel
    from studies.transition.identified import Identification
    from studies.transition.outcome import Outcome
    from studies.transition.under_way import UnderWay

REPORT = "report.html"
TEMPLATE, STYLE, SCRIPTS = "page.html.j2", "page.css", ("hover.js", "explorer.js", "fit.js")
ORDER = (
    *("question", "definitions", "vehicle", "baseline", "experiment", "identified", "terms"),
    *("known", "proven", "controllers", "failed", "conclusion", "provenance"),
)
OWN_ORDER = (
    *("vehicle", "controllers", "question", "definitions", "baseline", "identified", "terms"),
    *("known", "proven", "experiment", "failed", "conclusion", "provenance"),
)
"""Sections of the page; of another vehicle than the study's own questions about it come first, and
the published experiment late.
"""
SHOWS = {
    "vehicle": "baseline",
    "baseline": "baseline",
    "experiment": "paper_experiment",
    "identified": "identification",
    "terms": "comparison",
    "known": "known_kinematics",
    "proven": "bounds",
    "controllers": "controllers",
}
"""By section of the page the finding of a run that it shows."""
DIGITS = 4
"""Significant ones of the numbers that the slider moves over."""


def write_results(study: Outcome, out: Path) -> Path:
    """results.json with everything reached so far, after the proofs that it names."""
    save_proofs(study, out)
    return _written(to_dict(study), out)


def write_report(study: Outcome, out: Path) -> Path:
    """The proofs, results.json, figures (PNG, SVG, PDF) and report.html, in this order: no number
    waits for a picture, and what the page links is there.
    """
    from studies.transition.figures import drawn_in, figures

    write_results(study, out)
    each = tracked("figures", list(figures(study)))
    return write_page(study, out, {one.name: drawn_in(out, one) for one in each})


def write_page(
    study: Outcome, out: Path, pictures: Mapping[str, Drawn], under_way: UnderWay | None = None
) -> Path:
    """report.html with these figures, of a study that has ended or is `under_way`."""
    return write_text(out / REPORT, page(study, pictures, to_dict(study), under_way))


def page(
    study: Outcome,
    pictures: Mapping[str, Drawn],
    results: dict[str, Any],
    under_way: UnderWay | None = None,
) -> str:
    """The report as HTML; rendered twice, so that what stands below can be referred to above."""
    from markupsafe import Markup

    templates = environment()
    templates.filters["whole"] = whole
    template = templates.get_template(TEMPLATE)
    texts = {
        "study": study,
        "pictures": pictures,
        "axes": AXES,
        "t": tables,
        "results": results,
        "equations": EQUATIONS,
        "references": REFERENCES,
        "style": source(STYLE),
        "scripts": [source(name) for name in SCRIPTS],
        "held": Markup(compact(results["held"])),
        "under_way": under_way,
        **_headline(study),
    }
    if under_way is not None:
        texts |= _as_far_as_it_is(study, pictures, texts)
    first = Labels()
    template.render(labels=first, contents=[], **texts)
    labels = Labels(first.given, "not reached" if under_way is None else under_way.missing)
    text = template.render(labels=labels, contents=first.contents, **texts)
    return superscript(text)


def whole(cell: str) -> str:
    """Numbers that belong together stay on one line.

    >>> whole("0.85, 1.36") == "0.85,\\N{NO-BREAK SPACE}1.36"
    True
    """
    return re.sub(r"(?<=\d)(,| /) (?=[-\d])", "\\1\N{NO-BREAK SPACE}", cell)


def title(study: Outcome) -> str:
    """Return the title of the page."""
    if not of_its_own(study):
        return "LFT against LPV along the transition"
    return study.heli.vehicle.title if study.heli else Path(study.vehicle).stem


def compact(data: object) -> str:
    """JSON for a script element, with few digits."""

    def short(part: Any) -> Any:
        if isinstance(part, dict):
            return {key: short(value) for key, value in part.items()}
        if isinstance(part, list):
            return [short(value) for value in part]
        return float(f"{part:.{DIGITS}g}") if isinstance(part, float) else part

    return json.dumps(short(data), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _written(results: dict[str, Any], out: Path) -> Path:
    text = json.dumps(results, indent=1, allow_nan=False) + "\n"
    return write_text(out / "results.json", text)


def _headline(study: Outcome) -> dict[str, object]:
    """Return the sentences of the page, and the numbers at its head."""
    gust = [
        b
        for b in study.bounds
        if (b.model, b.channel, b.certificate.kind) == ("baseline", "gust", "l2 gain")
    ]
    proven = [b for b in gust if b.certificate.verified]
    hypotheses = list(dict.fromkeys(h for b in proven for h in b.certificate.hypotheses))
    return {
        "title": title(study),
        "question": question(study),
        "answer": answer(study),
        "own": of_its_own(study),
        "lead": "trim" if of_its_own(study) else "gain-against-rate",
        "order": OWN_ORDER if of_its_own(study) else ORDER,
        "vehicle": of_the_vehicle(study),
        "abstract": abstract(study),
        "conclusions": conclusions(study),
        "unproven": without_certificate(study),
        "negative": negative_results(study),
        "failures": failures(study),
        "meanings": {"negative": NEGATIVE, "failed": FAILED},
        "curves": curves(study.bounds),
        "gain_tables": gain_tables.every(study.bounds),
        "certificates": certificates(study),
        "proofs": linked_proofs(study),
        "controller_tables": controllers.every(study),
        "hypotheses": hypotheses,
        "notes": {
            name: model.excitation
            for name, model in _models(study.identification).items()
            if model.excitation is not None
        },
    }


def _as_far_as_it_is(
    study: Outcome, pictures: Mapping[str, Drawn], texts: Mapping[str, Any]
) -> dict[str, Any]:
    """Lead and order of a page that is not complete: a figure that is there, and the sections that
    have something to say first.
    """
    there = [key for key in OWN_ORDER if getattr(study, SHOWS.get(key, ""), None)]
    rest = [key for key in texts["order"] if key not in there]
    lead = texts["lead"] if texts["lead"] in pictures else "trim"
    return {"order": [*there, *rest], "lead": lead}


def _models(found: Identification | None) -> dict[str, LPVARXModel]:
    """Every identified model by what it was identified from."""
    if found is None:
        return {}
    each = {f"{one.axis.name}, {one.noise}": one.model for one in found.axes}
    return each | {"lateral, gentle": found.gentle}
