"""The model's equations outside CasADi: in SymPy, with any number of digits, and in print."""

from __future__ import annotations

from symheli.equations.document import latex, markdown
from symheli.equations.from_casadi import evaluate, to_steps, to_sympy
from symheli.equations.right_hand_side import RightHandSide, right_hand_side

__all__ = [
    "RightHandSide",
    "evaluate",
    "latex",
    "markdown",
    "right_hand_side",
    "to_steps",
    "to_sympy",
]
