"""Pages in a browser: who is let in, what is published, and that nothing else waits for them."""

import ast
import asyncio
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import symheli
from studies import cli
from studies.live.identifier import LiveIdentifier
from studies.live.sample import Sample
from studies.live.stream import Stream
from studies.live.watch import Watch
from studies.page import charts
from studies.page.gate import Gate
from studies.page.motion import GAP, MOST, Track
from studies.page.powers import baseline
from studies.page.server import bound
from studies.page.snapshot import Published, airspeeds, lamp, parts
from symheli import FlightRecord
from symheli.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
NAMES = ("u", "v", "w", "p", "q", "r", "phi", "theta")
PORT, TOKEN = 8400, "a-token"
HERE = [(b"host", b"127.0.0.1:8400")]


# --- the gate ---------------------------------------------------------------------------------


async def behind(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    await send({"type": "http.response.start", "status": 200, "headers": [(b"a", b"b")]})
    await send({"type": "http.response.body", "body": b"the page"})


def asked(path, headers, kind="http"):
    """What the gate sends back."""
    sent = []

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    scope = {"type": kind, "path": path, "headers": headers}
    asyncio.run(Gate(behind, TOKEN, PORT)(scope, receive, send))
    return sent


@pytest.mark.parametrize("host", [b"127.0.0.1:8400", b"localhost:8400"])
def test_who_has_the_token_sees_the_page(host):
    start, body = asked(f"/{TOKEN}/", [(b"host", host)])
    assert (start["status"], body["body"]) == (200, b"the page")
    headers = dict(start["headers"])
    assert headers[b"a"] == b"b"
    assert headers[b"referrer-policy"] == b"no-referrer"
    assert b"default-src 'self'" in headers[b"content-security-policy"]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", HERE),
        ("", HERE),
        ("/a-toke/", HERE),
        ("/A-TOKEN/", HERE),
        ("//a-token/", HERE),
        ("/_nicegui_ws/socket.io/", HERE),
        ("/_nicegui_ws/a-token", HERE),
        (f"/{TOKEN}/", []),
        (f"/{TOKEN}/", [(b"host", b"evil.example:8400")]),
        (f"/{TOKEN}/", [(b"host", b"127.0.0.1")]),
        (f"/{TOKEN}/", [(b"host", b"127.0.0.1:8401")]),
        (f"/{TOKEN}/", [*HERE, (b"host", b"evil.example:8400")]),
        (f"/{TOKEN}/", [*HERE, (b"origin", b"http://evil.example:8400")]),
        (f"/{TOKEN}/", [*HERE, (b"origin", b"null")]),
    ],
)
def test_anything_else_is_refused(path, headers, kind):
    """A wrong token; a name that DNS turned to this machine; a page from elsewhere."""
    first = asked(path, headers, kind)[0]
    if kind == "http":
        assert first["status"] == 404
    else:
        assert first["type"] == "websocket.close"


def test_a_port_that_is_taken_is_named():
    taken = bound(0)
    with taken, pytest.raises(InputError, match=r"port 8\d+ of 127.0.0.1 cannot be had"):
        bound(taken.getsockname()[1])


# --- who may know of it -----------------------------------------------------------------------


def test_nothing_but_the_page_imports_nicegui():
    found = set()
    for package in ("symheli", "identification", "synthesis", "studies"):
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if "nicegui" not in text:
                continue
            nodes = ast.walk(ast.parse(text))
            named = [a.name for n in nodes if isinstance(n, ast.Import) for a in n.names]
            nodes = ast.walk(ast.parse(text))
            named += [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
            if any(name.split(".")[0] == "nicegui" for name in named):
                found.add(path.parent.relative_to(ROOT).as_posix())
    assert found == {"studies/page"}


def test_the_pages_are_imported_without_nicegui():
    code = (
        "import sys; sys.modules['nicegui'] = sys.modules['uvicorn'] = None\n"
        "import studies, studies.page.live_page, studies.commands.live"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.fixture
def log(tmp_path):
    """Three seconds of a log that moves."""
    t = 0.02 * np.arange(150)
    columns = {name: 0.1 * np.sin((1 + k) * t) for k, name in enumerate((*NAMES, *INPUTS))}
    columns["airspeed"] = 3.0 + 0.0 * t
    head = ",".join(["t [s]", *(f"{name} [{symheli_unit(name)}]" for name in columns)])
    rows = np.column_stack([t, *columns.values()])
    path = tmp_path / "flight.csv"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


def symheli_unit(name):
    from symheli.values.signal import Signal

    return Signal(name).unit


def test_a_missing_extra_is_named(log, tmp_path, monkeypatch, capsys):
    """And nothing is left of what was begun."""
    for name in ("fastapi", "nicegui", "uvicorn"):
        monkeypatch.setitem(sys.modules, name, None)
    record = tmp_path / "record.csv"
    words = ["live", str(log), "--inputs", ",".join(INPUTS), "--page", "--record", str(record)]
    assert cli.main(words) == 1
    assert "a page in the browser needs" in (said := capsys.readouterr().err)
    assert "pip install 'symheli[live]'" in said
    assert not record.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--page", "80"], "expected a port from 1024 to 65535"),
        (["--page", "x"], "expected a whole number"),
        (["--baseline", "xcell60"], "--baseline is compared on the page: give --page too"),
        (["--page", "--baseline", "no_such"], "no_such"),
    ],
)
def test_options_that_cannot_be_are_refused(log, words, message, capsys):
    assert cli.main(["live", str(log), "--inputs", ",".join(INPUTS), *words]) > 0
    assert message in capsys.readouterr().err


