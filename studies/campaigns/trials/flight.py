"""Flights under feedback in turbulence, some beside each other: how they went, in numbers."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np

from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import helicopter, scattered
from studies.setup.flights import ABOVE_GROUND, BREEZE, TOP
from symheli import AirspeedSchedule, Wind
from symheli.environment import Dryden
from symheli.errors import UnknownNameError, ValidityWarning
from symheli.flight import XCELL_SERVOS, Autopilot, fly_batch, gain_scheduled_lqr
from symheli.steady.validity import Validity

CONTROLLERS = ("lqr", "lqr with servos", "lqr of hover")


def flight(
    *,
    vehicle: str = "xcell60",
    controller: str = "lqr",
    mass: float = 1.0,
    inertia: float = 1.0,
    servos: bool = True,
    delay: float = 0.02,
    noise_db: float = 30.0,
    turbulence: float = 7.7,
    acceleration: float = 3.0,
    flights: int = 32,
    seed: int = 0,
) -> dict[str, float]:
    """`flights` transitions, hover to 13 m/s and back, each with noise and turbulence of its own;
    the controller knows the vehicle as it is in its file, `mass` and `inertia` are factors on that.

    `turbulence`: mean wind at 20 ft, m/s (0: still air); `noise_db` inf: none; `delay`, s.
    """
    heli = scattered(vehicle, mass, inertia)
    wind = Wind(BREEZE, turbulence=Dryden(turbulence, ABOVE_GROUND)) if turbulence else Wind()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)  # counted
        batch = fly_batch(
            heli,
            AirspeedSchedule.transition(0.0, TOP, acceleration, hold=2.0),
            seeds=range(seed, seed + flights),
            controller=designed(vehicle, controller),
            wind=wind,
            noise_db=None if np.isinf(noise_db) else noise_db,
            servos=XCELL_SERVOS if servos else None,
            delay=delay,
            workers=1,  # the other cores have cases of their own
        )
    kept = ~batch.lost
    attitude = np.nanmax(np.abs([batch.column("phi"), batch.column("theta")]), axis=(0, 2))
    error = batch.column("u") - batch.column("u_reference")
    speed = np.sqrt(np.nanmean(error**2, axis=1))
    airspeed = batch.column("airspeed")
    beyond = airspeed[np.isfinite(airspeed)] > Validity.of(heli).harmless[0]
    row = {"lost": float(batch.lost.mean()), "beyond the equations": float(beyond.mean())}
    if kept.any():
        row |= {
            "largest attitude, median": float(np.median(attitude[kept])),
            "largest attitude, worst": float(attitude[kept].max()),
            "speed error, median": float(np.median(speed[kept])),
            "speed error, worst": float(speed[kept].max()),
        }
    return row


@cache
def designed(vehicle: str, controller: str) -> Autopilot:
    """Design for the vehicle of the file, once a process."""
    if controller not in CONTROLLERS:
        raise UnknownNameError("controller", controller, CONTROLLERS)
    top, points = (0.5, 2) if controller == "lqr of hover" else (TOP, 14)
    servos = XCELL_SERVOS if controller == "lqr with servos" else None
    return gain_scheduled_lqr(helicopter(vehicle), 0.0, top, 0.02, points, servos)


TRIAL = Trial(
    flight,
    {
        "lost": "1",
        "beyond the equations": "1",
        "largest attitude, median": "rad",
        "largest attitude, worst": "rad",
        "speed error, median": "m/s",
        "speed error, worst": "m/s",
    },
)
"""Of the flights that were not lost, but for the share that was, and the share of the time that was
flown faster than the equations hold for.
"""
