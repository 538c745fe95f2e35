"""Linear-quadratic designs at every p, as functions of p: LQR and LQG of a plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from symheli import UncertainStateSpace
from symheli.errors import InputError, SynthesisError
from symheli.lpv.bases import PiecewiseLinear
from symheli.lpv.riccati import SEMIDEFINITE
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, indices, signals
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.fitted import Fitted, controller_from, fitted
from synthesis.design.lpv.frozen_stability import frozen_stability
from synthesis.design.lti import linear_quadratic
from synthesis.design.plant.diagnosis import reasons
from synthesis.design.plant.generalized import Generalized
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import conditions, least_ranks, require_channels

ACCURACY = 1e-3
"""Relative error of the functions of p that a schedule is made of, at which the next are not tried.
"""
Weight = ArrayLike | Mapping[str, float]
Points = Sequence[float] | Array


def lqr(
    plant: Plant,
    points: Points | None = None,
    *,
    Q: Weight | None = None,
    R: Weight | None = None,
    N: ArrayLike | None = None,
) -> Controller:
    """Design a state feedback u = F(p) x, F at every p from the Riccati equation of the frozen
    plant.

    States that are not measured, those of delays and servos among them, are computed in the
    controller by their own equations from the measured states and the commands; what disturbs them
    is left out.

    Parameters
    ----------
    plant : Plant
        Continuous or sampled; its measurements are linearly independent, their noise is left out.
    points : sequence of float, optional
        Values of the one parameter, between which the controller is straight; default: polynomials
        or splines in all parameters, see `Controller.misfit`.
    Q, R : array or mapping of str to float, optional
        Weights (n, n) of the states and (nu, nu) of the controls in x'Qx + 2 x'Nu + u'Ru, or
        {signal: number} of their diagonals, 0 where no state is named; both or none. Default: the
        squares of the plant's performance.
    N : array (n, nu), optional
        The mixed weight, with Q and R.

    Returns
    -------
    Controller
        It promises no gain; `certify` proves one.

    Raises
    ------
    InputError
        Weights that are not definite; measurements that depend on each other or on the controls.
    SynthesisError
        No stabilising solution at some p, states that cannot be computed by their own equations,
        or a frozen loop that is not stable; with reasons.

    See Also
    --------
    synthesis.lqg : the regulator on a Kalman filter
    synthesis.state_feedback : u = F(p) x by linear matrix inequalities

    References
    ----------
    Anderson and Moore (1990), Optimal Control, chapters 2 and 3; Gavrilets et al., AIAA 2002-4834,
    for the schedule over airspeed.

    Examples
    --------
    >>> import symheli
    >>> cart = symheli.LinearModel(
    ...     [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)),
    ...     ["s", "v"], ["u"], ["s", "v"])
    >>> moved = synthesis.Plant(cart, controls=["u"], measurements=["s", "v"])
    >>> print(synthesis.lqr(moved, Q={"s": 1.0}, R={"u": 1.0}).at(0.0).D.round(4))
    [[-1.     -1.4142]]
    """
    require_plant(plant)
    require_channels(plant, disturbances=False, performance=Q is None)
    cost = _cost(plant, Q, R, N)
    if cost is None:
        least_ranks(plant, measurements=False, disturbances=False)
    kept = _not_measured(plant)
    n = len(plant.states)
    any_noise = _Root(*np.hsplit(np.eye(n + len(plant.measurements)), [n]))

    def design(p: Array) -> Array:
        P = _with(plant.at(*p), cost, any_noise)
        found = linear_quadratic.control_gains(P, plant.dt)
        if found is None:
            raise _without(plant, p, P)
        return _computing(P, found.F, kept)

    names = [Signal(f"{plant.states[i]}_computed", plant.states[i].unit) for i in kept]
    made = _schedule(plant, design, points, names, "LQR")
    return _stable(made, "the states that are not measured" if len(kept) else "")


def lqg(
    plant: Plant,
    points: Points | None = None,
    *,
    Q: Weight | None = None,
    R: Weight | None = None,
    N: ArrayLike | None = None,
    W: Weight | None = None,
    V: Weight | None = None,
) -> Controller:
    """Design the linear-quadratic regulator on a Kalman filter at every p of a plant.

    Of a frozen plant it is the controller of `h2`; of a continuous one without the direct way from
    disturbances to performance.

    Parameters
    ----------
    plant, points, Q, R, N
        As in `lqr`.
    W, V : array or mapping of str to float, optional
        Intensities (n, n) of white noise in dx/dt and (ny, ny) in the measurements (sampled:
        variances), or {signal: number} of their diagonals; both or none. Default: those of unit
        white noise at the plant's disturbances.

    Returns
    -------
    Controller
        Its state estimates the plant's. It promises no gain; `certify` proves one.

    Raises
    ------
    InputError
        Weights or intensities that are not definite; a control without weight or a measurement
        without noise.
    SynthesisError
        No stabilising solution at some p, or a frozen loop that is not stable; with reasons.

    See Also
    --------
    synthesis.lqr : state feedback by Riccati equations
    synthesis.h2 : least variance of one model
    synthesis.estimator : an observer with a bound of its error

    References
    ----------
    Zhou, Doyle, Glover (1996), section 14.5; Chen and Francis (1995), section 6.6.

    Examples
    --------
    >>> made = synthesis.lqg(plant)
    >>> print(made.order, made.certify(search=None).verified)
    1 True
    """
    require_plant(plant)
    require_channels(plant, disturbances=W is None, performance=Q is None)
    cost, noise = _cost(plant, Q, R, N), _noise(plant, W, V)
    least_ranks(
        plant,
        controls=cost is None,
        measurements=noise is None,
        disturbances=noise is None,
        performance=cost is None,
    )

    def design(p: Array) -> Array:
        P = _with(plant.at(*p), cost, noise)
        K = linear_quadratic.lqg(P, plant.dt)
        if K is None:
            raise _without(plant, p, P)
        A, B, C, D = linear_quadratic.given_direct_way(P.D22, *K)
        return np.block([[A, B], [C, D]])

    names = [Signal(f"{s}_estimate", s.unit) for s in plant.states]
    return _stable(_schedule(plant, design, points, names, "LQG"))


class _Root(NamedTuple):
    """Rows whose squares add up to a weight: those of the states, and of controls or
    measurements.
    """

    states: Array
    others: Array


def _cost(plant: Plant, Q: Weight | None, R: Weight | None, N: ArrayLike | None) -> _Root | None:
    n, nu = len(plant.states), len(plant.controls)
    if Q is None and R is None and N is None:
        return None
    if Q is None or R is None:
        raise InputError("give both Q and R, or none: then the plant's performance is the weight")
    mixed = np.zeros((n, nu)) if N is None else frozen(N, "N", (n, nu))
    return _root(
        _weight(Q, "Q", plant.states), _weight(R, "R", plant.controls), mixed, "[Q N; N' R]", "R"
    )


def _noise(plant: Plant, W: Weight | None, V: Weight | None) -> _Root | None:
    if W is None and V is None:
        return None
    if W is None or V is None:
        raise InputError("give both W and V, or none: then the plant's disturbances are the noise")
    none = np.zeros((len(plant.states), len(plant.measurements)))
    return _root(_weight(W, "W", plant.states), _weight(V, "V", plant.measurements), none, "W", "V")


def _weight(given: Any, name: str, names: Sequence[Signal]) -> Array:
    """Return a weight (n, n) of these signals, given as a matrix or by its diagonal."""
    if not isinstance(given, Mapping):
        return frozen(given, name, (len(names), len(names)))
    out = np.zeros(len(names))
    out[indices(given, names, f"signal of {name}")] = [float(v) for v in given.values()]
    return np.diag(frozen(out, name, (len(names),)))


def _root(states: Array, others: Array, mixed: Array, what: str, strict: str) -> _Root:
    whole = np.block([[states, mixed], [mixed.T, others]])
    n = len(states)
    units = np.sqrt(np.where(np.diag(whole) > 0, np.diag(whole), 1.0))
    values, vectors = np.linalg.eigh(whole / units / units[:, None])
    least = float(np.linalg.eigvalsh(whole[n:, n:] / units[n:] / units[n:, None])[0])
    if np.abs(whole - whole.T).max() > SEMIDEFINITE * np.abs(whole).max():
        raise InputError(f"{what}: expected symmetric matrices")
    if values[0] < -SEMIDEFINITE or least <= SEMIDEFINITE:
        raise InputError(
            f"{what} must be positive semidefinite and {strict} positive definite: every"
            f" {'control' if strict == 'R' else 'measurement'} needs a number > 0"
        )
    rows = (vectors * np.sqrt(np.maximum(values, 0.0))).T * units
    return _Root(rows[:, :n], rows[:, n:])


def _with(P: Generalized, cost: _Root | None, noise: _Root | None) -> Generalized:
    """Return the plant with these weights in place of its own."""
    if cost is not None:
        P = P._replace(C1=cost.states, D12=cost.others)
    if noise is not None:
        P = P._replace(B1=noise.states.T, D21=noise.others.T)
    return P if cost is noise is None else P._replace(D11=np.zeros((len(P.C1), P.B1.shape[1])))


def _not_measured(plant: Plant) -> list[int]:
    """Return the numbers of the states that the measurements, known exactly, leave to be
    computed.
    """
    p, reasons = conditions(plant)
    at = plant.matrices(p)
    ny = len(plant.measurements)
    _, _, order = linalg.qr(at.C2[len(reasons) // 2], pivoting=True)  # type: ignore[misc]
    kept = sorted(order[ny:])
    own = np.delete(at.C2, kept, axis=-1)
    dependent = own.shape[-2] != own.shape[-1] or any(
        np.linalg.cond(M) > 1 / np.finfo(float).eps for M in own
    )
    if dependent or np.any(at.D22):
        raise InputError(
            f"LQR: the measurements {', '.join(plant.measurements)} must be linearly independent"
            " combinations of the states at every p, without the controls; leave some out, or take"
            " lqg"
        )
    return kept


def _computing(P: Generalized, F: Array, kept: list[int]) -> Array:
    """Return [A B; C D] of u = F x, the states `kept` computed, the others read from y."""
    seen = [i for i in range(len(P.A)) if i not in kept]
    read = np.linalg.inv(P.C2[:, seen])
    D = F[:, seen] @ read
    C = F[:, kept] - D @ P.C2[:, kept]
    into = P.A[np.ix_(kept, seen)] @ read
    A = P.A[np.ix_(kept, kept)] - into @ P.C2[:, kept] + P.B2[kept] @ C
    return np.block([[A, into + P.B2[kept] @ D], [C, D]])


def _schedule(
    plant: Plant,
    design: Callable[[Array], Array],
    points: Points | None,
    names: Sequence[Signal],
    method: str,
) -> Controller:
    """Return the designs [A B; C D] at single p (m,) as one controller over p."""
    if points is None and plant.basis.size == 1:
        middle = np.array([0.5 * (s.low + s.high) for s in plant.parameters])
        fit = Fitted(plant.basis, design(middle)[None] / plant.basis(middle)[0], 0.0)
    elif points is None:
        fit = fitted(lambda p: np.stack([design(q) for q in p]), plant.parameters, ACCURACY)
    elif len(plant.parameters) > 1:
        raise InputError("points: a schedule through points is over one parameter; leave them out")
    else:
        at = frozen(points, "points", (None,))
        M = np.stack([design(q[None]) for q in at])
        fit, method = Fitted(PiecewiseLinear(tuple(at.tolist())), M, 0.0), f"{method} at points"
    return controller_from(plant, fit, signals(names), math.nan, method)


def _stable(made: Controller, computed: str = "") -> Controller:
    """Return the controller; raise `SynthesisError` where a frozen loop is not stable."""
    loop = made.closed()
    found = frozen_stability(loop.nominal if isinstance(loop, UncertainStateSpace) else loop)
    if found.stable is not False or found.p is None:
        return made
    at = ", ".join(
        f"{s.name} = {v:g} {s.unit}"
        for s, v in zip(made.plant.parameters, np.atleast_1d(found.p), strict=True)
    )
    why = f"the loop is not stable at {at}"
    if computed:
        why += f": {computed} cannot be computed by their own equations; measure more or take lqg"
    raise SynthesisError(why, (why,))


def _without(plant: Plant, p: Array, P: Generalized) -> SynthesisError:
    at = ", ".join(f"{s.name} = {v:g}" for s, v in zip(plant.parameters, p, strict=True))
    why = reasons(P, plant.channels, dt=plant.dt) or ("a Riccati equation was not solved",)
    return SynthesisError(f"no design at {at}: {'; '.join(why)}", tuple(why))
