"""Reader of files of identified linear models: equations and parameters in the source's units,
converted to SI; one message lists all errors with their lines.
"""

from __future__ import annotations

import ast
import difflib
import operator
from collections.abc import Callable, Iterator, Mapping
from keyword import iskeyword
from typing import Any, NamedTuple

import numpy as np

from symheli.airframe.quantity import Quantity, read_quantity
from symheli.airframe.readable import (
    UNREADABLE,
    Problem,
    broken_lines,
    problem,
    readable,
    refuse,
)
from symheli.errors import InputError, UnknownNameError
from symheli.values.arrays import Array
from symheli.values.units import to_si

TABLES = ("states", "inputs", "equations", "parameters")
_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
}
_ROUNDING = 1e-9
"""Relative tolerance: far above rounding, far below any unit or nonlinearity."""


class LinearEquations(NamedTuple):
    """Content of the file in SI: units of states and inputs by name, coefficients (states, states
    and inputs) of the derivatives, and parameters.
    """

    states: Mapping[str, str]
    inputs: Mapping[str, str]
    coefficients: Array
    parameters: Mapping[str, Quantity]


class LinearModelFile:
    """Text of such a file, its tables and all errors found."""

    def __init__(self, path: str, text: str):
        self.path, self.lines = path, text.splitlines()
        self.tables, unread = readable(text)
        self.problems: list[Problem] = broken_lines(unread)
        self._factors: dict[str, float] = {}
        """{state or input: its unit in SI}, of those that can be read."""
        self._parameters: dict[str, Quantity] = {}

    def read(self) -> LinearEquations:
        """The equations; raises one `InputError` with everything that is wrong, in the order of the
        file.
        """
        sections = {table: self._table(table) for table in TABLES}
        states, inputs = (self._signals(sections[table], table) for table in ("states", "inputs"))
        self._read_parameters(sections["parameters"])
        self._named_once(sections)
        equations = self._equations(sections["equations"], sections["states"])
        signals = [*sections["states"], *sections["inputs"]]
        known = [*signals, *sections["parameters"]]
        rows = {state: self._row(state, text, signals, known) for state, text in equations.items()}
        refuse(self.path, self.problems)
        coefficients = np.array([rows[state] for state in states])
        return LinearEquations(states, inputs, coefficients + 0.0, self._parameters)

    def _wrong(self, section: str, entry: str, wrong: str) -> None:
        self.problems.append(problem(self.lines, section, entry, wrong))

    def _table(self, name: str) -> Mapping[str, Any]:
        """Return one of the sections; where it is missing, note that and take one with nearly that
        name.
        """
        found = self.tables.get(name)
        if isinstance(found, dict):
            return found
        others = [k for k, v in self.tables.items() if isinstance(v, dict) and k not in TABLES]
        near = difflib.get_close_matches(name, others, n=1, cutoff=0.6)
        meant = f"; did you mean [{name}] by [{near[0]}]?" if near else ""
        self._wrong(near[0] if near else name, "", f"section [{name}] is missing{meant}")
        return self.tables[near[0]] if near else {}

    def _signals(self, table: Mapping[str, Any], section: str) -> dict[str, str]:
        """{name: SI unit} of states or inputs; what cannot be read is noted."""
        if not table and isinstance(self.tables.get(section), dict) and section == "states":
            self._wrong(section, "", 'expected at least one state, as in u = "m/s"')
        out = {}
        for name, unit in table.items():
            if not _can_be_written(name):
                self._wrong(
                    section,
                    name,
                    f"{name!r} cannot stand in an equation: use letters, digits and underscores",
                )
            if unit == UNREADABLE:
                continue
            try:
                self._factors[name], out[name] = to_si(unit)
            except InputError as error:
                self._wrong(section, name, str(error))
        return out

    def _read_parameters(self, table: Mapping[str, Any]) -> None:
        """Every parameter that can be read; what is wrong with another is noted."""
        for name, given in table.items():
            if not _can_be_written(name):
                self._wrong(
                    "parameters",
                    name,
                    f"{name!r} cannot stand in an equation: use letters, digits and underscores",
                )
            if given == UNREADABLE:
                continue
            try:
                self._parameters[name] = _quantity(given)
            except InputError as error:
                self._wrong("parameters", name, str(error))

    def _named_once(self, tables: Mapping[str, Mapping[str, Any]]) -> None:
        """Note every name that means two things."""
        sections = ("states", "inputs", "parameters")
        for k, section in enumerate(sections):
            for name in tables[section]:
                for earlier in sections[:k]:
                    if name in tables[earlier]:
                        self._wrong(section, name, f"is the name of one of [{earlier}], too")

    def _equations(self, table: Mapping[str, Any], states: Mapping[str, Any]) -> dict[str, str]:
        """{state: right-hand side} of those that are there; what is missing or of no state is
        noted.
        """
        out = {}
        missing = [state for state in states if state not in table]
        for name, text in table.items():
            if name not in states:
                self._wrong("equations", name, str(UnknownNameError("state", name, states)))
                for near in difflib.get_close_matches(name, missing, n=1, cutoff=0.4):
                    missing.remove(near)
            elif isinstance(text, str):
                out[name] = text
            elif text != UNREADABLE:
                self._wrong("equations", name, f'expected a text such as "X_u*u", got {text!r}')
        if missing and isinstance(self.tables.get("equations"), dict):
            those = (
                f"is that of {missing[0]}"
                if len(missing) == 1
                else (f"are those of {', '.join(missing)}")
            )
            self._wrong("equations", "", f"expected one equation a state; missing {those}")
        return out

    def _row(self, state: str, text: str, signals: list[str], known: list[str]) -> Array | None:
        """Coefficients in SI of the derivative of a state; None where that was noted."""
        try:
            tree, names = _parsed(text)
        except InputError as error:
            self._wrong("equations", state, str(error))
            return None
        unknown = [name for name in names if name not in known]
        for name in unknown:
            self._wrong("equations", state, str(UnknownNameError("name", name, known)))
        if unknown:
            return None
        numbers = {n: q.value for n, q in self._parameters.items()}
        theirs = {n: q.value / to_si(q.given)[0] for n, q in self._parameters.items()}
        unread = {*names} - {*signals, *numbers}
        stand_in = dict.fromkeys(unread, 1.0)
        try:
            row = _linear(tree, signals, numbers | stand_in)
            in_their_units = _linear(tree, signals, theirs | stand_in)
        except (ZeroDivisionError, OverflowError) as error:
            self._wrong("equations", state, f"{text!r} cannot be evaluated: {error}")
            return None
        if row is None or in_their_units is None:
            self._wrong(
                "equations",
                state,
                f"must be linear in states and inputs, without a constant: {text!r}",
            )
            return None
        if state in self._factors and not unread:
            self._units_fit(state, signals, row, in_their_units)
        return row

    def _units_fit(self, state: str, signals: list[str], row: Array, theirs: Array) -> None:
        """Note the terms of an equation whose units are inconsistent in SI."""
        wrong = []
        for name, made, given in zip(signals, row, theirs, strict=True):
            if name in self._factors:
                expected = given * self._factors[state] / self._factors[name]
                if abs(made - expected) > _ROUNDING * abs(expected):
                    wrong.append((name, made, given, expected))
        if wrong:
            (name, made, given, expected), *others = wrong
            too = f"; so does the one with {', '.join(n for n, *_ in others)}" if others else ""
            self._wrong(
                "equations",
                state,
                f"the units do not fit: the term with {name} is {given:g} in the file's units,"
                f" {expected:g} in SI, but its parameters in SI make {made:g}{too}; check their"
                " units",
            )


