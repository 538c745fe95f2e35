"""The protocols against clients that know nothing of this code, and the record of what came."""

import math
import os
import random
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import symheli
from studies.live import mavlink, peer, xplane
from studies.live.earth import earth_velocity
from studies.live.identifier import LiveIdentifier
from studies.live.peer import MavlinkLine, OnTheWire, XPlaneLine
from studies.live.recorder import Recorder
from studies.live.sample import STICKS, Sample
from studies.live.stream import Stream
from studies.live.watch import Watch
from studies.live.xplane import XPlaneSource
from symheli import FlightRecord
from symheli.errors import InputError
from symheli.logs.xplane import body_velocity

STATE = {
    **dict(zip("uvw", (7.0, -0.4, 0.9), strict=True)),
    **dict(zip("pqr", (0.3, -0.2, 0.5), strict=True)),
    **{"phi": 0.2, "theta": -0.1, "psi": 1.0, "airspeed": 7.1},
    **{"stick_lon": 0.1, "stick_lat": -0.2, "stick_col": 0.6, "stick_ped": 0.3},
}


def test_velocities_go_to_earth_and_back():
    angles = (0.4, -0.3, 2.0)
    back = body_velocity(*earth_velocity(3.0, -2.0, 1.0, *angles), *angles)
    np.testing.assert_allclose(back, (3.0, -2.0, 1.0), rtol=1e-14)


@pytest.fixture
def line():
    made = XPlaneLine(port=0)
    yield made
    made.close()


