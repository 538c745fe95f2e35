"""Files that are either whole or not there."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from symheli.errors import InputError, SymheliError


def write_text(path: str | os.PathLike[str], content: str) -> Path:
    """Write `content` as UTF-8; see `write_bytes`."""
    return write_bytes(path, content.encode("utf-8"))


def write_own(path: str | os.PathLike[str], content: str) -> Path | None:
    """`write_text`, unless a file is there whose first line is another: that is somebody's own, is
    left alone, and None comes back.
    """
    target, first = Path(path), content.partition("\n")[0]
    if target.exists() and not target.read_text(encoding="utf-8").startswith(first):
        return None
    return write_text(target, content)


def write_bytes(path: str | os.PathLike[str], content: bytes, *, forced: bool = True) -> Path:
    """Replace `path` by `content` at once, folders made as needed: a reader sees the old file or
    the new one, never half of it. Where it is not `forced` onto the disk, which takes some
    milliseconds, that holds for stops and kills but not for a power failure.

    Raises `SymheliError` where the disk is full or the folder cannot be written; the old file is
    then still there.
    """
    target = Path(path)
    temporary = ""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            if forced:
                os.fsync(file.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        _remove(temporary)
        raise SymheliError(_reason(target, error, len(content))) from error
    except ValueError as error:  # a null byte, or half a character
        raise InputError(f"{str(path)!r} is not a path: {error}") from error
    except BaseException:
        _remove(temporary)
        raise
    return target


def _reason(target: Path, error: OSError, size: int) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return (
            f"{target}: the disk is full, {size / 1024:.0f} KiB are needed; free some space and try"
            " again"
        )
    if target.is_dir():
        return (
            f"{target} is a folder: give the name of a file in it, such as {target / 'model.json'}"
        )
    return f"{target}: cannot be written ({error.strerror or error}); choose another place"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _remove(path: str) -> None:
    if path:
        with contextlib.suppress(OSError):
            os.unlink(path)
