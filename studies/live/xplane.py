"""X-Plane's own UDP: requests for datarefs (RREF), their values, and datarefs that are set (DREF).

Little-endian. A request is `RREF\\0`, samples a second and a number of one's own (int32), and the
dataref in 400 bytes; 0 a second ends it. An answer is `RREF,` and pairs of that number and the
value (int32, float32). A dataref is set by `DREF\\0`, the value (float32) and the dataref in 500
bytes.
Source: "Exchanging data with X-Plane" in the folder Instructions of X-Plane 11 and 12.
"""

from __future__ import annotations

import contextlib
import math
import select
import socket
import struct
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from studies.live.earth import earth_velocity, in_body
from studies.live.sample import EXCITATION, Sample
from symheli.errors import InputError

PORT = 49000
"""UDP port on which X-Plane listens."""
REQUEST, SETTING, ENTRY = (
    struct.Struct("<5sii400s"),
    struct.Struct("<5sf500s"),
    struct.Struct("<if"),
)
ANSWER = b"RREF,"
ANSWERS = (b"RREF,", b"RREFO")
"""First bytes of an answer; the second of X-Plane 11 before 11.10."""
SILENCE = 1.0
"""Seconds without an answer after which the request is sent again: X-Plane forgets it when it loads
an aircraft.
"""
LARGEST = 65535
"""Bytes of a datagram, at most."""
AT_ONCE = 1000
"""Datagrams that are read in one go, at most: a flood stops nothing else."""
PER_ANSWER = 180
"""Values in an answer, at most: more do not pass an Ethernet in one piece."""

DEG, KNOT = math.pi / 180.0, 0.514444
DATAREFS: Mapping[str, tuple[str, float]] = {
    "time": ("sim/time/total_flight_time_sec", 1.0),
    "east": ("sim/flightmodel/position/local_vx", 1.0),
    "up": ("sim/flightmodel/position/local_vy", 1.0),
    "south": ("sim/flightmodel/position/local_vz", 1.0),
    "p": ("sim/flightmodel/position/P", DEG),
    "q": ("sim/flightmodel/position/Q", DEG),
    "r": ("sim/flightmodel/position/R", DEG),
    "phi": ("sim/flightmodel/position/true_phi", DEG),
    "theta": ("sim/flightmodel/position/true_theta", DEG),
    "psi": ("sim/flightmodel/position/true_psi", DEG),
    "airspeed": ("sim/flightmodel/position/true_airspeed", 1.0),
    "stick_lon": ("sim/joystick/yoke_pitch_ratio", 1.0),
    "stick_lat": ("sim/joystick/yoke_roll_ratio", 1.0),
    "stick_col": ("sim/cockpit2/engine/actuators/prop_ratio_all", 1.0),
    "stick_ped": ("sim/joystick/yoke_heading_ratio", 1.0),
}
"""Dataref of each quantity, and its unit in SI."""
EXCITES = "symheli/excitation"
"""Dataref of a simulated vehicle's own: whether its autopilot excites it."""
EARTH = ("east", "up", "south")


class Request(NamedTuple):
    """What a client asks for: a dataref, so many times a second (0: no more), under its number."""

    frequency: int
    number: int
    dataref: str


def request(frequency: int, number: int, dataref: str) -> bytes:
    """Return the datagram that asks for a dataref."""
    return REQUEST.pack(b"RREF\0", frequency, number, dataref.encode("ascii"))


def setting(dataref: str, value: float) -> bytes:
    """Return the datagram that sets a dataref."""
    return SETTING.pack(b"DREF\0", value, dataref.encode("ascii"))


def answers(values: Mapping[int, float]) -> list[bytes]:
    """Return the datagrams with values by their numbers."""
    packed = [ENTRY.pack(number, value) for number, value in values.items()]
    firsts = range(0, len(packed), PER_ANSWER)
    return [ANSWER + b"".join(packed[k : k + PER_ANSWER]) for k in firsts]


def shown(at: float, values: Mapping[str, float]) -> dict[str, float]:
    """Return the datarefs of a vehicle at a time (s), in X-Plane's units, from its signals."""
    angles = [values[name] for name in ("phi", "theta", "psi")]
    north, east, down = earth_velocity(*(values[name] for name in "uvw"), *angles)
    raw = {**values, "time": at, "east": east, "up": -down, "south": -north}
    return {
        dataref: raw[name] / factor for name, (dataref, factor) in DATAREFS.items() if name in raw
    }


