"""State of a recursive estimator, as a value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from identification.recursive.forgetting import Constant
from identification.recursive.kernel import configuration as at
from identification.recursive.kernel import twin
from identification.recursive.kernel.configuration import GroupLayout, KernelConfiguration
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized

NO_FORGETTING = Constant(1.0)
"""Forgetting factor of a recursion that keeps all data."""
MAX_REFINEMENTS = 12
"""Largest number of steps of a refinement."""


@dataclass(frozen=True, eq=False)
class RLSState:
    """The state of the recursive estimator; every update returns a new one.

    Parameters
    ----------
    configuration : KernelConfiguration
        Of the estimator it belongs to.
    memory : array
        The kernel's; the properties are what it means.

    Examples
    --------
    >>> state = idn.RecursiveLeastSquares(arx).run(record).state
    >>> state.count, state.determined, state.theta.shape
    (799, True, (4, 1))
    """

    configuration: KernelConfiguration
    memory: Array
    _learnt: dict[str, Array] = field(default_factory=dict, repr=False)

    __repr__ = summarized

    def __post_init__(self) -> None:
        self.memory.flags.writeable = False

    def after_idling(self, memory: Array) -> RLSState:
        """The state with another past and the same knowledge."""
        return RLSState(self.configuration, memory, self._learnt)

    @property
    def factor(self) -> Array:
        """(n + ny, n + ny), upper triangular, [[R, Z], [0, S]].

        R'R is the weighted information of the regressors, R theta = Z, and S'S the weighted sum of
        squared residuals. Raises `InputError` where outputs have different regressors, hence
        several factors: see `factors`.
        """
        if len(self.configuration.groups) > 1:
            raise InputError(
                f"this structure has {len(self.configuration.groups)} groups of outputs, each with"
                " its factor: see factors"
            )
        return self.factors[0]

    @property
    def factors(self) -> tuple[Array, ...]:
        """The factor of each group of outputs that share a regressor."""
        names = [f"factor {g}" for g in range(len(self.configuration.groups))]
        return tuple(
            (
                self._remember(name, self._factor(layout))
                if name not in self._learnt
                else self._learnt[name]
            )
            for name, layout in zip(names, self.configuration.groups, strict=True)
        )

    @property
    def theta(self) -> Array:
        """Coefficients (n, ny)."""
        if "theta" not in self._learnt:
            self._remember("theta", twin.theta(self.configuration, self.memory).astype(float))
        return self._learnt["theta"]

    @property
    def peak(self) -> Array:
        """(n,) largest regressors to expect: each signal at its largest so far, times each function
        at its largest.
        """
        out = np.zeros(self.configuration.structure.n_regressors)
        for layout in self.configuration.groups:
            out[self.configuration.structure.regressors(layout.group)] = self._part(layout, "peak")[
                : layout.n
            ]
        return out

    @property
    def past(self) -> Array:
        """The last samples, oldest first, rows [y, u, p, f(p)], at most memory + 1."""
        rows = self.memory[self.configuration.past].reshape(-1, self.configuration.width)
        return rows[: int(self.memory[at.FILLED])][::-1].astype(float)

    @property
    def count(self) -> int:
        """Regressors absorbed."""
        return int(self.memory[at.COUNT]) + at.MILLION * int(self.memory[at.MILLIONS])

    @property
    def weight(self) -> float:
        """Their sum of weights: how many samples are remembered; the smallest of the groups."""
        return min(self._header(at.WEIGHT))

    @property
    def determined(self) -> bool:
        """Whether the data fix every coefficient."""
        return all(self._header(at.DETERMINED))

    @property
    def saturated(self) -> bool:
        """Whether an ordinary sample is lost to rounding: in single precision that never forgets,
        after 8.4e6 samples.
        """
        return max(self._header(at.WEIGHT)) * float(np.finfo(self.configuration.dtype).eps) >= 1

    def solve(self, *, as_it_stands: bool = False) -> Array:
        """The least-squares coefficients (n, ny) in double precision.

        Where nothing is forgotten and everything is determined, those of the data alone: what is
        pretended of the coefficients is taken off again, and `theta` is as far away as `pretended`
        says. `as_it_stands`: the solution of R theta = Z, with which `theta` agrees to rounding.
        """
        alone = not as_it_stands and self.configuration.forgetting == NO_FORGETTING
        structure = self.configuration.structure
        out = np.zeros((structure.n_regressors, structure.ny))
        for layout in self.configuration.groups:
            n, triangle = (
                layout.n,
                layout.triangle.full(self._part(layout, "triangle").astype(float)),
            )
            where = structure.regressors(layout.group)[:, None], layout.group.outputs
            R, Z = triangle[:n, :n], triangle[:n, n:]
            found = solve_triangular(R, Z, unit_diagonal=True)
            if alone and self._part(layout, "header")[at.DETERMINED]:
                d, fed = (self._part(layout, name)[:n].astype(float) for name in ("d", "fed"))
                found = _of_data_alone(found, R, d, fed)
            out[where] = found
        return out

    @property
    def pretended(self) -> float:
        """How far `theta` is at most from `solve()`, in standard deviations of the coefficients:
        what the pseudo-observations move them. Small unless the data hardly tell coefficients
        apart, as in a flight at one airspeed that then creeps away.
        """
        away, solved = 0.0, self.solve()
        size = np.sqrt(np.diag(self.residual_covariance))
        for layout, factor in zip(self.configuration.groups, self.factors, strict=True):
            n, rows = layout.n, self.configuration.structure.regressors(layout.group)
            inverse = solve_triangular(factor[:n, :n], np.eye(n))
            deviation = np.outer(np.linalg.norm(inverse, axis=1), size[layout.group.outputs])
            off = np.abs(self.theta - solved)[rows][:, layout.group.outputs]
            with np.errstate(divide="ignore", invalid="ignore"):
                away = max(away, float(np.max(np.where(off > 0, off / deviation, 0.0))))
        return away

    @property
    def residual_covariance(self) -> Array:
        """Weighted covariance (ny, ny) of the residuals, per degree of freedom left; 0 between
        outputs with different regressors.
        """
        ny = self.configuration.structure.ny
        out = np.zeros((ny, ny))
        for layout, factor, weight in zip(
            self.configuration.groups, self.factors, self._header(at.WEIGHT), strict=True
        ):
            S = factor[layout.n :, layout.n :]
            out[np.ix_(layout.group.outputs, layout.group.outputs)] = (
                S.T @ S / max(weight - layout.n, 1.0)
            )
        return out

    def _factor(self, layout: GroupLayout) -> Array:
        d = self._part(layout, "d")[layout.triangle.used].astype(float)
        return np.sqrt(d)[:, None] * layout.triangle.full(
            self._part(layout, "triangle").astype(float)
        )

    def _part(self, layout: GroupLayout, name: str) -> Array:
        return self.memory[layout.in_state[name]]

    def _header(self, index: int) -> list[float]:
        return [float(self._part(layout, "header")[index]) for layout in self.configuration.groups]

    def _remember(self, name: str, value: Array) -> Array:
        value.flags.writeable = False
        self._learnt[name] = value
        return value


def _of_data_alone(theta: Array, R: Array, d: Array, fed: Array) -> Array:
    """theta (n, ny) of (R'DR) theta = R'DZ without the rows that say 0 with the weights `fed` (n,)
    in it, R'DR - diag(fed): by refinement, each step of which leaves of the rest what those rows
    decide, less than a thousandth.
    """
    found, last = theta, np.inf
    for _ in range(MAX_REFINEMENTS):
        inner = solve_triangular(R, fed[:, None] * found, unit_diagonal=True, trans=1)
        better = theta + solve_triangular(R, inner / d[:, None], unit_diagonal=True)
        step = float(np.abs(better - found).max(initial=0.0))
        if not step < 0.5 * last:  # nothing but rounding is left, or it would not converge
            break
        found, last = better, step
    return found


class RLSInfo(NamedTuple):
    """Diagnostics of one recursive update.

    Parameters
    ----------
    available : bool
        Whether the sample had a complete regressor. Without one innovation and gain are NaN and
        nothing was learnt.
    innovation : array (ny,)
        y minus its prediction before the update.
    gain : array (n,) or (n, ny)
        How the coefficients of an output move per unit of its innovation; (n, ny) where outputs
        have different regressors.
    coefficients : array (n, ny)
        After the update.
    determined : bool
        Whether the data so far leave no coefficient open.

    Examples
    --------
    >>> rls = idn.RecursiveLeastSquares(arx)
    >>> state, info = rls.update(rls.init(), y=[0.1], u=[1.0], p=0.5)
    >>> info.available, info.determined
    (False, False)
    """

    available: bool
    innovation: Array
    gain: Array
    coefficients: Array
    determined: bool

    __repr__ = summarized
