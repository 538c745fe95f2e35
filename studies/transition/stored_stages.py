"""Finished stages of a study on disk, each whole or not at all, for a run that goes on where
another stopped.

A stage is stored as a Python pickle below a line with the key of what it was computed from and the
digest of its bytes. The key covers what the stage reads of the effort and the keys of the stages it
needs: where one entry changes, the stages that it reaches are computed again, and no others.
Pickles run code when they are read: resume only your own folders.
"""

from __future__ import annotations

import contextlib
import hashlib
import pickle
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from studies.transition.configuration import Configuration
from studies.transition.effort import Effort
from studies.transition.stages import Stage
from symheli import Helicopter
from symheli.errors import SymheliError
from symheli.values.whole_files import write_bytes

FORMAT = "symheli stage 1"
STAGES = "stages"
"""Folder of the stored stages, in that of the run."""
PACKAGES = ("symheli", "identification", "synthesis", "studies")
LIBRARIES = ("casadi", "numpy", "scipy", "cvxpy", "clarabel")


class NotUsable(SymheliError):
    """A stage that is stored and cannot be taken; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """The result of a stage, and the seconds it took to compute."""

    result: Any
    seconds: float


@dataclass(frozen=True)
class StoredStages:
    """The stages in `folder` that were computed from what the key of each stands for."""

    folder: Path
    keys: Mapping[str, str]

    def path(self, name: str) -> Path:
        """Where the stage is stored."""
        return self.folder / f"{name}.stage"

    def save(self, name: str, stored: Stored) -> Path:
        """Store a stage, in place of an older one; see `whole_files.write_bytes`."""
        return _write(self.path(name), self.keys[name], stored)

    def load(self, name: str, kind: type) -> Stored | None:
        """A stored stage whose result is a `kind`; None where none is stored.

        Raises `NotUsable` for one that another version, vehicle, effort or seed has left, and for
        one that is damaged.
        """
        return _read(self.path(name), self.keys[name], kind)

    def state(self, name: str, kind: type) -> str:
        """In a few words: whether the stage is there and can be taken, or how far it is."""
        try:
            if self.load(name, kind) is not None:
                return "stored"
        except NotUsable as reason:
            return "damaged" if "damaged" in str(reason) else "of another run"
        answers = len(list(self.folder.glob(f"{name}-*.stage")))
        return f"{answers} answers stored" if answers else "absent"

    def answers(self, stage: str) -> StoredAnswers:
        """Where the answers to the questions of a stage are stored until it is finished."""
        return StoredAnswers(self.folder, stage, self.keys[stage])


@dataclass(frozen=True)
class StoredAnswers:
    """Answers to the questions of a stage that is not finished, each stored as it is found."""

    folder: Path
    stage: str
    key: str

    def save(self, i: int, answer: tuple[float, Any]) -> Path:
        """Store the answer to question i, found in so many seconds."""
        seconds, found = answer
        return _write(self._path(i), self.key, Stored(result=found, seconds=seconds))

    def load(self, count: int) -> dict[int, tuple[float, Any]]:
        """Those that are there and whole, of `count`."""
        known = {}
        for i in range(count):
            with contextlib.suppress(NotUsable):
                if (answer := _read(self._path(i), self.key, list)) is not None:
                    known[i] = (answer.seconds, answer.result)
        return known

    def clear(self) -> None:
        """Remove them: the stage is stored."""
        for path in self.folder.glob(f"{self.stage}-*.stage"):
            path.unlink(missing_ok=True)

    def _path(self, i: int) -> Path:
        return self.folder / f"{self.stage}-{i}.stage"


def _write(path: Path, key: str, stored: Stored) -> Path:
    content = pickle.dumps(stored)
    head = f"{FORMAT} {key} {hashlib.sha256(content).hexdigest()}\n"
    return write_bytes(path, head.encode() + content)


def _read(path: Path, key: str, kind: type) -> Stored | None:
    if not path.is_file():
        return None
    head, _, content = path.read_bytes().partition(b"\n")
    words = head.decode("utf-8", "replace").rsplit(" ", 2)
    if len(words) != 3 or words[0] != FORMAT:
        raise NotUsable(f"{path} is damaged: it is no stored stage")
    if words[1] != key:
        raise NotUsable(f"{path} is of another version, vehicle, effort or seed")
    if words[2] != hashlib.sha256(content).hexdigest():
        raise NotUsable(f"{path} is damaged: its content is not what was written")
    stored = pickle.loads(content)
    if not (isinstance(stored, Stored) and isinstance(stored.result, kind)):
        raise NotUsable(f"{path} is damaged: it holds another stage")
    return stored


def stored_stages(
    configuration: Configuration, stages: Iterable[Stage], heli: Helicopter | None = None
) -> StoredStages:
    """Those in the folder of a run that were computed from what it asks for."""
    content = content_key(heli or loaded(configuration), configuration.vehicle, configuration.seed)
    keys = stage_keys(stages, content, configuration.effort)
    return StoredStages(configuration.out / STAGES, keys)


def loaded(configuration: Configuration) -> Helicopter:
    """The helicopter of a run."""
    return Helicopter.load(configuration.vehicle, governor="ideal")


def stage_keys(stages: Iterable[Stage], content: str, effort: Effort) -> dict[str, str]:
    """By stage, in order, a digest of all that decides what it finds: the content that all share,
    what the stage reads of the effort, and the keys of the stages it needs.
    """
    keys: dict[str, str] = {}
    for stage in stages:
        own = [f"{name} = {getattr(effort, name)!r}" for name in sorted(stage.reads)]
        before = [keys[name] for name in stage.needs]
        keys[stage.name] = _digest((content, stage.name, *own, *before))
    return keys


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
    return _digest(parts)


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@cache
def code_digest() -> str:
    """Of every source file of the four packages, and of the packaged vehicles."""
    root, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.suffix in (".py", ".c", ".h", ".toml"):
                digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()
