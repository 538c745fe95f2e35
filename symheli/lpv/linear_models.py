"""Many linear models with equal names, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import overload

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel, selected
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.operating_points import ListedPoints, OperatingPoints
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class LinearModels(Sequence[LinearModel]):
    """K linear models with equal names and sample period; models[k] is one of them.

    Parameters
    ----------
    A, B, C, D : array (K, nx, nx), (K, nx, nu), (K, ny, nx), (K, ny, nu)
        SI units and radians.
    states, inputs, outputs : tuple of Signal
        Strings that carry their unit.
    dt : float, optional
        Sample period, s; None: continuous.
    points : OperatingPoints
        What x and u of each are measured from; empty where it is not known.

    Raises
    ------
    InputError
        Shapes that do not fit, another number of operating points.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None
    points: OperatingPoints = field(default_factory=ListedPoints)

    __repr__ = summarized

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        nx, nu, ny = len(self.states), len(self.inputs), len(self.outputs)
        K = len(frozen(self.A, "A", (None, nx, nx)))
        shapes = {"A": (K, nx, nx), "B": (K, nx, nu), "C": (K, ny, nx), "D": (K, ny, nu)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        if self.dt is not None:
            positive(self.dt, "dt")
        if len(self.points) not in (0, K):
            raise InputError(
                f"expected {K} trims, one a model, or none at all, got {len(self.points)}"
            )

    @classmethod
    def of(cls, models: Sequence[LinearModel]) -> LinearModels:
        """Return these models as one stack; all with their operating point, or none."""
        if isinstance(models, LinearModels):
            return models
        if not len(models):
            raise InputError("expected at least one model, got none")
        first = models[0]
        names = first.states, first.inputs, first.outputs, first.dt
        for k, model in enumerate(models):
            if (model.states, model.inputs, model.outputs, model.dt) != names:
                raise InputError(
                    f"models[{k}]: expected states, inputs, outputs and dt of models[0]; select or"
                    " discretize first"
                )
        A, B, C, D = (np.stack([getattr(model, name) for model in models]) for name in "ABCD")
        points = OperatingPoints.of([model.point for model in models if model.point])
        return cls(A, B, C, D, *names, points)

    def __len__(self) -> int:
        return len(self.A)

    @overload
    def __getitem__(self, k: int) -> LinearModel: ...
    @overload
    def __getitem__(self, k: slice) -> tuple[LinearModel, ...]: ...
    def __getitem__(self, k: int | slice) -> LinearModel | tuple[LinearModel, ...]:
        if isinstance(k, slice):
            return tuple(self[i] for i in range(*k.indices(len(self))))
        return LinearModel(
            self.A[k],
            self.B[k],
            self.C[k],
            self.D[k],
            self.states,
            self.inputs,
            self.outputs,
            self.dt,
            self.points[k] if self.points else None,
        )

    def take(self, which: Array) -> LinearModels:
        """The models at these positions."""
        points = [self.points[k] for k in which.tolist()] if self.points else ()
        return replace(
            self,
            A=self.A[which],
            B=self.B[which],
            C=self.C[which],
            D=self.D[which],
            points=OperatingPoints.of(points),
        )

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearModels:
        """Select states, inputs and outputs as `LinearModel.select`."""
        return selected(self, states, inputs, outputs)

    def each(self, change: Callable[[LinearModel], LinearModel]) -> LinearModels:
        """Every model changed."""
        return LinearModels.of([change(model) for model in self])
