"""Coefficient diagram method: a controller of one input and output by a target polynomial."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import companion

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.equilibration import is_singular
from symheli.lpv.linear_model import as_model
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.signal import Signal

STANDARD = (2.5, 2.0)
"""Stability indices of Manabe's standard form; the last one holds for all further ones."""
REACHED, REFINEMENTS = 1e-9, 3
"""Relative error of every coefficient of the target that counts as reached, and steps of the
solution.
"""


def target(tau: float, order: int, indices: Sequence[float] = STANDARD) -> Array:
    """Return the polynomial of an order, (order + 1,), from the highest power, constant term 1:
    a_1 / a_0 = tau, a_i^2 / (a_(i-1) a_(i+1)) = the i-th stability index.
    """
    g = [*indices, *[indices[-1]] * order]
    a = [1.0, tau]
    for i in range(1, order):
        a.append(a[i] ** 2 / (g[i - 1] * a[i - 1]))
    return np.array(a[order::-1])


def coefficient_diagram(
    G: LinearModel,
    tau: float,
    *,
    integral: bool = False,
    roll_off: bool = False,
    indices: Sequence[float] | Array = STANDARD,
) -> LinearModel:
    """Design a controller of one model by the coefficient diagram method.

    It takes the loop alone, since its target is the polynomial of that. Of a `Plant` it is the
    design for `plant.nominal.at(p).select(inputs=plant.controls, outputs=plant.measurements)`, and
    `Controller.of(plant, K)` of the result is its `Controller`.

    The characteristic polynomial of the loop is that of an equivalent time constant and of
    stability indices, reached by the controller of least order: one below the plant's, one more for
    an integrator, and one more to be strictly proper.

    Parameters
    ----------
    G : LinearModel or system of python-control
        Continuous, of one input and output, strictly proper, controllable and observable.
    tau : float
        Equivalent time constant, s; a step settles after about 2.5 to 3 of them.
    integral : bool
        Whether the controller has an integrator.
    roll_off : bool
        Whether it is strictly proper.
    indices : sequence of float
        Stability indices gamma_1, gamma_2, ...; the last one holds for all further ones.

    Returns
    -------
    LinearModel
        u = K y, with positive feedback as of every design here.

    Raises
    ------
    InputError
        Another plant, indices whose polynomial is not stable, a numerator and a denominator with a
        common factor.

    References
    ----------
    Manabe, Coefficient diagram method, IFAC Proceedings 31 (1998), 211-222.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> cart = LinearModel([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]],
    ...                    ["s", "v"], ["u"], ["s"])
    >>> K = synthesis.designs.coefficient_diagram(cart, 1.0)
    >>> print(-K.D - K.C @ np.linalg.solve(-K.A, K.B))  # k_0 / l_0 = 1 / (tau^2 / gamma_1)
    [[2.5]]
    """
    G = as_model(G)
    tau, g = positive(tau, "tau"), frozen(indices, "indices", (None,))
    sizes = len(G.states), len(G.inputs), len(G.outputs)
    if G.dt is not None or np.any(G.D) or sizes[1:] != (1, 1) or not sizes[0]:
        raise InputError(
            "cdm: expected a continuous, strictly proper plant with states, of one input and one"
            " output (of a direct way put a servo before it), got {} states, {} inputs, {} outputs,"
            f" dt {G.dt}, D {'not zero' if np.any(G.D) else 'zero'}".format(*sizes)
        )
    if not len(g) or not (g > 0).all():
        raise InputError(f"indices: expected numbers > 0, got {indices!r:.80}")
    n = len(G.states)
    order = n - 1 + integral + roll_off
    P = target(1.0, n + order, g.tolist())  # in the time unit tau, as all below
    if np.roots(P).real.max(initial=-1.0) >= 0:
        raise InputError(f"indices {g.tolist()}: their polynomial is not stable; raise them")
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        numerator, denominator = _fraction(tau * G.A, tau * G.B, G.C)
    if not np.isfinite([*numerator, *denominator]).all():
        raise InputError(f"tau: {tau:g} s is out of all proportion to the poles of the plant")
    size = np.abs(numerator).max(initial=0.0)
    powers_a, powers_b = range(order, int(integral) - 1, -1), range(order - roll_off, -1, -1)
    columns = [_shifted(denominator, k, n + order) for k in powers_a]
    columns += [_shifted(numerator / (size or 1.0), k, n + order) for k in powers_b]
    x = _solved(np.array(columns).T, P)
    if x is None:
        near = f"{_common(numerator, denominator) / tau:.4g} 1/s"
        raise InputError(
            "cdm: numerator and denominator of the plant have a common factor, or nearly (near"
            f" {near}{', the integrator' if integral else ''}): leave out the mode that is not"
            " controllable or not observable"
        )
    a = np.concatenate([x[: len(powers_a)], np.zeros(int(integral))])
    b = x[len(powers_a) :] / size
    a, b = a / a[0], np.concatenate([np.zeros(int(roll_off)), -b / a[0]])
    A, B = companion(a) if order else np.zeros((0, 0)), np.eye(order, 1)
    C, D = (b[1:] - b[0] * a[1:])[None], b[:1, None]
    states = tuple(Signal(f"k{i + 1}") for i in range(order))
    return LinearModel(A / tau, B / tau, C, D, states, G.outputs, G.inputs)


def _fraction(A: Array, B: Array, C: Array) -> tuple[Array, Array]:
    """Return numerator (n,) and denominator (n + 1,) of C (s - A)^-1 B, from the highest power."""
    denominator = np.real(np.poly(A)) if len(A) else np.ones(1)
    h, numerator = B[:, 0], []
    for k in range(len(A)):  # sum of Markov parameters C A^j B times the denominator's coefficients
        markov = [float(C[0] @ np.linalg.matrix_power(A, j) @ h) for j in range(k + 1)]
        numerator.append(sum(denominator[k - j] * markov[j] for j in range(k + 1)))
    return np.array(numerator), denominator


def _solved(M: Array, P: Array) -> Array | None:
    """Return x of M x = P with every coefficient reached to `REACHED`; None where M is singular."""
    if is_singular(M):
        return None
    wide, x = M.astype(np.longdouble), np.zeros(len(P))
    for _ in range(REFINEMENTS):
        x = np.asarray(x + np.linalg.solve(M, np.asarray(P - wide @ x, float)), float)
    return x if (np.abs(wide @ x - P) <= REACHED * np.abs(P)).all() else None


def _shifted(polynomial: Array, power: int, order: int) -> Array:
    """Return the polynomial times s^power, (order + 1,), from the highest power."""
    out = np.zeros(order + 1)
    low = order + 1 - power
    out[low - len(polynomial) : low] = polynomial
    return out


def _common(numerator: Array, denominator: Array) -> complex:
    """Return the pole that is nearest to a zero."""
    zeros, poles = np.roots(numerator), np.roots(denominator)
    if not len(zeros):
        return complex(poles[0])
    return complex(poles[int(np.argmin(np.abs(poles[:, None] - zeros).min(axis=1)))])