@pytest.fixture
def client(line):
    """A plain socket, with X-Plane's published formats written out."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.settimeout(2.0)
    made.connect(("127.0.0.1", line.port))
    yield made
    made.close()


def test_a_plain_socket_reads_datarefs(line, client):
    for number, name in ((7, b"sim/flightmodel/position/Q"), (9, b"sim/nothing/of/the/kind")):
        client.send(struct.pack("<4sxii400s", b"RREF", 50, number, name))
    line.wait(0.05)
    line.send(0.0, STATE)
    answer = client.recv(2048)
    assert answer[:5] == b"RREF,"
    found = dict(struct.iter_unpack("<if", answer[5:]))
    assert found[7] == pytest.approx(math.degrees(STATE["q"]), rel=1e-6)
    assert found[9] == 0.0  # as X-Plane answers for a dataref that it does not have


def test_the_rate_is_that_asked_for_and_0_ends_it(line, client):
    client.send(struct.pack("<4sxii400s", b"RREF", 10, 1, b"sim/flightmodel/position/Q"))
    line.wait(0.05)
    for k in range(51):  # a second at 50 Hz
        line.send(0.02 * k, STATE)
    client.setblocking(False)
    assert len(drained(client)) == 11
    client.send(struct.pack("<4sxii400s", b"RREF", 0, 1, b"sim/flightmodel/position/Q"))
    line.wait(0.05)
    line.send(2.0, STATE)
    assert drained(client) == []


def drained(client):
    found = []
    try:
        while True:
            found.append(client.recv(2048))
    except BlockingIOError:
        return found


def test_a_dataref_that_is_set_moves_a_stick(line, client):
    client.send(struct.pack("<4sxf500s", b"DREF", -0.25, b"sim/joystick/yoke_roll_ratio"))
    client.send(struct.pack("<4sxf500s", b"DREF", 1.0, b"sim/cockpit/switches/no_stick"))
    client.send(b"nonsense")
    assert line.wait(0.05) == {"stick_lat": -0.25}


def test_a_port_that_is_taken_is_refused(line):
    with pytest.raises(InputError, match="cannot be had"):
        XPlaneLine(port=line.port)


def test_an_answer_fits_into_datagrams(line, client):
    for number in range(1000):
        client.send(struct.pack("<4sxii400s", b"RREF", 1000, number, b"sim/no"))
        line.wait(0.0)
    line.send(0.0, STATE)
    client.setblocking(False)
    found = [k for one in drained(client) for k, _ in struct.iter_unpack("<if", one[5:])]
    assert sorted(found) == list(range(1000))


def test_clients_that_never_leave_are_dropped(line, monkeypatch):
    """The first of them, when there are too many requests; a negative frequency asks nothing."""
    monkeypatch.setattr(peer, "MOST_REQUESTS", 5)
    for number in range(20):
        line._take(("127.0.0.1", 1000 + number), xplane.Request(50, 1, "sim/no"))
        line._take(("127.0.0.1", 9), xplane.Request(-50, number, "sim/no"))
        line.send(float(number), STATE)
    assert [port for _, port in line._asked] == list(range(1015, 1020))
    assert len(line._due) == 5


def test_a_flood_neither_stops_nor_hurries_the_flight(line):
    """Another process sends as fast as it can."""
    code = "import socket, sys\ns = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\n"
    code += "while True: s.sendto(b'DREF' + bytes(30), ('127.0.0.1', int(sys.argv[1])))"
    flood = subprocess.Popen([sys.executable, "-c", code, str(line.port)])
    try:
        select.select([line._socket], [], [], 10.0)
        begun = time.monotonic()
        line.wait(0.3)
        assert 0.3 <= time.monotonic() - begun < 3.0
    finally:
        flood.kill()
        flood.wait()


@pytest.mark.parametrize("port", [0, 70000])
def test_a_port_out_of_range_is_refused(port):
    with pytest.raises(InputError, match="expected 1 to 65535"):
        XPlaneSource(port=port)


def test_noise_from_the_network_is_left_out(line):
    """Random bytes, and answers with random numbers; the next answer is read as ever."""
    rng, source = random.Random(0), XPlaneSource(port=line.port)
    source.receive(0.0)
    line.wait(0.05)
    (address,) = line._asked
    for _ in range(100):
        line._socket.sendto(rng.randbytes(rng.randint(0, 300)), address)
        line._socket.sendto(b"RREF," + rng.randbytes(8 * rng.randint(0, 40)), address)
    for bad in (math.nan, math.inf, -1e30):
        line._socket.sendto(b"".join(xplane.answers(dict.fromkeys(range(15), bad))), address)
    stream = Stream(tuple(STATE), 0.02)
    for sample in source.receive(0.1):
        assert all(np.isnan(row.values).any() for row in stream.take(sample, 0.0))
    line.send(12.5, STATE)
    (found,) = source.receive(1.0)
    assert found.values["q"] == pytest.approx(STATE["q"])
    source.close()


def test_the_source_reads_what_the_line_sends(line):
    source = XPlaneSource(port=line.port)
    assert list(source.receive(0.0)) == []
    line.wait(0.1)
    line.send(12.5, STATE)
    (found,) = source.receive(1.0)
    assert found.time == 12.5
    for name, value in STATE.items():
        assert found.values[name] == pytest.approx(value, rel=1e-5, abs=1e-6), name
    source.close()
    line.wait(0.05)
    assert not line._asked  # it has said that it wants no more


def test_an_answer_that_is_damaged_is_left_out(line):
    source = XPlaneSource(port=line.port)
    source.receive(0.0)
    line.wait(0.05)
    (address,) = line._asked
    for datagram in (b"RREF,\x00", b"RREF", b"", b"DATA\x00" + bytes(36)):
        line._socket.sendto(datagram, address)
    assert list(source.receive(0.2)) == []
    source.close()


def test_mavlink_both_ways():
    mavutil = pytest.importorskip("pymavlink.mavutil")
    from studies.live.mavlink import MavlinkSource

    port = free_port()
    source = MavlinkSource(f"udpin:127.0.0.1:{port}")
    line = MavlinkLine(f"udpout:127.0.0.1:{port}")
    line.send(3.0, STATE)
    (found,) = source.receive(1.0)
    assert (found.time, found.sender) == (3.0, "system 1")
    for name, value in STATE.items():
        near = 1e-3 if name.startswith("stick") else 1e-5  # servo outputs are whole us
        assert found.values[name] == pytest.approx(value, abs=near), name
    other = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=9)
    other.mav.attitude_send(4000, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    (found,) = source.receive(1.0)
    assert found.sender == "system 9"
    assert "u" not in found.values  # another vehicle's velocity is not taken for its own
    source._link.mav.rc_channels_override_send(1, 1, 1750, 0, 65535, 1400, 0, 0, 0, 0)
    assert line.wait(0.5) == {"stick_lon": 0.5, "stick_ped": -0.2}
    for each in (source, line, other):
        each.close()


def test_a_ground_station_reads_the_parameters_of_the_vehicle():
    """By pymavlink's own requests: all of them, one by name, one by number; none is set."""
    mavutil = pytest.importorskip("pymavlink.mavutil")
    heli = symheli.Helicopter.load("xcell60", governor="pi")
    numbers = {str(name): heli.parameters[name] for name in heli.parameters}
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    line = MavlinkLine(f"udpout:127.0.0.1:{port}", numbers)
    values = {**STATE, **dict.fromkeys(STICKS, 0.0)}
    line.send(0.0, values)
    assert station.wait_heartbeat(timeout=5.0) is not None

    def answers(ask, count):
        ask()
        found = {}
        for k in range(1, 200):
            line.wait(0.005)
            line.send(0.02 * k, values)
            while (message := station.recv_match(type="PARAM_VALUE")) is not None:
                found[message.param_id] = message.param_value
            if len(found) == count:
                return found
        raise AssertionError(f"{len(found)} of {count} came")

    found = answers(station.param_fetch_all, len(numbers))
    assert found["BODY_MASS"] == pytest.approx(numbers["body.mass"])
    assert found["MR_RADIUS"] == pytest.approx(numbers["main_rotor.radius"])
    assert sorted(found.values()) == pytest.approx(sorted(numbers.values()), rel=1e-6)
    one = {"BODY_MASS": pytest.approx(numbers["body.mass"])}
    assert answers(lambda: station.param_fetch_one("BODY_MASS"), 1) == one
    assert answers(lambda: station.param_set_send("BODY_MASS", 99.0), 1) == one
    assert len(answers(lambda: station.param_fetch_one(3), 1)) == 1
    for each in (station, line):
        each.close()


