"""Numbers that one reads off a frozen loop, with the unit and the digits in which each is
printed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from synthesis.design.loops.handling_qualities import Bandwidth
from synthesis.design.loops.margins import Margins, decibels
from synthesis.design.loops.responses import Responses


class Measure(NamedTuple):
    """How a number of a loop is printed: its name in words, its unit, and decimals."""

    words: str
    unit: str
    decimals: int


MEASURES: Mapping[str, Measure] = {
    "gain": Measure("gain margin", "dB", 1),
    "phase": Measure("phase margin", "deg", 1),
    "delay": Measure("delay margin", "ms", 0),
    "disk_gain": Measure("disk gain", "dB", 1),
    "disk_phase": Measure("disk phase", "deg", 0),
    "crossover": Measure("crossover", "rad/s", 2),
    "bandwidth_3db": Measure("bandwidth (3 dB)", "rad/s", 2),
    "bandwidth_ads33": Measure("bandwidth (ADS-33)", "rad/s", 2),
    "phase_delay": Measure("phase delay", "ms", 0),
    "peak": Measure("peak", "dB", 1),
    "rejection": Measure("rejection", "rad/s", 2),
    "rejection_peak": Measure("rejection peak", "dB", 1),
    "overshoot": Measure("overshoot", "%", 0),
    "rise": Measure("rise", "s", 2),
    "settling": Measure("settling", "s", 2),
}
"""Numbers of a loop by name. `gain`: smallest change in either direction. `bandwidth_3db`: up to
which the response follows its command within 3 dB. `bandwidth_ads33`: up to which 45 deg of phase
and 6 dB of gain are left.
"""

LARGEST = 40.0
"""Gain margin, dB, above which a loop has as much as anyone asks for: it is shown as this."""

UNSTABLE, UNKNOWN = "unstable", "not known"


@dataclass(frozen=True, eq=False)
class LoopMeasures:
    """Numbers of one loop by the names of `MEASURES`, each in its unit.

    stable: None where it is not known. bands: half widths of what each number may be, where known.
    """

    stable: bool | None
    values: Mapping[str, float]
    bands: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        margins: Margins | None = None,
        responses: Responses | None = None,
        attitude: Bandwidth | None = None,
    ) -> LoopMeasures:
        """Return the numbers of what is given: margins, responses to a command and a disturbance,
        ADS-33 bandwidth and phase delay of a rate response.
        """
        values: dict[str, float] = {}
        if margins is not None:
            values |= cls._of_margins(margins)
        if responses is not None:
            values |= responses._asdict()
        if attitude is not None:
            values["bandwidth_ads33"] = attitude.rate_response
            values["phase_delay"] = 1e3 * attitude.phase_delay
        return cls(margins is None or margins.stable, values)

    @staticmethod
    def _of_margins(margins: Margins) -> dict[str, float]:
        values = {
            "gain": min(margins.gain_margin, LARGEST),
            "phase": min(margins.phase_margin, 180.0),
            "delay": 1e3 * margins.delay,
            "crossover": margins.highest_crossover,
        }
        if not math.isnan(margins.disk):
            values["disk_gain"] = min(decibels(margins.disk_gain[1]), LARGEST)
            values["disk_phase"] = math.degrees(margins.disk_phase)
        return values

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def banded(self, name: str) -> tuple[float, float]:
        """Return a number and the half width of its band, 0 without one."""
        return self.values[name], self.bands.get(name, 0.0)

    def cell(self, name: str) -> str:
        """Return a number as a table prints it, with its band where it has one; of a loop that is
        not stable a word.
        """
        if self.stable is False:
            return UNSTABLE
        value, band = self.banded(name)
        if math.isnan(value + band):
            return UNKNOWN
        digits = MEASURES[name].decimals
        return f"{value:.{digits}f}" + (f" +-{band:.{digits}f}" if band else "")
