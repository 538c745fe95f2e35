"""Invariant tubes: sets that a nonlinear helicopter, or any other model, does not leave, whatever
the gusts.
"""

from synthesis.tubes.coverage import Coverage, coverage
from synthesis.tubes.gain import LocalGain
from synthesis.tubes.motions import Motions
from synthesis.tubes.tube import Tube, tube

__all__ = ["Coverage", "LocalGain", "Motions", "Tube", "coverage", "tube"]
