"""What a certificate from flights of two masses is worth in steady wind: proven for every model
between the two and every head wind of a range, held against the exact models of both masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import symheli
import synthesis
from evidence.tables import markdown
from identification.model import KinematicModel
from studies.known_kinematics.flights import aggressive, gentle
from studies.known_kinematics.models import PAIRS, identified
from studies.known_kinematics.robust_loop import FORM, robust_loop
from studies.loops.exact_lateral import ExactLateral
from studies.loops.robust_lateral import FEEDBACK
from studies.setup.bounds import PERIOD
from studies.setup.flights import TOP, autopilot_for
from studies.transition.guarantees import scaled
from symheli import Helicopter

RATE = 3.0
"""Largest |dV/dt|, m/s^2."""

MASSES = (1.0, 1.2)
"""Of the vehicle's own."""

WINDS = (-2.0, 0.0, 2.0)
"""Head winds of the exact loops, m/s."""

PIECES = ((-2.0, 1.4), (1.4, 2.0))
"""Ranges of head wind with a certificate each, m/s: a steady wind stays in one of them."""

TOO_MUCH = 5.0
"""Head wind in which the exact loop has no finite gain at an airspeed of 0, m/s."""

RATIO = 1.5
"""Mark of the median ratio to the largest exact proven gain."""


def helicopter(truth: str, mass: float) -> Helicopter:
    """The vehicle with another mass, a factor."""
    heli = Helicopter.load(truth, governor="ideal")
    return heli.with_parameters({"body.mass": mass * float(heli.parameters["body.mass"])})


@dataclass(frozen=True)
class Exact:
    """The exact loop of a mass (a factor) in a head wind (m/s): largest frozen gain, which is a
    lower bound, and the proven gain where it was asked for.
    """

    mass: float
    head_wind: float
    frozen: float
    proven: float | None


def exact(truth: str, mass: float, head_wind: float, prove: bool) -> Exact:
    """The gain of the exact loop."""
    models = ExactLateral.of(helicopter(truth, mass), 0.0, TOP, head_wind)
    loop = scaled(models.loop("inputs", PERIOD, FEEDBACK))
    proven = synthesis.l2_gain(loop, rate=RATE, search=None).gamma if prove else None
    return Exact(mass, head_wind, synthesis.frozen_gain(loop).gain, proven)


@dataclass(frozen=True)
class Spanning:
    """Of one seed: gains proven in each range of wind, and in too much of it."""

    seed: int
    proven: tuple[float, ...]
    too_much: float


def of_seed(truth: str, seed: int) -> Spanning:
    """Identify both masses, and prove."""
    light, heavy = (_model(truth, mass, seed) for mass in MASSES)
    return Spanning(
        seed,
        tuple(_proven(light, heavy, piece) for piece in PIECES),
        _proven(light, heavy, (TOO_MUCH, TOO_MUCH)),
    )


def _model(truth: str, mass: float, seed: int) -> KinematicModel:
    heli = helicopter(truth, mass)
    autopilot = autopilot_for(heli)
    plans = [aggressive(seed, autopilot), gentle(seed, autopilot)]
    other = Helicopter.load(PAIRS[truth], governor="ideal")
    return identified([symheli.fly(heli, plan) for plan in plans], other)


def _proven(model: KinematicModel, other: KinematicModel, head_wind: tuple[float, float]) -> float:
    loop = robust_loop(model, other, head_wind)
    return synthesis.l2_gain(loop, rate=RATE, form=FORM, search=None).gamma


def table(truth: str, exacts: Sequence[Exact], found: Sequence[Spanning]) -> str:
    """The exact gains, and how the certificates stand beside them."""
    largest = max(e.proven for e in exacts if e.proven is not None)
    proven = np.array([max(one.proven) for one in found])
    ratios = proven / largest
    median = float(np.median(ratios))
    none = sum(np.isinf(one.too_much) for one in found)
    rows = [
        ("holds for every exact loop", f"{int(np.sum(proven >= largest))} of {len(found)}"),
        (
            f"ratio to the largest exact gain, median (mark {RATIO:g})",
            f"{median:.3f}, {'met' if median <= RATIO else 'MISSED'}",
        ),
        ("worst (seed)", f"{ratios.max():.3f} ({found[int(ratios.argmax())].seed})"),
        (f"no certificate in a head wind of {TOO_MUCH:g} m/s", f"{none} of {len(found)}"),
    ]
    loops = [
        (
            f"{e.mass:g}",
            f"{e.head_wind:g}",
            f"{e.frozen:.4g}",
            "" if e.proven is None else f"{e.proven:.4g}",
        )
        for e in exacts
    ]
    return "\n".join(
        [
            f"Truth {truth}, {len(found)} seeds from {found[0].seed} to {found[-1].seed}; masses"
            f" {MASSES[0]:g} and {MASSES[1]:g} times its own, head winds of {PIECES[0][0]:g} to"
            f" {PIECES[-1][1]:g} m/s, |dV/dt| up to {RATE:g} m/s^2.",
            "",
            markdown(("exact loop: mass", "head wind, m/s", "frozen gain", "proven gain"), loops),
            "",
            markdown(("certificates of the set", ""), rows),
        ]
    )
