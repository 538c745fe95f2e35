"""The published contraction metrics of the planar VTOL, checked between the points of a grid.

The stored W and Y are polynomials of degree 4 in phi and vx. The published condition, for all
states within the box and |w| <= 1, is

    F = [dW/dt - (A W + B Y) - (A W + B Y)' - lambda W, -Bw; -Bw', mu] >= 0.

Published is then a position within alpha = max(mu, max W_pp / lambda); |p|^2 <= max W_pp mu /
lambda follows too, and is less. F is affine in vz, in phi' and in w: their ends decide.
"""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi
import numpy as np

from evidence.planar_vtol.model import LIMITS, published
from synthesis.numerics.polynomial.exact import exact, positive_definite, rational
from synthesis.tubes.enclosure import AffineForm, Domain, enclose

Array = np.ndarray

STORED = Path(__file__).with_name("metrics.json")
"""Of github.com/boranzhao/robust_ccm_tube, commit 2e210c9, MIT License, (c) 2022 Pan Zhao."""
CELLS, SPLITS = 48, 4
"""Cells along phi and vx at first, and how often one may be cut into four."""
GRID = 41
"""Points along phi and vx of the search for lambda and mu, which proves nothing."""
SPARE = 1.003
"""Factor on mu and on W_pp of the search, and its square root's inverse on lambda: between its
points, and for the exact check.
"""


@dataclass(frozen=True, eq=False)
class Metric:
    """W (6, 6, k) and Y (2, 6, k), factors of the monomials phi^a vx^b (k, 2)."""

    W: Array
    Y: Array
    monomials: Array
    tube: float

    @classmethod
    def stored(cls, name: str) -> Metric:
        """The metric "position" (lambda 1.2) or "all" (lambda 1.4), with its tube in position."""
        content = json.loads(STORED.read_text(encoding="utf-8"))
        own = content["metrics"][name]
        W, Y = np.array(own["W"]), np.array(own["Y"])
        return cls(W, Y, np.array(content["monomials"]), own["tubes"]["tube_xz"])

    def at(self, x: Any) -> tuple[Any, Any, Any, Any]:
        """W, Y, and the slopes of W by phi and by vx, in CasADi; x = (phi, vx)."""
        powers = [[casadi.SX(1)], [casadi.SX(1)]]
        for own, value in zip(powers, casadi.vertsplit(x), strict=True):
            for _ in range(4):
                own.append(own[-1] * value)
        phi, vx = powers
        value, by_phi, by_vx = [], [], []
        for a, b in self.monomials:
            value.append(phi[a] * vx[b])
            by_phi.append(int(a) * (phi[a - 1] * vx[b]) if a else casadi.SX(0))
            by_vx.append(int(b) * (phi[a] * vx[b - 1]) if b else casadi.SX(0))

        def sum_of(factors: Array, terms: list[Any]) -> Any:
            rows = [
                [sum(float(c) * t for c, t in zip(e, terms, strict=True)) for e in r]
                for r in factors
            ]
            return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))

        own = [(self.W, value), (self.Y, value), (self.W, by_phi), (self.W, by_vx)]
        W, Y, W_phi, W_vx = (sum_of(*pair) for pair in own)
        return W, Y, W_phi, W_vx

    @cached_property
    def parts(self) -> casadi.Function:
        """(phi, vx), (vz, phi', w) -> dW/dt - (A W + B Y) - (A W + B Y)', W, Bw."""
        x, y = casadi.SX.sym("x", 2), casadi.SX.sym("y", 3)
        W, Y, W_phi, W_vx = self.at(x)
        model, u = published(), casadi.SX.zeros(2)
        state, w = casadi.SX.sym("state", 6), casadi.SX.sym("w", 1)
        rate = model(state, u, w)
        full = casadi.vertcat(0, 0, x[0], x[1], y[0], y[1])
        slopes = casadi.Function(
            "slopes", [state, w], [casadi.jacobian(rate, state), casadi.jacobian(rate, w), rate]
        )
        A, Bw, moving = slopes(full, y[2])
        control = casadi.SX.sym("u", 2)
        B = casadi.jacobian(model(state, control, w), control)
        T = A @ W + B @ Y
        F = W_phi * moving[2] + W_vx * moving[3] - (T + T.T)
        return casadi.Function("parts", [x, y], [F, W, Bw])

    def condition(self, lam: float, mu: float) -> casadi.Function:
        """(phi, vx) -> F at the ends of vz, phi' and w, each column its lower triangle."""
        x, ends = casadi.SX.sym("x", 2), [LIMITS["vz"], LIMITS["phi'"], LIMITS["w"]]
        columns = []
        for signs in itertools.product((-1, 1), repeat=3):
            F, W, Bw = self.parts(
                x, casadi.DM([s * end for s, end in zip(signs, ends, strict=True)])
            )
            whole = casadi.vertcat(
                casadi.horzcat(F - lam * W, -Bw), casadi.horzcat(-Bw.T, casadi.SX(mu))
            )
            columns.append(_lower(whole))
        return casadi.Function("condition", [x], [casadi.densify(c) for c in columns])

    def position(self, size: float) -> casadi.Function:
        """(phi, vx) -> size I - W_pp."""
        x = casadi.SX.sym("x", 2)
        W = self.at(x)[0]
        return casadi.Function("position", [x], [_lower(size * casadi.SX.eye(2) - W[:2, :2])])

    @property
    def positive(self) -> casadi.Function:
        """(phi, vx) -> W."""
        x = casadi.SX.sym("x", 2)
        return casadi.Function("metric", [x], [_lower(self.at(x)[0])])

    def smallest(self) -> tuple[float, float, float]:
        """(lambda, mu, W_pp) of the smallest tube on a grid, with spare; proves nothing."""
        phi, vx = (np.linspace(-LIMITS[n], LIMITS[n], GRID) for n in ("phi", "vx"))
        x = np.array(list(itertools.product(phi, vx))).T
        F, W, Bw = [], [], []
        for signs in itertools.product((-1, 1), repeat=3):
            y = np.array(signs) * [LIMITS[n] for n in ("vz", "phi'", "w")]
            own = self.parts.map(x.shape[1])(x, np.tile(y[:, None], x.shape[1]))
            for to, value, width in zip((F, W, Bw), own, (6, 6, 1), strict=True):
                to.append(np.asarray(value).T.reshape(-1, width, 6))
        F, W, Bw = (np.concatenate(part) for part in (F, W, Bw))
        size = float(np.linalg.eigvalsh(W[:, :2, :2])[:, -1].max())
        lower = np.linalg.inv(np.linalg.cholesky(W))
        most = np.linalg.eigvalsh(lower @ F @ np.swapaxes(lower, 1, 2)).min()
        tries = []
        for lam in np.linspace(0.5, 0.999, 120) * most:
            mu = (Bw @ np.linalg.solve(F - lam * W, np.swapaxes(Bw, 1, 2))).max()
            tries.append((mu / lam, lam, mu))
        _, lam, mu = min(tries)
        return float(lam / SPARE**1.5), float(SPARE * mu), float(SPARE * size)