@pytest.fixture
def mavlink_pair():
    pytest.importorskip("pymavlink")
    port = free_port()
    pair = mavlink.MavlinkSource(f"udpin:127.0.0.1:{port}"), MavlinkLine(f"udpout:127.0.0.1:{port}")
    yield pair
    for each in pair:
        each.close()


def test_a_mavlink_port_is_not_shared(mavlink_pair):
    """A second listener would take the messages away without a word."""
    with pytest.raises(InputError, match="cannot be had"):
        mavlink.MavlinkSource(mavlink_pair[0].name.removeprefix("MAVLink at "))


@pytest.mark.parametrize("address", ["udpin:127.0.0.1", "udpin:127.0.0.1:x", "udpout:127.0.0.1"])
def test_a_mavlink_address_that_is_none_is_refused(address):
    pytest.importorskip("pymavlink")
    with pytest.raises(InputError, match="cannot be opened"):
        mavlink.opened(address)


def test_mavlink_goes_on_after_71_minutes(mavlink_pair):
    """Where the microseconds of its servo outputs begin again from 0."""
    source, line = mavlink_pair
    line.send(2.0**32 * 1e-6 + 1.0, STATE)
    (found,) = source.receive(1.0)
    assert found.values["stick_col"] == pytest.approx(0.6)


def test_a_servo_that_is_not_in_use_is_no_stick(mavlink_pair):
    source, line = mavlink_pair
    line.send(0.0, STATE)
    line._link.mav.servo_output_raw_send(0, 0, 0, 65535, 1500, 1000, *[0] * 4)
    line._link.mav.attitude_send(0, *[0.0] * 6)
    *_, found = source.receive(1.0)
    sticks = [found.values[name] for name in mavlink.STICKS]
    np.testing.assert_array_equal(sticks, [math.nan, math.nan, 0.0, -1.0])


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


# --- a flight on the wire -------------------------------------------------------------------------


class Hold:
    """A controller that leaves everything at its trim."""

    dt = 0.02

    def init(self):
        return None

    def step(self, state, measured, reference, p):
        return np.array([reference[n] for n in ("d_lon", "d_lat", "d_col", "d_ped")]), state


class Script:
    """A line that keeps what is sent and gives the sticks of a script."""

    def __init__(self, sticks=()):
        self.sent, self._sticks = [], dict(sticks)

    def send(self, at, values):
        self.sent.append((at, dict(values)))

    def wait(self, timeout):
        return self._sticks.pop(len(self.sent), {})

    def close(self):
        pass


@pytest.fixture(scope="module")
def heli():
    return symheli.Helicopter.load("xcell60", governor="ideal")


def flown(heli, line, **options):
    wire = OnTheWire(Hold(), [line], heli.travel, math.inf, **options)
    hover = symheli.AirspeedSchedule((4.0,), (1.0,), (1.0,), start=4.0, lead=0.0)
    return wire, symheli.fly(heli, hover, controller=wire)


def test_what_is_sent_is_what_is_flown(heli):
    line = Script()
    wire, record = flown(heli, line)
    assert wire.samples == len(line.sent) == len(record)
    for k in (0, 10, len(record) - 1):
        at, values = line.sent[k]
        assert at == pytest.approx(0.02 * k)
        assert values["q"] == pytest.approx(record["q"][k], abs=1e-12)
        travel = dict(zip(map(str, heli.inputs), heli.travel, strict=True))
        assert values["stick_ped"] * travel["d_ped"] == pytest.approx(record["d_ped"][k], abs=1e-12)


