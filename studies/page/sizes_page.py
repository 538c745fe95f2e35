"""The page of `symheli synthesize --page`: sizes are moved, frozen loops follow, a proof is asked
for.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup

from studies.controllers.design_choices import DesignChoices
from studies.controllers.synthesized import Given
from studies.page.elements import html, page_of, section
from studies.page.frozen import Computing, points
from studies.page.proving import Proving
from studies.page.server import PageServer
from studies.page.sizes import DECADES, NOISE, STEP, Moved, Size, parts, proof
from studies.processes import Processes
from symheli.extras import extra

LOOK = 0.05
"""Seconds between two looks of a browser at what has changed."""
VALUE = "(event) => emit(event.target.valueAsNumber)"
"""Script that sends the value of a slider."""
BEFORE = "being computed; this is of the sizes before"
FEW = 4
"""Processes of the frozen designs, at most."""


class Session:
    """One file that is tuned: its sizes, the numbers of the frozen loops, the proof; the same for
    every browser.

    Raises what `points` raises.
    """

    def __init__(self, choices: DesignChoices, given: Given | None, processes: Processes):
        self.computing = Computing(points(choices, given), processes)
        self.moved = Moved(choices, self.computing.request)
        self.proving = Proving(given)
        self.saved = ""
        self._sheet = ""
        self._parts: tuple[object, dict[str, str]] = (None, {})
        self.computing.request(choices)

    def parts(self) -> tuple[object, dict[str, str]]:
        """Return the pieces of the page with a key, made once for all browsers."""
        shown = self.computing.shown
        key = (shown.number, len(shown.designs), shown.judged == shown.judged)
        if self._parts[0] != key:
            made = parts(shown, self.computing.points)
            if key[-1]:
                self._sheet = made["sheet"]
            elif self._sheet:
                made["sheet"] = f'<div class="old"><p>{BEFORE}</p>{self._sheet}</div>'
            self._parts = key, made
        return self._parts

    def save(self) -> None:
        """Write what there is, and say so."""
        try:
            written = self.proving.save(self.moved.choices)
        except Exception as error:
            self.saved = f"nothing is saved: {error}"
        else:
            self.saved = (
                f"wrote {', '.join(path.name for path in written)} into {written[0].parent}"
            )
        self.proving.changes += 1


@contextmanager
def sizes_page(
    choices: DesignChoices, given: Given | None, title: str, port: int = 0
) -> Iterator[tuple[PageServer, Session]]:
    """Serve the sizes of a file within this context; errors as of `PageServer` and `points`."""
    with Processes(min(FEW, os.cpu_count() or 1)) as processes:
        session = Session(choices, given, processes)
        server = PageServer(lambda: _build(session, title), title, port)
        try:
            yield server, session
        finally:
            server.close()
            session.proving.close()
            processes.end()


def _build(session: Session, title: str) -> None:
    with extra("live", "a page in the browser"):
        from nicegui import run, ui
    shown = _Shown(session)

    async def save() -> None:
        await run.io_bound(session.save)

    with page_of(title):
        with section("Sizes", "narrow sizes"):
            shown.build_sliders()
        with ui.element("div").classes("broad column"):
            with section("Frozen loops: computed, not proven", ""):
                shown.part("state")
                shown.part("margins")
            with section("Specification sheet", ""):
                shown.part("sheet")
            with section("Proof", ""):
                with ui.element("div").classes("buttons"):
                    begin = lambda: session.proving.begin(session.moved.choices)  # noqa: E731
                    shown.prove = button("Prove", begin)
                    shown.cancel = button("Cancel", session.proving.cancel)
                    shown.save = button("Save", save)
                shown.saved, shown.proof = html(""), html("")
            with section("Responses to a command of 1", ""):
                shown.part("steps")
            with section("Responses to a disturbance of its size", ""):
                shown.part("gusts")
    ui.timer(LOOK, shown.update)  # from when the browser is there: its sliders are set by scripts


def button(words: str, act: Any, label: str = "") -> Any:
    """A button that the keyboard reaches."""
    with extra("live", "a page in the browser"):
        from nicegui import ui
    made = ui.button(words, on_click=act, color=None).props("no-caps unelevated dense")
    return made.props(f'aria-label="{label}"') if label else made


@dataclass
class _Shown:
    """The elements of one browser, and what they show."""

    session: Session
    pieces: dict[str, Any] = field(default_factory=dict)
    sliders: dict[Size, Any] = field(default_factory=dict)
    values: dict[Size, Any] = field(default_factory=dict)
    there: dict[Size, float] = field(default_factory=dict)
    prove: Any = None
    cancel: Any = None
    save: Any = None
    saved: Any = None
    proof: Any = None
    key: object = None
    changes: int = -1
    said: str = ""

    def part(self, name: str) -> None:
        """A piece of the page."""
        self.pieces[name] = html("")

    def build_sliders(self) -> None:
        """A slider for each size, under its group, and buttons that put them back."""
        with extra("live", "a page in the browser"):
            from nicegui import ui
        sizes = self.session.moved.sizes
        for group in dict.fromkeys(size.group for size in sizes):
            with ui.element("details").props("" if group == NOISE else "open"):
                with ui.element("summary"):
                    ui.label(group)
                for size in sizes:
                    if size.group == group:
                        self._slider(size)

    def _slider(self, size: Size) -> None:
        with extra("live", "a page in the browser"):
            from nicegui import ui
        moved = self.session.moved
        with ui.element("div").classes("size"):
            self.values[size] = html("")
            # a native one: it is itself what the keyboard reaches and a screen reader names
            self.sliders[size] = (
                ui.element("input")
                .props(f"type=range min={-DECADES} max={DECADES} step={STEP}")
                .props(f'aria-label="{size.label}, {size.unit}"')
                .on("input", lambda e: self._slid(size, e.args), throttle=LOOK, js_handler=VALUE)
            )
            button("reset", lambda: moved.move(size, 0.0), f"reset {size.label}")

    def update(self) -> None:
        """Show what has changed."""
        session = self.session
        if session.moved.changes != self.changes:
            self.changes = session.moved.changes
            for size, slider in self.sliders.items():
                self._show(size, slider)
        key, found = session.parts()
        if key != self.key:
            self.key = key
            for name, element in self.pieces.items():
                element.set_content(found[name])
        said = proof(session.proving, session.moved.choices)
        if said != self.said:
            self.said = said
            self.proof.set_content(said)
        running = session.proving.running
        self.prove.set_enabled(not running)
        self.cancel.set_enabled(running)
        self.save.set_enabled(not running)
        self.saved.set_content(Markup('<p role="status">{}</p>').format(session.saved))

    def _slid(self, size: Size, to: float) -> None:
        self.there[size] = float(to)
        self.session.moved.move(size, float(to))

    def _show(self, size: Size, slider: Any) -> None:
        """Show a size; its slider is moved only where another browser or a button moved it."""
        moved = self.session.moved
        value = f"{moved.value(size):.3g} {size.unit}"
        self.values[size].set_content(
            Markup("<p><b>{}</b><output>{}</output></p>").format(size.label, value)
        )
        slider.props(f'aria-valuetext="{value}"')
        if self.there.get(size) != moved.at[size]:
            self.there[size] = moved.at[size]
            slider.client.run_javascript(f"getHtmlElement({slider.id}).value = {moved.at[size]}")