def _lower(M: Any) -> Any:
    return casadi.vertcat(*[M[i, j] for i in range(M.shape[0]) for j in range(i + 1)])


def proven_positive(function: casadi.Function) -> bool:
    """Whether symmetric matrices, each an output with the lower triangle as a column, are positive
    definite over all phi and vx of the box: cells are enclosed, and cut until rational arithmetic
    decides at the corners of each form, less its remainder.
    """
    limits = np.nextafter([LIMITS["phi"], LIMITS["vx"]], np.inf)
    edges = [np.linspace(-limit, limit, CELLS + 1) for limit in limits]
    cells = np.array(
        [
            [(a, c), (b, d)]
            for a, b in itertools.pairwise(edges[0])
            for c, d in itertools.pairwise(edges[1])
        ]
    )
    for _ in range(SPLITS):
        form = enclose(function, Domain.box(cells[:, 0], cells[:, 1])).value
        corners = [_corners(form, function, k) for k in range(function.n_out())]
        left = np.logical_or.reduce(
            [np.linalg.eigvalsh(M)[..., 0].min(axis=1) <= 0 for M, _, _ in corners]
        )
        for k in np.flatnonzero(~left):
            left[k] = not all(_exact(parts[k], rest[k]) for _, parts, rest in corners)
        if not left.any():
            return True
        cells = np.concatenate([_quarters(*cell) for cell in cells[left]])
    return False


SIGNS = np.array(list(itertools.product((-1, 1), repeat=2)))


