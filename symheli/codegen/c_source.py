"""A program as C, for one point or for several side by side in vector registers."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources

from symheli.codegen.branches import Side, branches
from symheli.codegen.program import COMPARISONS, ELEMENTARY, Operation, ScalarProgram

_INFIX = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "lt": "<",
    "le": "<=",
    "eq": "==",
    "ne": "!=",
    "and": "&",
    "or": "|",
}


@dataclass(frozen=True)
class Layout:
    """`width` points in the lanes of vector registers, times `groups` of them interleaved to hide
    the latency of roots and quotients.
    """

    width: int = 1
    groups: int = 1

    @property
    def lanes(self) -> int:
        """Points computed at once."""
        return self.width * self.groups

    @property
    def _advice(self) -> str:
        """Compiler pragmas for choices that GCC does not make by itself.

        A point alone waits for roots and quotients, one after the other: a selection made by a
        branch does not wait for the side that is not taken, nor for the condition. Four fifths of
        the time of conditional moves.
        """
        if self.lanes == 1:
            return '#pragma GCC optimize("no-if-conversion")'
        return """#ifdef __AVX512F__
#pragma GCC target("prefer-vector-width=512")
#endif"""

    @property
    def prelude(self) -> str:
        """The beginning of every generated source: headers, the elementary functions and the
        type of a scalar for all lanes.
        """
        return f"""#include <math.h>
#include <stdlib.h>
#include <string.h>
#if defined(__GNUC__) && !defined(__clang__)
{self._advice}
#endif
{resources.files("symheli.codegen").joinpath("elementary.c").read_text(encoding="utf-8")}
#define LANES {self.lanes}
typedef double lane[LANES];
"""


def c_function(program: ScalarProgram, layout: Layout, name: str) -> str:
    """`static void name(const lane *in0, ..., lane *out0, ...)`: a plain loop over lanes that the
    compiler turns into vector code.

    Many lanes are not inlined: the compiler takes a third of the time, and the code is as fast.
    Each lane goes through the same operations in the same order, whatever the layout: its bits do
    not depend on its neighbours.
    """
    arguments = [f"const lane *restrict in{i}" for i in range(len(program.sizes))] + [
        f"lane *restrict out{i}" for i in range(len(program.outputs))
    ]
    separate = "" if layout.lanes == 1 else "__attribute__((noinline)) "
    lines = [
        f"{separate}static void {name}({', '.join(arguments)})",
        "{",
        f"  for (int l = 0; l < {layout.width}; ++l) {{",
    ]
    lines += _in_branches(program) if layout.lanes == 1 else _in_line(program, layout)
    for i, output in enumerate(program.outputs):
        for j, a in enumerate(output):
            lines += [
                f"    out{i}[{j}][l + {g * layout.width}] = {_operand(program, a, g)};"
                for g in range(layout.groups)
            ]
    return "\n".join([*lines, "  }", "}", ""])


def _in_line(program: ScalarProgram, layout: Layout) -> list[str]:
    """Every operation in order, both sides of every selection: what vector registers can do."""
    return [
        _definition(program, k, g, layout.width)
        for k, operation in enumerate(program.operations)
        if operation.name != "constant"
        for g in range(layout.groups)
    ]


def _in_branches(program: ScalarProgram) -> list[str]:
    """Write code for one point only: operations that only one side of a selection needs are
    computed only where it is taken.
    """
    homes = branches(program)
    inside: dict[Side, list[int]] = {}
    for k, operation in enumerate(program.operations):
        if operation.name != "constant":
            inside.setdefault(homes[k], []).append(k)

    def written(side: Side) -> list[str]:
        lines = []
        for k in inside.get(side, []):
            if not any((k, taken) in inside for taken in (True, False)):
                lines.append(_definition(program, k, 0, 1))
                continue
            condition, yes, no = (_operand(program, a, 0) for a in program.operations[k].arguments)
            lines += [
                f"    double {_name(k, 0)};",
                f"    if ({condition}) {{",
                *written((k, True)),
                f"    {_name(k, 0)} = {yes};",
                "    } else {",
            ]
            lines += [*written((k, False)), f"    {_name(k, 0)} = {no};", "    }"]
        return lines

    return written(None)


def _definition(program: ScalarProgram, position: int, group: int, width: int) -> str:
    operation = program.operations[position]
    kind = "_Bool" if operation.name in COMPARISONS else "double"
    return (
        f"    const {kind} {_name(position, group)} ="
        f" {_expression(program, operation, group, width)};"
    )


def _name(position: int, group: int) -> str:
    return f"{'abcdefgh'[group]}{position}"


def _operand(program: ScalarProgram, position: int, group: int) -> str:
    o = program.operations[position]
    return f"({o.value!r})" if o.name == "constant" else _name(position, group)


def _expression(program: ScalarProgram, o: Operation, group: int, width: int) -> str:
    a = [_operand(program, k, group) for k in o.arguments]
    if o.name in _INFIX:
        return f"{a[0]} {_INFIX[o.name]} {a[1]}"
    match o.name:
        case "input":
            return f"in{o.element[0]}[{o.element[1]}][l + {group * width}]"
        case "neg":
            return f"-{a[0]}"
        case "not":
            return f"!{a[0]}"
        case "select":
            return f"{a[0]} ? {a[1]} : {a[2]}"
        case "number":
            return f"{a[0]} ? 1.0 : 0.0"
        case "fma":
            return f"FUSED({a[0]}, {a[1]}, {a[2]})"
        case "fms":
            return f"FUSED({a[0]}, {a[1]}, -{a[2]})"
        case "fnma":
            return f"FUSED(-{a[0]}, {a[1]}, {a[2]})"
        case "min":
            return f"{a[1]} < {a[0]} ? {a[1]} : {a[0]}"
        case "max":
            return f"{a[0]} < {a[1]} ? {a[1]} : {a[0]}"
    if o.name in ELEMENTARY:
        return f"elementary_{o.name}({', '.join(a)})"
    return f"{o.name}({a[0]})"  # sqrt, fabs
