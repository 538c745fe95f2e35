"""Pages from templates: escaped text, the style of all reports, date and version."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

FOLDER = Path(__file__).resolve().parent
"""Templates, style and scripts."""


def environment() -> Environment:
    """Return the environment of the templates: text is escaped, an undefined name is an error."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def rendered(template: str, **texts: Any) -> str:
    """Return the page of a template: with `style`, today's `date` and the `version` besides."""
    from symheli import __version__

    common = {"style": source("page.css"), "version": __version__}
    common["date"] = datetime.date.today().isoformat()
    return superscript(environment().get_template(template).render(**common, **texts))


def source(name: str) -> Markup:
    """Return a style or script, which is not escaped."""
    from markupsafe import Markup

    return Markup((FOLDER / name).read_text(encoding="utf-8"))


def superscript(text: str) -> str:
    """Return the text with the unit of accelerations as it is printed."""
    return text.replace("m/s^2", "m/s²")
