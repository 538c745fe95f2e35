"""Linear models over airspeed and other quantities."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.interpolation import Kind, interpolated
from symheli.lpv.linear_family import AIRSPEED, LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Rates
from symheli.values.arrays import Array, frozen
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal
from symheli.values.summary import as_table, summarized

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class LinearGrid:
    """Linear models at every combination of the `values` (n1, n2, ...) of d `axes`.

    Parameters
    ----------
    axes : sequence of Signal
        What varies, with units; the first is usually the airspeed.
    values : sequence of array_like
        Increasing values of each axis, in its unit.
    models : sequence of LinearModel
        n1 n2 ... models with equal names and sample period, the last axis running fastest; with
        their operating points or without.

    Raises
    ------
    InputError
        Wrong numbers of values or models, values that do not increase, models that differ in names.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> grid = symheli.sweep_grid(heli, [4.0, 6.0], acceleration=[-2.0, 0.0, 2.0])
    >>> grid.A.shape
    (2, 3, 10, 10)
    >>> lpv = grid.interpolate(degree=1)
    >>> [(s.name, s.rate) for s in lpv.parameters]
    [('airspeed', 'acceleration'), ('acceleration', inf)]
    """

    axes: tuple[Signal, ...]
    values: tuple[Array, ...]
    models: LinearModels

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        axes = tuple(a if isinstance(a, Signal) else Signal(a) for a in self.axes)
        object.__setattr__(self, "axes", axes)
        if len(self.values) != len(axes) or len(set(axes)) < len(axes):
            raise InputError(
                f"expected values for each of different axes, got {len(self.values)} sets for"
                f" {', '.join(axes)}"
            )
        values = tuple(frozen(v, str(a), (None,)) for a, v in zip(axes, self.values, strict=True))
        object.__setattr__(self, "values", values)
        for axis, nodes in zip(axes, values, strict=True):
            if not len(nodes) or np.any(np.diff(nodes) <= 0):
                raise InputError(f"{axis}: expected increasing values, got {nodes.tolist()}")
        if len(self.models) != math.prod(self.shape):
            raise InputError(
                f"expected {math.prod(self.shape)} models, one a combination of the values, got"
                f" {len(self.models)}"
            )
        object.__setattr__(self, "models", LinearModels.of(self.models))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(len(nodes) for nodes in self.values)

    @property
    def airspeeds(self) -> Array:
        """Values of the airspeed, m/s; raises `UnknownNameError` where it is no axis."""
        return self.values[self._axis(AIRSPEED)]

    @property
    def states(self) -> tuple[Signal, ...]:
        """States with units."""
        return self.models.states

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Inputs with units."""
        return self.models.inputs

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Outputs with units."""
        return self.models.outputs

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.models.dt

    @property
    def A(self) -> Array:
        """(n1, n2, ..., nx, nx)."""
        return self._stacked("A")

    @property
    def B(self) -> Array:
        """(n1, n2, ..., nx, nu)."""
        return self._stacked("B")

    @property
    def C(self) -> Array:
        """(n1, n2, ..., ny, nx)."""
        return self._stacked("C")

    @property
    def D(self) -> Array:
        """(n1, n2, ..., ny, nu)."""
        return self._stacked("D")

    def at(self, *index: int) -> LinearModel:
        """The model at these positions along the axes."""
        return self.models[int(np.ravel_multi_index(index, self.shape))]

    def trim(self, *index: int) -> OperatingPoint | None:
        """Its operating point, None where none is known."""
        return self.at(*index).point

    def family(self, **fixed: float) -> LinearFamily:
        """The models over one axis at one value of every other, as in family(mass=8.2); it must be
        on the grid.
        """
        left = [a for a in self.axes if a not in fixed]
        if len(left) != 1 or len(fixed) != len(self.axes) - 1:
            usual = AIRSPEED if AIRSPEED in self.axes else self.axes[0]
            others = [a for a in self.axes if a != usual]
            raise UnknownNameError("axes", ", ".join(fixed) or "(none)", [", ".join(others)])
        index: list[int | slice] = [slice(None)] * len(self.axes)
        for name, value in fixed.items():
            index[self._axis(name)] = self._position(name, value)
        chosen = np.arange(len(self.models)).reshape(self.shape)[tuple(index)]
        along = self.values[self._axis(left[0])]
        return LinearFamily.from_models(along, self.models.at(chosen), parameter=left[0])

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearGrid:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs."""
        return replace(self, models=self.models.select(states, inputs, outputs))

    def residualize(self, states: Sequence[str]) -> LinearGrid:
        """Remove these states by setting their derivatives to zero, continuous time only."""
        return replace(self, models=self.models.each(lambda model: model.residualize(states)))

    def discretize(self, dt: float) -> LinearGrid:
        """Zero-order-hold equivalent of each model at sample period `dt` (s)."""
        return replace(self, models=self.models.each(lambda model: model.discretize(dt)))

    def interpolate(
        self,
        kind: Kind = "polynomial",
        degree: int | Sequence[int] = 3,
        *,
        rate: Rates | None = None,
    ) -> LPVStateSpace:
        """Element-wise interpolation of every entry over all axes.

        As `LinearFamily.interpolate`, with products of its functions; `degree` one for all axes or
        one each. `rate`: one for all axes, one each or {axis: rate}, in the unit of the axis per
        second, or the name of the axis that is the rate; None: as fast as they like, but an
        airspeed beside an acceleration changes as that says.
        """
        return interpolated(self.models, self.axes, self.values, kind, degree, rate)

    def plot(self, ax: Axes | None = None, entries: Sequence[str] | None = None) -> Axes:
        """Entries such as "A[q, u]" over airspeed (without one: over the first axis), a curve a
        combination of the other axes' values, paler the earlier it comes; each entry by its largest
        magnitude on the grid, which the legend gives; default the diagonal of A. Returns the axes;
        raises `UnknownNameError` for an entry that is not there.
        """
        from symheli.lpv.entry_plot import plot_grid

        return plot_grid(ax, self, entries)

    def to_frame(self) -> pandas.DataFrame:
        """A row a model by the values of the axes, a column an entry A[q, u] ..., their units in
        attrs["units"]. Raises `InputError` without pandas.
        """
        from symheli.lpv.labelled_models import models_frame

        return models_frame(list(zip(self.axes, self.values, strict=True)), self, self)

    def to_xarray(self) -> xarray.Dataset:
        """A, B, C, D over the axes, "equation", "state", "input" and "output", and x0, u0 where the
        trims are known. Raises `InputError` without xarray.
        """
        from symheli.lpv.labelled_models import models_dataset

        axes = list(zip(self.axes, self.values, strict=True))
        return models_dataset(axes, self, self, self.models.points)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the models with names, units and trims, as JSON or NPZ by the ending of the name,
        in the form `symheli.lpv.family_file` describes; every number exact. Raises `SymheliError`
        where the file cannot be written.
        """
        from symheli.lpv.family_file import Content, write

        return write(Content(self.axes, self.values, self.models, {}), path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LinearGrid:
        """Load the models from a file written by `save` or another program. Raises `InputError` for
        any other file.
        """
        from symheli.lpv.family_file import read

        found = read(path)
        return cls(found.axes, found.values, found.models)

    def _stacked(self, name: str) -> Array:
        every = getattr(self.models, name)
        return every.reshape(*self.shape, *every.shape[1:])

    def _axis(self, name: str) -> int:
        if name not in self.axes:
            raise UnknownNameError("axis", name, list(map(str, self.axes)))
        return self.axes.index(Signal(name))

    def _position(self, name: str, wanted: float) -> int:
        axis = self._axis(name)
        nodes, unit = self.values[axis], self.axes[axis].unit
        miss = np.abs(nodes - wanted)
        # the same number, rounded otherwise
        if not miss.min() <= 1e-9 * max(abs(wanted), np.ptp(nodes)):
            raise InputError(
                f"{name} = {wanted} {unit} is not on the grid: {', '.join(f'{v:g}' for v in nodes)}"
            )
        return int(miss.argmin())
