"""The specification sheet of a helicopter over airspeed: its loops as they fly, the controllers of
the study, and what is kept of long work.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

import symheli
from studies.controllers.certified import FORM, SOLVER
from studies.controllers.design_choices import CONTROLS, POINTS, SERVO_RATE, TOP
from studies.controllers.designs import (
    IDENTIFIED,
    NAMES,
    Design,
    classical,
    design,
    from_data,
    from_equations,
)
from studies.controllers.in_airspeed import of_degree
from studies.controllers.plant import baseline, flown_plant
from studies.known_kinematics import flights, models
from studies.setup.flights import ACTUATION, autopilot_for
from studies.setup.stored_stages import Stored, StoredStages, content_key
from symheli import Helicopter, LinearFamily, LPVStateSpace
from symheli.progress import task, tracked
from symheli.values.arrays import Array
from synthesis.sheet.evaluation import SpecificationTable, specifications
from synthesis.sheet.proven import PROVABLE, Proven, provable, prove
from synthesis.sheet.sheet import Sheet

PROOF_DEGREE = 3
"""Degree in airspeed of the plant and of a controller that is a table, for a proof."""

FLIGHTS_FROM = 5000
"""First seed of the flights that judge: the study designs with none of these."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OfVehicle:
    """A vehicle with its sheet, between two airspeeds, m/s. What takes long is kept in `folder`, if
    there is one, and not computed again.
    """

    name: str
    sheet: Sheet = field(default_factory=Sheet.load)
    airspeeds: tuple[float, float] = (0.0, TOP)
    points: int = 27
    seed: int = 0
    folder: Path | None = None

    @cached_property
    def heli(self) -> Helicopter:
        """The equations, rotor speed held."""
        return Helicopter.load(self.name, governor="ideal")

    @cached_property
    def scaled(self) -> Sheet:
        """The sheet for the rotor of this vehicle."""
        return self.sheet.at_length(self.heli.vehicle.sections["main_rotor"]["radius"].value)

    @cached_property
    def family(self) -> LinearFamily:
        """The exact linear models at every airspeed."""
        speeds = np.linspace(*self.airspeeds, self.points).tolist()
        return symheli.sweep(self.heli, speeds, inputs=CONTROLS)

    @property
    def travel(self) -> dict[str, float]:
        """Largest deflection of every control, rad."""
        return dict(zip(map(str, self.heli.inputs), map(float, self.heli.travel), strict=True))

    def designs(self, names: Sequence[str] = NAMES) -> Iterator[Design]:
        """Return the controllers of the study, or further ones, by these names, one after the
        other; one without a controller says why.
        """
        base = baseline(self.heli)
        ways: dict[str, Callable[[], Any]] = {
            **from_equations(self.heli, base),
            **classical(base),
        }
        ways[IDENTIFIED] = self._identified
        plant = flown_plant(base)
        for name in tracked("designing", names, len(names)):
            (found,) = self.kept("design", name, partial(design, name, ways[name], plant))
            yield found

    def frozen(self, controllers: Mapping[str, Any]) -> SpecificationTable:
        """Return the frozen specifications of controllers at every airspeed."""
        return specifications(
            self.family,
            controllers,
            self.scaled,
            servos=ACTUATION,
            travel=self.travel,
            rate_limit=dict.fromkeys(CONTROLS, SERVO_RATE),
        )

    def proven(
        self, controllers: Mapping[str, LPVStateSpace], rate: float, axes: Sequence[str] | None
    ) -> dict[str, tuple[Proven, ...]]:
        """Return proofs of the peaks and disk margins of these axes, for every airspeed between the
        ends, that changes at most at `rate`, m/s^2.

        They are about the cubic interpolation of plant and controller.
        """
        wanted = [s for s in provable(self.scaled) if axes is None or s.axis in axes]
        speeds = np.linspace(*self.airspeeds, max(self.points, POINTS)).tolist()
        family = symheli.sweep(self.heli, speeds, inputs=CONTROLS)
        plant = family.interpolate("polynomial", PROOF_DEGREE, rate=rate)
        jobs = [(name, spec) for name in controllers for spec in wanted]
        found: dict[str, list[Proven]] = {name: [] for name in controllers}
        for name, spec in tracked("proving", jobs, len(jobs)):
            K = controllers[name]
            smooth = K if K.basis.degrees is not None else of_degree(K, PROOF_DEGREE)
            make = partial(
                prove,
                plant,
                smooth,
                spec,
                self.scaled.axes[spec.axis],
                rate,
                servos=ACTUATION,
                form=FORM,
                solver=SOLVER,
            )
            what = f"{name} {digest_of(K)}, {spec.axis}, {PROVABLE[spec.measure]}, {rate:g}"
            shared = next(
                (
                    p
                    for p in found[name]
                    if p.specification.axis == spec.axis
                    and PROVABLE[p.specification.measure] == PROVABLE[spec.measure]
                ),
                None,
            )
            proof = self.kept("proof", what, make) if shared is None else shared
            found[name].append(replace(proof, specification=spec))
        return {name: tuple(each) for name, each in found.items()}

    def kept(self, kind: str, what: str, make: Callable[[], Any]) -> Any:
        """Return a result that is in the folder, or make it and put it there."""
        if self.folder is None:
            return make()
        name = f"{kind}-{hashlib.sha256(what.encode()).hexdigest()[:12]}"
        stages = StoredStages(self.folder, {name: self._key(what)})
        if (stored := stages.usable(name)) is not None:
            return stored.result
        begin = time.perf_counter()
        with task(f"{kind}: {what}"):
            result = make()
        stages.save(name, Stored(result=result, seconds=time.perf_counter() - begin))
        return result

    def _key(self, what: str) -> str:
        text = f"{self._content}\n{what}\n{self.airspeeds}\n{self.points}\n"
        text += f"{self.scaled.axes}\n{self.scaled.specifications}"
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def _content(self) -> str:
        return content_key(self.heli, self.name, self.seed)

    def _identified(self) -> Any:
        """The design from a flight: the aggressive one of the study, its model identified."""
        record = symheli.fly(self.heli, flights.aggressive(self.seed, autopilot_for(self.heli)))
        _, simulator = models.simulator_of(self.name, self.heli)
        return from_data(models.identified([record], simulator))()


def digest_of(K: LPVStateSpace) -> str:
    """Return a digest of the matrices of a controller."""
    digest = hashlib.sha256()
    for M in (K.A, K.B, K.C, K.D):
        digest.update(np.ascontiguousarray(M).tobytes())
    return digest.hexdigest()[:16]


def share_met(values: Array, share: float) -> float:
    """Return the value that `share` of the flights do not exceed; inf where more were lost."""
    ordered = np.sort(values)
    k = math.ceil(share * len(ordered)) - 1
    return float(ordered[max(k, 0)])
