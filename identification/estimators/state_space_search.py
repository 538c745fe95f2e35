"""State-space models: the subspace method, then the least prediction error over all matrices."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from identification.design.excitation import excitation_of
from identification.estimators.innovations import Innovations
from identification.estimators.method import Method
from identification.estimators.prediction_error import ADVICE, OutputError
from identification.estimators.subspace import Piece, Subspace, subspace_start
from identification.model.state_space_model import (
    StateSpaceModel,
    design_matrices,
    pieces_of,
    start_of,
)
from identification.model.state_space_run import Along, StateSpaceRun
from identification.structure.regressors import stacked, units_of
from identification.structure.state_space import StateSpace
from symheli import LPVStateSpace, Scheduling
from symheli.errors import ConvergenceWarning, ExcitationError, InputError
from symheli.progress import task
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array

GAINS = (1.0, 0.5, 0.2, 0.0)
"""Shares of the gain K, and of what moves with p, that the search may begin with."""

UNSEEN = 1e-12
"""Share of the largest information below which a direction is not seen in the response."""

LARGEST_DAMPING = 1e8

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
    if not isinstance(method, OutputError | Innovations | Subspace) or (
        type(method).shorthand not in ("oe", "innovations", "subspace")
    ):
        raise InputError(
            "a StateSpace is fitted by the closest free run, OutputError(...), by Innovations(...)"
            f" or Subspace(...), got {method.shorthand!r}"
        )
    if structure.own_scheduling and not isinstance(method, OutputError):
        raise InputError(
            "own_scheduling: the model's own free run is fitted by OutputError(...), got"
            f" {method.shorthand!r}"
        )
    inputs = replace(structure.regression, na=0, nb=1)
    excitation_of(inputs, stacked(inputs, records)).require()
    pieces = [Piece(*found[1:]) for record in records for found in pieces_of(structure, record)]
    if not pieces:
        raise ExcitationError(f"no unbroken stretch of more than {structure.order} samples")
    begin = subspace_start(structure, pieces, method.past if isinstance(method, Subspace) else None)
    problem = Problem(StateSpaceRun(structure, not isinstance(method, OutputError)), pieces)
    z = problem.best_of(_starts(structure, begin.unknowns))
    details = {"singular_values": begin.singular_values.tolist()}
    if not isinstance(method, Subspace):
        z, problem, more = _searched(problem, z, method)
        details |= more
    return _model(problem, z, records, method.shorthand, details)


class Information(NamedTuple):
    """Sum of squares, gradient (n,) and information (n, n) of unknowns."""

    cost: float
    gradient: Array
    square: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Prediction errors of all pieces, weighted by `weight` (ny, ny), over the matrices and the
    start of each piece.
    """

    run: StateSpaceRun
    pieces: Sequence[Piece]
    weight: Array | None = None

    @property
    def scale(self) -> Array:
        """Spread (ny,) of the outputs."""
        spread = np.nanstd(np.concatenate([piece.y for piece in self.pieces]), axis=0)
        return np.where(spread > 0, spread, 1.0)

    @property
    def weights(self) -> Array:
        """(ny, ny), by which rows of errors are multiplied."""
        return np.diag(1.0 / self.scale) if self.weight is None else self.weight

    def own(self, i: int) -> slice:
        """Where the start of piece i stands among the unknowns."""
        nx = self.run.structure.order
        return slice(self.run.size + i * nx, self.run.size + (i + 1) * nx)

    def along(self, z: Array, i: int) -> Along:
        """Piece i run with the unknowns."""
        y, u, p = self.pieces[i]
        fed = y if self.run.innovations else None
        return self.run.along(z[: self.run.size], z[self.own(i)], u, p, fed)

    def left(self, z: Array, i: int, found: Along | None = None) -> Array:
        """(m, ny) prediction errors of piece i, less their sign; NaN where y is missing."""
        return (found or self.along(z, i)).y - self.pieces[i].y

    def cost(self, z: Array) -> float:
        """The sum of squares; infinite where a run diverges."""
        total = 0.0
        with np.errstate(all="ignore"):
            for i in range(len(self.pieces)):
                error = self.left(z, i)
                total += float(
                    np.sum((np.where(np.isnan(self.pieces[i].y), 0.0, error) @ self.weights) ** 2)
                )
        return total if np.isfinite(total) else np.inf

    def information(self, z: Array) -> Information:
        """Cost, gradient and Gauss-Newton information, summed up block by block."""
        first, cost = self.run.size, 0.0
        square, gradient = np.zeros((len(z), len(z))), np.zeros(len(z))
        for i, piece in enumerate(self.pieces):
            found = self.along(z, i)
            seen = np.isfinite(piece.y)
            error = np.where(seen, self.left(z, i, found), 0.0) @ self.weights
            cost += float(np.sum(error**2))
            at = np.r_[0:first, self.own(i)]
            for rows, slopes in self.run.slopes(z[:first], found):
                part = slopes * seen[rows, :, None]
                part = np.matmul(self.weights.T, part).reshape(-1, len(at))
                square[np.ix_(at, at)] += part.T @ part
                gradient[at] += part.T @ error[rows].reshape(-1)
        return Information(cost, gradient, square)

    def best_of(self, candidates: Sequence[Array]) -> Array:
        """The unknowns of least cost, each piece started from the state that suits it best.

        Raises `InputError` where every run diverges.
        """
        tried = []
        for unknowns in candidates:
            starts = [
                start_of(self.run, unknowns[: self.run.size], *piece) for piece in self.pieces
            ]
            z = np.concatenate([unknowns[: self.run.size], *starts])
            tried.append((self.cost(z), z))
        cost, z = min(tried, key=lambda each: each[0])
        if not np.isfinite(cost):
            raise InputError(
                "every run from the subspace start diverges: fit over shorter records, or with"
                " another order"
            )
        return z

    def weighted(self, z: Array) -> Problem:
        """The same with errors made white: the likelihood of correlated innovations."""
        covariance = self.residual_covariance(z) + np.diag((FLOOR * self.scale) ** 2)
        return replace(self, weight=np.linalg.inv(np.linalg.cholesky(covariance)).T)

    def residual_covariance(self, z: Array) -> Array:
        """(ny, ny) of complete rows."""
        errors = np.concatenate([self.left(z, i) for i in range(len(self.pieces))])
        errors = errors[np.isfinite(errors).all(axis=1)]
        return errors.T @ errors / max(len(errors), 1)


