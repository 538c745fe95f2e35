"""Simulation of every controller in the same gusts with the nonlinear helicopter."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from studies.controllers.design_choices import (
    LIMITED,
    MEASUREMENTS,
    NOISE,
    NOISE_SHARE,
    PERIOD,
    RATE,
)
from studies.controllers.designs import Designs
from studies.controllers.measures import Measures, measured
from symheli import AirspeedSchedule, FlightPlan, Helicopter, LPVStateSpace, Wind
from symheli.environment import Dryden
from symheli.errors import ValidityWarning
from symheli.flight import ScheduledController, Sensor, fly_batch

if TYPE_CHECKING:
    from synthesis.tubes import Tube

LOW, HIGH = 0.5, 12.0
"""Lowest and highest airspeed of the transition, m/s; the acceleration between them is the
permitted one.
"""

STEADY, ALTITUDE = (-2.0, 1.0, 0.0), 20.0
"""The steady wind (north, east, down, m/s), and the height of the turbulence, m."""

WINDS = (7.7, 15.4, 23.2)
"""Turbulence levels as mean winds at 20 ft, m/s: light, moderate, severe."""

BEYOND = (0.0, 1.9, 3.9, 34.8, 52.2)
"""Further levels at which the proven gains are tested: from still air, with sensor noise only, to
more than any weather.
"""

SEEDS, FEW_SEEDS = 20, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class TurbulentFlights:
    """One controller in turbulence of one size: `gust` is the standard deviation of its level
    components, m/s; one of `flights` a seed.
    """

    name: str
    wind: float
    gust: float
    flights: tuple[Measures, ...]

    @property
    def lost(self) -> int:
        """Number of flights that were lost."""
        return sum(flight.lost for flight in self.flights)

    def of(self, measure: Callable[[Measures], float]) -> tuple[float, float]:
        """Return median and largest value of a measure."""
        values = [measure(flight) for flight in self.flights]
        return float(np.median(values)), float(np.max(values))

    @property
    def ratio(self) -> float:
        """Median of the energy ratio."""
        return self.of(lambda flight: flight.ratio)[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlownControllers:
    """Simulated flights, by controller and within that by size."""

    flown: tuple[TurbulentFlights, ...]
    seeds: int
    duration: float

    def of(self, name: str) -> list[TurbulentFlights]:
        """Return the flights of one controller, by size."""
        return [one for one in self.flown if one.name == name]

    def at(self, wind: float) -> list[TurbulentFlights]:
        """Return the flights of all controllers, in turbulence of one size."""
        return [one for one in self.flown if one.wind == wind]

    def exceeded(self, name: str, gain: float) -> TurbulentFlights | None:
        """The flights in the least turbulence in which one of them has an energy ratio above a
        gain.
        """
        above = (f for f in self.of(name) if f.of(lambda flight: flight.ratio)[1] > gain)
        return min(above, key=lambda f: f.wind, default=None)

    def ranked(self, wind: float) -> list[TurbulentFlights]:
        """Return the controllers that lost no flight, the least median energy ratio first."""
        return sorted((f for f in self.at(wind) if not f.lost), key=lambda f: f.ratio)


def transition() -> AirspeedSchedule:
    """Return the transition forth and back at the acceleration that the certificates permit."""
    return AirspeedSchedule.transition(LOW, HIGH, acceleration=RATE, hold=3.0)


def plans(designs: Designs) -> Iterator[tuple[str, float, FlightPlan]]:
    """(controller, wind, plan) of every controller that exists, for every size."""
    for design in designs.designs:
        if design.controller is None:
            continue
        for wind in sorted((*WINDS, *BEYOND)):
            yield design.name, wind, plan(design.controller, wind)


def plan(controller: LPVStateSpace, wind: float) -> FlightPlan:
    """Return the transition with that controller in turbulence of one size, servos, noise and
    delay.
    """
    return FlightPlan(
        transition(),
        dt=PERIOD,
        controller=ScheduledController(controller),
        wind=Wind(STEADY, turbulence=Dryden(wind, ALTITUDE)),
        servos=LIMITED,
        sensors={y: Sensor(noise=NOISE_SHARE * NOISE[y]) for y in MEASUREMENTS},
    )


def fly_controllers(
    vehicle: str, designs: Designs, seeds: Sequence[int], tubes: Sequence[Tube] = ()
) -> FlownControllers:
    """Simulate every controller and size with every seed: the same gusts and noise for all
    of them; compared with these proven tubes.
    """
    heli = Helicopter.load(vehicle, governor="pi")
    planned = list(plans(designs))
    each = measures(heli, [p for *_, p in planned], seeds, tubes=tubes) if planned else []
    n = len(seeds)
    return FlownControllers(
        flown=tuple(
            TurbulentFlights(
                name=name,
                wind=wind,
                gust=float(Dryden(wind, ALTITUDE).intensities[0]),
                flights=tuple(each[i * n : (i + 1) * n]),
            )
            for i, (name, wind, _) in enumerate(planned)
        ),
        seeds=n,
        duration=transition().duration,
    )


def measures(
    heli: Helicopter,
    plans: Sequence[FlightPlan],
    seeds: Sequence[int],
    workers: int | None = None,
    tubes: Sequence[Tube] = (),
) -> list[Measures]:
    """Return the measures of every plan with every seed, with the time outside the validity range
    of the equations.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        return measured(fly_batch(heli, plans, seeds=seeds, workers=workers).data, tubes=tubes)
