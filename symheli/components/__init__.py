"""The parts of the airframe, one file each: pure functions from motion and controls to forces.

A part is found by the name of its file: a new one is a new file that defines `COMPONENT`, and a section in a vehicle file.
References: [G15] V. Gavrilets, "Dynamic Model for a Miniature Aerobatic Helicopter", Handbook of Unmanned Aerial Vehicles,
Springer 2015.
"""

from __future__ import annotations

import importlib
import pkgutil

from symheli.components.component import Component, Effect, Flow, Motion
from symheli.errors import UnknownNameError

__all__ = ["Component", "Effect", "Flow", "Motion", "find"]


def find(name: str) -> Component:
    """The component defined by the file `name`; raises `UnknownNameError`."""
    known = [m.name for m in pkgutil.iter_modules(__path__) if m.name not in ("component", "rotor")]
    if name not in known:
        raise UnknownNameError("component", name, known)
    return importlib.import_module(f"{__name__}.{name}").COMPONENT
