"""What a scheduled synthesis refuses, and why one has failed: with the names of the plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError, SynthesisError
from synthesis.certificate import Attempt
from synthesis.plant.conditions import conditions
from synthesis.plant.diagnosis import reasons, unpriced

if TYPE_CHECKING:
    from synthesis.plant.generalized import Channels
    from synthesis.plant.plant import Plant


NOTHING_WRONG = (
    "nothing is wrong with the plant at frozen p: a lower rate, other functions for X and Y, or"
    " more divisions may help"
)


def least_ranks(plant: Plant, *, controls: bool = True, measurements: bool = True) -> None:
    """Raises `InputError` where a control costs nothing or a measurement is free of disturbances at
    some p, and where the plant has none.
    """
    named = require_channels(plant, controls=controls, measurements=measurements)
    at = plant.matrices(conditions(plant)[0])
    found: list[str] = []
    if controls:
        found += unpriced(at.D12, named.controls)
    if measurements:
        found += unpriced(np.swapaxes(at.D21, 1, 2), named.measurements, dual=True)
    if found:
        raise InputError("; ".join(found))


def require_channels(plant: Plant, *, controls: bool = True, measurements: bool = True) -> Channels:
    """The channels of a plant; raises `InputError` where a group has none."""
    named = plant.channels
    for wanted, group in (
        (True, "disturbances"),
        (True, "performance"),
        (controls, "controls"),
        (measurements, "measurements"),
    ):
        if wanted and not getattr(named, group):
            raise InputError(f"the plant has no {group}: name them, Plant(model, {group}=[...])")
    return named


def failed(plant: Plant, attempts: Sequence[Attempt], asked: Sequence[str] = ()) -> SynthesisError:
    """The error that says why: what was `asked` for, modes, directions and weights, and every
    program that was tried.
    """
    p, said = conditions(plant)
    # what a solve that ran out of digits left is no level of this plant
    least = min((a.bound for a in attempts if a.answer.startswith("solved")), default=math.inf)
    why = reasons(
        plant.matrices(p),
        plant.channels,
        dt=plant.dt,
        at=said,
        gamma=least if math.isfinite(least) else None,
    )
    lines = (*asked, *why) or (NOTHING_WRONG,)
    return SynthesisError(
        "no controller was found:\n  " + "\n  ".join([*lines, *map(str, attempts)]), tuple(lines)
    )
