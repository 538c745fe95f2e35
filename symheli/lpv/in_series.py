"""Filters in series with the inputs and outputs of an LPV model, exact in every basis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lower_feedback import apart, lower_feedback
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.mixing import itself, mixed
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, indices

Part = LinearModel | LPVStateSpace
"""One input, one output; continuous, or of the model's sample period."""

AHEAD, BEHIND = "ahead of ", "behind "
"""With the name of a signal: what a part is driven by, and what it drives, while it is
connected.
"""


def driven_by(lpv: LPVStateSpace, parts: Mapping[str, Part]) -> LPVStateSpace:
    """The model behind `parts` {input: part}; see `LPVStateSpace.driven_by`."""
    for name, part in parts.items():
        (i,) = indices([name], lpv.inputs, "input")
        ahead, behind = Signal(AHEAD + name), Signal(BEHIND + name)
        inputs = {**itself(lpv.inputs), behind: {name: 1.0}}
        del inputs[lpv.inputs[i]]
        new = Signal(name, _checked(part, name, lpv, "input").inputs[0].unit)
        order = [*(new if u == name else u for u in lpv.inputs), behind]
        wide = mixed(
            lpv,
            {u: inputs.get(u, {}) for u in order},
            {**itself(lpv.outputs), ahead: {}},
            {ahead: {new: 1.0}},
        )
        lpv = _connected(wide, part, ahead, behind, f"{name}_")
    return lpv


def filtered_by(lpv: LPVStateSpace, parts: Mapping[str, Part]) -> LPVStateSpace:
    """The model in front of `parts` {output: part}; see `LPVStateSpace.filtered_by`."""
    for name, part in parts.items():
        indices([name], lpv.outputs, "output")
        ahead, behind = Signal(AHEAD + name), Signal(BEHIND + name)
        new = Signal(name, _checked(part, name, lpv, "output").outputs[0].unit)
        outputs = {new if y == name else y: {} if y == name else {y: 1.0} for y in lpv.outputs}
        wide = mixed(
            lpv,
            {**itself(lpv.inputs), behind: {}},
            {**outputs, ahead: {name: 1.0}},
            {new: {behind: 1.0}},
        )
        lpv = _connected(wide, part, ahead, behind, f"{name}_")
    return lpv


def _checked(part: Part, name: str, lpv: LPVStateSpace, kind: Literal["input", "output"]) -> Part:
    if not isinstance(part, LinearModel | LPVStateSpace):
        raise InputError(
            f"the {kind} {name}: expected a LinearModel or an LPVStateSpace in series, got"
            f" {type(part).__name__}"
        )
    rates = same_period(part.dt, lpv.dt) or not part.states
    if not rates or len(part.inputs) != 1 or len(part.outputs) != 1:
        raise InputError(
            f"what is in series with the {kind} {name} needs one input, one output and dt ="
            f" {lpv.dt}; got {len(part.inputs)}, {len(part.outputs)} and {part.dt}"
        )
    return part


def _connected(
    wide: LPVStateSpace, part: Part, ahead: Signal, behind: Signal, prefix: str
) -> LPVStateSpace:
    names = apart(part.states, wide.states, prefix)
    renamed = replace(part, states=names, inputs=(ahead,), outputs=(behind,))
    closed = lower_feedback(wide, renamed)
    assert isinstance(closed, LPVStateSpace)  # noqa: S101  (as `wide`)
    return closed
