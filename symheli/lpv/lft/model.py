"""Linear fractional transformations: a constant matrix closed by blocks of scheduling
parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.lft_matrices import Block, LFTMatrices
from symheli.lpv.linear_model import LinearModel, feedback_matrix
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.operators import Operators
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.numbers import positive
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    from symheli.lpv.lft.sampling import HoldError
    from symheli.lpv.lft.truncation import Truncation
    from symheli.lpv.lft.well_posed import WellPosedness


@dataclass(frozen=True, eq=False)
class LFT(Operators, LFTMatrices):
    """A linear fractional transformation closes normalised scheduling parameters, |delta_i| <= 1,
    around a constant matrix.

    M(delta) = M22 + M21 Delta (I - M11 Delta)^-1 M12 = [A B; C D], Delta = diag(delta_i I_ni), and
    dx/dt = A x + B u, y = C x + D u, or x(k+1) = A x(k) + B u(k).

    Parameters
    ----------
    M11, M12, M21, M22 : array (n, n), (n, nx + nu), (nx + ny, n), (nx + ny, nx + nu)
        n = `order` = sum of the block sizes.
    blocks : tuple of Block
        One a parameter, with its `Scheduling` and its size.
    states, inputs, outputs : tuple of Signal
        nx, nu, ny names.
    dt : float, optional
        Sample period, s; None: continuous.

    Raises
    ------
    InputError
        Shapes that do not fit, a parameter in two blocks, a period that is not positive.

    See Also
    --------
    symheli.LPVStateSpace : matrices as functions of parameters
    synthesis.lft_gain : gains for parameters that may jump

    References
    ----------
    Zhou, Doyle and Glover (1996), Robust and Optimal Control, ch. 10.

    Examples
    --------
    >>> p = symheli.Scheduling("p", "1", low=0.0, high=1.0)
    >>> spring = symheli.LFT.polynomial(
    ...     A={(0,): [[0.0, 1.0], [-2.0, -1.0]], (1,): [[0.0, 0.0], [-0.5, 0.0]]},
    ...     B={(0,): [[0.0], [1.0]]},
    ...     C={(0,): [[1.0, 0.0]]},
    ...     D={(0,): [[0.0]]},
    ...     parameters=[p],
    ... )
    >>> spring.reduce().order, spring.at(0.5).A[1].round(6).tolist()
    (1, [-2.25, -1.0])
    """

    __repr__ = summarized
    _repr_html_ = as_table

    # -- made from

    @classmethod
    def from_polynomial(cls, lpv: LPVStateSpace) -> LFT:
        """The polynomial family itself, by Horner's rule: order d (nx + nu), not yet reduced."""
        from symheli.lpv.lft.polynomial import from_lpv

        return from_lpv(lpv)

    @classmethod
    def polynomial(
        cls,
        A: Mapping[Any, Any],
        B: Mapping[Any, Any],
        C: Mapping[Any, Any],
        D: Mapping[Any, Any],
        parameters: Sequence[Scheduling],
        dt: float | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LFT:
        """Polynomials in several parameters: {(0, 0): A00, (1, 0): A10, (0, 2): A02, ...},
        exponents in the order of `parameters`.

        The parameters are in physical units. Not yet reduced. Names default to x1.., u1.., y1...
        """
        from symheli.lpv.lft.polynomial import from_monomials

        return from_monomials(A, B, C, D, parameters, dt, states, inputs, outputs)

    @classmethod
    def constant(cls, model: LinearModel) -> LFT:
        """A model that depends on no parameter: order 0."""
        M22 = np.block([[model.A, model.B], [model.C, model.D]])
        none = np.zeros((0, 0))
        M12, M21 = np.zeros((0, M22.shape[1])), np.zeros((M22.shape[0], 0))
        return cls(none, M12, M21, M22, (), model.states, model.inputs, model.outputs, model.dt)

    @classmethod
    def parameter(
        cls, scheduling: Scheduling, input: str, output: str, dt: float | None = None
    ) -> LFT:
        """y = p u without states, the brick of rational models: `connect` makes 1/p of it, p^2, and
        so on.
        """
        one = np.array([[1.0]])
        blocks = (Block(scheduling, 1),)
        return cls(
            np.zeros((1, 1)),
            one,
            scheduling.radius * one,
            scheduling.middle * one,
            blocks,
            (),
            signals([input]),
            signals([output]),
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
    ) -> LFT:
        """Return the LFT of matrices of rational expressions, written as for
        `LPVStateSpace.from_expressions`; exact, with as many copies of each parameter as `reduce`
        leaves.

        Names default to x1.., u1.., y1... Raises `InputError` for other functions and for shapes
        that do not fit, `UnknownNameError` for another symbol.

        Examples
        --------
        >>> rho = symheli.Scheduling("rho", "1", low=0.0, high=1.0, rate=0.5)
        >>> p = rho.symbol
        >>> plant = symheli.LFT.from_expressions([[-1 / (1 + p)]], [[1]], [[1]], [[0]], rho)
        >>> plant.order, plant.at(0.25).A.round(12)
        (1, array([[-0.8]]))
        """
        from symheli.lpv.expressions import lft_of

        return lft_of((A, B, C, D), scheduling, dt, states, inputs, outputs)

    # -- what it is

    def at(self, *p: float, **named: float) -> LinearModel:
        """The model frozen at p (physical units), in the order of the blocks or by name: at(5.0,
        8.0), at(airspeed=5, mass=8).
        """
        M, nx = self.matrix(self.normalised(*p, **named)), len(self.states)
        return LinearModel(
            M[:nx, :nx],
            M[:nx, nx:],
            M[nx:, :nx],
            M[nx:, nx:],
            self.states,
            self.inputs,
            self.outputs,
            dt=self.dt,
        )

    def well_posed(self, boxes: int = 4000) -> WellPosedness:
        """Whether I - M11 Delta is invertible over the whole box; at most `boxes` cells are
        examined.
        """
        from symheli.lpv.lft.well_posed import well_posed

        return well_posed(self, boxes)

    # -- equivalent representations

    def with_scheduling(self, scheduling: Scheduling) -> LFT:
        """Return the same model with the parameter of that name over another range, with another
        rate or in another unit of the same quantity, to which it is converted; exact.
        """
        from symheli.lpv.lft.algebra import over_range

        return over_range(self, scheduling)

    def rename(self, names: Mapping[str, str]) -> LFT:
        """States, inputs, outputs and parameters under new names {old: new}; units stay."""
        groups = {
            group: [str(s) for s in getattr(self, group)]
            for group in ("states", "inputs", "outputs")
        }
        known = {name for group in groups.values() for name in group} | {
            s.name for s in self.parameters
        }
        for name in names:
            if name not in known:
                raise UnknownNameError("signal or parameter", name, sorted(known))
        new = {
            group: tuple(Signal(names.get(s, s), s.unit) for s in getattr(self, group))
            for group in groups
        }
        blocks = tuple(
            Block(
                replace(b.scheduling, name=names.get(b.scheduling.name, b.scheduling.name)), b.size
            )
            for b in self.blocks
        )
        return replace(self, blocks=blocks, **new)

    def select(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> LFT:
        """Keep these inputs and outputs, in this order; every state stays."""
        nx = len(self.states)
        columns = [
            *range(nx),
            *(
                nx + i
                for i in indices(self.inputs if inputs is None else inputs, self.inputs, "input")
            ),
        ]
        rows = [
            *range(nx),
            *(
                nx + i
                for i in indices(
                    self.outputs if outputs is None else outputs, self.outputs, "output"
                )
            ),
        ]
        return replace(
            self,
            M12=self.M12[:, columns],
            M21=self.M21[rows],
            M22=self.M22[np.ix_(rows, columns)],
            inputs=tuple(self.inputs[i - nx] for i in columns[nx:]),
            outputs=tuple(self.outputs[i - nx] for i in rows[nx:]),
        )

    def reduce(
        self,
        tolerance: float | None = None,
        *,
        order: int | None = None,
        by: str | None = None,
        loss: float | None = None,
    ) -> LFT:
        """Return the model with fewer copies of the parameters, by "minimal" the same model, by
        "balanced" the approximation of `truncate` with an order or a loss.

        Minimal is the default without order and loss. It is exact for one parameter, structured
        Kalman for several. No entry changes by more than the rounding of what depends on the
        parameters, and no parameter goes.

        With a `tolerance`, 1e-12 say, another model of fewer copies: what is below it, of the size
        that its row and column give an entry, counts as rounding and is lost.

        Raises `InputError` for a tolerance that is no fraction or stands beside an order or a loss,
        `UnknownNameError` for another method.
        """
        from symheli.lpv.balancing import method
        from symheli.lpv.lft.reduction import reduce

        by = method(by, order, loss, "balanced")
        if tolerance is not None and not (
            by == "minimal" and positive(tolerance, "tolerance", or_zero=True) < 1
        ):
            raise InputError(
                f'tolerance: expected a number from 0 to 1 such as 1e-12, of by="minimal", got'
                f" {tolerance!r:.80}; an order has its name, reduce(order=...)"
            )
        return reduce(self, tolerance) if by == "minimal" else self.truncate(loss, order=order).lft

    def truncate(self, error: float | None = None, *, order: int | None = None) -> Truncation:
        """Return an approximation with fewer copies, whose error is measured and, where possible,
        bounded; see `Truncation`.
        """
        from symheli.lpv.lft.truncation import truncate

        return truncate(self, error, order)

    def star(self, other: Any, outputs: int = 0, inputs: int | None = None) -> LFT:
        """Redheffer star product: the last `outputs` outputs feed the first inputs of `other`,
        whose first `inputs` outputs feed the last inputs here. By default series connection, y =
        self(other(u)).

        States are kept side by side, a parameter of both is one block.
        """
        from symheli.lpv.interconnection import star

        return star(self, other, outputs, inputs)

    def feedback(self, gains: Mapping[tuple[str, str], float]) -> LFT:
        """Close the positive loops u_i = gain * y_j + (new u_i) for each {(input, output): gain}; a
        negative loop has a negative gain.

        See Also
        --------
        symheli.lpv.feedback : with a dynamic controller, and a sign
        """
        from symheli.lpv.lft.algebra import close

        K = feedback_matrix(gains, self.inputs, self.outputs)
        return close(
            self, K, np.eye(len(self.inputs)), np.eye(len(self.outputs)), self.inputs, self.outputs
        )

    def simulate(
        self, p: object, u: object, x0: object | None = None, *, dt: float | None = None
    ) -> tuple[Array, Array]:
        """States (n, nx) and outputs (n, ny) along p (n,) or (n, d), or with p(t, x, u) a function;
        see `symheli.lpv.tools.simulate`.
        """
        from symheli.lpv.simulate import simulate

        return simulate(self, p, u, x0, dt=dt)

    def discretize(self, dt: float) -> LFT:
        """Tustin's rule, exact in the parameters: the trapezoidal rule of the time-varying model at
        samples `dt` s apart.
        """
        from symheli.lpv.lft.sampling import tustin

        return tustin(self, dt)

    def hold_error(self, dt: float, *, band: float = 0.25) -> HoldError:
        """Return the difference of Tustin's rule from the zero-order hold, for frozen p, up to
        `band` of the Nyquist frequency.
        """
        from symheli.lpv.lft.sampling import hold_error

        return hold_error(self, dt, band)

    def to_lpv(self, degree: int | Sequence[int] | None = None) -> LPVStateSpace:
        """The polynomial model in the same parameters, exact where the dependence is polynomial.

        Rational dependence needs a `degree`, one for all parameters or one each: a Chebyshev fit
        whose misfit is in `.residuals`.
        """
        from symheli.lpv.lft.polynomial import to_lpv

        return to_lpv(self, degree)