def test_a_stick_from_the_wire_is_flown_until_it_is_old(heli):
    line = Script({5: {"stick_lat": 0.1, "stick_col": math.nan}})
    _, record = flown(heli, line)
    quiet = flown(heli, Script())[1]
    lateral, same = record["d_lat"] / heli.travel[1], record["d_lat"] == quiet["d_lat"]
    np.testing.assert_allclose(lateral[5:30], 0.1)  # half a second
    assert same[:5].all()
    assert same[31:].all()
    assert (record["d_col"] == quiet["d_col"]).all()  # no number moves nothing


def test_a_stick_beyond_its_stop_stays_there(heli):
    """A command of 1e9 is one of the full travel."""
    _, record = flown(heli, Script({5: {"stick_ped": 1e9}}))
    assert record["d_ped"].max() == pytest.approx(heli.travel[3])


def test_real_time_is_kept(heli):
    wire = OnTheWire(Hold(), [XPlaneLine(port=0)], heli.travel, 4.0)
    hover = symheli.AirspeedSchedule((4.0,), (1.0,), (2.0,), start=4.0, lead=0.0)
    symheli.fly(heli, hover, controller=Hold4())  # compiled before the clock runs
    begun = time.monotonic()
    symheli.fly(heli, hover, controller=wire)
    assert time.monotonic() - begun > 0.9 * wire.samples * 0.02 / 4.0
    wire.lines[0].close()


class Hold4(Hold):
    """Another object of the same kind: its flight is planned anew."""


# --- the record -----------------------------------------------------------------------------------


def test_a_record_is_read_back_to_the_last_bit(tmp_path):
    recorder = Recorder(tmp_path / "a.csv", ("q", "stick_lon"))
    rng = np.random.default_rng(0)
    values = rng.normal(size=(20, 2))
    for k, row in enumerate(values):
        recorder.add(Sample(0.02 * k, dict(zip(("q", "stick_lon"), row, strict=True)), "a"), 0.0)
    recorder.close()
    found = FlightRecord.from_csv(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.values, values)
    with pytest.raises(InputError, match="is there already"):
        Recorder(tmp_path / "a.csv", ("q",))


def test_a_record_of_nothing_leaves_no_file(tmp_path):
    Recorder(tmp_path / "a.csv", ("q",)).close()
    assert list(tmp_path.iterdir()) == []


class Full:
    """A file on a disk that takes `space` bytes and no more."""

    def __init__(self, file, space):
        self.file, self.space = file, space

    def write(self, line):
        part = line[: self.space]
        self.file.write(part)
        self.space -= len(part)
        if not part:
            raise OSError(28, "No space left on device")
        return len(part)

    def __getattr__(self, name):
        return getattr(self.file, name)


def test_a_full_disk_loses_nothing(tmp_path):
    recorder = Recorder(tmp_path / "a.csv", ("q",))
    disk = recorder._file = Full(recorder._file, 25)
    for k in range(10):
        recorder.add(Sample(float(k), {"q": 1.0}, "a"), float(k))
    assert "wait in memory" in recorder.problem
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert all(len(line.split(",")) == 2 for line in lines)  # no half line stands there
    assert len(lines) < 11
    disk.space = 10**6
    recorder.add(Sample(10.0, {"q": math.nan}, "a"), 10.0)
    recorder.close()
    assert recorder.problem is None
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[1:] == [*(f"{float(k)},1.0" for k in range(10)), "10.0,"]


def test_a_record_that_is_not_whole_at_the_end_is_said(tmp_path):
    """What waited for the disk is lost then."""
    said = []

    class Three:
        name = "three"

        def receive(self, timeout):
            yield from (Sample(0.02 * k, {"q": 1.0}, "a") for k in range(3))
            raise EOFError

        def close(self):
            pass

    recorder = Recorder(tmp_path / "a.csv", ("q",))
    recorder._file = Full(recorder._file, 5)
    identifier = LiveIdentifier(STICKS, 0.0, 13.0, 0.02)
    stream = Stream(identifier.signals, 0.02)
    Watch(Three(), identifier, stream, recorder).run(1.0, said.append)
    assert "a.csv is not whole" in said[-1]


