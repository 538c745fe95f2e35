"""A linear parameter-varying model: every entry a function of the scheduling parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.bases.polynomials import coefficients_of, lobatto_points, polynomials
from symheli.lpv.bases.rescaled import rescaled
from symheli.lpv.bases.restricted import Restricted
from symheli.lpv.given_parameters import unit_sizes, with_rates
from symheli.lpv.linear_model import LinearModel, feedback_matrix
from symheli.lpv.lpv_matrices import LPVMatrices, Matrices
from symheli.lpv.monomials import as_blocks
from symheli.lpv.operators import Operators
from symheli.lpv.recentred import centre, recentred
from symheli.lpv.scheduling import UNSCHEDULED, Rates, Scheduling, check_all, parameters
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from symheli.lpv.balanced_truncation import BalancedTruncation
    from symheli.lpv.lft import LFT
    from symheli.lpv.prediction import SteppedFlight


class FitResiduals(NamedTuple):
    """Fit minus exact data at `nodes` (K,), (K, d) with d parameters: A (K, nx, nx), B (K, nx, nu),
    C (K, ny, nx), D (K, ny, nu).
    """

    nodes: Array
    A: Array
    B: Array
    C: Array
    D: Array

    @property
    def matrices(self) -> Matrices:
        """The four arrays without the nodes."""
        return Matrices(*self[1:])

    def within(self, box: Sequence[Scheduling]) -> FitResiduals | None:
        """Return the residuals at the nodes in these ranges; None where there are none."""
        columns = self.nodes.reshape(len(self.nodes), -1).T
        inside = np.all(
            [(s.low <= at) & (at <= s.high) for s, at in zip(box, columns, strict=False)], axis=0
        )
        return FitResiduals(*(each[inside] for each in self)) if np.any(inside) else None


@dataclass(frozen=True, eq=False)
class LPVStateSpace(Operators, LPVMatrices):
    """A linear parameter-varying (LPV) model has matrices that are functions of scheduling
    parameters p.

    dx/dt = A(p) x + B(p) u, y = C(p) x + D(p) u, or sampled x(k+1) = A(p(k)) x(k) + ...

    A(p) = sum_j f_j(p) A_j with the n functions f_j of `basis`, of one scheduling parameter p or of
    several. With one, p may have any shape; with d, the last axis of p holds them.

    Parameters
    ----------
    basis : FunctionSpace
        The functions f_j, over a box that holds the ranges of the parameters.
    A, B, C, D : array_like
        Coefficients (n, nx, nx), (n, nx, nu), (n, ny, nx), (n, ny, nu).
    parameters : Scheduling or sequence of Scheduling
        Names, units, ranges and rate limits, in the order of the basis.
    states, inputs, outputs : sequence of str
        Names, with units where they are `Signal`s. States and inputs are deviations from `trim`
        where there is one.
    dt : float, optional
        Sample period in s; None in continuous time.
    trim : TrimSchedule, optional
        x0(p), u0(p), y0(p) about which the model holds.
    residuals : FitResiduals, optional
        Where the model was fitted or sampled: fit minus what it was fitted to, at its nodes.

    Raises
    ------
    InputError
        Shapes that do not fit, numbers that are not finite, ranges beyond the basis.

    See Also
    --------
    symheli.LFT : rational dependence on the parameters
    symheli.LinearFamily : linear models over parameters
    synthesis.l2_gain : worst-case gain while p moves

    Examples
    --------
    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", low=0.0, high=1.0, rate=0.5)
    >>> A = [[[0, 1.0], [-2, -1]], [[0, 0], [-0.5, 0]]]
    >>> B, C, D = [[[0], [1.0]]], [[[1.0, 0]]], [[[0.0]]]
    >>> lpv = symheli.LPVStateSpace.polynomial(A, B, C, D, p)
    >>> lpv.at(0.5).A
    array([[ 0.  ,  1.  ],
           [-2.25, -1.  ]])
    """

    trim: TrimSchedule | None = None
    residuals: FitResiduals | None = None

    if TYPE_CHECKING:  # what is given becomes arrays, parameters and signals

        def __init__(
            self,
            basis: FunctionSpace,
            A: ArrayLike,
            B: ArrayLike,
            C: ArrayLike,
            D: ArrayLike,
            parameters: Scheduling | Sequence[Scheduling],
            states: Sequence[str],
            inputs: Sequence[str],
            outputs: Sequence[str],
            dt: float | None = None,
            trim: TrimSchedule | None = None,
            residuals: FitResiduals | None = None,
        ) -> None: ...

    __repr__ = summarized
    _repr_html_ = as_table

    @classmethod
    def polynomial(
        cls,
        A: Sequence[Any] | Mapping[Any, Any],
        B: Sequence[Any] | Mapping[Any, Any],
        C: Sequence[Any] | Mapping[Any, Any],
        D: Sequence[Any] | Mapping[Any, Any],
        scheduling: Scheduling | Sequence[Scheduling],
        dt: float | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LPVStateSpace:
        """Return a model from monomial coefficients, p in physical units.

        One parameter: lists, A(p) = A[0] + p A[1] + p^2 A[2] + ..., which may differ in length.
        Several (or one): {exponents: matrix}, A={(0, 0): A0, (1, 0): A1, (0, 2): A2} is A0 + p1 A1
        + p2^2 A2. Names default to x1.., u1.., y1... Raises `InputError` for shapes that do not
        fit.
        """
        given = parameters(scheduling)
        matrices = [
            _by_exponents(name, M, len(given)) for name, M in zip("ABCD", (A, B, C, D), strict=True)
        ]
        whole, nx = as_blocks(*matrices, count=len(given))
        ranges = [(s.low, s.high) for s in given]
        scaled = recentred(whole, [centre(*bounds) for bounds in ranges])
        scaled.setdefault((0,) * len(given), np.zeros_like(next(iter(whole.values()))))
        basis, M = coefficients_of(scaled, ranges)
        for kind, group, count in (
            ("states", states, nx),
            ("inputs", inputs, M.shape[2] - nx),
            ("outputs", outputs, M.shape[1] - nx),
        ):
            if group and len(group) != count:
                raise InputError(
                    f"{kind}: {len(group)} names, {', '.join(group)}, for {count} in the matrices"
                )
        return cls(
            basis,
            M[:, :nx, :nx],
            M[:, :nx, nx:],
            M[:, nx:, :nx],
            M[:, nx:, nx:],
            given,
            signals(states or [f"x{i + 1}" for i in range(nx)]),
            signals(inputs or [f"u{i + 1}" for i in range(M.shape[2] - nx)]),
            signals(outputs or [f"y{i + 1}" for i in range(M.shape[1] - nx)]),
            dt,
        )

    @classmethod
    def from_expressions(
        cls,
        A: Any,
        B: Any,
        C: Any,
        D: Any,
        scheduling: Scheduling | Sequence[Scheduling],
        dt: float | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LPVStateSpace:
        """Return a model from matrices of SymPy expressions in the symbols of the parameters
        (`Scheduling.symbol`, in their units), or of CasADi expressions in scalar symbols of their
        names, and numbers; exact.

        Polynomials in any number of parameters get a polynomial basis; other functions, such as
        sin(p), sqrt(p) or 1/p, are functions of a `UserFunctions` basis, in several parameters
        products of functions of one each: such a model is simulated, drawn, connected and designed
        for, but has no certificate. `LFT.from_expressions` holds rational functions so that there
        are certificates. Names default to x1.., u1.., y1... Raises `InputError` for shapes that do
        not fit, `UnknownNameError` for another symbol.

        Examples
        --------
        >>> rho = symheli.Scheduling("rho", "1", low=-1.0, high=1.0, rate=0.5)
        >>> p = rho.symbol
        >>> plant = symheli.LPVStateSpace.from_expressions(
        ...     [[-1 - p**2, p], [0, -2]], [[0], [1 + p]], [[1, 0]], [[0]], rho)
        >>> plant.at(0.5).A
        array([[-1.25,  0.5 ],
               [ 0.  , -2.  ]])
        """
        from symheli.lpv.expressions import lpv_of

        return lpv_of((A, B, C, D), scheduling, dt, states, inputs, outputs)

    @classmethod
    def constant(
        cls, model: LinearModel, scheduling: Scheduling | Sequence[Scheduling] = UNSCHEDULED
    ) -> LPVStateSpace:
        """The matrices of `model` at every value of the parameters; without any, of one called
        "constant" from 0 to 1.
        """
        given = parameters(scheduling)
        return cls(
            polynomials([0] * len(given), [(s.low, s.high) for s in given]),
            model.A[None],
            model.B[None],
            model.C[None],
            model.D[None],
            given,
            model.states,
            model.inputs,
            model.outputs,
            model.dt,
        )

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """(low, high) of each parameter."""
        return tuple((s.low, s.high) for s in self.parameters)

    def at(self, *p: float) -> LinearModel:
        """The model frozen at p, one value a parameter."""
        if len(p) != len(self.parameters):
            raise InputError(
                f"at: expected {len(self.parameters)} value(s), one for each of"
                f" {', '.join(s.name for s in self.parameters)}, got {len(p)}"
            )
        point = np.array([float(v) for v in p])
        frozen_at = self.matrices(point if len(p) > 1 else point[0])
        return LinearModel(*frozen_at, self.states, self.inputs, self.outputs, dt=self.dt)

    def with_scheduling(self, scheduling: Scheduling | Sequence[Scheduling]) -> LPVStateSpace:
        """Return the same model over narrower ranges, with the residuals there, with other rate
        limits, or with its parameters, in order, under other names or in other units.

        Another unit of the same quantity is converted to: in "km/h" a model over "m/s" takes p in
        km/h, and is the same. A parameter without a unit ("1") is given one as it is. Raises
        `InputError` for a unit of another quantity, and ranges beyond the basis.
        """
        given = parameters(scheduling)
        model, sizes = self, unit_sizes(self.parameters, given)
        if any(size != 1.0 for size in sizes):
            model = self._in_units(given, sizes)
        return replace(
            model, parameters=given, residuals=model.residuals and model.residuals.within(given)
        )

    def _in_units(self, given: Sequence[Scheduling], sizes: Sequence[float]) -> LPVStateSpace:
        """p in units that are so many times as large, over the ranges given."""
        scale = np.array(sizes) if len(sizes) > 1 else sizes[0]
        off = self.residuals
        return replace(
            self,
            parameters=tuple(given),
            basis=rescaled(self.basis, sizes),
            trim=self.trim and replace(self.trim, basis=rescaled(self.trim.basis, sizes)),
            residuals=off and off._replace(nodes=off.nodes / scale),
        )

    def with_rate(self, rate: Rates) -> LPVStateSpace:
        """Return the same model with |dp/dt| <= rate: one for all parameters, one each or by name;
        the name of a parameter states that it is the rate.
        """
        return replace(self, parameters=with_rates(self.parameters, rate))

    def with_parameter(self, scheduling: Scheduling) -> LPVStateSpace:
        """Return the same model over one more parameter, the last, on which it does not depend.

        With it a parameter may get a rate that is bounded in its own rate:
        `with_parameter(Scheduling("acceleration", "m/s^2", -3, 3, rate=5)).with_rate({"airspeed":
        "acceleration"})`. Raises `InputError` for a name that repeats, and a basis that cannot
        be a factor of a `Product`.
        """
        from symheli.lpv.further_parameter import with_parameter

        return with_parameter(self, scheduling)

    def along(self, start: Sequence[float], end: Sequence[float]) -> LPVStateSpace:
        """The model on the straight line from `start` (s = -1) to `end` (s = 1), one parameter s.

        Its rate, per second, is the largest at which no parameter exceeds its own; `InputError`
        where that of one is another parameter.
        """
        first, last = (check_all(self.parameters, np.reshape(p, -1)) for p in (start, end))
        half = 0.5 * np.abs(last - first)
        rate = min(s.limit / h for s, h in zip(self.parameters, half, strict=True) if h > 0)
        line = Restricted(self.basis, tuple(first.tolist()), tuple(last.tolist()))
        return replace(
            self,
            basis=line,
            parameters=(Scheduling("line", "1", -1.0, 1.0, rate),),
            trim=None,
            residuals=None,
        )

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
            trim=self.trim and self.trim.select(ix, iu, iy),
            residuals=self.residuals
            and FitResiduals(self.residuals.nodes, *keep(*self.residuals.matrices)),
        )

    def feedback(self, gains: Mapping[tuple[str, str], float]) -> LPVStateSpace:
        """Close the positive loops u_i = gain * y_j + (new u_i) for each {(input, output): gain};
        always an `LPVStateSpace`, exact. A negative loop has a negative gain.

        Outputs that depend on p multiply inputs that do: a polynomial model then has up to twice
        the degree, a piecewise polynomial one gets `Patches`, in another basis `InputError`. A
        loop through constant feedthrough is solved;
        through feedthrough D(p) that depends on p, from an input that is driven to an output that
        is fed back, the closed loop is rational and `InputError` says so:
        `to_lft().feedback(gains)` closes it exactly, as an `LFT`.

        See Also
        --------
        symheli.lpv.feedback : with a dynamic controller, and a sign
        """
        from symheli.lpv.lower_feedback import close_static

        return close_static(self, feedback_matrix(gains, self.inputs, self.outputs))

    def driven_by(self, parts: Mapping[str, LinearModel | LPVStateSpace]) -> LPVStateSpace:
        """This model behind single-input single-output `parts` {input: part}, such as actuators;
        the inputs keep their names and units.

        The states of the parts come last, with the name of the input before those that the model
        has too; parts may be scheduled. Raises `InputError` for a part of several inputs or
        outputs or of another sample period.
        """
        from symheli.lpv.in_series import driven_by

        return driven_by(self, parts)

    def filtered_by(self, parts: Mapping[str, LinearModel | LPVStateSpace]) -> LPVStateSpace:
        """This model in front of single-input single-output `parts` {output: part}, such as
        filters; the outputs keep their names and units. See `driven_by`.
        """
        from symheli.lpv.in_series import filtered_by

        return filtered_by(self, parts)

    def scaled(
        self, inputs: Mapping[str, float] | None = None, outputs: Mapping[str, float] | None = None
    ) -> LPVStateSpace:
        """Return the model with inputs and outputs {name: size} measured in that size (> 0): a
        value of `size` in its unit becomes 1. The others stay; the trim is left out.
        """
        sizes = [
            _sizes(given or {}, names, kind)
            for given, names, kind in (
                (inputs, self.inputs, "input"),
                (outputs, self.outputs, "output"),
            )
        ]

        def measured(A: Array, B: Array, C: Array, D: Array) -> Matrices:
            into, out = sizes[0], sizes[1][:, None]
            return Matrices(A, B * into, C / out, D * into / out)

        own = measured(self.A, self.B, self.C, self.D)
        model = replace(self, **own._asdict(), trim=None, residuals=None)
        if (origin := self.fitted_to) is None:
            return model
        return model.with_residuals(origin.nodes, measured(*origin.matrices))

    def adjoint(self) -> LPVStateSpace:
        """dx/dt = A(p)' x + C(p)' u, y = B(p)' x + D(p)' u: outputs become inputs.

        Run backwards in time it is the adjoint of the model as an operator: over all p(t) within
        the range and rates, which are the same backwards, both have the same L2 gain. What p is
        frozen at has the same frequency response, transposed. Raises `InputError` where the rate of
        a parameter is another one, which backwards it is not.
        """
        for s in self.parameters:
            if isinstance(s.rate, str):
                raise InputError(
                    f"backwards the rate of {s.name} is not {s.rate}: give it as a number,"
                    " .with_rate(...)"
                )

        def turned(A: Array, B: Array, C: Array, D: Array) -> Matrices:
            return Matrices(*(np.swapaxes(M, -1, -2) for M in (A, C, B, D)))

        own = turned(self.A, self.B, self.C, self.D)
        outputs, inputs = self.outputs, self.inputs
        model = replace(
            self, **own._asdict(), inputs=outputs, outputs=inputs, trim=None, residuals=None
        )
        if (origin := self.fitted_to) is None:
            return model
        return model.with_residuals(origin.nodes, turned(*origin.matrices))

    def discretize(
        self, dt: float, *, degree: int | Sequence[int] | None = None, nodes: int | None = None
    ) -> LPVStateSpace:
        """Return the zero-order-hold equivalent at frozen p, fitted element-wise by polynomials of
        `degree`.

        `nodes` values of each parameter (None: 41 of one, 13 each of several). `degree`, one for
        all parameters or one each, defaults to that of the basis (needed where the basis is no
        polynomial). The misfit at the nodes is in `.residuals`: the exponential of a polynomial is
        no polynomial. So is the misfit to the sampled models of the family that this model was
        fitted to, at the nodes of that.
        """
        if self.dt is not None:
            raise InputError(f"the model is already discrete (dt = {self.dt} s)")
        count = len(self.parameters)
        degrees = self.basis.degrees if degree is None else np.broadcast_to(degree, count).tolist()
        if degrees is None:
            raise InputError("give `degree`: the discrete entries are fitted by polynomials")
        p = lobatto_points((41 if count == 1 else 13) if nodes is None else nodes, self.box)
        sampled = self._sampled(self.matrices(p), dt)
        basis = polynomials(degrees, self.box)
        fitted = Matrices(*(basis.fit(p, M) for M in sampled))
        model = replace(
            self, basis=basis, A=fitted.A, B=fitted.B, C=fitted.C, D=fitted.D, dt=dt, residuals=None
        )
        if (origin := self.fitted_to) is not None:
            p = np.concatenate([p, origin.nodes])
            sampled = Matrices(
                *map(np.concatenate, zip(sampled, self._sampled(origin.matrices, dt), strict=True))
            )
        return model.with_residuals(p, sampled)

    def fitted(self, basis: FunctionSpace) -> LPVStateSpace:
        """Return the model with its entries fitted by the functions of another basis, such as
        `Polynomial(8, low, high)`, and the misfit in `.residuals`: certificates are of polynomials
        and piecewise polynomials.
        """
        p = lobatto_points(41 if len(self.parameters) == 1 else 13, self.box)
        p = np.concatenate([p, basis.samples(self.box)])
        exact = self.matrices(p)
        model = replace(
            self,
            basis=basis,
            **{name: basis.fit(p, M) for name, M in exact._asdict().items()},
            residuals=None,
        )
        if (origin := self.fitted_to) is not None:
            p = np.concatenate([p, origin.nodes])
            exact = Matrices(*map(np.concatenate, zip(exact, origin.matrices, strict=True)))
        return model.with_residuals(p, exact)

    @property
    def fitted_to(self) -> FitResiduals | None:
        """Data of the fit at its nodes: fit minus residuals; None for a model that is not a fit."""
        if self.residuals is None:
            return None
        exact = (
            M - off
            for M, off in zip(
                self.matrices(self.residuals.nodes), self.residuals.matrices, strict=True
            )
        )
        return FitResiduals(self.residuals.nodes, *exact)

    def with_residuals(self, nodes: Array, exact: Matrices) -> LPVStateSpace:
        """Return the same model as a fit of `exact` (K, ...) at `nodes` (K,), or (K, d)."""
        off = (M - E for M, E in zip(self.matrices(nodes), exact, strict=True))
        return replace(self, residuals=FitResiduals(nodes, *off))

    def _sampled(self, matrices: Matrices, dt: float) -> Matrices:
        frozen = [
            LinearModel(*each, self.states, self.inputs, self.outputs).discretize(dt)
            for each in zip(*matrices, strict=True)
        ]
        return Matrices(*(np.stack([getattr(model, name) for model in frozen]) for name in "ABCD"))

    def reduce(
        self, order: int | None = None, *, by: str | None = None, loss: float | None = None
    ) -> LPVStateSpace:
        """Return the model with `order` states, or with the fewest whose error is at most `loss`.

        By "minimal", the default without order and loss, `minimal_realization`. By "coprime", else
        the default, `truncate` for feedback, of unstable models too; its error is the nu-gap at
        frozen p. By "balanced" `truncate` for the response; its error is the largest gain of the
        difference by that of the model. `synthesis.designs.bounded_truncation` has a bound while p
        moves.

        Raises `InputError` for an order or a method that does not serve the model,
        `UnknownNameError` for another method.
        """
        from symheli.lpv.balanced_truncation import reduced

        return reduced(self, order, by, loss)

    def truncate(self, order: int, **options: Any) -> BalancedTruncation[LPVStateSpace]:
        """`order` states by one projection balanced over p, with the error it makes; see
        `symheli.lpv.balanced_truncation`, which has the options.
        """
        from symheli.lpv.balanced_truncation import balanced_truncation

        return balanced_truncation(self, order, **options)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model with names, units, trim and residuals as JSON, every number exact; a
        reader sees the old file or the new one. Raises `InputError` for a basis that is not made of
        numbers, `SymheliError` where the file cannot be written.
        """
        from symheli.lpv.lpv_file import save

        return save(self, path)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], basis: FunctionSpace | None = None
    ) -> LPVStateSpace:
        """The model in `path`, equal to the last bit; one with `UserFunctions` needs the `basis` it
        was made with. Raises `InputError` unless the file is whole and of this kind.
        """
        from symheli.lpv.lpv_file import load

        return load(path, basis)

    def simulate(
        self,
        p: object,
        u: object,
        x0: object | None = None,
        *,
        dt: float | None = None,
        drift: object | None = None,
        offsets: bool = False,
    ) -> tuple[Array, Array]:
        """States (n, nx) and outputs (n, ny) along p (n,) or (n, d), or with p(t, x, u) a function;
        see `symheli.lpv.tools.simulate`.
        """
        from symheli.lpv.simulate import simulate

        return simulate(self, p, u, x0, dt=dt, drift=drift, offsets=offsets)

    def predict(
        self,
        p: object,
        u: object,
        x: object,
        *,
        dt: float | None = None,
        rate: object | None = None,
    ) -> SteppedFlight:
        """Predict a flight: any number of samples ahead, or in free run; see
        `symheli.lpv.predict`.
        """
        from symheli.lpv.prediction import predict

        return predict(self, p, u, x, dt=dt, rate=rate)

    def with_trim_drift(self) -> LPVStateSpace:
        """The model with what the motion of its trim adds to dx/dt as further inputs, last.

        "drift_airspeed" (m/s^2) is the rate of the airspeed and enters by -dx0/dp; where that rate
        is another parameter, the input is 1 while the flight goes on and enters by xdot0(p) -
        dx0/dV a, and "drift_acceleration" (m/s^3) is the jerk. So a certificate bounds what the
        drift does. The columns are fitted by the basis of the model; the misfit is in `.residuals`.
        Raises `InputError` for a model without trim: declare the drift before closing loops.
        """
        from symheli.lpv.trim_drift import with_trim_drift

        return with_trim_drift(self)

    def plot(self, ax: Axes | None = None, entries: Sequence[str] | None = None) -> Axes:
        """Entries such as "A[q, u]" over the scheduling parameter, each by its largest magnitude,
        which the legend gives; default the diagonal of A. Returns the axes; raises `InputError`
        for several parameters, `UnknownNameError` for an entry that is not there.
        """
        from symheli.lpv.entry_plot import plot_entries

        s = self.scheduling
        p = np.linspace(s.low, s.high, 201)
        return plot_entries(ax, Signal(s.name, s.unit), p, self, self.matrices(p), entries, "")

    def to_frame(self, p: object = None) -> pandas.DataFrame:
        """A row a value of the scheduling parameters, a column an entry A[q, u] ... there; the
        units of all of them in attrs["units"].

        p: (K,) values of one parameter, (K, d) of several; default 21 of each evenly over its
        range, in every combination. Raises `InputError` for values outside, or without pandas.
        """
        from symheli.lpv.labelled_models import values_frame

        return values_frame(self, p)

    def to_xarray(self) -> xarray.Dataset:
        """Return the coefficients of A, B, C, D over "function" (j of f_j), "equation", "state",
        "input" and "output"; the attribute `basis` describes the functions. Raises `InputError`
        without xarray.
        """
        from symheli.lpv.labelled_models import coefficient_dataset

        return coefficient_dataset(self, self, repr(self.basis))

    def to_control(self, *p: float) -> Any:
        """A python-control `StateSpace` with the same names, p held: one value a parameter."""
        return self.at(*p).to_control()

    def to_lft(self) -> LFT:
        """The equivalent linear fractional transformation (polynomial dependence only), not yet
        reduced.
        """
        from symheli.lpv.lft import LFT

        return LFT.from_polynomial(self)


