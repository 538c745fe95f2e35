"""A controller with an error in its measured parameter: the loop for every error within a bound.

It is at K(p + b) where the plant is at p, and K(p + b) = K(p) + b K[p, p + b] with the divided
difference K[p, q], the mean of the slopes of K between p and q. On a short interval of p that mean
lies in the convex hull of the Bernstein coefficients of the slope wherever p + b may be, and so in
S_0(p) + sum_i m_i S_i(p), |m_i| <= 1, with matrices S that are constant on each interval:

    [x_K(k+1); u] = K(p) y~ + d,    y~ = (x_K, y),    d = b S_0(p) y~ + sum_i b m_i S_i(p) y~.

All are repeated scalars within the largest error: an `UncertainStateSpace` holds every motion of b,
and more. Nothing is linearized. Between two knots of a table the slope is one; where p + b may pass
a knot one S_i holds the slopes of both sides.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import linalg

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.bases import Patches
from symheli.lpv.bases.function_space import Piece
from symheli.lpv.equilibration import equilibrate
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lower_feedback import Partition, Positions
from symheli.lpv.matrix_function import MatrixFunction, block, functions_of, in_one_basis
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import signals
from synthesis.design.loops.balanced_block import balanced
from synthesis.design.plant.as_controller import as_controller
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.numerics.polynomial.bernstein import restriction
from synthesis.numerics.polynomial.pieces import function_pieces
from synthesis.numerics.program.bases import MAX_DIVISIONS

ROUNDING = 64 * np.finfo(float).eps
"""Relative rounding error of an entry, as a fraction of the sum of its own terms, so that the
units of controls and measurements play no part.
"""
MAX_INVERSE_ERROR = 0.1
"""Largest relative error of the inverse of a change of coordinates; with a larger error the change
is not used.
"""


def with_scheduling_error(
    plant: Plant, controller: Any, error: float, *, divisions: int = 8
) -> UncertainStateSpace:
    """Return the loop of a controller that reads p + b instead of p, for every b(t) with |b| <=
    `error`.

    A reading beyond the range of the parameter counts as its end. A bias of b0 and a lag of T s at
    rates |dp/dt| <= r together are within `error` = b0 + T r, whatever their motion.

    Parameters
    ----------
    plant : Plant
        Over one parameter, without feedthrough from controls to measurements (a servo or a delay
        takes it away).
    controller : TableController, Controller, LPVStateSpace or what else `Plant.close` takes
        Over the same parameter, continuous in it.
    error : float
        Largest |b|, in the unit of the parameter.
    divisions : int
        Intervals on which a controller that is no table is given one slope each; a table has its
        own, and one around each knot.

    Returns
    -------
    UncertainStateSpace
        For `l2_gain` and `stability`; with `error` 0 the loop itself, whose block is zero.

    Raises
    ------
    InputError
        A negative error, several parameters, feedthrough, a controller that jumps or that is no
        piecewise polynomial.

    Examples
    --------
    >>> import synthesis
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    >>> lag = LPVStateSpace.polynomial(
    ...     [[[0.9]], [[0.3]]], [[[0.1, 0.1]]], [[[1.0]]], [[[0.0, 0.0]]], p, dt=0.1,
    ...     inputs=("w", "u"), outputs=("y",))
    >>> plant = synthesis.Plant(lag, disturbances=["w"], performance=["y"], controls=["u"],
    ...                         measurements=["y"])
    >>> nothing, through = [np.zeros((0, 0))], [np.zeros((0, 1))]
    >>> gain = LPVStateSpace.polynomial(  # u = -(1 + 3 p) y: the pole stays at 0.8
    ...     nothing, through, [np.zeros((1, 0))], [[[-1.0]], [[-3.0]]], p,
    ...     inputs=("y",), outputs=("u",))
    >>> wrong = synthesis.analysis.with_scheduling_error(plant, gain, 0.1)  # pole: .77 to .83
    >>> print(round(synthesis.l2_gain(wrong, 0.1, search=None).gamma, 3), round(0.1 / 0.17, 3))
    0.588 0.588
    """
    require_plant(plant)
    if not (np.isfinite(error) and error >= 0):
        raise InputError(f"error: expected a number >= 0 in the unit of p, got {error!r}")
    whole = isinstance(divisions, int) and not isinstance(divisions, bool)
    if not whole or not 1 <= divisions <= MAX_DIVISIONS:
        raise InputError(
            f"divisions: expected an integer from 1 to {MAX_DIVISIONS}, got {divisions!r}"
        )
    if len(plant.parameters) != 1:
        raise InputError(
            "a wrong reading needs a plant of one parameter, this one has"
            f" {', '.join(s.name for s in plant.parameters)}"
        )
    K = _scheduled(as_controller(controller, plant.controls, plant.measurements), plant)
    loop = _Opened.of(plant, K)
    s = plant.parameters[0]
    reach = min(error, s.high - s.low)  # the measured p ends with its range
    S = _slopes(K, s, reach, divisions)
    U, rows_kept = _reached([each.coefficients for each in S])
    seen = [each[rows_kept, :] for each in S]
    enter = np.hstack([reach * U] * len(seen))
    rows = np.concatenate([each.coefficients for each in seen], axis=1)
    leave = MatrixFunction(seen[0].basis, rows, seen[0].box)
    open_loop = loop.closed(enter, leave)
    ends = len(plant.disturbances), len(plant.performance)
    points = leave.basis.points(3) if isinstance(leave.basis, Patches) else np.zeros(0)
    model = _in_balanced_units(open_loop, ends, points, U.shape[1], len(seen))
    sentence, probability = "", 1.0
    if isinstance(plant.model, UncertainStateSpace):
        sentence, probability = f"{plant.model.source}; ", plant.model.probability
    sentence += f"the controller reads {s.name} wrong by at most {error:g} {s.unit}, in any motion"
    d, v = model.inputs[ends[0] :], model.outputs[ends[1] :]
    return UncertainStateSpace(model, d, v, 1.0, probability, sentence)


class _Opened:
    """The loop under K(p) with inputs d added to [x_K(k+1); u] and outputs y~ = (x_K, y).

    A .. D of it as functions of p, with the inputs (w, d) and the outputs (z, y~); w and z hold the
    channels of the plant's own block, if it has one.
    """

    def __init__(self, plant: Plant, K: LPVStateSpace, parts: dict[str, MatrixFunction]) -> None:
        self.plant, self.K, self.parts = plant, K, parts

    @classmethod
    def of(cls, plant: Plant, K: LPVStateSpace) -> _Opened:
        own = plant.model
        model = own.model if isinstance(own, UncertainStateSpace) else plant.nominal
        w, z = list(plant.disturbances), list(plant.performance)
        if isinstance(own, UncertainStateSpace):
            w += own.perturbation_inputs
            z += own.perturbation_outputs
        at = Positions(
            *([model.inputs.index(s) for s in group] for group in (w, K.outputs)),
            *([model.outputs.index(s) for s in group] for group in (z, K.inputs)),
        )
        P = Partition.of(functions_of(model), at)
        if not (P.D22.is_constant and not np.any(P.D22.value)):
            raise InputError(
                "the controls act on the measurements at once, so that a wrong reading enters"
                " twice: put a servo or a delay between"
            )
        M = MatrixFunction(K.basis, np.block([[K.A, K.B], [K.C, K.D]]), plant.nominal.box).simplest
        n = len(K.states)
        zero = np.zeros
        A = _corner(P.A, n, n)
        B1, D21 = _corner(P.B1, n, 0), _corner(P.D21, n, 0, first=True)
        C1 = _corner(P.C1, 0, n)
        nx, ny, nz = len(model.states), len(K.inputs), len(z)
        B2 = block(
            [
                [_constant(zero((nx, n)), P.A), P.B2],
                [_constant(np.eye(n), P.A), _constant(zero((n, len(K.outputs))), P.A)],
            ]
        )
        C2 = block(
            [
                [_constant(zero((n, nx)), P.A), _constant(np.eye(n), P.A)],
                [P.C2, _constant(zero((ny, n)), P.A)],
            ]
        )
        D12 = block([[_constant(zero((nz, n)), P.A), P.D12]])
        parts = {
            "A": A + B2 @ M @ C2,
            "B": B1 + B2 @ M @ D21,
            "Bd": B2,
            "C": C1 + D12 @ M @ C2,
            "D": P.D11 + D12 @ M @ D21,
            "Dd": D12,
            "Cy": C2,
            "Dy": D21,
        }
        return cls(plant, K, parts)

    def closed(self, enter: Array, leave: MatrixFunction) -> LPVStateSpace:
        """Return the loop with d = enter d_1 and v_1 = leave(p) y~, the inputs (w, d_1, own d) and
        the outputs (z, v_1, own v); the bound of the plant's own block is in its d.
        """
        f, plant, own = self.parts, self.plant, self.plant.model
        w, z = len(plant.disturbances), len(plant.performance)
        size, inside, outside = np.ones(f["B"].shape[1]), (), ()
        if isinstance(own, UncertainStateSpace):
            size[w:] = own.bound
            inside, outside = own.perturbation_inputs, own.perturbation_outputs
        every, first, last = slice(None), np.diag(size)[:, :w], np.diag(size)[:, w:]
        blind = _constant(np.zeros((leave.shape[0], enter.shape[1])), f["A"])
        seen = {"C": leave @ f["Cy"], "D": leave @ f["Dy"]}
        columns = [f["D"] @ first, f["Dd"] @ enter, f["D"] @ last]
        basis, (A, B, C, D) = in_one_basis(
            [
                f["A"],
                block([[f["B"] @ first, f["Bd"] @ enter, f["B"] @ last]]),
                block([[f["C"][:z, every]], [seen["C"]], [f["C"][z:, every]]]),
                block(
                    [
                        [M[:z, every] for M in columns],
                        [seen["D"] @ first, blind, seen["D"] @ last],
                        [M[z:, every] for M in columns],
                    ]
                ),
            ],
            plant.basis.ranges,
        )
        wrong = (f"wrong_{i + 1}" for i in range(enter.shape[1]))
        slope = (f"slope_{i + 1}" for i in range(leave.shape[0]))
        return LPVStateSpace(
            basis,
            *(A, B, C, D),
            plant.parameters,
            signals((*plant.states, *(f"controller_{s}" for s in self.K.states))),
            signals((*plant.disturbances, *wrong, *inside)),
            signals((*plant.performance, *slope, *outside)),
            plant.dt,
        )


def _in_balanced_units(
    model: LPVStateSpace, ends: tuple[int, int], p: Array, size: int, count: int
) -> LPVStateSpace:
    """Return coordinates of the block's channels, those after `ends`, in which it is least
    conservative, from the responses at p and some frequencies.
    """
    w, z = ends
    A, B, C, D = model.matrices(p)
    dt = model.dt
    fastest = np.abs(np.linalg.eigvals(A)).max() if dt is None else np.pi / dt
    omega = np.geomspace(1e-3 * fastest, fastest, 24)
    one = np.eye(A.shape[-1])
    responses = [
        C[:, z:] @ np.linalg.solve(at * one - A, B[:, :, w:]) + D[:, z:, w:]
        for at in (1j * omega if dt is None else np.exp(1j * omega * dt))
    ]
    left, right, _ = balanced(np.concatenate(responses), size, count)
    left, right = _inverse(left, right, size * count)
    right = linalg.block_diag(np.eye(w), right)
    left = linalg.block_diag(np.eye(z), left)
    return replace(model, B=model.B @ right, C=left @ model.C, D=left @ model.D @ right)


def _inverse(left: Array, right: Array, own: int) -> tuple[Array, Array]:
    """Return (left^-1, right) with the `own` first columns of `right` enlarged by the rounding of
    the inverse: b T^-1 (T^-1)^-1 is then within the error for every b. The coordinates stay
    unchanged if that is too large.
    """
    inverse, T = np.linalg.inv(left), left[:own, :own]
    L = inverse[:own, :own]
    computed = np.abs(L @ T - np.eye(own))
    missed = np.linalg.norm(computed + own * np.finfo(float).eps * np.abs(L) @ np.abs(T))
    if not missed < MAX_INVERSE_ERROR:
        return np.eye(len(left)), np.eye(len(right))
    grown = right * (1.0 + 4 * np.finfo(float).eps)
    grown[:, :own] /= 1.0 - missed
    return inverse, grown


def _constant(M: Array, like: MatrixFunction) -> MatrixFunction:
    return MatrixFunction.constant(M, like.box)


def _corner(M: MatrixFunction, rows: int, columns: int, *, first: bool = False) -> MatrixFunction:
    """Return M with this many rows and columns of zeros added, after it or (rows) before it."""
    before, after = (rows, 0) if first else (0, rows)
    padded = np.pad(M.coefficients, ((0, 0), (before, after), (0, columns)))
    return MatrixFunction(M.basis, padded, M.box)


def _scheduled(given: LinearModel | LPVStateSpace, plant: Plant) -> LPVStateSpace:
    """Return K over the parameter of the plant, in its sample period."""
    if isinstance(given, LinearModel):
        given = LPVStateSpace.constant(given, plant.parameters)
    read, own = given.parameters, plant.parameters[0]
    if len(read) != 1 or read[0].name != own.name or read[0].unit != own.unit:
        raise InputError(
            f"the controller reads {', '.join(s.name for s in read)}, the plant moves with"
            f" {own.name}: both must be over the same one parameter"
        )
    slack = 1e-9 * (own.high - own.low)
    if read[0].low > own.low + slack or read[0].high < own.high - slack:
        raise InputError(
            f"the controller is known on [{read[0].low:g}, {read[0].high:g}] {own.unit}, the plant"
            f" on [{own.low:g}, {own.high:g}]: narrow the plant, .with_scheduling(...)"
        )
    if given.states and not same_period(plant.dt, given.dt):
        raise InputError("plant and controller must have one sample period, .discretize(dt)")
    return given


def _slopes(K: LPVStateSpace, s: Scheduling, error: float, divisions: int) -> list[MatrixFunction]:
    """Return S_0, S_1 .., each constant on the same intervals."""
    M = np.block([[K.A, K.B], [K.C, K.D]])
    cuts, slopes = _derivative(K, M, s)
    least = 1e-6 * (s.high - s.low)
    ends = {k + side * (error + 2 * least) for k in cuts[1:-1] for side in (-1.0, 1.0)} | set(cuts)
    if any(len(slope) > 1 for slope in slopes):
        ends |= set(np.linspace(s.low, s.high, divisions + 1).tolist())
    breaks = [s.low]
    for p in sorted(e for e in ends if s.low < e < s.high):
        if p - breaks[-1] > least and s.high - p > least:
            breaks.append(p)
    breaks.append(s.high)
    # breaks nearer than `least` were joined
    hulls = [_hull(cuts, slopes, a - error - least, b + error + least) for a, b in pairwise(breaks)]
    found = [_box(hull) for hull in hulls]
    count = max(len(box) for box in found) if error else 1
    intervals = Patches(0, tuple(breaks))
    nothing = np.zeros_like(hulls[0][0])
    return [
        MatrixFunction(
            intervals,
            np.array([box[i] if i < len(box) else nothing for box in found]),
            ((s.low, s.high),),
        )
        for i in range(count)
    ]


def _box(hull: Array) -> list[Array]:
    """Return S_0, S_1 .. such that S_0 + sum_i m_i S_i, |m_i| <= 1, contains the convex hull: the
    principal directions of the hull with each entry scaled by its spread, each as long as the hull
    reaches in it. Directions are added until only rounding is left of any entry.
    """
    centre = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
    flat = (hull - centre).reshape(len(hull), -1)
    spread = np.abs(flat).max(axis=0)
    moves = spread > 0
    unit = flat[:, moves] / spread[moves]
    _, _, directions = np.linalg.svd(unit, full_matrices=False)
    out = [centre]
    for d in directions:
        if np.abs(unit).max(initial=0.0) <= ROUNDING:
            break
        share = unit @ d
        whole = np.zeros(centre.size)
        whole[moves] = np.abs(share).max() * d * spread[moves]
        out.append(whole.reshape(centre.shape))
        unit = unit - np.outer(share, d)
    return out


def _derivative(K: LPVStateSpace, M: Array, s: Scheduling) -> tuple[list[float], list[Array]]:
    """Return the ends of the pieces of K, and the Bernstein coefficients (degree, ..) of its slope
    on each.

    A jump is one of an entry beside its own terms, whatever stands in the others.
    """
    pieces = function_pieces(K.basis, s.low, s.high)
    slopes, end = [], None
    for piece in pieces:
        first, last = (
            (
                np.tensordot(piece.bernstein[:, at], M, axes=1),
                np.tensordot(np.abs(piece.bernstein[:, at]), np.abs(M), axes=1),
            )
            for at in (0, -1)
        )
        if end is not None and np.any(np.abs(first[0] - end[0]) > ROUNDING * (first[1] + end[1])):
            raise InputError(
                f"the controller jumps at {s.name} = {piece.low:g} {s.unit}: a wrong reading there"
                " changes it at once; make a table of it, or give it a continuous basis"
            )
        end = last
        slopes.append(_slope(piece, M, K.basis.constant()))
    return [*(piece.low for piece in pieces), pieces[-1].high], slopes


def _slope(piece: Piece, M: Array, one: Array) -> Array:
    """Return the Bernstein coefficients (degree, ..) of the slope on a piece; exactly zero for a
    constant entry.
    """
    degree, width = piece.bernstein.shape[1] - 1, piece.high - piece.low
    if degree == 0:
        return np.zeros((1, *M.shape[1:]))
    of_each = degree * np.diff(piece.bernstein, axis=1) / width
    if np.all(one == 1.0):  # the slopes add up to zero, so that any matrix may be taken away
        M = M - M[int(np.argmax(np.abs(of_each).max(axis=1)))]
    return np.tensordot(of_each.T, M, axes=1)


def _hull(cuts: list[float], slopes: list[Array], low: float, high: float) -> Array:
    """Return matrices (N, ..) whose convex hull contains the slope for p from `low` to `high`."""
    found = []
    for (a, b), slope in zip(pairwise(cuts), slopes, strict=True):
        start, stop = max(a, low), min(b, high)
        if start < stop:
            local = restriction(len(slope) - 1, (start - a) / (b - a), (stop - a) / (b - a))
            found.append(np.tensordot(local, slope, axes=1))
    return np.concatenate(found)


def _reached(S: list[Array]) -> tuple[Array, list[int]]:
    """Return U (rows, r) and r rows with S = U S[those rows] for every slope, r >= 1.

    A row is left out where the others give all its entries, each to its own rounding.
    """
    whole = np.concatenate(list(np.concatenate(S)), axis=1)
    used = np.flatnonzero(np.any(whole != 0, axis=1))
    if not len(used):
        return np.eye(len(whole), 1), [0]
    size, column = equilibrate(np.abs(whole[used]))
    scaled = size[:, None] * whole[used] * column
    _, R, order = linalg.qr(scaled.T, mode="economic", pivoting=True)  # type: ignore[misc]
    U = np.zeros((len(whole), len(used)))
    U[used, np.arange(len(used))] = 1.0
    kept = list(used)
    for r in range(1, min(len(used), *scaled.shape)):
        if R[r - 1, r - 1] == 0.0:
            break
        few, rest = order[:r], order[r:]
        share = linalg.solve_triangular(R[:r, :r], R[:r, r:]).T
        missed = np.abs(scaled[rest] - share @ scaled[few])
        if np.all(missed <= ROUNDING * np.abs(scaled[rest])):
            U, kept = np.zeros((len(whole), r)), [int(k) for k in used[few]]
            U[used[few], np.arange(r)] = 1.0
            U[used[rest]] = share * size[few] / size[rest][:, None]
            break
    return U, [int(k) for k in kept]
