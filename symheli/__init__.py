"""Helicopter models from hover to forward flight: symbolic equations in, exact linear families and
LPV models out.

Everything is loaded when first used: `import symheli` brings in neither CasADi nor a plotting
library.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from symheli.airspeed_sweep import sweep
    from symheli.derivative_table import DerivativeTable, derivatives
    from symheli.environment import Dryden, Gust, Wind, standard_atmosphere
    from symheli.equilibrium import TrimPoint, trim
    from symheli.errors import (
        ExcitationError,
        InputError,
        SymheliError,
        TrimError,
        UnknownNameError,
    )
    from symheli.flight import AirspeedSchedule, Excitation, Sensor, Servo, fly
    from symheli.grid_sweep import sweep_grid
    from symheli.helicopter import Helicopter
    from symheli.identified import identified_model
    from symheli.integrate import Trajectory, simulate, simulate_batch
    from symheli.linearization import linearize
    from symheli.lpv import (
        LFT,
        FlightRecord,
        LinearFamily,
        LinearGrid,
        LinearModel,
        LPVStateSpace,
        Scheduling,
        Signal,
    )
    from symheli.stitched_model import StitchedModel
    from symheli.trim_grid import TrimMap, trim_map

_HOME = {
    "Helicopter": "symheli.helicopter",
    "trim": "symheli.equilibrium",
    "TrimPoint": "symheli.equilibrium",
    "linearize": "symheli.linearization",
    **dict.fromkeys(("simulate", "simulate_batch", "Trajectory"), "symheli.integrate"),
    "sweep": "symheli.airspeed_sweep",
    "sweep_grid": "symheli.grid_sweep",
    **dict.fromkeys(("TrimMap", "trim_map"), "symheli.trim_grid"),
    **dict.fromkeys(("DerivativeTable", "derivatives"), "symheli.derivative_table"),
    "identified_model": "symheli.identified",
    "StitchedModel": "symheli.stitched_model",
    **dict.fromkeys(("Dryden", "Gust", "Wind", "standard_atmosphere"), "symheli.environment"),
    **dict.fromkeys(("fly", "AirspeedSchedule", "Excitation", "Sensor", "Servo"), "symheli.flight"),
    **dict.fromkeys(
        (
            "LFT",
            "FlightRecord",
            "LinearFamily",
            "LinearGrid",
            "LinearModel",
            "LPVStateSpace",
            "Scheduling",
            "Signal",
        ),
        "symheli.lpv",
    ),
    **dict.fromkeys(
        ("SymheliError", "InputError", "UnknownNameError", "TrimError", "ExcitationError"),
        "symheli.errors",
    ),
}

__all__ = [
    "LFT",
    "AirspeedSchedule",
    "DerivativeTable",
    "Dryden",
    "Excitation",
    "ExcitationError",
    "FlightRecord",
    "Gust",
    "Helicopter",
    "InputError",
    "LPVStateSpace",
    "LinearFamily",
    "LinearGrid",
    "LinearModel",
    "Scheduling",
    "Sensor",
    "Servo",
    "Signal",
    "StitchedModel",
    "SymheliError",
    "Trajectory",
    "TrimError",
    "TrimMap",
    "TrimPoint",
    "UnknownNameError",
    "Wind",
    "derivatives",
    "fly",
    "identified_model",
    "linearize",
    "simulate",
    "simulate_batch",
    "standard_atmosphere",
    "sweep",
    "sweep_grid",
    "trim",
    "trim_map",
]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'symheli' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
