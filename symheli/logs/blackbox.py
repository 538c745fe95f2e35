"""Blackbox logs of Betaflight, Rotorflight, INAV and Cleanflight (.bbl, .bfl, .txt), version 2.

A file holds one or more logs, each with a header in words and frames of bytes: I frames whole, P
frames as differences to a prediction, S (slow) and G (GPS) frames between them. Columns are called
as in the header, such as "gyroADC[0]"; three are added: "pidSum[0]" to "pidSum[2]", the sum of the
controller's terms on an axis, which is what the mixer gets, and "log", the number of the log in the
file. Signs are the firmware's.

The clock counts us since power on. Where it begins again, a later log is set `GAP` behind the log
before it. Parts that are damaged are left out up to the next I frame, with a warning.

Format: https://betaflight.com/docs/development/Blackbox-Internals.
"""

from __future__ import annotations

import os
import struct
from array import array
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.logs.column import GAP, Column, on_one_axis
from symheli.logs.files import Table, bounded, positive, warn_of_damage
from symheli.logs.format import LogFormat
from symheli.logs.meaning import BLACKBOX as GUESSED
from symheli.logs.signal_map import SignalMap
from symheli.progress import task
from symheli.values.units import to_si

BLACKBOX = b"H Product:Blackbox"
"""At the beginning of each log of a Blackbox file."""

MAX_BYTES = 64 * 2**20
"""Largest file that is read; a MiB takes about a second."""

MAX_LOGS, MAX_FIELDS = 1000, 512
"""Most logs of a file, and most fields of a frame, that are taken for real."""

MAX_JUMP = 10_000_000
"""us: a frame that is later than the one before it by more is damaged."""

REPORT_EVERY = 2**16
"""Bytes after which progress is reported."""

TERMS = ("axisP", "axisI", "axisD", "axisF", "axisS", "axisB", "axisO")
"""Terms of the controller, of which a firmware has some."""

SIGNED, UNSIGNED, NEGATIVE_14, TAG8_8, TAG2_3, TAG8_4, NULL = 0, 1, 3, 6, 7, 8, 9
GROUPS = {SIGNED: 1, UNSIGNED: 1, NEGATIVE_14: 1, TAG8_8: 8, TAG2_3: 3, TAG8_4: 4, NULL: 1}
"""Encodings, and how many neighbouring fields one of them holds at most."""

PREDICTORS = range(12)
EVENTS: Mapping[int, int] = {0: 1, 14: 2, 15: 1, 30: 2}
"""Numbers of the events that are passed over, with how many unsigned numbers follow each."""

END_OF_LOG = 255


class _Damaged(Exception):
    """A frame that cannot be right."""


class _Kind(NamedTuple):
    """Fields of a kind of frame: names, groups of (encoding, number of fields), predictors."""

    names: list[str]
    groups: list[tuple[int, int]]
    predictors: list[int]


class _Header(NamedTuple):
    """What the header of one log says, and where its frames begin."""

    words: dict[str, str]
    kinds: dict[str, _Kind]
    body: int


def read_blackbox(
    path: str | os.PathLike[str], fields: Mapping[str, tuple[str, str]], dt: float
) -> Table:
    """{signal: (column, unit)}, interpolated to steps of `dt` (s) over their common time as
    `symheli.logs.column.on_one_axis` does.

    Raises `InputError` without a signal and for a file that is no such log, `UnknownNameError` for
    a column it lacks.
    """
    if not fields:
        raise InputError('fields: expected at least one signal, such as {"p": "gyroADC[0]"}')
    dt, found = positive(dt), blackbox_columns(path)
    for column, _ in fields.values():
        if column not in found:
            raise UnknownNameError(f"column of {path}", column, sorted(found))
    time, values = on_one_axis({name: found[c] for name, (c, _) in fields.items()}, dt, path)
    units = {}
    for name, (column, given) in fields.items():
        logged = found[column].unit
        if logged is not None and given and to_si(logged) != to_si(given):
            raise InputError(f"{name}: the log says that {column} is in {logged}, not {given}")
        units[name] = logged or given or "1"
    return time, values, units


