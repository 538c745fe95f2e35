"""Every reader, each with a good file or folder of its own, as this project or others write it."""

from __future__ import annotations

import importlib.util
import pickle
import shutil
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.io import savemat
from valid_calls import caught

import identification
import symheli
import synthesis
from evidence import written_logs
from studies.campaigns.campaign import Campaign
from studies.campaigns.dataset import CampaignDataset
from studies.campaigns.trial import Trial, TrialOutcome
from studies.setup.stored_stages import Stored, StoredStages
from symheli.logs.signal_map import SignalMap
from symheli.lpv.linear_models import LinearModels
from symheli.values import NamedVector, Signal, signals
from symheli.values.operating_point import OperatingPoint
from symheli.values.operating_points import OperatingPoints

ROOT = Path(__file__).resolve().parents[2]


class Reader(NamedTuple):
    """A reader, and a good file or folder for it."""

    entry: str
    path: Path
    read: Callable[[Path], Any]
    apart: bool = False
    """In a process of its own: what reads it may take the whole process down."""
    content: Callable[[Any], Any] | None = None
    """Of formats with a checksum or a proof: what is as it was wherever the file is read."""

    @property
    def files(self) -> tuple[Path, ...]:
        """What can be damaged."""
        if self.path.is_file():
            return (self.path,)
        return tuple(sorted(path for path in self.path.rglob("*") if path.is_file()))


def readers(folder: Path) -> list[Reader]:
    """Every reader, each with a good file in `folder`."""
    found = [*logs(folder), *_saved(folder), *_families(folder), *folders(folder)]
    vehicle = folder / "vehicle.toml"
    packaged = ROOT / "symheli" / "airframe" / "vehicles" / "xcell60.toml"
    vehicle.write_bytes(packaged.read_bytes())
    found.append(Reader("vehicle TOML", vehicle, symheli.Helicopter.load))
    signals = folder / "map.toml"
    signals.write_text(
        'time = "t"\ndt = 0.02\n[signals]\n'
        'q = { column = "gyro_y", unit = "deg/s", scale = -1.0 }\n'
        'theta = { column = "pitch", offset = 0.5 }\n',
        encoding="utf-8",
    )
    found.append(Reader("signal map", signals, SignalMap.load))
    stages = StoredStages(folder, {"one": "key"})
    path = stages.save("one", Stored(result=[1.0, 2.0], seconds=0.5))
    found.append(
        Reader(
            "study stage",
            path,
            lambda p: StoredStages(p.parent, {p.stem: "key"}).load(p.stem),
        )
    )
    return found


def logs(folder: Path) -> list[Reader]:
    """The readers of flight logs whose libraries are here."""
    t = 0.02 * np.arange(40)
    csv = folder / "log.csv"
    rows = [f"{a:.2f},{np.sin(a):.6f},{0.1 * a:.4f}" for a in t]
    csv.write_text("\n".join(["t,q,u", *rows]) + "\n", encoding="utf-8")
    mat = folder / "log.mat"
    savemat(mat, {"t": t, "q": np.sin(t), "u": 0.1 * t})
    xplane = folder / "Data.txt"
    lines = (ROOT / "tests" / "data" / "xplane" / "Forward.txt").read_bytes().splitlines(True)
    xplane.write_bytes(b"".join(lines[:60]))
    units = {"q": "rad/s", "u": "1"}
    found = [
        Reader("CSV", csv, lambda p: symheli.FlightRecord.from_csv(p, time="t", units=units)),
        Reader("MAT", mat, lambda p: symheli.FlightRecord.from_mat(p, time="t", units=units), True),
        Reader("X-Plane", xplane, lambda p: symheli.FlightRecord.from_xplane(p, dt=0.1)),
    ]
    blackbox = folder / "log.bbl"
    blackbox.write_bytes(blackbox_of(t))
    gyro = {"q": "gyroADC[1]"}
    found.append(
        Reader("Blackbox", blackbox, lambda p: symheli.FlightRecord.from_blackbox(p, gyro, dt=0.02))
    )
    if importlib.util.find_spec("pyulog"):
        ulog = folder / "log.ulg"
        ulog.write_bytes(ulog_of(t))
        topics = {"q": ("rates", "xyz[1]", "rad/s")}
        found.append(
            Reader("ULog", ulog, lambda p: symheli.FlightRecord.from_ulog(p, topics, dt=0.02))
        )
    if importlib.util.find_spec("pymavlink"):
        binary = folder / "log.bin"
        messages = {"FMT": written_logs.FMT, "ATT": (141, "Qff", "TimeUS,Pitch,Yaw")}
        rows = [("ATT", (int(1e6 * a) + 1, np.sin(a), 0.0)) for a in t]
        binary.write_bytes(written_logs.dataflash(rows, messages))
        attitude, rad = {"theta": "ATT.Pitch"}, {"theta": "rad"}
        found.append(
            Reader(
                "DataFlash",
                binary,
                lambda p: symheli.FlightRecord.from_dataflash(p, attitude, 0.02, rad),
            )
        )
    return found


