"""Stack level of the user's code, to which a warning refers."""

from __future__ import annotations

import sys


def level_of_caller() -> int:
    """`stacklevel` that makes `warnings.warn` name the line that called this package, however
    many of its own functions lie between.
    """
    package, level, frame = __name__.partition(".")[0], 1, sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        level, frame = level + 1, frame.f_back
    return level
