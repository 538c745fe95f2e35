"""Guarantees for LPV models: certified gains and stability, each with a proof that is verified
after the solver.

No solver is loaded by importing this package.
"""

from synthesis.certificate import Attempt, Certificate
from synthesis.cone_program import Solver, installed_solvers
from synthesis.decay_rate import decay_rate
from synthesis.forms import Relaxation
from synthesis.frozen import FrozenGain, frozen_gain
from synthesis.generalized_h2 import generalized_h2
from synthesis.handling_qualities import Bandwidth, bandwidth
from synthesis.l2_gain import l2_gain, stability
from synthesis.lft import (
    SCALINGS,
    BoxGain,
    LFTCertificate,
    Multiplier,
    Trial,
    frozen_box_gain,
    lft_gain,
    lft_stability,
)
from synthesis.lower_bound import LowerBound, Search, lower_bound
from synthesis.lyapunov import MemoryLyapunov, SplineLyapunov
from synthesis.margins import Margins, disk_margin, loop, margins
from synthesis.polynomial import BoxCertificate, BoxLyapunov, PolynomialMatrix
from synthesis.verdict import Seconds, Status, Trajectory, Verdict

__all__ = [
    "SCALINGS",
    "Attempt",
    "Bandwidth",
    "BoxCertificate",
    "BoxGain",
    "BoxLyapunov",
    "Certificate",
    "FrozenGain",
    "LFTCertificate",
    "LowerBound",
    "Margins",
    "MemoryLyapunov",
    "Multiplier",
    "PolynomialMatrix",
    "Relaxation",
    "Search",
    "Seconds",
    "Solver",
    "SplineLyapunov",
    "Status",
    "Trajectory",
    "Trial",
    "Verdict",
    "bandwidth",
    "decay_rate",
    "disk_margin",
    "frozen_box_gain",
    "frozen_gain",
    "generalized_h2",
    "installed_solvers",
    "l2_gain",
    "lft_gain",
    "lft_stability",
    "loop",
    "lower_bound",
    "margins",
    "stability",
]
