"""State-space models: the subspace method, then the least prediction error over all matrices."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from identification.design.excitation import excitation_of
from identification.estimators.innovations import Innovations
from identification.estimators.method import Method
from identification.estimators.prediction_error import ADVICE, OutputError, PredictionError
from identification.estimators.state_space_trim import Trim
from identification.estimators.subspace import Piece, Subspace, subspace_start
from identification.model.state_space_model import (
    StateSpaceModel,
    design_matrices,
    pieces_of,
    spread_of,
    start_of,
)
from identification.model.state_space_run import Along, StateSpaceRun
from identification.structure.regressors import basis_values, stacked, units_of
from identification.structure.state_space import StateSpace
from symheli import LPVStateSpace, Scheduling
from symheli.errors import ConvergenceWarning, DataWarning, ExcitationError, InputError
from symheli.progress import task
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array

GAINS: tuple[float, ...] = (1.0, 0.5, 0.2, 0.0)
"""Shares of the gain K, and of what moves with p, that the search may begin with."""

RADIUS = 0.99
"""Largest eigenvalue of the mean A of the candidate that diverges in no case."""

UNSEEN = 1e-12
"""Share of the largest information below which a direction is not seen in the response."""

DAMPING, LARGEST_DAMPING, FLAT = 1e-3, 1e6, 2
"""Damping a search begins with and ends at; number of steps in a row that gain too little."""

NEAR, BENT = 0.1, 0.375
"""Part of a step over which curvature is measured; largest bend of a step, as a share of it."""

VISITED, GROWN, LONG = 50, 20.0, 200
"""Number of places of p at which a filter is looked at; growth along a record that is none, and
samples of it that count where growth is only estimated.
"""

HELD = 2**25
"""Largest number of slopes that are kept to measure curvature with: 256 MB."""

ROUGH = 1e-4
"""Relative change of the cost at which a search that others follow ends."""

TRIM = 10.0
"""Mean of an output, in its spreads, that is a trim."""

LAGS, WIDEST = 25, 20
"""Samples over which errors of a free run may be correlated; least rows for each of these."""

COMPLETE = 0.05
"""Share of complete rows from which the covariance of outputs is that of these."""

FLOOR = 1e-6
"""Least deviation of an innovation, as a share of its output's spread, that weighs."""


def state_space_of(
    structure: StateSpace, records: Sequence[FlightRecord], method: Method
) -> StateSpaceModel:
    """The model by the subspace method, and from there the least error of the free run or of the
    innovation filter over all matrices and the states that runs start from.

    Every basis of the states serves: steps go along the directions that change the response, by
    the eigenvectors of the information, as in the data-driven local coordinates of McKelvey,
    Helmersson and Ribarits (2004), Automatica 40. Raises `ExcitationError` where no record has a
    stretch long enough, or an input does not tell its functions of p.
    """
    records = tuple(structure.regression.prepared(record) for record in records)
    method = _required(structure, method)
    _require_values(structure, records, noisy=not isinstance(method, OutputError))
    pieces = [Piece(*found[1:]) for record in records for found in pieces_of(structure, record)]
    _require_enough(StateSpaceRun(structure, not isinstance(method, OutputError)), pieces)
    trim = Trim.of(structure, pieces)
    pieces = pieces if trim is None else trim.less(pieces)
    begin = subspace_start(structure, pieces, method.past if isinstance(method, Subspace) else None)
    problem = Problem(StateSpaceRun(structure, not isinstance(method, OutputError)), pieces)
    if isinstance(method, OutputError) and not structure.own_scheduling:
        _warn_of_growth(problem, begin.unknowns)
    z = problem.best_of(_starts(problem, begin.unknowns))
    details = {"singular_values": begin.singular_values.tolist()}
    problem = replace(problem, guarded=problem.forgets(z))
    if not isinstance(method, Subspace):
        z, problem, more = _searched(problem, z, method)
        details |= more
    z[: problem.run.size] = _calmed(problem.run, z[: problem.run.size])
    found = _model(problem, z, records, method.shorthand, details)
    return found if trim is None else trim.back(found)


