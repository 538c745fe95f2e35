"""Families of linear models, and coefficients of LPV models, with labelled axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.lpv.entries import Names, Stacked, entries, rates
from symheli.values.arrays import Array, frozen
from symheli.values.labelled import dataset, frame
from symheli.values.operating_points import OperatingPoints
from symheli.values.signal import Signal

if TYPE_CHECKING:
    import pandas
    import xarray

    from symheli.lpv.lpv_state_space import LPVStateSpace

VALUES = 21
"""Default number of values of a scheduling parameter."""

MATRICES = {
    "A": ("equation", "state"),
    "B": ("equation", "input"),
    "C": ("output", "state"),
    "D": ("output", "input"),
}


def models_frame(
    axes: Sequence[tuple[Signal, Array]], names: Names, matrices: Stacked
) -> pandas.DataFrame:
    """A row a model, a column an entry A[q, u] ..., over the values of all `axes`."""
    grids = np.meshgrid(*(values for _, values in axes), indexing="ij")
    index = [(s, grid.reshape(-1)) for (s, _), grid in zip(axes, grids, strict=True)]
    columns = [(name, values.reshape(-1)) for name, values in entries(names, matrices)]
    return frame(index, columns)


def values_frame(model: LPVStateSpace, p: object) -> pandas.DataFrame:
    """A row a value of the scheduling parameters (K,) or (K, d), a column an entry A[q, u] ...;
    None: an even grid over their ranges.
    """
    ranges = model.parameters
    if p is None:
        each = np.meshgrid(*(np.linspace(s.low, s.high, VALUES) for s in ranges), indexing="ij")
        p = np.stack([values.reshape(-1) for values in each], axis=-1)
    values = frozen(p, "p")
    if values.ndim == 1 and len(ranges) == 1:
        values = values[:, None]
    values = frozen(values, "p", (None, len(ranges)))
    matrices = model.matrices(values if len(ranges) > 1 else values[:, 0])
    index = [(Signal(s.name, s.unit), column) for s, column in zip(ranges, values.T, strict=True)]
    return frame(index, list(entries(model, matrices)))


def models_dataset(
    axes: Sequence[tuple[Signal, Array]],
    names: Names,
    matrices: Stacked,
    trims: OperatingPoints | None,
) -> xarray.Dataset:
    """A, B, C, D over the `axes`, "equation" (the state whose derivative, or next value, the row
    is), "state", "input" and "output"; x0 and u0 where the trims are known.
    """
    over = tuple(str(s) for s, _ in axes)
    shape = tuple(len(values) for _, values in axes)
    variables: dict[str, Any] = {
        name: ((*over, *dims), getattr(matrices, name), "") for name, dims in MATRICES.items()
    }
    if trims:
        for name, dim, values in (
            ("x0", "state", trims.state(names.states)),
            ("u0", "input", trims.input(names.inputs)),
        ):
            variables[name] = ((*over, dim), values.reshape(*shape, -1), "")
    coordinates = {str(s): (s, values) for s, values in axes} | _named(names)
    return dataset(coordinates, variables, dt=names.dt)


def coefficient_dataset(names: Names, matrices: Stacked, functions: str) -> xarray.Dataset:
    """Return the coefficients of an LPV model: A over "function" (j of f_j), "equation" and
    "state", and so on; `functions` describes them.
    """
    order = np.arange(len(matrices.A))
    variables: dict[str, Any] = {
        name: (("function", *dims), getattr(matrices, name), "") for name, dims in MATRICES.items()
    }
    coordinates = {"function": (Signal("function"), order)} | _named(names)
    return dataset(coordinates, variables, basis=functions, dt=names.dt)


def _named(names: Names) -> dict[str, Any]:
    return {
        "equation": [Signal(s, unit) for s, unit in zip(names.states, rates(names), strict=True)],
        "state": names.states,
        "input": names.inputs,
        "output": names.outputs,
    }
