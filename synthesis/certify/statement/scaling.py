"""A constant change of coordinates in which the numbers of an LMI are of order one, whatever the
units of the states.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import linalg

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.riccati import lyapunov
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.linear.balance import balance, size_of
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.polynomial.symmetric import powered, symmetrized
from synthesis.numerics.program.storage import least_storage, strict_storage

SMALLEST = 1e-150
"""Gain from all inputs to all outputs, in the units given, whose square is still a number."""

MAX_ENTRY = 1e100
"""Largest entry of a model: Gramians square the entries."""

MIN_COUPLING = 0.3
"""Every state is reached and observed at least by this fraction of the inputs and outputs, so that
states which they do not reach have a scale too.
"""
NEGLIGIBLE_GAIN = 1e-6
"""A gain below this fraction of the response of the states is the remainder of a cancellation and
sets no scale.
"""
NEGLIGIBLE_RESPONSE = 1e-7
"""Fraction below which a response is rounding: the square root of the rounding of a Gramian."""
INITIAL_FRACTION = 0.1
"""Fraction of that response with which the search then begins."""
LEVELS = (1.01, 2.0, 10.0, 100.0, 1e4)
"""Multiples of the expected gain at which a storage function is computed in turn."""

GRAMIAN_SHARE = 0.01
"""Share of the variance of the outputs by which noise at each state raises it, in
`gramian_units`.
"""


def of_model(units: Scaling, model: LinearModel) -> Matrices:
    """Return the matrices of a frozen model in these units."""
    every = units.of_matrices(Matrices(*(M[None] for M in (model.A, model.B, model.C, model.D))))
    return Matrices(*(M[0] for M in every))


def storage_of(units: Scaling, model: LinearModel, above: float) -> Array | None:
    """Return P of a frozen model in these units, which dissipates strictly at the level 1 + `above`
    of the channel; None where there is none.
    """
    inner = linalg.inv(units.weight)
    share = 0.5 * above / (LEVELS[0] - 1.0)
    return least_storage(
        *of_model(units, model), 1.0 + above, share * inner @ inner, discrete=model.dt is not None
    )


def scaling(lpv: LPVStateSpace, gain: float) -> Scaling:
    """Return the scaling by the model at mid-range and the inputs and outputs of the states over
    the whole range; `gain` is the expected one.
    """
    s = lpv.scheduling
    return model_scaling(lpv.at(s.middle), gain, lpv.matrices(np.linspace(s.low, s.high, 9)))


def block_scaling(lpv: LPVStateSpace, block: NormBounded, gain: float) -> Scaling:
    """Return the same with a norm-bounded block: a multiplier of 1 in these units balances d to y
    with u to v, as a constant one would.
    """
    d, v = slice(None, block.inputs), slice(len(lpv.outputs) - block.outputs, None)
    u, y = slice(block.inputs, None), slice(None, len(lpv.outputs) - block.outputs)
    into, out = np.ones(len(lpv.inputs)), np.ones(len(lpv.outputs))
    t = 1.0
    if lpv.inputs[u] and lpv.outputs[y] and 0 < gain < math.inf:
        received, caused, around = (_response(lpv, *pair) for pair in ((d, y), (u, v), (d, v)))
        # a block of almost nothing would ask for a multiplier without limit
        caused = max(block.bound, 1e-6 / around if around > 0 else 0.0) * caused
        t = math.sqrt(gain * received / caused) if received > 0 and caused > 0 else 1.0
        into[d] = gain / t
    out[v] = t * block.bound
    weighed = replace(
        lpv,
        B=lpv.B * into,
        C=lpv.C * out[:, None],
        D=lpv.D * into * out[:, None],
        trim=None,
        residuals=None,
    )
    return scaling(weighed, gain)._replace(multiplier=t * t)


def _response(lpv: LPVStateSpace, inputs: slice, outputs: slice) -> float:
    """Return the largest gain of some frozen models from these inputs to these outputs; 0 where
    none is stable.
    """
    s = lpv.scheduling
    found = [0.0]
    for p in np.linspace(s.low, s.high, 5):
        A, B, C, D = lpv.matrices(float(p))
        found.append(norm(A, B[:, inputs], C[outputs], D[outputs, inputs], lpv.dt)[0])
    return max(gain for gain in found if math.isfinite(gain))


def model_scaling(model: LinearModel, gain: float, elsewhere: Matrices | None = None) -> Scaling:
    """Return the scaling by one frozen model, with the size of its matrices `elsewhere` (K, ...).

    The Lyapunov function of order one is the sum of that by the outputs and the inverse of the
    Gramian of the inputs, between which those of the bounded real lemma lie: both go with the
    coordinates, so that units cancel. A model that is not stable is made so by a shift.
    """
    n, continuous = len(model.states), model.dt is None
    every = elsewhere or Matrices(*(M[None] for M in (model.A, model.B, model.C, model.D)))
    if max(np.abs(M).max(initial=0.0) for M in every) > MAX_ENTRY:
        raise InputError(
            f"a model with entries beyond {MAX_ENTRY:.0e} cannot be squared; choose other units"
        )
    B, C = np.hstack([*every.B]), np.vstack([*every.C])
    D = balance(np.abs(every.A).max(axis=0), B, C)
    A, B, C = model.A * D / D[:, None], B / D[:, None], C * D
    poles = np.linalg.eigvals(A)
    pace = np.abs(poles if continuous else poles - 1.0)
    time = 1.0 / float(np.median(pace)) if continuous and np.median(pace) > 0 else 1.0
    A = _stabilised(A, poles, continuous)
    own = _pace(A if continuous else A - np.eye(n))
    reached = np.hstack([B, MIN_COUPLING * size_of(B) * np.diag(np.sqrt(own))])
    seen = np.vstack([C, MIN_COUPLING * size_of(C) * np.diag(np.sqrt(own))])
    Wc, Wo = _gramian(A, reached, continuous), _gramian(A.T, seen.T, continuous)
    # where inputs and outputs weigh alike: the geometric mean of the Hankel singular values
    level = np.exp(0.5 * (np.linalg.slogdet(Wo)[1] + np.linalg.slogdet(Wc)[1]) / n)
    if not SMALLEST < level < 1 / SMALLEST:
        raise InputError(
            f"a model whose gain is near {level:.0e} cannot be squared; choose other units of its"
            " inputs and outputs"
        )
    inverse = linalg.inv(Wc)
    X = symmetrized(Wo / level + level * inverse)
    side = inverse @ reached
    Q = seen.T @ seen / level + level * (
        side @ side.T if continuous else inverse - A.T @ inverse @ A
    )
    root = linalg.inv(linalg.cholesky(X))
    weight = powered(root.T @ symmetrized(Q) @ root * (time if continuous else 1.0), -0.5)
    # state by state, so that their units play no part
    alone = _gramian(A, B, continuous, 0.0), _gramian(A.T, C.T, continuous, 0.0)
    received = np.sqrt(np.maximum(np.diag(alone[0]) * np.diag(alone[1]), 0.0))
    # where no state is both reached and seen but for rounding, what hardly is
    response, silent, hardly = (
        float(np.sum(received)),
        *(np.sqrt(np.trace(c) * np.trace(o)) for c, o in (alone, (Wc, Wo))),
    )
    channel = _channel(gain, response if response > NEGLIGIBLE_RESPONSE * silent else hardly)
    size_B, size_C = (
        np.linalg.norm(weight @ linalg.solve(root, B)),
        np.linalg.norm(C @ root @ weight) / channel,
    )
    # P = alpha I with alpha = |C|/|B| weighs inputs and outputs alike; put it into the coordinates
    alpha = size_C / size_B if size_B > 0 and size_C > 0 else 1.0
    right = D[:, None] * root / np.sqrt(alpha)
    return Scaling(np.sqrt(alpha) * linalg.inv(root) / D, right, channel, time, weight)


def dissipative(units: Scaling, model: LinearModel, gain: float) -> Scaling | None:
    """Return units in which P = I is a storage function of a frozen model that dissipates strictly
    just above the expected `gain`, and weight^-2 the dissipation; None where there is none.

    At that level a margin of one is reached, and by convexity a smaller one costs that share of
    what the level is above the norm.
    """
    if not (model.inputs and model.outputs and 0 < gain < math.inf):
        return None
    found, levels = None, LEVELS
    while levels:
        scaled = of_model((found or units)._replace(channel=gain), model)
        tried = (
            (k, strict_storage(*scaled, level, discrete=model.dt is not None))
            for k, level in enumerate(levels)
        )
        lowest = next(((k, storage) for k, storage in tried if storage is not None), None)
        if lowest is None:
            break
        # in the coordinates of a higher level a lower one is found where rounding kept it
        k, storage = lowest
        levels, own = levels[:k], found or units
        found = own._replace(
            left=linalg.solve(storage.T, own.left),
            right=own.right @ storage.T,
            channel=gain,
            weight=powered(storage.W, -0.5),
        )
    return found


def gramian_units(units: Scaling, model: LinearModel) -> Scaling:
    """Return units in which P = I is the inverse Gramian of the inputs of a stable frozen model and
    of a little noise at each state, which raises the variance of the outputs by `GRAMIAN_SHARE`;
    weight^-2 is what that noise adds. Other models keep their units.
    """
    A, B, C, _ = of_model(units, model)
    continuous, n = model.dt is None, len(A)
    if not (model.is_stable() and B.size and C.size):
        return units
    noise = np.diag(np.sqrt(_pace(A if continuous else A - np.eye(n))))
    by_inputs, by_noise = (_gramian(A, M, continuous, 0.0) for M in (B, noise))
    seen, added = (float(np.sum((C @ X) * C)) for X in (by_inputs, by_noise))
    if not (seen > 0 and added > 0):
        return units
    share = GRAMIAN_SHARE * seen / added
    try:
        root = np.linalg.cholesky(by_inputs + share * by_noise)
    except np.linalg.LinAlgError:
        return units
    inner = math.sqrt(share) * linalg.solve(root, noise)
    return units._replace(
        left=linalg.solve(root, units.left),
        right=units.right @ root,
        weight=powered(inner @ inner.T, -0.5),
    )


def _channel(gain: float, response: float) -> float:
    """Return the expected gain; where that is negligible beside the `response` of the states to
    inputs and outputs, an initial gain.
    """
    return (
        gain
        if math.isfinite(gain) and gain > NEGLIGIBLE_GAIN * response
        else INITIAL_FRACTION * response
    )


def _pace(A: Array) -> Array:
    """Return the rate of each state (n,), relative to the fastest at least 1e-12."""
    size = np.maximum(np.linalg.norm(A, axis=0), np.linalg.norm(A, axis=1))
    return np.maximum(size, 1e-12 * size_of(size))


def _stabilised(A: Array, poles: Any, continuous: bool) -> Array:
    """Return A with its poles moved inside the stability region by as little as the
    Gramians need.
    """
    if continuous:
        shift = float(poles.real.max()) + 1e-6 * float(
            np.abs(poles).min() or np.abs(poles).max() or 1.0
        )
        return A - max(shift, 0.0) * np.eye(len(A))
    return A / max(1.0, float(np.abs(poles).max()) * (1 + 1e-6))


def _gramian(A: Array, B: Array, continuous: bool, least: float = 1e-12) -> Array:
    """Return the Gramian with no eigenvalue below the fraction `least` of the largest.

    Near chains of integrators its digits are few; units and coordinates need no more.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", linalg.LinAlgWarning)
        X = lyapunov(A, B @ B.T, None if continuous else 1.0)
    values, vectors = linalg.eigh(symmetrized(X))
    return (vectors * np.maximum(values, least * abs(values[-1]))) @ vectors.T
