"""An identified LPV state-space model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.model.prediction import named_fit
from identification.model.state_space_run import StateSpaceRun
from identification.structure.regressors import Samples, check_units
from identification.structure.state_space import StateSpace
from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values import NamedVector, Signal
from symheli.values.arrays import Array, frozen
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
        The entries of A, B, C and D as `StateSpaceRun` orders them.
    state_space : LPVStateSpace
        The same for design.
    residual_covariance : array (ny, ny)
        Of the free run.
    details : mapping
        `evaluations`, `converged`, `message`.

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
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    __repr__ = summarized

    def __post_init__(self) -> None:
        size = StateSpaceRun(self.structure).size
        object.__setattr__(self, "unknowns", frozen(self.unknowns, "unknowns", (size,)))

    @property
    def dt(self) -> float:
        """Sample period, s."""
        assert self.state_space.dt is not None  # noqa: S101  made of a sampled record
        return self.state_space.dt

    def simulate(self, record: FlightRecord) -> Array:
        """Free run (n, ny) from the state that suits each unbroken stretch best, with the record's
        inputs and p, or with p of its own; NaN where inputs or p are missing, infinite where it
        diverges.

        Raises `InputError` for another sample period or unit.
        """
        design = self.state_space
        moving = [] if self.structure.regression.constant else design.parameters
        scheduling = [Signal(p.name, p.unit) for p in moving]
        check_units([*design.outputs, *design.inputs, *scheduling], record)
        if not same_period(record.dt, self.dt, JITTER):
            raise InputError(
                f"the model was identified at dt = {self.dt:.4g} s, the record has {record.dt:.4g}"
                " s; resample it"
            )
        run = StateSpaceRun(self.structure)
        out = np.full((len(record), len(design.outputs)), np.nan)
        for part, y, u, p in pieces_of(self.structure, record):
            start = start_of(run, self.unknowns, y, u, p)
            out[part] = run.outputs(self.unknowns, start, u, p)
        return out

    def score(self, record: FlightRecord) -> NamedVector:
        """Fit in percent of each output in free run; see `fit_percent`."""
        return named_fit(self.state_space.outputs, record, self.simulate(record))


def pieces_of(
    structure: StateSpace, record: FlightRecord
) -> list[tuple[slice, Array, Array, Array]]:
    """Stretches with all inputs and p: where, and outputs, inputs and p in them."""
    s, out = Samples.of(structure.regression, record), []
    given = s.u if structure.own_scheduling else np.column_stack([s.u, s.f])
    known = np.asarray(np.isfinite(given).all(axis=1))
    for part in s.segments:
        inside = known[part].astype(int)
        edges = part.start + np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            if b - a > structure.order:
                at = slice(a, b)
                out.append((at, s.y[at], s.u[at], s.p[at]))
    return out


def start_of(
    run: StateSpaceRun, unknowns: Array, y: Array, u: Array, p: Array, rounds: int = 3
) -> Array:
    """The state (nx,) from which the free run comes closest to y (m, ny), by Gauss-Newton steps."""
    start = np.zeros(run.structure.order)
    for _ in range(rounds if run.structure.own_scheduling else 1):
        left = run.outputs(unknowns, start, u, p) - y
        by_start = run.sensitivities(unknowns, start, u, p)[:, :, run.size :]
        seen = np.isfinite(left)
        if not np.isfinite(by_start).all() or not seen.any():
            break
        start = start - np.linalg.lstsq(by_start[seen], left[seen], rcond=None)[0]
    return start
