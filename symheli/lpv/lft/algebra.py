"""Algebra of LFTs: side by side, in series, in parallel, in feedback, the star product. Everything
is one constant closure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.equilibration import is_singular
from symheli.lpv.lft.model import LFT, Block, parts
from symheli.lpv.lft.systems import System, as_lft
from symheli.lpv.scheduling import Scheduling, unit_sizes
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal


def append(*systems: System) -> LFT:
    """Stack systems: states, inputs and outputs one after the other, with one block for a parameter
    that several of them share.

    Parameters
    ----------
    *systems : LFT, LPVStateSpace, LinearModel or a system of python-control
        A name that comes again gets the number of its system: phi, phi_2.

    Returns
    -------
    LFT
        Of all.

    Raises
    ------
    InputError
        Sample periods that differ.

    Examples
    --------
    >>> two = lpv.append(spring, spring)
    >>> [str(s) for s in two.outputs], two.sizes
    (['y1', 'y1_2'], (6,))
    """
    lfts = [as_lft(s) for s in systems]
    if not lfts:
        raise InputError("append needs at least one system")
    dt = _sample_period(lfts)
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
        _distinct([lft.states for lft in lfts]),
        _distinct([lft.inputs for lft in lfts]),
        _distinct([lft.outputs for lft in lfts]),
        dt,
    )


def close(
    lft: LFT, K: Array, E: Array, F: Array, inputs: Sequence[Signal], outputs: Sequence[Signal]
) -> LFT:
    """The system with u = K y + E r and the outputs F y; r and F y are called `inputs` and
    `outputs`.

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
    whole = np.block([[left + B @ KC, B @ N], [F @ (C + D @ KC), F @ D @ N]])
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


def series(first: System, second: System) -> LFT:
    """Connect two systems in series, y = second(first(u)): the outputs of `first` feed the inputs
    of `second` in their order.

    Parameters
    ----------
    first, second : LFT, LPVStateSpace, LinearModel or a system of python-control
        With as many outputs as inputs between them.

    Returns
    -------
    LFT
        From the inputs of `first` to the outputs of `second`.

    Raises
    ------
    InputError
        Numbers of signals or sample periods that differ.

    Examples
    --------
    >>> delayed = lpv.series(lpv.pade_delay("u1", 0.02, order=2), spring)
    >>> len(delayed.states), [str(s) for s in delayed.inputs]
    (4, ['u1_command'])
    """
    first, second = as_lft(first), as_lft(second)
    ny, nu = len(first.outputs), len(first.inputs)
    if len(second.inputs) != ny:
        raise InputError(
            f"series connection needs as many inputs ({len(second.inputs)}) as outputs of the other"
            f" ({ny})"
        )
    both = append(first, second)
    K, E = np.zeros((len(both.inputs), len(both.outputs))), np.zeros((len(both.inputs), nu))
    K[nu:, :ny], E[:nu] = np.eye(ny), np.eye(nu)
    return close(both, K, E, np.eye(len(both.outputs))[ny:], first.inputs, second.outputs)


def parallel(first: System, second: System) -> LFT:
    """Connect two systems in parallel, y = first(u) + second(u); the signals keep the names of
    `first`.

    Parameters
    ----------
    first, second : LFT, LPVStateSpace, LinearModel or a system of python-control
        With as many inputs and outputs.

    Returns
    -------
    LFT
        The sum.

    Raises
    ------
    InputError
        Numbers of signals or sample periods that differ.

    Examples
    --------
    >>> twice = lpv.parallel(spring, spring).at(0.0)
    >>> gains = [m.frequency_response([0.0])[0].real for m in (twice, spring.at(0.0))]
    >>> print((gains[0] / gains[1]).round(6))
    [[2.]]
    """
    first, second = as_lft(first), as_lft(second)
    nu, ny = len(first.inputs), len(first.outputs)
    if (len(second.inputs), len(second.outputs)) != (nu, ny):
        raise InputError(
            f"parallel connection needs equal numbers of inputs and outputs, got {nu}, {ny} and"
            f" {len(second.inputs)}, {len(second.outputs)}"
        )
    both = append(first, second)
    E, F = np.vstack([np.eye(nu), np.eye(nu)]), np.hstack([np.eye(ny), np.eye(ny)])
    return close(both, np.zeros((2 * nu, 2 * ny)), E, F, first.inputs, first.outputs)


