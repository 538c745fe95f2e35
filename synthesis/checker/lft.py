"""Functions V = x' P x of an LFT, with a multiplier: its parameters may jump.

With w = Delta z, Delta = diag(delta_i I), delta_i = (p_i - middle)/radius in [-1, 1], and rows (z,
dx/dt or x(k+1), y) of the LFT, for all (w, x, u) other than zero

    dV/dt + [w; z]' [Q S; S' R] [w; z] + |y|^2 - g^2 |u|^2 < 0,  P > 0

and the multiplier is nonnegative for every Delta: N = Delta Q Delta + Delta S + S' Delta + R >= 0.
It is where R = -Q = diag(D_i) > 0 and S = diag(G_i), G_i = -G_i', since then N = (I - Delta^2) D;
or where Q_ii < 0, so that N is concave in each delta_i alone, and N > 0 at the corners of the box.
"""

from collections.abc import Iterator, Sequence
from itertools import product as combinations
from typing import Any

from . import words
from .demands import Claim, Demand
from .polynomials import Polynomial, block, diagonal, even, matrix
from .reading import INFINITE, Unreadable, array, bound_of, names, parameters, period, whole

MOST_PARAMETERS = 12
"""Parameters up to which a multiplier is checked at the corners of their box."""


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate of an LFT claims."""
    lft, V = content["proof"]["lft"], content["proof"]["lyapunov"]
    motion = parameters([each["scheduling"] for each in lft["blocks"]])
    sizes = [whole(each["size"], "the size of a block", 0, 10**4) for each in lft["blocks"]]
    x, u, y = (len(names(lft[name])) for name in ("states", "inputs", "outputs"))
    w, dt = sum(sizes), period(lft["dt"])
    if kind != ("l2 gain" if u else "stability"):
        raise Unreadable(f"an LFT of {u} inputs has no proof of the kind {kind!r:.40}")
    if content["rates"] != [INFINITE] * len(motion):
        raise Unreadable("the proof of an LFT is for parameters that jump, the claim is not")
    if V["multiplier"]["sizes"] != sizes:
        raise Unreadable("the multiplier is not one of the blocks of the LFT")
    (M11, M12), (M21, M22) = (
        [matrix(array(lft[f"M{i}{j}"], "the LFT", rows, n), n) for j, n in ((1, w), (2, x + u))]
        for i, rows in ((1, w), (2, x + y))
    )
    M, P = block([[M11, M12], [M21, M22]]), even(array(V["P"], "P", x, x))
    Q, S, R = (array(V["multiplier"][name], "a multiplier", w, w) for name in "QSR")
    multiplier, bound = (even(Q), matrix(S, w), even(R)), bound_of(kind, content)
    falling = _falling(M, P, multiplier, u, dt is not None)
    demands = [Demand("V > 0", P), *_nonnegative(*multiplier, sizes), falling]
    jumping = [p._replace(rate=None, tie=None) for p in motion]
    said = words.model(x, u, y, dt, jumping)
    return Claim(words.gain(kind, bound), said, demands, bound, lambda g: g * g)


def _falling(
    M: Polynomial, P: Polynomial, multiplier: Sequence[Polynomial], inputs: int, sampled: bool
) -> Demand:
    """Return the inequality of dV/dt in (w, x, u); without y where there is no u."""
    nx, size, (Q, S, R) = P.shape[0], M.shape[1], multiplier
    nw = Q.shape[0]
    z, move, y = (M.part(range(a, b)) for a, b in ((0, nw), (nw, nw + nx), (nw + nx, M.shape[0])))
    every = diagonal([1] * size)
    w, x = every.part(range(nw)), every.part(range(nw, nw + nx))
    cross = w.T @ S @ z
    form = z.T @ R @ z + w.T @ Q @ w + cross + cross.T
    slope = x.T @ P @ move
    change = move.T @ P @ move - x.T @ P @ x if sampled else slope + slope.T
    if not inputs:
        return Demand("V falls", -(form + change))
    energy = diagonal([int(i >= nw + nx) for i in range(size)])
    return Demand("V falls", -(form + change + y.T @ y), None, energy)


def _nonnegative(
    Q: Polynomial, S: Polynomial, R: Polynomial, sizes: Sequence[int]
) -> Iterator[Demand]:
    """Yield what makes the multiplier nonnegative for every Delta of the box."""
    owner = [i for i, size in enumerate(sizes) for _ in range(size)]
    n = range(len(owner))
    for i in range(len(sizes)):
        own = [k for k in n if owner[k] == i]
        yield Demand("the multiplier is concave in each parameter", -Q.part(own, own))
    apart = [(a, b) for a in n for b in n if owner[a] != owner[b]]
    zeros = [M.part([a], [b]) for M in (S, R) for a, b in apart] + [Q + R, S + S.T]
    if not any(M.reduced().terms for M in zeros):
        return
    if len(sizes) > MOST_PARAMETERS:
        raise Unreadable("the multiplier has more corners than this checker looks at")
    for signs in combinations((-1, 1), repeat=len(sizes)):
        Delta = diagonal([signs[i] for i in owner])
        turned = Delta @ S
        at_corner = Delta @ Q @ Delta + turned + turned.T + R
        yield Demand(f"the multiplier is positive at delta = {signs}", at_corner)
