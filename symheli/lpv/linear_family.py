"""Linear models along a range of airspeeds, and their element-wise interpolation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from symheli.errors import InputError
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

AIRSPEED = Signal("airspeed", "m/s")


@dataclass(frozen=True, eq=False)
class LinearFamily:
    """K linear models at increasing airspeeds.

    Parameters
    ----------
    airspeeds : array_like
        (K,), m/s, increasing.
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
    models: LinearModels = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "airspeeds", frozen(self.airspeeds, "airspeeds", (None,)))
        if np.any(np.diff(self.airspeeds) <= 0):
            raise InputError("airspeeds must increase strictly")
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
                f"expected one model an airspeed, got {len(models)} models for"
                f" {len(self.airspeeds)} airspeeds"
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
    ) -> LinearFamily:
        """From linear models with equal names and sample period, one an airspeed (m/s); all with
        their operating point, or none.
        """
        if not len(models) or len(models) != len(np.atleast_1d(np.asarray(airspeeds))):
            raise InputError(f"expected one model an airspeed, got {len(models)} models")
        models = LinearModels.of(models)
        return cls(
            np.asarray(airspeeds, float),
            *(models.A, models.B, models.C, models.D),
            *(models.states, models.inputs, models.outputs),
            models.points,
            models.dt,
            kinks or {},
        )

    def __len__(self) -> int:
        return len(self.airspeeds)

    def __getitem__(self, k: int) -> LinearModel:
        return self.models[k]

    def known_trims(self, purpose: str) -> OperatingPoints:
        """The trims; raises `InputError` where there are none, which `purpose` needs."""
        if not self.models.points:
            raise InputError(
                f"{purpose} needs the trim at each airspeed, and this family has none; give its"
                " models a point, or sweep"
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
        drift -x0'(p) dp/dt. `rate` bounds |dp/dt| in m/s^2 (None: as fast as it likes).
        """
        return interpolated(self.models, (AIRSPEED,), (self.airspeeds,), kind, degree, rate)

    def _of(self, models: LinearModels) -> LinearFamily:
        return LinearFamily.from_models(self.airspeeds, models, self.kinks)
