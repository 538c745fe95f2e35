"""Coefficients of an identified model as datasets with labelled axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from identification.model.lpvarx_model import LPVARXModel
from symheli.values.labelled import dataset, frame
from symheli.values.signal import Signal

if TYPE_CHECKING:
    import pandas
    import xarray


def coefficients_frame(model: LPVARXModel) -> pandas.DataFrame:
    """See `LPVARXModel.to_frame`."""
    columns: Any = [(y, model.theta[:, i]) for i, y in enumerate(model.outputs)]
    made = frame([(Signal("regressor"), _names(model))], columns)
    made.attrs["regressor_units"] = {str(s): s.unit for s in _regressors(model)}
    return made


def coefficients_dataset(model: LPVARXModel) -> xarray.Dataset:
    """See `LPVARXModel.to_xarray`."""
    coordinates = {"regressor": _regressors(model), "output": model.outputs}
    return dataset(
        coordinates,
        {"theta": (("regressor", "output"), model.theta, "")},
        basis=repr(model.structure.basis),
        dt=model.dt,
        method=model.method,
    )


def _names(model: LPVARXModel) -> Any:
    return [str(s) for s in _regressors(model)]


def _regressors(model: LPVARXModel) -> list[Signal]:
    """Each regressor with the unit of the signal in it; the functions of p have none."""
    arx = model.structure
    units = {"output": model.outputs, "input": model.inputs, "increment": model.parameters}
    each = [
        "1" if e.kind == "offset" else units[e.kind][e.channel].unit
        for e in arx.entries
        for _ in range(arx.basis.size)
    ]
    return [Signal(name, unit) for name, unit in zip(arx.regressor_names, each, strict=True)]
