"""What a sample costs while a vehicle flies: from the bytes of X-Plane to the coefficients of all
axes, beside pymavlink's own decoding of one vehicle's messages and the recursion in NumPy.
"""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

from benchmarks.race import Ratio, present, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from studies.live import mavlink, xplane  # noqa: E402
from studies.live.identifier import STATES, LiveIdentifier  # noqa: E402
from studies.live.sample import STICKS, Sample  # noqa: E402
from studies.live.stream import Stream  # noqa: E402
from studies.live.watch import Watch  # noqa: E402
from symheli.errors import InputError  # noqa: E402

DT = 0.02
SHARE = 0.2
"""Goal: share of a core at 50 Hz."""


def values_of(count: int) -> list[dict[str, float]]:
    """Samples of a smooth random motion that excites everything."""
    rng = np.random.default_rng(0)
    t = DT * np.arange(count)
    names = (*STATES, *STICKS, "airspeed", "psi")
    phases, rates = rng.uniform(0, 6, (len(names), 5)), rng.uniform(0.3, 12, (len(names), 5))
    columns = [
        np.sin(np.outer(t, w) + f).sum(axis=1) / 10 for w, f in zip(rates, phases, strict=True)
    ]
    rows = np.column_stack(columns)
    rows[:, names.index("airspeed")] = 6.0 + 5.0 * np.sin(0.05 * t)
    return [dict(zip(names, map(float, row), strict=True)) for row in rows]


def datagrams(samples: list[dict[str, float]]) -> list[bytes]:
    """The answers of X-Plane that hold these samples."""
    shown = (xplane.shown(DT * k, values).values() for k, values in enumerate(samples))
    return [xplane.answers(dict(enumerate(found)))[0] for found in shown]


def each(work, items) -> np.ndarray:
    """Seconds of processor of `work` for each item."""
    spent = np.empty(len(items))
    for k, item in enumerate(items):
        begin = time.thread_time()
        work(item)
        spent[k] = time.thread_time() - begin
    return spent


class ByHand:
    """Recursive least squares as one writes it: covariance form in NumPy, six outputs."""

    def __init__(self, n: int):
        self.P, self.theta = 1e6 * np.eye(n), np.zeros((n, 6))

    def update(self, phi: np.ndarray, y: np.ndarray) -> None:
        gain = self.P @ phi / (1.0 + phi @ self.P @ phi)
        self.theta += np.outer(gain, y - self.theta.T @ phi)
        self.P -= np.outer(gain, phi @ self.P)


SENDER = """
import json, pickle, socket, sys, time
port, packets, dt = pickle.load(sys.stdin.buffer)
out, begin, sent = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic() + 0.5, []
for k, packet in enumerate(packets):
    time.sleep(max(begin + k * dt - time.monotonic(), 0.0))
    sent.append(time.monotonic())
    out.sendto(packet, ("127.0.0.1", port))
print(json.dumps(sent))
"""
"""Another process that sends, and says when."""


