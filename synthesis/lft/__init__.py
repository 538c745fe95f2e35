"""What the classical LFT tests can prove: parameters as fast as they like, one constant Lyapunov
matrix and a multiplier.
"""

from synthesis.lft.bounds import BoxGain, frozen_box_gain
from synthesis.lft.certificate import LFTCertificate, Trial
from synthesis.lft.gain import lft_gain, lft_stability
from synthesis.lft.multipliers import SCALINGS, Multiplier

__all__ = [
    "SCALINGS",
    "BoxGain",
    "LFTCertificate",
    "Multiplier",
    "Trial",
    "frozen_box_gain",
    "lft_gain",
    "lft_stability",
]
