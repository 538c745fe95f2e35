"""Text files as they come from outside."""

from __future__ import annotations

from pathlib import Path

from symheli.errors import InputError


def text_of(path: Path) -> str:
    """The text of a UTF-8 file; raises `InputError` for one that cannot be read, or is no text."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file in UTF-8 ({error})") from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
