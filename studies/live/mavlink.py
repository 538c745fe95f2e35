"""MAVLink over UDP or a serial line: a vehicle's stream, and what a simulated vehicle sends.

A sample is made at each ATTITUDE, with the latest velocity (LOCAL_POSITION_NED), servo outputs
(SERVO_OUTPUT_RAW) and airspeed (VFR_HUD); all come at the rate of the stream. A servo output of
1000 to 2000 us is a stick from -1 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from studies.live.earth import earth_velocity, in_body
from studies.live.sample import STICKS, Sample
from studies.live.xplane import AT_ONCE, bound
from symheli.errors import InputError
from symheli.extras import extra

PORT = 14550
"""UDP port on which ground stations listen."""
CENTRE, TRAVEL = 1500.0, 500.0
"""Servo output in the middle, and from there to a stop, us."""
OLD = 0.5
"""Seconds on the sender's clock after which the last velocity or servo output is too old."""
SYSTEM, COMPONENT = 1, 1


def library() -> Any:
    """Return pymavlink's utilities. Raises `InputError` where it is not installed."""
    with extra("logs", "MAVLink"):
        from pymavlink import mavutil
    return mavutil


def opened(address: str, **options: Any) -> Any:
    """Return pymavlink's connection to an address. Raises `InputError` where it cannot be had: a
    port that another listens on would take its messages away.
    """
    kind, _, place = address.partition(":")
    try:
        if kind in ("udp", "udpin"):
            host, _, port = place.rpartition(":")
            bound(host, int(port)).close()
        return library().mavlink_connection(address, **options)
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(f"MAVLink at {address} cannot be opened: {error}") from error
    except ImportError as error:
        hint = "a serial line needs `pip install pyserial`; a port begins with udpin:"
        raise InputError(f"MAVLink at {address} cannot be opened: {hint}") from error


class MavlinkSource:
    """A vehicle that speaks MAVLink.

    Parameters
    ----------
    address : str
        As pymavlink writes it: "udpin:127.0.0.1:14550", "/dev/ttyUSB0".
    baud : int
        Of a serial line.

    Raises
    ------
    InputError
        Without pymavlink, and for an address that cannot be opened.
    """

    signals = (*"uvwpqr", "phi", "theta", "psi", "airspeed", *STICKS)
    rate = 50

    def __init__(self, address: str = f"udpin:127.0.0.1:{PORT}", baud: int = 57600):
        self.name = f"MAVLink at {address}"
        self._link = opened(address, baud=baud, robust_parsing=True)
        self._latest: dict[tuple[int, str], tuple[float, dict[str, float]]] = {}
        self._clock: dict[int, float] = {}

    def receive(self, timeout: float) -> Sequence[Sample]:
        """Return a sample for each ATTITUDE that has come."""
        found: list[Sample] = []
        message = self._link.recv_match(blocking=True, timeout=timeout)
        for _ in range(AT_ONCE):
            if message is None:
                break
            found += self._taken(message)
            message = self._link.recv_match(blocking=False)
        return found

    def _taken(self, message: Any) -> list[Sample]:
        kind, system = message.get_type(), message.get_srcSystem()
        if kind == "ATTITUDE":
            return [self._sample(message, system)]
        read = READ.get(kind)
        if read is not None:
            self._latest[system, kind] = self._time(message, system), read(message)
        return []

    def _time(self, message: Any, system: int) -> float:
        """Time of a message since boot, s, or the last (microseconds in 32 bits do not count)."""
        if hasattr(message, "time_boot_ms"):
            self._clock[system] = 1e-3 * message.time_boot_ms
        return self._clock.get(system, -math.inf)

    def _sample(self, attitude: Any, system: int) -> Sample:
        time = self._time(attitude, system)
        values = {
            "phi": attitude.roll,
            "theta": attitude.pitch,
            "psi": attitude.yaw,
            "p": attitude.rollspeed,
            "q": attitude.pitchspeed,
            "r": attitude.yawspeed,
        }
        for kind in READ:
            at, found = self._latest.get((system, kind), (-math.inf, {}))
            if abs(time - at) <= OLD:
                values |= found
        if "north" in values:
            earth = [values.pop(name) for name in ("north", "east", "down")]
            values |= in_body(*earth, *(values[name] for name in ("phi", "theta", "psi")))
        return Sample(time, values, f"system {system}")

    def close(self) -> None:
        """Close the line."""
        self._link.close()


def _velocity(message: Any) -> dict[str, float]:
    return {"north": message.vx, "east": message.vy, "down": message.vz}


def _servos(message: Any) -> dict[str, float]:
    raw = [getattr(message, f"servo{k + 1}_raw") for k in range(len(STICKS))]
    return {
        name: (us - CENTRE) / TRAVEL if 0 < us < 2**16 - 1 else math.nan  # 0: not in use
        for name, us in zip(STICKS, raw, strict=True)
    }


READ = {
    "LOCAL_POSITION_NED": _velocity,
    "SERVO_OUTPUT_RAW": _servos,
    "VFR_HUD": lambda message: {"airspeed": message.airspeed},
}
"""Readers of the messages beside the attitude."""


def sent(link: Any, time: float, values: Mapping[str, float]) -> None:
    """Send one set of values of a vehicle, the attitude last."""
    ms = round(1e3 * time) % 2**32
    angles = [values[name] for name in ("phi", "theta", "psi")]
    velocity = earth_velocity(*(values[name] for name in "uvw"), *angles)
    link.local_position_ned_send(ms, 0.0, 0.0, 0.0, *velocity)
    servos = [round(CENTRE + TRAVEL * min(max(values[name], -1.0), 1.0)) for name in STICKS]
    link.servo_output_raw_send(round(1e6 * time) % 2**32, 0, *servos, *[0] * 4)
    heading = round(math.degrees(angles[2])) % 360
    link.vfr_hud_send(values["airspeed"], math.hypot(*velocity[:2]), heading, 0, 0.0, -velocity[2])
    rates = (values[name] for name in "pqr")
    link.attitude_send(ms, *angles, *rates)


SHORT = {
    "main_rotor": "MR",
    "tail_rotor": "TR",
    "horizontal_tail": "HT",
    "vertical_fin": "VF",
    "drivetrain": "DT",
}
"""Parts of a helicopter in names of parameters, which have 16 letters."""


def parameters(values: Mapping[str, float]) -> dict[str, float]:
    """Return parameters by the names that they have in MAVLink: main_rotor.radius is MR_RADIUS.

    Raises `InputError` where two have one name.
    """
    found: dict[str, float] = {}
    for name, value in values.items():
        part, _, own = name.rpartition(".")
        short = f"{SHORT.get(part, part)}_{own}".strip("_").upper()[:16]
        if short in found:
            raise InputError(f"two parameters are called {short} in 16 letters; one is {name}")
        found[short] = float(value)
    return found
