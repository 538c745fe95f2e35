"""The lateral loop of the exact linearizations: polynomials between the corners of the model, free
to jump at them.

The linearizations are smooth between two corners (a stall, an edge of the wake) and may jump at
one. A polynomial through many of them on each interval misses so little that a set of models around
it (`UncertainStateSpace.covering`) carries it through a proof.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

import symheli
from studies.loops.lateral import ATTITUDE_HOLD, INPUTS, close
from studies.setup.axes import LATERAL
from symheli import Helicopter, LinearFamily, LPVStateSpace, Scheduling
from symheli.lpv.bases import Patches
from symheli.values.arrays import Array

Channel = Literal["gust", "inputs"]

DEGREE = 4
LONGEST = 3.0
"""Longest interval, m/s: with `DEGREE` the entries are met to 1e-8 of the largest."""


@dataclass(frozen=True)
class ExactLateral:
    """v p r phi b1 under d_lat, d_ped, v_w: exact models at `nodes`, others to judge by at
    `between`, on the intervals of `basis`.
    """

    basis: Patches
    nodes: LinearFamily
    between: LinearFamily

    @classmethod
    def of(
        cls, heli: Helicopter, low: float = 0.0, high: float = 13.0, head_wind: float = 0.0
    ) -> ExactLateral:
        """From `low` to `high` m/s through the air, in a steady `head_wind` (m/s), cut at the
        corners of the model and where an interval would exceed `LONGEST`.
        """
        first = np.linspace(low, high, max(2, math.ceil(4 * (high - low))))
        found = _family(heli, first, head_wind).kinks
        ends = [low, *sorted(c for places in found.values() for c in places), high]
        breaks = [
            float(p)
            for a, b in pairwise(ends)
            for p in np.linspace(a, b, math.ceil((b - a) / LONGEST) + 1)[:-1]
        ]
        basis = Patches(DEGREE, (*breaks, high))
        return cls(
            basis,
            _family(heli, basis.points(2 * DEGREE + 2), head_wind),
            _family(heli, basis.points(4 * DEGREE + 5), head_wind),
        )

    def loop(
        self,
        channel: Channel = "gust",
        dt: float | None = None,
        gains: Mapping[tuple[str, str], float] = ATTITUDE_HOLD,
    ) -> LPVStateSpace:
        """The loop of `studies.loops.lateral` with exact models; `dt` (s): each held for so long,
        sampled.
        """
        family = self.nodes if dt is None else self.nodes.discretize(dt)
        A, B, C, D = (
            self.basis.fit(family.airspeeds, M) for M in (family.A, family.B, family.C, family.D)
        )
        scheduling = (Scheduling("airspeed", "m/s", self.basis.low, self.basis.high),)
        return close(
            LPVStateSpace(
                self.basis, A, B, C, D, scheduling, family.states, family.inputs, family.outputs, dt
            ),
            channel,
            gains,
        )

    def missed(self, loop: LPVStateSpace, channel: Channel = "gust") -> Array:
        """[A B] of the exact loop minus that of `loop` at the models in between, (K, nx, nx +
        nu).
        """
        family = self.between if loop.dt is None else self.between.discretize(loop.dt)
        exact = close(family.interpolate("linear"), channel)
        there, here = (
            np.concatenate(model.matrices(family.airspeeds)[:2], axis=2) for model in (exact, loop)
        )
        return there - here


def _family(heli: Helicopter, airspeeds: Sequence[float] | Array, head_wind: float) -> LinearFamily:
    wind = (-head_wind, 0.0, 0.0)
    return symheli.sweep(heli, airspeeds, wind=wind, inputs=INPUTS).select(LATERAL.states, INPUTS)  # type: ignore[arg-type]
