"""LFTs side by side, closed by constants, and over another range of a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.equilibration import is_singular
from symheli.lpv.given_parameters import unit_sizes
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft_matrices import Block, parts
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, distinct


def append_lfts(*lfts: LFT) -> LFT:
    """States, inputs and outputs one after the other, with one block for a parameter that several
    of them share; a name that comes again gets the number of its system.
    """
    dt = common_period(lfts)
    parameters = _parameters(lfts)
    rows: list[list[tuple[int, int]]] = [
        [],
        [],
        [],
    ]  # (system, row) of the parameter loop, the states, the outputs
    columns: list[list[tuple[int, int]]] = [[], [], []]
    for k, lft in enumerate(lfts):
        for axis, last in ((rows, lft.outputs), (columns, lft.inputs)):
            start = lft.order + len(lft.states)
            axis[1] += [(k, lft.order + i) for i in range(len(lft.states))]
            axis[2] += [(k, start + i) for i in range(len(last))]
    for s in parameters:
        for k, lft in enumerate(lfts):
            loop = [(k, i) for i in _where(lft, s.name)]
            rows[0] += loop
            columns[0] += loop
    wholes = [np.block([[lft.M11, lft.M12], [lft.M21, lft.M22]]) for lft in lfts]
    M = np.zeros((sum(map(len, rows)), sum(map(len, columns))))
    place_rows, place_columns = list(chain(*rows)), list(chain(*columns))
    for k, whole in enumerate(wholes):
        mine_rows = [i for i, (system, _) in enumerate(place_rows) if system == k]
        mine_columns = [j for j, (system, _) in enumerate(place_columns) if system == k]
        M[np.ix_(mine_rows, mine_columns)] = whole[
            np.ix_(
                [place_rows[i][1] for i in mine_rows], [place_columns[j][1] for j in mine_columns]
            )
        ]
    blocks = tuple(Block(s, sum(len(_where(lft, s.name)) for lft in lfts)) for s in parameters)
    n = sum(block.size for block in blocks)
    return LFT(
        M[:n, :n],
        M[:n, n:],
        M[n:, :n],
        M[n:, n:],
        blocks,
        distinct([lft.states for lft in lfts]),
        distinct([lft.inputs for lft in lfts]),
        distinct([lft.outputs for lft in lfts]),
        dt,
    )


def close(
    lft: LFT,
    K: Array,
    E: Array,
    F: Array,
    inputs: Sequence[Signal],
    outputs: Sequence[Signal],
    G: Array | float = 0.0,
) -> LFT:
    """The system with u = K y + E r and the outputs F y + G r; r and the outputs are called
    `inputs` and `outputs`.

    Loops through D and through the parameters are solved exactly. Raises `InputError` where the
    loop is singular at the middle of the parameters.
    """
    nx, n = len(lft.states), lft.order
    D = lft.M22[nx:, nx:]
    loop = np.eye(len(lft.inputs)) - K @ D
    if is_singular(loop):
        raise InputError(
            "the loop is not well posed: I - K D is singular at the middle of the parameter range"
        )
    left = np.block([[lft.M11, lft.M12[:, :nx]], [lft.M21[:nx], lft.M22[:nx, :nx]]])
    B, C = (
        np.vstack([lft.M12[:, nx:], lft.M22[:nx, nx:]]),
        np.hstack([lft.M21[nx:], lft.M22[nx:, :nx]]),
    )
    KC, N = np.linalg.solve(loop, K @ C), np.linalg.solve(loop, E)
    whole = np.block([[left + B @ KC, B @ N], [F @ (C + D @ KC), F @ D @ N + G]])
    return LFT(
        whole[:n, :n],
        whole[:n, n:],
        whole[n:, :n],
        whole[n:, n:],
        lft.blocks,
        lft.states,
        tuple(inputs),
        tuple(outputs),
        lft.dt,
    )


def over_range(lft: LFT, scheduling: Scheduling) -> LFT:
    """See `LFT.with_scheduling`: delta = a + b delta' closes part of the loop with a constant."""
    names = [s.name for s in lft.parameters]
    if scheduling.name not in names:
        raise UnknownNameError("scheduling parameter", scheduling.name, names)
    old = lft.parameters[names.index(scheduling.name)]
    (size,) = unit_sizes([old], [scheduling])
    a, b = np.zeros(lft.order), np.ones(lft.order)
    here = _where(lft, scheduling.name)
    a[here] = (size * scheduling.middle - old.middle) / old.radius
    b[here] = size * scheduling.radius / old.radius
    loop = np.eye(lft.order) - lft.M11 * a
    if is_singular(loop):
        raise InputError(
            f"the parameter loop is singular at the middle of the new range of {scheduling.name};"
            " see .well_posed()"
        )
    M11, M12 = np.linalg.solve(loop, lft.M11), np.linalg.solve(loop, lft.M12)
    blocks = tuple(
        Block(scheduling if block.scheduling is old else block.scheduling, block.size)
        for block in lft.blocks
    )
    # w = (a + b delta') z: the outputs see M21 (a z + b w'), and z = M11 b w' + M12 v after the
    # constant part is closed
    M21 = lft.M21 * b + (lft.M21 * a) @ (M11 * b)
    return replace(
        lft, M11=M11 * b, M12=M12, M21=M21, M22=lft.M22 + (lft.M21 * a) @ M12, blocks=blocks
    )


def common_period(systems: Sequence[Any]) -> float | None:
    """The one of all systems with states, s; those without go with any. Raises `InputError`."""
    given = [s.dt for s in systems if s.states or s.dt is not None]
    if not all(same_period(dt, given[0]) for dt in given):
        raise InputError(
            "systems must share one sample period, got"
            f" {', '.join('continuous' if dt is None else f'{dt:g} s' for dt in given)}; discretize"
            " the continuous ones first"
        )
    return given[0] if given else None


def _parameters(lfts: Sequence[LFT]) -> list[Scheduling]:
    found: dict[str, Scheduling] = {}
    for s in chain(*(lft.parameters for lft in lfts)):
        if found.setdefault(s.name, s) != s:
            raise InputError(
                f"two systems schedule on {s.name} with different ranges, units or rates:"
                f" {found[s.name]} and {s}; bring both to one with with_scheduling, or rename one"
            )
    return list(found.values())


def _where(lft: LFT, name: str) -> list[int]:
    """Rows of the parameter loop that belong to the parameter of this name."""
    return [
        i
        for block, part in zip(lft.blocks, parts(lft.sizes), strict=True)
        if block.scheduling.name == name
        for i in _range(part)
    ]


def _range(part: slice) -> range:
    return range(part.start, part.stop)
