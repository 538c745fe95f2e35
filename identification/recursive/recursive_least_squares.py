"""Recursive least squares as a square-root information filter: one triangular factor for all
outputs that share a regressor.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from identification.model.kinematic_fit import mean_trim
from identification.recursive import kernel, saved_state
from identification.recursive.forgetting import Forgetting, forgetting_of
from identification.recursive.history import History
from identification.recursive.kernel.configuration import KernelConfiguration
from identification.recursive.online import Online
from identification.recursive.rigid_body_online import RigidBodyOnline
from identification.recursive.rls_state import RLSInfo, RLSState
from identification.structure.kinematic_arx import KinematicARX
from identification.structure.lpvarx import LPVARX, require_structure
from identification.structure.regressors import Samples, as_records, units_of, vector
from symheli.errors import InputError
from symheli.progress import task
from symheli.records import FlightRecord
from symheli.values.arrays import Array

PRECISIONS = {"double": np.float64, "single": np.float32}
AT_ONCE = 10_000
"""So many samples are taken in before an interrupt is heard: some hundredths of a second."""


@dataclass(frozen=True)
class RecursiveLeastSquares:
    """Recursive least squares updates the coefficients of a structure with every sample and may
    forget old ones.

    `init`, `update`, or `run` over a record; `online` for real time.

    Each sample rotates the row [phi', y'] into [sqrt(l) R, sqrt(l) Z] by square-root-free Givens
    rotations; the covariance is never formed, so nothing can lose its definiteness. Outputs share
    the factor, which nothing but data enters. The coefficients solve R theta = Z: from sample to
    sample they move along the gain g = R^-1 (R^-T phi), theta += g (y - theta' phi)', and are
    solved anew as soon as a running bound of the rounding errors along it is no longer small, so
    that they are at every sample those of batch least squares on the weighted samples so far.
    Undetermined directions are regularized by pseudo-observations: each coefficient is 0, with the
    weight of 32 eps samples with its regressor at its largest (without forgetting; otherwise see
    `Constant`). Models made from the state exclude them: `RLSState.solve` removes these rows.
    `determined` says whether the data determine every coefficient, by the rule of
    `identification.design.determined`.

    The arithmetic is C where a compiler was there when symheli was installed, else NumPy, with one
    `CompilerWarning`: the same operations in the same order.

    Parameters
    ----------
    structure : LPVARX or KinematicARX
        What is identified. With known kinematics a sample is y (8,), u, p, and outputs are what the
        increments of u v w p q r have beyond the kinematics.
    forgetting : float or Forgetting
        A factor l in (0, 1] (a sample k steps old has the weight l^k), or one of `Constant`,
        `Variable`, `Directional` of `identification.forgetting`.
    floor : float, optional
        That of `Constant`, for a factor.
    precision : {"double", "single"}
        "single" computes as an autopilot without double precision would.

    Raises
    ------
    InputError
        An option out of range, or a floor beside a way of forgetting.

    See Also
    --------
    identification.fit : coefficients from records
    identification.forgetting.Directional : forgetting where data come in
    identification.export.write_estimator : recursive least squares in C

    References
    ----------
    Gentleman (1973), Least squares computations by Givens transformations without square roots, J.
    Inst. Maths Applics 12; Bjorck (1996), Numerical Methods for Least Squares Problems, ch. 3.

    Examples
    --------
    >>> rls = idn.RecursiveLeastSquares(arx, forgetting=0.995)
    >>> state = rls.init()
    >>> for k in range(200):
    ...     state, info = rls.update(state, record["y"][k], record["u"][k], record["p"][k])
    >>> info.determined, bool(abs(info.innovation[0]) < 0.1)
    (True, True)
    """

    structure: LPVARX | KinematicARX
    forgetting: float | Forgetting = 1.0
    floor: float | None = None
    precision: Literal["double", "single"] = "double"

    def __post_init__(self) -> None:
        require_structure(self.regression)
        if isinstance(self.structure, KinematicARX):
            self.structure.require_plain("an estimator in flight")
        if self.precision not in PRECISIONS:
            raise InputError(f'precision: expected "double" or "single", got {self.precision!r}')
        forgetting_of(self.forgetting, self.floor)

    @property
    def regression(self) -> LPVARX:
        """Regression of the kernel: the structure, or the aerodynamics within its kinematics."""
        structure = self.structure
        return structure.aerodynamics if isinstance(structure, KinematicARX) else structure

    @cached_property
    def configuration(self) -> KernelConfiguration:
        """Configuration of the kernel; its `sizes` are the numbers of memory the estimator
        takes.
        """
        forgetting = forgetting_of(self.forgetting, self.floor)
        return KernelConfiguration(self.regression, forgetting, PRECISIONS[self.precision])

    def init(self) -> RLSState:
        """Return the initial state, without information."""
        state, work = (
            np.zeros(size, self.configuration.dtype) for size in self.configuration.sizes
        )
        self._kernel.start(state, work)
        return RLSState(self.configuration, state)

    def online(self, state: RLSState | None = None, dt: float | None = None) -> Online:
        """An estimator that goes on from `state`, or from nothing, changing in place.

        With known kinematics its samples are those of a rigid body, `dt` s apart, and the first is
        a start: the attitude before is not in `state`. Raises `InputError` without `dt` there.
        """
        if not isinstance(self.structure, KinematicARX):
            return self._online(state)
        if dt is None or not 0 < dt < np.inf:
            raise InputError(f"dt: known kinematics need the sample period in s, got {dt!r}")
        return RigidBodyOnline(self.configuration, self._kernel, self._own(state), dt)

    def _online(self, state: RLSState | None = None) -> Online:
        return Online(self.configuration, self._kernel, self._own(state))

    def update(self, state: RLSState, y: object, u: object, p: object) -> tuple[RLSState, RLSInfo]:
        """Take in the sample y (ny,), u (nu,), p of one instant; returns the new state and what it
        did.

        A NaN anywhere is a missing sample: nothing is learnt and the lags start afresh. Raises
        `InputError` for wrong shapes, infinite values and p outside the basis, and with known
        kinematics: a state does not remember the attitude before.
        """
        if isinstance(self.structure, KinematicARX):
            raise InputError(
                "with known kinematics an update needs the sample before, which a state does not"
                " hold: use online().update(y, u, p), or run(record)"
            )
        online = self._online(state)
        return _outcome(online, online.update(y, u, p))

    def absorb(self, state: RLSState, phi: Array, y: Array) -> tuple[RLSState, RLSInfo]:
        """Take in one regressor phi (n,) with the outputs y (ny,) it must explain.

        Raises `InputError` for another shape and numbers that are not finite.
        """
        arx = self.regression
        phi, y = vector(phi, arx.n_regressors, "phi"), vector(y, arx.ny, "y")
        if not (np.isfinite(phi).all() and np.isfinite(y).all()):
            raise InputError("phi and y must be finite; leave an incomplete regressor out")
        online = self._online(state)
        return _outcome(online, online.absorb(phi, y))

    def run(self, record: FlightRecord, state: RLSState | None = None) -> History:
        """Every sample of a record in turn, from `state` or from nothing; lags never reach across a
        gap.

        The same as `update` sample by sample.
        """
        arx, records = self.regression, as_records(record)
        if len(records) != 1:
            raise InputError(
                f"run takes one record, got {len(records)}; go on from its state: run(second,"
                " run(first).state)"
            )
        record = arx.prepared(records[0])
        s, online = Samples.of(arx, record), self.online(state, record.dt)
        measured = record.columns((*self.structure.outputs, *self.structure.inputs))
        rows = np.column_stack([measured, s.p])
        online.forget_past()
        parts = []
        with task("recursive least squares", len(rows)) as learning:
            for segment in s.segments:
                online.forget_past()
                for begin in range(segment.start, segment.stop, AT_ONCE):
                    end = min(begin + AT_ONCE, segment.stop)
                    parts.append(online.run(rows[begin:end]))
                    learning.to(end)
        learnt, innovations, coefficients = (
            np.concatenate(part) for part in zip(*parts, strict=True)
        )
        return History(
            structure=self.structure,
            time=record.time,
            coefficients=coefficients.astype(float, copy=False),
            innovations=innovations.astype(float, copy=False),
            state=online.state,
            dt=record.dt,
            outputs=units_of(arx.outputs, [record]),
            inputs=units_of(arx.inputs, [record]),
            scheduling=units_of(arx.parameters, [record]),
            dropped=int(len(record) - learnt.sum()),
            trim=mean_trim(self.structure, [record])
            if isinstance(self.structure, KinematicARX)
            else None,
        )

    def save(self, state: RLSState, path: str | os.PathLike[str]) -> None:
        """Write `state` to a file from which `load` brings it back to the last bit; an old file is
        replaced at once or not at all.
        """
        saved_state.save(self._own(state), path)

    def load(self, path: str | os.PathLike[str]) -> RLSState:
        """The state in a file of `save`. Raises `InputError` for a damaged file, or one of another
        structure, forgetting or precision.
        """
        return saved_state.load(self.configuration, path)

    @cached_property
    def _kernel(self) -> Any:
        return kernel.kernel(self.configuration)

    def _own(self, state: RLSState | None) -> RLSState:
        if state is None:
            return self.init()
        if not isinstance(state, RLSState):
            raise InputError(
                f"state: expected one from init, update, run or load, got {state!r:.80}"
            )
        if (
            state.configuration.structure != self.regression
            or state.memory.dtype != self.configuration.dtype
        ):
            raise InputError(
                "state: it belongs to an estimator with another structure or precision; start with"
                " init()"
            )
        return state


def _outcome(online: Online, available: bool) -> tuple[RLSState, RLSInfo]:
    state = online.state
    innovation, gain = (
        part.astype(float) if available else np.full(part.shape, np.nan)
        for part in (online.innovation, online.gain)
    )
    return state, RLSInfo(available, innovation, gain, state.theta, state.determined)
