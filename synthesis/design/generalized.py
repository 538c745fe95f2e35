"""temporary"""
from __future__ import annotations
from typing import NamedTuple
import numpy as np
Array = np.ndarray

class Generalized(NamedTuple):
    """x' = A x + B1 w + B2 u, z = C1 x + D11 w + D12 u, y = C2 x + D21 w + D22 u."""
    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    D12: Array
    D21: Array
    D22: Array
