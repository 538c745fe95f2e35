"""Pages in a browser: who is let in, what is published, and that nothing else waits for them."""

import ast
import asyncio
import math
import subprocess
import sys
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import symheli
from studies import cli
from studies.controllers import starting
from studies.controllers.design_choices import DesignChoices
from studies.controllers.plant import design_plant
from studies.controllers.synthesized import model_of, smooth
from studies.live.identifier import LiveIdentifier
from studies.live.sample import Sample
from studies.live.stream import Stream
from studies.live.watch import Watch
from studies.page import charts
from studies.page.frozen import Computing, Frozen, frozen, points
from studies.page.gate import Gate
from studies.page.motion import GAP, MOST, Track
from studies.page.powers import baseline
from studies.page.proving import Proving
from studies.page.server import bound
from studies.page.sizes import Moved, sizes_of
from studies.page.sizes import parts as sizes_parts
from studies.page.sizes import proof as proof_words
from studies.page.snapshot import Published, airspeeds, lamp, parts
from symheli import FlightRecord
from symheli.errors import InputError
from synthesis.design.loops.margins import margins, open_loop
from synthesis.design.lpv.point_schedule import hinf_schedule
from synthesis.design.lti.h2 import h2
from synthesis.design.lti.point_design import design_at
from synthesis.sheet.evaluation import driven_plant

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


def test_a_page_is_not_opened_where_choices_are_only_written(tmp_path, capsys):
    config = tmp_path / "my.toml"
    assert cli.main(["synthesize", "--page", "--write-config", str(config)]) == 1
    assert "give one of the two" in capsys.readouterr().err
    assert not config.exists()


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
    assert found["lamp"] == lamp(watch.data())
    assert watch.identifier.next_to_fly() in found["next"]
    assert "<b>known" not in found["state"]
    assert "&lt;b&gt;known" in found["state"]
    assert found["coverage"].count('class="bar few"') == 6
    assert found["coverage"].count('class="still"') == 6 * len(INPUTS)
    assert "0 of 6 airspeeds are covered" in found["coverage"]


def test_a_pilot_says_what_it_does_and_what_has_happened():
    """In place of what to fly next; the last events alone, as text."""

    class Pilot:
        alarm = None

        def take(self, row):
            return False

        def reasons(self):
            return ["<b>nobody</b> flies"]

        def data(self):
            events = [{"time": float(k), "what": f"event {k} <i>"} for k in range(9)]
            return {"doing": "a controller & a flight", "events": events}

    found = watch_of(50)
    found.run(60.0, print)
    found.pilot = Pilot()
    shown = parts(found)
    assert "a controller &amp; a flight" in shown["next"]
    assert "8 s: event 8 &lt;i&gt;" in shown["next"]
    assert "event 4" not in shown["next"]
    assert "&lt;b&gt;nobody&lt;/b&gt; flies" in shown["lamp"]


def test_the_lamp_is_that_of_the_watch():
    red = lamp({"lamp": {"green": False, "reasons": ["gusts & <noise>"]}, "alarm": "too fast"})
    assert 'class="lamp red"' in red
    assert "not green" in red
    assert "gusts &amp; &lt;noise&gt;" in red
    assert 'role="alert"' in red
    assert "too fast" in red
    assert 'class="lamp green"' in lamp({"lamp": {"green": True, "reasons": []}})
    assert "no lamp yet" in lamp({})


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


# --- sizes ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tuned():
    """The choices for the X-Cell, and what their sizes act on."""
    choices = starting.for_vehicle(DesignChoices(degree=2, points=5))
    return choices, points(choices)


def test_sizes_scale_the_plant_and_nothing_else(tuned):
    """The scaled model is the plant that the synthesis would make of these sizes."""
    choices, found = tuned
    sizes = {**choices.sizes, "u": 5.0, "d_ped": 0.01, "v_w": 4.0}
    other = replace(choices, sizes=sizes, noise={**choices.noise, "q": 0.3})
    whole = design_plant(smooth(model_of(other)), other.period / 2, other)
    point = found[1]
    expected, scaled = whole.nominal.at(point.airspeed), point.sized(other)
    for name in "ABCD":
        np.testing.assert_allclose(
            getattr(scaled, name), getattr(expected, name), rtol=1e-12, atol=1e-14
        )
    assert np.abs(np.array(scaled.B) - np.array(point.design.B)).max() > 0.1


