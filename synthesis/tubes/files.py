"""Loops and multipliers of a tube as JSON holds them."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from symheli import Helicopter
from symheli.airframe.vehicle import load_vehicle
from symheli.airframe.written import as_toml
from symheli.values.arrays import Array
from synthesis.tubes.deviations import MOST_SEGMENTS, SEGMENTS, Deviations
from synthesis.tubes.enclosure import equations
from synthesis.tubes.equipment import LoopEquipment
from synthesis.tubes.inequality import Multipliers
from synthesis.tubes.motions import Motions
from synthesis.tubes.reference import Reference

ARRAYS = ("airspeeds", "steady", "jerk", "snap", "gain")
"""Fields of `Reference` that are stored as they are."""


def numbers(values: Any, *shape: int) -> Array:
    """Finite numbers of this shape; raises `ValueError` for others."""
    read = np.asarray(values, float)
    if not read.size and 0 in shape:
        read = read.reshape(shape)
    if read.shape != shape or not np.all(np.isfinite(read)):
        raise ValueError(f"expected finite numbers of shape {shape}, got {read.shape}")
    return read


def written_loop(loop: Deviations) -> dict[str, Any]:
    """The equations, reference and feedback of a loop, and its gusts."""
    model, reference = loop.model, loop.reference
    own = _written_motions(reference) if isinstance(reference, Motions) else _written(reference)
    if isinstance(model, Helicopter):
        own |= {
            "name": model.vehicle.name,
            "vehicle": as_toml(model.vehicle),
            "density": model.density,
            "governor": model.governor,
            "smoothing": model.smoothing,
            "printed": sorted(model.printed),
        }
    else:
        own |= {"model": equations.written(model)}
    return {**own, "gust": loop.gust, "segments": loop.segments}


def read_loop(content: Mapping[str, Any]) -> Deviations:
    """The loop so written; raises `ValueError` for damaged values."""
    model, reference = _read_flight(content) if "vehicle" in content else _read_model(content)
    gust = float(numbers(content["gust"]))
    if not gust >= 0:
        raise ValueError(f"gust: expected the size of the gusts, >= 0, got {gust:g}")
    segments = content.get("segments", SEGMENTS)
    if type(segments) is not int or not 1 <= segments <= MOST_SEGMENTS:
        raise ValueError(f"segments: expected a whole number, got {segments!r:.40}")
    return Deviations(model, reference, gust, segments)


def _written(r: Reference) -> dict[str, Any]:
    limits = [limit if math.isfinite(limit) else None for limit in r.limits]
    arrays = {name: getattr(r, name).tolist() for name in ARRAYS}
    return {"limits": limits, "equipment": r.equipment.written(), **arrays}


def _read_flight(content: Mapping[str, Any]) -> tuple[Helicopter, Reference]:
    with tempfile.TemporaryDirectory(prefix="symheli-") as folder:
        file = Path(folder) / f"{Path(str(content['name'])).name}.toml"
        file.write_text(content["vehicle"], encoding="utf-8")
        vehicle = load_vehicle(file)
    density, smoothing = float(content["density"]), float(content["smoothing"])
    heli = Helicopter(
        vehicle, content["governor"], density, frozenset(content["printed"]), smoothing
    )
    n, k = len(heli.states), len(content["airspeeds"])
    equipment = LoopEquipment.read(content["equipment"])
    powers, c = np.shape(content["steady"])[2], len(equipment.states)
    shapes = ((k,), (k, 2, powers, n + 4), (k, n + 4), (k, 4), (k, 4 + c, n + c))
    own = {name: numbers(content[name], *shape) for name, shape in zip(ARRAYS, shapes, strict=True)}
    if not (k > 0 and np.all(np.diff(own["airspeeds"]) > 0)):
        raise ValueError("the airspeeds do not increase")
    a, j, snap = (math.inf if limit is None else float(limit) for limit in content["limits"])
    if equipment.period and k > 1:
        raise ValueError("a sampled loop has one airspeed")
    return heli, Reference(
        **own, limits=(float(numbers(a)), float(numbers(j)), snap), equipment=equipment
    )


def _written_motions(r: Motions) -> dict[str, Any]:
    return {
        "reference": equations.written(r.reference),
        "schedule": None if r.schedule is None else r.schedule.tolist(),
        "rate": list(r.rate),
        "others": r.others.tolist(),
        "pieces": list(r.pieces),
        "gain": r.gain.tolist(),
        "states": list(r.states),
        "inputs": list(r.inputs),
    }


def _read_model(content: Mapping[str, Any]) -> tuple[Any, Motions]:
    model, reference = equations.read(content["model"]), equations.read(content["reference"])
    names = ("gain", "schedule", "rate", "others", "pieces", "states", "inputs")
    motions = Motions(reference, **{name: content[name] for name in names})
    n, k = len(motions.states), len(motions.inputs)
    if [model.size1_in(i) for i in range(2)] != [n, k] or model.size1_out(0) != n:
        raise ValueError("the model does not fit its motions")
    return model, motions


def written_multipliers(by: Multipliers) -> dict[str, Any]:
    """Multipliers by name."""
    return {name: np.asarray(m).tolist() for name, m in by._asdict().items()}


def read_multipliers(given: dict[str, Any], n: int) -> Multipliers:
    """Multipliers of a model with n states."""
    terms = np.asarray(given["terms"], float)
    return Multipliers(
        numbers(given["tube"], n, n),
        numbers(given["gust"], n, n),
        numbers(terms, *terms.shape),
        numbers(given["wind"], 1, 1),
        float(numbers(given["decay"])),
    )
