"""The scalar operations of a CasADi function as data: one list, from which C source, NumPy and
CasADi evaluate alike.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi

from symheli.errors import InputError

COMPARISONS = ("lt", "le", "eq", "ne", "not", "and", "or")
"""Operations whose result is true or false."""
ARITHMETIC = ("add", "sub", "mul", "div", "neg", "sqrt", "fabs")
"""Operations on numbers, each correctly rounded by IEEE 754."""
EXTREMES = ("min", "max")
"""The smaller and larger of two numbers, b < a ? b : a and a < b ? b : a: one machine instruction,
and a first NaN stays.
"""

_TRANSLATED = ("sq", "twice", "inv", "sign", "if_else_zero", "assign")
_NAMES = {
    getattr(casadi, f"OP_{name.upper()}"): name
    for name in (*ARITHMETIC, *COMPARISONS, *_TRANSLATED)
}


@dataclass(frozen=True)
class Operation:
    """One scalar: the `name` of the operation and the positions of its `arguments` in the list.

    name: "input" (with `element`: which input, which entry), "constant" (with `value`), "select"
    (condition, yes, no), "number" (a condition as 1.0 or 0.0), one of `COMPARISONS`, `ARITHMETIC`
    or `EXTREMES`.
    """

    name: str
    arguments: tuple[int, ...] = ()
    value: float = 0.0
    element: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Program:
    """A function of vectors as a list of scalar operations, none repeated, none unused.

    `sizes`: length of each input. `outputs`: for each output the positions of its entries. Whoever
    evaluates the list in this order in IEEE double precision gets the same bits.
    """

    name: str
    sizes: tuple[int, ...]
    operations: tuple[Operation, ...]
    outputs: tuple[tuple[int, ...], ...]

    def depends(self, inputs: Sequence[int]) -> list[bool]:
        """Whether each operation depends on one of these inputs."""
        out: list[bool] = []
        for o in self.operations:
            out.append(
                o.element[0] in inputs if o.name == "input" else any(out[a] for a in o.arguments)
            )
        return out

    def hoist(self, varying: Sequence[int]) -> tuple[Program, Program]:
        """(held, rest): what does not depend on the `varying` inputs, and the rest given it, so
        that held work is done once.

        held(the other inputs) -> one vector; rest(varying inputs, that vector) -> outputs.
        """
        depends = self.depends(varying)
        handed = sorted(self._handed(depends))
        others = [i for i in range(len(self.sizes)) if i not in varying]
        held = replace(
            self,
            name=f"{self.name}_held",
            sizes=tuple(self.sizes[i] for i in others),
            outputs=(tuple(handed),),
            operations=tuple(_renamed(o, others) for o in self.operations),
        )
        given = {a: Operation("input", element=(len(varying), k)) for k, a in enumerate(handed)}
        rest = replace(
            self,
            sizes=(*(self.sizes[i] for i in varying), len(handed)),
            operations=tuple(
                given.get(k) or _renamed(o, varying) for k, o in enumerate(self.operations)
            ),
        )
        return _without_unused(held), _without_unused(rest)

    def _handed(self, depends: Sequence[bool]) -> set[int]:
        """Positions the dependent operations and the outputs need of the others; conditions are
        made again from their numbers.
        """
        wanted = [a for k, o in enumerate(self.operations) if depends[k] for a in o.arguments]
        wanted += [a for output in self.outputs for a in output]
        handed: set[int] = set()
        while wanted:
            position = wanted.pop()
            o = self.operations[position]
            if depends[position] or o.name == "constant" or position in handed:
                continue
            if o.name in COMPARISONS:
                wanted.extend(o.arguments)
            else:
                handed.add(position)
        return handed


def _renamed(operation: Operation, inputs: Sequence[int]) -> Operation:
    """An input operation counted among these inputs only; any other operation as it is."""
    if operation.name != "input" or operation.element[0] not in inputs:
        return operation
    return replace(
        operation, element=(list(inputs).index(operation.element[0]), operation.element[1])
    )


def program(function: casadi.Function, varying: Sequence[int] | None = None) -> Program:
    """The operations of an SX function of dense column vectors that needs no more than + - * / sqrt
    | |, comparisons and branches.

    Two sides of a branch become one selection; a divisor that is constant, used more than once, or
    independent of the `varying` inputs (default: all vary; see `Program.hoist`) is inverted once:
    values differ from CasADi's by rounding. Raises `InputError` where an operation has no such form
    (sin, exp, ...).
    """
    builder = _Builder()
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
                f"{function.name()}: CasADi operation {code} cannot be written without the"
                " mathematical library"
            )
    sizes = tuple(function.size1_in(i) for i in range(function.n_in()))
    read = Program(function.name(), sizes, tuple(builder.operations), tuple(map(tuple, outputs)))
    return _without_unused(
        _divisors_inverted(read, range(len(sizes)) if varying is None else varying)
    )


class _Builder:
    """A growing list of operations, each distinct one once."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._known: dict[tuple[object, ...], int] = {}

    def add(self, operation: Operation) -> int:
        key = (
            operation.name,
            operation.arguments,
            operation.value.hex(),
            operation.element,
        )  # hex: 0.0 and -0.0 differ
        if key not in self._known:
            self._known[key] = len(self.operations)
            self.operations.append(operation)
        return self._known[key]

    def apply(self, name: str, *arguments: int) -> int:
        return self.add(Operation(name, arguments))

    def constant(self, value: float) -> int:
        if not math.isfinite(value):
            raise InputError(f"a constant of the function is {value}")
        return self.add(Operation("constant", value=float(value)))

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
        """condition ? yes : no, as the smaller or larger of the two where that is what it says."""
        o = self.operations[condition]
        if o.name == "le" and o.arguments in ((yes, no), (no, yes)):
            return self.apply("min" if o.arguments == (yes, no) else "max", yes, no)
        return self.apply("select", condition, yes, no)


