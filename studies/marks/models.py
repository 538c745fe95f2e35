"""What is identified, and how: fixed on the seeds 1000 to 1004, before any mark was read."""

from __future__ import annotations

from identification import FilterError, KinematicARX, KinematicModel, Polynomial, Product, fit
from studies.transition.flights import TOP
from symheli import FlightRecord, Helicopter, SimulatedFlight

INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
SCHEDULING = ("airspeed_command", "acceleration_command")
FASTEST = 4.0
"""Largest commanded acceleration, m/s^2."""


def structure(servos: bool = False) -> KinematicARX:
    """Cubic in airspeed, quadratic in acceleration, of total degree 3; where servos fly, from the
    commands, with as many lags as delay and servo need.
    """
    basis = Product(
        (Polynomial(3, 0.0, TOP), Polynomial(2, -FASTEST, FASTEST)),
        total_degree=3,
    )
    inputs = tuple(f"{u}_command" for u in INPUTS) if servos else INPUTS
    return KinematicARX(inputs, SCHEDULING, basis=basis, nb=4 if servos else 2, offset_rate=False)


def identified(
    records: FlightRecord | list[FlightRecord], simulator: Helicopter, servos: bool = False
) -> KinematicModel:
    """By the filter error method, its instruments flown in `simulator`."""
    return fit(structure(servos), records, method=FilterError(SimulatedFlight(simulator)))
