"""Signals of saved models, and the parts of MATLAB files that identified models share."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symheli.lpv import Polynomial, Product
from symheli.lpv.bases import FunctionSpace
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.whole_files import write_bytes


def signals_of(names: tuple[str, ...], units: dict[str, str]) -> tuple[Signal, ...]:
    """Names with their units."""
    return tuple(Signal(n, units[n]) for n in names)


def write_mat(path: str | os.PathLike[str], content: Mapping[str, Any]) -> Path:
    """Write variables as a MATLAB file (version 5)."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, dict(content))
    return write_bytes(path, buffer.getvalue())


def cells(**groups: Sequence[Signal]) -> dict[str, Array]:
    """Return names and units of groups of signals as cell arrays: outputs, outputs_units, .."""
    return {
        f"{name}{ending}": np.array([text(s) for s in group], dtype=object)
        for name, group in groups.items()
        for ending, text in (("", str), ("_units", lambda s: s.unit))
    }


def powers_of(basis: FunctionSpace) -> Array | None:
    """(functions, parameters) powers of p, None where the basis is not made of polynomials."""
    if isinstance(basis, Polynomial):
        return np.arange(basis.size, dtype=float)[:, None]
    if isinstance(basis, Product) and all(isinstance(f, Polynomial) for f in basis.factors):
        return np.array(basis.indices, dtype=float)
    return None