def feedback(plant: System, controller: System) -> LFT:
    """Close the loop y = plant(u + controller(y)), all outputs to all inputs, in their order.

    The sign is positive, as in every `.feedback(...)` of this package; MATLAB's and
    python-control's `feedback(P, K)` is `feedback(P, -K)`.

    Parameters
    ----------
    plant, controller : LFT, LPVStateSpace, LinearModel or a system of python-control
        The outputs of each as many as the inputs of the other.

    Returns
    -------
    LFT
        From the inputs of the plant to its outputs.

    Raises
    ------
    InputError
        Numbers of signals or sample periods that differ, or a singular loop.

    Examples
    --------
    A gain of -2 stiffens the spring:

    >>> gain = lpv.LFT.constant(
    ...     lpv.LinearModel(
    ...         np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[-2.0]], (), ("e",), ("v",)
    ...     )
    ... )
    >>> lpv.feedback(spring, gain).at(0.0).A.round(6) + 0.0
    array([[ 0.,  1.],
           [-4., -1.]])
    """
    plant, controller = as_lft(plant), as_lft(controller)
    nu, ny = len(plant.inputs), len(plant.outputs)
    if (len(controller.inputs), len(controller.outputs)) != (ny, nu):
        raise InputError(
            f"expected a controller with {ny} input(s) and {nu} output(s), got"
            f" {len(controller.inputs)} and {len(controller.outputs)}"
        )
    both = append(plant, controller)
    K = np.zeros((nu + ny, ny + nu))
    K[:nu, ny:], K[nu:, :ny] = np.eye(nu), np.eye(ny)
    return close(
        both, K, np.eye(nu + ny)[:, :nu], np.eye(ny + nu)[:ny], plant.inputs, plant.outputs
    )


def star(upper: LFT, lower: System, outputs: int, inputs: int | None) -> LFT:
    """See `LFT.star`."""
    lower = as_lft(lower)
    inputs = len(lower.outputs) if inputs is None else inputs
    nu, ny = len(upper.inputs), len(upper.outputs)
    if not (
        0 <= outputs <= min(ny, len(lower.inputs)) and 0 <= inputs <= min(nu, len(lower.outputs))
    ):
        raise InputError(
            f"star product: {outputs} of {ny} outputs cannot feed {len(lower.inputs)} inputs, or"
            f" {inputs} of {len(lower.outputs)} outputs of the other cannot feed {nu} inputs; a"
            " series connection needs as many inputs as outputs of the other"
        )
    if outputs == 0 and inputs != nu:
        raise InputError(
            f"series connection needs as many inputs ({nu}) as outputs of the other ({inputs})"
        )
    both = append(upper, lower)
    K = np.zeros((len(both.inputs), len(both.outputs)))
    K[nu : nu + outputs, ny - outputs : ny] = np.eye(outputs)
    K[nu - inputs : nu, ny : ny + inputs] = np.eye(inputs)
    free_inputs = [*range(nu - inputs), *range(nu + outputs, len(both.inputs))]
    free_outputs = [*range(ny - outputs), *range(ny + inputs, len(both.outputs))]
    E, F = np.eye(len(both.inputs))[:, free_inputs], np.eye(len(both.outputs))[free_outputs]
    own_inputs = _distinct([upper.inputs[: nu - inputs], lower.inputs[outputs:]])
    own_outputs = _distinct([upper.outputs[: ny - outputs], lower.outputs[inputs:]])
    return close(both, K, E, F, own_inputs, own_outputs)


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


def _sample_period(lfts: Sequence[LFT]) -> float | None:
    """The one of all systems with states; those without go with any."""
    given = [lft.dt for lft in lfts if lft.states or lft.dt is not None]
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


def _distinct(groups: Sequence[Sequence[Signal]]) -> tuple[Signal, ...]:
    """All the names, one group after the other; one that is taken gets the number of its group."""
    out: list[Signal] = []
    for k, group in enumerate(groups):
        for s in group:
            name, number = str(s), k + 1
            while name in out:
                name, number = f"{s}_{number}", number + 1
            out.append(Signal(name, s.unit))
    return tuple(out)
