"""Linear models identified from flight by others: equations and parameters from a file, in SI with
names and units.
"""

from __future__ import annotations

import ast
import operator
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from symheli.airframe.quantity import Quantity, read_quantity
from symheli.airframe.vehicle_file import LINEAR
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.values.signal import Signal
from symheli.values.summary import as_table, summarized
from symheli.values.text_file import text_of
from symheli.values.units import to_si

_TABLES = ("states", "inputs", "equations", "parameters")
_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
}


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModel(LinearModel):
    """A `LinearModel` from the literature, with C = I.

    Parameters
    ----------
    A, B, C, D, states, inputs, outputs, dt, point
        As in `LinearModel`.
    title, source : str
        What it is of, and where from.
    parameters : mapping of str to Quantity
        In SI by the source's names. Those that are disputed or were not at hand have `assumed` set,
        and their source says why they are what they are.

    Examples
    --------
    >>> model = symheli.identified_model("r50_hover")
    >>> [str(s) for s in model.inputs], len(model.parameters) > 20
    (['lat', 'lon', 'ped', 'col'], True)
    """

    title: str = ""
    source: str = ""
    parameters: Mapping[str, Quantity] = field(default_factory=dict)

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def assumed(self) -> list[str]:
        """Names of the parameters that are not the source's."""
        return [name for name, quantity in self.parameters.items() if quantity.assumed]


def identified_models() -> list[str]:
    """Names of the identified linear models that come with the package.

    Returns
    -------
    list of str
        What `identified_model` takes, beside a path.

    Examples
    --------
    >>> symheli.identified_models()
    ['r50_hover']
    """
    names = (p.name for p in resources.files("symheli.airframe.vehicles").iterdir())
    return sorted(name.removesuffix(LINEAR) for name in names if name.endswith(LINEAR))


def identified_model(name_or_path: str | os.PathLike[str]) -> IdentifiedModel:
    """A linear model from the literature.

    The file gives for each state its unit and the equation of its derivative, for each parameter
    value, unit and source. That the units fit is checked: the equations must say the same in the
    file's units and in SI.

    Parameters
    ----------
    name_or_path : str or path
        A packaged model ("r50_hover": Yamaha R-50 in hover), or any file of that form.

    Returns
    -------
    IdentifiedModel
        A `LinearModel` with its title, source and parameters.

    Raises
    ------
    InputError
        No such model, or units that do not fit.

    References
    ----------
    Each file names its own.

    Examples
    --------
    >>> model = symheli.identified_model("r50_hover")
    >>> model.A.shape, model.is_stable()
    ((13, 13), False)
    """
    given = os.fspath(name_or_path)
    if given.endswith(".toml"):
        if not Path(given).is_file():
            raise InputError(
                f"no model file at {given}; packaged models: {', '.join(identified_models())}"
            )
        text = text_of(Path(given))
    elif given in identified_models():
        text = (resources.files("symheli.airframe.vehicles") / f"{given}{LINEAR}").read_text(
            encoding="utf-8"
        )
    else:
        raise UnknownNameError("identified model", given, identified_models())
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{given} is not valid TOML: {error}") from error
    for table in _TABLES:
        if not isinstance(data.get(table), dict):
            raise InputError(f"{given}: section [{table}] is missing")
    return _model(given, data)


def _model(path: str, data: Mapping[str, Any]) -> IdentifiedModel:
    states, inputs, equations = data["states"], data["inputs"], data["equations"]
    if list(equations) != list(states):
        raise InputError(
            f"{path}: expected one equation a state in the same order: {', '.join(states)}; got"
            f" {', '.join(equations)}"
        )
    signals = {name: Signal(name, to_si(unit)[1]) for name, unit in {**states, **inputs}.items()}
    factor = {name: to_si(unit)[0] for name, unit in {**states, **inputs}.items()}
    parameters = {
        name: read_quantity(f"{path}, parameters.{name}", table, _si(path, name, table))
        for name, table in data["parameters"].items()
    }
    raw = {name: float(table["value"]) for name, table in data["parameters"].items()}
    matrix, theirs = (
        _coefficients(path, equations, list(signals), numbers)
        for numbers in ({n: q.value for n, q in parameters.items()}, raw)
    )
    rows, columns = np.array([factor[s] for s in states]), np.array([factor[s] for s in signals])
    expected = theirs * rows[:, None] / columns
    wrong = np.argwhere(
        np.abs(matrix - expected) > 1e-9 * np.abs(expected)
    )  # far above rounding, far below any unit
    if len(wrong):
        i, j = wrong[0]
        raise InputError(
            f"{path}, equations.{list(states)[i]}: the units do not fit: the term with"
            f" {list(signals)[j]} is {theirs[i, j]:g} in the file's units, {expected[i, j]:g} in"
            f" SI, but its parameters in SI make {matrix[i, j]:g}; check their units"
        )
    n = len(states)
    return IdentifiedModel(
        A=matrix[:, :n] + 0.0,
        B=matrix[:, n:] + 0.0,
        C=np.eye(n),
        D=np.zeros((n, len(inputs))),
        states=tuple(signals[s] for s in states),
        inputs=tuple(signals[s] for s in inputs),
        outputs=tuple(signals[s] for s in states),
        title=str(data.get("title", path)),
        source=str(data.get("source", "")),
        parameters=parameters,
    )


def _si(path: str, name: str, table: Any) -> str:
    """The SI unit of what a parameter declares."""
    try:
        return to_si(str(table["unit"]))[1]
    except (InputError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}, parameters.{name}: write {{ value = ..., unit = ..., source = ... }}: {error}"
        ) from error


def _coefficients(
    path: str, equations: Mapping[str, str], variables: list[str], parameters: Mapping[str, float]
) -> np.ndarray:
    """Coefficients (equations, variables) of equations that are linear in the variables; raises
    `InputError` where one is not.
    """

    def values(at: np.ndarray) -> np.ndarray:
        names = {**parameters, **dict(zip(variables, at.tolist(), strict=True))}
        return np.array(
            [_value(f"{path}, equations.{row}", text, names) for row, text in equations.items()]
        )

    matrix = np.column_stack([values(e) for e in np.eye(len(variables))])
    probe = np.arange(2.0, len(variables) + 2)
    for row, miss in zip(equations, np.abs(values(probe) - matrix @ probe), strict=True):
        if miss > 1e-9 * (
            1 + np.abs(matrix).max() * probe.max()
        ):  # rounding only, where every term is linear
            raise InputError(
                f"{path}, equations.{row}: must be linear in states and inputs, without a constant:"
                f" {equations[row]!r}"
            )
    return matrix


def _value(where: str, text: str, names: Mapping[str, float]) -> float:
    """Value of an expression of names, numbers and + - * / ( )."""

    def walk(node: ast.AST) -> float:
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)](walk(node.left), walk(node.right))
        if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)](walk(node.operand))
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return float(node.value)
        if isinstance(node, ast.Name):
            if node.id not in names:
                raise InputError(f"{where}: {UnknownNameError('name', node.id, names)}")
            return names[node.id]
        raise InputError(f"{where}: expected names, numbers and + - * / ( ), got {text!r}")

    try:
        return walk(ast.parse(text, mode="eval").body)
    except (SyntaxError, ZeroDivisionError) as error:
        raise InputError(f"{where}: {text!r} cannot be evaluated: {error}") from error
