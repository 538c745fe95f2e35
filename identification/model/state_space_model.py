"""An identified LPV state-space model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from identification.model.prediction import named_fit, require_horizon
from identification.model.realization import held_value
from identification.model.state_space_run import StateSpaceRun
from identification.structure.regressors import Samples, check_units
from identification.structure.state_space import StateSpace
from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array, frozen
from symheli.values.runs import runs
from symheli.values.sample_period import JITTER, same_period
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class StateSpaceModel:
    """A `StateSpace` with its matrices, as `fit` returns it.

    Parameters
    ----------
    structure : StateSpace
        Signals, order, basis.
    unknowns : array
        The entries of A, B, C, D and (not by output error) K as `StateSpaceRun` orders them.
    state_space : LPVStateSpace
        The same for design, without K and the offset.
    residual_covariance : array (ny, ny)
        Of the free run by output error, else of the innovations.
    method : str
        Shorthand of the method.
    covariance : array (1, n, 1, n), optional
        Of the unknowns, along the directions that change the response; see `fit`.
    details : mapping
        `evaluations`, `converged`, `message`, `singular_values` of the subspace start.

    Raises
    ------
    InputError
        Another number of unknowns.

    Examples
    --------
    >>> found = idn.fit(idn.StateSpace("y", "u", order=2), record)
    >>> found.state_space.dt, found.simulate(record).shape
    (0.1, (800, 1))
    """

    structure: StateSpace
    unknowns: Array
    state_space: LPVStateSpace
    residual_covariance: Array
    method: str = "oe"
    covariance: Array | None = None
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    least_squares: ClassVar[bool] = False

    __repr__ = summarized

    def __post_init__(self) -> None:
        size = self.run.size
        object.__setattr__(self, "unknowns", frozen(self.unknowns, "unknowns", (size,)))

    @cached_property
    def run(self) -> StateSpaceRun:
        """Layout of the unknowns, and their runs."""
        return StateSpaceRun(self.structure, self.method != "oe")

    @property
    def dt(self) -> float:
        """Sample period, s."""
        assert self.state_space.dt is not None  # noqa: S101  made of a sampled record
        return self.state_space.dt

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Outputs with their units."""
        return self.state_space.outputs

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Inputs with their units."""
        return self.state_space.inputs

    @property
    def theta(self) -> Array:
        """The unknowns (n, 1), as judges of other models take coefficients."""
        return self.unknowns[:, None]

    def with_theta(self, theta: Array) -> StateSpaceModel:
        """The same with other unknowns (n, 1), whose covariance is not known."""
        unknowns = theta[:, 0]
        design = replace(self.state_space, **design_matrices(self.run, unknowns))
        return replace(self, unknowns=unknowns, state_space=design, covariance=None)

    def at(self, *p: float) -> LinearModel:
        """The discrete model with the scheduling held at p, one number a parameter."""
        held = held_value(p, self.structure.basis)
        return self.state_space.at(*np.atleast_1d(held))

    def simulate(self, record: FlightRecord) -> Array:
        """Free run (n, ny) from the state that suits each unbroken stretch best, with the record's
        inputs and p, or with p of its own; NaN where inputs or p are missing, infinite where it
        diverges.

        Raises `InputError` for another sample period or unit.
        """
        self._require_same_kind(record)
        out = np.full((len(record), len(self.outputs)), np.nan)
        for part, y, u, p in pieces_of(self.structure, record):
            start = start_of(self.run, self.unknowns, y, u, p, free=True)
            out[part] = self.run.outputs(self.unknowns, start, u, p)
        return out

    def predict(self, record: FlightRecord, horizon: int) -> Array:
        """Predictions (n, ny) `horizon` samples ahead: outputs known up to t - horizon, inputs and
        p up to t. By output error it is the free run; else the innovation filter, which runs free
        while outputs are missing.

        Raises `InputError` as `simulate`, and for a horizon below 1.
        """
        require_horizon(horizon)
        self._require_same_kind(record)
        out = np.full((len(record), len(self.outputs)), np.nan)
        for part, y, u, p in pieces_of(self.structure, record):
            start = start_of(self.run, self.unknowns, y, u, p)
            out[part] = self.run.ahead(self.unknowns, start, u, p, y, horizon)
        return out

    def score(self, record: FlightRecord, horizon: int | None = None) -> NamedVector:
        """Fit in percent of each output, `horizon` samples ahead or, with None, in free run; see
        `fit_percent`.
        """
        guess = self.simulate(record) if horizon is None else self.predict(record, horizon)
        return named_fit(self.outputs, record, guess)

    def _require_same_kind(self, record: FlightRecord) -> None:
        """Raise `InputError` for a record of another sample period or other units."""
        design = self.state_space
        moving = [] if self.structure.regression.constant else design.parameters
        scheduling = [Signal(p.name, p.unit) for p in moving]
        check_units([*design.outputs, *design.inputs, *scheduling], record)
        if not same_period(record.dt, self.dt, JITTER):
            raise InputError(
                f"the model was identified at dt = {self.dt:.4g} s, the record has {record.dt:.4g}"
                " s; resample it"
            )


def design_matrices(run: StateSpaceRun, unknowns: Array) -> dict[str, Any]:
    """A, B, C and D by function, without the offset, as `LPVStateSpace` takes them."""
    A, B, C, D, _ = run.matrices(unknowns)
    one = run.structure.basis.constant()[:, None, None]
    return {"A": A, "B": B[:, :, : len(run.structure.inputs)], "C": one * C, "D": one * D}


def pieces_of(
    structure: StateSpace, record: FlightRecord
) -> list[tuple[slice, Array, Array, Array]]:
    """Stretches with all inputs and p: where, and outputs, inputs and p in them."""
    s, out = Samples.of(structure.regression, record), []
    given = s.u if structure.own_scheduling else np.column_stack([s.u, s.f])
    known = np.asarray(np.isfinite(given).all(axis=1))
    for part in s.segments:
        for a, b in runs(known[part]):
            if b - a > structure.order:
                at = slice(part.start + a, part.start + b)
                out.append((at, s.y[at], s.u[at], s.p[at]))
    return out


def start_of(
    run: StateSpaceRun,
    unknowns: Array,
    y: Array,
    u: Array,
    p: Array,
    rounds: int = 3,
    *,
    free: bool = False,
) -> Array:
    """The state (nx,) from which the free run (or with innovations and not `free` the filter) comes
    closest to y (m, ny), each output in its spread, by Gauss-Newton steps.
    """
    start, scale = np.zeros(run.structure.order), spread_of(y)[:, None]
    fed = None if free else y
    for _ in range(rounds if run.structure.own_scheduling else 1):
        found = run.along(unknowns, start, u, p, fed)
        with np.errstate(over="ignore"):
            left, by_start = (found.y - y) / scale[:, 0], run.by_start(unknowns, found) / scale
        seen = np.isfinite(left)
        if not np.isfinite(by_start).all() or not seen.any():
            break
        start = start - np.linalg.lstsq(by_start[seen], left[seen], rcond=None)[0]
    return start


def spread_of(y: Array) -> Array:
    """Deviation (ny,) of outputs (m, ny) from their means; 1 for one that does not move."""
    known = np.isfinite(y)
    count, held = np.maximum(known.sum(axis=0), 1), np.where(known, y, 0.0)
    mean = held.sum(axis=0) / count
    spread = np.sqrt(np.sum(np.where(known, y - mean, 0.0) ** 2, axis=0) / count)
    return np.where(spread > 1e-12 * np.abs(mean), spread, 1.0)
