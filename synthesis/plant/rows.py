"""Rows and columns that a design plant gets besides those of its model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace, UncertainStateSpace
from symheli.lpv.mixing import itself, mixed
from symheli.values.signal import Signal

Model = LPVStateSpace | UncertainStateSpace
DISTURBANCE = "_disturbance"
"""Ends the name of what is added to a control."""


def on(model: Model, change: Callable[[LPVStateSpace], LPVStateSpace]) -> Model:
    """The model changed; of an uncertain one, the model around its block."""
    if isinstance(model, UncertainStateSpace):
        return replace(model, model=change(model.model))
    return change(model)


def passing(names: Sequence[Signal]) -> Callable[[LPVStateSpace], LPVStateSpace]:
    """The model with outputs that pass these inputs; `InputError` where it has another output of
    that name.
    """

    def add(model: LPVStateSpace) -> LPVStateSpace:
        for name in names:
            if name not in model.outputs:
                model = with_row(model, name, {}, {name: 1.0})
            elif not _passes(model, name):
                raise InputError(
                    f"{name} is an input of the plant and an output of its model that is not that"
                    " input: rename one of the two"
                )
        return model

    return add


def _passes(model: LPVStateSpace, name: Signal) -> bool:
    """Whether the output is the input of that name."""
    row = model.select(outputs=[name]).matrices(model.basis.samples(model.box))
    unit = np.array([float(u == name) for u in model.inputs])
    return not np.any(row.C) and bool(np.allclose(row.D, unit, rtol=0.0, atol=1e-12))


def disturbed(model: LPVStateSpace, controls: Sequence[Signal]) -> LPVStateSpace:
    """The model with one more input for each of these inputs, `<name>_disturbance`, added to it."""
    inputs = itself(model.inputs)
    for name in controls:
        added = Signal(f"{name}{DISTURBANCE}", name.unit)
        inputs |= new_name(added, model.inputs, "input", {name: 1.0})
    return mixed(model, inputs, itself(model.outputs))


def with_row(
    model: LPVStateSpace,
    new: Signal,
    of: Mapping[str, float],
    across: Mapping[str, float] | None = None,
) -> LPVStateSpace:
    """One more output: a sum `of` outputs, and of inputs `across`."""
    outputs = {**itself(model.outputs), **new_name(new, model.outputs, "output", of)}
    return mixed(model, itself(model.inputs), outputs, {new: across or {}})


def new_name(
    name: Signal, known: Sequence[str], kind: str, of: Mapping[str, float] | None = None
) -> dict[Signal, Mapping[str, float]]:
    """{name: of} for `mixed`; raises `InputError` for a name that is known already."""
    if name in known:
        raise InputError(f"the plant has an {kind} {name} already: rename that one")
    return {name: of or {}}
