"""Functions V = x' P x of an LFT, with a multiplier: its parameters may jump.

With w = Delta z, Delta = diag(delta_i I), delta_i = (p_i - middle)/radius in [-1, 1], and rows (z,
dx/dt or x(k+1), y) of the LFT, for all (w, x, u) other than zero

    dV/dt + [w; z]' [Q S; S' R] [w; z] + |y|^2 - g^2 |u|^2 < 0,  P > 0

and the multiplier is nonnegative for every Delta: N = Delta Q Delta + Delta S + S' Delta + R >= 0.
It is where R = -Q = diag(D_i) > 0 and S = diag(G_i), G_i = -G_i', since then N = (I - Delta^2) D;
or where Q_ii < 0, so that N is concave in each delta_i alone, and N > 0 at the corners of the box.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product as combinations
from typing import Any

from . import words
from .demands import Claim, Demand
from .polynomials import Polynomial, block, diagonal, even, matrix
from .reading import (
    Unreadable,
    array,
    bound_of,
    field,
    items,
    names,
    parameters,
    period,
    whole,
)

MOST_CORNERS = 4096
"""Corners of the box at which a multiplier is checked."""


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate of an LFT claims."""
    proof = field(content, "proof")
    lft, V = field(proof, "lft"), field(proof, "lyapunov")
    blocks = items(field(lft, "blocks"), "blocks")
    motion = parameters([field(each, "scheduling") for each in blocks])
    sizes = [whole(field(each, "size"), "the size of a block", 0, 10**4) for each in blocks]
    x, u, y = (names(field(lft, name), name) for name in ("states", "inputs", "outputs"))
    dt, (nw, nx, nu, ny) = period(field(lft, "dt")), (sum(sizes), len(x), len(u), len(y))
    if kind != ("l2 gain" if nu else "stability"):
        raise Unreadable(f"an LFT of {nu} inputs has no proof of the kind {kind!r:.40}")
    if field(content, "rates") != [{"float": "inf"}] * len(motion):
        raise Unreadable("the proof of an LFT is for parameters that jump, the claim is not")
    parts = {
        name: matrix(array(field(lft, name), name, rows, columns), columns)
        for name, rows, columns in (
            ("M11", nw, nw), ("M12", nw, nx + nu), ("M21", nx + ny, nw), ("M22", nx + ny, nx + nu)
        )
    }  # fmt: skip
    M = block([[parts["M11"], parts["M12"]], [parts["M21"], parts["M22"]]])
    P = even(array(field(V, "P"), "P", nx, nx))
    given = field(V, "multiplier")
    Q, S, R = (array(field(given, name), name, nw, nw) for name in "QSR")
    multiplier = even(Q), matrix(S, nw), even(R)
    if field(given, "sizes") != sizes:
        raise Unreadable("the multiplier is not one of the blocks of the LFT")

    def demands() -> Iterator[Demand]:
        yield Demand("V > 0", P)
        yield from _nonnegative(multiplier, sizes)
        yield _falling(M, P, multiplier, nw, nu, dt is not None)

    bound = bound_of(kind, content)
    jumping = [p._replace(rate=None, tie=None) for p in motion]
    said = [words.sizes(nx, nu, ny, dt), *words.motion(jumping)]
    return Claim(words.gain(kind, bound), said, demands(), bound, lambda g: g * g)


def _falling(
    M: Polynomial, P: Polynomial, multiplier: Any, nw: int, nu: int, sampled: bool
) -> Demand:
    """Return the inequality of dV/dt in (w, x, u); of stability in (w, x)."""
    nx, size = P.shape[0], M.shape[1]
    Q, S, R = multiplier
    z, move, y = (M.part(range(a, b)) for a, b in ((0, nw), (nw, nw + nx), (nw + nx, M.shape[0])))
    everything = diagonal(range(size), size)
    w, x = everything.part(range(nw)), everything.part(range(nw, nw + nx))
    cross = w.T @ S @ z
    form = z.T @ R @ z + w.T @ Q @ w + cross + cross.T
    if sampled:
        form = form + move.T @ P @ move - x.T @ P @ x
    else:
        slope = x.T @ P @ move
        form = form + slope + slope.T
    if nu:
        form = form + y.T @ y
    return Demand("V falls", -form, None, diagonal(range(nw + nx, size), size) if nu else None)


def _nonnegative(multiplier: Any, sizes: list[int]) -> Iterator[Demand]:
    """Yield what makes the multiplier nonnegative for every Delta of the box."""
    Q, S, R = multiplier
    owner = [i for i, size in enumerate(sizes) for _ in range(size)]
    n = range(len(owner))
    apart = [(a, b) for a in n for b in n if owner[a] != owner[b]]
    coupled = any(M.part([a], [b]).reduced().terms for M in (S, R) for a, b in apart)
    scalings = not (coupled or (Q + R).reduced().terms or (S + S.T).reduced().terms)
    places = [[k for k in n if owner[k] == i] for i in range(len(sizes))]
    for own in places:
        yield Demand("the multiplier is concave in each parameter", -Q.part(own, own))
    if scalings:
        return
    if 2 ** len(sizes) > MOST_CORNERS:
        raise Unreadable("the multiplier has more corners than this checker looks at")
    for signs in combinations((-1, 1), repeat=len(sizes)):
        Delta = matrix([[signs[owner[i]] * (i == j) for j in n] for i in n], len(n))
        turned = Delta @ S
        at_corner = Delta @ Q @ Delta + turned + turned.T + R
        yield Demand(f"the multiplier is positive at delta = {signs}", at_corner)
