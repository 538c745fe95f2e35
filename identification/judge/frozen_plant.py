"""The plant of a loop as an identified model has it, with the scheduling held: the estimate, draws
of its coefficients, and the loop around them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from identification.model.state_space_model import StateSpaceModel
from identification.structure.lpvarx import LPVARX
from identification.structure.state_space import StateSpace
from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import stability_margin
from symheli.lpv.stability_margin import Feedback, as_controller, closed_loop
from symheli.lpv.tools import LinearModels, nu_gaps
from symheli.values.arrays import Array
from symheli.values.numbers import finite

Model = LPVARXModel | KinematicModel | StateSpaceModel

Point = float | tuple[float, ...]
"""A value of the scheduling: a number, or one a parameter."""


def tuples(points: Iterable[Point]) -> list[tuple[float, ...]]:
    """Return the points as tuples of one number a parameter; raises `InputError` for none, or for
    one that is no number.
    """
    given = [p if isinstance(p, tuple) else (p,) for p in points]
    chosen = [tuple(finite(value, "points") for value in p) for p in given]
    if not chosen:
        raise InputError("points: give at least one value of the scheduling")
    return chosen


def with_covariance(model: Model) -> str:
    """What to do for a covariance of such a model."""
    if isinstance(model, StateSpaceModel):
        return 'fit by "oe" or "innovations"'
    return "fit by FilterError or least squares"


@dataclass(frozen=True, eq=False)
class FrozenPlant:
    """`outputs` and `inputs` of a model; of known kinematics only the states that stay with them,
    as `KinematicModel.to_state_space` keeps them.

    Raises `UnknownNameError` for a signal the model does not have.
    """

    model: Model
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def __post_init__(self) -> None:
        for kind, names, known in (
            ("output", self.outputs, self.model.outputs),
            ("input", self.inputs, self.model.inputs),
        ):
            for name in names:
                if name not in known:
                    raise UnknownNameError(f"{kind} of the plant", name, known)

    def at(self, *p: float) -> LinearModel:
        """Discrete, with the scheduling held at p."""
        if isinstance(self.model, KinematicModel):
            return self.model.at(*p, outputs=self.outputs, inputs=self.inputs)
        return self.model.at(*p).select(inputs=self.inputs, outputs=self.outputs)

    def of_each(self, thetas: Array, *p: float) -> LinearModels:
        """The plants of coefficients (K, n, ny) in the place of the model's, at p."""
        return LinearModels.of(
            [replace(self, model=self.model.with_theta(t)).at(*p) for t in thetas]
        )

    @property
    def regression(self) -> LPVARX:
        """The structure whose coefficients theta are; of states the difference equation in the same
        signals.
        """
        structure = self.model.structure
        if isinstance(structure, StateSpace):
            return structure.regression
        return structure if isinstance(structure, LPVARX) else structure.aerodynamics

    @property
    def free(self) -> Array:
        """(n, ny), true where a coefficient is not zero by structure; all unknowns of states."""
        if isinstance(self.model, StateSpaceModel):
            return np.ones(self.model.theta.shape, bool)
        return self.regression.free


@dataclass(frozen=True, eq=False)
class AtPoint:
    """The estimate, its draws and its loop with the scheduling held at `p`."""

    plant: FrozenPlant
    p: Point
    feedback: Feedback
    scales: Mapping[str, float]
    thetas: Array | None
    covariance: Array | None
    second: tuple[FrozenPlant, ...]

    @cached_property
    def sizes(self) -> dict[str, Any]:
        """Sizes as `nu_gap` takes them."""
        return {
            "input_scale": np.array([self.scales[u] for u in self.plant.inputs]),
            "output_scale": np.array([self.scales[y] for y in self.plant.outputs]),
        }

    @property
    def _values(self) -> tuple[float, ...]:
        return self.p if isinstance(self.p, tuple) else (self.p,)

    @cached_property
    def estimate(self) -> LinearModel:
        """The plant of the model."""
        return self.plant.at(*self._values)

    @cached_property
    def drawn(self) -> LinearModels | None:
        """The plants of the draws; None without a covariance."""
        return None if self.thetas is None else self.plant.of_each(self.thetas, *self._values)

    @cached_property
    def margin(self) -> float:
        """b(P, C) of the estimate; 0 where its loop is unstable."""
        return stability_margin(self.estimate, self.feedback, **self.sizes)

    def gaps_to(self, others: Sequence[LinearModel]) -> Array:
        """nu-gaps (K,) from the estimate, signals by name."""
        each = [
            other.select(inputs=self.estimate.inputs, outputs=self.estimate.outputs)
            for other in others
        ]
        return nu_gaps(self.estimate, LinearModels.of(each), **self.sizes)

    @cached_property
    def drawn_gaps(self) -> Array:
        """nu-gaps (K,) to the draws, NaN without any."""
        if self.drawn is None:
            return np.array([np.nan])
        return nu_gaps(self.estimate, self.drawn, **self.sizes)

    @cached_property
    def second_gap(self) -> float:
        """The largest to another estimate, NaN without one."""
        if not self.second:
            return float("nan")
        return float(self.gaps_to([other.at(*self._values) for other in self.second]).max())

    @cached_property
    def lost(self) -> float:
        """Share of the draws around which the loop is unstable. Those nearer than the margin are
        stable by the theorem, the others are looked at.
        """
        if self.drawn is None:
            return float("nan")
        far = np.flatnonzero(self.drawn_gaps >= self.margin)
        return sum(not self.stable(self.drawn[int(k)]) for k in far) / len(self.drawn)

    def stable(self, plant: LinearModel) -> bool:
        """Whether the loop around another plant is."""
        A = self._closed(plant)[0]
        return bool(np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1)

    def gain_errors(self, others: Iterable[LinearModel], in_loop: bool) -> Array:
        """Largest singular values (K,) of static gains less that of the estimate, as shares of the
        latter's.
        """
        per = 1 / self.sizes["output_scale"][:, None] * self.sizes["input_scale"]
        mine = self._static(self.estimate, in_loop) * per
        theirs = np.array([self._static(m, in_loop) * per for m in others])
        return np.linalg.norm(theirs - mine, 2, (1, 2)) / np.linalg.norm(mine, 2)

    def _static(self, plant: LinearModel, in_loop: bool) -> Array:
        """Outputs per input at frequency zero, open or with the input added to the feedback."""
        A, B, C, D = plant.A, plant.B, plant.C, plant.D
        if in_loop:
            ny = len(plant.outputs)
            A, B, C, D = self._closed(plant)
            B, C, D = B[:, ny:], C[:ny], D[:ny, ny:]
        return C @ np.linalg.solve(np.eye(len(A)) - A, B) + D

    def _closed(self, plant: LinearModel) -> tuple[Array, Array, Array, Array]:
        return closed_loop(plant, as_controller(self.feedback, plant))


def worst(values: Array, at: Sequence[AtPoint]) -> tuple[float, str]:
    """The largest value over the points and where it stands; NaN where one is."""
    k = int(np.argmax(values))  # the first NaN, if there is one
    return float(values[k]), f"p = {text(at[k].p)}"


def text(p: Point) -> str:
    """A value of the scheduling in four digits."""
    return f"{p:.4g}" if np.isscalar(p) else ", ".join(f"{v:.4g}" for v in p)  # type: ignore[union-attr]