def _sizes(given: Mapping[str, float], names: Sequence[str], kind: str) -> Array:
    """One size a name, 1 where none is given."""
    out = np.ones(len(names))
    for name, size in given.items():
        if not 0 < float(size) < math.inf:
            raise InputError(
                f"the size of the {kind} {name} must be a number > 0, got {size!r:.60}"
            )
        out[indices([name], names, kind)[0]] = float(size)
    return out


def _by_exponents(
    name: str, matrices: Sequence[Any] | Mapping[Any, Any], count: int
) -> Mapping[Any, Any]:
    """{exponents: matrix}, also of a list [of p^0, p^1, ...] where there is one parameter."""
    if isinstance(matrices, Mapping):
        return matrices
    if count > 1:
        raise InputError(
            f"{name}: expected {{exponents: matrix}}, such as {{{(0,) * count}: {name}0}}, with"
            f" {count} parameters"
        )
    if isinstance(matrices, str) or not hasattr(matrices, "__len__"):
        raise InputError(
            f"{name}: expected a list of coefficient matrices [{name}0, {name}1, ...], got"
            f" {matrices!r:.60}"
        )
    if len(matrices) and all(np.ndim(M) == 1 for M in matrices):
        raise InputError(
            f"{name}: expected a list of coefficient matrices [{name}0, {name}1, ...], {name}(p) ="
            f" {name}0 + p {name}1 + ..., got one matrix; write [{name}0]"
        )
    if not len(matrices):
        raise InputError(
            f"{name}: expected a list of at least one coefficient matrix [{name}0, {name}1, ...]"
        )
    return {(i,): M for i, M in enumerate(matrices)}