def test_a_process_that_is_killed_has_written_everything(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path;"
        "from studies.live.recorder import Recorder; from studies.live.sample import Sample;"
        "r = Recorder(Path(sys.argv[1]), ('q',));"
        "[r.add(Sample(.02 * k, {'q': 1.0}, 'a'), 0.0) for k in range(500)];"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    path = tmp_path / "a.csv"
    ended = subprocess.run([sys.executable, "-c", code, str(path)], env=dict(os.environ))
    assert ended.returncode == -signal.SIGKILL
    assert len(FlightRecord.from_csv(path)) == 500


def test_a_flight_over_the_wire_is_identified(heli, tmp_path):
    """Real sockets, a hundred times real time: the model predicts, the record is whole."""
    inner = symheli.flight.gain_scheduled_lqr(heli, 0.0, 6.0, 0.02).scheduled_controller
    schedule = symheli.AirspeedSchedule((5.0, 1.0), (2.0, 2.0), (4.0, 4.0), start=1.0)
    excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01), "multisine", (0.05, 4.0))
    time_of = 0.02 * np.arange(800)
    added = np.column_stack([excitation(time_of)[str(u)] for u in heli.inputs])
    line = XPlaneLine(port=0)
    wire = OnTheWire(inner, [line], heli.travel, 20.0, added)
    sticks = ("stick_lon", "stick_lat", "stick_col", "stick_ped")
    identifier = LiveIdentifier(sticks, 0.0, 6.0, degree=1)
    source = XPlaneSource(port=line.port)
    watch = Watch(source, identifier, Stream(identifier.signals, 0.02))
    watch.recorder = Recorder(tmp_path / "a.csv", ("q", *sticks))
    said = []
    source.receive(0.0)
    flight = threading.Thread(
        target=symheli.fly, args=(heli, schedule), kwargs={"controller": wire}
    )
    flight.start()
    watch.run(wire.samples * 0.02 / 20.0 + 3.0, said.append)
    flight.join()
    line.close()
    assert watch.received > 0.9 * wire.samples  # a busy machine drops datagrams
    assert identifier.learnt > 0.8 * watch.received
    assert identifier.model() is not None
    found = {(p.output, p.control): p for p in identifier.control_powers([3.0])}
    assert set(found) == {("p", sticks[1]), ("q", sticks[0]), ("w", sticks[2]), ("r", sticks[3])}
    assert found["p", "stick_lat"].value > 10 * found["p", "stick_lat"].error
    assert len(FlightRecord.from_csv(tmp_path / "a.csv")) == watch.received
    assert "learnt" in said[-1]


def test_a_vehicle_that_was_held_up_does_not_hurry_after():
    """Its samples go on a period apart: a burst of them would outrun every command."""
    now, waits = [0.0], []

    class Known:
        def send(self, at, values):
            now[0] += 1.0 if round(at / 0.02) == 10 else 1e-3

        def wait(self, timeout):
            waits.append(timeout)
            now[0] += timeout
            return {}

    class Level:
        dt = 0.02

        def init(self):
            return None

        def step(self, state, measured, reference, p):
            return np.zeros(4), state

    wire = OnTheWire(Level(), [Known()], np.ones(4), clock=lambda: now[0])
    for _ in range(30):
        wire.step(STATE, {}, {})
    assert waits[9] == pytest.approx(0.019)
    assert waits[10] == 0.0
    assert waits[11:] == pytest.approx([0.019] * 19)
    assert wire.late == 1


@pytest.mark.slow
def test_a_client_of_x_plane_by_other_hands_flies_the_vehicle():
    """pyxpudpserver, unchanged: it reads datarefs, sets a stick, and is forgotten when it quits."""
    package = pytest.importorskip("pyxpudpserver")
    client = package.XPlaneUDPServer()
    line, sticks, over = XPlaneLine(port=0), {}, threading.Event()
    values = dict.fromkeys(("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", *STICKS), 0.0)
    values |= {"u": 5.0, "airspeed": 5.0, "phi": 0.2, "stick_lat": -0.5}

    def serve():
        at = 0.0
        while not over.is_set():
            line.send(at, values)
            sticks.update(line.wait(0.02))
            at += 0.02

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        client.initialiseUDP(("127.0.0.1", 0), ("127.0.0.1", line.port), "this machine")
        client.start()
        names = [xplane.DATAREFS[name][0] for name in ("phi", "airspeed", "stick_lat")]
        for name in names:
            client.requestXPDref(name)
        client.sendXPDref(xplane.DATAREFS["stick_lon"][0], 0, 0.25)
        end = time.monotonic() + 20.0
        while time.monotonic() < end and not (
            "stick_lon" in sticks and all(client.getData(name) for name in names)
        ):
            time.sleep(0.05)
        read = [client.getData(name) for name in names]
        assert read == pytest.approx([math.degrees(0.2), 5.0, -0.5], rel=1e-6)
        assert sticks == {"stick_lon": pytest.approx(0.25)}
        client.quit()
        while time.monotonic() < end and line._asked:
            time.sleep(0.05)
        assert not line._asked
    finally:
        over.set()
        serving.join()
        line.close()
        for made in (client, package.pyXPUDPServer):
            made.sendSock.close()  # it does not itself
