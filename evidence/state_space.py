"""A helicopter from one flight as a state-space model that knows no physics, beside the filter
error method with known kinematics on the same flight: distance from the exact linear models, and
predictions.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import Polynomial, StateSpace, fit
from identification.methods import Innovations
from identification.model import KinematicModel, StateSpaceModel
from studies.known_kinematics.flights import aggressive, transition
from studies.known_kinematics.models import FASTEST, PAIRS, SCHEDULING, identified
from studies.known_kinematics.predictions import HORIZON, OUTPUTS, fits_of, states_of
from studies.known_kinematics.truth import SPEEDS, Truth, frozen_axes
from studies.output import as_json
from studies.setup.axes import ALL
from studies.setup.flights import TOP, autopilot_for
from symheli import FlightRecord, Helicopter
from symheli.errors import ConvergenceWarning
from symheli.lpv import Product

VEHICLE = "xcell60"

SECTION = "states of a helicopter"

AXIS = {"all axes": ALL}

BASIS = Product((Polynomial(2, 0.0, TOP), Polynomial(1, -FASTEST, FASTEST)), total_degree=2)

STRUCTURE = StateSpace(ALL.outputs, ALL.inputs, SCHEDULING, order=10, basis=BASIS, offset=True)

EVALUATIONS, TOLERANCE = 30, 1e-6
"""Of the search: an evaluation with all slopes takes seconds."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """nu-gap to the exact models, median over airspeeds and largest; fits 1 s ahead and in free run
    against the states without noise, percent by output; seconds of the fit.
    """

    gap: float
    worst: float
    ahead: dict[str, float]
    free: dict[str, float]
    seconds: float


def of_seed(seed: int) -> dict[str, Found]:
    """Both models of one flight, by name, and the subspace start alone."""
    heli, simulator = (Helicopter.load(n, governor="ideal") for n in (VEHICLE, PAIRS[VEHICLE]))
    autopilot = autopilot_for(heli)
    training = symheli.fly(heli, aggressive(seed, autopilot))
    test = symheli.fly(heli, transition(seed, autopilot))
    ways: Mapping[str, Callable[[], KinematicModel | StateSpaceModel]] = {
        "known kinematics, filter error": lambda: identified(training, simulator),
        "states, subspace alone": lambda: fit(STRUCTURE, training, "subspace"),
        "states, innovations": lambda: fit(
            STRUCTURE, training, Innovations(evaluations=EVALUATIONS, tolerance=TOLERANCE)
        ),
    }
    truth, out = Truth.of(heli, AXIS), {}
    for name, way in ways.items():
        begin = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            model = way()
        seconds = time.perf_counter() - begin
        out[name] = _judged(model, heli, truth, test, seconds)
    return out


def _judged(
    model: KinematicModel | StateSpaceModel,
    heli: Helicopter,
    truth: Truth,
    test: FlightRecord,
    seconds: float,
) -> Found:
    models: Any
    if isinstance(model, KinematicModel):
        models = frozen_axes(model, truth)
    else:
        models = {"all axes": tuple(model.at(float(v), 0.0) for v in SPEEDS)}
    gap = truth.compare(models)["all axes"]["model"].gap
    clean = states_of(heli, test)
    return Found(
        gap=float(np.median(gap)),
        worst=float(gap.max()),
        ahead=fits_of(clean, model.predict(test, HORIZON)),
        free=fits_of(clean, model.simulate(test)),
        seconds=seconds,
    )


def table(found: Sequence[dict[str, Found]]) -> str:
    """A row a model: medians over seeds, of the largest nu-gap the worst seed too."""
    rows = []
    for name in found[0]:
        each = [one[name] for one in found]
        ahead = [np.median([one.ahead[y] for one in each]) for y in OUTPUTS]
        free = np.median([np.median(list(one.free.values())) for one in each])
        worst = np.array([one.worst for one in each])
        rows.append(
            [
                name,
                f"{np.median([one.gap for one in each]):.3f}",
                f"{np.median(worst):.3f} ({worst.max():.3f})",
                " ".join(f"{v:.0f}" for v in ahead),
                f"{free:.0f}",
                f"{np.median([one.seconds for one in each]):.0f}",
            ]
        )
    head = (
        "model",
        "nu-gap, median over airspeed",
        "largest (worst seed)",
        f"1 s ahead, %: {' '.join(OUTPUTS)}",
        "free run, %",
        "seconds",
    )
    about = (
        f"{VEHICLE}, {STRUCTURE.order} states, {BASIS.size} functions of airspeed and acceleration,"
        f" {len(found)} seeds; medians. A free run of states begins where it suits best, the other"
        " as measured."
    )
    return f"{about}\n\n{markdown(head, rows)}"


def main() -> None:
    """Print the table, and keep it in docs/appendix/identified.md."""
    options = parsed(parser_of(__doc__, "0-2", quick=1), "appendix/identified.md", timed=False)
    found = list(over_seeds(options, [partial(of_seed, seed) for seed in seeds_of(options)]))
    plain = [{name: asdict(one) for name, one in each.items()} for each in found]
    print(as_json(plain) if options.json else table(found))
    if options.write:
        keep(DOCS / "identified.md", SECTION, table(found))


if __name__ == "__main__":
    from evidence import state_space  # under its own name: its results are stored by it

    state_space.main()
