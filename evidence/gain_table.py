"""`python -m evidence.gain_table`: a PI structure for the X-Cell over 0 to 13 m/s, its gains as
functions of airspeed, tuned, certified and flown, beside the scheduled LQR.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np

import symheli
import synthesis
from evidence.tables import DOCS, keep, markdown
from studies.controllers.certified import FORM, SOLVER
from studies.controllers.design_choices import RATE, SIZES, TOP
from studies.controllers.designs import lqr_schedule
from studies.controllers.flown import transition
from studies.controllers.measures import Measures, measured
from studies.controllers.plant import baseline, closed, flown_plant
from studies.setup.flights import ACTUATION
from symheli import FlightPlan, Helicopter, LPVStateSpace, Wind
from symheli.environment import Dryden
from symheli.errors import ValidityWarning
from symheli.flight import ScheduledController
from symheli.lpv.bases import Polynomial
from symheli.values.kinematics import VELOCITIES
from synthesis import Certificate, Plant
from synthesis.objectives import L2
from synthesis.structures import TunableController
from synthesis.structures.design import StructuredController

PATHS = {
    ("d_lon", "u"): "PI",
    ("d_lon", "w"): "P",
    ("d_lon", "q"): "P",
    ("d_lon", "theta"): "P",
    ("d_lat", "v"): "PI",
    ("d_lat", "p"): "P",
    ("d_lat", "phi"): "P",
    ("d_col", "u"): "P",
    ("d_col", "w"): "PI",
    ("d_col", "theta"): "P",
    ("d_ped", "v"): "P",
    ("d_ped", "w"): "P",
    ("d_ped", "r"): "PI",
}
"""Velocities over attitudes over rates, multiplied out; the integrals are those of velocities."""
DEGREE = 2
LEAD = 0.3
"""First gain of an integral by the proportional one, 1/s."""
DECAY = 0.05
"""Of every frozen pole, 1/s."""
BOUNDS = (1.0, 4.0)
"""On velocities and rates, and on attitudes and commands: at rest the integrals leave the latter to
the gusts, whatever the gains.
"""
STARTS = 2
TURBULENCE, SEED = 7.7, 1
"""Mean wind at 20 ft (light), m/s, and the seed of the flight: not used in the design."""


def plant(heli: Helicopter) -> Plant:
    """The plant of the study's certificates: servos, delay and sampling as they fly."""
    return flown_plant(baseline(heli))


def structure(of: Plant) -> TunableController:
    """The paths with gains of the second degree in airspeed."""
    return TunableController.pid(of, PATHS, basis=Polynomial(DEGREE, 0.0, TOP))


def specifications(of: Plant) -> list[L2]:
    """Velocities and rates, then attitudes and commands, each with its bound."""
    first = [z for z in of.performance if z.removeprefix("weighted_") in VELOCITIES]
    rest = [z for z in of.performance if z not in first]
    return [L2(performance=z, bound=b) for z, b in zip((first, rest), BOUNDS, strict=True)]


def first_gains(lqr: LPVStateSpace, of: TunableController) -> dict[str, np.ndarray]:
    """Those of the scheduled LQR, an integral as `LEAD` times the proportional gain."""
    assert of.basis is not None
    V = np.linspace(0.0, TOP, 14)
    gains = np.array([lqr.at(v).D for v in V])
    out = {}
    for (u, y), terms in PATHS.items():
        own = of.basis.fit(V, gains[:, lqr.outputs.index(u), lqr.inputs.index(y)])
        out |= {f"{u}_{y}_{term}": own * (LEAD if term == "I" else 1.0) for term in terms}
    return out


def tuned(heli: Helicopter, starts: int = STARTS) -> StructuredController:
    """The controller."""
    of = plant(heli)
    free = structure(of)
    units = {f"{u}_{y}_{t}": SIZES[u] / SIZES[y] for (u, y), ts in PATHS.items() for t in ts}
    return synthesis.structured(
        of,
        free,
        specifications(of),
        start=first_gains(lqr_schedule(heli), free),
        units=units,
        decay=DECAY,
        starts=starts,
    )


def ratios(of: Plant, model: LPVStateSpace) -> list[float]:
    """Largest frozen gain of each specification over its bound."""
    loop = closed(of, model)
    out = []
    for one in specifications(of):
        own = loop.select(outputs=one.performance)
        out.append(synthesis.frozen_gain(own, points=27).gain / (one.bound or 1.0))
    return out


def proof(of: Plant, model: LPVStateSpace) -> Certificate:
    """The gain over all channels at the study's acceleration."""
    return synthesis.l2_gain(closed(of, model), RATE, form=FORM, solver=SOLVER, search=None)


def flight(heli: Helicopter, model: LPVStateSpace) -> Measures:
    """A transition in light turbulence with servos and delay."""
    wind = Wind(turbulence=Dryden(TURBULENCE, 20.0))
    plan = FlightPlan(
        transition(),
        controller=ScheduledController(model),
        servos=ACTUATION,
        wind=wind,
        seed=SEED,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        return measured(symheli.flight.fly_batch(heli, [plan]).data)[0]


def row(name: str, heli: Helicopter, of: Plant, model: LPVStateSpace) -> list[str]:
    """Return a row of the table: frozen gains, the proven gain, and errors of the flight."""
    one, two = ratios(of, model)
    found, flown = proof(of, model), flight(heli, model)
    return [
        name,
        f"{BOUNDS[0] * one:.4g}",
        f"{BOUNDS[1] * two:.4g}",
        f"{found.gamma:.4g}" if found.verified else "none",
        "lost" if flown.lost else f"{flown.speed:.2f} m/s",
        f"{np.degrees(flown.attitude):.0f} deg",
    ]


def main() -> None:
    """Print both tables, or keep them in docs/structured.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep them in docs/structured.md")
    parser.add_argument("--starts", type=int, default=STARTS)
    given = parser.parse_args()
    heli = Helicopter.load("xcell60", governor="ideal")
    of = plant(heli)
    begin = time.perf_counter()
    made = tuned(heli, given.starts)
    print(made, f"\n{time.perf_counter() - begin:.0f} s", flush=True)
    rows = []
    for name, model in (("structured", made.model), ("scheduled LQR", lqr_schedule(heli))):
        rows.append(row(name, heli, of, model))
        print(*rows[-1], flush=True)
    head = ["controller", "velocities, rates", "attitudes, commands"]
    compared = markdown([*head, "proven, all at 3 m/s^2", "speed error", "attitude"], rows)
    V = (0.0, 6.5, 13.0)
    gains = [
        [gain.name, *(f"{float(made.gain(gain.name, v)):.3g}" for v in V)]
        for gain in made.structure.gains
    ]
    table = markdown(["gain", *(f"{v:g} m/s" for v in V)], gains)
    count = f"{made.structure.numbers} numbers, {made.order} states."
    text = f"{count}\n\n{compared}\n\n{table}"
    if given.write:
        keep(DOCS / "structured.md", "gain table", text)
    else:
        print(text)


if __name__ == "__main__":
    main()
