"""Filters in series with the inputs and outputs of an LPV model, exact in every basis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel, is_control_system
from symheli.lpv.lower_feedback import apart, around
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.mixing import itself, mixed
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, indices

Part = LinearModel | LPVStateSpace
"""One input, one output; continuous, or of the model's sample period."""

AHEAD, BEHIND = "ahead of ", "behind "
"""Prefixes of temporary signal names: the input and the output of a system in series while it is
connected.
"""


def driven_by(lpv: LPVStateSpace, parts: Mapping[str, Part]) -> LPVStateSpace:
    """The model behind `parts` {input: part}; see `LPVStateSpace.driven_by`."""
    for name, part in parts.items():
        indices([name], lpv.inputs, "input")
        ahead, behind = Signal(AHEAD + name), Signal(BEHIND + name)
        inputs = {u: {} if u == name else {u: 1.0} for u in lpv.inputs}
        wide = mixed(
            lpv,
            {**inputs, behind: {name: 1.0}},
            {**itself(lpv.outputs), ahead: {}},
            {ahead: {name: 1.0}},
        )
        lpv = _connected(wide, part, ahead, behind, "input", name)
    return lpv


def filtered_by(lpv: LPVStateSpace, parts: Mapping[str, Part]) -> LPVStateSpace:
    """The model in front of `parts` {output: part}; see `LPVStateSpace.filtered_by`."""
    for name, part in parts.items():
        (i,) = indices([name], lpv.outputs, "output")
        ahead, behind = Signal(AHEAD + name), Signal(BEHIND + name)
        outputs = {y: {} if y == name else {y: 1.0} for y in lpv.outputs}
        wide = mixed(
            lpv,
            {**itself(lpv.inputs), behind: {}},
            {**outputs, ahead: {name: 1.0}},
            {lpv.outputs[i]: {behind: 1.0}},
        )
        lpv = _connected(wide, part, ahead, behind, "output", name)
    return lpv


def as_part(
    given: Any, what: str, simplest: str, dt: float | None, method: Literal["hold", "tustin"]
) -> Part:
    """Return what is in series as a system; a continuous LinearModel is sampled every `dt` s by
    the method. Raises `InputError` for another kind, where `what` was to be `simplest`, or a model.
    """
    if is_control_system(given):
        given = LinearModel.from_control(given)
    if not isinstance(given, LinearModel | LPVStateSpace):
        raise InputError(
            f"{what}: expected {simplest}, a LinearModel, an LPVStateSpace or a system of"
            f" python-control, got {given!r:.60}"
        )
    if isinstance(given, LinearModel) and given.dt is None and dt is not None and given.states:
        return given.discretize(dt, method)
    return given


def _connected(
    wide: LPVStateSpace, part: Part, ahead: Signal, behind: Signal, kind: str, name: str
) -> LPVStateSpace:
    """The loop that puts a part between the output `ahead` and the input `behind`."""
    if not isinstance(part, LinearModel | LPVStateSpace):
        raise InputError(
            f"the {kind} {name}: expected a LinearModel or an LPVStateSpace in series, got"
            f" {type(part).__name__}"
        )
    together = same_period(part.dt, wide.dt) or not part.states
    if not together or len(part.inputs) != 1 or len(part.outputs) != 1:
        raise InputError(
            f"what is in series with the {kind} {name} needs one input, one output and dt ="
            f" {wide.dt}; got {len(part.inputs)}, {len(part.outputs)} and {part.dt}; sample what is"
            " continuous, .discretize(dt)"
        )
    names = apart(part.states, wide.states, f"{name}_")
    renamed = replace(part, states=names, inputs=(ahead,), outputs=(behind,))
    return around(
        wide, LPVStateSpace.constant(renamed) if isinstance(renamed, LinearModel) else renamed
    )