def blackbox_columns(path: str | os.PathLike[str]) -> dict[str, Column]:
    """Every column by its name, those of all logs of the file one after the other."""
    file = bounded(path, MAX_BYTES)
    data = file.read_bytes()
    starts = list(_occurrences(data, BLACKBOX))
    if not starts:
        raise InputError(f"{file}: not a Blackbox log: no line begins with {BLACKBOX.decode()!r}")
    if len(starts) > MAX_LOGS:
        raise InputError(f"{file}: {len(starts)} logs in one file, at most {MAX_LOGS} are read")
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    units: dict[str, str] = {}
    late, offset, lost = -np.inf, 0.0, False
    with task("reading a Blackbox log", len(data), percent=True) as reading:
        for number, (start, stop) in enumerate(
            zip(starts, [*starts[1:], len(data)], strict=True), 1
        ):
            header = _header(data[start:stop], file)
            frames, damaged = _frames(
                data[start:stop], header, lambda at, start=start: reading.to(start + at)
            )
            lost |= damaged
            columns = _columns(frames, header, number)
            if not columns:
                continue
            first = min(time[0] for time, _ in columns.values())
            last = max(time[-1] for time, _ in columns.values())
            if first + offset <= late:
                offset = late + GAP - first
            late = last + offset
            for name, (time, values) in columns.items():
                parts.setdefault(name, []).append((time + offset, values))
            units |= _units(header)
    if not parts:
        raise InputError(
            f"{file}: {len(starts)} log{'s'[: len(starts) > 1]} without a whole frame; was the"
            " memory full, or erased?"
        )
    if lost:
        warn_of_damage(file)
    return {
        name: Column(
            np.concatenate([t for t, _ in found]),
            np.concatenate([v for _, v in found]),
            units.get(name),
        )
        for name, found in parts.items()
    }


def _occurrences(data: bytes, what: bytes) -> Iterator[int]:
    at = data.find(what)
    while at >= 0:
        yield at
        at = data.find(what, at + 1)


def _header(data: bytes, path: object) -> _Header:
    """The lines "H name:value" at the beginning of a log."""
    words, at = {}, 0
    while data[at : at + 2] == b"H ":
        end = data.find(b"\n", at)
        if end < 0:
            break
        name, _, value = data[at + 2 : end].decode("latin-1").partition(":")
        words[name.strip()] = value.strip()
        at = end + 1
    if words.get("Data version", "2") != "2":
        raise InputError(
            f"{path}: version {words['Data version']} of the Blackbox format is not read, only 2"
            " (since 2015); blackbox_decode makes a CSV of it"
        )
    kinds = {}
    for letter in "IPSGH":
        of = "I" if letter == "P" else letter
        names = words.get(f"Field {of} name", "").split(",")
        codes = words.get(f"Field {letter} encoding", "")
        if not codes or not names[0]:
            continue
        try:
            encodings = [int(code) for code in codes.split(",")]
            predictors = [int(p) for p in words.get(f"Field {letter} predictor", "").split(",")]
        except ValueError as error:
            raise InputError(f"{path}: the header is damaged ({error})") from error
        if not len(names) == len(encodings) == len(predictors) <= MAX_FIELDS:
            raise InputError(
                f"{path}: the header is damaged: {len(names)} names, {len(encodings)} encodings and"
                f" {len(predictors)} predictors of {letter} frames, at most {MAX_FIELDS}"
            )
        for what, known, given in (
            ("encoding", GROUPS, encodings),
            ("predictor", PREDICTORS, predictors),
        ):
            if unknown := sorted({*given} - {*known}):
                raise InputError(
                    f"{path}: {what} {unknown[0]} of {letter} frames is not known here;"
                    " blackbox_decode makes a CSV of such a log, which symheli reads"
                )
        kinds[letter] = _Kind(names, _groups(encodings), predictors)
    if "I" not in kinds or "time" not in kinds["I"].names:
        raise InputError(f"{path}: the header says nothing of the frames; was the log cut?")
    return _Header(words, kinds, at)


def _groups(encodings: list[int]) -> list[tuple[int, int]]:
    out: list[tuple[int, int]] = []
    for code in encodings:
        if out and out[-1][0] == code and out[-1][1] < GROUPS[code]:
            out[-1] = code, out[-1][1] + 1
        else:
            out.append((code, 1))
    return out


