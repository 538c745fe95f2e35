"""Guarantees for LPV models: certified gains and stability, each with a proof that is verified
after the solver.

No solver is loaded by importing this package.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.lazy import lazily

if TYPE_CHECKING:
    from synthesis.analysis.decay_rate import decay_rate
    from synthesis.analysis.generalized_h2 import generalized_h2
    from synthesis.analysis.l2_gain import l2_gain
    from synthesis.analysis.stability import stability
    from synthesis.certificate import Attempt, Certificate, Proof, Seconds, Status
    from synthesis.design.h2 import h2
    from synthesis.design.hinf import hinf
    from synthesis.design.loop_shaping import ncf
    from synthesis.design.mixed_sensitivity import mixed_sensitivity
    from synthesis.design.point_design import DesignStatus, PointDesign
    from synthesis.forms import HigherOrder, Memory, Spline
    from synthesis.impose import Bernstein, Grid, SumOfSquares, Vertices
    from synthesis.lft.gain import lft_gain, lft_stability
    from synthesis.lft.multipliers import SCALINGS, Multiplier
    from synthesis.loops.handling_qualities import Bandwidth, bandwidth
    from synthesis.loops.margins import Margins, disk_margin, loop, margins
    from synthesis.lyapunov.box import BoxLyapunov
    from synthesis.lyapunov.spline import MemoryLyapunov, SplineLyapunov
    from synthesis.polynomial.matrix import PolynomialMatrix
    from synthesis.program.cone_program import Solver, installed_solvers
    from synthesis.worst.frozen import FrozenGain, frozen_gain
    from synthesis.worst.lft import BoxGain, frozen_box_gain
    from synthesis.worst.lower_bound import LowerBound, Search, lower_bound
    from synthesis.worst.trajectory import Trajectory

_ROOMS = {
    "synthesis.analysis.decay_rate": "decay_rate",
    "synthesis.analysis.generalized_h2": "generalized_h2",
    "synthesis.analysis.l2_gain": "l2_gain",
    "synthesis.analysis.stability": "stability",
    "synthesis.certificate": "Attempt Certificate Proof Seconds Status",
    "synthesis.design.h2": "h2",
    "synthesis.design.hinf": "hinf",
    "synthesis.design.loop_shaping": "ncf",
    "synthesis.design.mixed_sensitivity": "mixed_sensitivity",
    "synthesis.design.point_design": "DesignStatus PointDesign",
    "synthesis.forms": "HigherOrder Memory Spline",
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
    "synthesis.worst.trajectory": "Trajectory",
}

__all__ = [
    "SCALINGS",
    "Attempt",
    "Bandwidth",
    "Bernstein",
    "BoxGain",
    "BoxLyapunov",
    "Certificate",
    "DesignStatus",
    "FrozenGain",
    "Grid",
    "HigherOrder",
    "LowerBound",
    "Margins",
    "Memory",
    "MemoryLyapunov",
    "Multiplier",
    "PointDesign",
    "PolynomialMatrix",
    "Proof",
    "Search",
    "Seconds",
    "Solver",
    "Spline",
    "SplineLyapunov",
    "Status",
    "SumOfSquares",
    "Trajectory",
    "Vertices",
    "bandwidth",
    "decay_rate",
    "disk_margin",
    "frozen_box_gain",
    "frozen_gain",
    "generalized_h2",
    "h2",
    "hinf",
    "installed_solvers",
    "l2_gain",
    "lft_gain",
    "lft_stability",
    "loop",
    "lower_bound",
    "margins",
    "mixed_sensitivity",
    "ncf",
    "stability",
]

__getattr__ = lazily(__name__, _ROOMS)


def __dir__() -> list[str]:
    return list(__all__)
