"""One simulated flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.physics.attitude import euler_state
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.kinematics import INPUTS, RIGID_BODY
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory:
    """The result of `simulate`; flown["q"] is one state, `to_record()` returns a `FlightRecord`.

    Parameters
    ----------
    times : array (n+1,)
        s.
    states : array (n+1, nx)
        Quaternion form, SI.
    inputs, wind : array (n, 4), (n, 3)
        Each row held; wind north east down, m/s.
    signals : tuple of Signal
        nx names.
    steps : array (m,)
        Those the method took, s.
    per_sample : array (n,)
        How many of them in each sample: derivatives follow the same steps.
    evaluations : int or None
        How often the right-hand side was evaluated; None where the method does not count.
    method : RungeKutta4, CashKarp, DormandPrince or Radau
        With its options.
    parameters : NamedVector
        Of the helicopter.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> flown = symheli.simulate(heli, point, np.tile(point.u.array, (50, 1)), dt=0.02)
    >>> flown.states.shape, round(float(flown.times[-1]), 2), len(flown.to_record())
    ((51, 15), 1.0, 51)
    """

    times: Array
    states: Array
    inputs: Array
    wind: Array
    signals: tuple[Signal, ...]
    steps: Array
    per_sample: Array
    evaluations: int | None
    method: Any
    parameters: NamedVector

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        n = len(self.times) - 1
        object.__setattr__(self, "signals", signals(self.signals))
        object.__setattr__(self, "times", frozen(self.times, "times", (n + 1,)))
        object.__setattr__(
            self, "states", frozen(self.states, "states", (n + 1, len(self.signals)), finite=False)
        )
        object.__setattr__(self, "inputs", frozen(self.inputs, "inputs", (n, 4)))
        object.__setattr__(self, "wind", frozen(self.wind, "wind", (n, 3)))
        object.__setattr__(self, "steps", frozen(self.steps, "steps", (None,)))
        if len(self.per_sample) != n or int(np.sum(self.per_sample)) != len(self.steps):
            raise InputError(
                f"expected the number of steps of {n} samples, {len(self.steps)} in all, got"
                f" {self.per_sample}"
            )

    def __getitem__(self, name: str) -> Array:
        """One state over time (n+1,), by its name."""
        return self.states[:, indices([name], self.signals, "signal")[0]]

    @property
    def final(self) -> Array:
        """State at the end (nx,)."""
        return self.states[-1]

    def to_record(self) -> FlightRecord:
        """Return a flight record: velocities, rates, phi, theta, rotor states and position, and the
        inputs (the last one repeated at the end).
        """
        euler, own = euler_state(self.states), self.signals[13:]
        columns = {str(name): euler[:, i] for i, name in enumerate((*RIGID_BODY, *own))}
        columns |= {str(name): self[name] for name in ("x_n", "x_e", "x_d")}
        columns |= {
            str(name): self.inputs[[*range(len(self.inputs)), -1], i]
            for i, name in enumerate(INPUTS)
        }
        return FlightRecord.from_arrays(
            self.times, {name: Signal(name).unit for name in columns}, repr(self.method), **columns
        )