def _require_values(structure: StateSpace, records: Sequence[FlightRecord], *, noisy: bool) -> None:
    """Raise `ExcitationError` where a signal has no values, no output moves, or an input does not
    tell its functions of p. Warn (`DataWarning`) of trims, and where inputs tell too little of
    states that no noise excites.
    """
    arx = structure.regression
    for name in (*arx.outputs, *arx.inputs, *arx.parameters):
        if not any(np.isfinite(record[name]).any() for record in records):
            raise ExcitationError(f"{name} has no values in the records: leave it out")
    if all(np.nanmin(values) == np.nanmax(values) for values in _all_of(arx.outputs, records)):
        raise ExcitationError(f"{', '.join(arx.outputs)}: no output moves in the records")
    if not structure.offset and not structure.own_scheduling:
        _warn_of_trims(arx.outputs, records)
    inputs = replace(arx, na=0, nb=1)
    given = {*arx.outputs} - {*arx.parameters}  # outputs may all be missing at different times
    there = [
        record.with_signals(
            {str(s): s.unit for s in record.signals if str(s) in given},
            **{name: np.zeros(len(record)) for name in given},
        )
        for record in records
    ]
    excitation_of(inputs, stacked(inputs, there)).require()
    if not noisy:
        _warn_of_poor_inputs(structure, there)


def _warn_of_poor_inputs(structure: StateSpace, records: Sequence[FlightRecord]) -> None:
    """Warn (`DataWarning`) where the inputs of twice as many samples as states are dependent, and
    their rank times the number of outputs is below the number of unknowns.
    """
    rich = replace(structure.regression, na=0, nb=2 * structure.order)
    data, run = stacked(rich, records), StateSpaceRun(structure)
    rank, unknown = excitation_of(rich, data).rank, run.size - run.undetermined
    told = len(rich.outputs) * rank
    if len(data.phi) > 2 * rich.n_regressors > 2 * rank and told < unknown:
        warnings.warn(
            DataWarning(
                f"the inputs tell {told} numbers at most, the matrices have {unknown}: the rest is"
                " noise; excite at more frequencies, or take fewer states"
            ),
            stacklevel=5,
        )


def _warn_of_trims(names: Sequence[str], records: Sequence[FlightRecord]) -> None:
    """Warn (`DataWarning`) of outputs whose mean is far larger than what moves."""
    for name, values in zip(names, _all_of(names, records), strict=True):
        mean, spread = float(np.nanmean(values)), float(np.nanstd(values))
        if abs(mean) > TRIM * spread > 0.0:
            warnings.warn(
                DataWarning(
                    f"{name} moves by {spread:.2g} about {mean:.4g}, which no state of a linear"
                    " model explains: take offset=True, or subtract its trim"
                ),
                stacklevel=5,
            )


def _all_of(names: Sequence[str], records: Sequence[FlightRecord]) -> list[Array]:
    return [np.concatenate([record[name] for record in records]) for name in names]


def _require_enough(run: StateSpaceRun, pieces: Sequence[Piece]) -> None:
    """Raise `ExcitationError` for no stretch that is long enough, or no more values of outputs than
    unknowns.
    """
    nx = run.structure.order
    if not pieces:
        raise ExcitationError(
            f"no stretch of more than {nx} samples in which all inputs and p are known"
        )
    values = sum(int(np.isfinite(piece.y).sum()) for piece in pieces)
    unknown = run.size - run.undetermined + nx * len(pieces)
    if values <= unknown:
        raise ExcitationError(
            f"{values} values of outputs in {len(pieces)} unbroken stretches cannot determine"
            f" {unknown} unknowns: record longer, without gaps in inputs and p, or take fewer"
            " states or a smaller basis"
        )


