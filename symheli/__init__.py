"""Helicopter models from hover to forward flight: symbolic equations in, exact linear families and
LPV models out.

Everything is loaded when first used: `import symheli` brings in neither CasADi nor a plotting
library. The examples of this package start from

>>> import numpy as np
>>> import symheli
>>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.lazy import lazily

if TYPE_CHECKING:
    from symheli.airframe.identified_models import (
        IdentifiedModel,
        identified_model,
        identified_models,
    )
    from symheli.airframe.vehicle import vehicles
    from symheli.environment import Air, Dryden, Gust, Wind, standard_atmosphere
    from symheli.errors import (
        AccuracyError,
        CertificateError,
        CompilerWarning,
        ConvergenceWarning,
        DataWarning,
        ExcitationError,
        FlightLostError,
        InputError,
        PrecisionWarning,
        SolverError,
        SymheliError,
        TrimError,
        UnknownNameError,
        ValidityWarning,
    )
    from symheli.flight import (
        AirspeedSchedule,
        Autopilot,
        Excitation,
        FlightBatch,
        FlightDataset,
        FlightPlan,
        ParameterMonitor,
        PureController,
        ScheduledController,
        Sensor,
        Servo,
        SimulatedFlight,
        StatefulController,
        TableController,
        fly,
        fly_batch,
        fly_campaign,
        gain_scheduled_lqr,
    )
    from symheli.flight.stitched_model import StitchedModel
    from symheli.helicopter import Helicopter
    from symheli.integrate import (
        Batch,
        CashKarp,
        DormandPrince,
        Feedback,
        Radau,
        RungeKutta4,
        Trajectory,
        simulate,
        simulate_batch,
    )
    from symheli.lpv import (
        LFT,
        LinearFamily,
        LinearModel,
        LPVStateSpace,
        Scheduling,
        StepResponse,
        UncertainStateSpace,
    )
    from symheli.progress import Progress, watched
    from symheli.records import FlightRecord
    from symheli.steady.airspeed_sweep import sweep
    from symheli.steady.derivative_table import DerivativeTable, derivatives
    from symheli.steady.equilibrium import TrimPoint, trim
    from symheli.steady.flight_condition import FlightCondition
    from symheli.steady.grid_sweep import sweep_grid
    from symheli.steady.linearization import linearize
    from symheli.steady.trim_batch import TrimBatch, trim_batch
    from symheli.steady.trim_map import TrimMap, trim_map
    from symheli.values import NamedVector, Signal

_ROOMS = {
    "symheli.helicopter": "Helicopter",
    "symheli.airframe.vehicle": "vehicles",
    "symheli.airframe.identified_models": "IdentifiedModel identified_model identified_models",
    "symheli.steady.flight_condition": "FlightCondition",
    "symheli.steady.equilibrium": "TrimPoint trim",
    "symheli.steady.linearization": "linearize",
    "symheli.steady.airspeed_sweep": "sweep",
    "symheli.steady.grid_sweep": "sweep_grid",
    "symheli.steady.trim_batch": "TrimBatch trim_batch",
    "symheli.steady.trim_map": "TrimMap trim_map",
    "symheli.steady.derivative_table": "DerivativeTable derivatives",
    "symheli.integrate": (
        "Batch CashKarp DormandPrince Feedback Radau RungeKutta4 Trajectory simulate simulate_batch"
    ),
    "symheli.flight": (
        "AirspeedSchedule Autopilot Excitation FlightBatch FlightDataset"
        " FlightPlan ParameterMonitor PureController ScheduledController Sensor Servo"
        " SimulatedFlight StatefulController TableController fly fly_batch fly_campaign"
        " gain_scheduled_lqr"
    ),
    "symheli.flight.stitched_model": "StitchedModel",
    "symheli.environment": "Air Dryden Gust Wind standard_atmosphere",
    "symheli.values": "NamedVector Signal",
    "symheli.records": "FlightRecord",
    "symheli.lpv": (
        "LFT LPVStateSpace LinearFamily LinearModel Scheduling StepResponse UncertainStateSpace"
    ),
    "symheli.progress": "Progress watched",
    "symheli.errors": (
        "AccuracyError CertificateError CompilerWarning ConvergenceWarning DataWarning"
        " ExcitationError FlightLostError InputError PrecisionWarning SolverError SymheliError"
        " TrimError UnknownNameError ValidityWarning"
    ),
}
__all__ = [
    "LFT",
    "AccuracyError",
    "Air",
    "AirspeedSchedule",
    "Autopilot",
    "Batch",
    "CashKarp",
    "CertificateError",
    "CompilerWarning",
    "ConvergenceWarning",
    "DataWarning",
    "DerivativeTable",
    "DormandPrince",
    "Dryden",
    "Excitation",
    "ExcitationError",
    "Feedback",
    "FlightBatch",
    "FlightCondition",
    "FlightDataset",
    "FlightLostError",
    "FlightPlan",
    "FlightRecord",
    "Gust",
    "Helicopter",
    "IdentifiedModel",
    "InputError",
    "LPVStateSpace",
    "LinearFamily",
    "LinearModel",
    "NamedVector",
    "ParameterMonitor",
    "PrecisionWarning",
    "Progress",
    "PureController",
    "Radau",
    "RungeKutta4",
    "ScheduledController",
    "Scheduling",
    "Sensor",
    "Servo",
    "Signal",
    "SimulatedFlight",
    "SolverError",
    "StatefulController",
    "StepResponse",
    "StitchedModel",
    "SymheliError",
    "TableController",
    "Trajectory",
    "TrimBatch",
    "TrimError",
    "TrimMap",
    "TrimPoint",
    "UncertainStateSpace",
    "UnknownNameError",
    "ValidityWarning",
    "Wind",
    "derivatives",
    "fly",
    "fly_batch",
    "fly_campaign",
    "gain_scheduled_lqr",
    "identified_model",
    "identified_models",
    "linearize",
    "simulate",
    "simulate_batch",
    "standard_atmosphere",
    "sweep",
    "sweep_grid",
    "trim",
    "trim_batch",
    "trim_map",
    "vehicles",
    "watched",
]
__version__ = "0.1.0"


__getattr__ = lazily(__name__, _ROOMS)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
