"""Orders and delays of a structure: one number for all, or a table by output and signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from symheli.errors import InputError, UnknownNameError

MAX_LAG = 10_000
"""Largest lag of a signal, samples."""

Table = tuple[tuple[int, ...], ...]
Orders = int | Mapping[str, "int | Mapping[str, int]"] | Sequence[Sequence[int]]
"""One number; {output: number}; for inputs {input: number}; {output: {signal: number}}; or rows,
one an output.
"""


def table(value: Orders, name: str, outputs: tuple[str, ...], signals: tuple[str, ...]) -> Table:
    """The order of each signal (column) in the equation of each output (row).

    Raises `InputError` for a number that is no order or a name left out, `UnknownNameError` for one
    that is not a signal.
    """
    if isinstance(value, Mapping):
        if outputs != signals and signals and set(value) <= set(signals):
            row = _row(value, name, signals)
            return tuple(row for _ in outputs)
        _complete(value, name, outputs, tuple(dict.fromkeys(outputs + signals)))
        return tuple(_row(value[y], f"{name} of {y}", signals) for y in outputs)
    if isinstance(value, Sequence) and not isinstance(value, str):
        rows = tuple(value)
        if len(rows) != len(outputs) or any(
            not isinstance(r, Sequence) or len(r) != len(signals) for r in rows
        ):
            raise InputError(
                f"{name}: expected one row an output with {len(signals)} numbers each, got"
                f" {value!r:.80}"
            )
        return tuple(tuple(_order(v, name) for v in row) for row in rows)
    return tuple((_order(value, name),) * len(signals) for _ in outputs)


def compact(
    value: Orders, name: str, outputs: tuple[str, ...], signals: tuple[str, ...]
) -> int | Table:
    """One number where all entries agree, the table otherwise: equal structures compare equal
    however they were written.
    """
    rows = table(value, name, outputs, signals)
    entries = {v for row in rows for v in row}
    if not entries:
        return _order(value, name) if isinstance(value, int) else 0
    return entries.pop() if len(entries) == 1 else rows


def _row(value: object, name: str, signals: tuple[str, ...]) -> tuple[int, ...]:
    if isinstance(value, Mapping):
        _complete(value, name, signals, signals)
        return tuple(_order(value[s], name) for s in signals)
    return (_order(value, name),) * len(signals)


def _complete(
    value: Mapping[str, object], name: str, names: tuple[str, ...], known: tuple[str, ...]
) -> None:
    for key in value:
        if key not in names:
            raise UnknownNameError(f"signal in {name}", key, known)
    missing = [n for n in names if n not in value]
    if missing:
        raise InputError(
            f"{name}: give a number for {', '.join(missing)} too (an order of 0 leaves a signal"
            " out)"
        )


def _order(value: object, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= MAX_LAG:
        raise InputError(
            f"{name}: expected an integer from 0 to {MAX_LAG}, a mapping by signal name or one row"
            " an output, got"
            f" {value!r:.80}"
        )
    return value