def requested(datagram: bytes) -> Request | None:
    """Return the request in a datagram; None of any other."""
    if datagram[:4] != b"RREF" or len(datagram) < 13 + 1:
        return None
    frequency, number = struct.unpack_from("<ii", datagram, 5)
    return Request(frequency, number, _text(datagram[13:]))


def set_by(datagram: bytes) -> tuple[str, float] | None:
    """Return the dataref that a datagram sets, and its value; None of any other datagram."""
    if datagram[:4] != b"DREF" or len(datagram) < 9 + 1:
        return None
    (value,) = struct.unpack_from("<f", datagram, 5)
    return _text(datagram[9:]), value


def answered(datagram: bytes) -> dict[int, float] | None:
    """Return the values in an answer, by number; None of any other datagram, and of a damaged
    one.
    """
    if datagram[:5] not in ANSWERS or (len(datagram) - 5) % ENTRY.size:
        return None
    return dict(ENTRY.iter_unpack(datagram[5:]))


def _text(field: bytes) -> str:
    """A dataref; its first and only element is the dataref itself."""
    return field.split(b"\0")[0].decode("ascii", "replace").strip().removesuffix("[0]")


def bound(host: str, port: int) -> socket.socket:
    """Return a UDP socket at this address. Raises `InputError` where it is taken."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind((host, port))
    except (OSError, OverflowError) as error:
        made.close()
        raise InputError(f"port {port} of {host} cannot be had ({error}): give another") from error
    return made


class XPlaneSource:
    """X-Plane, or what speaks like it, at an address.

    Parameters
    ----------
    host, port
        Where X-Plane listens.
    rate : int
        Samples a second.
    datarefs : mapping
        {quantity: (dataref, its unit in SI)}, in place of `DATAREFS` or besides.

    Raises
    ------
    InputError
        For a host that has no address, and a port or rate out of range.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        rate: int = 50,
        datarefs: Mapping[str, tuple[str, float]] | None = None,
    ):
        self.name = f"X-Plane at {host}:{port}"
        self.rate, self.datarefs = rate, {**DATAREFS, **(datarefs or {})}
        self._quantities = list(self.datarefs)
        self.signals = (*"uvw", *self._quantities)
        if not 0 < port < 2**16:
            raise InputError(f"port: expected 1 to 65535, got {port}")
        try:
            self._peer = (socket.gethostbyname(host), port)
        except OSError as error:
            raise InputError(f"no address for the host {host!r}: {error}") from error
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(("127.0.0.1" if self._peer[0].startswith("127.") else "", 0))
        self._asked = -math.inf

    def receive(self, timeout: float) -> Sequence[Sample]:
        """Return the samples that have come; ask again where nothing has come for a while."""
        now = time.monotonic()
        if now - self._asked > SILENCE:
            self._ask(self.rate)
            self._asked = now
        found: list[Sample] = []
        select.select([self._socket], [], [], timeout)
        for _ in range(AT_ONCE):
            try:
                datagram, (host, port) = self._socket.recvfrom(LARGEST)
            except OSError:  # nothing more, or nobody listens there yet
                break
            values = answered(datagram)
            if values is not None:
                self._asked = time.monotonic()
                found += self._samples(values, f"{host}:{port}")
        return found

    def _samples(self, values: Mapping[int, float], sender: str) -> list[Sample]:
        raw = {
            name: values[k] * self.datarefs[name][1]
            for k, name in enumerate(self._quantities)
            if k in values
        }
        if "time" not in raw:
            return []
        if all(name in raw for name in (*EARTH, "phi", "theta", "psi")):
            east, up, south = (raw.pop(name) for name in EARTH)
            raw |= in_body(-south, east, -up, raw["phi"], raw["theta"], raw["psi"])
        return [Sample(raw.pop("time"), raw, sender)]

    def _ask(self, frequency: int) -> None:
        with contextlib.suppress(OSError):  # no way there now: it is asked again
            for k, name in enumerate(self._quantities):
                self._socket.sendto(request(frequency, k, self.datarefs[name][0]), self._peer)

    def command(self, sticks: Mapping[str, float]) -> None:
        """Set the datarefs of sticks, each -1 to 1, and whether a vehicle of symheli serve excites
        itself.
        """
        with contextlib.suppress(OSError):  # nobody listens there now
            for name, value in sticks.items():
                dataref = EXCITES if name == EXCITATION else self.datarefs[name][0]
                self._socket.sendto(setting(dataref, value), self._peer)

    def close(self) -> None:
        """Ask X-Plane to send no more."""
        self._ask(0)
        self._socket.close()
