"""Helicopters and autopilots of trials, each made once a process."""

from __future__ import annotations

from functools import cache

from studies.transition.flights import autopilot_for
from symheli import Helicopter
from symheli.flight import Autopilot

INERTIAS = ("Ixx", "Iyy", "Izz")


@cache
def helicopter(vehicle: str) -> Helicopter:
    """With its rotor speed held."""
    return Helicopter.load(vehicle, governor="ideal")


@cache
def autopilot(vehicle: str, period: float = 0.02) -> Autopilot:
    """The one of the study, for that sample period (s)."""
    return autopilot_for(helicopter(vehicle), period)


def scattered(vehicle: str, mass: float, inertia: float) -> Helicopter:
    """With `mass` and `inertia` times what its file says."""
    known = helicopter(vehicle)
    factors = {"body.mass": mass} | {f"body.{name}": inertia for name in INERTIAS}
    return known.with_parameters({n: f * known.parameters[n] for n, f in factors.items()})
