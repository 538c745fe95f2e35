"""Read a linear model from this package or from python-control."""

from __future__ import annotations

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import is_control_system


def as_model(system: object) -> LinearModel:
    """Return a LinearModel itself, a system of python-control as one; `InputError` for anything
    else.
    """
    if isinstance(system, LinearModel):
        return system
    if is_control_system(system):
        return LinearModel.from_control(system)
    raise InputError(
        "expected a LinearModel or a system of python-control, got"
        f" {type(system).__name__}; an LPV model has .at(p), a Plant .nominal.at(p)"
    )
