"""`python -m evidence.simulated_log --folder DIR`: a log of a simulated helicopter of which the
truth is known, as CSV, DataFlash and ULog. The files are under this project's licence.

An X-Cell under ArduPilot-like loops, from hover to 12 m/s and back twice, in wind and turbulence,
with white noise on every sensor. Its heading is not logged: the model has no need of one, so no
message of velocities north and east is written, but one of those in body axes.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import symheli
from evidence.tuning import THROW, TRUTH, parameters
from evidence.written_logs import FMT, FMTU, MULT, PARM, UNIT, UNITS, Format, dataflash, ulog
from symheli import AirspeedSchedule, Excitation, FlightRecord, Helicopter, Sensor, Wind
from symheli.airframe.written import as_toml
from symheli.environment import Dryden
from symheli.flight import HelicopterLoops
from symheli.values.kinematics import INPUTS
from symheli.values.whole_files import write_bytes, write_text

AIRSPEEDS = (0.0, 3.0, 6.0, 9.0, 12.0)
"""Where the exact linear models are given, m/s."""

WIND = (-2.0, 1.0, 0.0)
"""Steady wind north, east, down, m/s."""

NOISE = (
    dict.fromkeys(("u", "v", "w"), 0.05)
    | dict.fromkeys(("p", "q", "r"), 0.005)
    | dict.fromkeys(("phi", "theta"), 0.003)
)
"""Standard deviation of every sensor, SI; of the airspeed as of a velocity."""

DEFLECTIONS = tuple(map(str, INPUTS))
LOGGED = (*DEFLECTIONS, *NOISE, "airspeed")

FULL = THROW | {"d_col": 0.3}
"""Deflections (rad) that an output of 1 stands for."""

SCHEDULE = AirspeedSchedule((12.0, 0.0, 12.0, 0.0), (1.0,) * 4, (5.0,) * 4)
"""From hover to 12 m/s and back, twice."""

START = 20.0
"""Of the flight on the log's clock, s."""

SLOWER = 5
"""Samples of the loops between two of the airspeed."""

MESSAGES: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "IMU": {"GyrX": ("p", "E"), "GyrY": ("q", "E"), "GyrZ": ("r", "E")},
    "ATT": {"Roll": ("phi", "d"), "Pitch": ("theta", "d")},
    "ARSP": {"Airspeed": ("airspeed", "n")},
    "RATE": {
        "ROut": ("d_lat", "-"),
        "POut": ("d_lon", "-"),
        "YOut": ("d_ped", "-"),
        "AOut": ("d_col", "-"),
    },
    "BVEL": {"U": ("u", "n"), "V": ("v", "n"), "W": ("w", "n")},
    "SWSH": {
        "Lon": ("d_lon", "r"),
        "Lat": ("d_lat", "r"),
        "Col": ("d_col", "r"),
        "Ped": ("d_ped", "r"),
    },
}
"""Signal and letter of the unit of every field of a DataFlash log; BVEL and SWSH are no messages of
ArduPilot's.
"""


def flight(seed: int = 1, schedule: AirspeedSchedule = SCHEDULE) -> FlightRecord:
    """The measured signals."""
    heli = Helicopter.load(TRUTH, governor="ideal")
    flown = symheli.fly(
        heli,
        schedule,
        controller=HelicopterLoops.from_parameters(parameters(), throw=THROW),
        excitation=Excitation(
            {"d_lon": 0.005, "d_lat": 0.004, "d_col": 0.008, "d_ped": 0.012},
            "multisine",
            (0.05, 4.0),
            seed,
        ),
        wind=Wind(steady=WIND, turbulence=Dryden(wind=4.0, altitude=20.0), seed=seed),
        sensors={name: Sensor(noise=deviation) for name, deviation in NOISE.items()},
        seed=seed,
    )
    noise = NOISE["u"] * np.random.default_rng(seed).standard_normal(len(flown))
    airspeed = np.maximum(flown["airspeed"] + noise, 0.0)
    return flown.select(LOGGED[:-1]).with_signals({"airspeed": "m/s"}, airspeed=airspeed)


def as_dataflash(record: FlightRecord) -> bytes:
    """The record as ArduPilot logs it, the parameters of the loops at its head."""
    stamps = np.round(1e6 * (record.time + START)).astype(int)
    formats: dict[str, Format] = {"FMT": FMT, "UNIT": UNIT, "FMTU": FMTU, "MULT": MULT}
    formats["PARM"] = PARM
    declared: dict[str, tuple[str, str]] = {}
    rows: list[tuple[int, str, tuple[Any, ...]]] = []
    for number, (message, fields) in enumerate(MESSAGES.items(), start=200):
        names = ",".join(("TimeUS", *fields))
        formats[message] = (number, "Q" + "f" * len(fields), names)
        units = "".join(unit for _, unit in fields.values())
        declared[message] = "s" + units, "F" + "".join("-" if u == "-" else "0" for u in units)
        columns = [_in_units(record, *field) for field in fields.values()]
        every = SLOWER if message == "ARSP" else 1
        values = np.column_stack(columns)[::every].tolist()
        rows += [
            (int(t), message, (int(t), *row))
            for t, row in zip(stamps[::every], values, strict=True)
        ]
    rows.sort(key=lambda row: row[0])
    first = [("PARM", (0, name, value)) for name, value in parameters().items()]
    messages = [*first, *((message, values) for _, message, values in rows)]
    return dataflash(messages, formats, declared, units=UNITS | {"r": "rad"})


