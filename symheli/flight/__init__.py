"""Closed-loop flights of the nonlinear model."""

from symheli.flight.ardupilot import HelicopterLoops, Pilot, RateController
from symheli.flight.autopilot import Autopilot, gain_scheduled_lqr
from symheli.flight.batch import FlightBatch, fly_batch
from symheli.flight.campaign import fly_campaign
from symheli.flight.controller import ScheduledController
from symheli.flight.excitation import Excitation
from symheli.flight.flight_dataset import FlightDataset
from symheli.flight.fly import fly
from symheli.flight.hypothesis_monitor import (
    HypothesisEvents,
    HypothesisMonitor,
    HypothesisState,
)
from symheli.flight.parameter_change import ParameterChange
from symheli.flight.parameter_monitor import ParameterMonitor
from symheli.flight.plan import FlightPlan
from symheli.flight.schedule import AirspeedSchedule
from symheli.flight.sensor import Sensor
from symheli.flight.servo import XCELL_SERVOS, Servo, ServoBank
from symheli.flight.simulated_flight import SimulatedFlight
from symheli.flight.stitched_model import StitchedModel
from symheli.flight.table_arithmetic import StepEvents, TableState
from symheli.flight.table_controller import TableController
from symheli.values.controllers import PureController, StatefulController

__all__ = [
    "XCELL_SERVOS",
    "AirspeedSchedule",
    "Autopilot",
    "Excitation",
    "FlightBatch",
    "FlightDataset",
    "FlightPlan",
    "HelicopterLoops",
    "HypothesisEvents",
    "HypothesisMonitor",
    "HypothesisState",
    "ParameterChange",
    "ParameterMonitor",
    "Pilot",
    "PureController",
    "RateController",
    "ScheduledController",
    "Sensor",
    "Servo",
    "ServoBank",
    "SimulatedFlight",
    "StatefulController",
    "StepEvents",
    "StitchedModel",
    "TableController",
    "TableState",
    "fly",
    "fly_batch",
    "fly_campaign",
    "gain_scheduled_lqr",
]
