"""The trim of a family of models as a function of the scheduling parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace, Order
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class TrimSchedule:
    """x0(p) and u0(p) as coefficients `x` (n, nx) and `u` (n, nu) in `basis`.

    `xdot` (n, nx): the rates of the states at the trim, of a quasi-steady one (a steady climb, an
    acceleration); None where they are zero.
    """

    basis: FunctionSpace
    x: Array
    u: Array
    xdot: Array | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", frozen(self.x, "trim states", (self.basis.size, None)))
        object.__setattr__(self, "u", frozen(self.u, "trim inputs", (self.basis.size, None)))
        if self.xdot is not None:
            object.__setattr__(self, "xdot", frozen(self.xdot, "trim rates", self.x.shape))

    def state(self, p: object, derivative: Order = 0) -> Array:
        """x0 (or its derivative per unit of p) at p, shape p.shape + (nx,), the axis of several
        parameters left out.
        """
        return self.basis(p, derivative) @ self.x

    def input(self, p: object, derivative: Order = 0) -> Array:
        """u0 (or its derivative per unit of p) at p, shape p.shape + (nu,)."""
        return self.basis(p, derivative) @ self.u

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

    def select(self, states: list[int], inputs: list[int]) -> TrimSchedule:
        """Keep these columns."""
        xdot = None if self.xdot is None else self.xdot[:, states]
        return replace(self, x=self.x[:, states], u=self.u[:, inputs], xdot=xdot)
