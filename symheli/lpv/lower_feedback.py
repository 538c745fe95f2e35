"""A controller closed around an LPV plant: the lower linear fractional transformation, exactly."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import DataWarning, InputError
from symheli.lpv.equilibration import loop_inverse
from symheli.lpv.further_parameter import over
from symheli.lpv.linear_model import LinearModel, is_control_system
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.matrix_function import Box, MatrixFunction, block, functions_of, in_one_basis
from symheli.lpv.scheduling import UNSCHEDULED, Scheduling
from symheli.lpv.uncertain_state_space import UncertainStateSpace
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, distinct, indices
from symheli.values.units import per_second, to_si

PREFIX = "controller_"
"""Prefix of a controller's state whose name the plant has too."""


class Positions(NamedTuple):
    """Positions of the inputs w, u and the outputs z, y of a plant; one may be in both."""

    w: list[int]
    u: list[int]
    z: list[int]
    y: list[int]


class ControllerMatrices(NamedTuple):
    """Matrices of dx/dt = A x + B y, u = C x + D y, as functions of p."""

    A: MatrixFunction
    B: MatrixFunction
    C: MatrixFunction
    D: MatrixFunction

    @classmethod
    def static(cls, K: Array, box: Box) -> ControllerMatrices:
        """u = K y."""
        (nu, ny), constant = K.shape, MatrixFunction.constant
        A, B, C = (constant(np.zeros(shape), box) for shape in ((0, 0), (0, ny), (nu, 0)))
        return cls(A, B, C, constant(K, box))


