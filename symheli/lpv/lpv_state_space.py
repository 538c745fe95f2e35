"""A linear parameter-varying model whose every entry is a function of the scheduling parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases import Basis, Polynomial
from symheli.lpv.linear_model import LinearModel, feedback_matrix
from symheli.lpv.scheduling import Scheduling
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, indices, signals

if TYPE_CHECKING:
    from symheli.lpv.balanced_truncation import BalancedTruncation
    from symheli.lpv.lft import LFT


class Matrices(NamedTuple):
    """A (..., nx, nx), B (..., nx, nu), C (..., ny, nx), D (..., ny, nu)."""

    A: Array
    B: Array
    C: Array
    D: Array


class Residuals(NamedTuple):
    """Fit minus what it was fitted to at `nodes` (K,): A (K, nx, nx), B (K, nx, nu), C (K, ny, nx),
    D (K, ny, nu).
    """

    nodes: Array
    A: Array
    B: Array
    C: Array
    D: Array

    @property
    def matrices(self) -> Matrices:
        """Without the nodes."""
        return Matrices(*self[1:])


@dataclass(frozen=True, eq=False)
class LPVStateSpace:
    """dx/dt = A(p) x + B(p) u, y = C(p) x + D(p) u (dt None), or x(k+1) = A(p(k)) x(k) + ... (dt in
    s).

    A (n, nx, nx), B (n, nx, nu), C (n, ny, nx), D (n, ny, nu) are coefficients: A(p) = sum_j f_j(p)
    A_j with the n functions f_j of `basis`. x and u are deviations from the schedule `trim` where
    there is one. `residuals`, where the model was fitted to a family or sampled: fit minus what it
    was fitted to, at its nodes.
    """

    basis: Basis
    A: Array
    B: Array
    C: Array
    D: Array
    scheduling: Scheduling
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None
    trim: TrimSchedule | None = None
    residuals: Residuals | None = None

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        n, nx, nu, ny = self.basis.size, len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (
            ("A", (n, nx, nx)),
            ("B", (n, nx, nu)),
            ("C", (n, ny, nx)),
            ("D", (n, ny, nu)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        slack = 1e-9 * (self.scheduling.high - self.scheduling.low)
        if (
            self.basis.low > self.scheduling.low + slack
            or self.basis.high < self.scheduling.high - slack
        ):
            raise InputError(
                f"the basis covers [{self.basis.low}, {self.basis.high}] but scheduling"
                f" {self.scheduling.name} ranges over [{self.scheduling.low},"
                f" {self.scheduling.high}]"
            )
        if self.dt is not None and not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds or None, got {self.dt}")

    @classmethod
    def polynomial(
        cls,
        A: Sequence[Any],
        B: Sequence[Any],
        C: Sequence[Any],
        D: Sequence[Any],
        scheduling: Scheduling,
        dt: float | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LPVStateSpace:
        """From monomial coefficients: A(p) = A[0] + p A[1] + p^2 A[2] + ..., p in physical units.

        The lists may differ in length; each entry is a matrix. Names default to x1.., u1.., y1...
        """
        shapes = {}
        for name, matrices in (("A", A), ("B", B), ("C", C), ("D", D)):
            if not len(matrices):
                raise InputError(
                    f"{name}: expected a list of at least one coefficient matrix [{name}0, {name}1,"
                    " ...]"
                )
            stack = [frozen(m, f"{name}[{i}]", (None, None)) for i, m in enumerate(matrices)]
            if len({m.shape for m in stack}) > 1:
                raise InputError(
                    f"{name}: coefficient matrices differ in shape:"
                    f" {', '.join(str(m.shape) for m in stack)}"
                )
            shapes[name] = np.stack(stack)
        basis = Polynomial(
            max(len(m) for m in shapes.values()) - 1, scheduling.low, scheduling.high
        )
        nx, nu, ny = shapes["A"].shape[1], shapes["B"].shape[2], shapes["C"].shape[1]
        return cls(
            basis,
            basis.from_monomial(shapes["A"]),
            basis.from_monomial(shapes["B"]),
            basis.from_monomial(shapes["C"]),
            basis.from_monomial(shapes["D"]),
            scheduling,
            states=signals(states or [f"x{i + 1}" for i in range(nx)]),
            inputs=signals(inputs or [f"u{i + 1}" for i in range(nu)]),
            outputs=signals(outputs or [f"y{i + 1}" for i in range(ny)]),
            dt=dt,
        )

    def matrices(self, p: object) -> Matrices:
        """A, B, C, D at p; an axis of p comes first. Raises `InputError` outside the scheduling
        range.
        """
        f = self.basis(self.scheduling.check(p))
        return Matrices(*(np.tensordot(f, M, axes=1) for M in (self.A, self.B, self.C, self.D)))

    def at(self, p: float) -> LinearModel:
        """The model frozen at p."""
        return LinearModel(
            *self.matrices(float(p)), self.states, self.inputs, self.outputs, dt=self.dt
        )

    def with_scheduling(self, scheduling: Scheduling) -> LPVStateSpace:
        """The same model over a narrower range or with another rate limit."""
        return replace(self, scheduling=scheduling)

    def with_rate(self, rate: float) -> LPVStateSpace:
        """The same model with |dp/dt| <= rate."""
        return replace(self, scheduling=self.scheduling.with_rate(rate))

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LPVStateSpace:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs, in
        this order.
        """
        ix = indices(self.states if states is None else states, self.states, "state")
        iu = indices(self.inputs if inputs is None else inputs, self.inputs, "input")
        if outputs is None:
            outputs = [
                y for y in self.outputs if y not in self.states or self.states.index(y) in ix
            ]
        iy = indices(outputs, self.outputs, "output")

        def keep(A: Array, B: Array, C: Array, D: Array) -> Matrices:
            return Matrices(
                A[:, ix][:, :, ix], B[:, ix][:, :, iu], C[:, iy][:, :, ix], D[:, iy][:, :, iu]
            )

        kept = keep(self.A, self.B, self.C, self.D)
        return replace(
            self,
            A=kept.A,
            B=kept.B,
            C=kept.C,
            D=kept.D,
            states=tuple(self.states[i] for i in ix),
            inputs=tuple(self.inputs[i] for i in iu),
            outputs=tuple(self.outputs[i] for i in iy),
            trim=self.trim and self.trim.select(ix, iu),
            residuals=self.residuals
            and Residuals(self.residuals.nodes, *keep(*self.residuals.matrices)),
        )

    def feedback(self, gains: Mapping[tuple[str, str], float]) -> LPVStateSpace:
        """Close u_i = gain * y_j + (new u_i) for each {(input, output): gain}; always an
        `LPVStateSpace`, exact.

        Outputs that depend on p multiply inputs that do: a polynomial model then has up to twice
        the degree, in another basis `InputError`. A loop through constant feedthrough is solved;
        through feedthrough D(p) that depends on p the closed loop is rational and `InputError` says
        so: `to_lft().feedback(gains)` closes it exactly, as an `LFT`.
        """
        from symheli.lpv.output_feedback import close

        return close(self, feedback_matrix(gains, self.inputs, self.outputs))

    def discretize(self, dt: float, *, degree: int | None = None, nodes: int = 41) -> LPVStateSpace:
        """Zero-order-hold equivalent at each of `nodes` frozen p, fitted element-wise by a
        polynomial of `degree`.

        `degree` defaults to that of the basis (needed where the basis is no polynomial). The misfit
        at the nodes is in `.residuals`: the exponential of a polynomial is no polynomial. So is the
        misfit to the sampled models of the family that this model was fitted to, at the nodes of
        that.
        """
        if self.dt is not None:
            raise InputError(f"the model is already discrete (dt = {self.dt} s)")
        if degree is None:
            if not isinstance(self.basis, Polynomial):
                raise InputError("give `degree`: the discrete entries are fitted by polynomials")
            degree = self.basis.degree
        low, high = self.scheduling.low, self.scheduling.high
        # Chebyshev-Lobatto nodes: the fit stays close to the best one between them too
        p = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * np.arange(nodes) / (nodes - 1))
        sampled = self._sampled(self.matrices(p), dt)
        basis = Polynomial(degree, low, high)
        fitted = Matrices(*(basis.fit(p, M) for M in sampled))
        model = replace(
            self, basis=basis, A=fitted.A, B=fitted.B, C=fitted.C, D=fitted.D, dt=dt, residuals=None
        )
        if (origin := self.fitted_to) is not None:
            p = np.append(p, origin.nodes)
            sampled = Matrices(
                *map(np.concatenate, zip(sampled, self._sampled(origin.matrices, dt), strict=True))
            )
        return model.with_residuals(p, sampled)

    @property
    def fitted_to(self) -> Residuals | None:
        """What the model was fitted to, at its nodes: fit minus residuals; None where it was given
        as it is.
        """
        if self.residuals is None:
            return None
        exact = (
            M - off
            for M, off in zip(
                self.matrices(self.residuals.nodes), self.residuals.matrices, strict=True
            )
        )
        return Residuals(self.residuals.nodes, *exact)

    def with_residuals(self, nodes: Array, exact: Matrices) -> LPVStateSpace:
        """The same model as a fit of `exact` (K, ...) at `nodes` (K,)."""
        off = (M - E for M, E in zip(self.matrices(nodes), exact, strict=True))
        return replace(self, residuals=Residuals(nodes, *off))

    def _sampled(self, matrices: Matrices, dt: float) -> Matrices:
        frozen = [
            LinearModel(*each, self.states, self.inputs, self.outputs).discretize(dt)
            for each in zip(*matrices, strict=True)
        ]
        return Matrices(*(np.stack([getattr(model, name) for model in frozen]) for name in "ABCD"))

    def truncate(
        self, order: int, *, nodes: int = 21, input_scale: object = 1.0, output_scale: object = 1.0
    ) -> BalancedTruncation[LPVStateSpace]:
        """`order` states by one projection balanced over p, with the error it makes; see
        `symheli.lpv.balanced_truncation`.
        """
        from symheli.lpv.balanced_truncation import balanced_truncation

        return balanced_truncation(
            self, order, nodes=nodes, input_scale=input_scale, output_scale=output_scale
        )

    def to_lft(self) -> LFT:
        """The equivalent linear fractional transformation (polynomial dependence only), not yet
        reduced.
        """
        from symheli.lpv.lft import LFT

        return LFT.from_polynomial(self)
