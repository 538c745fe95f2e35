"""A sampled model over one parameter as a table for single precision."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.flight.anti_windup import observer_gains
from symheli.flight.controller import RATE, deviations
from symheli.flight.single_precision import increasing
from symheli.lpv.bases.interpolating import PiecewiseLinear
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices
from symheli.values.units import per_second, quotient

CHECKS_PER_INTERVAL = 4
"""Number of points between two knots at which a table is compared with its original."""


@dataclass(frozen=True, eq=False)
class Tabulated:
    """The sampled `model` over one parameter of a `TableController`; raises `InputError` for any
    other.
    """

    model: LPVStateSpace
    integrates: Collection[str] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", deviations(self.model))
        if self.model.dt is None:
            raise InputError("the controller is continuous: sample it with .discretize(dt)")
        if len(self.model.parameters) > 1:
            raise InputError(
                "a table is over one scheduling parameter, this model over"
                f" {', '.join(s.name for s in self.model.parameters)}: design the controller over"
                " one of them"
            )
        if self.integrates is not None:
            rates = [str(y).removesuffix(RATE) for y in self.model.outputs if y.endswith(RATE)]
            indices(self.integrates, rates, "command that integrates")

    @property
    def dt(self) -> float:
        """Sample period, s."""
        assert self.model.dt is not None  # noqa: S101
        return self.model.dt

    @property
    def parameter(self) -> Signal:
        """The signal over which the table is given, with its unit."""
        return Signal(self.model.scheduling.name, self.model.scheduling.unit)

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The commands, or those whose rates are given."""
        return tuple(
            _integrated(y) if rate else y
            for y, rate in zip(self.model.outputs, self.rates, strict=True)
        )

    @property
    def rates(self) -> Array:
        """(ny,) of bool: which outputs are rates of commands."""
        chosen = self.integrates
        return np.array(
            [
                y.endswith(RATE) and (chosen is None or y.removesuffix(RATE) in chosen)
                for y in self.model.outputs
            ],
            bool,
        )

    def knots(self, given: int | Sequence[float]) -> Array:
        """Return this number of equidistant knots, or the given ones, in the range of the model;
        float32.
        """
        low, high = self.model.scheduling.low, self.model.scheduling.high
        if isinstance(given, int):
            if isinstance(given, bool) or given < 2:
                raise InputError(f"knots: expected at least 2, got {given}")
            given = np.linspace(low, high, given).tolist()
        at = increasing(given, "knots")
        slack = 1e-6 * (high - low)
        if at[0] < low - slack or at[-1] > high + slack:
            raise InputError(
                f"knots: expected values within {low:g} to {high:g} {self.parameter.unit}, the"
                f" range of {self.parameter} of the model, got {at[0]:g} to {at[-1]:g}"
            )
        return at

    def at(self, p: Array) -> Matrices:
        """A, B, C, D (N, ...), rates as what they change in a sample."""
        s = self.model.scheduling
        A, B, C, D = self.model.matrices(np.clip(p, s.low, s.high))
        each = np.where(self.rates, self.dt, 1.0)[:, None]
        return Matrices(A, B, each * C, each * D)

    def matrices(self, knots: Array, correction: object | None) -> Array:
        """Return [A B L; C D 0] (K, n + ny, n + nu + ny), L designed or given."""
        A, B, C, D = self.at(knots.astype(float))
        none = np.zeros((len(knots), len(self.outputs), len(self.outputs)))
        return np.block([[A, B, self._corrections(correction, A, B, C)], [C, D, none]])

    def misfit(self, knots: Array, matrices: Array) -> float:
        """Largest entry of table minus model, at the knots and between, over the largest of the
        model: of A, B, C, D the worst.
        """
        at = knots.astype(float)
        steps = np.arange(CHECKS_PER_INTERVAL + 1) / (CHECKS_PER_INTERVAL + 1)
        p = np.append((at[:-1, None] + np.diff(at)[:, None] * steps).ravel(), at[-1])
        n = len(self.model.states)
        own = n + len(self.model.inputs)
        M = np.tensordot(PiecewiseLinear(tuple(at.tolist()))(p), matrices.astype(float), axes=1)
        table = M[:, :n, :n], M[:, :n, n:own], M[:, n:, :n], M[:, n:, n:own]
        return max(
            float(np.abs(mine - true).max(initial=0.0) / (np.abs(true).max(initial=0.0) or 1.0))
            for mine, true in zip(table, self.at(p), strict=True)
        )

    def _corrections(self, given: object | None, A: Array, B: Array, C: Array) -> Array:
        shape = (*A.shape[:2], C.shape[1])
        if given is None:
            L, positions = np.zeros(shape), ~self.rates
            L[:, :, positions] = observer_gains(A, B, C[:, positions])
            return L
        try:
            return np.broadcast_to(np.asarray(given, float), shape)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"correction: expected (states, outputs) {shape[1:]}, one at each knot {shape}, or"
                f" 0, got {given!r:.80}"
            ) from error


def _integrated(rate: Signal) -> Signal:
    """The command whose rate this is, in the unit that is a second's change of it: "m/s" of
    "m/s^2", "km/h" of "km/h/s"; where the rate has no unit, in the unit of its name.
    """
    unit, name = rate.unit, rate.removesuffix(RATE)
    if unit == "1":
        return Signal(name)
    whole = unit.removesuffix("/s")
    if whole == unit or per_second(whole) != unit:
        try:
            whole = quotient(unit, "1/s")
        except InputError:
            whole = f"{unit} s"
    return Signal(name, whole)
