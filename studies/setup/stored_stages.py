"""Finished stages of a study on disk, each complete or absent, for a run that resumes a stopped
one.

A stage is stored as JSON and arrays, see `stage_file`, below a line with the key of what it was
computed from and the digest of its bytes. The key covers what the stage reads of the effort, the
keys of the stages it needs, and which stage and which of its questions the file answers: where one
entry changes, the stages that it reaches are computed again, and no others; a file that was copied
or renamed is none.
"""

from __future__ import annotations

import contextlib
import hashlib
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from studies.setup import stage_file
from symheli import Helicopter
from symheli.errors import SymheliError
from symheli.values.whole_files import write_bytes

FORMAT = "symheli stage 3"
STAGES = "stages"
"""Folder of the stored stages, in that of the run."""
PACKAGES = ("symheli", "identification", "synthesis", "studies")
LIBRARIES = ("casadi", "numpy", "scipy", "cvxpy", "clarabel")


class NotUsable(SymheliError):
    """Raised for a stored stage that cannot be used; the message gives the reason."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """Result of a stage, and the seconds it took."""

    result: Any
    seconds: float


@dataclass(frozen=True)
class StoredStages:
    """The stages in `folder` that were computed from what the key of each stands for.

    A stage of questions that is not finished has its answers there, each a `part` by its number.
    """

    folder: Path
    keys: Mapping[str, str]

    def path(self, name: str, part: int | None = None) -> Path:
        """File where the stage, or an answer to one of its questions, is stored."""
        return self.folder / (f"{name}.stage" if part is None else f"{name}-{part}.stage")

    def _key(self, name: str, part: int | None) -> str:
        """What the file was computed from, and of which stage and question it is the answer."""
        return digest((self.keys[name], name, "whole" if part is None else str(part)))

    def save(self, name: str, stored: Stored, part: int | None = None) -> Path:
        """Store it, in place of an older one; see `whole_files.write_bytes`. The answers to the
        questions of a stage go when it is stored.
        """
        content = stage_file.written(stored)
        head = f"{FORMAT} {self._key(name, part)} {hashlib.sha256(content).hexdigest()}\n"
        path = write_bytes(self.path(name, part), head.encode() + content)
        for answer in self.folder.glob(f"{name}-*.stage") if part is None else ():
            answer.unlink(missing_ok=True)
        return path

    def load(self, name: str, part: int | None = None) -> Stored | None:
        """Return the stored result; None where there is none.

        Raises `NotUsable` for what another version, vehicle, effort or seed has left, for the
        answer to another question, and for what is damaged.
        """
        path = self.path(name, part)
        if not path.is_file():
            return None
        head, _, content = path.read_bytes().partition(b"\n")
        words = head.decode("utf-8", "replace").rsplit(" ", 2)
        if len(words) != 3 or words[0] != FORMAT:
            raise NotUsable(f"{path} is damaged: it is no stored stage")
        if words[1] != self._key(name, part):
            raise NotUsable(
                f"{path} is of another stage or question, or of another version, vehicle, effort or"
                " seed"
            )
        if words[2] != hashlib.sha256(content).hexdigest():
            raise NotUsable(f"{path} is damaged: its content is not what was written")
        try:
            stored = stage_file.read(content)
        except stage_file.UnreadableError as error:
            raise NotUsable(f"{path} is damaged: {error}") from error
        if not isinstance(stored, Stored):
            raise NotUsable(f"{path} is damaged: it holds no stage")
        return stored

    def parts(self, name: str, count: int) -> dict[int, Stored]:
        """The answers that are there and whole, of `count`, by number."""
        each = ((i, self.usable(name, i)) for i in range(count))
        return {i: answer for i, answer in each if answer is not None}

    def usable(self, name: str, part: int | None = None) -> Stored | None:
        """The stored result; None where there is none that can be used."""
        with contextlib.suppress(NotUsable):
            return self.load(name, part)
        return None


def content_key(heli: Helicopter, vehicle: str, seed: int) -> str:
    """A digest of what decides what every stage finds: the code and vehicles of this project, the
    libraries, the equations and data of the helicopter, its name, by which the simulator is chosen,
    and the seed.
    """
    parts = (
        code_digest(),
        platform.python_version(),
        *(version(name) for name in LIBRARIES),
        repr((heli.vehicle.title, heli.vehicle.source, heli.vehicle.sections)),
        heli.rhs.serialize(),
        heli.flight_rhs.serialize(),
        repr((heli.governor, heli.density, heli.travel.tolist())),
        vehicle,
        str(seed),
    )
    return digest(parts)


def digest(parts: Iterable[str]) -> str:
    """Return the SHA-256 digest of these texts, one a line."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@cache
def code_digest(packages: tuple[str, ...] = PACKAGES) -> str:
    """Return a digest of every source file of the packages, and of the packaged vehicles."""
    root, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for package in packages:
        for path in sorted((root / package).rglob("*")):
            if path.suffix in (".py", ".c", ".h", ".toml"):
                digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()
