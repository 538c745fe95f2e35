"""Files as disks, cables and editors leave them: cut, with bytes flipped, numbers replaced, lines
exchanged, and what the readers say of them.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import random
import re
import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fuzzed import Fault, Tally
from scipy.io import savemat
from valid_calls import caught
from verdict import Verdict, judged

import identification
import symheli
import synthesis
from studies.transition.stored_stages import Stored, StoredStages
from symheli.logs.signal_map import SignalMap

ROOT = Path(__file__).resolve().parents[2]
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")
INSTEAD = (b"nan", b"NaN", b"inf", b"-1", b"0", b"1e300", b"1e-300", b"fast", b"", b"[]", b"null")
USUAL = 300
"""Damaged files of a reader that make up the whole."""
KINDS = ("cut", "flipped", "dropped", "repeated", "number", "lines", "zeros", "foreign")


class Reader(NamedTuple):
    """A reader, and a good file for it."""

    entry: str
    path: Path
    read: Callable[[Path], Any]
    apart: bool = False
    """In a process of its own: what reads it may take the whole process down."""


def readers(folder: Path) -> list[Reader]:
    """Every reader, each with a good file in `folder`."""
    found = [*_logs(folder), *_saved(folder)]
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
            lambda p: StoredStages(p.parent, {p.stem: "key"}).load(p.stem, list),
        )
    )
    return found


def _logs(folder: Path) -> list[Reader]:
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
    if importlib.util.find_spec("pyulog"):
        ulog = folder / "log.ulg"
        ulog.write_bytes(ulog_of(t))
        topics = {"q": ("rates", "xyz[1]", "rad/s")}
        found.append(
            Reader("ULog", ulog, lambda p: symheli.FlightRecord.from_ulog(p, topics, dt=0.02))
        )
    return found


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
    entries = ("symheli.TableController", "identification.KinematicModel")
    entries += ("identification.LPVARXModel", "identification.RecursiveLeastSquares")
    calls = {call.entry: call for call in caught(lambda entry: entry in entries)}
    table = calls["symheli.TableController.of"].repeated()
    kinematic = calls["identification.KinematicModel.predict"].function.__self__  # type: ignore[attr-defined]
    model = calls["identification.LPVARXModel.predict"].function.__self__  # type: ignore[attr-defined]
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
    synthesis.stability(lag).save(folder / "proof.json")
    return [
        Reader("controller table", folder / "table.json", symheli.TableController.load),
        Reader("kinematic model", folder / "kinematic.json", identification.KinematicModel.load),
        Reader("LPV-ARX model", folder / "model.json", identification.LPVARXModel.load),
        Reader("recursion state", folder / "state.json", recursion.load),
        Reader("certificate", folder / "proof.json", synthesis.Certificate.load),
    ]


def damaged(content: bytes, seed: int) -> tuple[str, bytes]:
    """(kind of damage, content) number `seed`."""
    rng = random.Random(seed)
    kind, n = KINDS[seed % len(KINDS)], len(content)
    a, b = sorted(rng.randrange(n + 1) for _ in range(2))
    b = min(b, a + 64)
    if kind == "cut":
        return kind, content[:a]
    if kind == "flipped":
        out = bytearray(content)
        for _ in range(rng.choice((1, 1, 2, 8))):
            out[rng.randrange(n)] ^= 1 << rng.randrange(8)
        return kind, bytes(out)
    if kind == "dropped":
        return kind, content[:a] + content[b:]
    if kind == "repeated":
        return kind, content[:b] + content[a:]
    if kind == "number" and (places := list(NUMBER.finditer(content))):
        place = rng.choice(places)
        return kind, content[: place.start()] + rng.choice(INSTEAD) + content[place.end() :]
    if kind == "lines" and len(lines := content.splitlines(True)) > 1:
        i, j = rng.sample(range(len(lines)), 2)
        lines[i], lines[j] = lines[j], lines[i]
        return kind, b"".join(lines)
    if kind == "foreign":
        return kind, rng.choice((b"", b"{}", b"[]", b"\xff\xfe\x00", rng.randbytes(200), b"\n" * 9))
    return "zeros", content[:a] + bytes(b - a) + content[b:]


def _judged_apart(*asked: Any) -> Verdict:
    """`judged` in a child of this process."""
    receiving, sending = multiprocessing.Pipe(duplex=False)
    child = os.fork()
    if not child:
        sending.send(judged(*asked))
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return Verdict("crash", f"the process ended with {status}") if status else receiving.recv()


def tally(reader: Reader, inputs: int, first: int = 0) -> Tally:
    """So many damaged files; the good one is as it was afterwards."""
    whole, kind_of = reader.path.read_bytes(), type(reader.read(reader.path))
    found = Tally(Counter(), [])
    for seed in range(first, first + inputs):
        kind, content = damaged(whole, seed)
        reader.path.write_bytes(content)
        judge = _judged_apart if reader.apart else judged
        verdict = judge(lambda: reader.read(reader.path), kind, (), (kind_of,), 3.0)
        fault = verdict.fault
        if fault.startswith("NaN") and kind_of in (symheli.FlightRecord, synthesis.Certificate):
            fault = ""  # what was not measured; what a certificate does not claim
        if reader.path.read_bytes() != content:
            fault = "the file was changed"
        found.outcomes[verdict.outcome] += 1
        if fault:
            found.faults.append(Fault(reader.entry, f"seed {seed}", kind, "", fault))
    reader.path.write_bytes(whole)
    return found
