"""A simulated vehicle in real time: a flight whose controller sends its samples over the wire and
takes commands from there.
"""

from __future__ import annotations

import contextlib
import math
import select
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from studies.live import mavlink, xplane
from studies.live.sample import EXCITATION, STICKS
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.values.named_vector import NamedVector

FRESH = 0.5
"""Seconds after which a command from the wire is too old, and the autopilot has the stick again."""
MOST_REQUESTS = 10_000
"""Requests of all clients, at most: one more drops the client that came first."""
TAKEN = ("RC_CHANNELS_OVERRIDE", "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET")
"""Messages that a vehicle takes."""
PARAMETERS_A_SAMPLE = 2
"""Parameters that are sent with a sample, at most: 100 a second."""
MEASURED = ("u", "v", "w", "p", "q", "r", "phi", "theta", "airspeed")


class Line(Protocol):
    """A protocol that a simulated vehicle speaks."""

    def send(self, at: float, values: Mapping[str, float]) -> None:
        """Send the values of the vehicle at `at` (s), to whom asked for them."""

    def wait(self, timeout: float) -> Mapping[str, float]:
        """Serve requests for so long (s); return the sticks that were set meanwhile."""
        ...

    def close(self) -> None:
        """Close its sockets."""


class XPlaneLine:
    """X-Plane's UDP from its side: answers requests for datarefs, and takes datarefs that are set.

    Raises `InputError` where the port is taken.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = xplane.PORT):
        self._socket = xplane.bound(host, port)
        self.port = self._socket.getsockname()[1]
        self._asked: dict[Any, dict[int, xplane.Request]] = {}
        self._due: dict[Any, float] = {}
        self._factors = dict(xplane.DATAREFS.values())
        self._names = {xplane.DATAREFS[name][0]: name for name in STICKS}
        self._names[xplane.EXCITES] = EXCITATION

    def send(self, at: float, values: Mapping[str, float]) -> None:
        """Send each client what it asked for, at the rate of its fastest request."""
        shown = xplane.shown(at, values)
        for client, requests in list(self._asked.items()):
            if at < self._due.get(client, -math.inf) - 1e-9:
                continue
            frequency = max(one.frequency for one in requests.values())
            self._due[client] = at + 1.0 / frequency
            found = {k: shown.get(one.dataref, 0.0) for k, one in requests.items()}
            for datagram in xplane.answers(found):
                with contextlib.suppress(OSError):  # no way there
                    self._socket.sendto(datagram, client)

    def wait(self, timeout: float) -> dict[str, float]:
        """Serve requests for so long (s); return the sticks that were set."""
        sticks: dict[str, float] = {}
        end = time.monotonic() + timeout
        for _ in range(xplane.AT_ONCE):
            if not select.select([self._socket], [], [], max(end - time.monotonic(), 0.0))[0]:
                break
            try:
                datagram, client = self._socket.recvfrom(xplane.LARGEST)
            except ConnectionError:  # a client that has gone
                continue
            request, setting = xplane.requested(datagram), xplane.set_by(datagram)
            if request is not None:
                self._take(client, request)
            elif setting is not None and (name := self._names.get(setting[0])):
                sticks[name] = setting[1]
        time.sleep(max(end - time.monotonic(), 0.0))
        return sticks

    def _take(self, client: Any, request: xplane.Request) -> None:
        requests = self._asked.setdefault(client, {})
        if request.frequency > 0:
            requests[request.number] = request
        else:
            requests.pop(request.number, None)
        crowded = sum(map(len, self._asked.values())) > MOST_REQUESTS
        leaving = next(iter(self._asked)) if crowded else client
        if crowded or not requests:
            del self._asked[leaving]
            self._due.pop(leaving, None)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class MavlinkLine:
    """A vehicle's side of MAVLink over UDP: a heartbeat a second, and the messages of a sample.

    Takes RC_CHANNELS_OVERRIDE: channels 1 to 4 are the sticks, 1000 to 2000 us. Answers requests
    for its `parameters`, {name: number in SI}, which nobody sets from there.
    """

    def __init__(
        self,
        address: str = f"udpout:127.0.0.1:{mavlink.PORT}",
        parameters: Mapping[str, float] | None = None,
    ):
        self._parameters = mavlink.parameters(parameters or {})
        self._asked: deque[int] = deque(maxlen=MOST_REQUESTS)
        self._library = mavlink.library()
        self._link = mavlink.opened(
            address, source_system=mavlink.SYSTEM, source_component=mavlink.COMPONENT
        )
        self._beat = -math.inf

    def send(self, at: float, values: Mapping[str, float]) -> None:
        """Send the messages of a sample."""
        link = self._link.mav
        try:
            if at - self._beat >= 1.0:
                self._beat = at
                m = self._library.mavlink
                link.heartbeat_send(m.MAV_TYPE_HELICOPTER, m.MAV_AUTOPILOT_GENERIC, 0, 0, 0)
            mavlink.sent(link, at, values)
            for _ in range(min(PARAMETERS_A_SAMPLE, len(self._asked))):
                self._send_parameter(self._asked.popleft())
        except OSError:  # nobody listens
            pass

    def wait(self, timeout: float) -> dict[str, float]:
        """Take messages for so long (s); return the sticks that were set."""
        sticks: dict[str, float] = {}
        end = time.monotonic() + timeout
        while True:
            left = end - time.monotonic()
            message = self._link.recv_match(
                type=list(TAKEN), blocking=left > 0, timeout=max(left, 0.0)
            )
            if message is None:
                return sticks
            if message.get_type() != "RC_CHANNELS_OVERRIDE":
                self._ask(message)
                continue
            for k, name in enumerate(STICKS):
                us = getattr(message, f"chan{k + 1}_raw")
                if 0 < us < 2**16 - 1:
                    sticks[name] = (us - mavlink.CENTRE) / mavlink.TRAVEL

    def close(self) -> None:
        """Close the socket."""
        self._link.close()

    def _ask(self, message: Any) -> None:
        """Note which parameters are asked for; who would set one is told what it is."""
        names = list(self._parameters)
        if message.get_type() == "PARAM_REQUEST_LIST":
            self._asked.extend(k for k in range(len(names)) if k not in self._asked)
        elif getattr(message, "param_index", -1) >= 0:
            self._asked.append(message.param_index)
        elif message.param_id in names:
            self._asked.append(names.index(message.param_id))

    def _send_parameter(self, index: int) -> None:
        names = list(self._parameters)
        if index < len(names):
            self._link.mav.param_value_send(
                names[index].encode(),
                self._parameters[names[index]],
                self._library.mavlink.MAV_PARAM_TYPE_REAL32,
                len(names),
                index,
            )


class OnTheWire:
    """A controller that flies as `inner` does, in real time, while each sample goes over lines.

    Sticks that are set from there, as fractions of the travel of each control, replace the command
    of `inner` until they are older than `FRESH`. What is set of the excitation stays.

    Parameters
    ----------
    inner
        Controller with `init()` and `step(state, measured, reference, p)`.
    lines : sequence of Line
        Protocols.
    travel : array (4,)
        Of each control to either side, rad.
    speed : float
        Times real time; inf as fast as it goes.
    added : array (samples, 4), optional
        Excitation on top of the commands, rad.
    """

    def __init__(
        self,
        inner: Any,
        lines: Sequence[Line],
        travel: Array,
        speed: float = 1.0,
        added: Array | None = None,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.inner, self.lines, self.travel, self.speed = inner, lines, np.asarray(travel), speed
        self._added = np.zeros((0, len(STICKS))) if added is None else added
        self.dt, self._clock = inner.dt, clock
        self.late = 0
        self.reset()

    def reset(self) -> None:
        """Begin a flight."""
        self._state, self.samples, self._psi = self.inner.init(), 0, 0.0
        self._begun = self._clock()
        self._set: dict[str, tuple[float, float]] = {}
        self._turned = math.nan

    def step(self, measured: NamedVector, reference: NamedVector, p: NamedVector) -> Array:
        """Return the commands; send the sample and wait until it is due."""
        at = self.samples * self.dt
        u, self._state = self.inner.step(self._state, measured, reference, p)
        u = np.array(u, float)
        if self.samples < len(self._added):
            excites, _ = self._set.get(EXCITATION, (1.0, at))
            u += float(excites > 0) * self._added[self.samples]
        for k, name in enumerate(STICKS):
            value, when = self._set.get(name, (0.0, -math.inf))
            if at - when <= FRESH:
                u[k] = value * self.travel[k]
        u = np.clip(u, -self.travel, self.travel)
        values = {name: float(measured[name]) for name in MEASURED}
        values["psi"] = self._heading(values)
        values |= dict(zip(STICKS, (u / self.travel).tolist(), strict=True))
        values |= dict(zip(map(str, INPUTS), u.tolist(), strict=True))
        for line in self.lines:
            line.send(at, values)
        self.samples += 1
        self._wait(self._begun + self.samples * self.dt / self.speed, at + self.dt)
        return u

    def _wait(self, due: float, at: float) -> None:
        left = due - self._clock()
        self.late += left < 0
        if left < -self.dt / self.speed:  # time stands still: a burst would outrun every command
            self._begun -= left
            due -= left
        for k, line in enumerate(self.lines):
            last = k == len(self.lines) - 1
            sticks = line.wait(max(due - self._clock(), 0.0) if last else 0.0)
            self._set |= {name: (float(v), at) for name, v in sticks.items() if math.isfinite(v)}

    def _heading(self, values: Mapping[str, float]) -> float:
        """Heading, rad, as the rates turn it."""
        turned = (
            values["q"] * math.sin(values["phi"]) + values["r"] * math.cos(values["phi"])
        ) / math.cos(values["theta"])
        if self.samples:
            self._psi += 0.5 * self.dt * (turned + self._turned)
        self._turned = turned
        return self._psi
