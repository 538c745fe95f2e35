"""Control powers of a helicopter's linearization, beside those that are identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import symheli
from studies.live.identifier import POWERS
from symheli import Helicopter
from symheli.values.arrays import Array
from symheli.values.signal import Signal

FLAPPING = ("a1", "b1")


class Baseline(NamedTuple):
    """Control powers over airspeeds (n,) m/s by (velocity, control): (n,), in the unit of the
    identifier.
    """

    name: str
    airspeeds: Array
    powers: Mapping[tuple[str, str], Array]


def baseline(vehicle: str, controls: Sequence[str], airspeeds: Sequence[float]) -> Baseline:
    """Return the acceleration by each control with its flapping settled, the velocities held.

    A control without a unit is a stick from -1 to 1, over the travel of the helicopter's control.
    Raises `InputError` for a vehicle that is not there, `TrimError` where it cannot fly so fast.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    family = symheli.sweep(heli, list(airspeeds))
    settled = family.residualize([s for s in map(str, family.states) if s in FLAPPING])
    states, inputs = list(map(str, settled.states)), list(map(str, heli.inputs))
    B = np.array([np.asarray(settled.at(v).B) for v in airspeeds])
    found: dict[tuple[str, str], Array] = {}
    for velocity, ending in POWERS.items():
        control = next((u for u in controls if u.endswith(ending)), None)
        own = next((k for k, u in enumerate(inputs) if u.endswith(ending)), None)
        if control is None or own is None:
            continue
        travel = float(heli.travel[own]) if Signal(control).unit == "1" else 1.0
        found[velocity, control] = travel * B[:, states.index(velocity), own]
    return Baseline(vehicle, np.asarray(airspeeds, float), found)
