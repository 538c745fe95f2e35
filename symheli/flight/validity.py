"""Whether flights under a controller stay where the equations of the helicopter are known to
hold.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.flight.flight_data import FlightData
from symheli.flight.plan import FlightPlan
from symheli.helicopter import Helicopter
from symheli.steady.validity import Validity, warn
from symheli.values.arrays import Array


def warn_of_flown(heli: Helicopter, flown: Sequence[FlightData]) -> None:
    """One `ValidityWarning` where flights went faster than the equations are known to hold for."""
    speeds = [data.column("airspeed") for data in flown]
    _warn(heli, np.array([np.nanmax(v, initial=0.0) for v in speeds]), "flown")


def warn_of_plans(heli: Helicopter, plans: Sequence[FlightPlan]) -> None:
    """Warn in the same way of commanded flights, before they are flown."""
    schedules = [plan.schedule for plan in plans]
    _warn(heli, np.array([max(s.start, *s.targets) for s in schedules]), "commanded")


def _warn(heli: Helicopter, speeds: Array, what: str) -> None:
    """By the largest airspeed of each flight (N,), m/s, taken as one in the plane of the disc."""

    def where(flight: int) -> str:
        named = f" in flight {flight}" if len(speeds) > 1 else ""
        return f"at {speeds[flight]:.4g} m/s, {what}{named}"

    velocity = np.column_stack([speeds, np.zeros((len(speeds), 2))])
    warn(Validity.of(heli).beyond(where, velocity))
