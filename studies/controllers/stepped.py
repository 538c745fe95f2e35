"""A controller whose reference of one signal steps in flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from symheli.values.named_vector import NamedVector

STEP_AT = 1.0
"""When a command steps, s."""


@dataclass(frozen=True, eq=False)
class Stepped:
    """A controller whose command of one signal is `size` larger from `STEP_AT` to `until`, s."""

    controller: Any
    signal: str
    size: float
    until: float = math.inf

    @property
    def dt(self) -> float:
        """Sample period, s."""
        return self.controller.dt

    def init(self) -> tuple[int, Any]:
        """Samples so far, and the state of the controller."""
        return 0, self.controller.init()

    def step(
        self, state: tuple[int, Any], measured: NamedVector, reference: NamedVector, p: NamedVector
    ) -> tuple[Array, tuple[int, Any]]:
        """Commands (4,), rad, and the state at the next sample."""
        k, inner = state
        if STEP_AT <= k * self.dt < self.until:
            values = np.array(measured.array)
            values[measured.signals.index(self.signal)] -= self.size
            measured = NamedVector(measured.signals, values)
        u, inner = self.controller.step(inner, measured, reference, p)
        return u, (k + 1, inner)
