"""Linear, LPV and LFT models: pure NumPy, no physics, no solver.

The examples of this package start from a spring that stiffens with p:

>>> import numpy as np
>>> from symheli import lpv
>>> spring = lpv.LPVStateSpace.polynomial(
...     A=[[[0.0, 1.0], [-2.0, -1.0]], [[0.0, 0.0], [-0.5, 0.0]]],
...     B=[[[0.0], [1.0]]],
...     C=[[[1.0, 0.0]]],
...     D=[[[0.0]]],
...     scheduling=lpv.Scheduling("p", "1", low=0.0, high=1.0),
... )
"""

from symheli.lpv.balanced_truncation import BalancedTruncation, balanced_truncation
from symheli.lpv.bases import (
    Basis,
    BSpline,
    CubicSpline,
    FunctionSpace,
    Patches,
    Piece,
    PiecewiseLinear,
    Polynomial,
    Product,
    UserFunctions,
)
from symheli.lpv.delay import pade_delay, sample_delay
from symheli.lpv.frozen_plots import bode, damping, nyquist, pole_map, sigma, step
from symheli.lpv.interconnection import append, connect, feedback, parallel, series
from symheli.lpv.lagged import lagged
from symheli.lpv.lft import (
    LFT,
    Block,
    HoldError,
    Truncation,
    WellPosedness,
)
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.linear_models import LinearModels
from symheli.lpv.lower_feedback import lower_feedback
from symheli.lpv.lpv_state_space import LPVStateSpace, Matrices
from symheli.lpv.minimal_realization import minimal_realization
from symheli.lpv.nu_gap import chordal_distance, nu_gap, nu_gaps
from symheli.lpv.scheduling import Scheduling
from symheli.lpv.simulate import simulate
from symheli.lpv.slider import slider
from symheli.lpv.stability_margin import stability_margin
from symheli.lpv.step_response import StepResponse
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.lpv.uncertain_state_space import UncertainStateSpace

__all__ = [
    "LFT",
    "BSpline",
    "BalancedTruncation",
    "Basis",
    "Block",
    "CubicSpline",
    "FunctionSpace",
    "HoldError",
    "LPVStateSpace",
    "LinearFamily",
    "LinearModel",
    "LinearModels",
    "Matrices",
    "Patches",
    "Piece",
    "PiecewiseLinear",
    "Polynomial",
    "Product",
    "Scheduling",
    "StepResponse",
    "TrimSchedule",
    "Truncation",
    "UncertainStateSpace",
    "UserFunctions",
    "WellPosedness",
    "append",
    "balanced_truncation",
    "bode",
    "chordal_distance",
    "connect",
    "damping",
    "feedback",
    "lagged",
    "lower_feedback",
    "minimal_realization",
    "nu_gap",
    "nu_gaps",
    "nyquist",
    "pade_delay",
    "parallel",
    "pole_map",
    "sample_delay",
    "series",
    "sigma",
    "simulate",
    "slider",
    "stability_margin",
    "step",
]