def lower_feedback(
    plant: Any,
    controller: Any,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LPVStateSpace | UncertainStateSpace:
    """Close the loop u = K y of a plant, and return the model from its other inputs to its other
    outputs.

    The feedback is positive, and by names: the controller's inputs are outputs y of the plant, its
    outputs inputs u. Exact: what is multiplied by constants keeps its basis, products of
    polynomials are polynomials, of other piecewise polynomials `Patches` over the breaks of both.
    A constant loop through the feedthrough of both is solved.

    Parameters
    ----------
    plant : LPVStateSpace, UncertainStateSpace, LinearModel or a system of python-control
        Of an uncertain one every model of the set is closed.
    controller : LPVStateSpace, LinearModel or a system of python-control
        Constant, or over parameters of the same names and units as the plant's: fewer, more, or in
        another order. Of one that both have, the loop takes the plant's range, which the
        controller's must hold, and the plant's rate, with a `DataWarning` where the controller was
        made for a slower one or its rate is another parameter. A parameter of another name is
        another parameter, with a `DataWarning` where it may be the same quantity.
    inputs, outputs : sequence of str, optional
        Of the closed loop, by default all that are not connected. A u among the inputs is what is
        added to the controller's; a y among the outputs is read by the controller and stays.

    Returns
    -------
    LPVStateSpace or UncertainStateSpace
        States (plant, controller); a controller's state that has the name of a plant's gets the
        prefix "controller_". A fit of what the loop makes of what the plant was fitted to.

    Raises
    ------
    InputError
        Sample periods that differ, a range that is too small, a loop that is singular or whose
        feedthrough depends on the parameters, functions whose products have no basis.
    UnknownNameError
        A signal that the plant does not have.

    Examples
    --------
    >>> p = symheli.Scheduling("p", "1", low=0.0, high=1.0)
    >>> gain = symheli.LPVStateSpace.polynomial(
    ...     [np.zeros((0, 0))], [np.zeros((0, 1))], [np.zeros((1, 0))], [[[-1.0]], [[-3.0]]], p,
    ...     inputs=["y1"], outputs=["force"])
    >>> pushed = symheli.LPVStateSpace(
    ...     spring.basis, spring.A, np.repeat(spring.B, 2, axis=2), spring.C,
    ...     np.repeat(spring.D, 2, axis=2), p, spring.states, ["u1", "force"], spring.outputs)
    >>> stiff = lpv.tools.lower_feedback(pushed, gain)
    >>> print(stiff.inputs, stiff.outputs, stiff.at(1.0).A[1].round(6))
    ('u1',) () [-6.5 -1. ]
    """
    given = _model(controller, "controller")
    if isinstance(plant, UncertainStateSpace):
        return replace(plant, model=_around_every(plant, given, inputs, outputs))
    return around(_model(plant, "plant"), given, inputs, outputs)


def _around_every(
    plant: UncertainStateSpace,
    controller: LPVStateSpace,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
) -> LPVStateSpace:
    """The model of the closed set: the channels of the block stay, and last."""
    indices((*controller.outputs, *(inputs or ())), plant.inputs, "input")
    indices((*controller.inputs, *(outputs or ())), plant.outputs, "output")
    if inputs is not None:
        inputs = [*inputs, *plant.perturbation_inputs]
    if outputs is not None:
        outputs = [*outputs, *plant.perturbation_outputs]
    return around(plant.model, controller, inputs, outputs)


def around(
    plant: LPVStateSpace,
    controller: LPVStateSpace,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LPVStateSpace:
    """See `lower_feedback`."""
    if not plant.states:
        plant = replace(plant, dt=controller.dt)
    if controller.states and not same_period(plant.dt, controller.dt):
        raise InputError(
            f"the plant is {_time(plant.dt)} and the controller {_time(controller.dt)}: sample both"
            " with one period, .discretize(dt)"
        )
    plant, controller = _over_the_same(plant, controller)
    u = indices(controller.outputs, plant.inputs, "input")
    y = indices(controller.inputs, plant.outputs, "output")
    w = _rest(plant.inputs, u) if inputs is None else indices(inputs, plant.inputs, "input")
    z = _rest(plant.outputs, y) if outputs is None else indices(outputs, plant.outputs, "output")
    K = ControllerMatrices(*(replace(M, box=plant.box) for M in functions_of(controller)))
    states = apart(controller.states, plant.states, PREFIX)
    return closed(plant, Positions(w, u, z, y), K, states)


def _rest(names: Sequence[str], connected: Sequence[int]) -> list[int]:
    return [i for i in range(len(names)) if i not in connected]


def closed(
    lpv: LPVStateSpace, at: Positions, K: ControllerMatrices, states: Sequence[Signal] = ()
) -> LPVStateSpace:
    """w -> z with u = K y, `states` those of K: a fit of what the loop makes of what `lpv` was
    fitted to.
    """
    P = Partition.of(functions_of(lpv), at)
    found = [block(rows) for rows in _interconnected(P, K, _loop(K.D, P.D22))]
    basis, (A, B, C, D) = in_one_basis(found, lpv.basis.ranges)
    model = LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        lpv.parameters,
        (*lpv.states, *states),
        tuple(lpv.inputs[i] for i in at.w),
        tuple(lpv.outputs[i] for i in at.z),
        lpv.dt,
    )
    if (origin := lpv.fitted_to) is None:
        return model
    P = Partition.of(origin.matrices, at)
    there = Matrices(*(M(origin.nodes) for M in K))
    N = np.stack([loop_inverse(each) for each in there.D @ P.D22])
    exact = (np.block([list(row) for row in rows]) for rows in _interconnected(P, there, N))
    return model.with_residuals(origin.nodes, Matrices(*exact))


def close_static(lpv: LPVStateSpace, K: Array) -> LPVStateSpace:
    """The model with u = K y + r; see `LPVStateSpace.feedback`. All inputs stay, as r, and all
    outputs; only the feedthrough from the inputs that are driven to the outputs that are fed back
    is a loop.
    """
    driven, fed = (np.flatnonzero(np.any(K, axis=axis)).tolist() for axis in (1, 0))
    at = Positions(list(range(len(lpv.inputs))), driven, list(range(len(lpv.outputs))), fed)
    return closed(lpv, at, ControllerMatrices.static(K[driven][:, fed], lpv.box))


def append_lpv(first: LPVStateSpace, second: LPVStateSpace) -> LPVStateSpace:
    """Return both models side by side, over the parameters of both; their names are made
    distinct.
    """
    first, second = _over_the_same(first, second)
    pairs = list(zip(functions_of(first), functions_of(second), strict=True))
    basis, (A, B, C, D) = in_one_basis([_diagonal(*pair) for pair in pairs], first.basis.ranges)
    x, u, y = (
        distinct([getattr(first, group), getattr(second, group)])
        for group in ("states", "inputs", "outputs")
    )
    model = LPVStateSpace(basis, A, B, C, D, first.parameters, x, u, y, first.dt)
    origins = [one.fitted_to for one in (first, second)]
    known = next((origin for origin in origins if origin is not None), None)
    if known is None:
        return model
    M, N = (
        known.matrices
        if origin is known
        else Matrices(*(M(known.nodes) for M in functions_of(one)))
        for one, origin in zip((first, second), origins, strict=True)
    )
    exact = (
        np.block(
            [[m, np.zeros((*m.shape[:2], n.shape[2]))], [np.zeros((*n.shape[:2], m.shape[2])), n]]
        )
        for m, n in zip(M, N, strict=True)
    )
    return model.with_residuals(known.nodes, Matrices(*exact))


def _diagonal(M: MatrixFunction, N: MatrixFunction) -> MatrixFunction:
    zero = MatrixFunction.constant
    return block(
        [
            [M, zero(np.zeros((M.shape[0], N.shape[1])), M.box)],
            [zero(np.zeros((N.shape[0], M.shape[1])), M.box), replace(N, box=M.box)],
        ]
    )


class Partition(NamedTuple):
    """dx/dt = A x + B1 w + B2 u, z = C1 x + D11 w + D12 u, y = C2 x + D21 w + D22 u.

    A (..., nx, nx), B1 (..., nx, nw), B2 (..., nx, nu), C1 (..., nz, nx), C2 (..., ny, nx), and so
    on.
    """

    A: Any
    B1: Any
    B2: Any
    C1: Any
    C2: Any
    D11: Any
    D12: Any
    D21: Any
    D22: Any

    @classmethod
    def of(cls, matrices: Sequence[Any], at: Positions) -> Partition:
        """The blocks of (A, B, C, D), arrays or `MatrixFunction`s."""
        A, B, C, D = matrices
        w, u, z, y = at

        def part(M: Any, rows: list[int] | slice, columns: list[int] | slice) -> Any:
            if isinstance(M, MatrixFunction):
                return M[rows, columns]
            return M[..., rows, :][..., columns]

        every = slice(None)
        return cls(
            A,
            part(B, every, w),
            part(B, every, u),
            part(C, z, every),
            part(C, y, every),
            part(D, z, w),
            part(D, z, u),
            part(D, y, w),
            part(D, y, u),
        )


def _interconnected(P: Partition, K: Any, N: Any) -> tuple[tuple[tuple[Any, ...], ...], ...]:
    """Return the blocks of A, B, C, D of the loop, N = (I - D_K D22)^-1: stacks of matrices or
    functions.

    With y = y0 + D22 u and y0 = C2 x + D21 w, u = N D_K y0 + N C_K x_K.
    """
    E, V = N @ K.D, N @ K.C
    F = P.D22 @ E + np.eye(P.D22.shape[-2])
    return (
        (
            (P.A + P.B2 @ E @ P.C2, P.B2 @ V),
            (K.B @ F @ P.C2, K.A + K.B @ P.D22 @ V),
        ),
        ((P.B1 + P.B2 @ E @ P.D21,), (K.B @ F @ P.D21,)),
        ((P.C1 + P.D12 @ E @ P.C2, P.D12 @ V),),
        ((P.D11 + P.D12 @ E @ P.D21,),),
    )


def _loop(D: MatrixFunction, D22: MatrixFunction) -> MatrixFunction:
    """(I - D D22)^-1 where that has a basis: the loop is constant, or no signal returns to where it
    came from.
    """
    KD = D @ D22
    if KD.is_constant:
        return KD.constant(loop_inverse(KD.value), KD.box)
    size = KD.shape[0]
    reached = passes = KD.varies | (KD.value != 0)
    power, total = KD, KD + np.eye(size)
    for _ in range(size - 1):
        reached = (reached.astype(int) @ passes) > 0
        if not np.any(reached):
            return total
        power = power @ KD
        total = total + power
    raise InputError(
        "the loop through the feedthrough D(p) depends on the scheduling: closed it is a rational"
        " function of it, which no basis holds; put a servo, a delay or a filter between, or an"
        " LFT, lpv.to_lft().feedback(...) closes it exactly"
    )


def apart(names: Sequence[Signal], taken: Sequence[str], prefix: str) -> tuple[Signal, ...]:
    """The names, with the prefix before those that are taken."""
    out: list[Signal] = []
    for name in names:
        new = name
        while new in taken or new in out or (new != name and new in names):
            new = Signal(prefix + new, name.unit)
        out.append(new)
    return tuple(out)


def _model(given: Any, what: str) -> LPVStateSpace:
    if is_control_system(given):
        given = LinearModel.from_control(given)
    if isinstance(given, LinearModel):
        given = LPVStateSpace.constant(given)
    if not isinstance(given, LPVStateSpace):
        raise InputError(
            f"{what}: expected an LPVStateSpace, a LinearModel or a system of python-control, got"
            f" {type(given).__name__}"
        )
    return given


def _time(dt: float | None) -> str:
    return "continuous" if dt is None else f"sampled every {dt:g} s"


def _is_unscheduled(lpv: LPVStateSpace) -> bool:
    """Whether the parameter is the one on which nothing depends, at whatever rate."""
    return [s.with_rate(UNSCHEDULED.rate) for s in lpv.parameters] == [UNSCHEDULED]


def _same_quantity(s: Scheduling, known: Sequence[Scheduling]) -> Scheduling | None:
    """One of these that may be the same signal: of the same dimension, with a range in common."""
    for other in known:
        try:
            (size, one), (other_size, two) = to_si(s.unit), to_si(other.unit)
        except InputError:  # user-defined units: comparable only if identical
            if s.unit != other.unit:
                continue
            size, one, other_size, two = 1.0, s.unit, 1.0, s.unit
        overlap = s.low * size < other.high * other_size and other.low * other_size < s.high * size
        if one == two != "1" and overlap:
            return other
    return None


def _renamed(s: Scheduling) -> str:
    """Return advice how to give another model the name and unit of a parameter."""
    return f".with_scheduling(Scheduling({s.name!r}, {s.unit!r}, low, high))"


def _made_for_another_rate(
    s: Scheduling, known: Scheduling, plant: Mapping[str, Scheduling]
) -> str | None:
    """Return a warning where the rate limit of the plant, which is used, exceeds the one that the
    connected system was made for; None where it does not, or the plant has no limit.
    """
    if s.rate == known.rate or known.rate == np.inf:
        return None
    most = known.rate
    if isinstance(most, str):
        most = max(abs(plant[most].low), abs(plant[most].high))
    unit = per_second(s.unit)
    if isinstance(s.rate, str):
        made = f"the rate of {s.name} is the parameter {s.rate}"
    elif s.rate < most:
        made = f"{s.name} moves at {s.rate:g} {unit} at most"
    else:
        return None
    return (
        f"in the connected system {made}, in the plant at up to {most:g} {unit}: the loop has the"
        " plant's rate; if that is too fast, limit it with .with_rate(...) of the plant"
    )


def _over_the_same(
    plant: LPVStateSpace, controller: LPVStateSpace
) -> tuple[LPVStateSpace, LPVStateSpace]:
    """Return both over the parameters of the plant and those that only the controller has."""
    plant, controller = (
        LPVStateSpace.constant(one.at(UNSCHEDULED.middle), other.parameters)
        if _is_unscheduled(one)
        else one
        for one, other in ((plant, controller), (controller, plant))
    )
    own = {s.name: s for s in plant.parameters}
    for s, (low, high) in zip(controller.parameters, controller.basis.ranges, strict=True):
        if (known := own.get(s.name)) is None:
            continue
        if known.unit != s.unit:
            raise InputError(
                f"{s.name} is in {known.unit} in the plant, in {s.unit} in the other:"
                f" {_renamed(known)} brings that to it"
            )
        low, high = max(low, s.low), min(high, s.high)
        slack = 1e-9 * (known.high - known.low)
        if low > known.low + slack or high < known.high - slack:
            raise InputError(
                f"the plant holds for {s.name} on [{known.low:g}, {known.high:g}] {s.unit}, what is"
                f" connected to it on [{low:g}, {high:g}] only; narrow the range of the plant,"
                " .with_scheduling(...), or design over the wider range"
            )
    for s in controller.parameters:
        if (known := own.get(s.name)) and (slower := _made_for_another_rate(s, known, own)):
            warnings.warn(slower, DataWarning, stacklevel=4)
        if known is None and (same := _same_quantity(s, plant.parameters)):
            warnings.warn(
                f"{same.name} ({same.unit}) of the plant and {s.name} ({s.unit}) of what is"
                " connected to it are taken for two parameters that move independently; if they are"
                f" one, {_renamed(same)} calls it so",
                DataWarning,
                stacklevel=4,
            )
    every = (*plant.parameters, *(s for s in controller.parameters if s.name not in own))
    return over(plant, every), over(controller, every)
