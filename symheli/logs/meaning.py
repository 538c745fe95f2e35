"""Probable meaning of a column of a log, by its name and its size: a suggestion for the user to
confirm, never used automatically.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symheli.logs.column import Column
from symheli.logs.format import known_formats
from symheli.values.signal import UNITS

Named = Mapping[str, Sequence[tuple[str, str]]]
"""Columns of a format and their units by signal, the best first."""


@dataclass(frozen=True)
class Guess:
    """A column that may be `signal`, in `unit`; `why` is the reason for both."""

    signal: str
    column: str
    unit: str
    why: str


RATES, ANGLES, SPEEDS = ("p", "q", "r"), ("phi", "theta", "psi"), ("airspeed", "u", "v", "w")
CONTROLS = ("lon", "lat", "col", "ped")
"""Longitudinal and lateral cyclic, collective, pedals: commands, in whatever the log has."""

NAMES = {
    "p": ("p", "rollrate", "rollspeed", "gyroroll", "rollgyro", "gyrox", "gyrx", "wx", "omegax"),
    "q": (
        "q",
        "pitchrate",
        "pitchspeed",
        "gyropitch",
        "pitchgyro",
        "gyroy",
        "gyry",
        "wy",
        "omegay",
    ),
    "r": ("r", "yawrate", "yawspeed", "gyroyaw", "yawgyro", "gyroz", "gyrz", "wz", "omegaz"),
    "phi": ("phi", "roll", "rollangle", "bank"),
    "theta": ("theta", "pitch", "pitchangle"),
    "psi": ("psi", "yaw", "heading", "hdg"),
    "airspeed": (
        *("airspeed", "trueairspeed", "tas", "vtas", "vtrue", "pitot", "ias", "aspd"),
        *("airspeedcommand", "speed", "groundspeed", "spd"),
    ),
    "u": ("u", "ubody", "vxbody", "vx"),
    "v": ("v", "vbody", "vybody", "vy"),
    "w": ("w", "wbody", "vzbody", "vz"),
    "lon": ("dlon", "lon", "sticklon", "longitudinal", "elevator", "elev", "pitchstick"),
    "lat": ("dlat", "lat", "sticklat", "lateral", "aileron", "ailrn", "ail", "rollstick"),
    "col": ("dcol", "col", "coll", "stickcol", "collective", "throttle", "thr"),
    "ped": ("dped", "ped", "stickped", "pedal", "pedals", "rudder", "ruddr", "rud", "yawstick"),
}
"""Names in tables, small letters and digits alone, the best first."""

CHANNELS = ("rcou", "rcout", "rcin", "rc", "servo")
"""Words before the name of a control: RCOU_elev."""

SUFFIXES = {
    **dict.fromkeys(("radps", "rads", "radpersec"), "rad/s"),
    **dict.fromkeys(("degps", "degs", "dps"), "deg/s"),
    "rad": "rad",
    "deg": "deg",
    **dict.fromkeys(("mps", "mpers"), "m/s"),
    **dict.fromkeys(("kmh", "kph"), "km/h"),
    **dict.fromkeys(("kt", "kts", "knots"), "kt"),
    "fps": "ft/s",
}
"""Units as they stand at the end of names: q_radps."""

DATAFLASH = {
    "p": (("IMU.GyrX", "rad/s"),),
    "q": (("IMU.GyrY", "rad/s"),),
    "r": (("IMU.GyrZ", "rad/s"),),
    "phi": (("ATT.Roll", "deg"),),
    "theta": (("ATT.Pitch", "deg"),),
    "psi": (("ATT.Yaw", "deg"),),
    "airspeed": (("ARSP.Airspeed", "m/s"), ("GPS.Spd", "m/s")),
    "lon": (("RATE.POut", "1"), ("RCIN.C2", "us")),
    "lat": (("RATE.ROut", "1"), ("RCIN.C1", "us")),
    "col": (("RATE.AOut", "1"), ("CTUN.ThO", "1"), ("RCIN.C3", "us")),
    "ped": (("RATE.YOut", "1"), ("RCIN.C4", "us")),
}
"""Columns of ArduPilot (ardupilot.org/copter/docs/logmessages.html), the best first; RATE is what
the rate controller sends to the swashplate.
"""

SDLOG2 = {
    **{
        signal: ((f"ATT.{name}Rate", "rad/s"), (f"IMU.Gyro{axis}", "rad/s"))
        for signal, name, axis in zip(RATES, ("Roll", "Pitch", "Yaw"), "XYZ", strict=True)
    },
    **{
        signal: ((f"ATT.{name}", "rad"),)
        for signal, name in zip(ANGLES, ("Roll", "Pitch", "Yaw"), strict=True)
    },
    "airspeed": (("AIRS.TrueSpeed", "m/s"), ("AIRS.AirSpeed", "m/s")),
    "lat": (("ATTC.Roll", "1"),),
    "lon": (("ATTC.Pitch", "1"),),
    "ped": (("ATTC.Yaw", "1"),),
    "col": (("ATTC.Thrust", "1"),),
}
"""Columns of PX4's logs before ULog (src/modules/sdlog2/sdlog2_messages.h), the best first; known
by their rates, which ArduPilot's attitude lacks.
"""

ULOG = {
    **{
        signal: (
            (f"vehicle_angular_velocity.xyz[{i}]", "rad/s"),
            (f"vehicle_attitude.{name}speed", "rad/s"),
            (f"sensor_combined.gyro_rad[{i}]", "rad/s"),
            (f"sensor_gyro.{'xyz'[i]}", "rad/s"),
        )
        for i, (signal, name) in enumerate(zip(RATES, ("roll", "pitch", "yaw"), strict=True))
    },
    **{signal: ((f"vehicle_attitude.{signal}", "rad"),) for signal in ANGLES},
    "airspeed": (
        ("airspeed_validated.true_airspeed_m_s", "m/s"),
        ("airspeed.true_airspeed_m_s", "m/s"),
        ("vehicle_gps_position.vel_m_s", "m/s"),
        ("sensor_gps.vel_m_s", "m/s"),
    ),
    "u": (("vehicle_local_position.vx", "m/s"),),
    "v": (("vehicle_local_position.vy", "m/s"),),
    **{
        signal: (
            (f"vehicle_torque_setpoint.xyz[{i}]", "1"),
            (f"actuator_controls_0.control[{i}]", "1"),
        )
        for i, signal in enumerate(("lat", "lon", "ped"))
    },
    "col": (("vehicle_thrust_setpoint.xyz[2]", "1"), ("actuator_controls_0.control[3]", "1")),
}
"""Columns of PX4 (the messages of github.com/PX4/PX4-Autopilot/tree/main/msg), the best first."""

BLACKBOX = {
    **{
        signal: ((f"gyroADC[{i}]", "deg/s"), (f"gyroRAW[{i}]", "deg/s"))
        for i, signal in enumerate(RATES)
    },
    "airspeed": (("GPS_speed", "m/s"),),
    **{
        signal: ((f"mixer[{i}]", "1"), (f"pidSum[{i}]", "1"), (f"rcCommand[{i}]", "1"))
        for i, signal in enumerate(("lat", "lon", "ped"))
    },
    "col": (("mixer[3]", "1"), ("setpoint[3]", "1"), ("rcCommand[3]", "1")),
}
"""Columns of Betaflight and Rotorflight, the best first: what goes to the mixer before what the
pilot commands.
"""

XPLANE = {
    **{name: ((name, UNITS[name]),) for name in (*RATES, *ANGLES, *SPEEDS)},
    **{name: ((f"stick_{name}", "1"),) for name in ("lon", "lat", "ped")},
    "col": (("throttle", "1"),),
}
"""Signals of `symheli.logs.xplane`."""


def guesses(columns: Mapping[str, Column], format: str) -> dict[str, Guess]:
    """{signal: the column that it probably is}, for p q r phi theta psi airspeed u v w and the
    controls lon lat col ped, by a table of its format or else by name; what moves before what stays
    where it is.
    """
    form = known_formats().get(format)
    named = form.named(columns) if form else {}
    if named:
        found = {
            signal: [Guess(signal, name, unit, "name") for name, unit in best if name in columns]
            for signal, best in named.items()
        }
    else:
        found = _by_name(columns)
    out = {}
    for signal, candidates in found.items():
        candidates.sort(key=lambda one: not moves(columns[one.column].values))
        if candidates:
            best = candidates[0]
            declared = columns[best.column].unit
            out[signal] = (
                best if declared is None else Guess(signal, best.column, declared, "the log")
            )
    return out


def moves(values: np.ndarray) -> bool:
    """Whether a column is more than one value."""
    known = values[np.isfinite(values)]
    return len(known) > 1 and bool(np.ptp(known) > 1e-6 * np.abs(known).max())


def _by_name(columns: Mapping[str, Column]) -> dict[str, list[Guess]]:
    found: dict[str, list[tuple[int, Guess]]] = {signal: [] for signal in NAMES}
    for column, content in columns.items():
        name, suffix = plain_name(column)
        channel = next((c for c in CHANNELS if name.startswith(c)), "")
        for signal, names in NAMES.items():
            if signal in CONTROLS and name.removeprefix(channel) in names:
                name = name.removeprefix(channel)
            if name in names:
                unit, why = _unit(signal, content.values)
                if column in UNITS and why == "name":
                    unit = UNITS[column]
                if suffix is not None:
                    unit, why = suffix, "name"
                if unit is not None:
                    found[signal].append((names.index(name), Guess(signal, column, unit, why)))
    return {
        signal: [guess for _, guess in sorted(ranked, key=lambda pair: pair[0])]
        for signal, ranked in found.items()
    }


def plain_name(column: str) -> tuple[str, str | None]:
    """The last part of a name in small letters and digits, and the unit at its end, if any."""
    words = [word for word in re.split(r"[^a-z0-9]+", column.lower().split(".")[-1]) if word]
    unit = SUFFIXES.get(words[-1]) if len(words) > 1 else None
    return "".join(words[:-1] if unit else words), unit


def _unit(signal: str, values: np.ndarray) -> tuple[str | None, str]:
    """The unit that fits a signal of this size; None where none does (a latitude is no stick)."""
    known = np.abs(values[np.isfinite(values)])
    size = float(known.max()) if len(known) else 0.0
    if signal in RATES:
        return ("deg/s", "name and size") if size > MAX_RATE else ("rad/s", "name")
    if signal in ANGLES:
        most = np.pi / 2 if signal == "theta" else 2 * np.pi
        return ("deg", "name and size") if size > 1.05 * most else ("rad", "name")
    if signal in SPEEDS:
        return "m/s", "name"
    if size <= 1.5:
        return "1", "name"
    if PULSES[0] <= size <= PULSES[1]:
        return "us", "name and size"
    return ("%", "name and size") if size == 100.0 else (None, "")


MAX_RATE = 12.0
"""Largest angular rate of a helicopter, rad/s; larger numbers are in deg/s."""

PULSES = (1000.0, 2500.0)
"""Range of pulse lengths of a radio channel, us."""
