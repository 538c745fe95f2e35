"""The drift of a moving trim as inputs of the model: a disturbance that is declared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.units import per_second

PREFIX = "drift_"
"""Prefix of the input that is the motion of a parameter."""


def with_trim_drift(lpv: LPVStateSpace) -> LPVStateSpace:
    """See `LPVStateSpace.with_trim_drift`."""
    if lpv.trim is None:
        raise InputError(
            "the model has no trim schedule, hence no drift; interpolate a family or a grid with"
            " trims, and declare the drift before closing loops"
        )
    names, columns = _columns(lpv, points := lpv.trim.basis.samples(lpv.box))
    own = lpv.basis.fit(points, columns)
    wider = replace(
        lpv,
        B=np.concatenate([lpv.B, own], axis=2),
        D=np.concatenate([lpv.D, np.zeros((*lpv.D.shape[:2], len(names)))], axis=2),
        inputs=(*lpv.inputs, *names),
        trim=replace(lpv.trim, u=np.pad(lpv.trim.u, ((0, 0), (0, len(names))))),
        residuals=None,
    )
    nodes, exact = points, lpv.matrices(points)
    if (origin := lpv.fitted_to) is not None:
        nodes, exact = origin.nodes, origin.matrices
    _, there = _columns(lpv, nodes)
    still = np.zeros((*exact.D.shape[:2], len(names)))
    B, D = np.concatenate([exact.B, there], axis=2), np.concatenate([exact.D, still], axis=2)
    return wider.with_residuals(nodes, Matrices(exact.A, B, exact.C, D))


def _columns(lpv: LPVStateSpace, p: Array) -> tuple[list[Signal], Array]:
    """Names of the inputs, and what each adds to dx/dt (K, nx, inputs) at p."""
    trim, box = lpv.trim, lpv.parameters
    assert trim is not None  # noqa: S101  (checked above)
    slopes = trim.basis.gradient(p) @ trim.x  # (K, d, nx)
    own = 0.0 if trim.xdot is None else trim.basis(p) @ trim.xdot
    tied = {s.name: s.rate for s in box if isinstance(s.rate, str)}
    at = {s.name: p if len(box) == 1 else p[:, i] for i, s in enumerate(box)}
    names, columns = [], []
    for i, s in enumerate(box):
        if s.name in tied:  # its rate is known where p is: of unit size, as it stands
            names.append(Signal(PREFIX + s.name, "1"))
            columns.append(own - slopes[:, i] * at[tied[s.name]][:, None])
            own = 0.0
        else:
            names.append(Signal(PREFIX + s.name, per_second(s.unit)))
            columns.append(-slopes[:, i])
    if not np.isscalar(own):
        names.append(Signal(PREFIX + "trim", "1"))
        columns.append(own)
    return names, np.stack(columns, axis=-1)
