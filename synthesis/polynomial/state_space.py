"""A linear model whose matrices are polynomials in several scheduling parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, LinearModel, LPVStateSpace, Matrices, Polynomial, Scheduling
from symheli.lpv.lft import expanded
from symheli.lpv.recentred import centre, recentred
from symheli.values import Signal, signals
from synthesis.polynomial.matrix import PolynomialMatrix

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class PolynomialStateSpace:
    """dx/dt = A(p) x + B(p) u, y = C(p) x + D(p) u (dt None), or x(k+1) = A(p(k)) x(k) + ... (dt in
    s), p in a box.

    A, B, C, D are `PolynomialMatrix` over the ranges of `parameters`, which carry unit and rate
    limit.
    """

    A: PolynomialMatrix
    B: PolynomialMatrix
    C: PolynomialMatrix
    D: PolynomialMatrix
    parameters: tuple[Scheduling, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(self.parameters))
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        nx, nu, ny = len(self.states), len(self.inputs), len(self.outputs)
        if not self.parameters or len({s.name for s in self.parameters}) < len(self.parameters):
            raise InputError(
                "expected parameters of different names, got"
                f" {', '.join(s.name for s in self.parameters) or 'none'}"
            )
        for name, shape in (("A", (nx, nx)), ("B", (nx, nu)), ("C", (ny, nx)), ("D", (ny, nu))):
            M = getattr(self, name)
            if M.shape != shape or M.coefficients.ndim != len(self.parameters) + 2:
                raise InputError(
                    f"{name}: expected polynomial matrices of shape {shape}, got {M.shape}"
                )
            if M.box != self.box:
                raise InputError(
                    f"{name} is known on {M.box}, the parameters range over {self.box}"
                )
            if not np.all(np.isfinite(M.coefficients)):
                raise InputError(f"{name}: expected finite coefficients")
        if self.dt is not None and not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds or None, got {self.dt}")

    @classmethod
    def polynomial(
        cls,
        A: Mapping[tuple[int, ...], Any],
        B: Mapping[tuple[int, ...], Any],
        C: Mapping[tuple[int, ...], Any],
        D: Mapping[tuple[int, ...], Any],
        parameters: Sequence[Scheduling],
        dt: float | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> PolynomialStateSpace:
        """From monomials, {exponents: matrix}: A={(0, 0): A0, (1, 0): A1, (0, 2): A2} is A0 + p1 A1
        + p2^2 A2, p in physical units.
        """
        box = tuple((s.low, s.high) for s in parameters)
        for M in (A, B, C, D):
            PolynomialMatrix.from_monomials(M, box)  # refuses what is not {exponents: matrix}
        a, b, c, d = (
            _in_delta(recentred(M, [centre(*bounds) for bounds in box]), parameters)
            for M in (A, B, C, D)
        )

        def names(given: Sequence[str] | None, letter: str, count: int) -> tuple[Signal, ...]:
            return signals(given or [f"{letter}{i + 1}" for i in range(count)])

        groups = (
            names(states, "x", a.shape[0]),
            names(inputs, "u", b.shape[1]),
            names(outputs, "y", c.shape[0]),
        )
        return cls(a, b, c, d, tuple(parameters), *groups, dt)

    @classmethod
    def from_lpv(cls, lpv: LPVStateSpace) -> PolynomialStateSpace:
        """The same model of one parameter; `InputError` where its basis is not polynomial."""
        if not isinstance(lpv.basis, Polynomial):
            raise InputError(
                "expected polynomial dependence; a spline model is analysed as the LPVStateSpace"
                " it is"
            )
        s, d = lpv.scheduling, lpv.basis.degree
        nodes = _nodes(d, s)
        fit = np.linalg.inv(_values(d, nodes, s))
        A, B, C, D = (
            PolynomialMatrix(((s.low, s.high),), np.tensordot(fit, M, axes=1))
            for M in lpv.matrices(nodes)
        )
        return cls(A, B, C, D, (s,), lpv.states, lpv.inputs, lpv.outputs, lpv.dt)

    @classmethod
    def from_lft(cls, lft: LFT) -> PolynomialStateSpace:
        """The same model, reduced or not; `InputError` where the dependence is rational (see
        `symheli.lpv.lft.expanded`).
        """
        terms = expanded(lft)
        if terms is None:
            raise InputError(
                "the LFT depends on its parameters as a rational function, not a polynomial; use"
                " lft_gain, or fit a polynomial"
            )
        parameters, nx = lft.parameters, len(lft.states)

        def part(rows: slice, columns: slice) -> PolynomialMatrix:
            own = {
                e: M[rows, columns]
                for e, M in terms.items()
                if not sum(e) or np.any(M[rows, columns])
            }
            return _in_delta(own, parameters)

        top, bottom = slice(None, nx), slice(nx, None)
        matrices = part(top, top), part(top, bottom), part(bottom, top), part(bottom, bottom)
        return cls(*matrices, parameters, lft.states, lft.inputs, lft.outputs, lft.dt)

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """(low, high) of each parameter."""
        return tuple((s.low, s.high) for s in self.parameters)

    def matrices(self, p: object) -> Matrices:
        """A, B, C, D at p (..., m); the axes of p come first. Raises `InputError` outside the
        box.
        """
        p = np.asarray(p, dtype=float)
        if p.shape[-1:] != (len(self.parameters),):
            raise InputError(
                f"expected the {len(self.parameters)} parameters along the last axis, got shape"
                f" {p.shape}"
            )
        p = np.stack([s.check(p[..., i]) for i, s in enumerate(self.parameters)], axis=-1)
        return Matrices(*(M(p) for M in (self.A, self.B, self.C, self.D)))

    def at(self, *p: float) -> LinearModel:
        """The model frozen at p, one value a parameter."""
        return LinearModel(*self.matrices(p), self.states, self.inputs, self.outputs, dt=self.dt)

    def along(self, start: Sequence[float], end: Sequence[float]) -> LPVStateSpace:
        """The model on the straight line from `start` (s = -1) to `end` (s = 1): one parameter s;
        exact.

        Its rate, per second, is the largest at which no parameter exceeds its own.
        """
        first, last = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        half = 0.5 * np.abs(last - first)
        rate = min(s.rate / h for s, h in zip(self.parameters, half, strict=True) if h > 0)
        degree = max(
            sum(d for d, h in zip(M.degrees, half, strict=True) if h > 0)
            for M in (self.A, self.B, self.C, self.D)
        )
        line = Scheduling("line", "1", -1.0, 1.0, rate)
        nodes = _nodes(degree, line)
        points = 0.5 * (first + last) + 0.5 * np.multiply.outer(nodes, last - first)
        basis = Polynomial(degree, -1.0, 1.0)
        low, high = np.array(self.box).T
        A, B, C, D = (basis.fit(nodes, M) for M in self.matrices(np.clip(points, low, high)))
        return LPVStateSpace(
            basis, A, B, C, D, line, self.states, self.inputs, self.outputs, self.dt
        )


def _nodes(degree: int, s: Scheduling) -> Array:
    return s.middle - s.radius * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))


def _values(degree: int, nodes: Array, s: Scheduling) -> Array:
    """Matrix (nodes, d + 1) of the Bernstein polynomials of that degree at the nodes."""
    one = PolynomialMatrix(((s.low, s.high),), np.eye(degree + 1)[:, None, :])
    return one(nodes[:, None])[:, 0, :]


def _in_delta(
    terms: Mapping[tuple[int, ...], Any], parameters: Sequence[Scheduling]
) -> PolynomialMatrix:
    """From {exponents: matrix} of the parameters normalised to [-1, 1], over their physical
    ranges.
    """
    normalised = PolynomialMatrix.from_monomials(terms, ((-1.0, 1.0),) * len(parameters))
    return replace(normalised, box=tuple((s.low, s.high) for s in parameters))
