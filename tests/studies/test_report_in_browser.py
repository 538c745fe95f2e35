"""The report in a browser: everything drawn, nothing cut on a phone, a screen or paper, and the
slider moves.
"""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from studies.transition import report

playwright = pytest.importorskip("playwright.sync_api", reason="wants playwright")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="wants Chromium")]
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
A4 = 688
"""Width between the margins of the paper, CSS pixels."""

CUT = """() => [...document.querySelectorAll("body *")]
    .filter((e) => e.getBoundingClientRect().right > document.documentElement.clientWidth + 1)
    .filter((e) => !e.closest("svg, math, .scroll, .tip, pre"))
    .map((e) => e.tagName + " in " + (e.closest("[id]") || {}).id)"""
"""What reaches beyond the page, but for what scrolls in a box of its own."""

CUT_ON_PAPER = CUT.replace("svg, math, .scroll, .tip, pre", "svg, .tip")
"""On paper nothing scrolls."""


@pytest.fixture(scope="module")
def address(full, tmp_path_factory):
    return report.write_report(full, tmp_path_factory.mktemp("report")).as_uri()


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as tools:
        running = tools.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield running
        running.close()


@pytest.fixture
def opened(browser, address):
    """A page of a width, and what the console said."""
    pages = []

    def at(width, **options):
        page = browser.new_page(viewport={"width": width, "height": 900}, **options)
        pages.append(page)
        said = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if foreign(request) else None)
        page.goto(address)
        return page, said

    yield at
    for page in pages:
        page.close()


def foreign(request):
    return not request.url.startswith(("file:", "data:"))


def width_and_room(page):
    root = "document.documentElement"
    return page.evaluate(f"[{root}.scrollWidth, {root}.clientWidth]")


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_cut_and_the_console_is_silent(opened, width):
    page, said = opened(width)
    wide, room = width_and_room(page)
    assert wide <= room
    assert page.evaluate(CUT) == []
    assert said == []


SCROLLS = """() => [...document.querySelectorAll("figure .scroll, .equation .scroll")]
    .filter((e) => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1)
    .filter((e) => !(innerWidth <= 640
        && e.querySelector('svg[style*="--least"]:not([data-whole])'))) // readable
    .map((e) => (e.closest("[id]") || {}).id)"""


@pytest.mark.parametrize("width", [390, 1280])
def test_figures_and_equations_fit_the_page_without_scrolling(opened, width):
    """But for a wide figure on a narrow screen, which scrolls so that its words can be read."""
    page, said = opened(width)
    assert page.evaluate(SCROLLS) == []
    panels = page.locator("svg.panel").count()
    assert (panels > 10) == (width == 390)
    page.set_viewport_size({"width": 1670 - width, "height": 900})  # the other way, and back
    page.wait_for_function(
        "n => (document.querySelectorAll('svg.panel').length > 0) === n", arg=width != 390
    )
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_function("n => document.querySelectorAll('svg.panel').length === n", arg=panels)
    assert said == []


def test_every_figure_is_drawn(opened):
    page, _ = opened(1280)
    figures = page.evaluate(
        """() => [...document.querySelectorAll("figure")].map((figure) => {
            const one = figure.querySelector("svg"), box = one.getBoundingClientRect();
            const picture = one.querySelector("image"), marks = one.querySelectorAll("path").length;
            const pixels = new Image();
            pixels.src = picture ? picture.getAttribute("href") : "";
            return [figure.id, box.width, box.height, pixels.naturalWidth, marks];
        })"""
    )
    assert len(figures) > 10
    assert any(pixels for *_, pixels, _ in figures)
    for name, width, height, pixels, marks in figures:
        assert min(width, height) > 50, name
        assert pixels > 500 or marks > 10, name


def test_on_paper_every_column_is_on_the_page(opened):
    page, _ = opened(A4)
    page.emulate_media(media="print")
    wide, room = width_and_room(page)
    assert wide <= room
    assert page.evaluate(CUT_ON_PAPER) == []
    assert page.pdf(prefer_css_page_size=True).startswith(b"%PDF")