def _quantity(given: Any) -> Quantity:
    """Return a parameter in the SI unit of its declaration; the `InputError` lists all errors."""
    wrong = []
    table = given if isinstance(given, dict) else {}
    if not table:
        raise InputError(f"write {{ value = ..., unit = ..., source = ... }}, got {given!r}")
    unit = "1"
    if "unit" not in table:
        wrong.append("the unit is missing: '1' where there is none")
    else:
        try:
            unit = to_si(table["unit"])[1]
        except InputError as error:
            wrong.append(str(error))
    try:
        made = read_quantity("", table | {"unit": "1"} if wrong else table, unit)
    except InputError as error:
        wrong.append(str(error).removeprefix(": "))
    if wrong:
        raise InputError("; ".join(wrong))
    return made


def _can_be_written(name: str) -> bool:
    return name.isidentifier() and not iskeyword(name)


def _parsed(text: str) -> tuple[ast.AST, list[str]]:
    """An expression and the names in it, each once; raises `InputError` where it has more than
    names, numbers and + - * / ( ).
    """
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        names = [node.id for node in _parts(tree, text) if isinstance(node, ast.Name)]
    except InputError:
        raise
    except (SyntaxError, ValueError, RecursionError) as error:
        reason = getattr(error, "msg", error)
        raise InputError(f"{text!r} cannot be evaluated: {reason}") from error
    return tree, list(dict.fromkeys(names))


def _parts(node: ast.AST, text: str) -> Iterator[ast.AST]:
    """Yield names and numbers of an expression."""
    match node:
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
            yield from _parts(left, text)
            yield from _parts(right, text)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATIONS:
            yield from _parts(operand, text)
        case ast.Name() | ast.Constant(value=int() | float()):
            yield node
        case _:
            raise InputError(f"expected names, numbers and + - * / ( ), got {text!r}")


def _value(node: ast.AST, names: Mapping[str, float]) -> float:
    """Value of an expression of `_parts`."""
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_value(left, names), _value(right, names))
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATIONS[type(op)](_value(operand, names))
        case ast.Name(id=name):
            return names[name]
        case ast.Constant(value=int() | float() as number):
            return float(number)
    raise AssertionError(node)  # `_parts` lets nothing else through


def _linear(tree: ast.AST, signals: list[str], numbers: Mapping[str, float]) -> Array | None:
    """Coefficients (signals,) of an expression that is linear in them; None where it is not."""

    def value(at: Array) -> float:
        return _value(tree, {**numbers, **dict(zip(signals, at.tolist(), strict=True))})

    row = np.array([value(e) for e in np.eye(len(signals))])
    probe = np.arange(2.0, len(signals) + 2)
    with np.errstate(over="ignore", invalid="ignore"):
        miss = abs(value(probe) - row @ probe)
    return row if miss <= _ROUNDING * (1 + np.abs(row).max() * probe.max()) else None