class _Bytes:
    """Numbers read one after the other."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at

    def byte(self) -> int:
        self.at += 1
        return self.data[self.at - 1]

    def whole(self, size: int) -> int:
        """A signed number of `size` bytes, the lowest first."""
        self.at += size
        if self.at > len(self.data):
            raise IndexError
        return int.from_bytes(self.data[self.at - size : self.at], "little", signed=True)

    def unsigned(self) -> int:
        """A number of 7 bits a byte, the lowest first, at most 32 bits."""
        data, at, value, shift = self.data, self.at, 0, 0
        while (byte := data[at]) & 0x80:
            value |= (byte & 0x7F) << shift
            shift += 7
            at += 1
            if shift > 28:
                raise _Damaged
        self.at = at + 1
        return value | byte << shift

    def signed(self) -> int:
        """The same, its sign in the lowest bit."""
        value = self.unsigned()
        return (value >> 1) ^ -(value & 1)

    def fields(self, groups: list[tuple[int, int]]) -> list[int]:
        """The fields of a frame, before their prediction is added."""
        out: list[int] = []
        for code, count in groups:
            if code == SIGNED or (code == TAG8_8 and count == 1):
                out.append(self.signed())
            elif code == UNSIGNED:
                out.append(self.unsigned())
            elif code == NULL:
                out.append(0)
            elif code == NEGATIVE_14:
                out.append(-_extended(self.unsigned(), 14))
            elif code == TAG8_8:
                tags = self.byte()
                out += [self.signed() if tags >> i & 1 else 0 for i in range(count)]
            elif code == TAG2_3:
                out += self._three()[:count]
            else:
                out += self._four()[:count]
        return out

    def _three(self) -> list[int]:
        lead = self.byte()
        match lead >> 6:
            case 0:
                return [_extended(lead >> shift, 2) for shift in (4, 2, 0)]
            case 1:
                rest = self.byte()
                return [_extended(x, 4) for x in (lead, rest >> 4, rest)]
            case 2:
                return [_extended(x, 6) for x in (lead, self.byte(), self.byte())]
        return [self.whole(1 + (lead >> shift & 3)) for shift in (0, 2, 4)]

    def _four(self) -> list[int]:
        """Four numbers of 0, 4, 8 or 16 bits, packed with the highest bits first."""
        tags = self.byte()
        out, held, bits = [], 0, 0
        for i in range(4):
            width = (0, 4, 8, 16)[tags >> 2 * i & 3]
            while bits < width:
                held, bits = held << 8 | self.byte(), bits + 8
            bits -= width
            out.append(_extended(held >> bits, width) if width else 0)
            held &= (1 << bits) - 1
        return out


def _extended(value: int, bits: int) -> int:
    """The lowest `bits` of a number as one with a sign."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


_Rows = dict[str, array]
"""Numbers of the frames by kind, one frame after the other, the instant (us) before each."""


def _frames(data: bytes, header: _Header, reached: Callable[[int], None]) -> tuple[_Rows, bool]:
    """Frames of one log, I and P together under "I", and whether some were damaged;
    `reached` is called with the number of bytes read.
    """
    stream, kinds = _Bytes(data, header.body), header.kinds
    index = kinds["I"].names.index("time")
    rows: _Rows = {letter: array("d") for letter in "ISG"}
    before: list[int] | None = None
    earlier, home, lost, size = before, [0, 0], False, len(data)
    constants = _constants(header)
    next_report = 0
    while stream.at < size:
        begin = stream.at
        if begin >= next_report:
            reached(begin)
            next_report = begin + REPORT_EVERY
        letter = chr(data[begin])
        stream.at += 1
        try:
            if letter == "E":
                if _event(stream) == END_OF_LOG:
                    break
                continue
            if letter not in kinds or (letter == "P" and before is None):
                raise _Damaged
            kind = kinds[letter]
            values = stream.fields(kind.groups)
            if stream.at < size and data[stream.at] not in b"IPSGHE":
                raise _Damaged
            now = before[index] if before is not None else 0  # of the first, filled in later
            if letter in "IP":
                base = before or []
                _predict(values, kind.predictors, base, earlier or base, constants)
                if before is not None and not 0 <= values[index] - now <= MAX_JUMP:
                    raise _Damaged
                earlier, before = (values if letter == "I" else before), values
                rows["I"].extend([values[index], *values])
                continue
            _predict(values, kind.predictors, [], [], {**constants, 10: now, 7: 0})
            if letter == "H":
                home = values[:2]
            elif letter == "G":
                for i, where in enumerate(i for i, p in enumerate(kind.predictors) if p == 7):
                    values[where] += home[i % 2]
            if letter in rows:
                rows[letter].extend([now, *values])
        except (_Damaged, IndexError):
            lost |= stream.at < size or letter in "IP"
            after = data.find(b"I", begin + 1)
            stream.at, before = (size if after < 0 else after), None
    return rows, lost


