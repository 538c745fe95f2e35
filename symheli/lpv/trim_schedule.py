"""The trim of a family of models as a function of the scheduling parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace

from symheli.lpv.bases.basis import Basis
from symheli.values.arrays import Array, frozen


@dataclass(frozen=True, eq=False)
class TrimSchedule:
    """x0(p) and u0(p) as coefficients `x` (n, nx) and `u` (n, nu) in `basis`."""

    basis: Basis
    x: Array
    u: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", frozen(self.x, "trim states", (self.basis.size, None)))
        object.__setattr__(self, "u", frozen(self.u, "trim inputs", (self.basis.size, None)))

    def state(self, p: object, derivative: int = 0) -> Array:
        """x0 (or its derivative per unit of p) at p, shape p.shape + (nx,)."""
        return self.basis(p, derivative) @ self.x

    def input(self, p: object, derivative: int = 0) -> Array:
        """u0 (or its derivative per unit of p) at p, shape p.shape + (nu,)."""
        return self.basis(p, derivative) @ self.u

    def select(self, states: list[int], inputs: list[int]) -> TrimSchedule:
        """Keep these columns."""
        return replace(self, x=self.x[:, states], u=self.u[:, inputs])