def _required(structure: StateSpace, method: Method) -> OutputError | Innovations | Subspace:
    """The method; raises `InputError` for one that does not find these states, or options that it
    does not take.
    """
    if not isinstance(method, OutputError | Innovations | Subspace) or (
        type(method).shorthand not in ("oe", "innovations", "subspace")
    ):
        raise InputError(
            "a StateSpace is fitted by the closest free run, OutputError(...), by Innovations(...)"
            f" or Subspace(...), got {method.shorthand!r}"
        )
    if isinstance(method, PredictionError) and (
        method.instruments is not None or getattr(method, "initial", "estimated") != "estimated"
    ):
        raise InputError(
            "instruments and initial are of difference equations: states begin with the subspace"
            " method, and from an estimated start"
        )
    if structure.own_scheduling and not isinstance(method, OutputError):
        raise InputError(
            "own_scheduling: the model's own free run is fitted by OutputError(...), got"
            f" {method.shorthand!r}"
        )
    return method


def _warn_of_growth(problem: Problem, unknowns: Array) -> None:
    """Warn (`DataWarning`) where the subspace start grows: no free run follows such a plant."""
    A = StateSpaceRun(problem.run.structure, innovations=True).matrices(unknowns)[0]
    radius = float(np.abs(np.linalg.eigvals(np.tensordot(problem.visited, A, 1))).max())
    length = min(max(len(piece.y) for piece in problem.pieces), LONG)
    if radius**length > GROWN:
        warnings.warn(
            DataWarning(
                f"the subspace start has modes that grow by {radius - 1:.2g} a sample: a free run"
                ' cannot follow them, and may call stable what is not; fit by "innovations"'
            ),
            stacklevel=4,
        )


class Information(NamedTuple):
    """Sum of squares, gradient (n,) and information (n, n) of unknowns; errors by piece, and their
    slopes with the unknowns they belong to, where these are few enough to be held.
    """

    cost: float
    gradient: Array
    square: Array
    errors: list[Array]
    slopes: list[tuple[int, slice, Array, Array]]

    def curvature(self, problem: Problem, z: Array, step: Array) -> Array | None:
        """Slopes (n,) times the second derivative of the errors along a step; None where it is not
        known.
        """
        if not self.slopes:
            return None
        before, after = problem.errors(z - NEAR * step), problem.errors(z + NEAR * step)
        out = np.zeros(len(z))
        with np.errstate(invalid="ignore", over="ignore"):  # a run beside this one may diverge
            for i, rows, at, part in self.slopes:
                bent = (after[i][rows] - 2.0 * self.errors[i][rows] + before[i][rows]) / NEAR**2
                out[at] += part.T @ bent.reshape(-1)
        return out if np.isfinite(out).all() else None


