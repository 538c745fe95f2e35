"""Keys of the stages of a run: a digest of all that decides what each finds."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from studies.setup.stored_stages import digest
from studies.transition.configuration import Configuration
from studies.transition.effort import Effort
from studies.transition.stages import Stage
from symheli import Helicopter
from symheli.errors import InputError

FILES = ("tubes",)
"""Options that name files."""


def loaded(configuration: Configuration) -> Helicopter:
    """The helicopter of a run."""
    return Helicopter.load(configuration.vehicle, governor="ideal")


def stage_keys(stages: Iterable[Stage], content: str, effort: Effort) -> dict[str, str]:
    """By stage, in order, a digest of all that decides what it finds: the content that all share,
    what the stage reads of the effort, and the keys of the stages it needs.
    """
    keys: dict[str, str] = {}
    for stage in stages:
        own = [f"{name} = {_value(effort, name)}" for name in sorted(stage.reads)]
        before = [keys[name] for name in stage.needs]
        keys[stage.name] = digest((content, stage.name, *own, *before))
    return keys


def _value(effort: Effort, name: str) -> str:
    """An option of the effort, of one that names files what these hold; raises `InputError` for one
    that cannot be read.
    """
    value = getattr(effort, name)
    if name not in FILES:
        return repr(value)
    try:
        return repr([hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in value])
    except OSError as error:
        raise InputError(f"{name}: {error.filename} cannot be read: {error.strerror}") from error