def _in_units(record: FlightRecord, signal: str, unit: str) -> np.ndarray:
    match unit:
        case "d":
            return np.degrees(record[signal])
        case "-":
            return record[signal] / FULL[signal]
    return record[signal]


def as_ulog(record: FlightRecord) -> bytes:
    """The record as PX4 logs it; deflections and velocities in body axes in topics of their own."""
    stamps = np.round(1e6 * (record.time + START))
    turned = Rotation.from_euler("ZYX", np.stack([0 * stamps, record["theta"], record["phi"]], 1))
    scalar_first = np.roll(turned.as_quat(), 1, axis=1)
    output = {name: record[name] / FULL[name] for name in DEFLECTIONS}

    def topic(columns: Mapping[str, np.ndarray], every: int = 1) -> dict[str, Any]:
        return {"timestamp": stamps[::every], **{n: c[::every] for n, c in columns.items()}}

    def vector(name: str, signals: tuple[str, ...], of: Any = record) -> dict[str, Any]:
        return topic({f"{name}[{i}]": of[s] for i, s in enumerate(signals)})

    return ulog(
        {
            ("vehicle_angular_velocity", 0): vector("xyz", ("p", "q", "r")),
            ("vehicle_attitude", 0): topic({f"q[{i}]": scalar_first[:, i] for i in range(4)}),
            ("airspeed_validated", 0): topic({"true_airspeed_m_s": record["airspeed"]}, SLOWER),
            ("vehicle_torque_setpoint", 0): vector("xyz", ("d_lat", "d_lon", "d_ped"), output),
            ("vehicle_thrust_setpoint", 0): topic({"xyz[2]": output["d_col"]}),
            ("body_velocity", 0): topic({name: record[name] for name in "uvw"}),
            ("helicopter_deflections", 0): topic({name: record[name] for name in DEFLECTIONS}),
        },
        parameters(),
    )


def signal_map(columns: Mapping[str, tuple[str, str]]) -> str:
    """The TOML file that says which column, in which unit, is which signal."""
    lines = (
        f'{signal} = {{ column = "{column}", unit = "{unit}" }}'
        for signal, (column, unit) in columns.items()
    )
    return "\n".join(["dt = 0.02", "", "[signals]", *lines, ""])


def maps() -> dict[str, str]:
    """Signal maps of the two logs of autopilots, by the name of the file."""
    named = UNITS | {"r": "rad"}
    bin_ = {
        signal: (f"{message}.{field}", named[unit])
        for message, fields in MESSAGES.items()
        for field, (signal, unit) in fields.items()
        if unit != "-"
    }
    ulg = {
        **{s: (f"vehicle_angular_velocity.xyz[{i}]", "rad/s") for i, s in enumerate("pqr")},
        **{s: (f"vehicle_attitude.{s}", "rad") for s in ("phi", "theta")},
        "airspeed": ("airspeed_validated.true_airspeed_m_s", "m/s"),
        **{s: (f"body_velocity.{s}", "m/s") for s in "uvw"},
        **{s: (f"helicopter_deflections.{s}", "rad") for s in DEFLECTIONS},
    }
    return {"dataflash.toml": signal_map(bin_), "ulog.toml": signal_map(ulg)}


def truth() -> dict[str, Any]:
    """What was flown: the vehicle file, the exact linear models, wind, noise and throws."""
    heli = Helicopter.load(TRUTH, governor="ideal")
    models = []
    for airspeed in AIRSPEEDS:
        trimmed = symheli.trim(heli, airspeed=airspeed)
        model = symheli.linearize(heli, trimmed)
        models.append(
            {
                "airspeed": airspeed,
                "trim": {str(s): float(trimmed.u[s]) for s in heli.inputs},
                "A": model.A.tolist(),
                "B": model.B.tolist(),
            }
        )
    return {
        "licence": "MIT",
        "vehicle": "truth.toml",
        "units": "SI, rad",
        "states": [str(s) for s in heli.states],
        "inputs": [str(s) for s in heli.inputs],
        "models": models,
        "noise": NOISE | {"airspeed": NOISE["u"]},
        "wind": {"steady": WIND, "turbulence": "Dryden, 4 m/s at 20 ft, 20 m above ground"},
        "full_output": FULL,
        "parameters": parameters(),
    }


def written(folder: Path, seed: int = 1, schedule: AirspeedSchedule = SCHEDULE) -> list[Path]:
    """Write all files into `folder`, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    record = flight(seed, schedule)
    heli = Helicopter.load(TRUTH, governor="ideal")
    texts = maps() | {
        "truth.json": json.dumps(truth(), indent=1) + "\n",
        "truth.toml": as_toml(heli.vehicle),
        "heli.param": "".join(f"{name},{value:.9g}\n" for name, value in parameters().items()),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    write_bytes(folder / "flight.bin", as_dataflash(record))
    write_bytes(folder / "flight.ulg", as_ulog(record))
    record.to_csv(folder / "flight.csv")
    return sorted(folder / name for name in (*texts, "flight.bin", "flight.ulg", "flight.csv"))


def main() -> None:
    """Write the log and say what was written."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where the files go")
    parser.add_argument("--seed", type=int, default=1, help="of noise, turbulence, excitation")
    given = parser.parse_args()
    for path in written(given.folder, given.seed):
        print(path)


if __name__ == "__main__":
    main()
