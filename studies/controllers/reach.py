"""Whether a design is possible: the least gain at single airspeeds, from Riccati equations, before
any semidefinite program; and what to add where it is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from studies.controllers.design_choices import CONTROLS, MEASUREMENTS, NOISE, SIZES, DesignChoices
from studies.controllers.plant import baseline, design_plant
from symheli import Helicopter, LPVStateSpace
from symheli.errors import SynthesisError
from synthesis import Plant
from synthesis.design.lti.hinf import optimum_above
from synthesis.design.plant.diagnosis import modes_out_of_reach
from synthesis.design.plant.generalized import Generalized

POINTS = 4
"""Airspeeds at which a vehicle is linearized for this, the degree in airspeed one less."""
SHARES = (0.0, 0.5, 1.0)
"""Airspeeds at which the least gain is looked at, of the range."""
FEWER = 10.0
"""Factor on noise and commands by which it is tried whether they are what is in the way."""
NAMED = 3
"""Number of single remedies that are named."""


@dataclass(frozen=True)
class Reach:
    """The least gain that any controller of some choices keeps at an airspeed held.

    The performance has every known state of the model, measured or not: what is not measured must
    not be left to the gusts. `model`: continuous, with every control and output that there is;
    `held`: half sample that a command is held for, s; `whole`: plant with all of them.
    """

    model: LPVStateSpace
    choices: DesignChoices
    held: float
    whole: Plant

    @classmethod
    def of(cls, choices: DesignChoices, given: LPVStateSpace | None, held: float) -> Reach:
        """Return that of a vehicle, linearized at `POINTS` airspeeds, or of a given model."""
        model = given
        if model is None:
            few = replace(choices, points=POINTS, degree=POINTS - 1, sizes=_known(choices).sizes)
            heli = Helicopter.load(choices.vehicle, governor="ideal")
            model = baseline(heli, replace(few, controls=_controls(heli.inputs, few)))
        return cls(model, choices, held, _whole(model, choices, held))

    @cached_property
    def speeds(self) -> list[float]:
        """Airspeeds at which it is looked at, m/s."""
        low, high = self.choices.airspeeds
        return [low + share * (high - low) for share in SHARES]

    @cached_property
    def plant(self) -> Plant:
        """The plant with the chosen controls and measurements."""
        a, P = self.choices, self.whole
        return replace(
            P,
            controls=tuple(u for u in P.controls if str(u) in a.controls),
            measurements=tuple(y for y in P.measurements if str(y) in a.measurements),
        )

    def level(self, speed: float, without: str = "") -> float:
        """Return the least gain at an airspeed, one performance signal left out; inf where no
        controller stabilises the model, NaN where the equations give none.
        """
        plant = self.plant
        kept = tuple(z for z in plant.performance if str(z) != f"weighted_{without}")
        plant = replace(plant, performance=kept)
        at = self._at(plant, speed)
        if modes_out_of_reach(at, plant.channels, dt=None):
            return math.inf
        return optimum_above(at, 0.0, None) or math.nan

    def why(self, speed: float) -> str:
        """Return the modes out of reach in a sentence; "" where there is none."""
        return "; ".join(
            modes_out_of_reach(self._at(self.plant, speed), self.plant.channels, dt=None)
        )

    def possible(self, speed: float) -> bool:
        """Whether some controller keeps the largest gain asked for, this airspeed tried first."""
        limit = self.choices.gain
        return self.level(speed) <= limit and self.worst()[0] <= limit

    def worst(self) -> tuple[float, float]:
        """Return the largest of the least gains and its airspeed, m/s."""
        each = [(self.level(v), v) for v in self.speeds]
        return max((pair for pair in each if not math.isnan(pair[0])), default=(0.0, 0.0))

    def mostly(self, speed: float) -> str:
        """Return the state without which the least gain at an airspeed is smallest."""
        names = [y for y in MEASUREMENTS if f"weighted_{y}" in self.plant.performance]
        return min(names, key=lambda y: self.level(speed, without=y), default="")

    def having(self, **changes: object) -> Reach:
        """Return the same model with other sizes, noise or delay."""
        choices = replace(self.choices, **changes)  # type: ignore[arg-type]
        return replace(self, choices=choices, whole=_whole(self.model, choices, self.held))

    def adding(self, names: Sequence[str]) -> Reach:
        """Return the same with these controls and measurements, their sizes and noise."""
        a, more = _known(self.choices), [u for u in names if u in self.controls]
        measurements = (*a.measurements, *(y for y in names if y not in more))
        choices = replace(a, controls=(*a.controls, *more), measurements=measurements)
        return replace(self, choices=choices)

    @property
    def controls(self) -> list[str]:
        """Controls of the model that are not used."""
        every = _controls(self.model.inputs, self.choices)
        return [u for u in every if u not in self.choices.controls]

    @property
    def outputs(self) -> list[str]:
        """Outputs of the model that are not measured and whose size and noise are known."""
        known = {**NOISE, **self.choices.noise}
        return [
            str(y)
            for y in self.model.outputs
            if str(y) in known and str(y) not in self.choices.measurements
        ]

    def _at(self, plant: Plant, speed: float) -> Generalized:
        (each,) = zip(*plant.matrices(np.array([speed])), strict=True)
        return Generalized(*each)


def _known(choices: DesignChoices) -> DesignChoices:
    """Return the choices with the usual sizes and noise of what they do not name."""
    return replace(choices, sizes={**SIZES, **choices.sizes}, noise={**NOISE, **choices.noise})


def _controls(inputs: Sequence[object], choices: DesignChoices) -> tuple[str, ...]:
    """Return the chosen controls, then other inputs of known size that are no disturbances."""
    known = {*CONTROLS, *choices.sizes} & set(_known(choices).sizes)
    others = {*choices.disturbances, *choices.sizes_of_disturbances}
    more = (u for u in map(str, inputs) if u in known and u not in others)
    return tuple(dict.fromkeys((*choices.controls, *more)))


def _whole(model: LPVStateSpace, choices: DesignChoices, held: float) -> Plant:
    """Return the plant of the design with every control, and every known state both measured and in
    the performance.
    """
    a = _known(choices)
    states = (y for y in MEASUREMENTS if y in model.outputs)
    return design_plant(
        model,
        held,
        replace(
            a,
            controls=_controls(model.inputs, choices),
            measurements=tuple(dict.fromkeys((*a.measurements, *states))),
            references=(),
        ),
    )


def require_possible(choices: DesignChoices, given: LPVStateSpace | None, held: float) -> None:
    """Raise `SynthesisError` where no controller keeps the largest gain asked for at some airspeed
    held, with what to add.
    """
    reach = Reach.of(choices, given, held)
    level, speed = reach.worst()
    if level <= choices.gain:
        return
    why = reach.why(speed)
    if not why:
        why = (
            f"no controller keeps a gain below {level:.3g}, mostly of {reach.mostly(speed)};"
            f" asked for is {choices.gain:g} or less (gain)"
        )
    lines = [f"at {speed:g} m/s held, by Riccati equations: {why}", *_advice(reach, speed)]
    raise SynthesisError("no controller is possible:\n  " + "\n  ".join(lines), tuple(lines))


def _advice(reach: Reach, speed: float) -> Iterator[str]:
    """Yield what brings the least gain below the largest asked for, at every airspeed looked at."""
    every = _remedies(reach)
    found = [(other.worst()[0], what) for what, other in every if other.possible(speed)]
    for level, what in sorted(found)[:NAMED]:
        yield f"{what}: least gain {level:.3g}"
    if found:
        return
    names = [*reach.controls, *reach.outputs]
    both = reach.adding(names)
    if not names or not both.possible(speed):
        level = both.worst()[0]
        if math.isfinite(level):
            yield (
                f"with every control and measurement of the model the least gain is {level:.3g}:"
                f" larger sizes of deviations and commands, less noise and delay, or gain ="
                f" {math.ceil(1.2 * level)}"
            )
        else:
            yield "no control and measurement of the model helps: leave these states out (states)"
        return
    for name in reversed(names):
        fewer = [n for n in names if n != name]
        if reach.adding(fewer).possible(speed):
            names = fewer
    level = reach.adding(names).worst()[0]
    yield f"{_words(reach, names)}: least gain {level:.3g}"


def _remedies(reach: Reach) -> Iterator[tuple[str, Reach]]:
    a = reach.choices
    for name in (*reach.controls, *reach.outputs):
        yield _words(reach, [name]), reach.adding([name])
    less = {y: size / FEWER for y, size in a.noise.items()}
    yield f"noise divided by {FEWER:g}", reach.having(noise=less)
    more = {n: s * (FEWER if n in a.controls else 1) for n, s in a.sizes.items()}
    yield f"sizes of the commands times {FEWER:g}", reach.having(sizes=more)
    if a.delay:
        yield "delay = 0", reach.having(delay=0.0)


def _words(reach: Reach, names: Sequence[str]) -> str:
    controls = [n for n in names if n in reach.controls]
    measurements = [n for n in names if n not in controls]
    parts = [f"to controls {', '.join(controls)}"] if controls else []
    parts += [f"to measurements {', '.join(measurements)}"] if measurements else []
    return f"add {' and '.join(parts)}"
