"""Structures and method of the identification, fixed on the seeds 1000 to 1004 before any
validation.
"""

from __future__ import annotations

from dataclasses import replace

from identification import KinematicARX, Polynomial, fit
from identification.methods import FilterError
from identification.model import KinematicModel
from studies.setup.axes import ALL
from studies.setup.flights import TOP
from symheli import FlightRecord, Helicopter
from symheli.flight import SimulatedFlight
from symheli.lpv import Product

SCHEDULING = ("airspeed_command", "acceleration_command")
FASTEST = 4.0
"""Largest commanded acceleration, m/s^2."""

PAIRS = {"xcell60": "xcell_kahn_hudson", "xcell_kahn_hudson": "xcell60"}
"""Vehicle whose simulator flies the instruments, by the vehicle that is identified."""
STANDARD = "xcell60"
"""Vehicle that stands for any other one, scaled to its rotor."""
RADIUS = "main_rotor.radius"


def simulator_of(vehicle: str, heli: Helicopter) -> tuple[str, Helicopter]:
    """Return name and helicopter whose simulator flies the instruments of `vehicle`, with the
    governor of `heli`: of a packaged X-Cell the other one, of any other vehicle the X-Cell .60,
    scaled by Froude's rule to the radius of its rotor.
    """
    name = PAIRS.get(vehicle, STANDARD)
    simulator = Helicopter.load(name, governor=heli.governor)
    if vehicle in PAIRS:
        return name, simulator
    factor = float(heli.parameters[RADIUS]) / float(simulator.parameters[RADIUS])
    return f"{name} scaled by {factor:.2f}", simulator.scaled(factor)


CONSTANT, ALONE, BOTH = "constant coefficients", "over airspeed", "over airspeed and acceleration"


def structure() -> KinematicARX:
    """Cubic in airspeed, quadratic in acceleration, of total degree 3."""
    basis = Product(
        (Polynomial(3, 0.0, TOP), Polynomial(2, -FASTEST, FASTEST)),
        total_degree=3,
    )
    return KinematicARX(ALL.inputs, SCHEDULING, basis=basis, nb=2, offset_rate=False)


def structures() -> dict[str, KinematicARX]:
    """The same beside those that are not scheduled on the acceleration, whose trims move with the
    rate of the airspeed instead, and on nothing.
    """
    both = structure()
    alone = replace(both, scheduling=SCHEDULING[0], basis=Polynomial(3, 0.0, TOP), offset_rate=True)
    return {CONSTANT: replace(alone, basis=Polynomial(0, 0.0, TOP)), ALONE: alone, BOTH: both}


def identified(
    records: FlightRecord | list[FlightRecord],
    simulator: Helicopter | SimulatedFlight,
    kin: KinematicARX | None = None,
) -> KinematicModel:
    """By the filter error method, its instruments flown in `simulator`. `kin`: another structure
    than that of `structure`. A `SimulatedFlight` keeps its flights for further identifications.
    """
    source = SimulatedFlight(simulator) if isinstance(simulator, Helicopter) else simulator
    return fit(kin or structure(), records, method=FilterError(source))
