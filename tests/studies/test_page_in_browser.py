"""The pages in a browser: nothing from elsewhere, a silent console, a phone, dark, the keyboard;
and who has no token sees nothing.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import symheli

playwright = pytest.importorskip("playwright.sync_api", reason="wants playwright")
pytest.importorskip("nicegui", reason="wants the extra live")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="wants Chromium")]
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
OPTIONS += ["--use-gl=swiftshader", "--enable-unsafe-swiftshader"]  # the picture in 3D
ROOT = Path(__file__).resolve().parents[2]
OWN_SAYING = "GL Driver Message"
"""Chromium's own, of a picture that is read back from a graphics card that is emulated."""
BAND = "section[aria-labelledby=control-powers] .band"
PATIENCE = 60.0
ENDED = 2.0
"""Seconds within which Ctrl-C ends a command."""


class Command:
    """`symheli ... --page` as a process of its own, and the address that it printed."""

    def __init__(self, words, folder):
        self.said = folder / "said.txt"
        with self.said.open("w") as out:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "studies.cli", *words, "--page"],
                stdout=out,
                stderr=out,
                cwd=folder,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
            )
        end = time.monotonic() + PATIENCE
        while not (found := re.search(r"http://\S+", self.said.read_text())):
            assert self.process.poll() is None, self.said.read_text()
            assert time.monotonic() < end, self.said.read_text()
            time.sleep(0.05)
        self.address = found[0]
        self.port = urlsplit(self.address).port

    def interrupt(self):
        """Ctrl-C; return the seconds until it has ended."""
        begun = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(PATIENCE)
        return time.monotonic() - begun

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        assert "Traceback" not in self.said.read_text()


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Ten minutes of flight; it comes again three times as fast."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule((5.0, 1.0) * 40, (1.0,) * 80, (4.0,) * 80, start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    record = symheli.fly(heli, schedule, excitation=excitation)
    path = tmp_path_factory.mktemp("log") / "flight.csv"
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "airspeed", *map(str, heli.inputs))
    record.select(names).to_csv(path)
    return path


def watching(log, folder, *words):
    inputs = ["--inputs", "d_lon,d_lat,d_col,d_ped", "--airspeeds", "0", "6"]
    return Command(["live", str(log), *inputs, "--speed", "3", *words], folder)


@pytest.fixture(scope="module")
def live(log, tmp_path_factory):
    command = watching(log, tmp_path_factory.mktemp("live"), "--baseline", "xcell60")
    yield command
    command.close()


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as tools:
        running = tools.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield running
        running.close()


