"""Certificate that an autopilot's loops stay stable while the airspeed moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import symheli
import synthesis
from studies.autopilot.tuned import closed_loops
from symheli import Helicopter, LinearFamily, LPVStateSpace, Servo
from symheli.errors import InputError, TrimError
from symheli.flight import HelicopterLoops
from symheli.lpv.tools import Actuation
from symheli.progress import task, tracked
from symheli.values.arrays import Array
from synthesis import Certificate

APART = 2.0
"""Largest distance (m/s) of the airspeeds between which the plant is taken as straight."""


@dataclass(frozen=True, kw_only=True)
class Between:
    """What is proven of the first helicopter's loops from the first of `airspeeds` (m/s) to the
    last, |dV/dt| <= `rate` (m/s^2), and of how many of those drawn.

    closed: the loops as a model over airspeed. exact: whether the proof holds in rational
    arithmetic. misfit: largest entry of [A B] by which the exact plant half-way between the
    airspeeds differs from the straight line; unstable: where half-way the loops around the exact
    plant are not stable. drawn, proven: helicopters drawn that have trims, and those of which
    stability is proven, in floating point.
    """

    closed: LPVStateSpace
    certificate: Certificate
    exact: bool
    airspeeds: Array
    rate: float
    misfit: float
    unstable: tuple[float, ...]
    drawn: int
    proven: int

    def __str__(self) -> str:
        low, high = self.airspeeds[0], self.airspeeds[-1]
        where = f"for every V(t) from {low:g} to {high:g} m/s with |dV/dt| <= {self.rate:g} m/s^2"
        if self.exact:
            sentence = f"Proven, in rational arithmetic: the changed loops are stable {where}"
        else:
            sentence = f"NOT PROVEN that the changed loops are stable {where}: {self._reason}"
        sentence += f"; of {self.drawn} drawn helicopters {self.proven} are proven" * bool(
            self.drawn
        )
        straight = (
            ". The linear model about the moving trim is sampled, and straight between trims at"
            f" {', '.join(f'{v:g}' for v in self.airspeeds)} m/s; half-way its entries are"
            f" within {self.misfit:.1g} of the exact ones, with which the loops"
        )
        if not self.unstable:
            return f"{sentence}{straight} are stable there too."
        unstable = ", ".join(f"{v:g}" for v in self.unstable)
        return f"{sentence}{straight} are UNSTABLE at {unstable} m/s."

    @property
    def _reason(self) -> str:
        if self.certificate.verified:
            return "it holds in floating point alone"
        return self.certificate.status.value


def stable_between(
    helicopters: Sequence[Helicopter],
    loops: HelicopterLoops,
    low: float,
    high: float,
    rate: float,
    *,
    servos: Mapping[str, Servo] | Actuation | None = None,
    delay: float = 0.0,
) -> Between:
    """Look for a Lyapunov function of the loops around the first helicopter over the airspeed (half
    a minute), and around each of the others, drawn from its uncertainty.

    Raises `InputError` for an empty range, a delay that is no whole number of periods, or a first
    helicopter without a trim in the range.
    """
    if not low < high:
        raise InputError(
            f"a proof between airspeeds needs two of them, got {low:g} to {high:g} m/s"
        )
    actuation = Actuation.of(servos, delay, loops.dt)
    airspeeds = np.linspace(low, high, max(math.ceil((high - low) / APART), 1) + 1)
    halfway = 0.5 * (airspeeds[1:] + airspeeds[:-1])

    def plants(heli: Helicopter, at: Array) -> LinearFamily:
        family = symheli.sweep(heli, at.tolist())
        each = family.models.each(actuation.discretize)
        return replace(family, models=each)

    found: list[tuple[LPVStateSpace, LPVStateSpace, Certificate]] = []
    for k, heli in enumerate(tracked("proofs of stability", helicopters)):
        try:
            plant = plants(heli, airspeeds).interpolate("linear", rate=rate)
        except TrimError as error:
            if k == 0:
                raise InputError(
                    f"the helicopter has no trim somewhere from {low:g} to {high:g} m/s: {error}"
                ) from None
            continue
        around = synthesis.Plant(
            plant, controls=loops.linear.outputs, measurements=loops.linear.inputs
        )
        closed = around.close(loops.linear)
        assert isinstance(closed, LPVStateSpace)  # noqa: S101
        found.append((plant, closed, synthesis.stability(closed, rate, search=None)))
    plant, closed, certificate = found[0]
    with task("checking the proof in rational arithmetic"):
        exact = certificate.verified and certificate.verify(rigorous=True)
    misfit, unstable = 0.0, []
    for airspeed, true in zip(halfway.tolist(), plants(helicopters[0], halfway), strict=True):
        straight = plant.at(airspeed)
        off = [np.abs(getattr(straight, M) - getattr(true, M)).max() for M in "AB"]
        misfit = max(misfit, *map(float, off))
        if not closed_loops(true, loops).is_stable():
            unstable.append(airspeed)
    return Between(
        closed=closed,
        certificate=certificate,
        exact=exact,
        airspeeds=airspeeds,
        rate=rate,
        misfit=misfit,
        unstable=tuple(unstable),
        drawn=len(found) - 1,
        proven=sum(one.verified for *_, one in found[1:]),
    )
