"""Models that are compared with those of known kinematics, and what each reaches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from identification.model import KinematicModel
from symheli.values.arrays import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Rival:
    """One model: fits in percent, 1 s ahead, against the states without noise (none of a
    simulator, which is no predictor); nu-gaps at `SPEEDS` by axis; at how many of them its
    stability is another than the exact one's, by axis; its static gain in the study's lateral loop
    over the exact one by airspeed (m/s), where it has that axis.
    """

    name: str
    ahead: Mapping[str, float]
    gaps: Mapping[str, Array]
    unlike: Mapping[str, int]
    static: Mapping[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownKinematics:
    """Results of the models with known kinematics.

    `flown`: seconds of each flight; `simulator`: the vehicle that the instruments are flown in;
    `model`: that over airspeed and acceleration; `margins`: b(P, C) of each of `LOOPS` around the
    exact models at `SPEEDS`; `update_time`: seconds of one recursive update of all coefficients.
    """

    flown: Mapping[str, float]
    simulator: str
    rivals: tuple[Rival, ...]
    model: KinematicModel
    margins: Mapping[str, Array]
    update_time: float

    def of(self, name: str) -> Rival:
        """One of the rivals."""
        return next(rival for rival in self.rivals if rival.name == name)
