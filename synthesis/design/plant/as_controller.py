"""Controllers of all accepted kinds as models with the signal names of a design plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symheli import LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError, SynthesisError
from symheli.lpv.linear_model import feedback_matrix, is_control_system
from symheli.lpv.mixing import ERROR, turned
from symheli.values.arrays import frozen
from symheli.values.signal import Signal, indices


def as_controller(
    given: Any, controls: Sequence[Signal], measurements: Sequence[Signal]
) -> LinearModel | LPVStateSpace:
    """Return the controller that is `given` in one of the ways of `Plant.close`; raise `InputError`
    for anything else, `UnknownNameError` for signals that are not the plant's, `SynthesisError`
    with its reasons for a design that found none.
    """
    if hasattr(given, "controller"):
        if given.controller is None:
            reasons = tuple(given.reasons)
            raise SynthesisError(f"the design has no controller: {'; '.join(reasons)}", reasons)
        given = given.controller
    inner = getattr(given, "model", None)
    if isinstance(inner, LPVStateSpace) and not isinstance(given, UncertainStateSpace):
        # what flies reads measured minus reference
        read = {y: f"{y}{ERROR}" for y in inner.inputs if y not in measurements}
        given = turned(inner, {y: e for y, e in read.items() if e in measurements})
    if is_control_system(given):
        given = LinearModel.from_control(_named(given, controls, measurements))
    elif isinstance(given, Mapping):
        K = feedback_matrix(given, controls, measurements)
        given = LinearModel.gain(K, measurements, controls)
    elif isinstance(given, np.ndarray | list):
        K = frozen(given, "controller", (len(controls), len(measurements)))
        given = LinearModel.gain(K, measurements, controls)
    if not isinstance(given, LinearModel | LPVStateSpace):
        raise InputError(
            "controller: expected {(control, measurement): gain}, an array of gains, a"
            " LinearModel, an LPVStateSpace, a system of python-control or an object with such"
            f" a .model or .controller, got {type(given).__name__}"
        )
    indices(given.inputs, measurements, "measurement")
    indices(given.outputs, controls, "control")
    return given


def _named(system: Any, controls: Sequence[str], measurements: Sequence[str]) -> Any:
    """Return a copy of a python-control system whose signals have the names of the plant, in order,
    where it has none of its own.
    """
    import control

    system = control.ss(system)
    for letter, labels, names, kind in (
        ("u", "input_labels", measurements, "inputs"),
        ("y", "output_labels", controls, "outputs"),
    ):
        own = getattr(system, labels)
        if list(own) != [f"{letter}[{i}]" for i in range(len(own))]:
            continue
        if len(own) != len(names):
            raise InputError(
                f"the controller has {len(own)} {kind} without names, the plant"
                f" {len(names)}: {', '.join(names)}"
            )
        system = control.ss(system, **{kind: [str(name) for name in names]})
    return system
