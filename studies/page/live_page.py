"""The page of `symheli live --page`: a flight that is watched in a browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup

from studies.live.identifier import LiveIdentifier
from studies.live.sample import Source
from studies.live.watch import Watch
from studies.output import progress
from studies.page.elements import html, page_of, section
from studies.page.motion import Motion
from studies.page.powers import baseline
from studies.page.server import PageServer
from studies.page.snapshot import MOTION_EVERY, Published, airspeeds
from symheli.extras import extra

SECTIONS = (
    ("lamp", "Lamp", "narrow"),
    ("next", "What to fly next", "broad next"),
    ("coverage", "Coverage of airspeed", ""),
    ("state", "Stream", ""),
    ("prediction", "Predictions 1 s ahead", ""),
    ("powers", "Control powers", "wide"),
)
"""Part of a snapshot, its heading, its style."""
GRID, CELL = 200, 10
"""Size of the ground that is drawn, m, and of its cells."""
LINE, POINT, BELOW = 0.08, 0.4, 3.0
"""Width of a line of the ground, size of a point of the path, and how far the ground is below the
lowest of it, m.
"""
GROUND, PATH, SKY = "#8a97a3", "#b85c00", "#dfe6ec"
PATH_EVERY = 3
"""Motions after which the path is drawn anew."""
SIZE = (360, 320)
"""Size of the picture in three dimensions before it is fitted, pixels."""


def live_page(published: Published, title: str, port: int = 0) -> PageServer:
    """Serve what is published; errors as of `PageServer`."""

    def build() -> None:
        with extra("live", "a page in the browser"):
            from nicegui import ui
        shown = _Shown(published)
        with page_of(title):
            for name, heading, style in SECTIONS[:3]:
                shown.section(name, heading, style)
            with section("Attitude and path", ""):
                shown.build_scene()
            for name, heading, style in SECTIONS[3:]:
                shown.section(name, heading, style)
        ui.timer(MOTION_EVERY, shown.update)

    return PageServer(build, title, port)


@contextmanager
def watched(
    port: int, identifier: LiveIdentifier, found: Source, vehicle: str | None
) -> Iterator[list[Callable[[Watch], None]]]:
    """Yield what looks at the watch of a source: the page, within this context, at a port (0: the
    first free one), beside the linearization of a `vehicle`. Closes the source where there is no
    page.
    """
    try:
        beside = None
        if vehicle is not None:
            speeds = airspeeds(identifier.low, identifier.high)
            beside = baseline(vehicle, identifier.inputs, speeds)
        published = Published(beside)
        page = live_page(published, f"Flight from {found.name}", port)
    except BaseException:
        found.close()
        raise
    progress(f"page: {page.address}")
    try:
        yield [published]
    finally:
        page.close()


@dataclass
class _Shown:
    """The elements of one browser, and what they show."""

    published: Published
    parts: dict[str, Any] = field(default_factory=dict)
    scene: Any = None
    helicopter: Any = None
    path: Any = None
    ground: Any = None
    points: Any = None
    words: Any = None
    motion: Motion | None = None
    drawn: int = -1
    moved: int = 0

    def section(self, name: str, heading: str, style: str) -> None:
        """A part of the snapshot under its heading."""
        with section(heading, style):
            self.parts[name] = html(self.published.parts.get(name, "<p>...</p>"))

    def build_scene(self) -> None:
        """The helicopter in the middle; ground and path move below and behind it."""
        with extra("live", "a page in the browser"):
            from nicegui import ui
        self.words = html("<p>no motion yet</p>").classes("quiet")
        with ui.scene(
            width=SIZE[0], height=SIZE[1], grid=False, background_color=SKY, fps=15
        ) as scene:
            self.scene = scene
            with scene.group() as self.ground:
                for at in range(-GRID // 2, GRID // 2 + 1, CELL):
                    scene.box(LINE, GRID, LINE).move(at, 0, 0).material(GROUND)
                    scene.box(GRID, LINE, LINE).move(0, at, 0).material(GROUND)
            with scene.group() as self.path:
                self.points = scene.point_cloud([[0, 0, 0]], point_size=POINT)
            with scene.group() as self.helicopter:
                _helicopter(scene)
            scene.move_camera(-7, -9, 5, 0, 0, 0, duration=0)
        scene.props('role="img" aria-label="attitude and path; the numbers stand above"')

    def update(self) -> None:
        """Show what was published since."""
        if self.published.count != self.drawn:
            self.drawn = self.published.count
            for name, element in self.parts.items():
                element.set_content(self.published.parts.get(name, ""))
        motion = self.published.motion
        if motion is None or motion is self.motion:
            return
        self.motion = motion
        x, y, z = motion.position
        self.helicopter.rotate_R(motion.rotation)
        self.path.move(-x, -y, -z)
        lowest = min(up for _, _, up in motion.path)
        self.ground.move(-(x % CELL), -(y % CELL), lowest - BELOW - z)
        self.moved += 1
        if self.moved % PATH_EVERY == 0:
            self._draw_path(motion)
        self.words.set_content(Markup("<p>{}</p>").format(motion.words))

    def _draw_path(self, motion: Motion) -> None:
        """Draw the path anew: points that are only moved stay where a browser first saw them."""
        old = self.points
        with self.scene, self.path:
            points = [[round(at, 2) for at in point] for point in motion.path]
            self.points = self.scene.point_cloud(points, point_size=POINT).material(PATH)
        old.delete()


def _helicopter(scene: Any) -> None:
    """Draw a helicopter in axes ahead, left, up, a little more than life-size of a model, m."""
    body, blades, fin = "#0b61a4", "#1b1f24", "#b85c00"
    scene.sphere(0.9).scale(1.5, 0.8, 0.8).material(body)
    scene.box(3.2, 0.25, 0.25).move(-2.4, 0, 0.2).material(body)
    scene.box(0.5, 0.12, 1.1).move(-4.0, 0, 0.5).material(fin)
    scene.box(0.12, 0.12, 0.7).move(0, 0, 0.9).material(blades)
    scene.box(7.0, 0.2, 0.06).move(0, 0, 1.3).material(blades)
    scene.box(0.2, 7.0, 0.06).move(0, 0, 1.3).material(blades)
    for side in (-0.8, 0.8):
        scene.box(2.6, 0.1, 0.1).move(0.1, side, -1.2).material(blades)
        for along in (-0.6, 0.7):
            scene.box(0.08, 0.08, 0.8).move(along, 0.75 * side, -0.8).material(blades)