@pytest.mark.parametrize("width", [390, 1280])
def test_the_slider_moves_poles_and_responses(opened, width):
    page, said = opened(width)
    before = page.locator("#explorer svg").evaluate_all("all => all.map(e => e.outerHTML)")
    page.locator("#airspeed").fill("9")
    after = page.locator("#explorer svg").evaluate_all("all => all.map(e => e.outerHTML)")
    assert [a != b for a, b in zip(before, after, strict=True)] == [True] * 4
    assert page.locator("#explorer output").inner_text() == "9 m/s"
    page.locator("input[value=longitudinal]").check()
    assert page.locator("#explorer").get_attribute("data-drawn") == "longitudinal 9"
    page.locator("input[value=exact]").uncheck()
    assert said == []


def test_pointing_at_a_curve_tells_its_value(opened, full):
    """The first point of the first curve of the trim: hover, and its pitch attitude."""
    page, _ = opened(1280)
    place = page.evaluate(
        """() => {
            const path = document.querySelector("#figure-trim [id$=curve-0-0] path");
            path.closest("svg").scrollIntoView({block: "center"});
            const on = path.getPointAtLength(0), out = path.getScreenCTM();
            return [on.x * out.a + out.e, on.y * out.d + out.f];
        }"""
    )
    page.mouse.move(*place)
    speed, pitch = map(float, page.locator(".tip").inner_text().splitlines()[-1].split(","))
    # a hundredth of a point of the figure is 1e-4 of a panel
    assert abs(speed) < 0.01
    assert pitch == pytest.approx(math.degrees(full.baseline.nodes.trims[0].x["theta"]), abs=0.01)


def test_pointing_at_a_curve_of_a_picture_tells_its_value(opened, full):
    """A figure too dense for curves in the page: the airspeed of the training flight midway."""
    page, _ = opened(1280)
    record = next(iter(full.flights.training.values()))
    middle = len(record.time) // 2
    place = page.evaluate(
        """([time, airspeed]) => {
            const svg = document.querySelector("#figure-flights svg[data-points]");
            svg.scrollIntoView({block: "center"});
            const {box: [x, y, w, h], x: [left, right], y: [low, high]} =
                JSON.parse(svg.dataset.axes)[0];
            const on = new DOMPoint(
                x + w * (time - left) / (right - left), y + h * (high - airspeed) / (high - low));
            const at = on.matrixTransform(svg.getScreenCTM());
            return [at.x, at.y];
        }""",
        [float(record.time[middle]), float(record["airspeed"][middle])],
    )
    page.mouse.move(*place)
    name, numbers = page.locator(".tip").inner_text().splitlines()
    time, airspeed = map(float, numbers.split(","))
    assert name in ("airspeed", "command")
    # three points of the figure apart, and the airspeed changes by a few m/s^2
    assert time == pytest.approx(record.time[middle], abs=0.01 * record.time[-1])
    assert airspeed == pytest.approx(record["airspeed"][middle], abs=0.5)


def test_without_scripts_the_figures_stay(opened, browser, address):
    context = browser.new_context(java_script_enabled=False, viewport={"width": 390, "height": 900})
    page = context.new_page()
    page.goto(address)
    assert page.locator("figure svg").count() > 10
    assert not page.locator("#explorer").is_visible()
    assert page.locator("noscript p").is_visible()
    context.close()


def test_the_links_to_the_proofs_open_files(opened):
    page, said = opened(1280)
    listed = page.locator("details.proofs")
    for k in range(listed.count()):
        listed.nth(k).locator("summary").click()
    links = page.locator("details.proofs a")
    assert links.count() == len(set(links.evaluate_all("all => all.map((a) => a.href)"))) > 0
    assert page.evaluate(CUT) == []
    for address in links.evaluate_all("all => all.map((a) => a.href)"):
        proof = json.loads(Path(unquote(urlsplit(address).path)).read_text(encoding="utf-8"))
        assert proof
    assert not said
