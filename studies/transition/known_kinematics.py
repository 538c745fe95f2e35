"""Models that know their kinematics beside LPV-ARX and the interpolated baselines, each over
airspeed and over airspeed and acceleration: all identified from the same noisy flights, all judged
by the same unseen one and by exact models with the airspeed held.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import symheli
from identification import fit
from identification.judge import BaselineModel
from identification.model import LPVARXModel
from studies.known_kinematics import flights, models
from studies.known_kinematics.predictions import HORIZON, OUTPUTS, fits_of, states_of
from studies.known_kinematics.rivals import KnownKinematics, Rival
from studies.known_kinematics.truth import AXES, SPEEDS, FrozenAxes, Truth, frozen_axes, sampled
from studies.loops.lateral import ATTITUDE_HOLD
from studies.loops.robust_lateral import FEEDBACK, margin
from studies.setup import accelerating_baseline
from studies.setup.accelerating_baseline import along_the_command
from studies.setup.axes import ALL, LATERAL, LONGITUDINAL
from studies.setup.axis_models import update_time
from studies.setup.flights import autopilot_for
from studies.transition.baseline import Baseline
from symheli import FlightRecord, Helicopter
from symheli.flight import SimulatedFlight
from symheli.values.arrays import Array

CUBIC = "baseline over airspeed, cubic (the LFT)"
SPLINE = {
    models.ALONE: "baseline over airspeed, spline",
    models.BOTH: "baseline over airspeed and acceleration, spline",
}
TWO_INPUTS, ALL_AXES = "LPV-ARX, two inputs an axis", "LPV-ARX, all axes"
KNOWN = {kind: f"known kinematics, {kind}" for kind in (models.CONSTANT, models.ALONE, models.BOTH)}
STATIC_SPEEDS = (0.0, 4.0, 13.0)
"""Airspeeds at which static gains are compared, m/s."""

FREQUENCIES = 500
"""Frequencies of a nu-gap, beside those around the poles: within 0.001 of those on 2000."""

LOOPS = {"attitude hold": ATTITUDE_HOLD, "loop with a margin": FEEDBACK}


def identify_with_known_kinematics(
    heli: Helicopter,
    vehicle: str,
    baseline: Baseline,
    seed: int,
    aggressive: float,
    gentle_flight: bool,
) -> KnownKinematics:
    """Fly, identify, judge: from an aggressive flight of at most so many seconds, and a gentle one
    where it is asked for.
    """
    autopilot = autopilot_for(heli)
    training = [symheli.fly(heli, flights.aggressive(seed, autopilot, longest=aggressive))]
    if gentle_flight:
        training.append(symheli.fly(heli, flights.gentle(seed, autopilot)))
    test = symheli.fly(heli, flights.transition(seed, autopilot))
    chosen, simulator = models.simulator_of(vehicle, heli)
    truth, clean = Truth.of(heli), states_of(heli, test)

    def rival(name: str, guess: Array | None, own: FrozenAxes) -> Rival:
        beside = truth.compare(own, FREQUENCIES)
        return Rival(
            name=name,
            ahead={} if guess is None else fits_of(clean, guess),
            gaps={axis: one["model"].gap for axis, one in beside.items()},
            unlike={axis: one.otherwise_stable("model") for axis, one in beside.items()},
            static=(
                {v: truth.static_ratio(own, v) for v in STATIC_SPEEDS} if "lateral" in own else {}
            ),
        )

    exact = _baselines(heli, baseline)
    found = [
        rival(name, one.on(test).predict(OUTPUTS, HORIZON), _interpolated(one))
        for name, one in exact.items()
    ]
    found += [
        rival(name, _predicted(arx, test), own) for name, (arx, own) in _arx(training).items()
    ]
    source = SimulatedFlight(simulator)
    known = {
        kind: models.identified(training, source, kin=kin)
        for kind, kin in models.structures().items()
    }
    found += [
        rival(KNOWN[kind], model.predict(test, HORIZON), frozen_axes(model, truth))
        for kind, model in known.items()
    ]
    own = Truth.of(simulator).models
    found.append(rival(f"the simulator itself ({chosen})", None, own))
    return KnownKinematics(
        flown={
            name: record.dt * len(record)
            for name, record in zip(("aggressive", "gentle"), training, strict=False)
        },
        simulator=chosen,
        rivals=tuple(found),
        model=known[models.BOTH],
        margins={
            name: np.array([margin(model, gains) for model in truth.models["lateral"]])
            for name, gains in LOOPS.items()
        },
        update_time=update_time(models.structure().aerodynamics, training[0]),
    )


def _baselines(heli: Helicopter, baseline: Baseline) -> dict[str, BaselineModel]:
    splines = accelerating_baseline.baselines(heli)
    return {
        CUBIC: along_the_command(baseline.lpv["polynomial 3"], heli),
        SPLINE[models.ALONE]: splines[accelerating_baseline.ALONE],
        SPLINE[models.BOTH]: splines[accelerating_baseline.BOTH],
    }


def _interpolated(baseline: BaselineModel) -> FrozenAxes:
    lpv = baseline.model
    rest = (0.0,) * (len(lpv.parameters) - 1)
    level = [lpv.at(float(v), *rest) for v in SPEEDS]
    return {name: [sampled(model, axis) for model in level] for name, axis in AXES.items()}


def _arx(
    training: Sequence[FlightRecord],
) -> dict[str, tuple[list[LPVARXModel], FrozenAxes]]:
    """Identify LPV-ARX models as in the sections before, of each axis alone and of all together."""
    alone = {"longitudinal": LONGITUDINAL, "lateral": LATERAL}
    each = {name: fit(axis.structure(), training, "ls") for name, axis in alone.items()}
    whole = fit(ALL.structure(), training, "ls")
    return {
        TWO_INPUTS: (
            list(each.values()),
            {name: [model.at(float(v)) for v in SPEEDS] for name, model in each.items()},
        ),
        ALL_AXES: (
            [whole],
            {"all axes": [whole.at(float(v)) for v in SPEEDS]},
        ),
    }


def _predicted(each: Sequence[LPVARXModel], test: FlightRecord) -> Array:
    columns = {
        str(y): column
        for model in each
        for y, column in zip(model.outputs, model.predict(test, HORIZON).T, strict=True)
    }
    return np.stack([columns[y] for y in OUTPUTS], axis=1)