def _event(stream: _Bytes) -> int:
    number = stream.byte()
    if number not in EVENTS and number != END_OF_LOG:
        raise _Damaged
    for _ in range(EVENTS.get(number, 0)):
        stream.unsigned()
    return number


def _constants(header: _Header) -> dict[int, int]:
    """Predictions that the header holds, by the number of the predictor."""

    def first(*names: str) -> int:
        for name in names:
            text = header.words.get(name, "").split(",")[0]
            if text.lstrip("-").isdigit():
                return int(text)
        return 0

    return {
        0: 0,
        4: first("minthrottle"),
        8: 1500,
        9: first("vbatref"),
        11: first("motorOutput", "minmotor"),
    }


def _predict(
    values: list[int],
    predictors: list[int],
    last: list[int],
    earlier: list[int],
    constants: Mapping[int, int],
) -> None:
    """Add its prediction to each field, from the two frames before."""
    motor = None
    for i, predictor in enumerate(predictors):
        if predictor == 0:
            continue
        if predictor == 1:
            values[i] += last[i] if last else 0
        elif predictor == 2:
            values[i] += 2 * last[i] - earlier[i] if last else 0
        elif predictor == 3:
            values[i] += int((last[i] + earlier[i]) / 2) if last else 0
        elif predictor == 6:
            values[i] += last[i] + 1 if last else 0
        elif predictor == 5:
            if motor is None:
                motor = i - 1  # the first motor stands before those that it predicts
            values[i] += values[motor]
        else:
            values[i] += constants.get(predictor, 0)


def _columns(rows: _Rows, header: _Header, number: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Instants (s) and values of each column of one log."""
    out: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for letter, found in rows.items():
        if not found:
            continue
        table = np.array(found).reshape(-1, 1 + len(header.kinds[letter].names))
        time = 1e-6 * np.maximum(table[:, 0], rows["I"][0] if rows["I"] else 0.0)
        for i, name in enumerate(header.kinds[letter].names):
            if name not in ("time", "loopIteration"):
                out.setdefault(name, (time, _scale(name, header) * table[:, i + 1]))
    if not rows["I"]:
        return {}
    time = 1e-6 * np.array(rows["I"])[:: 1 + len(header.kinds["I"].names)]
    for axis in range(3):
        terms = [out[name][1] for term in TERMS if (name := f"{term}[{axis}]") in out]
        if terms:
            out[f"pidSum[{axis}]"] = time, np.sum(terms, axis=0)
    out["log"] = time[[0, -1]], np.full(2, float(number))
    return out


def _scale(name: str, header: _Header) -> float:
    """What one count of a column is, in the unit of `_units`; 1 where that is not known."""
    if name.startswith("gyroADC"):
        return _gyro_scale(header) or 1.0
    return 0.01 if name == "GPS_speed" else 1.0


def _gyro_scale(header: _Header) -> float | None:
    """deg/s of one count of the gyro, None where the header does not say."""
    text = header.words.get("gyro_scale", header.words.get("gyro.scale", ""))
    try:
        scale = struct.unpack("<f", struct.pack("<I", int(text, 16)))[0]
    except (ValueError, struct.error):
        return None
    return float(scale if scale > 1e-3 else np.degrees(1e6 * scale))  # or rad/us


def _units(header: _Header) -> dict[str, str]:
    known = {"GPS_speed": "m/s"}
    if _gyro_scale(header) is not None:
        known |= {f"gyroADC[{axis}]": "deg/s" for axis in range(3)}
    return known


class Blackbox(LogFormat):
    """Blackbox logs of Betaflight, Rotorflight and INAV."""

    name, own_clocks = "blackbox", True
    guessed = GUESSED
    columns = staticmethod(blackbox_columns)

    def recognises(self, head: bytes) -> bool:
        """Whether a log begins in its head."""
        return BLACKBOX in head

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read the fields of a map, on its step."""
        fields = {column: (column, unit or "") for column, unit in by.given.items()}
        return read_blackbox(path, fields, by.needed_step(path))