def _corners(form: AffineForm, function: casadi.Function, k: int) -> tuple[Array, Array, Array]:
    """Of output k over N cells: matrices (N, 4, n, n) at the corners of a form less its remainder,
    the form's coefficients (N, 3, n, n), and its remainder as a diagonal (N, n, n).
    """
    size, start = function.size1_out(k), sum(function.size1_out(i) for i in range(k))
    n, own = int((2 * size) ** 0.5), slice(start, start + size)
    coefficients = np.concatenate(
        [form.centre[:, own, None], form.slopes[:, own], form.rest[:, own, None]], axis=-1
    )
    M = np.zeros((len(coefficients), 4, n, n))
    rows, columns = np.tril_indices(n)
    M[:, :, rows, columns] = np.swapaxes(coefficients, 1, 2)
    M[:, :, columns, rows] = M[:, :, rows, columns]
    parts, rest = M[:, :3], M[:, 3].sum(axis=-1)[..., None] * np.eye(n) * (1 + 1e-12)
    at = parts[:, :1] + np.tensordot(SIGNS, np.moveaxis(parts[:, 1:], 1, 0), 1).swapaxes(0, 1)
    return at - rest[:, None], parts, rest


def _exact(parts: Array, rest: Array) -> bool:
    """Whether all matrices of a form are positive definite, in rational arithmetic."""
    number = rational()
    centre, first, second = (exact(part, number) for part in parts)
    centre = centre - exact(rest, number)
    return all(positive_definite(centre + int(a) * first + int(b) * second) for a, b in SIGNS)


def _quarters(low: Array, high: Array) -> Array:
    middle = 0.5 * (low + high)
    xs, ys = ((low[i], middle[i], high[i]) for i in range(2))
    return np.array(
        [[(a, c), (b, d)] for a, b in itertools.pairwise(xs) for c, d in itertools.pairwise(ys)]
    )


def refuted(metric: Metric, tube: float) -> tuple[Array, float] | None:
    """A state and gust (phi, vx, vz, phi', w) at which no lambda and mu let the metric certify
    `tube`, with the upper bound of v'F v < 0 there, in ball arithmetic; None where none is found.

    alpha <= tube needs mu <= tube and lambda >= W_pp / tube, and F falls with lambda and rises with
    mu.
    """
    phi, vx = (np.linspace(-LIMITS[n], LIMITS[n], 2 * GRID - 1) for n in ("phi", "vx"))
    points = np.array(list(itertools.product(phi, vx)))
    x = casadi.SX.sym("x", 2)
    W = casadi.Function("W", [x], [_lower(metric.at(x)[0][:2, :2])])
    values = np.asarray(W.map(len(points))(points.T)).T
    largest = [np.linalg.eigh([[a, b], [b, c]]) for a, b, c in values]
    k = int(np.argmax([e[0][-1] for e in largest]))
    q = largest[k][1][:, -1]
    form = enclose(W, Domain.point(points[k])).value
    share = np.array([q[0] ** 2, 2 * q[0] * q[1], q[1] ** 2])
    lower = share @ form.centre - np.abs(share) @ form.rest
    lam = float(lower / (q @ q) * (1 - 1e-12) / tube)
    function = metric.condition(lam, tube)
    found = [np.asarray(c).T for c in function.map(len(points))(points.T)]
    at, worst = np.tril_indices(7), (0.0, 0, 0)
    for corner, column in enumerate(found):
        M = np.zeros((len(points), 7, 7))
        M[:, at[0], at[1]] = column
        least = np.linalg.eigvalsh(M)[:, 0]
        worst = min(worst, (float(least.min()), corner, int(least.argmin())))
    value, corner, k = worst
    if value >= 0:
        return None
    M = np.zeros((7, 7))
    M[at] = found[corner][k]
    v = np.linalg.eigh(M)[1][:, 0]
    weights = np.array([v[i] * v[j] * (1 if i == j else 2) for i, j in zip(*at, strict=True)])
    form = enclose(function, Domain.point(points[k])).value[corner * 28 : corner * 28 + 28]
    upper = weights @ form.centre + np.abs(weights) @ (form.rest + 1e-13 * np.abs(form.centre))
    signs = list(itertools.product((-1, 1), repeat=3))[corner]
    y = np.array(signs) * [LIMITS[n] for n in ("vz", "phi'", "w")]
    return (np.concatenate([points[k], y]), float(upper)) if upper < 0 else None
