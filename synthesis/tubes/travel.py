"""The proof that commands, blade pitch and servos stay within their limits on a tube."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import casadi
import numpy as np

from symheli import Helicopter
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from synthesis.tubes.deviations import CommandCell, Deviations
from synthesis.tubes.enclosure import enclose
from synthesis.tubes.inequality import MatrixSet
from synthesis.tubes.proof import is_within
from synthesis.tubes.reference import Reference

RAISED = 1 + 1e-9
"""Factor on bounds of rates that are computed in floating point, of some thousand roundings."""


class ControlRow(NamedTuple):
    """An output of the deviations, k (nodes, n), and which control of the reference it adds to."""

    name: str
    rows: Array
    control: int


def outputs(loop: Deviations) -> list[ControlRow]:
    """The commands as the servos receive them, and the blade pitch."""
    r = loop.reference
    if not isinstance(r, Reference):
        return []
    made = [("", r.closed[:, :4])]
    if r.equipment.bank is not None or r.sampled:
        made.append(("_command", r.equipment.commands(r.gain)))
    return [
        ControlRow(f"{u}{kind}", K[:, i], i)
        for kind, K in made
        for i, u in enumerate(map(str, loop.inputs))
    ]


def largest_controls(loop: Deviations, cells: Sequence[CommandCell]) -> Array:
    """Largest size of each of the reference's controls in each cell (cells, 4), rad, with and
    without what is added to the commands alone; rounded up.
    """
    r = cast(Reference, loop.reference)
    c = casadi.SX.sym("c", 1 + len(r.ranges) + len(r.whole))
    data = casadi.SX.sym("data", r.data.shape[1])
    both = casadi.horzcat(r.between(data, c)[2][:4], r.commands(data, c))
    function = casadi.Function("controls", [c, data], [casadi.vec(casadi.densify(both))])
    found = []
    for cell in cells:
        commands, own = loop.parts(cell, r.drift_parts)[2:]
        value = enclose(function, commands, own).value.interval.magnitude
        found.append(value.reshape(-1, 2, 4).max(axis=(0, 1)))
    return np.array(found)


def why_not_free(
    loop: Deviations, cells: Sequence[CommandCell], P: Array, over: Sequence[Any]
) -> str:
    """Empty where every command and blade pitch is proven to stay within its travel, in rational
    arithmetic, and no servo's rate limit is reached; else what may not.

    over: the cells' sets of F with their factors, for the rates.
    """
    if not isinstance(loop.model, Helicopter) or not isinstance(loop.reference, Reference):
        return ""
    most, servos = largest_controls(loop, cells), loop.reference.equipment.actuation.servos or {}
    for row in outputs(loop):
        rows = np.broadcast_to(row.rows, (len(P), row.rows.shape[-1]))
        for cell, own in zip(cells, most, strict=True):
            nodes = [cell.interval, cell.interval + (len(P) > 1)]
            left = float(np.nextafter(loop.model.travel[row.control] - own[row.control], -1.0))
            if not is_within(P[nodes], rows[nodes], left):
                return f"{row.name} may reach its travel"
    for i, name in enumerate(map(str, INPUTS)):
        if name in servos and math.isfinite(servos[name].rate):
            if len(P) > 1:
                return f"the rate of {name}_command is bounded at a held airspeed alone"
            K = loop.reference.equipment.commands(loop.reference.gain)[0, i]
            if not max(fastest(K, *at) for at in over) < servos[name].rate:
                return f"{name}_command may change faster than its servo follows"
    return ""


def fastest(row: Array, over: MatrixSet, factor: Array) -> float:
    """A bound of |k'de/dt| on a tube e = factor z, |z| <= 1, rounded up, per second."""
    n, q = over.corners.shape[-2:]
    right = np.eye(q)
    right[:n, :n] = factor

    def size(k: Array) -> Array:
        """Of k'v, (...,), for v = (e, w, 1)."""
        own = k @ right
        parts = (own[..., :n], own[..., n:-1], own[..., -1:])
        return sum((np.linalg.norm(part, axis=-1) for part in parts), np.zeros(own.shape[:-1]))

    total = size(row @ over.corners).max()
    total += sum(np.linalg.norm(size(row @ over.onto @ H)) for H in (over.tube, over.gust))
    # each of e, w and 1 has size 1: |v| <= sqrt 3
    terms = np.linalg.norm(right.T @ over.weights @ right, ord=2, axis=(1, 2))
    total += (np.abs(over.left @ row) * np.sqrt(3 * terms)).sum()
    return float(total * RAISED)
