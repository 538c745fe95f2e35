"""Translation of CasADi functions to lists of scalar operations, and of those to C for one flight
or many side by side, or to NumPy.
"""

from __future__ import annotations

from symheli.codegen.c_source import Layout, c_function
from symheli.codegen.evaluate import as_casadi, evaluate
from symheli.codegen.program import Operation, ScalarProgram
from symheli.codegen.translation import program

__all__ = ["Layout", "Operation", "ScalarProgram", "as_casadi", "c_function", "evaluate", "program"]
