"""The complete chain: identification, controller design, certification and simulation."""

from __future__ import annotations

from functools import cache

import numpy as np

import symheli
from identification.model import KinematicModel
from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import autopilot, helicopter, scattered
from studies.controllers import designs
from studies.controllers.certified import CertifiedControllers, proofs
from studies.controllers.designs import Design
from studies.controllers.flown import WINDS, measures, plan
from studies.controllers.plant import baseline, closed, flown_plant
from studies.known_kinematics import flights as training
from studies.known_kinematics import models
from symheli import LPVStateSpace
from symheli.errors import SynthesisError, UnknownNameError
from synthesis import Plant

CONTROLLERS = {
    "lqr": designs.LQR,
    "hinf": designs.HINF,
    "lft": designs.LFT,
    "lpv": designs.BASELINE,
    "identified": designs.IDENTIFIED,
}
"""Controllers of the study by their names in campaigns."""


def control(
    *,
    vehicle: str = "xcell60",
    controller: str = "lqr",
    mass: float = 1.0,
    inertia: float = 1.0,
    wind: float = WINDS[1],
    certified: bool = False,
    flown_to_identify: int = 0,
    flights: int = 20,
    seed: int = 0,
) -> dict[str, float]:
    """A controller of the study, designed for the vehicle as it is in its file, on `flights`
    transitions in turbulence of `wind` (mean at 20 ft, m/s) with the factors `mass` and `inertia`.

    `certified`: its loop is proven, too, which takes a minute; `flown_to_identify`: the seed of the
    flights from which the model is identified that "identified" is designed on.
    """
    found = designed(vehicle, controller, flown_to_identify)
    if found.controller is None:
        raise SynthesisError(f"{found.name}: {found.reason}")
    heli, plans = scattered(vehicle, mass, inertia, "pi"), [plan(found.controller, wind)]
    # the other cores have cases of their own
    flown = measures(heli, plans, range(seed, seed + flights), workers=1)
    row = {
        "controller states": float(found.order),
        "promised gain": found.promised,
        "frozen gain": found.frozen,
        "lost": float(np.mean([one.lost for one in flown])),
        "beyond the equations": float(np.mean([one.beyond for one in flown])),
    }
    if certified:
        bounds = proofs(found.name, closed(plants(vehicle)[1], found.controller))
        row["proven gain"] = CertifiedControllers(bounds=tuple(bounds)).gain(found.name)
    kept = [one for one in flown if not one.lost]
    if kept:
        for name, values in {
            "energy ratio": [one.ratio for one in kept],
            "speed error": [one.speed for one in kept],
            "largest attitude": [one.attitude for one in kept],
        }.items():
            row |= {
                f"{name}, median": float(np.median(values)),
                f"{name}, worst": float(max(values)),
            }
    return row


@cache
def designed(vehicle: str, controller: str, flown_to_identify: int) -> Design:
    """Design for the vehicle of the file, once a process."""
    if controller not in CONTROLLERS:
        raise UnknownNameError("controller", controller, CONTROLLERS)
    name, (base, flown) = CONTROLLERS[controller], plants(vehicle)
    make = (
        designs.from_data(identified(vehicle, flown_to_identify))
        if name == designs.IDENTIFIED
        else designs.from_equations(helicopter(vehicle), base)[name]
    )
    return designs.design(name, make, flown)[0]


@cache
def plants(vehicle: str) -> tuple[LPVStateSpace, Plant]:
    """Return the baseline, and the plants to simulate and certify."""
    base = baseline(helicopter(vehicle))
    return base, flown_plant(base)


@cache
def identified(vehicle: str, seed: int) -> KinematicModel:
    """Identify from an aggressive and a gentle flight, over airspeed and acceleration, as in the
    study.
    """
    heli, pilot = helicopter(vehicle), autopilot(vehicle)
    records = [
        symheli.fly(heli, make(seed, pilot)) for make in (training.aggressive, training.gentle)
    ]
    return models.identified(records, models.simulator_of(vehicle, heli)[1])


TRIAL = Trial(
    control,
    {
        "controller states": "1",
        **dict.fromkeys(("promised gain", "frozen gain", "proven gain"), "1"),
        **dict.fromkeys(("lost", "beyond the equations"), "1"),
        **{
            f"{name}, {which}": unit
            for name, unit in {
                "energy ratio": "1",
                "speed error": "m/s",
                "largest attitude": "rad",
            }.items()
            for which in ("median", "worst")
        },
    },
)
"""Of the flights that were not lost, but for the share that was; beyond the equations: the share of
the time that was flown faster than they hold for.
"""
