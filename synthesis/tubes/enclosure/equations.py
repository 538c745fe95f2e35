"""Functions as lists of operations, for the files of proofs."""

from __future__ import annotations

from typing import Any

import casadi

from symheli.codegen.evaluate import as_casadi
from symheli.codegen.program import Operation, ScalarProgram
from symheli.codegen.translation import operations
from symheli.errors import InputError


def written(function: casadi.Function) -> dict[str, Any]:
    """The operations of a function as JSON holds them: name, then the entry of an input, the value
    of a constant, or the positions of the arguments.
    """
    program = operations(function)
    rows = []
    for o in program.operations:
        match o.name:
            case "input":
                rows.append([o.name, *o.element])
            case "constant":
                rows.append([o.name, o.value])
            case _:
                rows.append([o.name, *o.arguments])
    return {
        "name": program.name,
        "sizes": list(program.sizes),
        "operations": rows,
        "outputs": [list(output) for output in program.outputs],
    }


def read(content: dict[str, Any]) -> casadi.Function:
    """The function of such a list.

    Raises `InputError` where an operation is none, or stands before its arguments.
    """
    rows = []
    for k, (name, *rest) in enumerate(content["operations"]):
        match name:
            case "input":
                i, j = map(int, rest)
                rows.append(Operation(name, element=(i, j)))
            case "constant":
                rows.append(Operation(name, value=float(rest[0])))
            case _:
                arguments = tuple(map(int, rest))
                if not all(0 <= a < k for a in arguments):
                    raise InputError(f"operation {k}, {name}, stands before its arguments")
                rows.append(Operation(str(name), arguments))
    outputs = tuple(tuple(map(int, output)) for output in content["outputs"])
    sizes = tuple(map(int, content["sizes"]))
    inputs = [o.element for o in rows if o.name == "input"]
    if not all(0 <= i < len(sizes) and 0 <= j < sizes[i] for i, j in inputs):
        raise InputError("an entry of an input that is none")
    if not all(0 <= k < len(rows) for output in outputs for k in output):
        raise InputError("an output that is no operation")
    try:
        return as_casadi(ScalarProgram(str(content["name"]), sizes, tuple(rows), outputs))
    except (KeyError, TypeError, RuntimeError) as error:
        raise InputError(f"no function of these operations: {error!r:.60}") from None
