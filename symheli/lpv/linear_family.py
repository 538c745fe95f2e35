"""Linear models along a range of one parameter, and their element-wise interpolation."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np

from symheli.errors import InputError
from symheli.lpv.entries import entry_called
from symheli.lpv.interpolation import Kind, interpolated
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Rates
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.operating_point import OperatingPoint
from symheli.values.operating_points import OperatingPoints
from symheli.values.signal import Signal
from symheli.values.summary import as_table, summarized

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

AIRSPEED = Signal("airspeed", "m/s")


@dataclass(frozen=True, eq=False)
class LinearFamily:
    """K linear models at increasing airspeeds, or values of another `parameter`.

    Parameters
    ----------
    airspeeds : array_like
        (K,), m/s or the unit of `parameter`, increasing.
    A, B, C, D : array_like
        (K, nx, nx), (K, nx, nu), (K, ny, nx), (K, ny, nu), in SI units and radians.
    states, inputs, outputs : sequence of str
        Names, with units where they are `Signal`s.
    trims : sequence of OperatingPoint
        The operating point of each model; empty where the matrices come from elsewhere and none is
        known.
    dt : float, optional
        Sample period, s; None in continuous time.
    kinks : mapping
        From a name of the physics (a saturation, an edge of a wake) to the airspeeds at which the
        models change with a corner.
    parameter : Signal
        What the models are over, with its unit: an LPV model made of them is scheduled on it.

    Raises
    ------
    InputError
        Shapes that do not fit, airspeeds that do not increase, another number of trims.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> family = symheli.sweep(heli, [2.0, 5.0, 8.0, 11.0])
    >>> roll = family.select(["v", "p", "r", "phi", "b1"], ["d_lat", "d_ped"])
    >>> roll.interpolate("polynomial", degree=2).at(4.0).A.shape
    (5, 5)
    """

    airspeeds: Array
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    trims: Sequence[OperatingPoint] | OperatingPoints = ()
    dt: float | None = None
    kinks: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    parameter: Signal = AIRSPEED
    models: LinearModels = field(init=False, repr=False)

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        object.__setattr__(self, "airspeeds", frozen(self.airspeeds, "airspeeds", (None,)))
        object.__setattr__(self, "parameter", Signal(self.parameter))
        if np.any(np.diff(self.airspeeds) <= 0):
            raise InputError(f"the values of {self.parameter} must increase strictly")
        if self.dt is not None:
            positive(self.dt, "dt")
        models = LinearModels(
            self.A,
            self.B,
            self.C,
            self.D,
            self.states,
            self.inputs,
            self.outputs,
            self.dt,
            OperatingPoints.of(self.trims),
        )
        if len(models) != len(self.airspeeds):
            raise InputError(
                f"expected one model a value of {self.parameter}, got {len(models)} models for"
                f" {len(self.airspeeds)} values"
            )
        for name in ("A", "B", "C", "D", "states", "inputs", "outputs"):
            object.__setattr__(self, name, getattr(models, name))
        object.__setattr__(self, "trims", models.points)
        object.__setattr__(self, "models", models)

    @classmethod
    def from_models(
        cls,
        airspeeds: Sequence[float] | Array,
        models: Sequence[LinearModel],
        kinks: Mapping[str, tuple[float, ...]] | None = None,
        parameter: Signal = AIRSPEED,
    ) -> LinearFamily:
        """From linear models with equal names and sample period, one an airspeed (m/s), or a value
        of another `parameter`; all with their operating point, or none.
        """
        if not len(models) or len(models) != len(np.atleast_1d(np.asarray(airspeeds))):
            raise InputError(f"expected one model a value of {parameter}, got {len(models)}")
        models = LinearModels.of(models)
        return cls(
            np.asarray(airspeeds, float),
            *(models.A, models.B, models.C, models.D),
            *(models.states, models.inputs, models.outputs),
            models.points,
            models.dt,
            kinks or {},
            parameter,
        )

    def __len__(self) -> int:
        return len(self.airspeeds)

    @overload
    def __getitem__(self, k: int) -> LinearModel: ...
    @overload
    def __getitem__(self, k: str) -> Array: ...
    def __getitem__(self, k: int | str) -> LinearModel | Array:
        """Model k, or one entry of all models (K,) by its name: family["A[q, u]"]. Raises
        `UnknownNameError` for one that is not there.
        """
        return entry_called(self, k) if isinstance(k, str) else self.models[k]

    def over_airspeed(self, purpose: str) -> Array:
        """The airspeeds, m/s; raises `InputError` for a family over another parameter or in another
        unit, which `purpose` has no use for.
        """
        if (self.parameter, self.parameter.unit) != (AIRSPEED, AIRSPEED.unit):
            raise InputError(
                f"{purpose} needs a family over airspeed in m/s, got one over {self.parameter}"
                f" ({self.parameter.unit})"
            )
        return self.airspeeds

    def known_trims(self, purpose: str) -> OperatingPoints:
        """The trims; raises `InputError` where there are none, which `purpose` needs."""
        if not self.models.points:
            raise InputError(
                f"{purpose} needs the trim at each {self.parameter}, and this family has none;"
                " give its models a point, or sweep"
            )
        return self.models.points

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearFamily:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs, in
        this order.
        """
        return self._of(self.models.select(states, inputs, outputs))

    def residualize(self, states: Sequence[str]) -> LinearFamily:
        """Remove these states by setting their derivatives to zero (quasi-steady), continuous time
        only.
        """
        return self._of(self.models.each(lambda model: model.residualize(states)))

    def discretize(self, dt: float) -> LinearFamily:
        """Zero-order-hold equivalent of each model at sample period `dt` (s)."""
        return self._of(self.models.each(lambda model: model.discretize(dt)))

    def interpolate(
        self, kind: Kind = "polynomial", degree: int = 3, *, rate: Rates | None = None
    ) -> LPVStateSpace:
        """Element-wise interpolation of every entry of A, B, C, D over airspeed.

        "polynomial": least-squares fit of `degree`; "spline": cubic through the nodes; "linear":
        straight lines. `.residuals` of the result are fit minus node values. The trim schedule is
        always the cubic spline (linear below four nodes), none without trims: its slope is the
        drift -x0'(p) dp/dt. `rate` bounds |dp/dt| in m/s^2 (None: arbitrarily fast).
        """
        return interpolated(self.models, (self.parameter,), (self.airspeeds,), kind, degree, rate)

    def plot(self, ax: Axes | None = None, entries: Sequence[str] | None = None) -> Axes:
        """Entries such as "A[q, u]" or "B[q, d_lon]" over airspeed, each by its largest magnitude,
        which the legend gives; default the diagonal of A. Returns the axes; raises
        `UnknownNameError` for an entry that is not there.
        """
        from symheli.lpv.entry_plot import plot_entries

        return plot_entries(ax, self.parameter, self.airspeeds, self, self, entries, ".")

    def to_frame(self) -> pandas.DataFrame:
        """A row an airspeed (m/s), a column an entry A[q, u] ..., their units in attrs["units"].
        Raises `InputError` without pandas.
        """
        from symheli.lpv.labelled_models import models_frame

        return models_frame([(self.parameter, self.airspeeds)], self, self)

    def to_xarray(self) -> xarray.Dataset:
        """A, B, C, D over "airspeed", "equation", "state", "input" and "output", and x0, u0 where
        the trims are known; units in the attributes of the coordinates. Raises `InputError` without
        xarray.
        """
        from symheli.lpv.labelled_models import models_dataset

        return models_dataset([(self.parameter, self.airspeeds)], self, self, self.models.points)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the models with names, units and trims, as JSON or NPZ by the ending of the name,
        in the form `symheli.lpv.family_file` describes; every number exact. Raises `SymheliError`
        where the file cannot be written.
        """
        from symheli.lpv.family_file import Content, write

        return write(Content((self.parameter,), (self.airspeeds,), self.models, self.kinks), path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LinearFamily:
        """Load the models from a file written by `save` or another program. Raises `InputError` for
        any other file, and for models over several parameters.
        """
        from symheli.lpv.family_file import read

        found = read(path)
        if len(found.axes) != 1:
            axes = ", ".join(f"{s} ({s.unit})" for s in found.axes)
            raise InputError(
                f"{path}: expected models over one parameter, got {axes}: read them with"
                " LinearGrid.load"
            )
        return cls.from_models(found.values[0], found.models, found.kinks, found.axes[0])

    def _of(self, models: LinearModels) -> LinearFamily:
        return LinearFamily.from_models(self.airspeeds, models, self.kinks, self.parameter)
