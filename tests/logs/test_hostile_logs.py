"""Files made to exhaust a reader: each is refused in a sentence, before memory or time run out.

The sizes that the files claim are thousands of times what the machine has: a reader that believed
them would not come to the assertion.
"""

from __future__ import annotations

import struct
import zlib

import pytest

from symheli.errors import InputError
from symheli.logs import files
from symheli.logs.format import contents_of, format_of
from symheli.logs.mat5 import MAX_INFLATED


def ulog(*formats):
    """A ULog that declares these topics and logs one sample of the first."""

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    return b"".join(
        [
            b"ULog\x01\x12\x35\x01" + bytes(8),
            message("B", bytes(40)),
            *(message("F", text.encode()) for text in formats),
            message("A", struct.pack("<BH", 0, 0) + formats[0].split(":")[0].encode()),
            message("D", struct.pack("<HQ", 0, 1) + bytes(60)),
        ]
    )


@pytest.mark.parametrize(
    "formats",
    [
        ("t:uint64_t timestamp;uint8_t[900000000000] x;",),
        ("t:uint64_t timestamp;a[9999] x;", "a:b[9999] x;", "b:uint8_t[9999] x;"),
        ("t:uint64_t timestamp;t[2] x;",),
        ("t:uint64_t timestamp;a x;", "a:t x;"),
    ],
    ids=["an array", "arrays of arrays", "itself", "each other"],
)
def test_a_ulog_of_endless_fields_is_refused(tmp_path, formats):
    pytest.importorskip("pyulog", reason="needs pyulog: pip install 'symheli[logs]'")
    (tmp_path / "log.ulg").write_bytes(ulog(*formats))
    with pytest.raises(InputError, match=r"damaged: topic '\w' is declared with"):
        contents_of(tmp_path / "log.ulg")


@pytest.mark.parametrize("size", [0, 2])
def test_a_dataflash_message_shorter_than_its_head_is_refused(tmp_path, size):
    """The index of the reader would stand still in front of it."""
    pytest.importorskip("pymavlink", reason="needs pymavlink: pip install 'symheli[logs]'")
    log = b"".join(
        b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *fields)
        for fields in (
            (128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
            (1, size, b"IMU", b"Qf", b"TimeUS,GyrX"),
        )
    )
    (tmp_path / "log.bin").write_bytes(log + b"\xa3\x95\x01" + bytes(50))
    with pytest.raises(InputError, match=f"it declares messages of {size} bytes"):
        contents_of(tmp_path / "log.bin")


@pytest.mark.slow
def test_a_matlab_file_that_swells_is_refused(tmp_path):
    stream, swollen = zlib.compressobj(9), []
    for _ in range(MAX_INFLATED // 2**20 + 1):
        swollen.append(stream.compress(bytes(2**20)))
    packed = b"".join([*swollen, stream.flush()])
    assert len(packed) < 2**20
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    (tmp_path / "log.mat").write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(InputError, match="a variable of more than 512 MiB"):
        contents_of(tmp_path / "log.mat")


@pytest.mark.parametrize(
    "head", [b"ULog", b"\xa3\x95\x80", b"H Product:Blackbox", b"t,q\n", b"MATLAB 5.0"]
)
def test_a_log_larger_than_memory_bears_is_refused_unread(tmp_path, head):
    path = tmp_path / "log"
    with path.open("wb") as file:
        file.write(head)
        file.truncate(100 * files.MAX_BYTES)  # takes no space
    with pytest.raises(InputError, match="MiB of such a log are read"):
        contents_of(path)


def test_parameters_are_no_log(tmp_path):
    lines = [f"ATC_RAT_RLL_{i},{0.1 * i}" for i in range(20)]
    (tmp_path / "heli.param").write_text("\n".join(lines))
    with pytest.raises(InputError, match="parameters of an autopilot, not a log"):
        format_of(tmp_path / "heli.param")
