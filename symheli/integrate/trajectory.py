"""One simulated flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from symheli.errors import InputError
from symheli.physics.attitude import euler_state
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, indices, signals

EULER = ("u", "v", "w", "p", "q", "r", "phi", "theta")
INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory:
    """States (n+1, nx) of `signals` (quaternion form, SI) at `times` (n+1,) in s, under `inputs`
    (n, 4) and `wind` (n, 3), each held.

    `wind` is north east down, m/s; `parameters` are those of the helicopter. `method` took `steps`
    (m,), in s, `per_sample` (n,) of them in each sample: derivatives follow the same steps.
    """

    times: Array
    states: Array
    inputs: Array
    wind: Array
    signals: tuple[Signal, ...]
    steps: Array
    per_sample: Array
    method: Any
    parameters: NamedVector

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
        if len(self.per_sample) != n or int(sum(self.per_sample)) != len(self.steps):
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
        """As a flight record: velocities, rates, phi, theta, rotor states and position, and the
        inputs (the last one again at the end).
        """
        euler, own = euler_state(self.states), self.signals[13:]
        columns = {str(name): euler[:, i] for i, name in enumerate((*EULER, *own))}
        columns |= {str(name): self[name] for name in ("x_n", "x_e", "x_d")}
        columns |= {
            name: self.inputs[[*range(len(self.inputs)), -1], i] for i, name in enumerate(INPUTS)
        }
        return FlightRecord.from_arrays(
            self.times, {name: Signal(name).unit for name in columns}, repr(self.method), **columns
        )
