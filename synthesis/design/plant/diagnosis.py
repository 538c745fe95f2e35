"""Diagnosis of a plant: why no controller exists, or why its gamma is not meaningful, in sentences
with signal names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from symheli.lpv.equilibration import equilibrate
from symheli.lpv.modes import Mode, hidden_modes, on_the_border, unstable
from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Channels, Generalized, continuous_plant
from synthesis.design.plant.unreachable import Unreachable, unreachable_gain
from synthesis.numerics.linear.norm import norm

SINGULAR = 1e-9
"""Singular values of a matrix with entries of order one up to this fraction of the largest count
as zero.
"""

FLOOR_TOLERANCE = 0.01
"""Relative difference up to which a gamma counts as decided by the part that no controller can
lower.
"""

FLOOR_ERROR = 1e-6
"""Relative error of that part for ill-conditioned plants: a gamma below it by more contradicts it.
"""

NAMED_FRACTION = 0.3
"""Least component of a signal in a direction, relative to the largest, with which the signal is
named.
"""


def reasons(
    plant: Generalized,
    channels: Channels,
    *,
    dt: float | None = None,
    gamma: float | None = None,
    at: Sequence[object] | None = None,
) -> tuple[str, ...]:
    """Return why a synthesis for this plant must fail, or why its gamma is not meaningful, a
    sentence each.

    Modes that the controls cannot stabilise or the measurements cannot detect; controls without a
    price and measurements without noise; invariant zeros on the border of stability, where the
    Riccati equations have no solution; and, with a `gamma`, the part of it that no controller can
    lower.

    Parameters
    ----------
    plant : Generalized
        Matrices; those of a family of frozen models with a leading axis.
    channels : Channels
        The names of its signals.
    dt : float, optional
        Sample period, s; None: continuous.
    gamma : float, optional
        A requested level, or the level reached.
    at : sequence, optional
        What to call each frozen model, for a family: "airspeed = 3 m/s".

    Returns
    -------
    tuple of str
        Empty where nothing stands against a synthesis.

    References
    ----------
    Zhou, Doyle, Glover (1996), Robust and Optimal Control, sections 2.11 and 16.2.

    Examples
    --------
    >>> import numpy as np
    >>> from symheli import LinearModel
    >>> from synthesis.design.plant.generalized import Channels, Generalized
    >>> heave = LinearModel(
    ...     [[0.5, 0.0], [0.0, -1.0]], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [[1, 1], [0, 0], [1, 0]],
    ...     [[0, 0, 0], [0, 0, 1], [0, 1, 0]], ("w", "lag"), ("gust", "noise", "d_col"),
    ...     ("z1", "z2", "y"),
    ... )
    >>> of = ["d_col"], ["y"]
    >>> found = reasons(Generalized.of(heave, *of), Channels.of(heave, *of))
    >>> print(*[sentence.split(":")[0] for sentence in found])
    the mode at 0.5 rad/s (mostly w) is not stable, and d_col cannot stabilise it
    """
    return _over_family(plant, at, lambda P: _reasons(P, channels, dt, gamma))


def modes_out_of_reach(
    plant: Generalized, channels: Channels, *, dt: float | None, at: Sequence[object] | None = None
) -> tuple[str, ...]:
    """Return a sentence for each mode that no controller can stabilise; see `reasons`."""

    def modes(P: Generalized) -> list[str]:
        return [*_modes(P, channels, dt), *_modes(P.dual, channels, dt, dual=True)]

    return _over_family(plant, at, modes)


def _over_family(
    plant: Generalized, at: Sequence[object] | None, sentences: Callable[[Generalized], list[str]]
) -> tuple[str, ...]:
    leading = np.broadcast_shapes(*(M.shape[:-2] for M in plant))
    if not leading:
        return tuple(sentences(plant))
    family = [np.broadcast_to(M, (*leading, *M.shape[-2:])) for M in plant]
    first: dict[str, list[str]] = {}
    for k in np.ndindex(leading):
        label = str(at[k[0]]) if at is not None else f"model {k[0] if len(k) == 1 else k}"
        for sentence in sentences(Generalized(*(M[k] for M in family))):
            first.setdefault(sentence, []).append(label)
    return tuple(f"{_where(labels)}: {sentence}" for sentence, labels in first.items())


def _where(labels: Sequence[str]) -> str:
    more = len(labels) - 1
    return f"at {labels[0]}" + (f" and {more} more" if more else "")


def _reasons(P: Generalized, names: Channels, dt: float | None, gamma: float | None) -> list[str]:
    found = [*_modes(P, names, dt), *_modes(P.dual, names, dt, dual=True)]
    found += _singular(P, names, dt)
    if gamma is not None:
        found += decided_by(P, names, gamma, dt)
    return found


def _modes(P: Generalized, names: Channels, dt: float | None, *, dual: bool = False) -> list[str]:
    """Return sentences on modes that cannot be stabilised; for the dual plant, on those that cannot
    be detected.
    """
    hidden = hidden_modes(P.A.T, P.B2.T, partial(unstable, sampled=dt is not None))
    through, sense = (
        (names.measurements, "detect it: measure what it moves")
        if dual
        else (names.controls, "stabilise it: add a control that drives it")
    )
    return [
        f"the mode {mode.place(dt)} (mostly {mode.among(names.states)}) is not stable, and"
        f" {_listed(through)} cannot {sense}, or leave it out"
        for mode in hidden
    ]


def _singular(P: Generalized, names: Channels, dt: float | None) -> list[str]:
    """Return sentences on controls without a weight, measurements without noise, and zeros on the
    stability boundary.
    """
    if dt is not None:
        if np.any(np.abs(np.linalg.eigvals(P.A) + 1) < SINGULAR):
            return ["a mode at z = -1, half the sample frequency: sample at another rate"]
        P = continuous_plant(P)
    out = []
    for plant, dual in ((P, False), (P.dual, True)):
        signals = names.measurements if dual else names.controls
        at_nyquist = "" if dt is None else " at half the sample frequency"
        free = unpriced(plant.D12, signals, at_nyquist, dual=dual)
        out += free
        if not free:
            out += [_zero(mode, names, dt, dual=dual) for mode in axis_zeros(plant)]
    return out


def unpriced(D12: Array, names: Sequence[str], where: str = "", *, dual: bool = False) -> list[str]:
    """Return a sentence for each direction of the controls `names` that D12 (.., nz, nu) does not
    see; for the dual plant, for measurements that no disturbance enters.
    """
    found: dict[str, None] = {}
    for each in D12.reshape(-1, *D12.shape[-2:]):
        for direction in free_directions(each).T:
            what = _direction(direction, names)
            found[
                f"{what} has no noise{where} (D21 loses row rank): add a disturbance, however"
                " small, that acts on it alone"
                if dual
                else f"{what} is not in the performance{where} (D12 loses column rank): add it"
                " with a weight, however small"
            ] = None
    return list(found)


def free_directions(D12: Array) -> Array:
    """Return the directions (nu, k) of the controls that D12 (nz, nu) does not see, in units of
    their own.
    """
    nu = D12.shape[1]
    if not np.any(D12):
        return np.eye(nu)
    row, column = equilibrate(np.abs(D12))
    _, values, V = np.linalg.svd(row[:, None] * D12 * column)
    seen = int(np.sum(values > SINGULAR * values[0]))
    directions = column[:, None] * V[seen:].T
    return directions / np.abs(directions).max(axis=0, initial=1e-300)


def axis_zeros(P: Generalized) -> list[Mode]:
    """Return the invariant zeros of (A, B2, C1, D12) on the imaginary axis; D12 has full column
    rank.

    They are the modes of the plant with z's part along D12 held at zero that the rest of z does not
    see.
    """
    inverse = np.linalg.pinv(P.D12)
    rest = np.eye(len(P.D12)) - P.D12 @ inverse
    return hidden_modes(
        P.A - P.B2 @ inverse @ P.C1, rest @ P.C1, partial(on_the_border, sampled=False)
    )


def _zero(mode: Mode, names: Channels, dt: float | None, *, dual: bool) -> str:
    omega = mode.value.imag if dt is None else 2 * math.atan(mode.value.imag) / dt
    omega = 0.0 if omega < 1e-12 else omega
    states = mode.among(names.states)
    if dual:
        return (
            f"no disturbance moves {states} at {omega:.4g} rad/s as the measurements see it (a zero"
            " from disturbances to measurements on the border of stability): add a disturbance on"
            f" {states}"
        )
    return (
        f"{states} can move at {omega:.4g} rad/s unseen by the performance (a zero from controls to"
        f" performance on the border of stability): put {states} into the performance"
    )


def decided(
    family: Generalized,
    names: Channels,
    reached: float,
    gamma: float,
    at: Sequence[str],
    dt: float | None = None,
) -> tuple[str, ...]:
    """Return which part of a level `gamma` no scheduled controller can lower, at which of the
    frozen models (leading axis, called `at`); and whether all keep it with the controls at rest.

    One is known that keeps `reached`: a floor above that is rounding.
    """
    each = [Generalized(*M) for M in zip(*family, strict=True)]
    floors = [unreachable_gain(P, dt) for P in each]
    close = [
        k
        for k, floor in enumerate(floors)
        if gamma <= floor.gamma * (1 + FLOOR_TOLERANCE)
        and floor.gamma <= reached * (1 + FLOOR_TOLERANCE)
    ]
    close.sort(key=lambda k: -floors[k].gamma)
    out = []
    if close:
        (sentence,) = _unreachable(floors[close[0]], names, gamma)
        out.append(f"{_where([at[k] for k in close])}: {sentence}")
    return (*out, *_idle(max(_at_rest(P, dt) for P in each), gamma))


def decided_by(
    P: Generalized,
    names: Channels,
    gamma: float,
    dt: float | None = None,
    reached: float = math.inf,
) -> list[str]:
    """Return sentences on the part of a level `gamma` that no controller can lower, where that is
    all of it or more.

    Where a controller that keeps `reached` is known, a floor above that is rounding.
    """
    floor, idle = unreachable_gain(P, dt), _idle(_at_rest(P, dt), gamma)
    return [*(_unreachable(floor, names, gamma) if floor.gamma <= reached else ()), *idle]


def _unreachable(floor: Unreachable, names: Channels, gamma: float) -> list[str]:
    if gamma < floor.gamma * (1 - FLOOR_ERROR):
        return [f"gamma = {gamma:.6g} cannot be reached: {_floor(floor, names)}"]
    if gamma > floor.gamma * (1 + FLOOR_TOLERANCE):
        return []
    if floor.at_rest <= floor.gamma * (1 + FLOOR_TOLERANCE):
        return [
            f"gamma = {gamma:.6g} proves nothing: {_floor(floor, names)}, as it is with the"
            " controls at rest; scale those signals or their weights, or give the"
            " controls a lower price"
        ]
    return [
        f"gamma = {gamma:.6g} is limited at a single frequency: {_floor(floor, names)}; it does"
        " not reflect the rest of the loop"
    ]


def _at_rest(P: Generalized, dt: float | None) -> float:
    return norm(P.A, P.B1, P.C1, P.D11, dt)[0]


def _idle(idle: float, gamma: float) -> list[str]:
    if idle > gamma * (1 + FLOOR_TOLERANCE):
        return []
    return [
        f"the gain is {idle:.6g} with the controls at rest: a controller for gamma ="
        f" {gamma:.6g} need not do anything; scale performance and disturbances"
    ]


def _floor(floor: Unreachable, names: Channels) -> str:
    z = _foremost(floor.performance, names.performance)
    w = _foremost(floor.disturbances, names.disturbances)
    if floor.omega == 0:
        where = "at 0 rad/s (the DC gain of the weight)"
    elif math.isinf(floor.omega):
        where = "by the direct way (D11)"
    else:
        where = f"at {floor.omega:.4g} rad/s"
    return (
        f"whatever the controller does, the gain from {w} to {z} is at least {floor.gamma:.6g}"
        f" {where}"
    )


def _foremost(sizes: Array, names: tuple[str, ...]) -> str:
    order = np.argsort(-sizes)
    return _listed([names[i] for i in order if sizes[i] >= NAMED_FRACTION * sizes.max()])


def _direction(direction: Array, names: Sequence[str]) -> str:
    """Return one signal by its name, a combination with its coefficients."""
    parts = [(c, n) for c, n in zip(direction, names, strict=True) if abs(c) > 1e-6]
    if len(parts) == 1:
        return str(parts[0][1])
    lead = parts[int(np.argmax([abs(c) for c, _ in parts]))][0]
    return "the combination " + " ".join(
        f"{'-' if c / lead < 0 else '+'} {abs(c / lead):.3g} {n}" for c, n in parts
    ).removeprefix("+ ")


def _listed(names: Sequence[str]) -> str:
    names = [str(n) for n in names]
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