def _starts(structure: StateSpace, unknowns: Array) -> list[Array]:
    """The unknowns with parts of their gain, and of what moves with p."""
    run = StateSpaceRun(structure, innovations=True)
    A, B, C, D, K = run.matrices(unknowns)
    one = structure.basis.constant()
    still = [np.multiply.outer(one, np.tensordot(one, M, 1) / (one @ one)) for M in (A, B, K)]
    out = []
    for moving in GAINS:
        part = [s + moving * (M - s) for s, M in zip(still, (A, B, K), strict=True)]
        for fed in GAINS:
            out.append(run.unknowns(part[0], part[1], C, D, fed * part[2]))
    return out


def _searched(
    problem: Problem, z: Array, method: OutputError | Innovations
) -> tuple[Array, Problem, dict[str, object]]:
    """The unknowns of least cost; with innovations once more with their covariance as weight."""
    evaluations, converged = 0, True
    for last in (False, True) if problem.run.innovations and len(problem.scale) > 1 else (True,):
        if last and problem.run.innovations:
            problem = problem.weighted(z)
        tolerance = method.tolerance if last else max(method.tolerance, 1e-4)
        left = method.evaluations - evaluations
        z, used, converged = minimized(problem, z, max(left, 1), tolerance, method.shorthand)
        evaluations += used
    if not converged:
        warnings.warn(
            ConvergenceWarning(f"{method.shorthand!r} of states did not settle: {ADVICE}"),
            stacklevel=5,
        )
    message = "settled" if converged else "evaluations used up"
    return z, problem, {"evaluations": evaluations, "converged": converged, "message": message}


def minimized(
    problem: Problem, z: Array, evaluations: int, tolerance: float, name: str
) -> tuple[Array, int, bool]:
    """Unknowns by Levenberg-Marquardt steps, number of evaluations, whether they settled."""
    damping, used, converged = 1e-3, 0, False
    with task(f"{name}: evaluations, at most", evaluations) as search:
        now = problem.information(z)
        while used < evaluations and not converged:
            step_of = _steps(now)
            while used < evaluations:
                used += 1
                search.step()
                step = step_of(damping)
                cost = problem.cost(z + step)
                gained = now.cost - cost
                small = np.linalg.norm(step) <= tolerance * np.linalg.norm(z)
                if cost < now.cost:
                    damping = max(damping * 0.1, 1e-12)
                    converged = bool(small or gained <= tolerance * now.cost)
                    z = z + step
                    break
                damping *= 8.0
                if small or damping > LARGEST_DAMPING:  # no step of any size is better
                    converged = True
                    break
            if not converged:
                now = problem.information(z)
    return z, used, converged


def _steps(now: Information) -> Callable[[float], Array]:
    """The step of a damping, along the directions that are seen."""
    values, vectors, scale = _directions(now.square)
    across = vectors.T @ (now.gradient / scale)

    def step(damping: float) -> Array:
        return -(vectors @ (across / (values + damping * values[-1]))) / scale  # type: ignore[no-any-return]

    return step


def _directions(square: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues and eigenvectors of the information in units of `scale`, of what is seen."""
    size = np.sqrt(np.diagonal(square))
    scale = np.maximum(size, 1e-6 * size.max(initial=0.0) + np.finfo(float).tiny)
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
    """(n, n) of all unknowns, residuals white: the inverse information along what is seen."""
    white = problem.weighted(z)
    values, vectors, scale = _directions(white.information(z).square)
    kept = len(z) - problem.run.undetermined
    values, vectors = values[-kept:], vectors[:, -kept:]
    root = vectors / np.sqrt(values) / scale[:, None]
    return root @ root.T  # type: ignore[no-any-return]
