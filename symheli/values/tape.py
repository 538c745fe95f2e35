"""A CasADi function as its list of operations, evaluated in any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import casadi

from symheli.errors import InputError


class Arithmetic(NamedTuple):
    """A kind of number: `constant` makes one from a float, `operations` has a function for every
    `casadi.OP_...` it knows.
    """

    constant: Callable[[float], Any]
    operations: Mapping[int, Callable[..., Any]]


class Instruction(NamedTuple):
    """Store `operation` of the registers `operands` in the register `result`; a constant carries
    its `value` instead.
    """

    operation: int
    result: int
    operands: tuple[int, ...]
    value: float = 0.0


@dataclass(frozen=True)
class Tape:
    """The operations of an SX function in order.

    `reads`: (register, argument, entry) of every scalar input used; `writes`: (output, row, column,
    register), in order of writing among the instructions at `at`, since registers are used again.
    """

    name: str
    registers: int
    sizes_in: tuple[tuple[int, int], ...]
    sizes_out: tuple[tuple[int, int], ...]
    steps: tuple[Instruction | _Read | _Write, ...]

    @classmethod
    def of(cls, function: casadi.Function) -> Tape:
        """Read the instructions of `function`; one that is not made of SX is expanded first. Raises
        `InputError` where it cannot be.
        """
        name = function.name()
        not_scalar = f"{name} calls what is no scalar operation (compiled code, a table, a solver)"
        if not function.is_a("SXFunction"):
            try:
                function = function.expand()
            except RuntimeError as error:
                raise InputError(not_scalar) from error
        outputs = [
            list(zip(*function.sparsity_out(i).get_triplet(), strict=True))
            for i in range(function.n_out())
        ]
        entries_in = [
            list(zip(*function.sparsity_in(i).get_triplet(), strict=True))
            for i in range(function.n_in())
        ]
        steps: list[Instruction | _Read | _Write] = []
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            if operation == casadi.OP_CALL:
                raise InputError(not_scalar)
            into, operands = function.instruction_output(k), function.instruction_input(k)
            if operation == casadi.OP_INPUT:
                steps.append(_Read(into[0], operands[0], *entries_in[operands[0]][operands[1]]))
            elif operation == casadi.OP_OUTPUT:
                steps.append(_Write(into[0], *outputs[into[0]][into[1]], operands[0]))
            elif operation == casadi.OP_CONST:
                steps.append(Instruction(operation, into[0], (), function.instruction_constant(k)))
            else:
                steps.append(Instruction(operation, into[0], tuple(operands)))
        sizes_in, sizes_out = (
            tuple(size(i) for i in range(n))
            for size, n in (
                (function.size_in, function.n_in()),
                (function.size_out, function.n_out()),
            )
        )
        return cls(name, function.sz_w(), sizes_in, sizes_out, tuple(steps))

    def run(
        self, arguments: Sequence[Sequence[Sequence[Any]]], arithmetic: Arithmetic
    ) -> list[list[list[Any]]]:
        """Every output as a list of rows, from every argument as a list of rows, in the given
        arithmetic.
        """
        self._check(arguments)
        registers: list[Any] = [None] * self.registers
        zero = arithmetic.constant(0.0)
        results = [[[zero] * columns for _ in range(rows)] for rows, columns in self.sizes_out]
        for step in self.steps:
            if isinstance(step, Instruction):
                if step.operation == casadi.OP_CONST:
                    registers[step.result] = arithmetic.constant(step.value)
                    continue
                carry_out = arithmetic.operations.get(step.operation)
                if carry_out is None:
                    raise InputError(
                        f"{self.name} uses {operation_name(step.operation)}, which this arithmetic"
                        " does not know"
                    )
                registers[step.result] = carry_out(*[registers[i] for i in step.operands])
            elif isinstance(step, _Read):
                registers[step.register] = arguments[step.argument][step.row][step.column]
            else:
                results[step.output][step.row][step.column] = registers[step.register]
        return results

    def _check(self, arguments: Sequence[Sequence[Sequence[Any]]]) -> None:
        if len(arguments) != len(self.sizes_in):
            raise InputError(
                f"{self.name} takes {len(self.sizes_in)} arguments, got {len(arguments)}"
            )
        for number, (argument, size) in enumerate(zip(arguments, self.sizes_in, strict=True)):
            got = (len(argument), len(argument[0]) if len(argument) else 0)
            if got != size or any(len(row) != size[1] for row in argument):
                raise InputError(
                    f"{self.name}: argument {number} must have shape {size}, got {got}"
                )


class _Read(NamedTuple):
    """Fill `register` from an entry of an argument."""

    register: int
    argument: int
    row: int
    column: int


class _Write(NamedTuple):
    """Put `register` into an entry of an output."""

    output: int
    row: int
    column: int
    register: int


@cache
def _operation_names() -> dict[int, str]:
    return {getattr(casadi, name): name for name in dir(casadi) if name.startswith("OP_")}


def operation_name(operation: int) -> str:
    """CasADi's name of an operation code, such as OP_MUL."""
    return _operation_names().get(operation, f"operation {operation}")
