"""First choices for a vehicle or a model, as `symheli synthesize --write-config` writes them: sizes
of commands from travel and gains, range and signals from the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import symheli
from identification.model import LPVARXModel
from studies.controllers.design_choices import DELAY, GUST, GUSTS, NOISE, SIZES, DesignChoices
from symheli import Helicopter, LinearFamily, LPVStateSpace
from symheli.values.units import ratio
from synthesis.design.plant.parts import DISTURBANCE

EFFECTS = {
    "d_lon": ("a1", 0.0378),
    "d_lat": ("b1", 0.0378),
    "d_col": ("w", 1.19),
    "d_ped": ("r", 2.73),
}
"""What a command of its size does in hover: tip-path plane tilted in the end, rad (2.2 deg), or
acceleration of a state, m/s^2, rad/s^2. They are what the sizes of the X-Cell do.
"""
FLAPPING = ("a1", "b1")
SHARE_OF_TRAVEL = 0.25
"""Largest size of a command, of the travel to either side."""
UNKNOWN_SIZE, NOISE_OF_SIZE = 1.0, 0.1
"""Size of a signal of a model without a usual one, in its unit, and its noise as a fraction of it.
"""
DIGITS = 2
ADDED = 0.2
"""Size of the disturbance added to a command of a model without gusts, of that of the command."""
WITHIN = 1.0
"""Time, s, within which a command of its size moves some output of a model by its size."""


def for_vehicle(choices: DesignChoices) -> DesignChoices:
    """Return the choices with sizes of commands by the travel and the gains of their vehicle."""
    heli = Helicopter.load(choices.vehicle, governor="ideal")
    hover = symheli.linearize(heli, 0.0)
    travel = dict(zip(map(str, heli.inputs), map(float, heli.travel), strict=True))
    states, inputs = list(map(str, hover.states)), list(map(str, hover.inputs))
    sizes = dict(choices.sizes)
    for u, (x, effect) in EFFECTS.items():
        if x not in states or u not in travel:
            continue
        i = states.index(x)
        gain = abs(float(hover.B[i, inputs.index(u)]))
        if x in FLAPPING:
            gain /= abs(float(hover.A[i, i]))
        most = SHARE_OF_TRAVEL * travel[u]
        sizes[u] = _rounded(min(effect / gain, most) if gain else most)
    return replace(choices, sizes=sizes)


def for_model(
    choices: DesignChoices, model: LPVStateSpace, given: object, vehicle: str
) -> DesignChoices:
    """Return the choices for a model: its range, period, controls and measurements, and of gusts
    only what it has; `vehicle`: in which it is flown, "" for none.
    """
    size = ratio("m/s", model.parameters[0].unit) or 1.0
    low, high = (float(edge) / size for edge in model.box[0])
    inputs = [str(u) for u in model.inputs]
    gusts = [name for name in GUSTS if name in inputs]
    controls = [u for u in inputs if u not in GUSTS]
    measurements = [str(y) for y in model.outputs if not vehicle or str(y) in NOISE]
    sizes = {y: SIZES.get(y, UNKNOWN_SIZE) for y in measurements}
    sizes |= _commands(model, controls, sizes)
    added = {f"{u}{DISTURBANCE}": _rounded(ADDED * sizes[u]) for u in controls if not gusts}
    noise = {y: NOISE.get(y, NOISE_OF_SIZE * sizes[y]) for y in measurements}
    period = choices.period if model.dt is None else model.dt
    made = replace(
        choices,
        vehicle=vehicle,
        airspeeds=(max(low, 0.0), high),
        period=period,
        delay=round(DELAY / period) * period,
        controls=tuple(controls),
        measurements=tuple(measurements),
        disturbances=tuple(gusts or controls),
        sizes={**dict.fromkeys(gusts, GUST), **sizes, **added},
        noise=noise,
        servos={u: servo for u, servo in choices.servos.items() if u in controls},
        degree=min(choices.degree, _degree(given)),
    )
    return for_vehicle(made) if vehicle else made


def _commands(
    model: LPVStateSpace, controls: Sequence[str], sizes: Mapping[str, float]
) -> dict[str, float]:
    """Return the size of each command, for which a step moves some output by its size within
    `WITHIN` s, in the middle of the range.
    """
    middle = 0.5 * sum(model.box[0])
    at = model.at(middle).select(inputs=controls, outputs=list(sizes))
    moved = np.abs(at.step_response(WITHIN).values).max(axis=0)
    peak = (moved / np.array(list(sizes.values()))[:, None]).max(axis=0)
    usual = (SIZES.get(u, UNKNOWN_SIZE) for u in controls)
    return {
        u: _rounded(1 / most) if most > 0 else size
        for u, most, size in zip(controls, peak, usual, strict=True)
    }


def _rounded(size: float) -> float:
    return float(f"{size:.{DIGITS}g}")


def _degree(given: object) -> int:
    """Return the largest degree in airspeed that a given model allows."""
    if isinstance(given, LinearFamily):
        return max(len(given.models) - 1, 1)
    return DesignChoices().degree


def state_space(given: object) -> LPVStateSpace:
    """Return a given model over its own range, with the gusts that it has."""
    from identification.model import KinematicModel
    from studies.controllers.identified_plant import moving_with_commands, with_gusts

    if isinstance(given, LinearFamily):
        return given.interpolate("polynomial", _degree(given))
    if isinstance(given, KinematicModel):
        return with_gusts(given.to_state_space(held=moving_with_commands(given)))
    assert isinstance(given, LPVARXModel)  # noqa: S101 - the reader knows no other
    return given.to_state_space()
