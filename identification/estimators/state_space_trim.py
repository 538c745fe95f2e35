"""Trims of state-space models with an offset: fitted about the means of their signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification.estimators.subspace import Piece
from identification.model.state_space_model import StateSpaceModel
from identification.model.state_space_run import StateSpaceRun
from identification.structure.state_space import StateSpace
from symheli.values.arrays import Array


class Trim(NamedTuple):
    """Means of the outputs (ny,) and inputs (nu,) that a fit is made about."""

    y: Array
    u: Array

    @classmethod
    def of(cls, structure: StateSpace, pieces: Sequence[Piece]) -> Trim | None:
        """The means; None where the structure has no offset that takes them up in its states: then
        it is fitted to whole values.
        """
        fewer = structure.order < len(structure.outputs)
        if not structure.offset or structure.own_scheduling or fewer:
            return None
        y, u = (np.concatenate([piece[i] for piece in pieces]) for i in (0, 1))
        return cls(np.nanmean(y, axis=0), u.mean(axis=0))

    def less(self, pieces: Sequence[Piece]) -> list[Piece]:
        """The pieces without these means."""
        return [Piece(piece.y - self.y, piece.u - self.u, piece.p) for piece in pieces]

    def back(self, model: StateSpaceModel) -> StateSpaceModel:
        """The model of whole values, from that of signals less these means.

        States move by t with C t + D u = y, and the offset c(p) by t - A(p) t - B(p) u: responses
        stay as they are.
        """
        run, z = model.run, model.unknowns
        turn = np.array([self._slope(run, z, e) for e in np.eye(run.size)]).T
        known = model.covariance
        if known is not None:
            known = (turn @ known[0, :, 0] @ turn.T).reshape(known.shape)
        return replace(model, unknowns=self._moved(run, z), covariance=known)

    def _shift(self, run: StateSpaceRun, z: Array) -> Array:
        _, _, C, D, _ = run.matrices(z)
        return np.linalg.lstsq(C, self.y - D @ self.u, rcond=None)[0]

    def _moved(self, run: StateSpaceRun, z: Array) -> Array:
        A, B, C, D, K = run.matrices(z)
        t, one = self._shift(run, z), run.structure.basis.constant()
        B = B.copy()
        B[:, :, -1] += np.multiply.outer(one, t) - A @ t - B[:, :, :-1] @ self.u
        return run.unknowns(A, B, C, D, K)

    def _slope(self, run: StateSpaceRun, z: Array, e: Array) -> Array:
        """How the moved unknowns answer a change e of the unknowns z."""
        A, _, C, _, _ = run.matrices(z)
        dA, dB, dC, dD, dK = run.matrices(e)
        t, one = self._shift(run, z), run.structure.basis.constant()
        dt = np.linalg.lstsq(C, -dC @ t - dD @ self.u, rcond=None)[0]
        dB = dB.copy()
        dB[:, :, -1] += np.multiply.outer(one, dt) - A @ dt - dA @ t - dB[:, :, :-1] @ self.u
        return run.unknowns(dA, dB, dC, dD, dK)
