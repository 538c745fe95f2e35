"""Whether the elements of a MATLAB file of version 5 fit into each other.

SciPy believes the sizes and types that a file states, and a damaged one may end the process in its
compiled reader, where no exception is raised: so they are checked before it sees the file. Source:
MathWorks, MAT-File Format, chapter 1.
"""

from __future__ import annotations

import itertools
import math
import zlib
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

ELEMENT_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a value by type of element: miINT8 to miUTF32."""
NAME, INT32, UINT32, MATRIX, COMPRESSED = (1, 16), (5, 6), 6, 14, 15
"""SciPy takes a name in UTF-8 and sizes that are said to have no sign."""
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMERIC = range(6, 16)
COMPLEX = 0x800
HEADER = 128
MAX_DEPTH = 50
"""Largest nesting depth of structs and cells; SciPy is recursive."""
MAX_INFLATED = 2**29
"""Most bytes of a variable that was compressed."""

MAX_EMPTY = 1_000_000
"""Largest number of structs without fields, or of spaces of a text, which take memory but no bytes
of the file.
"""


def _inflated(content: memoryview) -> bytes:
    """Bytes that were compressed, at most `MAX_INFLATED`: a small file may claim any amount."""
    stream = zlib.decompressobj()
    out = stream.decompress(content, MAX_INFLATED)
    if stream.unconsumed_tail:
        raise ValueError(f"a variable of more than {MAX_INFLATED / 2**20:.0f} MiB")
    if not stream.eof:
        raise ValueError("a compressed variable that was cut")
    return out


class _Element(NamedTuple):
    kind: int
    content: memoryview
    end: int


def check_mat5(file: Path) -> None:
    """Raise `ValueError` for a file of version 5 whose elements do not fit; files of other versions
    are not checked.
    """
    data = memoryview(file.read_bytes())
    if len(data) < 4 or 0 in data[:4]:  # version 4 has no header
        return
    if len(data) < HEADER:
        raise ValueError("the header is cut")
    mark = bytes(data[126:HEADER])
    if mark not in (b"IM", b"MI"):
        raise ValueError("the header does not say the order of bytes")
    _MatReader("little" if mark == b"IM" else "big").whole(data[HEADER:])


class _MatReader:
    def __init__(self, order: Literal["little", "big"]):
        self.order: Literal["little", "big"] = order

    def whole(self, data: memoryview) -> None:
        at = 0
        while at < len(data):
            kind, content, at = self.element(data, at, padded=False)
            if kind == COMPRESSED:
                kind, content, _ = self.element(memoryview(_inflated(content)), 0, False)
            if kind != MATRIX:
                raise ValueError(f"expected a variable, found an element of type {kind}")
            self.matrix(content, MAX_DEPTH)

    def element(self, data: memoryview, at: int, padded: bool = True) -> _Element:
        """The one that begins at `at`, the next of them at its `end`."""
        if at + 8 > len(data):
            raise ValueError("an element is cut")
        kind, size = self.integers(data[at : at + 8], "u4")
        if kind >> 16:  # up to four bytes in the place of the size
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            start = at + 8
            end = start + size + (-size % 8 if padded else 0)
        if start + size > len(data):
            raise ValueError("an element is longer than what it is in")
        if kind not in (MATRIX, COMPRESSED, *ELEMENT_BYTES):
            raise ValueError(f"an element of type {kind} with {size} bytes")
        return _Element(kind, data[start : start + size], end)

    def integers(self, content: memoryview, kind: str) -> list[int]:
        return np.frombuffer(content, f"{'<' if self.order == 'little' else '>'}{kind}").tolist()

    def of_type(self, data: memoryview, at: int, *kinds: int) -> _Element:
        found = self.element(data, at)
        if found.kind not in kinds:
            raise ValueError(f"expected an element of type {kinds[0]}, found {found.kind}")
        return found

    def matrix(self, data: memoryview, deeper: int) -> None:
        """Array flags, dimensions, name, and what the class of the array asks for."""
        if not len(data):
            return  # an empty array within a cell or struct
        if not deeper:
            raise ValueError(f"more than {MAX_DEPTH} structs or cells within each other")
        _, flags, at = self.of_type(data, 0, UINT32)
        if len(flags) != 8:
            raise ValueError("array flags are two numbers")
        flag = self.integers(flags, "u4")[0]
        kind = flag & 0xFF
        if kind == OPAQUE:
            for _ in range(3):
                at = self.of_type(data, at, *NAME).end
            self.matrices(data, at, 1, deeper)
            return
        _, content, at = self.of_type(data, at, *INT32)
        shape = self.integers(content, "i4")
        if not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise ValueError(f"dimensions {shape}")
        count = math.prod(shape)
        at = self.of_type(data, at, *NAME).end
        parts = 2 if flag & COMPLEX else 1
        if kind in NUMERIC:
            self.numbers(data, at, [count] * parts)
        elif kind == CHAR:
            found = self.of_type(data, at, *ELEMENT_BYTES)
            if count > (len(found.content) or MAX_EMPTY):  # spaces where there are none
                raise ValueError(f"{count} characters in {len(found.content)} bytes")
        elif kind == SPARSE:
            self.sparse(data, at, shape, parts)
        elif kind == CELL:
            self.matrices(data, at, count, deeper)
        elif kind in (STRUCT, OBJECT):
            self.structs(data, at, count, kind, deeper)
        elif kind == FUNCTION:
            self.matrices(data, at, 1, deeper)
        else:
            raise ValueError(f"an array of class {kind}")

    def numbers(self, data: memoryview, at: int, counts: list[int]) -> None:
        for count in counts:
            kind, content, at = self.of_type(data, at, *ELEMENT_BYTES)
            if len(content) != count * ELEMENT_BYTES[kind]:
                raise ValueError(
                    f"{len(content) // ELEMENT_BYTES[kind]} numbers in an array of {count}"
                )

    def sparse(self, data: memoryview, at: int, shape: list[int], parts: int) -> None:
        _, rows, at = self.of_type(data, at, *INT32)
        _, columns, at = self.of_type(data, at, *INT32)
        starts = self.integers(columns, "i4")
        ordered = all(a <= b for a, b in itertools.pairwise(starts))
        if len(shape) != 2 or len(starts) != shape[1] + 1 or starts[0] or not ordered:
            raise ValueError("the columns of a sparse array do not fit")
        used = self.integers(rows, "i4")[: starts[-1]]
        if len(used) < starts[-1] or not all(0 <= row < shape[0] for row in used):
            raise ValueError("the rows of a sparse array do not fit")
        for _ in range(parts):
            _kind, content, at = self.of_type(data, at, *ELEMENT_BYTES)
            if len(content) < starts[-1]:  # of logical values a byte each, whatever their type
                raise ValueError("a sparse array lacks numbers")

    def structs(self, data: memoryview, at: int, count: int, kind: int, deeper: int) -> None:
        if kind == OBJECT:
            at = self.of_type(data, at, *NAME).end
        _, content, at = self.of_type(data, at, *INT32)
        _, names, at = self.of_type(data, at, *NAME)
        length = self.integers(content, "i4")
        if len(length) != 1 or length[0] < 1 or len(names) % length[0]:
            raise ValueError("the names of the fields of a struct are cut")
        fields = len(names) // length[0]
        if not fields and count > MAX_EMPTY:
            raise ValueError(f"{count} structs without a field")
        self.matrices(data, at, count * fields, deeper)

    def matrices(self, data: memoryview, at: int, count: int, deeper: int) -> None:
        if count > len(data) // 8:
            raise ValueError(f"{count} arrays in {len(data)} bytes")
        for _ in range(count):
            _, content, at = self.of_type(data, at, MATRIX)
            self.matrix(content, deeper - 1)