@dataclass(frozen=True, eq=False)
class Problem:
    """Prediction errors of all pieces, weighted by `weight` (ny, ny), over the matrices and the
    start of each piece.
    """

    run: StateSpaceRun
    pieces: Sequence[Piece]
    weight: Array | None = None
    held: bool = False
    """Whether the gain K stays as it is."""
    guarded: bool = False
    """Whether runs whose filter forgets nothing count as diverging: with the right start they show
    small errors, whatever their matrices.
    """

    @cached_property
    def scale(self) -> Array:
        """Spread (ny,) of the outputs."""
        return spread_of(np.concatenate([piece.y for piece in self.pieces]))

    @cached_property
    def units(self) -> Array:
        """Units (n,) of the unknowns, in which no choice of units for the signals shows."""
        size = np.sqrt(np.mean(np.concatenate([piece.u for piece in self.pieces]) ** 2, axis=0))
        matrices = self.run.units(self.scale, np.where(size > 0, size, 1.0))
        return np.append(matrices, np.ones(len(self.pieces) * self.run.structure.order))

    @property
    def weights(self) -> Array:
        """(ny, ny), by which rows of errors are multiplied."""
        return np.diag(1.0 / self.scale) if self.weight is None else self.weight

    def own(self, i: int) -> slice:
        """Positions of the start of piece i among the unknowns."""
        nx = self.run.structure.order
        return slice(self.run.size + i * nx, self.run.size + (i + 1) * nx)

    def along(self, z: Array, i: int) -> Along:
        """Piece i run with the unknowns."""
        y, u, p = self.pieces[i]
        fed = y if self.run.innovations else None
        return self.run.along(z[: self.run.size], z[self.own(i)], u, p, fed)

    def left(self, z: Array, i: int) -> Array:
        """(m, ny) prediction errors of piece i, less their sign; NaN where y is missing."""
        return self.along(z, i).y - self.pieces[i].y

    def errors(self, z: Array) -> list[Array]:
        """Weighted errors (m, ny) of each piece, 0 where y is missing."""
        return [self._weighted(self.along(z, i), piece) for i, piece in enumerate(self.pieces)]

    def _weighted(self, found: Along, piece: Piece) -> Array:
        with np.errstate(all="ignore"):
            return np.where(np.isfinite(piece.y), found.y - piece.y, 0.0) @ self.weights

    @cached_property
    def visited(self) -> Array:
        """Functions of p (rows, n) at places that the records visit."""
        p = np.concatenate([piece.p for piece in self.pieces])
        p = p[np.isfinite(p.reshape(len(p), -1)).all(axis=1)]
        even = np.linspace(0, len(p) - 1, VISITED).astype(int)
        ends = [pick(p.reshape(len(p), -1), axis=0) for pick in (np.argmin, np.argmax)]
        return basis_values(self.run.structure.regression, p[np.unique([*even, *np.ravel(ends)])])

    def forgets(self, z: Array) -> bool:
        """Whether a filter with p held at these places lets go of its start along the longest
        piece, or at least does not grow by more than `GROWN`.
        """
        A, _, C, _, K = self.run.matrices(z[: self.run.size])
        if not K.size:
            return True
        filters = np.tensordot(self.visited, A - K @ C, 1)
        if not np.isfinite(filters).all():
            return False
        radius = float(np.abs(np.linalg.eigvals(filters)).max())
        return radius <= GROWN ** (1.0 / max(len(piece.y) for piece in self.pieces))

    def drawn_in(self, z: Array) -> Array:
        """The unknowns with as much of the gain as lets a guarded filter forget its start."""
        if not self.guarded or self.forgets(z):
            return z
        for share in np.linspace(0.9, 0.0, 10):
            other = z.copy()
            other[self.run.gains] *= share
            if self.forgets(other):
                return other
        return z

    def cost(self, z: Array) -> float:
        """The sum of squares; infinite where a run diverges."""
        if self.guarded and not self.forgets(z):
            return np.inf
        with np.errstate(all="ignore"):
            total = sum(float(np.sum(error**2)) for error in self.errors(z))
        return total if np.isfinite(total) else np.inf

    def information(self, z: Array) -> Information:
        """Cost, gradient and Gauss-Newton information, summed up block by block."""
        first, cost = self.run.size, 0.0
        square, gradient = np.zeros((len(z), len(z))), np.zeros(len(z))
        held = sum(piece.y.size for piece in self.pieces) * len(z) < HELD
        errors: list[Array] = []
        kept: list[tuple[int, slice, Array, Array]] = []
        for i, piece in enumerate(self.pieces):
            found, seen = self.along(z, i), np.isfinite(piece.y)
            errors.append(self._weighted(found, piece))
            cost += float(np.sum(errors[i] ** 2))
            at = np.r_[0:first, self.own(i)]
            for rows, slopes in self.run.slopes(z[:first], found):
                if self.held:
                    slopes[:, :, self.run.gains] = 0.0
                part = np.matmul(self.weights.T, slopes * seen[rows, :, None])
                part = part.reshape(-1, len(at))
                square[np.ix_(at, at)] += part.T @ part
                gradient[at] += part.T @ errors[i][rows].reshape(-1)
                if held:
                    kept.append((i, rows, at, part))
        return Information(cost, gradient, square, errors, kept)

    def correlated(self, z: Array) -> Array:
        """Covariance (n, n) of the gradient where errors are correlated over some samples and the
        inputs are not correlated with them: of the free run.
        """
        size, errors = self.run.size, self.errors(z)
        rows = sum(map(len, errors))
        seen = sum(int(np.isfinite(piece.y).any(axis=1).sum()) for piece in self.pieces)
        lags = min(LAGS, rows // WIDEST)
        ny, out = len(self.scale), np.zeros((len(z), len(z)))
        R = np.zeros((lags + 1, ny, ny))  # e(k) e(k + l)', tapered (Bartlett)
        for error in errors:
            for lag in range(min(lags + 1, len(error))):
                R[lag] += error[: len(error) - lag].T @ error[lag:]
        R *= (1.0 - np.arange(lags + 1) / (lags + 1.0))[:, None, None] / max(seen, 1)
        for i, piece in enumerate(self.pieces):
            at, there = np.r_[0:size, self.own(i)], np.isfinite(piece.y)
            for part, slopes in self.run.slopes(z[:size], self.along(z, i)):
                own = np.matmul(self.weights.T, slopes * there[part, :, None])
                later = 0.5 * np.matmul(R[0], own)
                for lag in range(1, min(lags + 1, len(own))):
                    later[:-lag] += np.matmul(R[lag], own[lag:])
                half = own.reshape(-1, len(at)).T @ later.reshape(-1, len(at))
                out[np.ix_(at, at)] += half + half.T
        return out

    def best_of(self, candidates: Sequence[Array]) -> Array:
        """The unknowns of least cost, each piece started from the state that suits it best; of
        filters those that forget their start where there are any.

        Raises `InputError` where every run diverges.
        """
        tried: list[tuple[bool, float, Array]] = []
        for unknowns in candidates:
            starts = [
                start_of(self.run, unknowns[: self.run.size], *piece) for piece in self.pieces
            ]
            z = np.concatenate([unknowns[: self.run.size], *starts])
            cost = self.cost(z)
            tried.append((not (np.isfinite(cost) and self.forgets(z)), cost, z))
        _, cost, z = min(tried, key=lambda each: each[:2])
        if not np.isfinite(cost):
            raise InputError(
                "every run from the subspace start diverges: fit over shorter records, or with"
                " another order"
            )
        return z

    def weighted(self, z: Array) -> Problem:
        """The same with errors made white: the likelihood of correlated innovations."""
        covariance = self.residual_covariance(z) + np.diag((FLOOR * self.scale) ** 2)
        return replace(self, weight=np.linalg.inv(np.linalg.cholesky(covariance)).T, held=False)

    def residual_covariance(self, z: Array) -> Array:
        """(ny, ny) of complete rows; where these are few, of each output by itself."""
        errors = np.concatenate([self.left(z, i) for i in range(len(self.pieces))])
        complete = errors[np.isfinite(errors).all(axis=1)]
        if len(complete) >= COMPLETE * len(errors):
            return complete.T @ complete / max(len(complete), 1)
        return np.diag(np.nanmean(errors**2, axis=0))


def _starts(problem: Problem, unknowns: Array) -> list[Array]:
    """The unknowns with parts of what moves with p, and with innovations of their gain; with the
    gain of an observer at the middle of p; and with what diverges in no case.
    """
    structure, scale = problem.run.structure, problem.scale
    run = StateSpaceRun(structure, innovations=True)
    A, B, C, D, K = run.matrices(unknowns)
    one = structure.basis.constant()
    still = [np.multiply.outer(one, np.tensordot(one, M, 1) / (one @ one)) for M in (A, B, K)]
    middle = structure.basis(_middle(structure))
    calm = np.tensordot(middle, still[0], 1)
    drawn_in = RADIUS / max(np.abs(np.linalg.eigvals(calm)).max(), RADIUS)
    gains, shares, now = [0.0 * K], GAINS[:1], np.tensordot(middle, A, 1)
    if problem.run.innovations:
        gains, shares = [K, still[2]], GAINS
        try:
            error = solve_discrete_are(now.T, C.T, np.eye(len(now)), np.diag(scale**2))
        except (np.linalg.LinAlgError, ValueError):  # no such gain: the others do
            pass
        else:
            fed = np.linalg.solve(C @ error @ C.T + np.diag(scale**2), C @ error @ now.T).T
            gains.append(np.multiply.outer(one, fed))
    out = []
    for moving in GAINS:
        a, b = (s + moving * (M - s) for s, M in zip(still[:2], (A, B), strict=True))
        out += [run.unknowns(a, b, C, D, share * gain) for gain in gains for share in shares]
    return [*out, run.unknowns(drawn_in * still[0], B, C, D, 0.0 * K)]


def _calmed(run: StateSpaceRun, unknowns: Array) -> Array:
    """The unknowns with as much of what moves in K as leaves the filter stable with p held anywhere
    in its range: a record says little of the filter in corners that it does not visit.

    Where no share does, they stay.
    """
    A, B, C, D, K = run.matrices(unknowns)
    if not K.size:
        return unknowns
    f, one = run.structure.basis(run.structure.basis.samples()), run.structure.basis.constant()
    still = np.multiply.outer(one, np.tensordot(one, K, 1) / (one @ one))
    for share in np.linspace(1.0, 0.0, 11):
        gain = still + share * (K - still)
        filters = np.tensordot(f, A - gain @ C, 1)
        if np.abs(np.linalg.eigvals(filters)).max() < 1.0:
            return run.unknowns(A, B, C, D, gain)
    return unknowns


def _middle(structure: StateSpace) -> Array | float:
    """The middle of the range of p."""
    middle = [0.5 * (low + high) for low, high in structure.basis.ranges]
    return middle[0] if len(middle) == 1 else np.array(middle)


def _searched(
    problem: Problem, z: Array, method: OutputError | Innovations
) -> tuple[Array, Problem, dict[str, object]]:
    """The unknowns of least cost; with innovations K is held at first, which errors that are nearly
    zero do not determine, and then their covariance is the weight, twice.
    """
    evaluations, converged, all_, damping = 0, True, method.evaluations, DAMPING
    phases = [(False, method.tolerance, all_)]
    if problem.run.innovations:
        problem, rough = replace(problem, held=True), max(method.tolerance, ROUGH)
        phases = [(False, method.tolerance, all_ // 4), (True, rough, all_ // 4)]
        phases.append((True, method.tolerance, all_))
    for weighted, tolerance, most in phases:
        if weighted:
            problem = problem.weighted(z)
        left = max(min(most, all_ - evaluations), 1)
        found = minimized(problem, z, left, tolerance, method.shorthand, damping)
        z, converged, damping = found.z, found.converged, found.damping
        evaluations += found.evaluations
    if not converged:
        warnings.warn(
            ConvergenceWarning(f"{method.shorthand!r} of states did not settle: {ADVICE}"),
            stacklevel=4,
        )
    message = "settled" if converged else "evaluations used up"
    return z, problem, {"evaluations": evaluations, "converged": converged, "message": message}


class Minimum(NamedTuple):
    """Unknowns, number of evaluations with slopes, whether they settled, damping of a next step."""

    z: Array
    evaluations: int
    converged: bool
    damping: float


def minimized(
    problem: Problem,
    z: Array,
    evaluations: int,
    tolerance: float,
    name: str,
    damping: float = DAMPING,
) -> Minimum:
    """The unknowns by Levenberg-Marquardt steps bent along the curvature of the response.

    A step that only its damping keeps short says nothing of whether they settle.

    Source: Transtrum and Sethna (2012), Improvements to the Levenberg-Marquardt algorithm for
    nonlinear least-squares minimization, arXiv 1201.5885, sec. 4.
    """
    flat, converged = 0, False
    with task(f"{name}: evaluations, at most", evaluations) as search:
        for used in range(1, evaluations + 1):
            search.step()
            now = problem.information(z)
            found = _better(problem, z, now, damping)
            if found is None and damping > DAMPING:  # longer ones may be
                found = _better(problem, z, now, DAMPING)
            if found is None:  # no step of any size is better
                return Minimum(z, used, True, DAMPING)
            step, free, damping, cost = found
            z = z + step
            moved, size = np.linalg.norm(step / problem.units), np.linalg.norm(z / problem.units)
            flat = flat + 1 if free and now.cost - cost <= tolerance * now.cost else 0
            converged = bool((free and moved <= tolerance * size) or flat == FLAT)
            if converged and not (problem.run.innovations and damping > DAMPING):
                break
            if converged:  # once more by long steps: an edge that was met may end
                damping, flat, converged = DAMPING, FLAT - 1, False
    return Minimum(z, used, converged, min(damping, DAMPING))


def _better(
    problem: Problem, z: Array, now: Information, damping: float
) -> tuple[Array, bool, float, float] | None:
    """A step that lowers the cost, whether something else than its first damping keeps it short,
    the damping of the next one, and that cost.
    """
    values, vectors, scale = _directions(now.square, problem.units)
    free = damping * values[-1] <= values[0]

    def solved(gradient: Array) -> Array:
        across = vectors.T @ (gradient / scale)
        return (vectors @ (across / (values + damping * values[-1]))) / scale  # type: ignore[no-any-return]

    while damping <= LARGEST_DAMPING:
        step = -solved(now.gradient)
        curvature = now.curvature(problem, z, step)
        if curvature is not None:
            bend = -0.5 * solved(curvature)
            if np.linalg.norm(scale * bend) <= BENT * np.linalg.norm(scale * step):
                step = step + bend
        step = problem.drawn_in(z + step) - z
        cost = problem.cost(z + step)
        if cost < now.cost:
            return step, bool(free), max(damping / 3.0, 1e-14), cost
        damping, free = 2.0 * damping, True
    return None


def _directions(square: Array, units: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues and eigenvectors of the information in units of `scale`, of what is seen."""
    size = np.sqrt(np.diagonal(square)) * units
    scale = np.maximum(size, 1e-6 * size.max(initial=0.0) + np.finfo(float).tiny) / units
    values, vectors = np.linalg.eigh(square / np.outer(scale, scale))
    seen = values > UNSEEN * values[-1]
    return values[seen], vectors[:, seen], scale


def _model(
    problem: Problem,
    z: Array,
    records: Sequence[FlightRecord],
    shorthand: str,
    details: dict[str, object],
) -> StateSpaceModel:
    run, structure = problem.run, problem.run.structure
    covariance = problem.residual_covariance(z)
    arx, unknowns = structure.regression, z[: run.size]
    parameters = tuple(
        Scheduling(str(p), p.unit, low, high)
        for p, (low, high) in zip(
            units_of(arx.parameters, records), structure.basis.ranges, strict=True
        )
    )
    design = LPVStateSpace(
        structure.basis,
        **design_matrices(run, unknowns),
        parameters=parameters,
        states=[Signal(f"x{i + 1}", "1") for i in range(structure.order)],
        inputs=units_of(arx.inputs, records),
        outputs=units_of(arx.outputs, records),
        dt=records[0].dt,
    )
    known = None
    if shorthand != Subspace.shorthand:
        known = _covariance(problem, z)[: run.size, : run.size]
        known = known.reshape(1, run.size, 1, run.size)
    return StateSpaceModel(
        structure=structure,
        unknowns=unknowns,
        state_space=design,
        residual_covariance=covariance,
        method=shorthand,
        covariance=known,
        details=details,
    )


def _covariance(problem: Problem, z: Array) -> Array:
    """(n, n) of all unknowns along what is seen, for as many residuals as the unknowns leave free:
    the inverse information where residuals are innovations; of a free run what residuals that are
    correlated over some samples make of it.
    """
    white = problem.weighted(z)
    values, vectors, scale = _directions(white.information(z).square, problem.units)
    kept = len(z) - problem.run.undetermined
    values, vectors = values[-kept:], vectors[:, -kept:]
    unseen = kept - problem.run.gains.size - len(values)
    if unseen > 0:
        warnings.warn(
            DataWarning(
                f"{unseen} of {kept} directions of the matrices do not show in these records, and"
                " the covariance is without them: take fewer states, or excite more richly"
            ),
            stacklevel=5,
        )
    count = sum(int(np.isfinite(piece.y).sum()) for piece in problem.pieces)
    free = count / max(count - len(values), 1)
    root = vectors / np.sqrt(values) / scale[:, None]
    if problem.run.innovations:
        return free * root @ root.T
    root = root / np.sqrt(values)
    across = vectors.T @ (white.correlated(z) / np.outer(scale, scale)) @ vectors
    return free * root @ across @ root.T
