"""The entries of matrices that change with the scheduling, by name and with units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from symheli.errors import InputError, UnknownNameError
from symheli.values.arrays import Array
from symheli.values.labelled import per
from symheli.values.signal import Signal


class Stacked(Protocol):
    """Matrices over any axes, which come first."""

    @property
    def A(self) -> Array:
        """(..., nx, nx)."""
        ...

    @property
    def B(self) -> Array:
        """(..., nx, nu)."""
        ...

    @property
    def C(self) -> Array:
        """(..., ny, nx)."""
        ...

    @property
    def D(self) -> Array:
        """(..., ny, nu)."""
        ...


class Names(Protocol):
    """Names of the rows and columns."""

    @property
    def states(self) -> tuple[Signal, ...]:
        """nx of them."""
        ...

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """nu of them."""
        ...

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """ny of them."""
        ...

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        ...


class MatrixEntry(NamedTuple):
    """One entry of A, B, C or D along the scheduling: its name, A[q, u], with unit, and values."""

    name: Signal
    values: Array


def entries(names: Names, matrices: Stacked) -> Iterator[MatrixEntry]:
    """Every entry, matrix by matrix and row by row."""
    outputs = [y.unit for y in names.outputs]
    for matrix, rows, units, columns in (
        ("A", names.states, rates(names), names.states),
        ("B", names.states, rates(names), names.inputs),
        ("C", names.outputs, outputs, names.states),
        ("D", names.outputs, outputs, names.inputs),
    ):
        values = getattr(matrices, matrix)
        for i, (row, unit) in enumerate(zip(rows, units, strict=True)):
            for j, column in enumerate(columns):
                name = Signal(f"{matrix}[{row}, {column}]", per(unit, column.unit))
                yield MatrixEntry(name, values[..., i, j])


def rates(names: Names) -> list[str]:
    """Units of the left sides of x' = A x + B u: those of the states per second, their own where
    x' is the next sample.
    """
    return [s.unit if names.dt is not None else per(s.unit, "s") for s in names.states]


def entry_called(models: Any, name: str) -> Array:
    """The values (...) of one entry such as "A[q, u]"; raises `UnknownNameError`, and `InputError`
    for a derivative, which is not an entry: kinematic terms are taken off it.
    """
    if name[:2] in ("X_", "Y_", "Z_", "L_", "M_", "N_"):
        raise InputError(
            f"{name!r} is a derivative: symheli.derivatives(family)[{name!r}]; an entry of the"
            ' matrices is called as family["A[q, u]"]'
        )
    return chosen(list(entries(models, models)), [name])[0].values


def chosen(every: Sequence[MatrixEntry], wanted: Sequence[str]) -> list[MatrixEntry]:
    """Entries of these names; raises `UnknownNameError`."""
    by_name = {str(e.name): e for e in every}
    for name in wanted:
        if name not in by_name:
            raise UnknownNameError("entry", name, by_name)
    return [by_name[name] for name in wanted]
