"""Helicopters and autopilots of trials, each made once a process."""

from __future__ import annotations

from functools import cache

from studies.setup.flights import autopilot_for
from symheli import Helicopter
from symheli.dynamics import Governor
from symheli.flight import Autopilot

INERTIAS = ("Ixx", "Iyy", "Izz")


@cache
def helicopter(vehicle: str, governor: Governor = "ideal") -> Helicopter:
    """Return the helicopter with its rotor speed held, or with another governor."""
    return Helicopter.load(vehicle, governor=governor)


@cache
def autopilot(vehicle: str, period: float = 0.02) -> Autopilot:
    """The one of the study, for that sample period (s)."""
    return autopilot_for(helicopter(vehicle), period)


def scattered(
    vehicle: str, mass: float, inertia: float, governor: Governor = "ideal"
) -> Helicopter:
    """Return the helicopter with `mass` and `inertia` times the values of its file."""
    known = helicopter(vehicle, governor)
    factors = {"body.mass": mass} | {f"body.{name}": inertia for name in INERTIAS}
    return known.with_parameters({n: f * known.parameters[n] for n, f in factors.items()})
