"""Elements that the pages share."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from typing import Any

from markupsafe import Markup

from symheli.extras import extra


def html(content: str) -> Any:
    """An element of HTML that this package has written, and escaped."""
    with extra("live", "a page in the browser"):
        from nicegui import ui
    return ui.html(content, sanitize=False)


@contextmanager
def page_of(title: str) -> Iterator[None]:
    """The page under its heading, in the style of this package."""
    with extra("live", "a page in the browser"):
        from nicegui import ui
    ui.add_css((resources.files("studies.page") / "style.css").read_text(encoding="utf-8"))
    with ui.element("div").classes("sheet"):
        with ui.element("header"):
            html(Markup("<h1>{}</h1>").format(title))
        yield


@contextmanager
def section(heading: str, style: str) -> Iterator[None]:
    """A part of a page under its heading."""
    with extra("live", "a page in the browser"):
        from nicegui import ui
    name = re.sub(r"\W+", "-", heading.lower())
    with ui.element("section").classes(style).props(f'aria-labelledby="{name}"'):
        html(Markup('<h2 id="{}">{}</h2>').format(name, heading))
        yield
