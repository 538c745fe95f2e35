"""Systems in series with a design plant: weights, actuators, delays, filters and integrators, each
with one input and one output.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from symheli import LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.linear_model import is_control_system
from symheli.lpv.mixing import itself, mixed
from symheli.lpv.tools import pade_delay, sample_delay
from symheli.values.numbers import positive
from symheli.values.sample_period import SAME
from symheli.values.signal import Signal

Part = LinearModel | LPVStateSpace
Model = LPVStateSpace | UncertainStateSpace
DISTURBANCE = "_disturbance"
"""Suffix of the name of a disturbance added to a control."""


@runtime_checkable
class Actuator(Protocol):
    """A servo: anything that has a linear model."""

    def linear(self, name: str) -> LinearModel:
        """Return the linear model from `name`_command to `name`, continuous."""
        ...


def weight(given: object, name: str, dt: float | None) -> Part:
    """Return a weight as a system: a number > 0, or a filter, on a sampled plant by
    Tustin's rule.
    """
    if _is_number(given):
        return _gain(positive(given, f"the weight of {name}"), name)
    return _filter(given, f"the weight of {name}", "a number > 0", dt, "tustin")


def actuator(given: object, name: str, dt: float | None) -> Part:
    """Return an actuator as a system, on a sampled plant with its command held between the
    samples.
    """
    if isinstance(given, Actuator):
        given = given.linear(name)
    return _filter(given, f"the actuator of {name}", "a Servo", dt, "hold")


def sensor_filter(given: object, name: str, dt: float | None) -> Part:
    """Return a filter as a system: a first-order lag for a given bandwidth (rad/s); on a sampled
    plant by Tustin's rule.
    """
    if _is_number(given):
        omega = positive(given, f"the bandwidth of the filter of {name}")
        given = _first_order(-omega, omega, f"{name}_filter", name, None)
    return _filter(given, f"the filter of {name}", "a bandwidth in rad/s", dt, "tustin")


def delay(seconds: float, name: str, order: int, dt: float | None) -> LinearModel:
    """Return a delay: whole samples on a sampled plant, Pade's approximation on a
    continuous one.
    """
    if dt is None:
        return pade_delay(name, seconds, order)
    samples = positive(seconds, "the delay") / dt
    whole = round(samples)
    if whole < 1 or abs(samples - whole) > SAME * samples:
        below = math.floor(samples)
        near = [f"{n * dt:.6g} s" for n in (below, below + 1) if n > 0]
        raise InputError(
            f"a delay of {seconds:g} s is no whole number of samples of {dt:g} s; the nearest are"
            f" {' and '.join(near)}"
        )
    return sample_delay(name, whole, dt)


def integrator(name: str, dt: float | None) -> LinearModel:
    """Return the integrator from the rate of a command to the command: u(k+1) = u(k) + dt v(k) on a
    sampled plant.
    """
    A, B = (0.0, 1.0) if dt is None else (1.0, dt)
    return _first_order(A, B, f"{name}_command", name, dt)


def on(model: Model, change: Callable[[LPVStateSpace], LPVStateSpace]) -> Model:
    """Apply the change to the model; to an uncertain one, around its block."""
    if isinstance(model, UncertainStateSpace):
        return replace(model, model=change(model.model))
    return change(model)


def passing(names: Sequence[Signal]) -> Callable[[LPVStateSpace], LPVStateSpace]:
    """Return the model with outputs that equal these inputs; `InputError` where it has another
    output of that name.
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
    """Whether the output equals the input of that name."""
    row = model.select(outputs=[name]).matrices(model.basis.samples(model.box))
    unit = np.array([float(u == name) for u in model.inputs])
    return not np.any(row.C) and bool(np.allclose(row.D, unit, rtol=0.0, atol=1e-12))


def disturbed(model: LPVStateSpace, controls: Sequence[Signal]) -> LPVStateSpace:
    """Return the model with an additional input `<name>_disturbance` for each of these inputs,
    added to it.
    """
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
    """Add an output: a sum `of` outputs, and of inputs `across`."""
    outputs = {**itself(model.outputs), **new_name(new, model.outputs, "output", of)}
    return mixed(model, itself(model.inputs), outputs, {new: across or {}})


def new_name(
    name: Signal, known: Sequence[str], kind: str, of: Mapping[str, float] | None = None
) -> dict[Signal, Mapping[str, float]]:
    """Return {name: of} for `mixed`; raise `InputError` for an existing name."""
    if name in known:
        raise InputError(f"the plant has an {kind} {name} already: rename that one")
    return {name: of or {}}


def _filter(
    given: Any, what: str, simplest: str, dt: float | None, method: Literal["hold", "tustin"]
) -> Part:
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


def _first_order(A: float, B: float, state: str, name: str, dt: float | None) -> LinearModel:
    """Return a first-order lag with the state as its output, in the unit of the signal."""
    a, b, c, d = (np.array([[entry]]) for entry in (A, B, 1.0, 0.0))
    signal = Signal(name)
    return LinearModel(a, b, c, d, (Signal(state, signal.unit),), (signal,), (signal,), dt)


def _gain(size: float, name: str) -> LinearModel:
    return LinearModel.gain(np.array([[size]]), (name,), (name,))


def _is_number(given: object) -> bool:
    return isinstance(given, int | float | np.number) and not isinstance(given, bool)
