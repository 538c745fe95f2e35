"""Linear fractional transformations: the value, reduction, sampling, and the way from
and to polynomials.
"""

from symheli.lpv.lft.model import LFT
from symheli.lpv.lft.polynomial import expanded
from symheli.lpv.lft.sampling import HoldError
from symheli.lpv.lft.truncation import Truncation
from symheli.lpv.lft.well_posed import WellPosedness
from symheli.lpv.lft_matrices import Block

__all__ = [
    "LFT",
    "Block",
    "HoldError",
    "Truncation",
    "WellPosedness",
    "expanded",
]
