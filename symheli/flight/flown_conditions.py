"""Conditions of a simulated flight, in words that a record keeps."""

from __future__ import annotations

from symheli.environment import Wind
from symheli.flight.plan import FlightPlan
from symheli.helicopter import Helicopter
from symheli.records.flight_record import CONDITIONS

MASS = "body.mass"


def flown_conditions(heli: Helicopter, plan: FlightPlan) -> dict[str, str]:
    """Return the wind, mass, governor and servos of a flight: `meta["flown"]` of its record."""
    mass = f"{float(heli.parameters[MASS]):.4g} kg"
    return dict(
        zip(CONDITIONS, (_wind(plan.wind), mass, heli.governor, _servos(plan)), strict=True)
    )


def _wind(wind: Wind) -> str:
    gusts = ["gusts"] * bool(wind.gusts) + ["turbulence"] * (wind.turbulence is not None)
    if not any(wind.steady):
        return " and ".join(gusts) or "still air"
    north, east, down = wind.steady
    return " with ".join([f"({north:g}, {east:g}, {down:g}) m/s north east down", *gusts])


def _servos(plan: FlightPlan) -> str:
    late = f", {1e3 * plan.delay:g} ms late" if plan.delay else ""
    servos = plan.actuation.servos
    if servos is None:
        return f"none{late}"
    each = (f"{name} {servo.natural_frequency:.3g} rad/s" for name, servo in servos.items())
    return f"{', '.join(each)}{late}"