def test_numbers_of_a_frozen_loop_are_those_of_its_design(tuned):
    """The design of the synthesis at this airspeed, its margins by the library's own functions."""
    choices, found = tuned
    point = found[1]
    own = frozen(point, choices)
    whole = design_plant(smooth(model_of(choices)), choices.period / 2, choices)
    K = design_at(whole, [point.airspeed], h2).controller.discretize(choices.period)
    heli = symheli.Helicopter.load(choices.vehicle, governor="ideal")
    bare = symheli.sweep(heli, [point.airspeed], inputs=choices.controls).at(point.airspeed)
    plant = driven_plant(bare, K, choices.actuation)
    for axis, control in (("pitch", "d_lon"), ("yaw", "d_ped")):
        expected = margins(open_loop(plant, K, control))
        assert own.measures[axis]["gain"] == pytest.approx(expected.gain_margin, rel=1e-3)
        assert own.measures[axis]["crossover"] == pytest.approx(
            expected.highest_crossover, rel=1e-3
        )
    assert set(own.gusts) == {"u_w", "v_w", "w_w"}
    assert own.steps["pitch"].time[-1] == pytest.approx(4.0)


@pytest.mark.slow
def test_what_follows_a_command_has_the_sign_of_the_table_that_flies():
    """The controller is of measured minus reference, as a `TableController` of the same design."""
    choices = starting.for_vehicle(DesignChoices(degree=2, points=5, references=("theta",)))
    point = points(choices)[1]
    own = frozen(point, choices)
    assert own.method == "H-infinity"  # a reference is measured at once: no least variance
    whole = design_plant(smooth(model_of(choices)), choices.period / 2, choices)
    made = hinf_schedule(whole, [0.0, point.airspeed, 13.0], choices.back_off[0])
    table = symheli.TableController.of(
        made.discretize(choices.period).model, [0.0, point.airspeed, 13.0]
    )
    expected = table.model.at(point.airspeed).select(inputs=own.controller.inputs)
    found, other = (K.frequency_response([0.3, 3.0]) for K in (own.controller, expected))
    # the table is sampled after it was interpolated, the design before
    assert np.linalg.norm(found - other) < 0.1 * np.linalg.norm(other)
    i = choices.measurements.index("theta")
    assert np.linalg.norm((found - other)[:, :, i]) < 0.1 * np.linalg.norm(other[:, :, i])
    assert "theta_reference" in own.gusts


def test_there_is_a_slider_for_each_size_that_acts(tuned):
    choices, _ = tuned
    names = [(size.table, size.name, size.unit) for size in sizes_of(choices)]
    assert ("sizes", "d_ped", "rad") in names
    assert ("noise", "q", "rad/s") in names
    assert len(names) == len(choices.sizes) + len(choices.noise)
    fewer = replace(choices, measurements=("q", "theta"), disturbances=("u_w",))
    assert {size.name for size in sizes_of(fewer)} == {"u_w", "q", "theta", *INPUTS}


def test_a_size_moves_by_powers_of_ten_and_back(tuned):
    choices, _ = tuned
    asked = []
    moved = Moved(choices, asked.append)
    size = next(size for size in moved.sizes if size.name == "d_lon")
    moved.move(size, 1.0)
    assert asked[-1].sizes["d_lon"] == pytest.approx(10 * choices.sizes["d_lon"])
    moved.move(size, 5.0)
    assert len(asked) == 1  # no further than that
    moved.move(size, 0.0)
    assert asked[-1] == choices


class ByHand:
    """Processes whose answers come when they are told to."""

    def __init__(self):
        self.calls = []

    def submit(self, function, *arguments):
        future = Future()
        self.calls.append((future, function, arguments))
        return future

    def answer(self, k):
        future, function, arguments = self.calls[k]
        if future.set_running_or_notify_cancel():
            future.set_result(function(*arguments))


def test_what_was_overtaken_is_dropped(tuned, monkeypatch):
    choices, found = tuned
    monkeypatch.setattr(
        "studies.page.frozen.frozen", lambda p, c: Frozen(p.airspeed, failure=c.out)
    )
    hands = ByHand()
    computing = Computing(found, hands)
    computing.request(replace(choices, out="first"))
    hands.calls[0][0].set_running_or_notify_cancel()  # under way: it cannot be cancelled
    second = computing.request(replace(choices, out="second"))
    assert all(future.cancelled() for future, *_ in hands.calls[1 : len(found)])
    hands.calls[0][0].set_result(Frozen(found[0].airspeed, failure="first"))
    assert not computing.latest.designs
    for k in range(len(found), 2 * len(found)):
        hands.answer(k)
    assert computing.shown.number == second
    assert {one.failure for one in computing.shown.designs.values()} == {"second"}
    assert "second" in sizes_parts(computing.shown, found)["state"]


