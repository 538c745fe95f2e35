"""Files of public repositories that are not kept here: fetched, and held against a checksum."""

from __future__ import annotations

import hashlib
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from symheli.errors import InputError
from symheli.values.whole_files import write_bytes

RAW = "https://raw.githubusercontent.com"
"""Where files of public repositories are served as they are."""
MAX_BYTES = 16 * 2**20
"""Largest answer of the server that is taken."""
TIMEOUT = 60.0
"""s"""


@dataclass(frozen=True)
class PublicFile:
    """A file of a public repository at a commit, with its SHA-256."""

    name: str
    repository: str
    commit: str
    path: str
    sha256: str

    @property
    def address(self) -> str:
        """Where it is fetched from."""
        return f"{RAW}/{self.repository}/{self.commit}/{urllib.parse.quote(self.path)}"


def fetched(public: PublicFile, folder: Path) -> Path:
    """The file in `folder`, fetched where it is not there; raises `InputError` where it cannot be,
    or is another than its checksum says.
    """
    file = folder / public.name
    if not file.is_file():
        try:
            with urllib.request.urlopen(public.address, timeout=TIMEOUT) as answer:
                content = answer.read(MAX_BYTES + 1)
        except (urllib.error.URLError, OSError) as error:
            raise InputError(
                f"{public.name} is not in {folder}, and {public.address} cannot be fetched"
                f" ({error})"
            ) from error
        _refuse_another(public, content, public.address)
        folder.mkdir(parents=True, exist_ok=True)
        write_bytes(file, content)
    _refuse_another(public, file.read_bytes(), str(file))
    return file


def _refuse_another(public: PublicFile, content: bytes, where: str) -> None:
    if (found := hashlib.sha256(content).hexdigest()) != public.sha256:
        raise InputError(
            f"{where}: SHA-256 {found}, expected {public.sha256}: another file; remove it"
        )
