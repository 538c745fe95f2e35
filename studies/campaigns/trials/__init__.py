"""Trials by name: what a campaign can repeat without a line of code."""

from __future__ import annotations

import importlib
import os

from studies.campaigns.trial import Trial
from symheli.components import ALLOW_CODE
from symheli.errors import InputError, UnknownNameError

NAMES = ("identification", "flight", "control", "gain", "marks", "pays")
"""Names of the trials, each a module of this package."""


def trial(name: str, *, allow_code: bool = True) -> Trial:
    """Return the trial called `name`: one of `NAMES`, or a user-defined "module:NAME", whose module
    is imported with `allow_code`.

    Raises `InputError` if there is none.

    Examples
    --------
    >>> list(trial("gain").quantities)
    ['proven gain', 'frozen gain']
    """
    if ":" not in name:
        if name not in NAMES:
            raise UnknownNameError("trial", name, (*NAMES, "module:NAME"))
        return importlib.import_module(f"{__name__}.{name}").TRIAL
    module, _, attribute = name.partition(":")
    if not (allow_code or os.environ.get(ALLOW_CODE) == "1"):
        raise InputError(
            f"trial {name!r}: this campaign would import and run the Python module {module}. Read"
            " it; to run it, add --allow-code"
        )
    try:
        found = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"trial {name!r} cannot be imported ({error}); its folder has to be on PYTHONPATH"
        ) from error
    if not isinstance(found, Trial):
        raise InputError(f"{name} is no Trial, but a {type(found).__name__}")
    return found
