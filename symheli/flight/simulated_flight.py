"""Repetition of a recorded flight in a simulation without noise and gusts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from symheli.environment import Wind
from symheli.errors import FlightLostError, InputError
from symheli.flight.fly import fly
from symheli.flight.plan import FlightPlan
from symheli.helicopter import Helicopter
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array

TIME_TOLERANCE = 0.02
"""Largest difference of the sample times of a record from those of its plan, as a fraction of the
sample period.
"""


@dataclass(frozen=True)
class SimulatedFlight:
    """The plan of a record, flown in a helicopter without sensor noise, gusts and turbulence.

    A source of instruments: what it flies depends on what was commanded and on nothing that
    happened, so that its signals know the noise of no record. The helicopter may be another one
    than that of the record.

    Parameters
    ----------
    heli : Helicopter
        The simulator.

    Raises
    ------
    InputError
        Not a helicopter.

    References
    ----------
    Gilson, Garnier and Van den Hof (2004), Instrumental variable methods for continuous-time
    closed-loop model identification, American Control Conference.

    Examples
    --------
    >>> slow = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> flight = symheli.fly(heli, slow, noise_db=30.0, seed=1)
    >>> clean = symheli.flight.SimulatedFlight(heli).flown(flight)
    >>> len(clean) == len(flight), bool(np.abs(clean["p"]).max() < np.abs(flight["p"]).max())
    (True, True)
    """

    heli: Helicopter
    _flights: dict[int, tuple[FlightPlan, FlightRecord]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        if not isinstance(self.heli, Helicopter):
            raise InputError(
                f"expected a Helicopter, got {self.heli!r:.80}; try Helicopter.load('xcell60')"
            )

    def __str__(self) -> str:
        return f"flown in {self.heli.vehicle.title}"

    def flown(self, record: FlightRecord) -> FlightRecord:
        """The samples of `record` (which may be part of its flight) as the simulator flies them.

        Raises `InputError` for a record without its plan or with other samples than the plan's, and
        where the simulator loses the flight.
        """
        plan = record.meta.get("plan")
        if not isinstance(plan, FlightPlan):
            raise InputError(
                "instruments from a simulated flight need the plan of the record, meta['plan'] (a"
                " FlightPlan: schedule, excitation, controller), and this record has none: put the"
                " plan that was flown there, or name the recorded excitation as instruments"
            )
        whole = self._whole(plan)
        return whole.rows(_same_samples(whole, record))

    def _whole(self, plan: FlightPlan) -> FlightRecord:
        known = self._flights.get(id(plan))
        if known is None:
            calm = replace(plan, noise_db=None, sensors=None, wind=Wind(plan.wind.steady))
            try:
                known = plan, fly(self.heli, calm)
            except FlightLostError as error:
                raise InputError(
                    f"the simulator loses this flight ({error}); use another simulator, or name the"
                    " recorded excitation as instruments"
                ) from error
            self._flights[id(plan)] = known
        return known[1]


def _same_samples(whole: FlightRecord, record: FlightRecord) -> Array:
    """True (n,) where a sample of the whole flight is one of the record."""
    nearest = np.rint((record.time - whole.time[0]) / whole.dt).astype(int)
    inside = (nearest >= 0) & (nearest < len(whole))
    if not inside.all() or not np.allclose(
        whole.time[nearest], record.time, rtol=0, atol=TIME_TOLERANCE * whole.dt
    ):
        raise InputError(
            f"the record has other samples than its plan ({record.time[0]:.6g} to"
            f" {record.time[-1]:.6g} s every {record.dt:.4g} s; flown every {whole.dt:.4g} s until"
            f" {whole.time[-1]:.6g} s): resampled and shifted records have no simulated twin"
        )
    keep = np.zeros(len(whole), bool)
    keep[nearest] = True
    return keep
