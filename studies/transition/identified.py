"""Identification of every axis from the training flights, and validation on the test flights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from identification.judge import Scores
from identification.model import LPVARXModel
from studies.setup.axes import ALL, AXES, LATERAL, LATERAL_WITH_COLLECTIVE, LONGITUDINAL, Axis
from studies.setup.axis_models import identify, judged, mode_misses, update_time
from studies.setup.flights import NOISES, StudyRecords
from symheli import Helicopter

CLEAN, NOISY = NOISES


@dataclass(frozen=True, kw_only=True, eq=False)
class IdentifiedAxis:
    """One axis from the training flight of one noise, judged on the test flight of the same."""

    axis: Axis
    noise: str
    model: LPVARXModel
    scores: Scores
    mode_miss: Mapping[float, float]


@dataclass(frozen=True, kw_only=True)
class NoisyModes:
    """Rotor mode missed (percent, by airspeed in m/s) by an order-2 model of the noisy flight."""

    axis: Axis
    method: str
    miss: Mapping[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Identification:
    """Identified models of all axes.

    `gentle` is the lateral model of the gentle flight; `first_stage` the first-stage F of the
    instruments in the direction they explain worst, `update_times` the seconds of one recursive
    update, both by axis.
    """

    axes: tuple[IdentifiedAxis, ...]
    gentle: LPVARXModel
    noisy_modes: tuple[NoisyModes, ...]
    first_stage: Mapping[str, float]
    update_times: Mapping[str, float]

    def of(self, axis: Axis, noise: str) -> IdentifiedAxis:
        """Return the identification of one axis."""
        return next(one for one in self.axes if (one.axis, one.noise) == (axis, noise))


def identify_axes(heli: Helicopter, flights: StudyRecords) -> Identification:
    """Fit every axis with and without noise; once more by instruments, which noise needs."""
    found = []
    for noise in NOISES:
        for axis in (LONGITUDINAL, LATERAL, LATERAL_WITH_COLLECTIVE, ALL):
            # MIMO by batch least squares: the same numbers as the recursion, which is shown on the
            # two-input axes
            model = identify(axis, flights.training[noise], "rls" if axis in AXES else "ls")
            verdict = judged(heli, axis, model, flights.test[noise])
            found.append(
                IdentifiedAxis(
                    axis=axis,
                    noise=noise,
                    model=model,
                    scores=verdict.scores,
                    mode_miss=verdict.mode_miss,
                )
            )
    noisy = flights.training[NOISY]
    times = {axis.name: update_time(axis.structure(), noisy) for axis in (*AXES, ALL)}
    modes, first_stage = [], {}
    for axis in AXES:
        for method in ("ls", "iv"):
            model = identify(axis, noisy, method, order=2)
            miss = mode_misses(heli, model, axis.mode)
            modes.append(NoisyModes(axis=axis, method=method, miss=miss))
            if method == "iv":
                first_stage[axis.name] = float(model.details["first_stage_F"])
    return Identification(
        axes=tuple(found),
        gentle=identify(LATERAL, flights.gentle, "rls", order=2),
        noisy_modes=tuple(modes),
        first_stage=first_stage,
        update_times=times,
    )