# --- motion -----------------------------------------------------------------------------------


def flown(seconds, dt=0.02, **values):
    """A track after samples of these values."""
    track = Track()
    for k in range(round(seconds / dt) + 1):
        track.add(k * dt, {**dict.fromkeys(NAMES, 0.0), **values})
    return track.shown()


def test_a_straight_flight_is_a_straight_path():
    """North-east at 5 m/s for 4 s, climbing at 1 m/s."""
    motion = flown(4.0, u=5.0, w=-1.0, psi=math.pi / 4)
    side = 20.0 / math.sqrt(2.0)
    np.testing.assert_allclose(motion.position, (side, side, 4.0), rtol=1e-9)
    assert motion.path[0] == (0.0, 0.0, 0.0)
    assert len(motion.path) > 30
    assert motion.words.endswith("heading 45 deg; 4.0 m above the start")


def test_a_source_without_a_heading_is_turned_by_its_rates():
    motion = flown(5.0, r=0.2)
    assert motion.psi == pytest.approx(1.0)


def test_the_way_over_a_gap_is_not_known():
    track = Track()
    for t in (0.0, 0.1, 0.1 + 2 * GAP, 0.2 + 2 * GAP):
        track.add(t, {**dict.fromkeys(NAMES, 0.0), "u": 10.0})
    assert track.shown().position[1] == pytest.approx(2.0)  # two steps of 0.1 s, north


def test_a_long_path_is_thinned_and_keeps_its_start():
    motion = flown(1000.0, dt=0.1, u=20.0)
    assert len(motion.path) <= MOST
    assert motion.path[0] == (0.0, 0.0, 0.0)
    assert math.dist(motion.path[-1], motion.position) < 100.0


def test_attitude_is_drawn_as_it_is_flown():
    """Axes ahead, left, up: nose up points up, right wing down points down, heading east."""
    nose_up = np.array(flown(0.0, theta=0.3).rotation)
    np.testing.assert_allclose(nose_up @ [1, 0, 0], [0, math.cos(0.3), math.sin(0.3)], atol=1e-12)
    right_down = np.array(flown(0.0, phi=0.3).rotation)
    assert (right_down @ [0, -1, 0])[2] == pytest.approx(-math.sin(0.3))
    east = np.array(flown(0.0, psi=math.pi / 2).rotation)
    np.testing.assert_allclose(east @ [1, 0, 0], [1, 0, 0], atol=1e-12)
    assert np.linalg.det(east) == pytest.approx(1.0)


def test_a_sample_that_is_not_a_number_moves_nothing():
    track = Track()
    track.add(0.0, dict.fromkeys(NAMES, math.nan))
    assert track.shown() is None


# --- what is published ------------------------------------------------------------------------


class Known:
    """A source of samples that are known."""

    name = "<b>known</b>"
    signals = (*NAMES, "airspeed", *INPUTS)

    def __init__(self, count):
        self.left, self.time = count, 0.0

    def receive(self, timeout):
        if not self.left:
            raise EOFError
        self.left, self.time = self.left - 1, self.time + 0.02
        k = range(1, 14)
        values = {n: 0.1 * math.sin(a * self.time) for n, a in zip(self.signals, k, strict=False)}
        return [Sample(self.time, {**values, "airspeed": 3.0}, "me")]

    def close(self):
        pass


def watch_of(count=50):
    identifier = LiveIdentifier(INPUTS, 0.0, 6.0)
    return Watch(Known(count), identifier, Stream(identifier.signals, 0.02))


def test_a_watch_calls_who_looks_after_each_receive():
    watch, seen = watch_of(20), []
    watch.looks.append(lambda one: seen.append((one.received, len(one.latest))))
    watch.run(60.0, print)
    assert seen == [(k + 1, 1) for k in range(20)]