def latencies(wire: list[bytes], busy: bool) -> np.ndarray:
    """Seconds from a packet's sending to the coefficients that know it, at 50 Hz, while a program
    keeps the other core busy or not.
    """
    source = xplane.XPlaneSource()
    identifier = LiveIdentifier(STICKS, 0.0, 12.0)
    learnt: dict[int, float] = {}
    watch = Watch(source, identifier, Stream(identifier.signals, DT))
    take = watch.take

    def taken(sample: Sample, now: float) -> None:
        take(sample, now)
        learnt[round(sample.time / DT)] = time.monotonic()

    watch.take = taken  # type: ignore[method-assign]
    loads = [subprocess.Popen([sys.executable, "-c", "while True: pass"])] if busy else []
    sender = subprocess.Popen(
        [sys.executable, "-c", SENDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        assert sender.stdin is not None
        pickle.dump((source._socket.getsockname()[1], wire, DT), sender.stdin)
        sender.stdin.close()
        watch.run(len(wire) * DT + 2.0, lambda line: None)
        sent = json.loads(sender.stdout.read() if sender.stdout else b"[]")
    finally:
        for process in (*loads, sender):
            process.kill()
            process.wait()
    return np.array([learnt[k] - at for k, at in enumerate(sent) if k in learnt])


def main() -> None:
    """Print times a sample and the share of a core at 50 Hz."""
    options = arguments(__doc__)
    count = 3000 if options.quick else 30000
    samples = values_of(count)
    source = xplane.XPlaneSource()
    identifier = LiveIdentifier(STICKS, 0.0, 12.0)
    stream = Stream(identifier.signals, DT)

    def decoded(datagram: bytes) -> list[Sample]:
        return source._samples(xplane.answered(datagram) or {}, "vehicle")

    def learnt(datagram: bytes) -> None:
        for sample in decoded(datagram):
            for row in stream.take(sample, sample.time):
                identifier.take(row)

    wire = datagrams(samples)
    n = identifier.structure.n_regressors
    hand, rng = ByHand(n), np.random.default_rng(1)
    regressors = list(rng.normal(size=(min(count, 5000), n)))
    y = rng.normal(size=6)
    times = {
        "decoding one answer of X-Plane": each(decoded, wire),
        "bytes to coefficients, all axes": each(learnt, wire),
        f"the recursion in NumPy, {n} regressors": each(
            lambda phi: hand.update(phi, y), regressors
        ),
    }
    summary = [each(lambda _: identifier.prediction(), range(20)).mean()]
    try:
        link = mavlink.library().mavlink.MAVLink(None)
        packed = packed_messages(link, samples[:3000])
        times["pymavlink decoding the four messages of a sample"] = each(link.parse_buffer, packed)
    except InputError as error:
        print(error)
    source.close()
    rows = [
        (
            name,
            f"{1e6 * np.median(t):.0f}",
            f"{1e6 * np.quantile(t, 0.999):.0f}",
            f"{100 * np.mean(t) / DT:.2f}",
        )
        for name, t in times.items()
    ]
    a_second = float(np.mean(times["bytes to coefficients, all axes"])) / DT + summary[0]
    head = ("a sample", "median, us", "99.9 %, us", "% of a core at 50 Hz")
    tables = [table("### A sample at 50 Hz, seconds of processor", rows, head)]
    late = [("", "samples", "median, ms", "99.9 %, ms", "largest, ms")]
    for busy in (False, True):
        seconds = latencies(wire[: 500 if options.quick else 6000], busy)
        late.append(
            (
                "the other core busy" if busy else "alone",
                f"{len(seconds)}",
                *(f"{1e3 * np.quantile(seconds, q):.2f}" for q in (0.5, 0.999, 1.0)),
            )
        )
    tables.append(table("### From a packet to the coefficients at 50 Hz", late[1:], late[0]))
    ratios = [
        Ratio("share of a core, 1 s predictions once a second among it", a_second, SHARE, True)
    ]
    ratios.append(
        Ratio("99.9 % of latencies, beside a busy core, in samples", late_share(seconds), 1.0, True)
    )
    present("live", options, tables, ratios, [])


def late_share(seconds: np.ndarray) -> float:
    """The latency that 99.9 % keep to, in periods."""
    return float(np.quantile(seconds, 0.999)) / DT


def packed_messages(link, samples: list[dict[str, float]]) -> list[bytes]:
    """The bytes of the messages of each sample."""

    class File:
        def __init__(self):
            self.parts: list[bytes] = []

        def write(self, part: bytes) -> None:
            self.parts.append(part)

    out = []
    for k, values in enumerate(samples):
        link.file = File()
        mavlink.sent(link, DT * k, values)
        out.append(b"".join(link.file.parts))
    return out


if __name__ == "__main__":
    main()
