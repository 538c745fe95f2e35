"""Linear models along a range of airspeeds, and their element-wise interpolation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from symheli.errors import InputError
from symheli.lpv.interpolation import Kind, interpolated
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import Rates
from symheli.values.arrays import Array, frozen
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal, signals

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
    trims: tuple[OperatingPoint, ...] = ()
    dt: float | None = None
    kinks: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        object.__setattr__(self, "airspeeds", frozen(self.airspeeds, "airspeeds", (None,)))
        if np.any(np.diff(self.airspeeds) <= 0):
            raise InputError("airspeeds must increase strictly")
        K, nx, nu, ny = len(self.airspeeds), len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (
            ("A", (K, nx, nx)),
            ("B", (K, nx, nu)),
            ("C", (K, ny, nx)),
            ("D", (K, ny, nu)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))
        if len(self.trims) not in (0, K):
            raise InputError(
                f"expected {K} trims, one an airspeed, or none at all, got {len(self.trims)}"
            )

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
        first = models[0]
        for k, model in enumerate(models):
            if (model.states, model.inputs, model.outputs, model.dt) != (
                first.states,
                first.inputs,
                first.outputs,
                first.dt,
            ):
                raise InputError(
                    f"models[{k}]: expected states, inputs, outputs and dt of models[0]; select or"
                    " discretize first"
                )
        return cls(
            np.asarray(airspeeds, float),
            np.stack([m.A for m in models]),
            np.stack([m.B for m in models]),
            np.stack([m.C for m in models]),
            np.stack([m.D for m in models]),
            first.states,
            first.inputs,
            first.outputs,
            tuple(m.point for m in models if m.point),
            first.dt,
            kinks or {},
        )

    def __len__(self) -> int:
        return len(self.airspeeds)

    def __getitem__(self, k: int) -> LinearModel:
        return LinearModel(
            self.A[k],
            self.B[k],
            self.C[k],
            self.D[k],
            self.states,
            self.inputs,
            self.outputs,
            self.dt,
            self._trim(k),
        )

    def known_trims(self, purpose: str) -> tuple[OperatingPoint, ...]:
        """The trims; raises `InputError` where there are none, which `purpose` needs."""
        if not self.trims:
            raise InputError(
                f"{purpose} needs the trim at each airspeed, and this family has none; give its"
                " models a point, or sweep"
            )
        return self.trims

    def _trim(self, k: int) -> OperatingPoint | None:
        return self.trims[k] if self.trims else None

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearFamily:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs, in
        this order.
        """
        return self._map(lambda model: model.select(states, inputs, outputs))

    def residualize(self, states: Sequence[str]) -> LinearFamily:
        """Remove these states by setting their derivatives to zero (quasi-steady), continuous time
        only.
        """
        return self._map(lambda model: model.residualize(states))

    def discretize(self, dt: float) -> LinearFamily:
        """Zero-order-hold equivalent of each model at sample period `dt` (s)."""
        return self._map(lambda model: model.discretize(dt))

    def interpolate(
        self, kind: Kind = "polynomial", degree: int = 3, *, rate: Rates | None = None
    ) -> LPVStateSpace:
        """Element-wise interpolation of every entry of A, B, C, D over airspeed.

        "polynomial": least-squares fit of `degree`; "spline": cubic through the nodes; "linear":
        straight lines. `.residuals` of the result are fit minus node values. The trim schedule is
        always the cubic spline (linear below four nodes), none without trims: its slope is the
        drift -x0'(p) dp/dt. `rate` bounds |dp/dt| in m/s^2 (None: as fast as it likes).
        """
        models = [self[k] for k in range(len(self))]
        return interpolated(models, (AIRSPEED,), (self.airspeeds,), kind, degree, rate)

    def _map(self, change) -> LinearFamily:
        return LinearFamily.from_models(
            self.airspeeds, [change(self[k]) for k in range(len(self))], self.kinks
        )
