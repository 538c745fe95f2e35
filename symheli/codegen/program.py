"""A function as a list of scalar operations, from which C source, NumPy and CasADi evaluate alike,
and what rewrites such a list.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from symheli.errors import InputError

COMPARISONS = ("lt", "le", "eq", "ne", "not", "and", "or")
"""Operations whose result is true or false."""
ARITHMETIC = ("add", "sub", "mul", "div", "neg", "sqrt", "fabs")
"""Operations on numbers, each correctly rounded by IEEE 754."""
FUSED = ("fma", "fms", "fnma")
"""a b + c, a b - c and c - a b: rounded once where the processor can, else twice."""
ELEMENTARY = ("sin", "cos", "asin", "atan2", "exp")
"""Functions within 2 units in the last place (elementary.c; NumPy and CasADi have their own)."""
EXTREMES = ("min", "max")
"""The smaller and larger of two numbers, b < a ? b : a and a < b ? b : a: one machine instruction,
and a first NaN stays.
"""


@dataclass(frozen=True)
class Operation:
    """One scalar: the `name` of the operation and the positions of its `arguments` in the list.

    name: "input" (with `element`: which input, which entry), "constant" (with `value`), "select"
    (condition, yes, no), "number" (a condition as 1.0 or 0.0), one of `COMPARISONS`, `ARITHMETIC`,
    `FUSED`, `ELEMENTARY` or `EXTREMES`.
    """

    name: str
    arguments: tuple[int, ...] = ()
    value: float = 0.0
    element: tuple[int, int] = (0, 0)

    def on(self, arguments: tuple[int, ...]) -> Operation:
        """Return the same operation on other arguments."""
        return Operation(self.name, arguments, self.value, self.element)


@dataclass(frozen=True)
class ScalarProgram:
    """A function of vectors as a list of scalar operations, none repeated, none unused.

    `sizes`: length of each input. `outputs`: for each output the positions of its entries. Whoever
    evaluates the list in IEEE double precision with the same `FUSED` and `ELEMENTARY` operations
    gets the same bits.
    """

    name: str
    sizes: tuple[int, ...]
    operations: tuple[Operation, ...]
    outputs: tuple[tuple[int, ...], ...]

    def count(self) -> Counter[str]:
        """How many operations of each name compute something, both sides of every selection
        counted.
        """
        return Counter(o.name for o in self.operations if o.name not in ("input", "constant"))

    def depends(self, inputs: Sequence[int]) -> list[bool]:
        """Whether each operation depends on one of these inputs."""
        out: list[bool] = []
        for o in self.operations:
            out.append(
                o.element[0] in inputs if o.name == "input" else any(out[a] for a in o.arguments)
            )
        return out

    def hoist(self, varying: Sequence[int]) -> tuple[ScalarProgram, ScalarProgram]:
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
        return without_unused(held), without_unused(rest)

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
    """Return an input operation with its number among these inputs only; any other operation
    unchanged.
    """
    if operation.name != "input" or operation.element[0] not in inputs:
        return operation
    return replace(
        operation, element=(list(inputs).index(operation.element[0]), operation.element[1])
    )


class Builder:
    """A growing list of operations, each distinct one once."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._known: dict[tuple[object, ...], int] = {}

    def add(self, operation: Operation) -> int:
        """Its position, new or known."""
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
        """Position of the operation `name` on these positions."""
        return self.add(Operation(name, arguments))

    def constant(self, value: float) -> int:
        """Position of a finite constant."""
        if not math.isfinite(value):
            raise InputError(f"a constant of the function is {value}")
        return self.add(Operation("constant", value=float(value)))


def rewritten(
    given: ScalarProgram, rule: Callable[[Builder, int, tuple[int, ...]], int | None]
) -> ScalarProgram:
    """The program with operations replaced: rule(builder, position in the given program, new
    positions of its arguments) -> new position, or None to keep it.
    """
    builder, moved = Builder(), []
    for k, operation in enumerate(given.operations):
        arguments = tuple(moved[a] for a in operation.arguments)
        replaced = rule(builder, k, arguments)
        moved.append(builder.add(operation.on(arguments)) if replaced is None else replaced)
    outputs = tuple(tuple(moved[a] for a in output) for output in given.outputs)
    return replace(given, operations=tuple(builder.operations), outputs=outputs)


def without_unused(given: ScalarProgram) -> ScalarProgram:
    """The program without the operations that no output needs."""
    used = {a for output in given.outputs for a in output}
    for position in reversed(range(len(given.operations))):
        if position in used:
            used.update(given.operations[position].arguments)
    new = {old: k for k, old in enumerate(sorted(used))}
    operations = tuple(
        o.on(tuple([new[a] for a in o.arguments]))
        for o in (given.operations[old] for old in sorted(used))
    )
    return replace(
        given,
        operations=operations,
        outputs=tuple(tuple(new[a] for a in output) for output in given.outputs),
    )
