"""Components of the airframe, one file each: pure functions from motion and controls to forces.

A part is found by the name of its file: a new one is a new file that defines `COMPONENT`, here or
beside the vehicle file, and a section in the vehicle file (docs/vehicles.md has an example).
References: [G15] V. Gavrilets, "Dynamic Model for a Miniature Aerobatic Helicopter", Handbook of
Unmanned Aerial Vehicles, Springer 2015.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import pkgutil
from pathlib import Path

from symheli.codegen.symbolic import unnamed
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry
from symheli.errors import InputError, UnknownNameError

ALLOW_CODE = "SYMHELI_ALLOW_CODE"
"""Environment variable: 1 lets vehicle files run the Python files that they name as parts."""

__all__ = ["AirMotion", "Component", "Effect", "Entry", "Flow", "find", "packaged", "unnamed"]


def find(name: str, folder: Path | None = None, *, allow_code: bool = False) -> Component:
    """The component of the packaged file `name`, or of a user's "./name.py" relative to `folder`.

    That file is run, where `allow_code` or the environment variable SYMHELI_ALLOW_CODE=1 says so.
    Raises `UnknownNameError`, `InputError`.
    """
    if name.endswith(".py"):
        path = (folder or Path()) / name
        if not path.is_file():
            raise InputError(f"no component file at {path}")
        if not (allow_code or os.environ.get(ALLOW_CODE) == "1"):
            raise InputError(
                f"loading this vehicle would run the Python file {path}. Read it; to run it, add"
                " --allow-code on the command line, allow_code=True to Helicopter.load, or set"
                f" {ALLOW_CODE}=1"
            )
        return _from_file(path)
    if name not in packaged():
        raise UnknownNameError("component", name, packaged())
    return importlib.import_module(f"{__name__}.{name}").COMPONENT


def packaged() -> list[str]:
    """Names of the packaged components."""
    shared = ("component", "entry", "rotor")
    return [m.name for m in pkgutil.iter_modules(__path__) if m.name not in shared]


def _from_file(path: Path) -> Component:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None  # noqa: S101, PT018  a .py file has both
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(
            f"component file {path} does not run: {type(error).__name__}: {error}"
        ) from error
    component = getattr(module, "COMPONENT", None)
    if not isinstance(component, Component):
        raise InputError(
            f"component file {path} must define COMPONENT = symheli.components.Component(...), got"
            f" {component!r:.80}"
        )
    return component
