"""Flights from the equations of motion: one at a time or thousands, by three methods, with their
derivatives both ways.
"""

from __future__ import annotations

from symheli.integrate.adaptive import CashKarp, DormandPrince
from symheli.integrate.batch import Batch, simulate_batch
from symheli.integrate.feedback import Feedback
from symheli.integrate.radau import Radau
from symheli.integrate.rk4 import RungeKutta4
from symheli.integrate.sensitivity import Gradient, gradient, tangent
from symheli.integrate.simulate import simulate
from symheli.integrate.step import runge_kutta
from symheli.integrate.trajectory import Trajectory

__all__ = [
    "Batch",
    "CashKarp",
    "DormandPrince",
    "Feedback",
    "Gradient",
    "Radau",
    "RungeKutta4",
    "Trajectory",
    "gradient",
    "runge_kutta",
    "simulate",
    "simulate_batch",
    "tangent",
]
