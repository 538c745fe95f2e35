"""A controller in a table as a file: JSON with a schema and a digest, every number exact."""

from __future__ import annotations

import math
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from symheli.flight.parameter_monitor import ParameterMonitor
from symheli.flight.table_controller import TableController
from symheli.values import Signal, plain_file

SCHEMA = "symheli table controller"
GROUPS = ("states", "inputs", "outputs")


def save(table: TableController, path: str | os.PathLike[str]) -> Path:
    """Write a table, without what it keeps in flight; see `TableController.save`."""
    content = {
        "knots": table.knots.astype(float).tolist(),
        "matrices": table.matrices.astype(float).ravel().tolist(),
        **{group: [[str(s), s.unit] for s in getattr(table, group)] for group in GROUPS},
        "dt": table.dt,
        "integrates": table.integrates,
        "limits": table.limits,
        "rate": table.rate,
        "fade": table.fade,
        "monitor": asdict(table.monitor),
        "parameter": [str(table.parameter), table.parameter.unit],
        "follow": table.follow,
        "misfit": table.misfit,
    }
    return plain_file.write(path, SCHEMA, _written(content))


def load(path: str | os.PathLike[str]) -> TableController:
    """The table in a file; see `TableController.load`."""
    content = _read(plain_file.read(path, SCHEMA))
    try:
        groups: dict[str, Any] = {
            g: tuple(Signal(name, unit) for name, unit in content.pop(g)) for g in GROUPS
        }
        n, ny = len(groups["states"]), len(groups["outputs"])
        shape = (len(content["knots"]), n + ny, n + len(groups["inputs"]) + ny)
        content["matrices"] = np.reshape(content["matrices"], shape)
        monitor = content.pop("airspeed" if "airspeed" in content else "monitor")
        content["monitor"] = ParameterMonitor(**monitor)
        if "parameter" in content:  # files that say none are over airspeed
            content["parameter"] = Signal(*content["parameter"])
        return TableController(**content, **groups)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise plain_file.incomplete(path, error) from error


def _written(value: Any) -> Any:
    """Return infinity, for which JSON has no number, as a word."""
    if isinstance(value, dict):
        return {key: _written(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_written(one) for one in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _read(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _read(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_read(one) for one in value]
    return float(value) if value in ("inf", "-inf") else value