@pytest.mark.slow
def test_a_sheet_is_judged_once_it_is_whole(tuned):
    choices, found = tuned
    two = found[1:3]
    hands = ByHand()
    computing = Computing(two, hands)
    computing.request(choices)
    hands.answer(0)
    assert not computing.shown.designs
    hands.answer(1)
    assert len(hands.calls) == 2 + 2 * 4
    assert sizes_parts(computing.shown, two)["sheet"].endswith("being computed</p>")
    for k in range(2, 10):
        hands.answer(k)
    table = computing.shown.table(two)
    expected = computing.shown.designs[two[0].airspeed].measures["yaw"]["gain"]
    assert table.over("controller", "yaw", "gain margin")[0] == pytest.approx(expected)
    shown = sizes_parts(computing.shown, two)
    assert "entries that count are in Level 1" in shown["sheet"]
    assert "Nothing of this is proven" in shown["state"]
    assert shown["margins"].count("<svg") == 3


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


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A file of choices for a lag over airspeed, and its model."""
    folder = tmp_path_factory.mktemp("small")
    models = [
        symheli.LinearModel(
            [[0.2 - 0.1 * V]], [[5.0, 1.0]], [[1.0]], [[0.0, 0.0]], ["v"], ["d_lat", "v_w"], ["v"]
        )
        for V in (0.0, 4.0, 8.0)
    ]
    family = symheli.LinearFamily.from_models([0.0, 4.0, 8.0], models)
    family.save(folder / "family.json")
    (folder / "small.toml").write_text(SMALL)
    return folder / "small.toml", family


def test_choices_of_which_nothing_is_proven_are_saved_beside(small, tmp_path):
    """`synthesize` reads what is saved, and finds the same sizes."""
    path, family = small
    choices = replace(DesignChoices.read(path, {}), out=tmp_path / "out")
    moved = Moved(choices, lambda _: None)
    moved.move(next(s for s in moved.sizes if s.name == "v_w"), 0.5)
    proving = Proving(family)
    (written,) = proving.save(moved.choices)
    proving.close()
    assert written == tmp_path / "out" / "sizes.toml"
    again = DesignChoices.read(written, {})
    assert again.sizes == {"v": 1.0, "d_lat": 0.05, "v_w": 3.16}
    assert again.noise == choices.noise


@pytest.mark.slow
def test_a_proof_is_saved_with_its_table_and_its_c(small, tmp_path):
    """What is written verifies, and is of the sizes that were proven."""
    path, family = small
    choices = replace(DesignChoices.read(path, {}), out=tmp_path / "out")
    proving = Proving(family)
    proving.begin(choices)
    until(lambda: not proving.running)
    assert proving.proof is not None, proving.said
    shown = proof_words(proving, choices)
    assert "keeps a gain of" in shown
    assert "of other sizes" not in shown
    other = replace(choices, noise={"v": 0.5})
    assert "of other sizes" in proof_words(proving, other)
    assert [p.name for p in proving.save(other)] == ["sizes.toml"]
    names = {written.name for written in proving.save(choices)}
    proving.close()
    assert {"controller.json", "certificate.json", "synthesize.toml", "controller.c"} <= names
    again = DesignChoices.read(tmp_path / "out" / "synthesize.toml", {})
    assert again.sizes == choices.sizes
    assert cli.main(["verify", str(tmp_path / "out" / "certificate.json")]) == 0


@pytest.mark.slow
def test_a_proof_is_given_up_at_once(tuned):
    choices, _ = tuned
    proving = Proving()
    proving.begin(choices)
    until(lambda: "begins" not in proving.progress)
    begun = time.monotonic()
    proving.cancel()
    until(lambda: not proving.running)
    assert time.monotonic() - begun < 2.0
    assert proving.proof is None
    assert "given up" in proof_words(proving, choices)
    proving.close()


@pytest.mark.slow
def test_a_design_that_is_impossible_says_why(tuned):
    choices, _ = tuned
    proving = Proving()
    proving.begin(replace(choices, gain=0.01))
    until(lambda: not proving.running)
    assert "no controller" in proof_words(proving, choices)
    proving.close()


def until(true, seconds=120.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)
