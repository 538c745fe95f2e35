"""Arrays with names on their axes and units in their attributes: pandas frames and xarray
datasets.

Units stand where the readers of both libraries look for them: `frame.attrs["units"]` {column: unit}
and the attribute "units" of each variable and coordinate, a list of them where the coordinate is
one of names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from symheli.errors import InputError
from symheli.extras import extra
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.units import quotient

if TYPE_CHECKING:
    import pandas
    import xarray

Coordinate = tuple[Signal, Array] | Sequence[Signal]
"""A quantity with its values, or names with their units."""
Variable = tuple[Sequence[str], Array, str]
"""Dimensions, values, unit; no unit where the entries have different ones."""


def frame(
    index: Sequence[tuple[Signal, Array]], columns: Sequence[tuple[Signal, Array]]
) -> pandas.DataFrame:
    """A data frame of `columns` over `index`, both (quantity, values (n,)); the units of all of
    them in attrs["units"]. Raises `InputError` without pandas.
    """
    with extra("labelled", "a data frame"):
        import pandas as pd

    rows: Any = (
        pd.MultiIndex.from_arrays([v for _, v in index], names=[str(s) for s, _ in index])
        if len(index) > 1
        else pd.Index(index[0][1], name=str(index[0][0]))
    )
    made = pd.DataFrame({str(s): values for s, values in columns}, index=rows)
    made.attrs["units"] = {str(s): s.unit for s, _ in (*index, *columns)}
    return made


def dataset(
    coordinates: Mapping[str, Coordinate], variables: Mapping[str, Variable], **attrs: Any
) -> xarray.Dataset:
    """A dataset of `variables` over `coordinates`, each with its units; attributes that are None
    are left out. Raises `InputError` without xarray.
    """
    with extra("labelled", "a labelled dataset"):
        import xarray as xr

    coords = {}
    for name, given in coordinates.items():
        if isinstance(given[0], Signal) and len(given) == 2 and not isinstance(given[1], str):
            coords[name] = ([name], given[1], {"units": given[0].unit})
        else:
            names = [Signal(s) for s in given]  # type: ignore[arg-type]
            coords[name] = ([name], [str(s) for s in names], {"units": [s.unit for s in names]})
    made = {
        name: (dims, values, {"units": unit} if unit else {})
        for name, (dims, values, unit) in variables.items()
    }
    return xr.Dataset(made, coords, {k: v for k, v in attrs.items() if v is not None})


def per(unit: str, by: str) -> str:
    """`unit` per `by`, simplified where both are known."""
    try:
        return quotient(unit, by)
    except InputError:
        return f"{unit}/({by})"
