"""Modules of this project that one call of `synthesis.l2_gain` enters: `python -m
evidence.modules_of_a_call`.
"""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

from symheli.lpv import LPVStateSpace, Scheduling
from synthesis import l2_gain

PACKAGES = ("symheli", "synthesis")


def entered(**options: Any) -> list[str]:
    """Names of the modules a function of which runs, for a lag that slows down with p."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    l2_gain(lag, **options)  # what is imported late is imported now
    found: set[str] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            found.add(frame.f_globals.get("__name__", ""))

    sys.setprofile(note)
    l2_gain(lag, **options)
    sys.setprofile(None)
    return sorted(name for name in found if name.split(".")[0] in PACKAGES)


if __name__ == "__main__":
    for what, options in (("with trajectories", {}), ("without", {"search": None})):
        names = entered(**options)
        print(f"{len(names)} modules, {what}:", *names, sep="\n  ")
