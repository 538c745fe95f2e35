"""Files as disks, cables and editors leave them: cut, with bytes flipped, numbers replaced, lines
exchanged, and what the readers say of them.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import re
from collections import Counter
from typing import Any

from fuzzed import Fault, Tally
from good_files import Reader
from verdict import NotANumber, Verdict, judged

import symheli
import synthesis

NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")
INSTEAD = (b"nan", b"NaN", b"inf", b"-1", b"0", b"1e300", b"1e-300", b"fast", b"", b"[]", b"null")
USUAL = 300
"""Damaged files of a reader that make up the whole."""
NOT_THERE = ("['period']", "['seconds']", "['u']")
"""NaN in a dataset: a case or flight that is not there, or failed."""
KINDS = ("cut", "flipped", "dropped", "repeated", "number", "lines", "zeros", "foreign")


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
    """So many damaged files; the good ones are as they were afterwards."""
    whole = {path: path.read_bytes() for path in reader.files}
    good = reader.read(reader.path)
    content = reader.content and reader.content(good)
    found = Tally(Counter(), [])

    def read() -> Any:
        result = reader.read(reader.path)
        if reader.content and reader.content(result) != content:
            raise AssertionError("other content than what was saved")
        return result

    for seed in range(first, first + inputs):
        path = list(whole)[seed // len(KINDS) % len(whole)]
        kind, damage = damaged(whole[path], seed)
        path.write_bytes(damage)
        judge = _judged_apart if reader.apart else judged
        verdict = judge(read, kind, (), (type(good),), 3.0, _missing)
        fault = verdict.fault
        there = {file: file.read_bytes() for file in reader.files}
        if there != whole | {path: damage}:
            fault = "a file was changed"
        found.outcomes[verdict.outcome] += 1
        if fault:
            place = f"seed {seed}, {path.relative_to(reader.path.parent)}"
            found.faults.append(Fault(reader.entry, place, kind, "", fault))
        path.write_bytes(whole[path])
    return found


def _missing(found: NotANumber) -> bool:
    """What was not measured, not run, or no certificate claims."""
    owner = found.owners[0]
    return isinstance(owner, symheli.FlightRecord | synthesis.Certificate) or (
        isinstance(owner, dict) and found.where in NOT_THERE
    )
