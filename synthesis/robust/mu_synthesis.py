"""Robust output feedback at one point by D-K iteration: the structured singular value of the loop.

In turns a controller is designed for the plant between scalings D(s) and their inverses, and the
scalings that make the response of its loop the smallest are found frequency by frequency and
fitted. What the last loop is worth is proven for all frequencies, as margins of several blocks are,
if the loop has few states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import optimize

from symheli import LFT, LinearModel
from symheli.errors import InputError
from symheli.lpv import series
from symheli.lpv.linear_model import as_model
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.design.lti.hinf import hinf
from synthesis.design.lti.point_design import PointDesign, named_loop
from synthesis.design.plant.generalized import Channels, Generalized, sampled_controller
from synthesis.numerics.linear.norm import to_continuous
from synthesis.robust import witness
from synthesis.robust.covers import rational
from synthesis.robust.intervals import LevelProof
from synthesis.robust.structure import BlockLoop, DynamicBlock, Part, behind, channels_of, loop_of
from synthesis.robust.upper_bound import Upper, proven_level

FREQUENCIES = 80
"""Frequencies at which scalings are found, over the poles of plant and controller and a decade
beyond.
"""
BACK_OFF = 1.002
"""Level of a design by the least of its scaled plant."""
NEAR = 1e-4
"""Weight of the squared step, in logarithms, of scalings from one frequency to the next: where they
do not matter they stay.
"""
GAINED = 1e-3
"""Relative decrease of the level below which an iteration has gained nothing; the second such one
ends the search.
"""
FAR = 3.0
"""Step of the scalings towards those found for the last loop, from the second iteration on: near
the end these are close, and plain steps many (1.0: plain ones).
"""


LIMIT, FITS = 30.0, 400
"""Largest logarithm of a coefficient of a filter, evaluations of a fit."""
NOT_SAMPLED = "the controller of the continuous plant has no sampled one: it would not be causal"


MAX_PROVEN_STATES = 24
"""Number of states of a loop up to which `mu` is proven: that of 44 states of the distillation
column takes over ten minutes.
"""


@dataclass(frozen=True, eq=False)
class MuDesign:
    """A controller u = K y with a bound `mu` of the structured singular value of its loop: blocks
    and performance within 1/mu of what was stated keep a gain of mu.

    `mu` is proven for all frequencies where `verified`. Of a loop of more than 24 states it is the
    peak at the frequencies of the design, and computed.

    Parameters
    ----------
    controller : LinearModel or None
        K from measurements to controls, with positive feedback; None where no design was found.
    mu : float
        The bound; inf without a controller.
    omega : float
        The frequency that decides it, rad/s; NaN where `mu` is not proven.
    levels : tuple of float
        The least level found at the frequencies looked at, of the loop of each iteration.
    scalings : tuple of LinearModel
        D of each part for which the controller was designed: parameters, blocks, performance.
    reasons : tuple of str
        Why there is no controller.
    proof : LevelProof, optional
        The numbers that `mu` rests on; None where it is inf or computed.
    asked : tuple, optional
        Model, controls, measurements and blocks.
    """

    controller: LinearModel | None
    mu: float
    omega: float
    levels: tuple[float, ...]
    scalings: tuple[LinearModel, ...]
    reasons: tuple[str, ...] = ()
    proof: LevelProof | None = None
    asked: tuple[LFT, Sequence[str], Sequence[str], Sequence[DynamicBlock]] | None = None

    __repr__ = summarized

    @property
    def verified(self) -> bool:
        """Whether there is a proof, which was checked in exact arithmetic as it was found."""
        return self.proof is not None

    def verify(self, rigorous: bool = False) -> bool:
        """Check the proof of `mu` again in exact arithmetic, from the plant, its blocks and the
        controller; `rigorous`: and the inequality at single frequencies, by a second writing of it.
        """
        if self.proof is None or self.asked is None or self.controller is None:
            return False
        loop, level = (
            _Plant.of(*self.asked).loop.in_rationals.behind(self.controller),
            self.proof.bound,
        )
        if level is None or self.proof.performance or level > self.mu:
            return False
        return self.proof.verified(loop) and (
            not rigorous or witness.level_is_kept(self.proof, loop)
        )


@with_one_thread
def mu_synthesis(
    model: LinearModel | LFT,
    controls: Sequence[str],
    measurements: Sequence[str],
    blocks: Sequence[DynamicBlock] = (),
    *,
    order: int = 4,
    iterations: int = 8,
) -> MuDesign:
    """Design the output feedback of one model for its uncertain blocks and constant parameters, by
    D-K iteration.

    D is one stable filter with a stable inverse a block and a parameter, times the identity: of a
    parameter that is repeated a full matrix, and that it is real, count in the proof alone. The
    iteration need not end at the least mu.

    Parameters
    ----------
    model : LinearModel, system of python-control or LFT
        From disturbances, block inputs and controls to performance, block outputs and measurements;
        the parameters of an LFT are constant and not known.
    controls, measurements : sequence of str
        Inputs that the controller commands, outputs that it reads. What belongs to no block besides
        is the performance.
    blocks : sequence of DynamicBlock
        The unknown dynamics, with their bounds and weights.
    order : int
        Number of states of each filter, even; 0: constants.
    iterations : int
        Largest number of designs.

    Returns
    -------
    MuDesign
        The best loop of all iterations, of the order of the plant, its weights and twice its
        scalings: `symheli.lpv.balanced_truncation` makes it smaller, `robust_margin` proves what is
        left. Where no design was found, `reasons`.

    Raises
    ------
    InputError
        As of `robust_margin`; an order that is odd, a number below 1.
    UnknownNameError
        A signal that the model does not have.

    References
    ----------
    `musyn` of MATLAB; Skogestad and Postlethwaite, Multivariable Feedback Control (2005), sec.
    8.12; Packard and Doyle, Automatica 29 (1993).

    Examples
    --------
    x' = u + w, of which a tenth of u is not known; y = x + n, z = (x, u):

    >>> from symheli import LinearModel
    >>> plant = LinearModel(
    ...     [[0.0]], [[1.0, 1.0, 0.0, 1.0]], [[0.0], [1.0], [0.0], [1.0]],
    ...     [[0, 0, 0, 0.1], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],
    ...     ["x"], ["d", "w", "n", "u"], ["v", "z", "cost", "y"])
    >>> design = mu_synthesis(plant, ["u"], ["y"], [DynamicBlock("d", "v")], order=2, iterations=2)
    >>> print(f"{design.levels[0]:.2f}, then {design.mu:.2f}", design.controller.is_stable())
    1.74, then 1.49 True
    """
    order, iterations = whole(order, "order", 0), whole(iterations, "iterations", 1)
    if order % 2:
        raise InputError(f"order: expected an even number of states, got {order}")
    if not isinstance(model, LFT):
        model = LFT.constant(as_model(model))
    plant = _Plant.of(model, controls, measurements, blocks)
    D = tuple(_Filter.one(order, plant.pace) for _ in plant.parts)
    best, levels, reasons = (math.inf, None, D), [], ()
    for _ in range(iterations):
        design = plant.designed(D)
        if design.controller is None:
            reasons = design.reasons
            break
        loop = plant.closed(design.controller)
        omega = _frequencies(loop)
        values, x = _scalings(loop, omega)
        levels.append(float(values.max()))
        gained = levels[-1] < best[0] * (1 - GAINED)
        if levels[-1] < best[0]:
            best = levels[-1], design.controller, D
        if not gained and len(levels) - np.argmin(levels) > 2:
            break
        count = values / values.max()
        far = FAR if len(levels) > 1 else 1.0
        D = tuple(
            own.fitted(omega, own.logarithm(omega) + far * (each - own.logarithm(omega)), count)
            for own, each in zip(D, x.T, strict=True)
        )
    level, K, D = best
    if K is None:
        return MuDesign(None, math.inf, math.nan, tuple(levels), (), tuple(reasons))
    found = plant.named(K)
    if found is None:
        return MuDesign(None, math.inf, math.nan, tuple(levels), (), (NOT_SAMPLED,))
    proven = plant.proven(K, found, level)
    omega, filters = plant.loop.frequency(proven.omega), tuple(d.model() for d in D)
    asked = model, controls, measurements, blocks
    return MuDesign(
        found, proven.level, omega, tuple(levels), filters, proof=proven.proof, asked=asked
    )


class _Plant(NamedTuple):
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
    ) -> _Plant:
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
        ends = np.cumsum([(0, 0), *((_size(p.rows), _size(p.columns)) for p in parts)], axis=0)
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

    def designed(self, D: Sequence[_Filter]) -> PointDesign:
        """Return the H-infinity design of the plant between D and its inverse."""
        A, B, C, E = self.loop[:4]
        pairs = list(zip(D, self.parts, strict=True))
        out = [d.model() for d, part in pairs for _ in range(_size(part.rows))]
        into = [d.inverse() for d, part in pairs for _ in range(_size(part.columns))]
        A, B, C, E = behind(A, B, C, E, out, None)
        A, C, B, E = (M.T for M in behind(A.T, C.T, B.T, E.T, into, None))
        scaled = self._model(A, B, C, E)
        return hinf(scaled, self.controls, self.measurements, back_off=BACK_OFF)

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


class _Filter(NamedTuple):
    """d(s) = gain times the product of (s^2 + a s + b)/(s^2 + c s + e), all > 0, s in units of
    `pace`: stable, with a stable inverse.
    """

    gain: float
    quadratics: Array
    pace: float

    @classmethod
    def one(cls, order: int, pace: float) -> _Filter:
        """Return the filter 1 with poles and zeros spread over four decades about the pace."""
        at = np.logspace(-2, 2, order // 2 + 2)[1:-1]
        return cls(1.0, np.column_stack([2 * at, at**2, 2 * at, at**2]), pace)

    def fitted(self, omega: Array, x: Array, count: Array) -> _Filter:
        """Return the filter with |d| closest to exp(x) at these frequencies, weighed by `count`."""
        if not len(self.quadratics):
            return self._replace(gain=math.exp(np.average(x, weights=count)))
        level, root = np.average(x, weights=count), np.sqrt(count)
        spread = self.one(2 * len(self.quadratics), self.pace).quadratics
        starts = (
            np.r_[math.log(self.gain), np.log(self.quadratics).ravel()],
            np.r_[level, np.log(spread).ravel()],
        )

        def misfit(own: Array) -> Array:
            return root * (self._of(own).logarithm(omega) - x)

        def slope(own: Array) -> Array:
            return root[:, None] * self._of(own).slopes(omega)

        found = [
            optimize.least_squares(misfit, own, slope, (-LIMIT, LIMIT), max_nfev=FITS)  # type: ignore[arg-type]
            for own in starts
        ]
        return self._of(min(found, key=lambda f: f.cost).x)

    def _of(self, own: Array) -> _Filter:
        return self._replace(gain=math.exp(own[0]), quadratics=np.exp(own[1:]).reshape(-1, 4))

    def logarithm(self, omega: Array) -> Array:
        """Return log |d(j omega)|."""
        s = 1j * omega[:, None] / self.pace
        a, b, c, e = self.quadratics.T
        each = np.log(np.abs(s * s + a * s + b)) - np.log(np.abs(s * s + c * s + e))
        return math.log(self.gain) + each.sum(axis=1)

    def slopes(self, omega: Array) -> Array:
        """Return the derivatives (K, 1 + coefficients) of that by the logarithms of the gain and
        the coefficients.
        """
        s = 1j * omega[:, None] / self.pace
        a, b, c, e = self.quadratics.T
        above, below = s * s + a * s + b, s * s + c * s + e
        each = np.real(np.stack([a * s / above, b / above, -c * s / below, -e / below], axis=2))
        return np.column_stack([np.ones(len(omega)), each.reshape(len(omega), -1)])

    def model(self) -> LinearModel:
        """Return the filter as a linear model of one input and output."""
        found = LinearModel.gain([[self.gain]], ["in"], ["out"])
        for a, b, c, e in self.quadratics:
            found = series(found, rational(np.array([1.0, a, b]), np.array([1.0, c, e]), self.pace))
        return found

    def inverse(self) -> LinearModel:
        """Return 1/d as a linear model."""
        return self._replace(
            gain=1 / self.gain, quadratics=self.quadratics[:, [2, 3, 0, 1]]
        ).model()


def _frequencies(loop: BlockLoop) -> Array:
    paces = loop.paces
    return np.geomspace(paces[0] / 10, 10 * paces[-1], FREQUENCIES)


def _scalings(loop: BlockLoop, omega: Array) -> tuple[Array, Array]:
    """Return (levels, x): the largest singular value (K,) of D M D^-1 at each frequency with the
    best D = exp(x) found, x (K, parts), 0 of the last part.
    """
    rows, columns = (
        np.repeat(np.arange(len(loop.parts)), [_size(getattr(p, side)) for p in loop.parts])
        for side in ("rows", "columns")
    )
    free, before = len(loop.parts) - 1, np.zeros(len(loop.parts) - 1)
    levels, found = [], []
    for M in loop.responses(omega):

        def size(x: Array, M: Array = M, before: Array = before) -> tuple[float, Array]:
            whole = np.r_[x, 0.0]
            left, values, right = np.linalg.svd(np.exp(whole[rows, None] - whole[columns]) * M)
            slope = np.bincount(rows, np.abs(left[:, 0]) ** 2, free + 1)
            slope -= np.bincount(columns, np.abs(right[0]) ** 2, free + 1)
            near = x - before
            return float(math.log(values[0]) + NEAR * near @ near), slope[:free] + 2 * NEAR * near

        if free:
            before = optimize.minimize(size, before, jac=True, method="BFGS").x
        whole = np.r_[before, 0.0]
        levels.append(np.linalg.norm(np.exp(whole[rows, None] - whole[columns]) * M, 2))
        found.append(whole)
    return np.array(levels), np.array(found)


def _size(part: slice) -> int:
    return part.stop - part.start
