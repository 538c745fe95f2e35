"""report.html, the figures and results.json: whole files or none."""

from __future__ import annotations

import base64
import io
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from studies.controllers import tables as controllers
from studies.transition import gain_tables, tables
from studies.transition.axes import AXES
from studies.transition.conclusions import certificates, conclusions
from studies.transition.guarantees import curves
from studies.transition.results import to_dict
from studies.transition.saved_proofs import save_proofs
from symheli.values.whole_files import write_bytes, write_text

if TYPE_CHECKING:
    from identification import LPVARXModel
    from studies.transition.identified import Identification
    from studies.transition.outcome import Outcome

TEMPLATE = "report.html.j2"


def write_results(study: Outcome, out: Path) -> Path:
    """results.json with everything reached so far, after the proofs that it names."""
    save_proofs(study, out)
    return write_text(
        out / "results.json", json.dumps(to_dict(study), indent=1, allow_nan=False) + "\n"
    )


def write_report(study: Outcome, out: Path) -> Path:
    """results.json, figures/*.png and report.html (self-contained: figures inside), in this order:
    no number waits for a picture.
    """
    import jinja2
    import matplotlib.pyplot as plt

    from studies.transition.figures import figures

    write_results(study, out)
    pictures = {}
    for name, caption, figure in figures(study):
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=130)
        plt.close(figure)
        write_bytes(out / "figures" / f"{name}.png", stream.getvalue())
        pictures[name] = {
            "caption": caption,
            "data": base64.b64encode(stream.getvalue()).decode("ascii"),
        }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    page = environment.get_template(TEMPLATE).render(
        study=study, pictures=pictures, axes=AXES, t=tables, **_headline(study)
    )
    return write_text(out / "report.html", page)


def _headline(study: Outcome) -> dict[str, object]:
    """The numbers the first paragraph speaks of."""
    gust = [
        b
        for b in study.bounds
        if (b.model, b.channel, b.certificate.kind) == ("baseline", "gust", "l2 gain")
    ]
    proven = [b for b in gust if b.certificate.verified]
    hypotheses = list(dict.fromkeys(h for b in proven for h in b.certificate.hypotheses))
    return {
        "conclusions": conclusions(study),
        "curves": curves(study.bounds),
        "gain_tables": gain_tables.every(study.bounds),
        "certificates": certificates(study),
        "controller_tables": controllers.every(study),
        "flown_conclusions": controllers.conclusions(study),
        "not_about_the_helicopter": gain_tables.not_about_the_helicopter(study.bounds),
        "frozen_gain": next((b.certificate.frozen for b in gust), None),
        "fastest": max(proven, key=lambda b: (b.rate, -b.certificate.gamma), default=None),
        "jump": min(
            (b for b in gust if math.isinf(b.rate)),
            key=lambda b: (b.certificate.gamma, -b.certificate.lower),
            default=None,
        ),
        "inf": math.inf,
        "hypotheses": hypotheses,
        "notes": {
            name: model.excitation
            for name, model in _models(study.identification).items()
            if model.excitation is not None
        },
    }


def _models(found: Identification | None) -> dict[str, LPVARXModel]:
    """Every identified model by what it was identified from."""
    if found is None:
        return {}
    each = {f"{one.axis.name}, {one.noise}": one.model for one in found.axes}
    return each | {"lateral, gentle": found.gentle}