def blackbox_of(t: np.ndarray) -> bytes:
    """A log of whole frames of three numbers, from the description of the format."""

    def unsigned(value: int) -> bytes:
        low, rest = value & 0x7F, value >> 7
        return bytes([low | 0x80]) + unsigned(rest) if rest else bytes([low])

    lines = ["Product:Blackbox flight data recorder by Nicholas Sherlock", "Data version:2"]
    for kind in "IP":
        lines += [
            f"Field {kind} name:loopIteration,time,gyroADC[1]",
            f"Field {kind} predictor:0,0,0",
            f"Field {kind} encoding:1,1,0",
        ]
    out = "".join(f"H {line}\n" for line in [*lines, "gyro_scale:0x3f800000"]).encode()
    for k, time in enumerate(t):
        rate = round(50 * float(np.sin(time)))
        zigzag = 2 * rate if rate >= 0 else -2 * rate - 1
        out += b"I" + unsigned(k) + unsigned(1 + int(1e6 * time)) + unsigned(zigzag)
    return out + b"E\xffEnd of log\x00"


def ulog_of(t: np.ndarray) -> bytes:
    """A log of one topic, from the description of the format."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += message(b"B", bytes(40))
    out += message(b"F", b"rates:uint64_t timestamp;float[3] xyz;")
    out += message(b"A", struct.pack("<BH", 0, 0) + b"rates")
    for time in t:
        data = struct.pack("<HQ3f", 0, int(1e6 * time) + 1, 0.0, float(np.sin(time)), 0.0)
        out += message(b"D", data)
    return out


def _saved(folder: Path) -> list[Reader]:
    entries = ("symheli.TableController", "identification.model.KinematicModel")
    entries += ("identification.model.LPVARXModel", "identification.RecursiveLeastSquares")
    calls = {call.entry: call for call in caught(lambda entry: entry in entries)}
    table = calls["symheli.TableController.of"].repeated()
    kinematic = calls["identification.model.KinematicModel.predict"].function.__self__  # type: ignore[attr-defined]
    model = calls["identification.model.LPVARXModel.predict"].function.__self__  # type: ignore[attr-defined]
    recursion = calls["identification.RecursiveLeastSquares"].repeated()
    lag = symheli.LPVStateSpace.polynomial(
        A=[[[-2.0]], [[1.0]]],
        B=[[[1.0]]],
        C=[[[1.0]]],
        D=[[[0.0]]],
        scheduling=symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.5),
    )
    table.save(folder / "table.json")
    kinematic.save(folder / "kinematic.json")
    model.save(folder / "model.json")
    recursion.save(recursion.init(), folder / "state.json")
    lag.save(folder / "lpv.json")
    synthesis.stability(lag).save(folder / "proof.json")
    record = symheli.FlightRecord.from_arrays(
        0.02 * np.arange(40),
        {"q": "rad/s", "u": "rad"},
        "a note",
        q=np.sin(np.arange(40)),
        u=np.where(np.arange(40) % 7, 0.1, np.nan),
    )
    meta = {"mass": 8.2, "trim": np.arange(3.0), "plan": {"laps": (1, 2)}}
    replace(record, meta=meta).save(folder / "r.npz")
    return [
        Reader(
            "controller table",
            folder / "table.json",
            symheli.TableController.load,
            content=pickle.dumps,
        ),
        Reader(
            "kinematic model",
            folder / "kinematic.json",
            identification.model.KinematicModel.load,
            content=pickle.dumps,
        ),
        Reader(
            "LPV-ARX model",
            folder / "model.json",
            identification.model.LPVARXModel.load,
            content=pickle.dumps,
        ),
        Reader(
            "LPV state space",
            folder / "lpv.json",
            symheli.LPVStateSpace.load,
            content=pickle.dumps,
        ),
        Reader("recursion state", folder / "state.json", recursion.load, content=pickle.dumps),
        Reader("certificate", folder / "proof.json", synthesis.Certificate.load, content=_holds),
        Reader("flight record", folder / "r.npz", symheli.FlightRecord.load, content=_of_record),
    ]


def _holds(certificate: synthesis.Certificate) -> bool:
    """A file without a checksum that proves itself: what it claims holds, whatever was changed."""
    return not certificate.verified or certificate.verify()


def _of_record(record: symheli.FlightRecord) -> bytes:
    units = [(str(s), s.unit) for s in record.signals]
    return pickle.dumps(
        (record.time, record.values, units, record.note, dict(record.meta), record.resampled)
    )


def _families(folder: Path) -> list[Reader]:
    """Linear models over airspeed, and over climb rate too."""
    speeds = np.array([2.0, 5.0, 8.0])
    states, inputs = signals(("v", "p")), signals(("d_lat",))

    def models(at: np.ndarray) -> LinearModels:
        rng, count = np.random.default_rng(0), len(at)
        shapes = {"A": (2, 2), "B": (2, 1), "C": (2, 2), "D": (2, 1)}
        arrays = {name: rng.standard_normal((count, *shape)) for name, shape in shapes.items()}
        points = [
            OperatingPoint(
                NamedVector(states, [0.1 * speed, 0.0]),
                NamedVector(inputs, [0.01 * speed]),
                NamedVector(states, [0.0, 0.0]),
                speed,
            )
            for speed in at.tolist()
        ]
        trims = OperatingPoints.of(points)
        return LinearModels(**arrays, states=states, inputs=inputs, outputs=states, points=trims)

    family = symheli.LinearFamily.from_models(speeds, models(speeds), {"stall": (3.5,)})
    axes = (Signal("airspeed"), Signal("climb_rate", "m/s"))
    grid = symheli.LinearFamily(axes, (speeds, [0.0, 1.0]), models(np.repeat(speeds, 2)))
    family.save(folder / "family.json")
    family.save(folder / "family.npz")
    grid.save(folder / "grid.json")
    return [
        Reader("family, JSON", folder / "family.json", symheli.LinearFamily.load),
        Reader("family, NPZ", folder / "family.npz", symheli.LinearFamily.load, content=_of_family),
        Reader("grid, JSON", folder / "grid.json", symheli.LinearFamily.load),
    ]


def _of_family(family: symheli.LinearFamily) -> bytes:
    models = family.models
    groups = [[(str(s), s.unit) for s in g] for g in (models.states, models.inputs, models.outputs)]
    arrays = [models.A, models.B, models.C, models.D, family.airspeeds]
    return pickle.dumps((arrays, groups, models.dt, family.kinks))


def folders(folder: Path) -> list[Reader]:
    """Campaigns, a row a case, and flights, a row a flight."""
    trial = Trial(_pendulum, {"period": "s"})
    campaign = Campaign(trial, grid={"length": [0.5, 1.0, -1.0], "kind": ["rod"]})
    path = folder / "campaign.zarr"
    dataset = CampaignDataset.open(path, campaign, {"version": "1"})
    for row, outcome in enumerate(
        (
            TrialOutcome((1.4, 0.1)),
            TrialOutcome((2.0, 0.1)),
            TrialOutcome((np.nan, 0.1), "ValueError: no length"),
        )
    ):
        dataset.write(row, outcome)

    def resumed(path: Path) -> dict[str, Any]:
        again = folder / "again.zarr"
        shutil.rmtree(again, ignore_errors=True)
        shutil.copytree(path, again)
        return _rows(CampaignDataset.open(again, campaign, {}).path)

    flights = folder / "flights.zarr"
    flown = symheli.flight.FlightDataset.create(
        flights,
        flights=2,
        chunk=1,
        time=np.arange(3.0),
        signals=(Signal("u"), Signal("w")),
        seeds=[3, 4],
        attributes={"vehicle": "xcell60"},
    )
    for chunk in (0, 1):
        flown.write(chunk, np.ones((1, 3, 2)), np.array([2.0]), np.array([False]))
    return [
        Reader("campaign", path, _rows, content=_what_was_asked),
        Reader("campaign, resumed", path, resumed, content=_what_was_asked),
        Reader("flights", flights, _flights, content=lambda found: found["u"].shape),
    ]


def _pendulum(*, length: float = 1.0, kind: str = "rod") -> dict[str, float]:
    return {"period": 2 * np.pi * np.sqrt(length / 9.81)}


def _rows(path: Path) -> dict[str, Any]:
    """All that a reader of the dataset asks for."""
    dataset = CampaignDataset(path)
    return {
        "length": dataset["length"],
        "period": dataset["period"],
        "finished": dataset.finished,
        "reasons": dataset.reasons,
        "units": dataset.units,
        "seconds": dataset["seconds"],
    }


def _what_was_asked(found: dict[str, Any]) -> bytes:
    return pickle.dumps((found["length"], found["units"], found["finished"]))


def _flights(path: Path) -> dict[str, Any]:
    dataset = symheli.flight.FlightDataset(path)
    return {
        "u": dataset["u"],
        "time": dataset.time,
        "finished": dataset.finished,
        "lost": dataset.lost,
        "signals": dataset.signals,
    }
