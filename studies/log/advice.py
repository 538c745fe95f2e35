"""Advice of the libraries in the words of the command line: a flag in place of an argument."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from symheli.errors import SymheliError

FLAGS = {
    "give delay=0": "give --delay 0",
    r'InstrumentalVariables(("name", ...)), the external excitation': (
        "--instruments A,B, the external excitation"
    ),
    'method "iv" needs its instruments': "--method iv needs its instruments",
    'needs instruments=("name", ...), the external': "needs --instruments A,B, the external",
    'method "iv" is the better one': "--method iv is the better one",
    "name more signals, or change the window or lags of LaggedSignals": (
        "name more --instruments, or lower --na, --nb or --degree"
    ),
    "name more instruments, widen their window, or lower the order or the degree": (
        "name more --instruments, or lower --na, --nb or --degree"
    ),
    "name more instruments or widen their window": "name more --instruments",
    "or lower na, nb or the size of the basis": "or lower --na, --nb or --degree",
    "or lower the orders": "or lower --na, --nb or --degree",
    "allow more evaluations, or fit a smaller structure": "lower --na, --nb or --degree",
    "schedule on a command, or leave offset_rate out and score with hold_p=True": (
        "schedule on a command, or leave the moving trim out: --offset-rate no"
    ),
    'schedule on a command, or leave scheduling_at="now" out and score with hold_p=True': (
        "schedule on a command, or leave --scheduling-at now out"
    ),
    'leave offset_rate out and take scheduling_at="lag", or schedule on a command': (
        "--offset-rate no with --scheduling-at lag, or schedule on a command"
    ),
    "record longer, or use fewer lags": "record longer",
}
"""{what a library advises: the same in flags of `symheli identify`}."""


def in_flags(text: str) -> str:
    """The text with advice in flags."""
    for words, flags in FLAGS.items():
        text = text.replace(words, flags)
    return re.sub(r"resample first: record\.resample\((\S+)\)", r"--dt \1", text)


@contextmanager
def advised_in_flags() -> Iterator[None]:
    """Errors and warnings of the work within advise in flags."""
    shown: Any = warnings.showwarning

    def show(message: Any, *where: Any, **more: Any) -> None:
        shown(type(message)(in_flags(str(message))), *where, **more)

    warnings.showwarning = show
    try:
        yield
    except SymheliError as error:
        if error.args:
            error.args = (in_flags(str(error)), *error.args[1:])
        raise
    finally:
        warnings.showwarning = shown
