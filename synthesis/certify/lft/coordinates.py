"""Coordinates in which the LMI of an LFT has numbers of order one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli import LFT
from symheli.lpv.lft_matrices import parts
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.lft.proof import Coordinates
from synthesis.certify.statement.scaling import model_scaling


class Loop(NamedTuple):
    """dx/dt (or x(k+1)) = A x + Bw w + Bu u, z = Cz x + Dzw w + Dzu u, y = Cy x + Dyw w + Dyu u, w
    = Delta z.
    """

    A: Array
    Bw: Array
    Bu: Array
    Cz: Array
    Dzw: Array
    Dzu: Array
    Cy: Array
    Dyw: Array
    Dyu: Array


def split(lft: LFT) -> Loop:
    """Return the nine matrices of the LFT, unscaled."""
    x = len(lft.states)
    return Loop(
        lft.M22[:x, :x],
        lft.M21[:x],
        lft.M22[:x, x:],
        lft.M12[:, :x],
        lft.M11,
        lft.M12[:, x:],
        lft.M22[x:, :x],
        lft.M21[x:],
        lft.M22[x:, x:],
    )


def scaled(lft: LFT, coordinates: Coordinates) -> Loop:
    """Return the LFT in these coordinates: outputs divided by the channel, time in its unit; ratios
    of energies are unchanged.
    """
    (left, right, channel, time, *_), L, R = coordinates.units, coordinates.left, coordinates.right
    loop, root = split(lft), np.sqrt(time)
    return Loop(
        time * left @ loop.A @ right,
        root * left @ loop.Bw @ R,
        root * left @ loop.Bu,
        root * L @ loop.Cz @ right,
        L @ loop.Dzw @ R,
        L @ loop.Dzu,
        root * loop.Cy @ right / channel,
        loop.Dyw @ R / channel,
        loop.Dyu / channel,
    )


def coordinates(lft: LFT, gain: float, *, one: bool = False) -> Coordinates:
    """Compute coordinates from the model at the middle of the box and an expected `gain`: states by
    a Lyapunov solution, the copies of a parameter by balancing the responses of z to state noise
    and inputs against those of state and outputs to w (`one`: by one number).
    """
    middle = lft.at(*(s.middle for s in lft.parameters))
    every = [
        lft.at(*(s.middle + delta * s.radius for s in lft.parameters))
        for delta in np.linspace(-1.0, 1.0, 9)
    ]
    elsewhere = Matrices(*(np.stack([getattr(model, name) for model in every]) for name in "ABCD"))
    plain = Coordinates(
        model_scaling(middle, gain, elsewhere), np.eye(lft.order), np.eye(lft.order)
    )
    loop, n, x = scaled(lft, plain), lft.order, len(lft.states)
    s = _frequencies(loop.A, lft.dt is None)
    pencil = s[:, None, None] * np.eye(x) - loop.A
    noise = linalg.inv(plain.units.weight)
    B, C = np.hstack([loop.Bw, noise, loop.Bu]), np.vstack([loop.Cz, noise, loop.Cy])
    # the pseudo-inverse: only sizes matter, and next to a pole that is singular to rounding there
    # is one too
    G = C @ np.linalg.pinv(pencil) @ B
    G[:, :n, :n] += loop.Dzw
    G[:, :n, n + x :] += loop.Dzu
    G[:, n + x :, :n] += loop.Dyw
    reach, seen = (
        _spread(G[:, :n, n:], G[:, :n, :n]),
        _spread(_adjoint(G[:, n:, :n]), _adjoint(G[:, :n, :n])),
    )
    left, right = np.zeros((2, n, n))
    if one and np.trace(reach) > 0 and np.trace(seen) > 0:
        unit = float(np.trace(reach) / np.trace(seen)) ** 0.25
        left, right = np.eye(n) / unit, unit * np.eye(n)
    else:
        for part in parts(lft.sizes):
            left[part, part], right[part, part] = _balancing(reach[part, part], seen[part, part])
    return Coordinates(plain.units, left, right)


def _frequencies(A: Array, continuous: bool) -> Array:
    """Return the points at which the loop is evaluated, just outside the stability region so that a
    pole on its border does no harm.
    """
    if not continuous:
        return 1.005 * np.exp(1j * np.concatenate([[0.0], np.geomspace(1e-3, np.pi, 40)]))
    size = np.abs(np.linalg.eigvals(A)) if len(A) else np.ones(1)
    slowest = max(float(size.min()), 1e-12 * float(size.max()), 1e-300)
    omega = np.concatenate(
        [[0.0], np.geomspace(0.3 * slowest, 3 * max(float(size.max()), slowest), 40), size]
    )
    return 1j * omega + 0.005 * np.maximum(omega, slowest)


def _spread(direct: Array, around: Array) -> Array:
    """Return the sum over frequencies of H H*, with H the direct response and the response once
    around the loop.
    """
    once = direct @ _adjoint(direct)
    return np.real(once + around @ once @ _adjoint(around)).sum(axis=0)


def _balancing(reach: Array, seen: Array) -> tuple[Array, Array]:
    """Return T^-1 and T with T^-1 reach T^-T = T' seen T, diagonal; directions that hardly matter
    are bounded from below.
    """
    if not len(reach):
        return reach, reach
    # each copy in a unit of its own first: those it came with may differ by any number
    a, b = np.diag(reach), np.diag(seen)
    both = (a > 0) & (b > 0)
    unit = np.where(both, a / np.where(both, b, 1.0), 1.0) ** 0.25
    reach, seen = reach / np.outer(unit, unit), seen * np.outer(unit, unit)
    reach, seen = (
        M + 1e-6 * max(float(np.trace(M)) / len(M), 1e-300) * np.eye(len(M)) for M in (reach, seen)
    )
    size, directions = linalg.eigh(reach)
    # a loop on the border of stability leaves negative ones by rounding
    sizes = np.sqrt(np.maximum(size, 1e-12 * float(size.max())))
    root = directions * sizes
    values, V = linalg.eigh(root.T @ seen @ root)
    least = max(1e-24 * float(values.max()), 1e-300)
    level = np.maximum(values, least) ** 0.25
    inverse = level[:, None] * (V.T @ (directions / sizes).T) / unit
    return inverse, unit[:, None] * root @ V / level


def _adjoint(G: Array) -> Array:
    return np.conj(np.swapaxes(G, -1, -2))
