"""Families of linear models as plain files that other programs can write too, JSON or NPZ.

A JSON file is one object:

    schema    "symheli linear models"
    version   1
    axes      [{"name": "airspeed", "unit": "m/s", "values": [0, 5, 10]}], one entry an axis
    states    {"v": "m/s", "p": "rad/s"}: names with units, in the order of the rows
    inputs    {"d_lat": "rad"}
    outputs   the same; left out: the states
    A, B      lists (values of each axis..., rows, columns), in these units
    C, D      the same; left out: the outputs are the states
    dt        sample period, s; left out or null in continuous time
    x0, u0    states and inputs at the trims, (values of each axis..., states), where they are known
    xdot0     rates of the states there; left out: zero
    airspeed0 airspeeds of the trims, m/s, (values of each axis...), where they have one and no axis
              is the airspeed in m/s
    kinks     {"stall": [7.5]}: airspeeds at which a family has a corner; may be left out

An NPZ file holds the same as arrays: A, B, C, D, dt, x0, u0, xdot0, airspeed0; `axes`, `states`,
`inputs` and `outputs` are arrays of names with `axes_units`, `states_units` ... beside them, and
the values of the axes are `values_0`, `values_1`, ...; `kinks` are names, with the airspeeds
`kinks_at`.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_family import AIRSPEED, LinearFamily
from symheli.lpv.linear_models import LinearModels
from symheli.values.arrays import Array, frozen
from symheli.values.named_vector import NamedVector
from symheli.values.operating_point import OperatingPoint
from symheli.values.operating_points import OperatingPoints
from symheli.values.signal import Signal
from symheli.values.units import ratio
from symheli.values.whole_files import write_bytes, write_text

SCHEMA, VERSION = "symheli linear models", 1
GROUPS = ("axes", "states", "inputs", "outputs")


def write(content: LinearFamily, path: str | os.PathLike[str]) -> Path:
    """Write a file, JSON or NPZ by the ending of its name; see `LinearFamily.save`."""
    path, models = Path(path), content.models
    arrays = {name: getattr(models, name) for name in "ABCD"}
    if models.points:
        arrays |= {
            "x0": models.points.state(models.states),
            "u0": models.points.input(models.inputs),
            "xdot0": models.points.rate(models.states),
        }
        speeds = [point.airspeed for point in models.points]
        if ("airspeed", "m/s") not in [(s, s.unit) for s in content.axes] and None not in speeds:
            arrays["airspeed0"] = np.array(speeds, float)
    arrays = {name: a.reshape(*content.shape, *a.shape[1:]) for name, a in arrays.items()}
    names = {"axes": content.axes} | {g: getattr(models, g) for g in GROUPS[1:]}
    match path.suffix:
        case ".json":
            return write_text(path, _json(content, arrays, names))
        case ".npz":
            buffer = io.BytesIO()
            np.savez(buffer, **arrays, **_labels(content, names))
            return write_bytes(path, buffer.getvalue())
    raise InputError(f"{path}: expected a name that ends in .json or .npz")


def _json(
    content: LinearFamily, arrays: dict[str, Array], names: Mapping[str, Sequence[Signal]]
) -> str:
    axes = zip(content.axes, content.values, strict=True)
    whole = {
        "schema": SCHEMA,
        "version": VERSION,
        "axes": [{"name": str(s), "unit": s.unit, "values": v.tolist()} for s, v in axes],
        **{g: {str(s): s.unit for s in names[g]} for g in GROUPS[1:]},
        "dt": content.models.dt,
        **{name: a.tolist() for name, a in arrays.items()},
        "kinks": {name: list(places) for name, places in content.kinks.items()},
    }
    return json.dumps(whole, indent=1, allow_nan=False) + "\n"


def _labels(content: LinearFamily, names: Mapping[str, Sequence[Signal]]) -> dict[str, Any]:
    labels = {g: np.array([str(s) for s in names[g]]) for g in GROUPS}
    labels |= {f"{g}_units": np.array([s.unit for s in names[g]]) for g in GROUPS}
    values = {f"values_{i}": v for i, v in enumerate(content.values)}
    dt = content.models.dt
    kinks = [(name, at) for name, places in content.kinks.items() for at in places]
    if kinks:
        labels |= {"kinks": np.array([n for n, _ in kinks]), "kinks_at": [at for _, at in kinks]}
    return labels | values | {"schema": SCHEMA, "version": VERSION} | ({"dt": dt} if dt else {})


def read(path: str | os.PathLike[str]) -> LinearFamily:
    """Read a file; raise `InputError` if it is not a file of models or lacks a part."""
    path = Path(path)
    try:
        given = _from_npz(path) if path.suffix == ".npz" else _from_json(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, EOFError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        if isinstance(error, InputError):
            raise InputError(f"{path}: {error}") from None
        raise InputError(f"{path}: not a whole file of {SCHEMA!r} ({error})") from None
    try:
        return _content(given)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _from_json(path: Path) -> dict[str, Any]:
    whole = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(whole, dict) or whole.get("schema") != SCHEMA:
        found = whole.get("schema") if isinstance(whole, dict) else type(whole).__name__
        raise InputError(f"expected a file of {SCHEMA!r}, got {found!r:.60}")
    if not isinstance(whole.get("axes"), list):
        raise InputError("axes: expected a list of {name, unit, values}")
    for axis in whole["axes"]:
        if not isinstance(axis, dict) or not {"name", "values"} <= axis.keys():
            raise InputError(f"axes: expected {{name, unit, values}}, got {axis!r:.60}")
    axes = whole["axes"]
    return whole | {
        "axes": {axis["name"]: axis.get("unit") for axis in axes},
        "values": [axis["values"] for axis in axes],
    }


def _from_npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as file:
        whole = {name: file[name] for name in file.files}
    if str(whole.get("schema")) != SCHEMA:
        raise InputError(f"expected a file of {SCHEMA!r}, got {str(whole.get('schema'))!r:.60}")
    for group in GROUPS:
        if group in whole:
            names = [str(n) for n in whole[group]]
            units = whole.get(f"{group}_units", [None] * len(names))
            pairs = zip(names, units, strict=True)
            whole[group] = {n: None if u is None else str(u) for n, u in pairs}
    count = len(whole.get("axes", ()))
    whole["values"] = [whole[f"values_{i}"] for i in range(count) if f"values_{i}" in whole]
    kinks: dict[str, list[float]] = {}
    for name, at in zip(whole.pop("kinks", ()), whole.pop("kinks_at", ()), strict=True):
        kinks.setdefault(str(name), []).append(float(at))
    return whole | {"kinks": kinks, "version": int(whole.get("version", 0))}


def _content(given: dict[str, Any]) -> LinearFamily:
    if given.get("version") != VERSION:
        raise InputError(f"version {given.get('version')!r} of the format, this reads {VERSION}")
    needed = {"axes", "states", "inputs", "A", "B"}
    if missing := needed - given.keys():
        raise InputError(f"{', '.join(sorted(missing))}: missing; see symheli.lpv.family_file")
    axes, states, inputs = (_signals(g, given[g]) for g in ("axes", "states", "inputs"))
    outputs = _signals("outputs", given["outputs"]) if "outputs" in given else states
    pairs = zip(axes, given["values"], strict=False)
    values = tuple(frozen(v, f"values of {s}", (None,)) for s, v in pairs)
    if not axes or len(values) != len(axes):
        raise InputError(f"expected values for each of the axes {', '.join(axes) or '(none)'}")
    shape, count = tuple(map(len, values)), math.prod(map(len, values))
    nx, nu, ny = len(states), len(inputs), len(outputs)

    def stacked(name: str, *rest: int) -> Array:
        return frozen(given[name], name, (*shape, *rest)).reshape(count, *rest)

    if "C" not in given and outputs != states:
        raise InputError("C: missing, and the outputs are not the states")
    models = LinearModels(
        stacked("A", nx, nx),
        stacked("B", nx, nu),
        stacked("C", ny, nx) if "C" in given else np.tile(np.eye(nx), (count, 1, 1)),
        stacked("D", ny, nu) if "D" in given else np.zeros((count, ny, nu)),
        *(states, inputs, outputs),
        None if given.get("dt") is None else float(given["dt"]),
    )
    if "x0" in given and "u0" in given:
        x, u = stacked("x0", nx), stacked("u0", nu)
        airspeeds = (
            stacked("airspeed0").tolist() if "airspeed0" in given else _airspeeds(axes, values)
        )
        xdot = stacked("xdot0", nx) if "xdot0" in given else np.zeros((count, nx))
        models = LinearModels(
            *(models.A, models.B, models.C, models.D, states, inputs, outputs, models.dt),
            OperatingPoints.of(
                [
                    OperatingPoint(
                        NamedVector(states, x0),
                        NamedVector(inputs, u0),
                        NamedVector(states, rate),
                        speed,
                    )
                    for x0, u0, rate, speed in zip(x, u, xdot, airspeeds, strict=True)
                ]
            ),
        )
    kinks = given.get("kinks") or {}
    if not isinstance(kinks, dict):
        raise InputError(f"kinks: expected {{name: [airspeeds]}}, got {kinks!r:.60}")
    return LinearFamily(axes, values, models, {k: tuple(map(float, v)) for k, v in kinks.items()})


def _airspeeds(axes: tuple[Signal, ...], values: tuple[Array, ...]) -> list[float] | list[None]:
    """Return the airspeed of every trim, m/s, from the axis; None where there is none."""
    size = next((ratio(s.unit, AIRSPEED.unit) for s in axes if s == AIRSPEED), None)
    if size is None:
        return [None] * math.prod(map(len, values))
    return (size * np.meshgrid(*values, indexing="ij")[axes.index(AIRSPEED)]).ravel().tolist()


def _signals(group: str, given: Any) -> tuple[Signal, ...]:
    """{name: unit}, or a list of names whose units are known."""
    if isinstance(given, dict) and all(isinstance(u, str | None) for u in given.values()):
        return tuple(Signal(name, unit) for name, unit in given.items())
    if isinstance(given, list) and all(isinstance(name, str) for name in given):
        return tuple(map(Signal, given))
    raise InputError(f"{group}: expected {{name: unit}}, got {given!r:.60}")
