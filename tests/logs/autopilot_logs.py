"""Small logs as autopilots write them, byte by byte from the formats' specifications: PX4 ULog
(docs.px4.io/main/en/dev_log/ulog_file_format.html) and ArduPilot DataFlash
(AP_Logger/LogStructure.h).
"""

from __future__ import annotations

import struct

import numpy as np


def ulog(topics):
    """Bytes of a ULog of {(topic, instance): {field: values}}, "timestamp" in us among the fields;
    samples of all topics in order of time.
    """

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    out = [b"ULog\x01\x12\x35\x01", struct.pack("<Q", 0)]
    for topic, fields in {name: f for (name, _), f in topics.items()}.items():
        names = ";".join(
            ["uint64_t timestamp", *(f"float {field}" for field in fields if field != "timestamp")]
        )
        out.append(message("F", f"{topic}:{names};".encode()))
    samples = []
    for number, ((topic, instance), fields) in enumerate(topics.items()):
        out.append(message("A", struct.pack("<BH", instance, number) + topic.encode()))
        rest = [values for field, values in fields.items() if field != "timestamp"]
        for row in zip(fields["timestamp"], *rest, strict=True):
            data = struct.pack(f"<HQ{len(rest)}f", number, int(row[0]), *row[1:])
            samples.append((row[0], message("D", data)))
    return b"".join([*out, *(data for _, data in sorted(samples, key=lambda s: s[0]))])


def quaternions(topic_fields):
    """Fields as PX4 names a vector: {"q": (n, 4)} to q[0] ... q[3], which the log declares as
    float[4].
    """
    return {
        f"{name}[{i}]": column
        for name, columns in topic_fields.items()
        for i, column in enumerate(np.transpose(columns))
    }


FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "UNIT": (177, "QbZ", "TimeUS,Id,Label"),
    "FMTU": (178, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    "MULT": (179, "Qbd", "TimeUS,Id,Mult"),
    "IMU": (140, "QBff", "TimeUS,I,GyrY,T"),
    "ATT": (141, "QcC", "TimeUS,Pitch,Yaw"),
    "RATE": (142, "Qh", "TimeUS,POut"),
    "GPS": (143, "QBIH", "TimeUS,Status,GMS,GWk"),
}
"""Type, letters of the fields and their names, by message."""

UNITS = {
    "s": "s",
    "E": "rad/s",
    "O": "degC",
    "d": "deg",
    "h": "degheading",
    "n": "m/s",
    "#": "inst",
}
MULTIPLIERS = {"F": 1e-6, "0": 1.0, "B": 1e-2, "-": 0.0}
DECLARED = {"IMU": ("s#EO", "F---"), "ATT": ("sdh", "FBB"), "RATE": ("sn", "FB")}
"""Letters of unit and multiplier for each field."""

TYPES = {
    "Q": "Q",
    "I": "I",
    "B": "B",
    "b": "b",
    "f": "f",
    "c": "h",
    "C": "H",
    "H": "H",
    "h": "h",
    "d": "d",
} | {
    "n": "4s",
    "N": "16s",
    "Z": "64s",
}


SDLOG2 = {
    "FMT": FORMATS["FMT"],
    "TIME": (129, "Q", "StartTime"),
    "ATT": (2, "ffffff", "Roll,Pitch,Yaw,RollRate,PitchRate,YawRate"),
    "ATTC": (9, "ffff", "Roll,Pitch,Yaw,Thrust"),
}
"""Of PX4's logs before ULog: the time stands in a message of its own, before those of its instant
(src/modules/sdlog2/sdlog2_messages.h).
"""

BEFORE_2015 = {
    "FMT": FORMATS["FMT"],
    "ATT": (1, "IcC", "TimeMS,Pitch,Yaw"),
    "IMU": (2, "Ifff", "TimeMS,GyrX,GyrY,GyrZ"),
    "RATE": (3, "If", "TimeMS,POut"),
    "GPS": (130, "BIfI", "Status,TimeMS,Spd,T"),
    "EV": (4, "IB", "TimeMS,Id"),
}
"""Of ArduPilot until 2014: TimeMS is the autopilot's, but of GPS that of the week, with the
autopilot's in T.
"""


def dataflash(rows, *, text=False, units=True, formats=FORMATS):
    """A DataFlash log of [(message, (field, ...)), ...], values as the log stores them (an angle of
    type c in 1/100 degrees); `units`: with the messages that declare them.
    """
    messages, units = [], units and "UNIT" in formats
    write = _line if text else _packet
    for kind, (number, letters, names) in formats.items():
        size = 3 + struct.calcsize("<" + "".join(TYPES[c] for c in letters))
        messages.append(("FMT", (number, size, kind, letters, names)))
    if units:
        messages += [("UNIT", (0, ord(key), label)) for key, label in UNITS.items()]
        messages += [("MULT", (0, ord(key), value)) for key, value in MULTIPLIERS.items()]
        messages += [("FMTU", (0, FORMATS[kind][0], *ids)) for kind, ids in DECLARED.items()]
    return b"".join(write(formats[kind], kind, values) for kind, values in [*messages, *rows])


def _packet(form, _, values):
    number, letters, _ = form
    values = [v.encode() if isinstance(v, str) else v for v in values]
    form = "<" + "".join(TYPES[c] for c in letters)
    return struct.pack("<BBB", 0xA3, 0x95, number) + struct.pack(form, *values)


def _line(form, kind, values):
    letters = form[1]
    shown = (v / 100 if c in "cC" else v for c, v in zip(letters, values, strict=True))
    return (", ".join([kind, *map(str, shown)]) + "\n").encode()
