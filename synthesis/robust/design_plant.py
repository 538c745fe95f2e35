"""The plant of a robust design: parts first, controls and measurements last, continuous."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symheli import LFT, LinearModel
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from synthesis.design.lti.hinf import hinf
from synthesis.design.lti.point_design import PointDesign, named_loop
from synthesis.design.plant.generalized import Channels, Generalized, sampled_controller
from synthesis.numerics.linear.norm import to_continuous
from synthesis.robust.exact_loop import Part
from synthesis.robust.filters import Filter
from synthesis.robust.structure import BlockLoop, DynamicBlock, behind, channels_of, loop_of
from synthesis.robust.upper_bound import Upper, proven_level

BACK_OFF = 1.002
"""Level of a design by the least of its scaled plant."""
MAX_PROVEN_STATES = 24
"""Number of states of a loop up to which `mu` is proven: that of 44 states of the distillation
column takes over ten minutes.
"""

Asked = tuple[LFT, Sequence[str], Sequence[str], Sequence[DynamicBlock]]
"""Model, controls, measurements and blocks."""


class DesignPlant(NamedTuple):
    """The plant of all parts, continuous, from (w, u) to (z, y)."""

    loop: BlockLoop
    parts: tuple[Part, ...]
    controls: tuple[Signal, ...]
    measurements: tuple[Signal, ...]

    @classmethod
    def of(
        cls,
        model: LFT,
        controls: Sequence[str],
        measurements: Sequence[str],
        blocks: Sequence[DynamicBlock],
    ) -> DesignPlant:
        """Return the plant with the parts first, controls and measurements last."""
        if not (model.order or blocks):
            raise InputError("nothing is uncertain: hinf designs for one model that is known")
        path = DynamicBlock(controls, measurements)
        (columns,), (rows,) = channels_of(model, [path])
        loop = loop_of(model, [*blocks, path], performance=True)
        k = loop.reals + len(blocks)
        parts = (*loop.parts[:k], *loop.parts[k + 1 :])
        into, out = (
            np.r_[tuple(np.r_[getattr(p, side)] for p in (*parts, loop.parts[k]))]
            for side in ("columns", "rows")
        )
        own = loop.in_rationals.select(into, out)
        # a design in coordinates of the modes loses levels: its Riccati equations are worse
        # conditioned there
        A, B, C, D = own.nearest()
        if loop.dt is not None:
            A, B, C, D = to_continuous(A, B, C, D)
        moved = loop._replace(A=A, B=B, C=C, D=D, exact=own)
        ends = np.cumsum([(0, 0), *((size_of(p.rows), size_of(p.columns)) for p in parts)], axis=0)
        own = tuple(
            Part(slice(a, b), slice(c, d), part.real)
            for part, (a, c), (b, d) in zip(
                parts, ends[:-1].tolist(), ends[1:].tolist(), strict=True
            )
        )
        return cls(
            moved,
            own,
            tuple(model.inputs[i] for i in columns),
            tuple(model.outputs[i] for i in rows),
        )

    @property
    def pace(self) -> float:
        """Mean frequency of the poles, rad/s of the continuous plant."""
        paces = self.loop.paces
        return math.exp(np.log(paces).mean()) if len(paces) else 1.0

    def designed(self, D: Sequence[Filter]) -> PointDesign:
        """Return the H-infinity design of the plant between D and its inverse."""
        A, B, C, E = self.loop[:4]
        pairs = list(zip(D, self.parts, strict=True))
        out = [d.model() for d, part in pairs for _ in range(size_of(part.rows))]
        into = [d.inverse() for d, part in pairs for _ in range(size_of(part.columns))]
        A, B, C, E = behind(A, B, C, E, out, None)
        A, C, B, E = (M.T for M in behind(A.T, C.T, B.T, E.T, into, None))
        scaled = self._model(A, B, C, E)
        return hinf(scaled, self.controls, self.measurements, back_off=BACK_OFF)

    def asking(self, gain: float) -> DesignPlant:
        """Return the plant whose performance is in units of a gain."""
        rows = np.ones(len(self.loop.C))
        rows[self.parts[-1].rows] /= gain
        loop = self.loop._replace(C=rows[:, None] * self.loop.C, D=rows[:, None] * self.loop.D)
        return self._replace(loop=loop)

    def known(self) -> PointDesign:
        """Return the H-infinity design without the uncertain parts."""
        nu, ny = len(self.controls), len(self.measurements)
        width, height = self.loop.B.shape[1] - nu, len(self.loop.C) - ny
        own = self.parts[-1]
        into = np.r_[np.r_[own.columns], width : width + nu]
        out = np.r_[np.r_[own.rows], height : height + ny]
        A, B, C, D = self.loop[:4]
        model = self._model(A, B[:, into], C[out], D[np.ix_(out, into)])
        return hinf(model, self.controls, self.measurements, back_off=BACK_OFF)

    def _model(self, A: Array, B: Array, C: Array, D: Array) -> LinearModel:
        nw, nz = B.shape[1] - len(self.controls), len(C) - len(self.measurements)
        names = [
            [Signal(f"{letter}_{i}") for i in range(n)]
            for letter, n in (("mu_x", len(A)), ("mu_w", nw), ("mu_z", nz))
        ]
        inputs, outputs = (*names[1], *self.controls), (*names[2], *self.measurements)
        return LinearModel(A, B, C, D, tuple(names[0]), inputs, outputs)

    def closed(self, K: LinearModel) -> BlockLoop:
        """Return the loop of the parts behind a controller, continuous."""
        model = self._model(*self.loop[:4])
        names = Channels.of(model, self.controls, self.measurements, None, None)
        one = named_loop(Generalized.between(model, names), K, names)
        return self.loop._replace(A=one.A, B=one.B, C=one.C, D=one.D, parts=self.parts)

    def proven(self, K: LinearModel, named: LinearModel, level: float) -> Upper:
        """Return what is proven, from a level on, of the loop behind a controller; of too many
        states that level without a proof. `named` is the controller of the model itself.
        """
        loop = self.closed(K)._replace(exact=self.loop.in_rationals.behind(named))
        if len(loop.A) > MAX_PROVEN_STATES:
            return Upper(level, math.nan, None)
        return proven_level(loop, level, performance=False)

    def named(self, K: LinearModel) -> LinearModel | None:
        """Return the controller of the model itself; None where that has none of this kind."""
        gains = K.A, K.B, K.C, K.D
        if self.loop.dt is not None:
            gains = sampled_controller(*gains)
        if gains is None:
            return None
        states = tuple(Signal(f"controller_{i + 1}") for i in range(len(gains[0])))
        return LinearModel(*gains, states, self.measurements, self.controls, self.loop.dt)


def size_of(part: slice) -> int:
    """Return the number of channels of a part."""
    return part.stop - part.start
