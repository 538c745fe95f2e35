"""Closed-loop flights of the nonlinear model."""

from symheli.flight.autopilot import Autopilot, gain_scheduled_lqr
from symheli.flight.excitation import Excitation
from symheli.flight.fly import fly
from symheli.flight.schedule import AirspeedSchedule

__all__ = ["AirspeedSchedule", "Autopilot", "Excitation", "fly", "gain_scheduled_lqr"]
