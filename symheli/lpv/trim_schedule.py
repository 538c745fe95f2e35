"""The trim of a family of models as a function of the scheduling parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace, Order
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class TrimSchedule:
    """x0(p) and u0(p) as coefficients `x` (n, nx) and `u` (n, nu) in `basis`.

    `xdot` (n, nx): the rates of the states at the trim, of a quasi-steady one (a steady climb, an
    acceleration); None where they are zero. `y` (n, ny): the outputs y0(p); None where they are
    C(p) x0(p) + D(p) u0(p).
    """

    basis: FunctionSpace
    x: Array
    u: Array
    xdot: Array | None = None
    y: Array | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", frozen(self.x, "trim states", (self.basis.size, None)))
        object.__setattr__(self, "u", frozen(self.u, "trim inputs", (self.basis.size, None)))
        if self.xdot is not None:
            object.__setattr__(self, "xdot", frozen(self.xdot, "trim rates", self.x.shape))
        if self.y is not None:
            object.__setattr__(self, "y", frozen(self.y, "trim outputs", (self.basis.size, None)))

    @classmethod
    def from_expressions(
        cls,
        x: Sequence[Any],
        u: Sequence[Any],
        scheduling: Scheduling | Sequence[Scheduling],
        *,
        y: Sequence[Any] | None = None,
        xdot: Sequence[Any] | None = None,
    ) -> TrimSchedule:
        """Return the trim of expressions in the symbols of the parameters, and numbers, one a
        state, input, output and state; see `LPVStateSpace.from_expressions`, which has the same
        errors.

        Examples
        --------
        A tank dh/dt = u - sqrt(h) is at rest where the inflow is sqrt(h):

        >>> import dataclasses, numpy as np, sympy
        >>> from symheli import lpv
        >>> level = symheli.Scheduling("level", "m", low=0.1, high=2.0)
        >>> h = level.symbol
        >>> tank = symheli.LPVStateSpace.from_expressions(
        ...     [[-1 / (2 * sympy.sqrt(h))]], [[1]], [[1]], [[0]], level)
        >>> trim = lpv.tools.TrimSchedule.from_expressions([h], [sympy.sqrt(h)], level)
        >>> tank = dataclasses.replace(tank, trim=trim)
        >>> inflow = np.full((300, 1), 1.2)
        >>> found, _ = tank.simulate(lambda t, x, u: x[0], inflow, [0.5], dt=0.1, offsets=True)
        >>> print(found[-1].round(3))
        [1.44]
        """
        from symheli.lpv.expressions import lpv_of

        given = [list(each) for each in (x, u, xdot or (), y or ())]
        D = [[entry] for each in given for entry in each]
        made = lpv_of(([], np.zeros((0, 1)), np.zeros((len(D), 0)), D), scheduling)
        ends = np.cumsum([len(each) for each in given])[:-1]
        whole = np.split(made.D[:, :, 0], ends, axis=1)
        return cls(made.basis, whole[0], whole[1], *(M if M.size else None for M in whole[2:]))

    def state(self, p: object, derivative: Order = 0) -> Array:
        """x0 (or its derivative per unit of p) at p, shape p.shape + (nx,), the axis of several
        parameters left out.
        """
        return self.basis(p, derivative) @ self.x

    def input(self, p: object, derivative: Order = 0) -> Array:
        """u0 (or its derivative per unit of p) at p, shape p.shape + (nu,)."""
        return self.basis(p, derivative) @ self.u

    def output(self, p: object) -> Array | None:
        """y0 at p, shape p.shape + (ny,); None where the trim does not state it."""
        return None if self.y is None else self.basis(p) @ self.y

    def drift(self, p: object, rate: object) -> Array:
        """Return the contribution of a moving trim to the rates of the deviations, xdot0(p) -
        dx0/dp dp/dt.

        `rate` (per second) has the shape of p; the result p.shape + (nx,), the axis of several
        parameters left out.
        """
        slopes = self.basis.gradient(p) @ self.x  # (..., d, nx)
        rate = np.asarray(rate, dtype=float)
        rate = rate[..., None] if self.basis.dimension == 1 else rate
        moved = np.einsum("...d,...dx->...x", rate, slopes)
        return (0.0 if self.xdot is None else self.basis(p) @ self.xdot) - moved

    def projected(self, left: Array) -> TrimSchedule:
        """The trim of the states left' x."""
        xdot = None if self.xdot is None else self.xdot @ left
        return replace(self, x=self.x @ left, xdot=xdot)

    def select(self, states: list[int], inputs: list[int], outputs: list[int]) -> TrimSchedule:
        """Keep these columns."""
        xdot = None if self.xdot is None else self.xdot[:, states]
        y = None if self.y is None else self.y[:, outputs]
        return replace(self, x=self.x[:, states], u=self.u[:, inputs], xdot=xdot, y=y)
