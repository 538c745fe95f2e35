"""Plants from JSON, NPZ or MAT files: the keys say what kind of plant it is."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError
from synthesis.claims.document import AXIS, number, only, read_as, stacked
from synthesis.claims.plants import (
    GridPlant,
    LimitedPlant,
    PolynomialPlant,
    VertexPlant,
    box_limits,
)

SYSTEM = ("A", "B", "C", "D", "dt", AXIS)
LIMITS = ("H_x", "h_x", "H_u", "h_u", "x_max", "u_max")


def read_plant(path: str | os.PathLike[str]) -> Any:
    """Return the plant of a file.

    Parameters
    ----------
    path : path
        A JSON, NPZ or MAT file with the keys of one plant: `states` and `f` of polynomials; `A`,
        `B` and limits `H_x`, `h_x`, `H_u`, `h_u` or `x_max`, `u_max` of a plant with limits; `p`,
        `rate`, `A`, `B`, `C`, `D`, `dt` of a grid; without p of vertices. Stacks are N x n x n or n
        x n x N; where both fit, `axis` says "first" or "last".

    Returns
    -------
    VertexPlant, GridPlant, PolynomialPlant or LimitedPlant
        The plant, for `check`.

    Raises
    ------
    InputError
        For a damaged file, unknown keys, or shapes that do not fit.

    Examples
    --------
    >>> import json, pathlib
    >>> text = json.dumps({"states": ["x"], "f": ["-x + x^3"]})
    >>> _ = pathlib.Path("plant.json").write_text(text)
    >>> print(*read_plant("plant.json").hypotheses)
    x' = 1*x^3 - 1*x
    """
    return read_as(path, plant_of)


def plant_of(content: Mapping[str, Any]) -> Any:
    """Return the plant of keys and values; see `read_plant`."""
    if "f" in content:
        only(content, ("states", "f"))
        return PolynomialPlant(content.get("states", ()), content["f"])
    if "A" not in content:
        raise InputError("expected the key A of a linear plant, or states and f of polynomials")
    if any(name in content for name in LIMITS):
        return _limited(content)
    grid = "p" in content
    only(content, (*SYSTEM, *(("p", "rate") if grid else ())))
    matrices = stacked(content, ("A", "B", "C", "D"))
    dt = number(content.get("dt"), "dt")
    if not grid:
        return VertexPlant(**matrices, dt=dt)
    rate = number(content.get("rate", math.inf), "rate")
    try:
        rate = math.inf if rate is None else float(rate)
    except (TypeError, ValueError):
        raise InputError(f'rate: expected a number or "inf", got {rate!r:.60}') from None
    return GridPlant(p=np.ravel(content["p"]), rate=rate, dt=dt, **matrices)


def _limited(content: Mapping[str, Any]) -> LimitedPlant:
    only(content, ("A", "B", AXIS, *LIMITS))
    matrices = stacked(content, ("A", "B"))
    if set(matrices) != {"A", "B"}:
        raise InputError("a plant with limits needs A and B")
    limits = {name: content[name] for name in LIMITS[:4] if content.get(name) is not None}
    n, m = matrices["A"].shape[-1], matrices["B"].shape[-1]
    for name, size in (("x", n), ("u", m)):
        if content.get(f"{name}_max") is None:
            continue
        if f"H_{name}" in limits:
            raise InputError(f"give H_{name} and h_{name}, or {name}_max, not both")
        most = np.broadcast_to(np.asarray(content[f"{name}_max"], dtype=float).ravel(), (size,))
        own = box_limits(most, most)
        limits |= {f"H_{name}": own["H_x"], f"h_{name}": own["h_x"]}
    return LimitedPlant(**matrices, **limits)
