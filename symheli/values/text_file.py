"""Text files as they come from outside."""

from __future__ import annotations

import codecs
from pathlib import Path

from symheli.errors import InputError


def text_of(path: Path) -> str:
    """The text of a file in UTF-8, or in UTF-16 with its mark, as a shell on Windows writes it; a
    mark at its beginning is dropped, and lines end in a newline.

    Raises `InputError` for a file that cannot be read, with the line of one that is no text.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    utf16 = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}, line {line}: not a text file in UTF-8; save it as UTF-8"
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
