"""Loop shaping of McFarlane and Glover: weights shape the loop, the controller makes it robust."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv import series
from symheli.lpv.linear_model import as_model
from symheli.lpv.mixing import itself, mixed
from symheli.lpv.riccati import stabilising
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from synthesis.design.lti.point_design import DesignStatus, PointDesign, checked
from synthesis.design.lti.weights import Weight, as_weight
from synthesis.design.plant.diagnosis import reasons
from synthesis.design.plant.generalized import sampled_controller
from synthesis.design.plant.plant import Plant
from synthesis.design.plant.refusals import levels_above
from synthesis.numerics.linear.norm import to_continuous


def ncfsyn(
    G: LinearModel, W1: Weight = 1.0, W2: Weight = 1.0, *, back_off: float = 1.01
) -> PointDesign:
    """Design the controller of the largest normalized coprime stability margin of the shaped plant
    W2 G W1.

    It takes the loop alone, since its weights stand for disturbances and performance. Of a `Plant`
    it is the design for `plant.nominal.at(p).select(inputs=plant.controls,
    outputs=plant.measurements)`, and `Controller.of(plant, design)` is its `Controller`.

    The smallest gamma is known in closed form, sqrt(1 + rho(X Z)) with the solutions of two Riccati
    equations: every plant within 1/gamma of the shaped one in the nu-gap is stabilised as well. Up
    to 4 the shape of the loop is nearly kept.

    Parameters
    ----------
    G : LinearModel or system of python-control
        The plant, continuous or sampled.
    W1, W2 : weight
        Before and behind it: a number, a system of one input and output for all channels alike, a
        square system, or a sequence with one for each channel.
    back_off : float
        At least 1; the level of the controller by the optimum.

    Returns
    -------
    PointDesign
        `optimum` and, recomputed, `gamma` of the shaped plant; `controller` is W1 K W2 for the
        plant itself, u = W1 K W2 y with positive feedback; the states of W2 stand first, then the
        estimates, then the states of W1. `loop` is that of the shaped plant.

    Raises
    ------
    InputError
        A weight of 0, one with another number of channels or another sample period, a `back_off`
        that is not from 1 to 1000.

    References
    ----------
    McFarlane and Glover, IEEE Trans. Automatic Control 37 (1992); Skogestad and Postlethwaite
    (2005), Multivariable Feedback Control, section 9.4.

    Examples
    --------
    For an integrator the optimum is sqrt(2):

    >>> from symheli import LinearModel, LPVStateSpace

    >>> from symheli.lpv import series
    >>> integrator = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    >>> design = ncfsyn(integrator)
    >>> print(f"{design.optimum:.6f} {design.hinf_norm:.3f} {design.controller.D[0, 0]:.1f}")
    1.414214 1.428 0.0
    """
    G = as_model(G)
    levels_above(back_off)
    for name, weight in (("W1", W1), ("W2", W2)):
        if isinstance(weight, int | float) and weight == 0:
            raise InputError(f"{name}: expected a weight that is not 0, which opens the loop")
    before = as_weight(W1, "W1", G.inputs, G.dt)
    behind = as_weight(W2, "W2", G.outputs, G.dt)
    shaped = series(series(before, G), behind)
    whole = four_block(LPVStateSpace.constant(shaped))
    plant, names = whole.at(0.5).checked(whole.channels), whole.channels
    if against := reasons(plant, names, dt=G.dt):
        return PointDesign.without(DesignStatus.IMPOSSIBLE, against)
    found = _closed_form(shaped, back_off)
    design = None if found is None else checked(plant, found[1], names, G.dt)
    if found is None or design is None or design.controller is None:
        return PointDesign.without(
            DesignStatus.FAILED, ["a Riccati equation was not solved to a stable loop"]
        )
    K = series(series(behind, design.controller), before)
    return replace(design, optimum=min(found[0], design.hinf_norm), controller=K)


def four_block(G: LPVStateSpace) -> Plant:
    """Return the plant from noise on y and a disturbance of u to u and y: [K; I] (I - G K)^-1 [I,
    G].
    """
    noise = {Signal(f"{y}_noise", y.unit): y for y in G.outputs}
    disturbance = {Signal(f"{u}_disturbance", u.unit): u for u in G.inputs}
    inputs = {
        **{n: {} for n in noise},
        **{d: {u: 1.0} for d, u in disturbance.items()},
        **itself(G.inputs),
    }
    across = {y: {n: 1.0} for n, y in noise.items()}
    return Plant(
        mixed(G, inputs, itself(G.outputs), across),
        disturbances=(*noise, *disturbance),
        performance=(*G.inputs, *G.outputs),
        controls=G.inputs,
        measurements=G.outputs,
    )


def _closed_form(
    G: LinearModel, back_off: float
) -> tuple[float, tuple[Array, Array, Array, Array]] | None:
    """Return the smallest gamma, and the controller of `back_off` times that; its state estimates
    that of the shaped plant.
    """
    A, B, C, D = (G.A, G.B, G.C, G.D) if G.dt is None else to_continuous(G.A, G.B, G.C, G.D)
    S, R = np.linalg.inv(np.eye(D.shape[1]) + D.T @ D), np.linalg.inv(np.eye(len(D)) + D @ D.T)
    drift = A - B @ S @ D.T @ C
    driven, seen = B @ S @ B.T, C.T @ R @ C
    X, Z = stabilising(drift, -driven, seen), stabilising(drift.T, -seen, driven)
    if X is None or Z is None:
        return None
    least = math.sqrt(1 + float(np.abs(np.linalg.eigvals(X @ Z)).max(initial=0.0)))
    gamma = least * back_off
    F = -S @ (D.T @ C + B.T @ X)
    L = (1 - gamma**2) * np.eye(len(A)) + X @ Z
    into = gamma**2 * np.linalg.solve(L.T, Z @ C.T)
    K = A + B @ F + into @ (C + D @ F), -into, -B.T @ X, -D.T
    if G.dt is None:
        return least, K
    sampled = sampled_controller(*K)
    return None if sampled is None else (least, sampled)
