"""Margins of the attitude hold and bandwidths of the attitude responses over airspeed, with servos
and a delay.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import synthesis
from studies.loops.lateral import HOLD
from studies.setup.flights import ACTUATION
from symheli import LinearModel
from symheli.progress import tracked
from synthesis.design.loops.handling_qualities import Bandwidth
from synthesis.design.loops.loop_measures import LoopMeasures
from synthesis.design.loops.margins import Margins


@dataclass(frozen=True)
class AtAirspeed:
    """Margins and bandwidths of one model at one airspeed (m/s): the roll hold d_lat = HOLD phi,
    and the responses to the sticks.
    """

    airspeed: float
    hold: Margins
    roll: Bandwidth
    pitch: Bandwidth

    @property
    def held(self) -> LoopMeasures:
        """Numbers of the roll hold and of its response to the stick."""
        return LoopMeasures.of(self.hold, attitude=self.roll)

    @property
    def free(self) -> LoopMeasures:
        """Numbers of the pitch response to the stick, without feedback."""
        return LoopMeasures.of(attitude=self.pitch)


def over_airspeed(
    airspeeds: Sequence[float], lateral: Sequence[LinearModel], longitudinal: Sequence[LinearModel]
) -> Iterator[AtAirspeed]:
    """One entry an airspeed from the continuous lateral and longitudinal models there."""
    models = zip(airspeeds, lateral, longitudinal, strict=True)
    for airspeed, roll, pitch in tracked("margins", models, len(airspeeds)):
        roll = ACTUATION.behind(roll, ["d_lat"])
        held = roll.feedback({("d_lat", "phi"): HOLD}).select(inputs=["d_lat"], outputs=["phi"])
        stick = ACTUATION.behind(pitch, ["d_lon"]).select(inputs=["d_lon"], outputs=["theta"])
        hold = synthesis.margins(
            synthesis.analysis.open_loop(roll, {("d_lat", "phi"): HOLD}, "d_lat")
        )
        yield AtAirspeed(
            float(airspeed),
            hold,
            synthesis.analysis.attitude_bandwidth(held),
            synthesis.analysis.attitude_bandwidth(stick),
        )
