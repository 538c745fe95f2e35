"""Linear models over airspeed, or any other parameters, and their element-wise interpolation."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.entries import entry_called
from symheli.lpv.interpolation import Kind, interpolated
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Rates
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.operating_points import OperatingPoints
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

AIRSPEED = Signal("airspeed", "m/s")


@dataclass(frozen=True, eq=False)
class LinearFamily:
    """A linear family holds linear models at every combination of the `values` (n1, n2, ...) of one
    or more `axes`.

    family[k] is a model of a family over one axis and family[i, j] one over two, by position;
    family.at(5.0) is the model at a value of the parameter; family["A[q, u]"] is one entry of all
    of them, (n1, n2, ...).

    Parameters
    ----------
    axes : sequence of Signal
        The parameters that vary, with units; the first is usually the airspeed. An LPV model made
        of the family is scheduled on them.
    values : sequence of array_like
        Increasing values of each axis, in its unit.
    models : sequence of LinearModel
        n1 n2 ... models with equal names and sample period, the last axis running fastest; all with
        their operating point, or none.
    kinks : mapping
        From a name of the physics (a saturation, an edge of a wake) to the values of the first axis
        at which the models change with a corner.

    Raises
    ------
    InputError
        Wrong numbers of values or models, values that do not increase, models that differ in names.

    See Also
    --------
    symheli.sweep : trims and linear models over airspeed
    symheli.LPVStateSpace : matrices as functions of parameters

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> family = symheli.sweep(heli, [2.0, 5.0, 8.0, 11.0])
    >>> roll = family.select(["v", "p", "r", "phi", "b1"], ["d_lat", "d_ped"])
    >>> roll.interpolate("polynomial", degree=2).at(4.0).A.shape
    (5, 5)
    >>> grid = symheli.steady.sweep_grid(heli, [4.0, 6.0], acceleration=[-2.0, 0.0, 2.0])
    >>> grid.A.shape
    (2, 3, 10, 10)
    >>> [(s.name, s.rate) for s in grid.interpolate(degree=1).parameters]
    [('airspeed', 'acceleration'), ('acceleration', inf)]
    """

    axes: tuple[Signal, ...]
    values: tuple[Array, ...]
    models: LinearModels
    kinks: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        axes = signals(self.axes)
        object.__setattr__(self, "axes", axes)
        if not axes or len(self.values) != len(axes) or len(set(axes)) < len(axes):
            raise InputError(
                f"expected values for each of different axes, got {len(self.values)} sets for"
                f" {', '.join(axes)}"
            )
        values = tuple(frozen(v, str(a), (None,)) for a, v in zip(axes, self.values, strict=True))
        object.__setattr__(self, "values", values)
        for axis, nodes in zip(axes, values, strict=True):
            if not len(nodes) or np.any(np.diff(nodes) <= 0):
                raise InputError(f"{axis}: expected increasing values, got {nodes.tolist()!s:.80}")
        if len(self.models) != math.prod(self.shape):
            raise InputError(
                f"expected one model for each value of {', '.join(axes)}: {math.prod(self.shape)},"
                f" got {len(self.models)}"
            )
        object.__setattr__(self, "models", LinearModels.of(self.models))
        for name, at in self.kinks.items():
            frozen(at, f"kinks of {name}", (None,))

    @classmethod
    def from_models(
        cls,
        airspeeds: Sequence[float] | Array,
        models: Sequence[LinearModel],
        kinks: Mapping[str, tuple[float, ...]] | None = None,
        parameter: Signal = AIRSPEED,
    ) -> LinearFamily:
        """Return the family of linear models at these airspeeds (m/s), or values of another
        `parameter`; their names and sample periods must be equal, and all have their operating
        point, or none.
        """
        return cls((parameter,), (np.atleast_1d(airspeeds),), models, kinks or {})  # type: ignore[arg-type]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(len(nodes) for nodes in self.values)

    @property
    def parameter(self) -> Signal:
        """The axis of a family over one; raises `InputError` for a family over several."""
        if self.axes[1:]:
            raise InputError(
                f"this family is over {', '.join(self.axes)}, and one parameter is needed: fix the"
                f" others, as in family.fix({self.axes[-1]}={self.values[-1][0]:g})"
            )
        return self.axes[0]

    @property
    def airspeeds(self) -> Array:
        """Values of the airspeed, m/s, or of the only axis; raises `UnknownNameError` where the
        airspeed is not among several axes.
        """
        return self.values[0 if len(self.axes) == 1 else self._axis(AIRSPEED)]

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
    def trims(self) -> OperatingPoints:
        """The operating point of each model, the last axis running fastest; empty where the
        matrices come from elsewhere and none is known.
        """
        return self.models.points

    @property
    def A(self) -> Array:
        """(n1, n2, ..., nx, nx), in SI units and radians."""
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

    def __len__(self) -> int:
        return len(self.models)

    def __iter__(self) -> Iterator[LinearModel]:
        return iter(self.models)

    @overload
    def __getitem__(self, k: int | tuple[int, ...]) -> LinearModel: ...
    @overload
    def __getitem__(self, k: str) -> Array: ...
    def __getitem__(self, k: int | tuple[int, ...] | str) -> LinearModel | Array:
        """The model at a position along each axis, or one entry of all models (n1, n2, ...) by its
        name: family["A[q, u]"]. Raises `UnknownNameError` for an unknown name, `IndexError`
        for a position beyond the last.
        """
        if isinstance(k, str):
            return entry_called(self, k)
        place = np.arange(len(self)).reshape(self.shape)[k]
        if np.ndim(place):
            raise InputError(f"expected a position along each of {', '.join(self.axes)}, got {k}")
        return self.models[int(place)]

    def at(self, *values: float) -> LinearModel:
        """The model at these values of the axes, in their units, which must be on the grid;
        `interpolate` gives a model between them. Raises `InputError` for a value off the grid.
        """
        if len(values) != len(self.axes):
            raise InputError(f"expected a value of {', '.join(self.axes)}, got {values}")
        pairs = zip(self.axes, values, strict=True)
        return self[tuple(self._position(axis, value) for axis, value in pairs)]

    def fix(self, **fixed: float) -> LinearFamily:
        """Return the models at one value of some axes, over the others, as in fix(mass=8.2); the
        value must be on the grid. Raises `UnknownNameError` for a name that is no axis.
        """
        index: list[int | slice] = [slice(None)] * len(self.axes)
        for name, value in fixed.items():
            index[self._axis(name)] = self._position(name, value)
        left = [k for k, place in enumerate(index) if isinstance(place, slice)]
        if not left:
            raise InputError("every axis is fixed, and none is left: use at(...) for one model")
        chosen = np.arange(len(self)).reshape(self.shape)[tuple(index)]
        axes, values = tuple(self.axes[k] for k in left), tuple(self.values[k] for k in left)
        kinks = self.kinks if left[0] == 0 else {}
        return LinearFamily(axes, values, self.models.take(chosen.ravel()), kinks)

    def over_airspeed(self, purpose: str) -> Array:
        """The airspeeds, m/s; raises `InputError` for a family over other parameters or in another
        unit, which `purpose` cannot use.
        """
        if [(axis, axis.unit) for axis in self.axes] != [(AIRSPEED, AIRSPEED.unit)]:
            over = ", ".join(f"{axis} ({axis.unit})" for axis in self.axes)
            raise InputError(f"{purpose} needs a family over airspeed in m/s, got one over {over}")
        return self.airspeeds

    def known_trims(self, purpose: str) -> OperatingPoints:
        """The trims; raises `InputError` where there are none, which `purpose` needs."""
        if not self.trims:
            raise InputError(
                f"{purpose} needs the trim at each {self.axes[0]}, and this family has none;"
                " give its models a point, or sweep"
            )
        return self.trims

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearFamily:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs, in
        this order.
        """
        return replace(self, models=self.models.select(states, inputs, outputs))

    def residualize(self, states: Sequence[str]) -> LinearFamily:
        """Remove these states by setting their derivatives to zero (quasi-steady), continuous time
        only.
        """
        return replace(self, models=self.models.each(lambda model: model.residualize(states)))

    def discretize(self, dt: float) -> LinearFamily:
        """Return the zero-order-hold equivalent of each model at sample period `dt` (s)."""
        return replace(self, models=self.models.each(lambda model: model.discretize(dt)))

    def interpolate(
        self,
        kind: Kind = "polynomial",
        degree: int | Sequence[int] = 3,
        *,
        rate: Rates | None = None,
    ) -> LPVStateSpace:
        """Element-wise interpolation of every entry of A, B, C, D over the axes.

        "polynomial": least-squares fit of `degree`, one for all axes or one each; "spline": cubic
        through the nodes; "linear": straight lines; over several axes, products of these.
        `.residuals` of the result are fit minus node values. The trim schedule is always the cubic
        spline (linear below four nodes), none without trims: its slope is the drift -x0'(p) dp/dt.
        `rate` bounds |dp/dt| in the unit of the axis per second: one for all axes, one each or
        {axis: rate}; or the name of the axis that is the rate. None: arbitrarily fast, but an
        airspeed beside an acceleration changes as that says.
        """
        return interpolated(self.models, self.axes, self.values, kind, degree, rate)

    def plot(self, ax: Axes | None = None, entries: Sequence[str] | None = None) -> Axes:
        """Entries such as "A[q, u]" or "B[q, d_lon]" over airspeed (without one: over the first
        axis), each by its largest magnitude, which the legend gives; default the diagonal of A. One
        curve for each combination of the other axes' values, paler the earlier it comes. Returns
        the axes; raises `UnknownNameError` for an entry that is not there.
        """
        from symheli.lpv.entry_plot import plot_family

        return plot_family(ax, self, entries)

    def to_frame(self) -> pandas.DataFrame:
        """A row a model by the values of the axes, a column an entry A[q, u] ..., their units in
        attrs["units"]. Raises `InputError` without pandas.
        """
        from symheli.lpv.labelled_models import models_frame

        return models_frame(list(zip(self.axes, self.values, strict=True)), self, self)

    def to_xarray(self) -> xarray.Dataset:
        """A, B, C, D over the axes, "equation", "state", "input" and "output", and x0, u0 where the
        trims are known; units in the attributes of the coordinates. Raises `InputError` without
        xarray.
        """
        from symheli.lpv.labelled_models import models_dataset

        axes = list(zip(self.axes, self.values, strict=True))
        return models_dataset(axes, self, self, self.trims)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the models with names, units and trims, as JSON or NPZ by the ending of the name,
        in the form `symheli.lpv.family_file` describes; every number exact. Raises `SymheliError`
        where the file cannot be written.
        """
        from symheli.lpv.family_file import write

        return write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LinearFamily:
        """Load the models from a file written by `save` or another program. Raises `InputError` for
        any other file.
        """
        from symheli.lpv.family_file import read

        return read(path)

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
