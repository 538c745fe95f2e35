"""The statement that an invariant set proves: model, feedback, disturbances and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices
from symheli.values.summary import summarized
from synthesis.certify.questions.hypotheses import drifting
from synthesis.certify.statement.rates import Rate, limits
from synthesis.certify.statement.sentences import motion
from synthesis.design.plant.as_controller import as_controller
from synthesis.numerics.program.bases import moves


class Limit(NamedTuple):
    """|signal| <= bound; the signal is row `index` of x, of y or of u (`where` 0, 1, 2)."""

    signal: Signal
    bound: float
    where: int
    index: int


@dataclass(frozen=True, eq=False)
class SetStatement:
    """The loop and its limits.

    Attributes
    ----------
    model : LPVStateSpace
        With the rates of its parameters; the inputs are those of `disturbance` and of `controls`.
    disturbance : dict of str to float
        Amplitude of each input that is a disturbance, |w| <= amplitude.
    controls : tuple of str
        The inputs that the feedback moves.
    state_bounds : dict of str to float
        Largest size of states or outputs; outputs without feedthrough of disturbances.
    input_bounds : dict of str to float
        Largest size of controls.
    feedback : LPVStateSpace or None
        Given u = K(p) x, without states; None: Y belongs to the set.
    """

    model: LPVStateSpace
    disturbance: Mapping[str, float]
    controls: tuple[str, ...]
    state_bounds: Mapping[str, float]
    input_bounds: Mapping[str, float]
    feedback: LPVStateSpace | None

    __repr__ = summarized

    def __post_init__(self) -> None:
        for name, bounds in (
            ("disturbance", self.disturbance),
            ("state_bounds", self.state_bounds),
            ("input_bounds", self.input_bounds),
        ):
            object.__setattr__(self, name, _sizes(bounds, name))
        object.__setattr__(self, "controls", tuple(self.controls))
        wanted = sorted((*self.disturbance, *self.controls))
        if wanted != sorted(self.model.inputs):
            raise InputError(
                "every input is a disturbance or a control, with a bound:"
                f" {', '.join(self.model.inputs)}; got disturbances"
                f" {', '.join(self.disturbance) or 'none'} and controls"
                f" {', '.join(self.controls) or 'none'}; model.select(inputs=[...]) leaves others"
                " out"
            )
        indices(self.input_bounds, self.controls, "control")
        if not (self.state_bounds or self.input_bounds):
            raise InputError("expected at least one of state_bounds and input_bounds")
        passed = [
            y
            for y in self.state_bounds
            if y in self.model.outputs
            and y not in self.model.states
            and np.any(self.model.D[:, self.model.outputs.index(y)][:, self.disturbed])
        ]
        if passed:
            raise InputError(
                f"state_bounds: disturbances reach {passed[0]} directly, and no set of states"
                " bounds it; bound a state or another output"
            )

    @cached_property
    def disturbed(self) -> list[int]:
        """Numbers of the inputs that are disturbances."""
        return indices(self.disturbance, self.model.inputs, "input")

    @cached_property
    def moved(self) -> list[int]:
        """Numbers of the inputs that are controls."""
        return indices(self.controls, self.model.inputs, "input")

    @cached_property
    def amplitudes(self) -> Array:
        """Amplitudes of the disturbances, (nw,)."""
        return np.array(list(self.disturbance.values()), dtype=float)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Everything that is limited."""
        model, out = self.model, []
        for name, bound in self.state_bounds.items():
            among, where = (model.states, 0) if name in model.states else (model.outputs, 1)
            (i,) = indices([name], among, "state or output")
            out.append(Limit(among[i], bound, where, i))
        for name, bound in self.input_bounds.items():
            (i,) = indices([name], model.inputs, "input")
            out.append(Limit(model.inputs[i], bound, 2, self.controls.index(name)))
        return tuple(out)

    def summary(self, what: str) -> str:
        """The statement, with the limits and hypotheses, in lines."""
        limited = ", ".join(f"|{limit.signal}| <= {limit.bound:g}" for limit in self.limits)
        lines = (f"- {line}" for line in self.hypotheses)
        return "\n".join([f"{what}, proven for every p", f"within {limited}", *lines])

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """Hypotheses of the statement, in sentences."""
        law = "u = K(p) x with all states known" if self.controls else "the loop as it is given"
        time = "continuous" if self.model.dt is None else "discrete"
        each = [f"|{w}| <= {a:g}" for w, a in self.disturbance.items()]
        return (
            f"the LPV model, in {time} time; {law}",
            *(
                motion(s, 0.0 if isinstance(s.rate, str) else s.limit)
                for s in self.model.parameters
            ),
            f"disturbances with any history: {', '.join(each)}" if each else "no disturbances",
            *(drifting(self.model) if moves(self.model.parameters) else ()),
            "the state lies in the set at the start",
        )


def _sizes(given: Mapping[str, float] | None, name: str) -> dict[str, float]:
    if not isinstance(given, Mapping):
        raise InputError(f"{name}: expected {{name: size}}, got {given!r:.60}")
    out = {}
    for key, value in given.items():
        try:
            size = float(value)
        except (TypeError, ValueError):
            size = math.nan
        if not (math.isfinite(size) and size > 0):
            raise InputError(f"{name}: expected a number > 0 for {key}, got {value!r:.60}")
        out[str(key)] = size
    return out


def feedback_of(given: Any, model: LPVStateSpace, controls: tuple[str, ...]) -> LPVStateSpace:
    """The given controller as u = D(p) x in the order of the controls and states; raises
    `InputError` for one with states of its own.
    """
    names = tuple(model.inputs[i] for i in indices(controls, model.inputs, "input"))
    K = as_controller(given, names, model.states)
    if isinstance(K, LinearModel):
        K = LPVStateSpace.constant(K, model.parameters)
    if len(K.states):
        raise InputError(
            f"controller: expected gains of the states, got one with {len(K.states)} states of its"
            " own; close the loop first (Plant.close) and take the set of that model"
        )
    if K.box != model.box:
        raise InputError(f"controller: expected one over {model.box}, got {K.box}")
    order = indices(K.inputs, model.states, "state")
    D = np.zeros((len(K.D), len(controls), len(model.states)))
    D[:, :, order] = K.D[:, indices(controls, K.outputs, "control")]
    nothing = np.zeros((len(D), 0, 0))
    return LPVStateSpace(
        K.basis, nothing, np.zeros((len(D), 0, D.shape[2])), np.zeros((len(D), D.shape[1], 0)), D,
        model.parameters, (), model.states, names, model.dt,
    )  # fmt: skip


def stated(
    model: Any,
    controller: Any,
    state_bounds: Mapping[str, float] | None,
    input_bounds: Mapping[str, float] | None,
    disturbance: Mapping[str, float] | None,
    rate: Rate = None,
) -> SetStatement:
    """The statement of the arguments of `invariant_set`; raises `InputError` where they do not
    fit.
    """
    if isinstance(model, LinearModel):
        model = LPVStateSpace.constant(model)
    if not isinstance(model, LPVStateSpace):
        raise InputError(
            f"model: expected an LPVStateSpace or a LinearModel, got {type(model).__name__}"
        )
    model = replace(model, parameters=limits(model.parameters, rate), residuals=None)
    outside = {} if disturbance is None else disturbance
    controls = tuple(u for u in model.inputs if u not in outside)
    feedback = None if controller is None else feedback_of(controller, model, controls)
    states = {} if state_bounds is None else state_bounds
    inputs = {} if input_bounds is None else input_bounds
    return SetStatement(model, outside, controls, states, inputs, feedback)
