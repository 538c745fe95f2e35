"""A controller that reads a wrong parameter: its loop for every error within a bound.

It is at K(p + b) where the plant is at p, and K(p + b) = K(p) + b K[p, p + b] with the divided
difference K[p, q], the mean of the slopes of K between p and q. On a short interval of p that mean
lies in the convex hull of the Bernstein coefficients of the slope wherever p + b may be; a centre
S(p), constant on each interval, leaves a remainder of which a norm is known:

    [x_K(k+1); u] = K(p) y~ + d,    y~ = (x_K, y),    d = b S(p) y~ + b (K[p, p + b] - S(p)) y~.

Both terms are blocks of bounded norm, b I by the largest error and the remainder by what it can be
times that: an `UncertainStateSpace` holds every motion of b, and more. Nothing is linearized.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace, Patches, Scheduling, UncertainStateSpace
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lower_feedback import Channels, Generalized
from symheli.lpv.matrix_function import MatrixFunction, block, functions_of, in_one_basis
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, signals
from synthesis.cover import Remainder
from synthesis.design.as_controller import as_controller
from synthesis.design.balanced_block import balanced
from synthesis.polynomial.bernstein import restriction

if TYPE_CHECKING:
    from synthesis.design.plant import Plant

Array = np.ndarray

JUMP = 1e-9
"""A controller that changes by more than this fraction of its size at one p has no slope there."""
RANK = 1e-12
"""Directions that the slope reaches by less than this fraction are left to the remainder."""


def with_wrong_parameter(
    plant: Plant, controller: Any, error: float, *, divisions: int = 8
) -> UncertainStateSpace:
    """The loop of a controller that reads p + b instead of p, for every b(t) with |b| <= `error`.

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
    >>> from symheli.lpv import LPVStateSpace, Scheduling
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
    >>> wrong = synthesis.with_wrong_parameter(plant, gain, 0.1)  # the pole within .77 and .83
    >>> print(round(synthesis.l2_gain(wrong, 0.1, search=None).gamma, 3), round(0.1 / 0.17, 3))
    0.588 0.588
    """
    if not (np.isfinite(error) and error >= 0):
        raise InputError(f"error: expected a number >= 0 in the unit of p, got {error!r}")
    if isinstance(divisions, bool) or not isinstance(divisions, int) or divisions < 1:
        raise InputError(f"divisions: expected an integer >= 1, got {divisions!r}")
    if len(plant.parameters) != 1:
        raise InputError(
            "a wrong reading is that of one parameter; the plant has"
            f" {', '.join(s.name for s in plant.parameters)}"
        )
    K = _scheduled(as_controller(controller, plant.controls, plant.measurements), plant)
    loop = _Opened.of(plant, K)
    S, rest = _slopes(K, plant.parameters[0], error, divisions)
    U = _reached(S.coefficients)
    seen = MatrixFunction(S.basis, U.T @ S.coefficients, S.box)
    enters, leaves = [error * U], [seen]
    if rest is not None:
        enters.append(np.diag(rest.rows))
        leaves.append(rest.columns)
    T, alpha = balanced(loop.response(enters, leaves), U.shape[1])
    scales = (T, np.linalg.inv(T)), (alpha, 1 / alpha)
    enters = [d * a if np.isscalar(a) else d @ a for d, (a, _) in zip(enters, scales)]
    leaves = [
        MatrixFunction(v.basis, b * v.coefficients if np.isscalar(b) else b @ v.coefficients, v.box)
        for v, (_, b) in zip(leaves, scales)
    ]
    return loop.closed(enters, leaves, error)


class _Opened:
    """The loop under K(p), to whose [x_K(k+1); u] d is added, and that shows y~ = (x_K, y).

    A .. D of it as functions of p, with the inputs (w, d) and the outputs (z, y~); w and z hold the
    channels of the plant's own block, if it has one.
    """

    def __init__(self, plant: Plant, K: LPVStateSpace, parts: dict[str, MatrixFunction]) -> None:
        self.plant, self.K, self.parts = plant, K, parts

    @classmethod
    def of(cls, plant: Plant, K: LPVStateSpace) -> _Opened:
        own = plant.model
        model = own.model if isinstance(own, UncertainStateSpace) else own
        w, z = list(plant.disturbances), list(plant.performance)
        if isinstance(own, UncertainStateSpace):
            w += own.perturbation_inputs
            z += own.perturbation_outputs
        at = Channels(
            *([model.inputs.index(s) for s in group] for group in (w, K.outputs)),
            *([model.outputs.index(s) for s in group] for group in (z, K.inputs)),
        )
        P = Generalized.of(functions_of(model), at)
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
        B2 = block([[_constant(zero((nx, n)), P.A), P.B2], [_constant(np.eye(n), P.A),
                    _constant(zero((n, len(K.outputs))), P.A)]])  # fmt: skip
        C2 = block([[_constant(zero((n, nx)), P.A), _constant(np.eye(n), P.A)],
                    [P.C2, _constant(zero((ny, n)), P.A)]])  # fmt: skip
        D12 = block([[_constant(zero((nz, n)), P.A), P.D12]])
        parts = {
            "A": A + B2 @ M @ C2, "B": B1 + B2 @ M @ D21, "Bd": B2, "C": C1 + D12 @ M @ C2,
            "D": P.D11 + D12 @ M @ D21, "Dd": D12, "Cy": C2, "Dy": D21,
        }  # fmt: skip
        return cls(plant, K, parts)

    def response(self, enters: list[Array], leaves: list[MatrixFunction]) -> list[Array]:
        """From what enters to what leaves(p) show of y~, at frozen p and some frequencies."""
        model, f = self.plant.nominal, self.parts
        (low, high), dt = model.box[0], model.dt
        p = low + (high - low) * (np.arange(12) + 0.5) / 12
        shown = np.concatenate([v(p) for v in leaves], axis=1)
        A, B, C = f["A"](p), f["Bd"](p) @ np.hstack(enters), shown @ f["Cy"](p)
        fastest = np.abs(np.linalg.eigvals(A)).max() if dt is None else np.pi / dt
        omega = np.geomspace(1e-3 * fastest, fastest, 24)
        s = 1j * omega if dt is None else np.exp(1j * omega * dt)
        one = np.eye(A.shape[-1])
        return [C @ np.linalg.solve(at * one - A, B) for at in s]

    def closed(
        self, enters: list[Array], leaves: list[MatrixFunction], error: float
    ) -> UncertainStateSpace:
        """With d = sum of enters d_i, v_i = leaves(p) y~, all blocks one of norm 1."""
        f, plant, own = self.parts, self.plant, self.plant.model
        w, z = len(plant.disturbances), len(plant.performance)
        bound = own.bound if isinstance(own, UncertainStateSpace) else 1.0
        size = np.full(f["B"].shape[1], bound)
        size[:w] = 1.0
        d = np.concatenate(enters, axis=1)
        B = block([[f["B"] @ np.diag(size), f["Bd"] @ d]])
        C = block([[f["C"]], *([M @ f["Cy"]] for M in leaves)])
        through = block([[f["D"] @ np.diag(size), f["Dd"] @ d]])
        seen = block(
            [
                [M @ f["Dy"] @ np.diag(size), _constant(np.zeros((M.shape[0], d.shape[1])), f["A"])]
                for M in leaves
            ]
        )
        D = block([[through], [seen]])
        basis, (a, b, c, e) = in_one_basis([f["A"], B, C, D], plant.basis.ranges)
        ins = (*_own(own, "inputs"), *(f"d_{i + 1}" for i in range(d.shape[1])))
        outs = (
            *_own(own, "outputs"),
            *(f"v_{i + 1}" for i in range(sum(M.shape[0] for M in leaves))),
        )
        model = LPVStateSpace(
            basis, a, b, c, e, plant.parameters,
            (*plant.states, *(Signal(f"controller_{s}", s.unit) for s in self.K.states)),
            (*plant.disturbances, *signals(ins)), (*plant.performance, *signals(outs)), plant.dt,
        )  # fmt: skip
        s = plant.parameters[0]
        said = f"the controller reads {s.name} wrong by at most {error:g} {s.unit}, in any motion"
        probability = 1.0
        if isinstance(own, UncertainStateSpace):
            said, probability = f"{own.source}; {said}", own.probability
        assert model.inputs[w:] == signals(ins)  # noqa: S101
        assert model.outputs[z:] == signals(outs)  # noqa: S101
        return UncertainStateSpace(model, signals(ins), signals(outs), 1.0, probability, said)


class _Rest:
    """What the divided difference may miss S(p) by, times the error: diag(rows) Delta columns(p)."""

    def __init__(self, rows: Array, columns: MatrixFunction) -> None:
        self.rows, self.columns = rows, columns


def _own(model: Any, group: str) -> tuple[Signal, ...]:
    found = getattr(model, f"perturbation_{group}", ())
    return tuple(Signal(f"own_{s}", s.unit) for s in found)


def _constant(M: Array, like: MatrixFunction) -> MatrixFunction:
    return MatrixFunction.constant(M, like.box)


def _corner(M: MatrixFunction, rows: int, columns: int, *, first: bool = False) -> MatrixFunction:
    """M with so many rows and columns of zeros more, after it or (rows) before it."""
    before, after = (rows, 0) if first else (0, rows)
    padded = np.pad(M.coefficients, ((0, 0), (before, after), (0, columns)))
    return MatrixFunction(M.basis, padded, M.box)


def _scheduled(given: LinearModel | LPVStateSpace, plant: Plant) -> LPVStateSpace:
    """K over the parameter of the plant, in its sample period."""
    if isinstance(given, LinearModel):
        given = LPVStateSpace.constant(given, plant.parameters)
    mine, own = given.parameters, plant.parameters[0]
    if len(mine) != 1 or mine[0].name != own.name or mine[0].unit != own.unit:
        raise InputError(
            f"the controller reads {', '.join(s.name for s in mine)}, the plant moves with"
            f" {own.name}: both must be over the same one parameter"
        )
    slack = 1e-9 * (own.high - own.low)
    if mine[0].low > own.low + slack or mine[0].high < own.high - slack:
        raise InputError(
            f"the controller is known on [{mine[0].low:g}, {mine[0].high:g}] {own.unit}, the plant"
            f" on [{own.low:g}, {own.high:g}]: narrow the plant, .with_scheduling(...)"
        )
    if given.states and not same_period(plant.dt, given.dt):
        raise InputError("plant and controller must have one sample period, .discretize(dt)")
    return given


def _slopes(
    K: LPVStateSpace, s: Scheduling, error: float, divisions: int
) -> tuple[MatrixFunction, _Rest | None]:
    """S(p), constant on intervals, and the remainder times the error."""
    M = np.block([[K.A, K.B], [K.C, K.D]])
    cuts, slopes = _derivative(K, M, s)
    ends = {s.low, s.high, *cuts}
    if len(slopes) == 1 and len(slopes[0]) > 1 or any(len(c) > 1 for c in slopes):
        ends |= {float(p) for p in np.linspace(s.low, s.high, divisions + 1)}
    ends |= {k + side * error for k in cuts[1:-1] for side in (-1.0, 1.0)}
    least = 1e-6 * (s.high - s.low)
    breaks = [s.low]
    for p in sorted(e for e in ends if s.low < e < s.high):
        if p - breaks[-1] > least and s.high - p > least:
            breaks.append(p)
    breaks.append(s.high)
    centres, reach = [], []
    for a, b in pairwise(breaks):
        # a little more than the error, for breaks that were joined
        hull = _hull(cuts, slopes, a - error - least, b + error + least)
        centre = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
        centres.append(centre)
        reach.append(hull - centre)
    box = ((s.low, s.high),)
    intervals = Patches(0, tuple(breaks))
    S = MatrixFunction(intervals, np.array(centres), box)
    every = np.concatenate(reach)
    size = np.abs(np.concatenate(centres)).max(initial=0.0)
    if error == 0 or np.abs(every).max(initial=0.0) <= RANK * size:
        return S, None
    rest = Remainder.of(every)
    norms = np.array(
        [
            np.linalg.norm(r / (rest.rows[:, None] * rest.columns), 2, axis=(1, 2)).max()
            for r in reach
        ]
    )
    columns = MatrixFunction(
        intervals, error * norms[:, None, None] * np.diag(rest.columns)[None], box
    )
    return S, _Rest(rest.rows, columns)


def _derivative(K: LPVStateSpace, M: Array, s: Scheduling) -> tuple[list[float], list[Array]]:
    """Ends of the pieces of K, and the Bernstein coefficients (degree, ..) of its slope on each."""
    cuts, slopes, end = [], [], None
    size = np.abs(M).max(initial=0.0)
    for piece in K.basis.pieces():
        values = np.tensordot(piece.bernstein.T, M, axes=1)
        if end is not None and np.abs(values[0] - end).max(initial=0.0) > JUMP * size:
            raise InputError(
                f"the controller jumps at {s.name} = {piece.low:g} {s.unit}: a wrong reading there"
                " changes it at once; make a table of it, or give it a continuous basis"
            )
        end = values[-1]
        degree = len(values) - 1
        slope = degree * np.diff(values, axis=0) if degree else np.zeros_like(values)
        slopes.append(slope / (piece.high - piece.low))
        cuts.append(piece.low)
    return [*cuts, K.basis.pieces()[-1].high], slopes


def _hull(cuts: list[float], slopes: list[Array], low: float, high: float) -> Array:
    """Matrices (N, ..) in whose convex hull the slope is for p from `low` to `high`."""
    found = []
    for (a, b), slope in zip(pairwise(cuts), slopes, strict=True):
        start, stop = max(a, low), min(b, high)
        if start < stop:
            local = restriction(len(slope) - 1, (start - a) / (b - a), (stop - a) / (b - a))
            found.append(np.tensordot(local, slope, axes=1))
    return np.concatenate(found)


def _reached(S: Array) -> Array:
    """An orthonormal basis (rows, r) of all that the slopes reach, r >= 1."""
    side_by_side = np.concatenate(list(S), axis=1)
    U, values, _ = np.linalg.svd(side_by_side, full_matrices=False)
    return U[:, : max(1, int(np.sum(values > RANK * values[0])))]
