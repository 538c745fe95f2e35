"""Trials by name: what a campaign can repeat without a line of code."""

from __future__ import annotations

import importlib

from studies.campaigns.trial import Trial
from symheli.errors import InputError, UnknownNameError

NAMES = ("identification", "flight", "control", "gain", "marks", "pays")
"""Names of the trials, each a module of this package."""


def trial(name: str) -> Trial:
    """Return the trial called `name`: one of `NAMES`, or a user-defined "module:NAME".

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
    try:
        found = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"trial {name!r} cannot be imported ({error}); its folder has to be on PYTHONPATH"
        ) from error
    if not isinstance(found, Trial):
        raise InputError(f"{name} is no Trial, but a {type(found).__name__}")
    return found
