"""Logs as autopilots write them, byte by byte from the formats' specifications: PX4 ULog
(docs.px4.io/main/en/dev_log/ulog_file_format.html) and ArduPilot DataFlash
(ardupilot.org/copter/docs/logmessages.html).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Format = tuple[int, str, str]
"""Type of a message, letters of its fields, their names."""

FMT: Format = (128, "BBnNZ", "Type,Length,Name,Format,Columns")
UNIT: Format = (177, "QbZ", "TimeUS,Id,Label")
FMTU: Format = (178, "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
MULT: Format = (179, "Qbd", "TimeUS,Id,Mult")
PARM: Format = (64, "QNf", "TimeUS,Name,Value")

UNITS = {
    "s": "s",
    "E": "rad/s",
    "O": "degC",
    "d": "deg",
    "h": "degheading",
    "n": "m/s",
    "#": "inst",
}
"""Unit by the letter that stands for it."""
MULTIPLIERS = {"F": 1e-6, "0": 1.0, "B": 1e-2, "-": 0.0}
"""Value of one count by the letter that stands for it."""

TYPES = {**{c: c for c in "QIBbfHhd"}, "c": "h", "C": "H", "n": "4s", "N": "16s", "Z": "64s"}
"""What `struct` calls the letter of a field."""


def dataflash(
    rows: Iterable[tuple[str, Sequence[Any]]],
    formats: Mapping[str, Format],
    declared: Mapping[str, tuple[str, str]] | None = None,
    *,
    units: Mapping[str, str] = UNITS,
    text: bool = False,
) -> bytes:
    """A DataFlash log of [(message, fields), ...], values as the log stores them (an angle of type
    c in 1/100 degrees), binary or as text. `declared`: letters of unit and multiplier of each
    field, by message, letters of units as in `units`; None for a log without units.
    """
    write = _line if text else _packet
    messages: list[tuple[str, Sequence[Any]]] = []
    for kind, (number, letters, names) in formats.items():
        size = 3 + struct.calcsize("<" + "".join(TYPES[c] for c in letters))
        messages.append(("FMT", (number, size, kind, letters, names)))
    if declared is not None:
        messages += [("UNIT", (0, ord(key), label)) for key, label in units.items()]
        messages += [("MULT", (0, ord(key), value)) for key, value in MULTIPLIERS.items()]
        messages += [("FMTU", (0, formats[kind][0], *ids)) for kind, ids in declared.items()]
    return b"".join(write(formats[kind], kind, values) for kind, values in [*messages, *rows])


def _packet(form: Format, _: str, values: Sequence[Any]) -> bytes:
    number, letters, _ = form
    values = [v.encode() if isinstance(v, str) else v for v in values]
    layout = "<" + "".join(TYPES[c] for c in letters)
    return struct.pack("<BBB", 0xA3, 0x95, number) + struct.pack(layout, *values)


def _line(form: Format, kind: str, values: Sequence[Any]) -> bytes:
    letters = form[1]
    shown = (v / 100 if c in "cC" else v for c, v in zip(letters, values, strict=True))
    return (", ".join([kind, *map(str, shown)]) + "\n").encode()


def ulog(
    topics: Mapping[tuple[str, int], Mapping[str, Sequence[float]]],
    parameters: Mapping[str, float] | None = None,
) -> bytes:
    """A ULog of {(topic, instance): {field: values}}, "timestamp" in us among the fields; samples
    of all topics in order of time.
    """

    def message(kind: str, payload: bytes) -> bytes:
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    out = [b"ULog\x01\x12\x35\x01", struct.pack("<Q", 0)]
    for topic, fields in {name: f for (name, _), f in topics.items()}.items():
        names = ";".join(
            ["uint64_t timestamp", *(f"float {field}" for field in fields if field != "timestamp")]
        )
        out.append(message("F", f"{topic}:{names};".encode()))
    for name, value in (parameters or {}).items():
        key = f"float {name}".encode()
        out.append(message("P", bytes([len(key)]) + key + struct.pack("<f", value)))
    samples = []
    for number, ((topic, instance), fields) in enumerate(topics.items()):
        out.append(message("A", struct.pack("<BH", instance, number) + topic.encode()))
        rest = [values for field, values in fields.items() if field != "timestamp"]
        for row in zip(fields["timestamp"], *rest, strict=True):
            data = struct.pack(f"<HQ{len(rest)}f", number, int(row[0]), *row[1:])
            samples.append((row[0], message("D", data)))
    return b"".join([*out, *(data for _, data in sorted(samples, key=lambda s: s[0]))])
