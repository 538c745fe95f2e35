"""The model's equations outside CasADi: in SymPy, and with any number of digits."""

from __future__ import annotations

from symheli.equations.from_casadi import evaluate, to_steps, to_sympy
from symheli.equations.right_hand_side import RightHandSide, right_hand_side

__all__ = ["RightHandSide", "evaluate", "right_hand_side", "to_steps", "to_sympy"]
