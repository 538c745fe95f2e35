"""A model behind servos and a delay, sampled as a controller is."""

from __future__ import annotations

from collections.abc import Mapping

from symheli import LinearModel
from symheli.errors import InputError
from synthesis.design.plant import parts

PADE = 4
"""Order of the approximation of a delay in continuous time."""


def actuated(
    model: LinearModel, servos: Mapping[str, object] | None, delay: float, dt: float | None
) -> LinearModel:
    """Return a continuous model behind the `servos` {input: Servo, LinearModel or python-control
    system}, held for `dt` s and sampled (None: neither), and behind `delay` s at every input, exact
    in whole samples.

    A model that is sampled already has its servos and is only delayed. Raises `InputError` for
    another sample period, servos of a sampled model, and a delay that is no number of samples.
    """
    if model.dt is None:
        for name, servo in (servos or {}).items():
            model = model.driven_by({name: parts.actuator(servo, name, None)})  # type: ignore[dict-item]
        model = model if dt is None else model.discretize(dt)
    elif servos or model.dt != dt:
        raise InputError(
            f"the plant is sampled every {model.dt:g} s: its controller must have that period, got"
            f" {dt}, and its servos belong in front of the sampling"
        )
    if not delay:
        return model
    return model.driven_by({str(u): parts.delay(delay, str(u), PADE, dt) for u in model.inputs})
