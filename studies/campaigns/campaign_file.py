"""A campaign as a TOML file.

trial = "identification"
draws = 20
paired = ["order"]

[grid]
order = [2, 3, 4]

[random]
noise_db = { low = 20.0, high = 40.0 }   # uniform; { mean = ..., deviation = ... } is normal

[fixed]
axis = "lateral"
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from studies.campaigns.campaign import Campaign, Normal, Uniform
from studies.campaigns.trials import trial
from symheli.errors import InputError, UnknownNameError

KEYS = ("trial", "grid", "draws", "random", "paired", "fixed", "root")
TABLES = ("grid", "random", "fixed")
KINDS = {frozenset({"low", "high"}): Uniform, frozenset({"mean", "deviation"}): Normal}


def read_campaign(path: Path, *, allow_code: bool = False) -> Campaign:
    """The campaign a file declares; see `Campaign` for what its entries mean. A trial
    "module:NAME" is imported only with `allow_code`.

    Raises `InputError`, which names the file, where it cannot be read or does not fit.
    """
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8"))
        return campaign_of(entries, allow_code=allow_code)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def campaign_of(entries: Mapping[str, Any], *, allow_code: bool = False) -> Campaign:
    """The campaign that the entries of a file declare.

    Examples
    --------
    >>> entries = {"trial": "identification", "grid": {"order": [2, 3]}, "draws": 5}
    >>> len(campaign_of(entries).cases)
    10
    """
    for name in entries:
        if name not in KEYS:
            raise UnknownNameError("entry of a campaign", name, KEYS)
    if not isinstance(entries.get("trial"), str):
        raise InputError('the trial is missing; add one, such as trial = "identification"')
    given: dict[str, Any] = {name: value for name, value in entries.items() if name != "trial"}
    for name in TABLES:
        if not isinstance(given.get(name, {}), Mapping):
            raise InputError(f"{name} is a table [{name}], got {given[name]!r}")
    for name, values in given.get("grid", {}).items():
        if not isinstance(values, list):
            raise InputError(f"the axis {name} of the grid is a list of values, got {values!r}")
    random = {name: _drawn(name, what) for name, what in given.get("random", {}).items()}
    given["random"] = random
    return Campaign(trial(entries["trial"], allow_code=allow_code), **given)


def _drawn(name: str, what: Any) -> Normal | Uniform:
    kind = KINDS.get(frozenset(what)) if isinstance(what, Mapping) else None
    if kind is None or not all(type(v) in (int, float) for v in what.values()):
        raise InputError(
            f"{name} is drawn evenly, {{ low = ..., high = ... }}, or normally, {{ mean = ...,"
            f" deviation = ... }}; got {what!r}"
        )
    return kind(**{key: float(value) for key, value in what.items()})
