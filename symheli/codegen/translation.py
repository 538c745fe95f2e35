"""CasADi functions as programs."""

from __future__ import annotations

from collections.abc import Sequence

import casadi

from symheli.codegen.fusion import fused
from symheli.codegen.program import (
    ARITHMETIC,
    COMPARISONS,
    ELEMENTARY,
    Builder,
    Operation,
    ScalarProgram,
    without_unused,
)
from symheli.codegen.reciprocals import reciprocals
from symheli.errors import InputError

_TRANSLATED = ("sq", "twice", "inv", "sign", "if_else_zero", "assign", "tan", "fmin", "fmax")
_NAMES = {
    getattr(casadi, f"OP_{name.upper()}"): name
    for name in (*ARITHMETIC, *COMPARISONS, *ELEMENTARY, *_TRANSLATED)
}


def program(function: casadi.Function, varying: Sequence[int] | None = None) -> ScalarProgram:
    """The operations of an SX function of dense column vectors that needs no more than + - * / sqrt
    | |, fmin, fmax, sin, cos, tan, asin, atan2, exp, comparisons and branches.

    Two sides of a branch become one selection; a divisor that is constant, used more than once, or
    independent of the `varying` inputs (default: all vary; see `ScalarProgram.hoist`) is inverted
    once; products are fused with the sums that use them: values differ from CasADi's by rounding.
    Raises `InputError` where an operation has no such form (log, ...).
    """
    varies = range(function.n_in()) if varying is None else varying
    return without_unused(fused(without_unused(reciprocals(operations(function), varies)), varies))


def operations(function: casadi.Function) -> ScalarProgram:
    """The operations of such a function as they stand: nothing inverted, nothing fused."""
    builder = _Translator()
    registers: dict[int, int] = {}
    outputs = [[builder.constant(0.0)] * function.size1_out(i) for i in range(function.n_out())]
    for i in range(function.n_instructions()):
        code, to, of = (
            function.instruction_id(i),
            function.instruction_output(i),
            function.instruction_input(i),
        )
        if code == casadi.OP_OUTPUT:
            outputs[to[0]][to[1]] = builder.number(registers[of[0]])
        elif code == casadi.OP_INPUT:
            registers[to[0]] = builder.add(Operation("input", element=(of[0], of[1])))
        elif code == casadi.OP_CONST:
            registers[to[0]] = builder.constant(function.instruction_constant(i))
        elif code in _NAMES:
            registers[to[0]] = builder.translate(_NAMES[code], [registers[a] for a in of])
        else:
            raise InputError(
                f"{function.name()}: CasADi operation {code} has no form in a program; write it"
                f" with + - * / sqrt fabs, comparisons, if_else, tan, {', '.join(ELEMENTARY)}"
            )
    sizes = tuple(function.size1_in(i) for i in range(function.n_in()))
    read = ScalarProgram(
        function.name(), sizes, tuple(builder.operations), tuple(map(tuple, outputs))
    )
    return without_unused(read)


class _Translator(Builder):
    """Builds what each operation of CasADi means."""

    def number(self, a: int) -> int:
        return self.apply("number", a) if self.operations[a].name in COMPARISONS else a

    def condition(self, a: int) -> int:
        return (
            a if self.operations[a].name in COMPARISONS else self.apply("ne", a, self.constant(0.0))
        )

    def translate(self, name: str, arguments: list[int]) -> int:
        if name in ("not", "and", "or"):
            return self.apply(name, *map(self.condition, arguments))
        if name == "if_else_zero":
            return self.apply(
                "select",
                self.condition(arguments[0]),
                self.number(arguments[1]),
                self.constant(0.0),
            )
        a = [self.number(k) for k in arguments]
        match name:
            case "assign":
                return a[0]
            case "sq":
                return self.apply("mul", a[0], a[0])
            case "twice":
                return self.apply("add", a[0], a[0])
            case "tan":
                return self.apply("div", self.apply("sin", a[0]), self.apply("cos", a[0]))
            case "fmin" | "fmax":
                return self.apply(name[1:], *a)
            case "inv":
                return self.apply("div", self.constant(1.0), a[0])
            case "sign":
                zero = self.constant(0.0)
                positive = self.apply(
                    "select", self.apply("lt", zero, a[0]), self.constant(1.0), zero
                )
                return self.apply(
                    "select", self.apply("lt", a[0], zero), self.constant(-1.0), positive
                )
            case "add" if (
                selection := self._selection(a[0], a[1]) or self._selection(a[1], a[0])
            ) is not None:
                return selection
        return self.apply(name, *a)

    def _selection(self, a: int, b: int) -> int | None:
        """(c ? yes : 0) + (not c ? no : 0) as c ? yes : no."""
        first, second, zero = self.operations[a], self.operations[b], self.constant(0.0)
        if (
            first.name == second.name == "select"
            and first.arguments[2] == second.arguments[2] == zero
        ):
            condition, opposite = first.arguments[0], self.operations[second.arguments[0]]
            if opposite.name == "not" and opposite.arguments[0] == condition:
                return self._extreme(condition, first.arguments[1], second.arguments[1])
        return None

    def _extreme(self, condition: int, yes: int, no: int) -> int:
        """Translate condition ? yes : no, as the smaller or larger of the two where it is
        equivalent to that.
        """
        o = self.operations[condition]
        if o.name == "le" and o.arguments in ((yes, no), (no, yes)):
            return self.apply("min" if o.arguments == (yes, no) else "max", yes, no)
        return self.apply("select", condition, yes, no)