@pytest.fixture
def opened(browser):
    """A page of a width, and what it said or asked of elsewhere."""
    contexts = []

    def at(address, width, **options):
        context = browser.new_context(viewport={"width": width, "height": 900}, **options)
        contexts.append(context)
        page, said = context.new_page(), []
        page.on("console", lambda m: said.append(m.text) if OWN_SAYING not in m.text else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        own = f"http://127.0.0.1:{urlsplit(address).port}/"

        def routed(route):
            if route.request.url.startswith(own):
                route.continue_()
            else:
                said.append(route.request.url)
                route.abort()

        context.route("**/*", routed)
        page.on("websocket", lambda w: said.append(w.url) if f"//{own[7:]}" not in w.url else None)
        page.goto(address)
        return page, said

    yield at
    for context in contexts:
        context.close()


def fits(page):
    root = "document.documentElement"
    return page.evaluate(f"{root}.scrollWidth <= {root}.clientWidth")


def brightness(page):
    """Of the page behind everything, 0 to 255."""
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return sum(map(int, re.findall(r"\d+", colour)[:3])) / 3


# --- the flight -------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [390, 1280])
def test_the_flight_is_shown_and_the_console_is_silent(live, opened, width):
    page, said = opened(live.address, width)
    page.wait_for_selector(BAND, state="attached", timeout=20_000)
    assert page.locator("svg.chart").count() == 5
    assert page.locator(".lamp").is_visible()
    assert page.locator(".next").inner_text().startswith("What to fly next\n")
    assert fits(page)
    assert page.locator("canvas").evaluate("e => e.width") > 100
    assert said == []


def test_numbers_and_motion_go_on(live, opened):
    page, said = opened(live.address, 1280)
    words = page.locator("section:has(canvas) p")
    page.wait_for_function("document.querySelector('.nicegui-scene') !== null")
    samples = page.locator("dl dd").nth(2)
    before = words.inner_text(), samples.inner_text()
    page.wait_for_timeout(2500)
    after = words.inner_text(), samples.inner_text()
    assert before[0] != after[0]
    assert int(after[1].split(":")[0]) > int(before[1].split(":")[0]) + 200
    assert said == []


def test_light_and_dark_follow_the_system(live, opened):
    assert brightness(opened(live.address, 1280, color_scheme="light")[0]) > 200
    assert brightness(opened(live.address, 1280, color_scheme="dark")[0]) < 60


def test_ten_browsers_at_once(live, opened):
    pages = [opened(live.address, 390) for _ in range(10)]
    for page, said in pages:
        page.wait_for_selector(BAND, state="attached", timeout=20_000)
        assert said == []
    assert live.process.poll() is None
    assert "GOOD:" in pages[-1][0].locator("dl dd").nth(1).inner_text()


# --- who is let in ----------------------------------------------------------------------------


def status(command, path, host=None):
    """Of a plain request."""
    asked = HTTPConnection("127.0.0.1", command.port, timeout=10)
    asked.request("GET", path, headers={} if host is None else {"Host": host})
    answer = asked.getresponse()
    body = answer.read()
    asked.close()
    return answer.status, body


def upgraded(command, path, **headers):
    """Status line of a request for a websocket."""
    key = base64.b64encode(os.urandom(16)).decode()
    lines = {
        "Host": f"127.0.0.1:{command.port}",
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": key,
        **headers,
    }
    words = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
    with socket.create_connection(("127.0.0.1", command.port), timeout=10) as peer:
        peer.sendall(f"GET {path} HTTP/1.1\r\n{words}\r\n".encode())
        return int(peer.recv(200).split()[1])


WEBSOCKET = "_nicegui_ws/socket.io/?EIO=4&transport=websocket"


def test_without_the_token_there_is_nothing(live):
    token = urlsplit(live.address).path
    assert len(token.strip("/")) >= 32
    whole = status(live, token)[1].decode()
    assert status(live, token)[0] == 200
    named = set(re.findall(r"[\"'](/[^\"'\s]*?_nicegui/[^\"'\s]+)[\"']", whole))
    routes = [route for route in named if status(live, route)[0] == 200]
    assert len(routes) > 5
    for route in routes:
        bare = "/" + route.removeprefix(token)
        assert status(live, bare)[0] == 404, bare
    for path in ("/", "/_nicegui_ws/socket.io/", "/docs", "/openapi.json", token[:-2] + "/"):
        assert status(live, path)[0] == 404, path
    assert upgraded(live, token + WEBSOCKET) == 101
    assert upgraded(live, "/" + WEBSOCKET) == 403


def test_a_name_that_dns_turned_here_sees_nothing(live):
    token = urlsplit(live.address).path
    assert status(live, token, f"localhost:{live.port}")[0] == 200
    assert status(live, token, f"evil.example:{live.port}")[0] == 404
    assert upgraded(live, token + WEBSOCKET, Host=f"evil.example:{live.port}") == 403
    assert upgraded(live, token + WEBSOCKET, Origin="http://evil.example") == 403


def test_only_this_address_of_this_machine_listens(live):
    """127.0.0.2 is this machine too: a server on all addresses would answer there."""
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", live.port), timeout=5)


def test_ctrl_c_ends_it_with_a_browser_open(log, opened, tmp_path):
    command = watching(log, tmp_path, "--record", str(tmp_path / "record.csv"))
    try:
        page, _ = opened(command.address, 390)
        page.wait_for_selector("dl dd")
        page.wait_for_timeout(1500)
        assert command.interrupt() < ENDED
        assert command.process.returncode == 0
        assert "samples from flight.csv" in command.said.read_text()
        assert len((tmp_path / "record.csv").read_text().splitlines()) > 100
    finally:
        command.close()


# --- sizes ------------------------------------------------------------------------------------


FAST = """
vehicle = "xcell60"
out = "made"
airspeeds = [0.0, 8.0]
points = 5
degree = 2
"""
SMALL = """
vehicle = ""
model = "family.json"
out = "made"
airspeeds = [0.0, 8.0]
acceleration = 2.0
degree = 1
controls = ["d_lat"]
measurements = ["v"]
disturbances = ["v_w", "d_lat"]
delay = 0.0
sizes = { v = 1.0, d_lat = 0.05, v_w = 1.0 }
noise = { v = 0.3 }
servos = {}
"""
VALUE = ".size:has([aria-label^='d_ped,']) output"
SHOWN = f'document.querySelector("{VALUE}").innerText'
JUDGED = "text=entries that count are in Level 1"


def tuning(text, folder):
    (folder / "file.toml").write_text(text)
    return Command(["synthesize", "file.toml"], folder)


@pytest.fixture(scope="module")
def sizes(tmp_path_factory):
    command = tuning(FAST, tmp_path_factory.mktemp("sizes"))
    yield command
    command.close()


@pytest.mark.parametrize("width", [390, 1280])
def test_sizes_are_shown_and_the_console_is_silent(sizes, opened, width):
    page, said = opened(sizes.address, width)
    page.wait_for_selector(JUDGED, timeout=60_000)
    assert page.locator("svg.chart").count() == 3 + 4 + 2 * 3
    assert page.locator("text=Nothing of this is proven").is_visible()
    assert fits(page)
    assert said == []


def test_a_size_moves_by_the_keyboard_and_the_loops_follow(sizes, opened):
    page, said = opened(sizes.address, 1280)
    page.wait_for_selector(JUDGED, timeout=60_000)
    other, _ = opened(sizes.address, 390)
    before = page.locator("svg.chart").nth(2).inner_html()
    slider = page.get_by_role("slider", name="d_ped, rad")
    value = page.locator(VALUE)
    was = value.inner_text()
    slider.focus()
    for _ in range(15):
        page.keyboard.press("ArrowRight")
    page.wait_for_function(f"was => {SHOWN} !== was", arg=was)
    page.wait_for_function(
        "was => document.querySelectorAll('svg.chart')[2].innerHTML !== was", arg=before
    )
    page.wait_for_timeout(500)
    there = other.locator(VALUE).inner_text()
    assert there == value.inner_text() != was  # the same in every browser
    page.get_by_role("button", name="reset d_ped").press("Enter")
    page.wait_for_function(f"was => {SHOWN} === was", arg=was)
    page.wait_for_function(
        "was => document.querySelectorAll('svg.chart')[2].innerHTML === was", arg=before
    )
    assert said == []


def test_every_control_has_a_name_and_is_reached_by_the_keyboard(sizes, opened):
    page, _ = opened(sizes.address, 1280)
    page.wait_for_selector(JUDGED, timeout=15_000)
    page.locator("summary", has_text="Noise").press("Enter")
    sliders = page.get_by_role("slider")
    assert sliders.count() == 3 + 8 + 4 + 8
    names = sliders.evaluate_all("all => all.map(e => e.getAttribute('aria-label'))")
    assert len(set(names)) == len(names)
    page.locator("summary").first.focus()
    reached = set()
    for _ in range(2 * len(names) + 10):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.getAttribute('aria-label')"))
        reached.add(page.evaluate("document.activeElement.innerText.trim()"))
    assert set(names) | {f"reset {n}" for n in ("u", "d_ped", "q noise")} <= reached
    assert {"Prove", "Save"} <= reached


def test_a_proof_is_begun_and_given_up(sizes, opened):
    page, said = opened(sizes.address, 1280)
    page.get_by_role("button", name="Prove").press("Enter")
    page.wait_for_selector("text=under way: designing", timeout=30_000)
    page.get_by_role("button", name="Cancel").press("Enter")
    page.wait_for_selector("text=given up: nothing is proven", timeout=5_000)
    assert said == []


def test_a_proof_is_shown_and_saved(opened, tmp_path):
    models = [
        symheli.LinearModel(
            [[0.2 - 0.1 * V]], [[5.0, 1.0]], [[1.0]], [[0.0, 0.0]], ["v"], ["d_lat", "v_w"], ["v"]
        )
        for V in (0.0, 4.0, 8.0)
    ]
    symheli.LinearFamily.from_models([0.0, 4.0, 8.0], models).save(tmp_path / "family.json")
    command = tuning(SMALL, tmp_path)
    try:
        page, said = opened(command.address, 390)
        page.get_by_role("button", name="Prove").click()
        page.wait_for_selector("text=keeps a gain of", timeout=30_000)
        page.get_by_role("button", name="Save").click()
        page.wait_for_selector("text=certificate.json", timeout=30_000)
        assert fits(page)
        made = {path.name for path in (tmp_path / "made").iterdir()}
        assert {"controller.json", "certificate.json", "synthesize.toml", "c"} <= made
        assert said == []
        assert command.interrupt() < ENDED
        assert command.process.returncode == 0
    finally:
        command.close()


def children(process):
    """Processes that one has started, and what they have."""
    found = subprocess.run(["pgrep", "-P", str(process)], capture_output=True, text=True)
    own = [int(word) for word in found.stdout.split()]
    return own + [one for child in own for one in children(child)]


@pytest.mark.skipif(shutil.which("pgrep") is None, reason="wants pgrep")
def test_ctrl_c_ends_a_proof_under_way_and_every_process(opened, tmp_path):
    command = tuning(FAST, tmp_path)
    try:
        page, _ = opened(command.address, 390)
        page.get_by_role("button", name="Prove").click()
        page.wait_for_selector("text=under way: designing", timeout=30_000)
        begun = children(command.process.pid)
        assert len(begun) >= 2
        assert command.interrupt() < ENDED
        assert not [one for one in begun if Path(f"/proc/{one}").exists()]
        assert "nothing was saved" in command.said.read_text()
    finally:
        command.close()
