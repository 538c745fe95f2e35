"""Claims from JSON, NPZ or MAT files: the key `claim` says what is claimed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError
from synthesis.claims.document import AXIS, number, only, read_as, stacked
from synthesis.claims.lyapunov_claim import KINDS, LyapunovClaim
from synthesis.claims.region_claim import RegionClaim
from synthesis.claims.terminal_claim import TerminalClaim

BOUNDS = {"decay rate": "alpha", "l2 gain": "gamma"}
EVERY = (*KINDS, RegionClaim.kind, TerminalClaim.kind)


def read_claim(path: str | os.PathLike[str]) -> Any:
    """Return the claim of a file.

    Parameters
    ----------
    path : path
        A JSON, NPZ or MAT file with the key `claim`: "stability", "decay rate" (with `alpha`, 1/s),
        "l2 gain" (with `gamma`), each with `P` and perhaps `K`; "region of attraction" with `V` and
        `rho`; "terminal set" with `K`, and `P` and `level` or `H` and `h`, and perhaps `Q`, `R`.

    Returns
    -------
    LyapunovClaim, RegionClaim or TerminalClaim
        The claim, for `check`.

    Raises
    ------
    InputError
        For a damaged file, unknown keys, or values that are no claim.

    Examples
    --------
    >>> import json, pathlib
    >>> text = json.dumps({"claim": "decay rate", "alpha": 0.5, "P": [[1.0]]})
    >>> _ = pathlib.Path("claim.json").write_text(text)
    >>> read_claim("claim.json").sentence
    '|x(t)| <= c exp(-0.5 t) |x(0)|'
    """
    return read_as(path, claim_of)


def claim_of(content: Mapping[str, Any]) -> Any:
    """Return the claim of keys and values; see `read_claim`."""
    kind = content.get("claim")
    if kind == RegionClaim.kind:
        only(content, ("claim", "V", "rho"))
        return RegionClaim(_present(content, "V"), number(_present(content, "rho"), "rho"))
    if kind == TerminalClaim.kind:
        return _terminal(content)
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"claim: expected one of {', '.join(EVERY)}, got {kind!r:.60}")
    bound = BOUNDS.get(kind)
    only(content, ("claim", "P", "K", "p", AXIS, *([bound] if bound else [])))
    _present(content, "P")
    bounds: dict[str, Any] = {"bound": _number(content, bound)} if bound else {}
    p = content.get("p")
    matrices: dict[str, Any] = stacked(content, ("P", "K"))
    if p is not None:
        matrices["p"] = np.ravel(p)
    return LyapunovClaim(kind, **matrices, **bounds)


def _terminal(content: Mapping[str, Any]) -> TerminalClaim:
    names = ("K", "P", "H", "Q", "R")
    only(content, ("claim", "level", "h", *names))
    _present(content, "K")
    matrices = {name: np.atleast_2d(content[name]) for name in names
                if content.get(name) is not None}  # fmt: skip
    h = content.get("h")
    level = number(content.get("level"), "level")
    return TerminalClaim(**matrices, h=None if h is None else np.ravel(h), level=level)


def _number(content: Mapping[str, Any], name: str) -> float:
    given: Any = number(_present(content, name), name)
    try:
        return float(given)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected a number, got {content[name]!r:.60}") from None


def _present(content: Mapping[str, Any], name: str) -> Any:
    if content.get(name) is None:
        raise InputError(f"the key {name} is missing")
    return content[name]
