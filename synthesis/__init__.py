"""Guarantees for LPV models: certified gains and stability, each with a proof that is verified
after the solver.

No solver is loaded by importing this package.

The examples of the designs start from a lag that grows unstable with p, disturbed by w and measured
with noise:

>>> import synthesis
>>> from symheli.lpv import LPVStateSpace, Scheduling
>>> lag = LPVStateSpace.polynomial(
...     A=[[[-1.0]], [[2.0]]],
...     B=[[[1.0, 0.0, 1.0]]],
...     C=[[[1.0], [0.0], [1.0]]],
...     D=[[[0, 0, 0], [0, 0, 1.0], [0, 0.1, 0]]],
...     scheduling=Scheduling("p", "1", 0.0, 1.0, rate=0.5),
...     states=["x"],
...     inputs=["w", "noise", "u"],
...     outputs=["z_x", "z_u", "y"],
... )
>>> plant = synthesis.Plant(
...     lag,
...     disturbances=["w", "noise"],
...     performance=["z_x", "z_u"],
...     controls=["u"],
...     measurements=["y"],
... )
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.lazy import lazily

if TYPE_CHECKING:
    from synthesis.analysis.gain_against_rate import gain_against_rate
    from synthesis.analysis.questions import decay_rate, generalized_h2, l2_gain, stability
    from synthesis.certificate import Attempt, Certificate, Proof, Seconds, Status
    from synthesis.forms import HigherOrder, Memory, Spline
    from synthesis.gain_curve import GainCurve
    from synthesis.impose import Bernstein, Grid, SumOfSquares, Vertices
    from synthesis.lft.gain import lft_gain, lft_stability
    from synthesis.lft.multipliers import SCALINGS, Multiplier
    from synthesis.loops.controller import Controller
    from synthesis.loops.frozen_reading import proven_around
    from synthesis.loops.handling_qualities import Bandwidth, bandwidth
    from synthesis.loops.margins import Margins, disk_margin, loop, margins
    from synthesis.loops.sampled_loop import SampledLoop, certify_sampled
    from synthesis.loops.wrong_parameter import with_wrong_parameter
    from synthesis.lpv.estimator import Estimator, estimator
    from synthesis.lpv.multiobjective import multiobjective
    from synthesis.lpv.objectives import H2, L2, EnergyToPeak, PoleRegion
    from synthesis.lpv.output_feedback import lft_feedback, output_feedback
    from synthesis.lpv.state_feedback import state_feedback
    from synthesis.lti.h2 import h2
    from synthesis.lti.hinf import hinf
    from synthesis.lti.loop_shaping import ncf
    from synthesis.lti.mixed_sensitivity import mixed_sensitivity
    from synthesis.lti.point_design import DesignStatus, PointDesign
    from synthesis.lyapunov.box import BoxLyapunov
    from synthesis.lyapunov.spline import MemoryLyapunov, SplineLyapunov
    from synthesis.plant.generalized import Generalized
    from synthesis.plant.plant import Plant
    from synthesis.polynomial.matrix import PolynomialMatrix
    from synthesis.program.cone_program import Solver, installed_solvers
    from synthesis.worst.frozen import FrozenGain, frozen_gain
    from synthesis.worst.lft import BoxGain, frozen_box_gain
    from synthesis.worst.lower_bound import LowerBound, Search, lower_bound
    from synthesis.worst.trajectory import SchedulingTrajectory

_ROOMS = {
    "synthesis.analysis.gain_against_rate": "gain_against_rate",
    "synthesis.analysis.questions": "decay_rate generalized_h2 l2_gain stability",
    "synthesis.certificate": "Attempt Certificate Proof Seconds Status",
    "synthesis.loops.controller": "Controller",
    "synthesis.lpv.estimator": "Estimator estimator",
    "synthesis.lpv.multiobjective": "multiobjective",
    "synthesis.lpv.objectives": "H2 L2 EnergyToPeak PoleRegion",
    "synthesis.lpv.output_feedback": "lft_feedback output_feedback",
    "synthesis.lpv.state_feedback": "state_feedback",
    "synthesis.loops.sampled_loop": "SampledLoop certify_sampled",
    "synthesis.loops.frozen_reading": "proven_around",
    "synthesis.plant.generalized": "Generalized",
    "synthesis.plant.plant": "Plant",
    "synthesis.lti.h2": "h2",
    "synthesis.lti.hinf": "hinf",
    "synthesis.lti.loop_shaping": "ncf",
    "synthesis.lti.mixed_sensitivity": "mixed_sensitivity",
    "synthesis.lti.point_design": "DesignStatus PointDesign",
    "synthesis.loops.wrong_parameter": "with_wrong_parameter",
    "synthesis.forms": "HigherOrder Memory Spline",
    "synthesis.gain_curve": "GainCurve",
    "synthesis.impose": "Bernstein Grid SumOfSquares Vertices",
    "synthesis.lft.gain": "lft_gain lft_stability",
    "synthesis.lft.multipliers": "SCALINGS Multiplier",
    "synthesis.loops.handling_qualities": "Bandwidth bandwidth",
    "synthesis.loops.margins": "Margins disk_margin loop margins",
    "synthesis.lyapunov.box": "BoxLyapunov",
    "synthesis.lyapunov.spline": "MemoryLyapunov SplineLyapunov",
    "synthesis.polynomial.matrix": "PolynomialMatrix",
    "synthesis.program.cone_program": "Solver installed_solvers",
    "synthesis.worst.frozen": "FrozenGain frozen_gain",
    "synthesis.worst.lft": "BoxGain frozen_box_gain",
    "synthesis.worst.lower_bound": "LowerBound Search lower_bound",
    "synthesis.worst.trajectory": "SchedulingTrajectory",
}

__all__ = [
    "H2",
    "L2",
    "SCALINGS",
    "Attempt",
    "Bandwidth",
    "Bernstein",
    "BoxGain",
    "BoxLyapunov",
    "Certificate",
    "Controller",
    "DesignStatus",
    "EnergyToPeak",
    "Estimator",
    "FrozenGain",
    "GainCurve",
    "Generalized",
    "Grid",
    "HigherOrder",
    "LowerBound",
    "Margins",
    "Memory",
    "MemoryLyapunov",
    "Multiplier",
    "Plant",
    "PointDesign",
    "PoleRegion",
    "PolynomialMatrix",
    "Proof",
    "SampledLoop",
    "SchedulingTrajectory",
    "Search",
    "Seconds",
    "Solver",
    "Spline",
    "SplineLyapunov",
    "Status",
    "SumOfSquares",
    "Vertices",
    "bandwidth",
    "certify_sampled",
    "decay_rate",
    "disk_margin",
    "estimator",
    "frozen_box_gain",
    "frozen_gain",
    "gain_against_rate",
    "generalized_h2",
    "h2",
    "hinf",
    "installed_solvers",
    "l2_gain",
    "lft_feedback",
    "lft_gain",
    "lft_stability",
    "loop",
    "lower_bound",
    "margins",
    "mixed_sensitivity",
    "multiobjective",
    "ncf",
    "output_feedback",
    "proven_around",
    "stability",
    "state_feedback",
    "with_wrong_parameter",
]

__getattr__ = lazily(__name__, _ROOMS)


def __dir__() -> list[str]:
    return list(__all__)
