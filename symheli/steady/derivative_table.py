"""Stability and control derivatives along the transition, in the field's nomenclature: X_u ...
N_ped, L_b1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.entries import MatrixEntry
from symheli.lpv.linear_family import AIRSPEED, LinearFamily
from symheli.values.arrays import Array, frozen
from symheli.values.comma_separated import comma_separated
from symheli.values.drawing import axes_of
from symheli.values.html_table import as_table
from symheli.values.labelled import dataset, frame
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from symheli.values.units import quotient

ROW = {"u": "X", "v": "Y", "w": "Z", "p": "L", "q": "M", "r": "N"}
"""Symbol of the force or moment by the state whose derivative it makes; other states keep their
name, as in a1dot_u.
"""

KINEMATIC = {
    ("u", "q"): ("w", 1),
    ("u", "r"): ("v", -1),
    ("v", "r"): ("u", 1),
    ("v", "p"): ("w", -1),
    ("w", "p"): ("v", 1),
    ("w", "q"): ("u", -1),
}
"""Entry of A: (trim velocity, sign) of what is added to leave the force: u' = v r - w q + X/m, so
A[u, q] = X_q - w0.
"""

SHOWN = ("X_u", "Z_w", "M_u", "M_w", "Y_v", "L_v", "N_v", "N_r")
"""Derivatives that shape the transition."""

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class DerivativeTable:
    """Stability and control derivatives at K airspeeds; table["M_q"] is (K,).

    Forces by mass and moments by moment of inertia: X_u = d(X/m)/du in 1/s, N_ped = d(N/Izz)/d
    d_ped in 1/s^2. With the governor "ideal" the yaw inertia includes the rotor, whose speed it
    holds.

    Parameters
    ----------
    airspeeds : array (K,)
        m/s.
    names : tuple of Signal
        n of them, with their unit.
    values : array (K, n)
        In that unit.

    Examples
    --------
    >>> table = symheli.derivatives(symheli.sweep(heli, [2.0, 8.0]))
    >>> table.values.shape == (2, len(table.names)), table.names[0].unit
    (True, '1/s')
    """

    airspeeds: Array
    names: tuple[Signal, ...]
    values: Array

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        object.__setattr__(self, "airspeeds", frozen(self.airspeeds, "airspeeds", (None,)))
        object.__setattr__(
            self,
            "values",
            frozen(self.values, "derivatives", (len(self.airspeeds), len(self.names))),
        )

    def __getitem__(self, name: str) -> Array:
        """One derivative along the airspeeds (K,)."""
        if name not in self.names:
            raise UnknownNameError("derivative", name, self.names)
        return self.values[:, list(self.names).index(name)]  # type: ignore[arg-type]

    def __iter__(self) -> Iterator[Signal]:
        return iter(self.names)

    def csv(self) -> str:
        """One line an airspeed, one column a derivative, units in the second line."""
        columns = zip(self.names, self.values.T, strict=True)
        return comma_separated([(Signal("airspeed"), self.airspeeds), *columns])

    def plot(self, ax: Axes | None = None, names: Sequence[str] = SHOWN) -> Axes:
        """Each of `names` over airspeed, by its largest magnitude, which the legend gives with its
        unit. Returns the axes; raises `UnknownNameError`.
        """
        from symheli.lpv.entry_plot import draw_scaled

        drawn = [MatrixEntry(next(s for s in self.names if s == n), self[n]) for n in names]
        ax = draw_scaled(axes_of(ax), AIRSPEED, self.airspeeds, drawn)
        ax.set_ylabel("derivative by its largest magnitude")
        return ax

    def to_frame(self) -> pandas.DataFrame:
        """A row an airspeed (m/s), a column a derivative, their units in attrs["units"]. Raises
        `InputError` without pandas.
        """
        columns = list(zip(self.names, self.values.T, strict=True))
        return frame([(AIRSPEED, self.airspeeds)], columns)

    def to_xarray(self) -> xarray.Dataset:
        """A variable a derivative over "airspeed", with its unit. Raises `InputError` without
        xarray.
        """
        columns = zip(self.names, self.values.T, strict=True)
        over = str(AIRSPEED)
        return dataset(
            {over: (AIRSPEED, self.airspeeds)},
            {str(name): ((over,), values, name.unit) for name, values in columns},
        )

    def __str__(self) -> str:
        """One line a derivative, one column an airspeed; derivatives that are zero throughout are
        left out.
        """
        shown = [
            (name, row) for name, row in zip(self.names, self.values.T, strict=True) if np.any(row)
        ]
        width = max(len(f"{name}") for name in self.names)
        units = max(len(name.unit) for name in self.names)
        head = f"{'':{width}s}  {'m/s':{units}s}" + "".join(f"{v:>11.4g}" for v in self.airspeeds)
        return "\n".join(
            [
                head,
                *(
                    f"{name!s:{width}s}  {name.unit:{units}s}" + "".join(f"{v:>11.4g}" for v in row)
                    for name, row in shown
                ),
            ]
        )


def derivatives(family: LinearFamily) -> DerivativeTable:
    """Return stability and control derivatives over a sweep in straight flight: entries of A and B
    without gravity and the kinematic terms w0, v0, u0.

    Parameters
    ----------
    family : LinearFamily
        As `sweep` returns it.

    Returns
    -------
    DerivativeTable
        By name; `str()` and `csv()` of it are tables.

    Raises
    ------
    InputError
        A discrete family, or trims that turn.

    See Also
    --------
    symheli.sweep : trims and linear models over airspeed
    symheli.linearize : the exact linear model about a trim

    Examples
    --------
    >>> table = symheli.derivatives(symheli.sweep(heli, [2.0, 8.0]))
    >>> bool((table["M_q"] < 0).all())
    True
    """
    if not isinstance(family, LinearFamily):
        raise InputError(
            f"derivatives: expected a LinearFamily, got {type(family).__name__}; a family of one"
            " airspeed is symheli.sweep(heli, [5.0])"
        )
    if family.dt is not None:
        raise InputError(
            f"derivatives are those of continuous models; this family has dt = {family.dt} s"
        )
    speeds = family.over_airspeed("a table of derivatives")
    trims = family.known_trims("a table of derivatives")
    rates = [rate for rate in ("p", "q", "r") if rate in trims[0].x]
    if np.any(np.abs(trims.state(rates)) > 1e-9):  # straight to the accuracy of a trim
        raise InputError("derivatives are tabulated for straight flight; this family turns")
    columns = [
        s for s in family.states if s not in ("phi", "theta")
    ]  # these enter by gravity and kinematics alone
    names, values = [], []
    for i, state in enumerate(family.states):
        if state in ("phi", "theta"):
            continue
        symbol, unit = ROW.get(state, f"{state}dot"), quotient(state.unit, "s")
        for column in columns:
            entry = family.A[:, i, family.states.index(column)]
            if (state, column) in KINEMATIC:
                velocity, sign = KINEMATIC[str(state), str(column)]
                entry = entry + sign * trims.state([velocity])[:, 0]
            names.append(Signal(f"{symbol}_{column}", quotient(unit, column.unit)))
            values.append(entry)
        for j, control in enumerate(family.inputs):
            names.append(
                Signal(f"{symbol}_{control.removeprefix('d_')}", quotient(unit, control.unit))
            )
            values.append(family.B[:, i, j])
    return DerivativeTable(speeds, tuple(names), np.column_stack(values) + 0.0)