def _rewritten(
    given: Program, rule: Callable[[_Builder, Operation, Operation], int | None]
) -> Program:
    """The program with operations replaced: rule(builder, operation as given, the same with new
    arguments) -> position or None.
    """
    builder, moved = _Builder(), []
    for operation in given.operations:
        renumbered = replace(operation, arguments=tuple(moved[a] for a in operation.arguments))
        replaced = rule(builder, operation, renumbered)
        moved.append(builder.add(renumbered) if replaced is None else replaced)
    outputs = tuple(tuple(moved[a] for a in output) for output in given.outputs)
    return replace(given, operations=tuple(builder.operations), outputs=outputs)


def _divisors_inverted(given: Program, varying: Sequence[int]) -> Program:
    uses, depends = (
        Counter(o.arguments[1] for o in given.operations if o.name == "div"),
        given.depends(varying),
    )

    def rule(builder: _Builder, before: Operation, after: Operation) -> int | None:
        if before.name != "div":
            return None
        divisor = given.operations[before.arguments[1]]
        if divisor.name == "constant" and divisor.value != 0.0:
            return builder.apply("mul", after.arguments[0], builder.constant(1.0 / divisor.value))
        if uses[before.arguments[1]] > 1 or not depends[before.arguments[1]]:
            return builder.apply(
                "mul",
                after.arguments[0],
                builder.apply("div", builder.constant(1.0), after.arguments[1]),
            )
        return None

    return _rewritten(given, rule)


def _without_unused(given: Program) -> Program:
    used = {a for output in given.outputs for a in output}
    for position in reversed(range(len(given.operations))):
        if position in used:
            used.update(given.operations[position].arguments)
    new = {old: k for k, old in enumerate(sorted(used))}
    operations = tuple(
        replace(o, arguments=tuple(new[a] for a in o.arguments))
        for o in (given.operations[old] for old in sorted(used))
    )
    return replace(
        given,
        operations=operations,
        outputs=tuple(tuple(new[a] for a in output) for output in given.outputs),
    )
