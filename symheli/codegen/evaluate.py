"""A program evaluated on NumPy arrays, many points at once, or on CasADi symbols: the same
operations in the same order.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np

from symheli.codegen.program import Operation, ScalarProgram
from symheli.codegen.symbolic import (
    absolute,
    arcsin,
    arctan2,
    cos,
    dense,
    exp,
    sin,
    sqrt,
    where,
)

_OPERATIONS: dict[str, Callable[..., Any]] = {
    **{
        "add": operator.add,
        "sub": operator.sub,
        "mul": operator.mul,
        "div": operator.truediv,
        "neg": operator.neg,
    },
    **{"lt": operator.lt, "le": operator.le, "eq": operator.eq, "ne": operator.ne},
    "fma": lambda a, b, c: a * b + c,
    "fms": lambda a, b, c: a * b - c,
    "fnma": lambda a, b, c: c - a * b,
    **{"sqrt": sqrt, "fabs": absolute, "select": where},
    **{"sin": sin, "cos": cos, "asin": arcsin, "atan2": arctan2, "exp": exp},
    "min": lambda a, b: where(b < a, b, a),
    "max": lambda a, b: where(a < b, b, a),
    "not": lambda a: a == 0,
    "and": operator.mul,
    "or": lambda a, b: a + b != 0,
    "number": lambda a: where(a, 1.0, 0.0),
}


def evaluate(program: ScalarProgram, *inputs: Any) -> list[list[Any]]:
    """The elements of each output; `inputs[i][j]` is entry j of input i: a float, an (N,) array or
    a CasADi symbol.

    A fused operation is a product and a sum, each rounded, and sin, cos, ... are the library's
    own: where C fuses, its bits are others. A side of a branch that is not taken may overflow
    silently.
    """
    last_use = {a: k for k, o in enumerate(program.operations) for a in o.arguments}
    last_use |= {a: len(program.operations) for output in program.outputs for a in output}
    values: list[Any] = []
    with np.errstate(all="ignore"):
        for k, o in enumerate(program.operations):
            values.append(_value(o, values, inputs))
            for a in o.arguments:
                if last_use[a] == k:
                    values[a] = (
                        None  # arrays that fit the cache are worth more than a complete list
                    )
    return [[values[a] for a in output] for output in program.outputs]


def _value(o: Operation, values: Sequence[Any], inputs: Sequence[Any]) -> Any:
    if o.name == "input":
        return inputs[o.element[0]][o.element[1]]
    return (
        o.value if o.name == "constant" else _OPERATIONS[o.name](*(values[a] for a in o.arguments))
    )


def as_casadi(program: ScalarProgram) -> casadi.Function:
    """The program as a CasADi function for its virtual machine: the same bits as `evaluate` on
    arrays, but for the sign of a zero, as long as it needs no sin, cos, ...
    """
    symbols = [casadi.SX.sym(f"in{i}", size) for i, size in enumerate(program.sizes)]
    simplified = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)  # a (1/b) must not become a/b
    try:
        outputs = evaluate(program, *([s[j] for j in range(s.numel())] for s in symbols))
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(simplified)
    return casadi.Function(
        program.name, symbols, [dense(casadi.vertcat(*output)) for output in outputs]
    )
