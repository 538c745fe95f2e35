"""A signal: a name with a unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from symheli.errors import InputError, UnknownNameError

UNITS = {
    **dict.fromkeys(("u", "v", "w", "airspeed", "airspeed_command"), "m/s"),
    **dict.fromkeys(("u_w", "v_w", "w_w", "wind_n", "wind_e", "wind_d"), "m/s"),
    **dict.fromkeys(("p", "q", "r"), "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi", "a1", "b1", "d_lon", "d_lat", "d_col", "d_ped"), "rad"),
    **dict.fromkeys(("x_n", "x_e", "x_d"), "m"),
    "Om": "rad/s",
    "om_i": "rad",
}
"""Units of the signals every room knows (body axes x forward, y right, z down; SI and radians)."""


class Signal(str):
    """A signal name (it compares, hashes and prints as that string) with its `unit`.

    Parameters
    ----------
    name : str
        As in equations and records.
    unit : str, optional
        Default that of a well-known name, "1" for any other.

    Examples
    --------
    >>> theta = symheli.values.Signal("theta")
    >>> theta == "theta", theta.unit, symheli.values.Signal("altitude", "m").unit
    (True, 'rad', 'm')
    """

    unit: str
    __slots__ = ("unit",)

    def __new__(cls, name: str, unit: str | None = None) -> Signal:
        """The name, with its unit where given, known or carried by `name`."""
        self = super().__new__(cls, name)
        self.unit = unit or getattr(name, "unit", None) or UNITS.get(name, "1")
        return self

    def __getnewargs__(self) -> tuple[str, str]:
        return str(self), self.unit


def signals(names: Iterable[str], units: Mapping[str, str] | None = None) -> tuple[Signal, ...]:
    """A tuple of `Signal`s; `units` overrides the known unit by name. Repeated names raise
    `InputError`.
    """
    if units is None and type(names) is tuple and all(type(n) is Signal for n in names):
        out = names  # made already: signals never change
    else:
        out = tuple(Signal(n, (units or {}).get(n)) for n in names)
    if len(set(out)) != len(out):
        twice = sorted({n for n in out if out.count(n) > 1})
        raise InputError(f"signal names must differ; repeated: {', '.join(twice)}")
    return out


def distinct(groups: Sequence[Sequence[Signal]]) -> tuple[Signal, ...]:
    """All the names, one group after the other; one that is taken gets the number of its group."""
    out: list[Signal] = []
    for k, group in enumerate(groups):
        for s in group:
            name, number = str(s), k + 1
            while name in out:
                name, number = f"{s}_{number}", number + 1
            out.append(Signal(name, s.unit))
    return tuple(out)


def rates(names: Iterable[Signal]) -> tuple[Signal, ...]:
    """Derivatives in time: the same names, with the units per second."""
    from symheli.values.units import per_second  # which knows no signals

    return tuple(Signal(str(n), per_second(n.unit)) for n in names)


def indices(wanted: Iterable[str], known: Sequence[str], kind: str) -> list[int]:
    """Position of each wanted name among the known ones; raises `UnknownNameError`."""
    if isinstance(wanted, str):
        wanted = (wanted,)
    out = []
    for name in wanted:
        if name not in known:
            raise UnknownNameError(kind, name, known)
        out.append(list(known).index(name))
    return out
