"""Input checks of a synthesis, and the error of a failed one, with the names of the plant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError, SynthesisError
from symheli.lpv.bases.polynomials import lobatto_points
from symheli.values.arrays import Array
from synthesis.certify.statement.outcome import Attempt
from synthesis.design.plant.diagnosis import reasons, unpriced

if TYPE_CHECKING:
    from synthesis.design.plant.generalized import Channels
    from synthesis.design.plant.plant import Plant

NOTHING_WRONG = (
    "nothing is wrong with the plant at frozen p: a lower rate, other functions for X and Y, or"
    " more divisions may help"
)
LARGEST_BACK_OFF = 1e3
"""Largest back-off; larger factors are meaningless and numerically unsafe."""


def levels_above(back_off: float | Sequence[float]) -> tuple[float, ...]:
    """Return the factors to try in order; raise `InputError` unless each is from 1 to
    `LARGEST_BACK_OFF`.
    """
    factors = (back_off,) if isinstance(back_off, int | float) else tuple(back_off)
    if not factors or not all(1 <= factor <= LARGEST_BACK_OFF for factor in factors):
        raise InputError(
            f"back_off: expected numbers from 1 to {LARGEST_BACK_OFF:g}, got {back_off!r:.80}"
        )
    return factors


def conditions(plant: Plant) -> tuple[Array, list[str]]:
    """Return some p all over the box, as `Plant.matrices` takes them, and a name for each."""
    p = lobatto_points(5 if len(plant.parameters) == 1 else 3, plant.box)
    names = [s.name for s in plant.parameters]
    texts = [
        ", ".join(f"{n} = {v:g}" for n, v in zip(names, np.atleast_1d(q), strict=True)) for q in p
    ]
    return p, texts


def least_ranks(
    plant: Plant, *, controls: bool = True, measurements: bool = True, **others: bool
) -> None:
    """Raise `InputError` where a control has no weight or a measurement no disturbance at some p,
    and where the plant has none of these, or of the `others`, see `require_channels`.
    """
    named = require_channels(plant, controls=controls, measurements=measurements, **others)
    at = plant.matrices(conditions(plant)[0])
    found: list[str] = []
    if controls:
        found += unpriced(at.D12, named.controls)
    if measurements:
        found += unpriced(np.swapaxes(at.D21, 1, 2), named.measurements, dual=True)
    if found:
        raise InputError("; ".join(found))


def require_channels(
    plant: Plant,
    *,
    controls: bool = True,
    measurements: bool = True,
    disturbances: bool = True,
    performance: bool = True,
    states: bool = True,
) -> Channels:
    """Return the channels of a plant; raise `InputError` where a group has none, and for numbers
    that cannot be squared.
    """
    named = plant.channels
    for wanted, group in (
        (disturbances, "disturbances"),
        (performance, "performance"),
        (controls, "controls"),
        (measurements, "measurements"),
    ):
        if wanted and not getattr(named, group):
            raise InputError(f"the plant has no {group}: name them, Plant(model, {group}=[...])")
    if states and not named.states:
        raise InputError(
            "the plant has no states: give it a servo, a delay or a weight with states, or take"
            " synthesis.hinf, which designs for gains too"
        )
    plant.matrices(conditions(plant)[0]).checked(named)
    return named


def failed(plant: Plant, attempts: Sequence[Attempt], wanted: Sequence[str] = ()) -> SynthesisError:
    """Return the error with the reasons: the `asked` options, modes, directions and weights, and
    every program tried.
    """
    p, said = conditions(plant)
    # the result of a solve without accuracy is no level of this plant
    least = min((a.bound for a in attempts if a.answer.startswith("solved")), default=math.inf)
    why = reasons(
        plant.matrices(p),
        plant.channels,
        dt=plant.dt,
        at=said,
        gamma=least if math.isfinite(least) else None,
    )
    lines = (*wanted, *why) or (NOTHING_WRONG,)
    return SynthesisError(
        "no controller was found:\n  " + "\n  ".join([*lines, *map(str, attempts)]), tuple(lines)
    )
