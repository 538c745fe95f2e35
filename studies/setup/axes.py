"""The axes of a helicopter, each with its signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from identification import LPVARX, Polynomial
from studies.setup.flights import TOP
from symheli.values.kinematics import INPUTS, RIGID_BODY

SCHEDULING = "airspeed_command"

_SIZES = {
    **dict.fromkeys(("u", "v", "w"), 2.0),
    **dict.fromkeys(("p", "q", "r"), 1.0),
    **dict.fromkeys(("phi", "theta"), 0.3),
    **dict.fromkeys(("d_lon", "d_lat", "d_col"), 0.05),
    "d_ped": 0.1,
}


@dataclass(frozen=True)
class Axis:
    """An axis names the signals that belong to it. Empty `states` mean all that a model has.

    `mode` names the rotor mode that an identified model has to reproduce.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    mode: str
    marks: Mapping[str, tuple[float, float]]
    """{output: (noise-free, 30 dB)} fit in percent, 1 s ahead, that is accepted."""

    @property
    def sizes(self) -> dict[str, float]:
        """Changes of the inputs and outputs (SI) that count as 1 in a nu-gap."""
        return {name: _SIZES[name] for name in (*self.inputs, *self.outputs)}

    def structure(self, order: int = 3, degree: int = 2, offset: bool = True) -> LPVARX:
        """LPV-ARX of this axis at 50 Hz: `order` lags of everything, polynomial of `degree` in the
        commanded airspeed.
        """
        basis = Polynomial(degree, 0.0, TOP)
        return LPVARX(
            self.outputs,
            self.inputs,
            SCHEDULING,
            na=order,
            nb=order,
            delay=1,
            basis=basis,
            offset=offset,
            offset_rate=offset,
        )


LONGITUDINAL = Axis(
    "longitudinal-vertical",
    ("u", "w", "q", "theta", "a1"),
    ("d_lon", "d_col"),
    ("u", "w", "q", "theta"),
    "pitch/flap",
    {"q": (90.0, 80.0), "theta": (90.0, 80.0)},
)
LATERAL = Axis(
    "lateral-directional",
    ("v", "p", "r", "phi", "b1"),
    ("d_lat", "d_ped"),
    ("v", "p", "r", "phi"),
    "roll/flap",
    {"p": (85.0, 80.0)},
)
LATERAL_WITH_COLLECTIVE = replace(
    LATERAL,
    name="lateral-directional, other inputs measured",
    inputs=("d_lat", "d_ped", "d_lon", "d_col"),
)
ALL = Axis(
    "all axes (MIMO)",
    (),
    tuple(map(str, INPUTS)),
    tuple(map(str, RIGID_BODY)),
    "roll/flap",
    {**LONGITUDINAL.marks, **LATERAL.marks},
)
AXES = (LONGITUDINAL, LATERAL)
CHOICES = {"longitudinal": LONGITUDINAL, "lateral": LATERAL, "all": ALL}
"""Axes by their names in commands and campaign files."""
