"""The value types that every room shares: pure NumPy, no physics, no solver."""

from symheli.lpv.bases import (
    Basis,
    BSpline,
    FunctionSpace,
    Piece,
    PiecewiseLinear,
    Polynomial,
    Product,
    Spline,
    UserFunctions,
)
from symheli.lpv.conditioning import cut, decimate, low_pass, smooth, split, with_norm
from symheli.lpv.delay import pade_delay
from symheli.lpv.flight_record import FlightRecord
from symheli.lpv.lft import (
    LFT,
    Block,
    HoldError,
    Truncation,
    WellPosedness,
    append,
    connect,
    feedback,
    parallel,
    series,
)
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_grid import LinearGrid
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace, Matrices
from symheli.lpv.named_vector import NamedVector
from symheli.lpv.nu_gap import chordal_distance, nu_gap
from symheli.lpv.operating_point import OperatingPoint
from symheli.lpv.reduction import Reduction, reduce
from symheli.lpv.scheduling import Scheduling
from symheli.lpv.signal import Signal, signals
from symheli.lpv.simulate import simulate
from symheli.lpv.trim_schedule import TrimSchedule

__all__ = [
    "LFT",
    "BSpline",
    "Basis",
    "Block",
    "FlightRecord",
    "FunctionSpace",
    "HoldError",
    "LPVStateSpace",
    "LinearFamily",
    "LinearGrid",
    "LinearModel",
    "Matrices",
    "NamedVector",
    "OperatingPoint",
    "Piece",
    "PiecewiseLinear",
    "Polynomial",
    "Product",
    "Reduction",
    "Scheduling",
    "Signal",
    "Spline",
    "TrimSchedule",
    "Truncation",
    "UserFunctions",
    "WellPosedness",
    "append",
    "chordal_distance",
    "connect",
    "cut",
    "decimate",
    "feedback",
    "low_pass",
    "nu_gap",
    "pade_delay",
    "parallel",
    "reduce",
    "series",
    "signals",
    "simulate",
    "smooth",
    "split",
    "with_norm",
]
