"""Exact models at frozen airspeed, and their distance from identified ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import symheli
from identification import compare_frozen
from identification.judge.frozen_models import FrozenModels
from identification.model import KinematicModel
from studies.loops.lateral import HOLD, OUTPUTS
from studies.setup.axes import ALL, LATERAL, LONGITUDINAL, Axis
from studies.setup.bounds import PERIOD, SIZES
from studies.setup.flights import TOP
from symheli import Helicopter, LinearModel
from symheli.lpv.tools import Actuation
from symheli.values import Signal

HELD = Actuation(period=PERIOD)
"""Commands held between the samples of the study, and nothing else."""

SPEEDS = np.linspace(0.0, TOP, 27)
"""m/s."""


AXES: Mapping[str, Axis] = {"lateral": LATERAL, "longitudinal": LONGITUDINAL, "all axes": ALL}

FrozenAxes = Mapping[str, Sequence[LinearModel]]
"""Models at `SPEEDS` by axis."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Linear models at `SPEEDS` by axis; from the commands where servos fly."""

    models: Mapping[str, tuple[LinearModel, ...]]

    @classmethod
    def of(
        cls,
        heli: Helicopter,
        axes: Mapping[str, Axis] = AXES,
        *,
        actuation: Actuation = HELD,
    ) -> Truth:
        """By exact linearization, sampled behind an actuation."""
        exact = [symheli.linearize(heli, symheli.trim(heli, float(v))) for v in SPEEDS]
        models = {
            name: tuple(sampled(model, axis, actuation) for model in exact)
            for name, axis in axes.items()
        }
        return cls(models)

    def compare(self, models: FrozenAxes, frequencies: int = 2000) -> dict[str, FrozenModels]:
        """The models ("model") beside the truth over airspeed, by axis, of the axes that `models`
        have; `frequencies` as of `compare_frozen`.
        """
        return {
            name: compare_frozen(
                {"model": dict(zip(SPEEDS, models[name], strict=True))},
                dict(zip(SPEEDS, exact, strict=True)),
                scales=ALL.sizes,
                frequencies=frequencies,
            )
            for name, exact in self.models.items()
            if name in models
        }

    def static_ratio(self, models: FrozenAxes, airspeed: float) -> float:
        """Static gain of the study's lateral loop around the model over that around the truth, at
        the nearest of `SPEEDS`.
        """
        k = int(np.argmin(np.abs(SPEEDS - airspeed)))
        return static_gain(models["lateral"][k]) / static_gain(self.models["lateral"][k])


def sampled(model: LinearModel, axis: Axis, actuation: Actuation = HELD) -> LinearModel:
    """The part of a continuous model that is an axis, sampled behind an actuation."""
    kept = model.select(states=axis.states) if axis.states else model
    kept = kept.select(inputs=axis.inputs, outputs=axis.outputs)
    return actuation.select(axis.inputs).discretize(kept)


def frozen_axes(model: KinematicModel, truth: Truth) -> FrozenAxes:
    """Return an identified model at `SPEEDS`, in the axes of the exact models."""
    return {
        name: tuple(frozen(model, AXES[name], float(v)) for v in SPEEDS) for name in truth.models
    }


def frozen(model: KinematicModel, axis: Axis, airspeed: float) -> LinearModel:
    """Return an identified model of an axis in level flight, with the names of the exact model."""
    p = (airspeed, 0.0) if len(model.parameters) == 2 else (airspeed,)
    commands = {u.removesuffix("_command"): u for u in map(str, model.inputs)}
    part = model.at(*p, outputs=axis.outputs, inputs=[commands[u] for u in axis.inputs])
    inputs = tuple(Signal(u.removesuffix("_command"), u.unit) for u in part.inputs)
    return replace(part, inputs=inputs)


def static_gain(model: LinearModel, hold: float = HOLD) -> float:
    """Largest gain from d_lat, d_ped to r, phi at frequency 0 in the study's lateral loop, in its
    sizes.
    """
    K = np.zeros((2, 4))
    K[0, 3] = hold
    A = model.A + model.B @ K @ model.C
    G = (model.C @ np.linalg.solve(np.eye(len(A)) - A, model.B))[2:]
    sizes = [[SIZES[u] / SIZES[y] for u in model.inputs] for y in OUTPUTS]
    return float(np.linalg.norm(G * np.array(sizes), 2))