def test_snapshots_are_made_ten_times_and_once_a_second():
    """However often they are asked for: 50 receives over a second."""
    clock = iter(0.02 * np.arange(1000))
    watch, published = watch_of(50), Published(clock=lambda: float(next(clock)))
    motions = []
    watch.looks += [published, lambda _: motions.append(published.motion)]
    watch.run(60.0, print)
    assert published.count == 1
    assert 9 <= len(dict.fromkeys(map(id, motions))) <= 10


def test_a_snapshot_that_fails_is_said_once_and_loses_no_sample(capsys):
    watch = watch_of(20)
    published = Published()
    published._track = None
    watch.looks.append(published)
    watch.run(60.0, print)
    assert watch.received == 20
    assert capsys.readouterr().err.count("the page shows no more of this") == 1


def test_the_parts_say_what_the_watch_knows():
    watch = watch_of(50)
    watch.run(60.0, print)
    found = parts(watch)
    assert "no lamp yet" in found["lamp"]
    assert watch.identifier.next_to_fly() in found["next"]
    assert "<b>known" not in found["state"]
    assert "&lt;b&gt;known" in found["state"]
    assert found["coverage"].count('class="bar few"') == 6
    assert found["coverage"].count('class="still"') == 6 * len(INPUTS)
    assert "0 of 6 airspeeds are covered" in found["coverage"]


def test_the_lamp_is_that_of_the_watch():
    red = lamp({"lamp": {"green": False, "reasons": ["gusts & <noise>"]}, "alarm": "too fast"})
    assert 'class="lamp red"' in red
    assert "not green" in red
    assert "gusts &amp; &lt;noise&gt;" in red
    assert 'role="alert"' in red
    assert "too fast" in red
    assert 'class="lamp green"' in lamp({"lamp": {"green": True, "reasons": []}})


@pytest.fixture(scope="module")
def flight():
    """A minute between 1 and 5 m/s without noise, learnt, and its helicopter."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule((5.0, 1.0) * 3, (1.0,) * 6, (4.0,) * 6, start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    record = symheli.fly(heli, schedule, excitation=excitation)
    return heli, record.select((*NAMES, "airspeed", *INPUTS))


def test_control_powers_stand_beside_the_baseline(flight):
    """Of the same helicopter they are within 5 %; each with its band and the other curve."""
    _, record = flight
    assert isinstance(record, FlightRecord)
    identifier = LiveIdentifier(INPUTS, 0.0, 6.0, record.dt)
    watch = Watch(Known(0), identifier, Stream(identifier.signals, record.dt))
    for t, row in zip(record.time, record.values, strict=True):
        values = dict(zip(map(str, record.signals), map(float, row), strict=True))
        watch.take(Sample(float(t), values, "me"), float(t))
    speeds = airspeeds(1.0, 5.0)
    beside = baseline("xcell60", INPUTS, speeds)
    for power in identifier.control_powers(speeds):
        other = beside.powers[power.output, power.control][speeds.index(power.airspeed)]
        assert power.value == pytest.approx(other, rel=0.05)
    shown = parts(watch, beside)["powers"]
    assert shown.count('class="band c0"') == 4
    assert shown.count('class="line c1"') == 4
    assert "linearization of xcell60" in shown


def test_a_stick_moves_its_control_over_the_travel():
    sticks = ("stick_lon", "stick_lat", "stick_col", "stick_ped")
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    by_stick = baseline("xcell60", sticks, [3.0]).powers
    by_control = baseline("xcell60", INPUTS, [3.0]).powers
    travel = dict(zip(INPUTS, heli.travel, strict=True))
    for (velocity, control), value in by_control.items():
        stick = by_stick[velocity, control.replace("d_", "stick_")]
        np.testing.assert_allclose(stick, value * travel[control])


# --- charts -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("low", "high"), [(0.0, 13.0), (-0.3, 0.2), (160.0, 166.0), (1e-4, 2e-4)])
def test_ticks_are_round_and_inside(low, high):
    found = charts.ticks(low, high)
    assert 2 <= len(found) <= 7
    assert low - 1e-12 <= found[0]
    assert found[-1] <= high * (1 + 1e-9)


def test_a_curve_is_where_its_numbers_are():
    """The ends of a line from corner to corner, and a gap where a number is missing."""
    frame = charts.Frame((0.0, 1.0), (0.0, 1.0))
    assert frame.at(0.0, 0.0) == (charts.LEFT, charts.HEIGHT - charts.BOTTOM)
    assert frame.at(1.0, 1.0) == (charts.WIDTH - charts.RIGHT, charts.TOP)
    assert frame.path([0, 0.5, 1], [0, math.nan, 1]).count("M") == 2
