"""How often the verdict "fit for control" is wrong: flights of many kinds, identified, judged from
the flight alone, and compared with the exact linear models that the verdict has not seen.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from typing import Any

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from identification import (
    FilterError,
    FitForControl,
    InstrumentalVariables,
    KinematicARX,
    Polynomial,
    fit,
)
from identification import fit_for_control as judge
from identification.judge.criteria import SHARE_OF_MARGIN
from studies.known_kinematics.models import PAIRS
from studies.loops.lateral import STATES
from studies.loops.robust_lateral import FEEDBACK, INPUTS, SIZES
from studies.output import progress
from studies.transition.flights import ACCELERATIONS, AMPLITUDE, TOP, autopilot_for
from symheli import (
    AirspeedSchedule,
    Excitation,
    FlightRecord,
    Helicopter,
    LinearModel,
    SimulatedFlight,
)
from symheli.errors import DataWarning, SymheliError
from symheli.flight import Autopilot

SPEEDS = tuple(float(v) for v in np.linspace(0.0, TOP, 9))

DEGREE = 2
"""Of the coefficients in the airspeed."""

METHODS = ("filter error", "iv", "ls")


@dataclass(frozen=True)
class Kind:
    """A kind of flight: ramps between airspeeds (m/s^2), held for `hold` s between, with multisines
    of `amplitude` times those of the study from `lowest` Hz on, and sensor noise (dB).
    """

    accelerations: tuple[float, ...]
    hold: float = 1.5
    noise_db: float = 30.0
    amplitude: float = 1.0
    lowest: float = 0.1

    def fly(self, heli: Helicopter, autopilot: Autopilot, seed: int) -> FlightRecord:
        """Between random airspeeds of the transition, other multisines and noise a seed."""
        schedule = AirspeedSchedule.varied(0.0, TOP, self.accelerations, self.hold, seed=seed)
        amplitudes = {name: self.amplitude * a for name, a in AMPLITUDE.items()}
        return symheli.fly(
            heli,
            schedule,
            dt=0.02,
            excitation=Excitation(amplitudes, "multisine", (self.lowest, 5.0), seed),
            noise_db=self.noise_db,
            seed=seed,
            controller=autopilot,
        )


KINDS = {
    "long": Kind(ACCELERATIONS),
    "short": Kind(ACCELERATIONS[:3]),
    "noisy": Kind(ACCELERATIONS, noise_db=20.0),
    "gentle": Kind((1.0,) * 8, hold=4.0, lowest=0.03),
    "poor": Kind(ACCELERATIONS[:6], amplitude=0.1),
}


@dataclass(frozen=True)
class Outcome:
    """One flight: the verdict, what the log says of d/b (by draws alone, and in all), and what is
    true of it.

    `true_ratio` is infinite where the estimate's own loop is unstable; `lost` says whether the loop
    is unstable around the truth anywhere. A method that refuses the flight has the verdict
    "refused" and no numbers.
    """

    vehicle: str
    kind: str
    method: str
    seed: int
    verdict: str
    rows: dict[str, str]
    drawn: float
    ratio: float
    true_ratio: float
    lost: bool

    @classmethod
    def of(cls, vehicle: str, kind: str, method: str, seed: int, found: FitForControl) -> Outcome:
        """What was found of one flight, with the truth beside."""
        feedback, loops = found["nu-gap over margin"], found["unstable loops"]
        assert feedback.truth is not None
        with np.errstate(divide="ignore"):
            drawn = float((found.gap / found.margin).max())
        return cls(
            vehicle,
            kind,
            method,
            seed,
            found.verdict,
            {row.name: row.verdict for row in found.criteria if row.decides},
            drawn,
            feedback.value,
            feedback.truth,
            bool(loops.truth),
        )

    @property
    def is_fit(self) -> bool:
        """By the exact models: nu-gap at most a third of the margin, and stable, everywhere."""
        return self.true_ratio <= SHARE_OF_MARGIN and not self.lost

    @property
    def wrong(self) -> bool:
        """Said to be fit and is not."""
        return self.verdict == "fit" and not self.is_fit


@cache
def _vehicle(name: str) -> tuple[Helicopter, Autopilot, dict[float, LinearModel]]:
    heli = Helicopter.load(name, governor="ideal")
    family = symheli.sweep(heli, SPEEDS, inputs=INPUTS).select(STATES, INPUTS)
    return heli, autopilot_for(heli), dict(zip(SPEEDS, family.models, strict=True))


def outcome(vehicle: str, kind: str, method: str, seed: int) -> Outcome:
    """Fly, identify with the other vehicle's simulator, judge; beside it a fit by instruments with
    one degree more, which sees what the basis cannot hold.
    """
    heli, autopilot, truth = _vehicle(vehicle)
    simulator = SimulatedFlight(_vehicle(PAIRS[vehicle])[0])
    record = KINDS[kind].fly(heli, autopilot, seed)
    structure, richer = (
        KinematicARX(heli.inputs, "airspeed_command", basis=Polynomial(degree, 0.0, TOP))
        for degree in (DEGREE, DEGREE + 1)
    )
    how: Any = {
        "filter error": FilterError(simulator),
        "iv": InstrumentalVariables(simulator),
        "ls": "ls",
    }[method]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        try:
            model = fit(structure, record, method=how)
            second = fit(richer, record, method=InstrumentalVariables(simulator))
            found = judge(model, record, FEEDBACK, scales=SIZES, second=second, truth=truth)
        except (SymheliError, np.linalg.LinAlgError) as error:
            why = {"refused": f"{type(error).__name__}: {error}"}
            nan = float("nan")
            return Outcome(vehicle, kind, method, seed, "refused", why, nan, nan, nan, False)
    return Outcome.of(vehicle, kind, method, seed, found)


def campaign(seeds: Sequence[int], methods: Sequence[str] = METHODS[:1]) -> list[partial[Outcome]]:
    """The call for every vehicle, kind and method with each of the seeds."""
    return [
        partial(outcome, vehicle, kind, method, seed)
        for seed in seeds
        for method in methods
        for kind in KINDS
        for vehicle in PAIRS
    ]


def table(outcomes: Sequence[Outcome]) -> str:
    """A line a vehicle, kind and method: how often which verdict, how many are fit in truth, and
    how many "fit" are wrong.
    """
    heads = ("fit", "not known", "not fit", "refused")
    lines = [
        f"{'vehicle':18s} {'flight':8s} {'method':13s}"
        + "".join(f"{h:>10s}" for h in (*heads, "truly fit", "wrong"))
        + f"{'d/b said':>10s}{'true':>7s}"
    ]
    groups = dict.fromkeys((o.vehicle, o.kind, o.method) for o in outcomes)
    for group in [*groups, None]:
        some = [o for o in outcomes if group in (None, (o.vehicle, o.kind, o.method))]
        counts = [sum(o.verdict == h for o in some) for h in heads]
        known = [o for o in some if o.verdict != "refused"]
        said, true = (
            np.median(v) if v else np.nan
            for v in ([o.ratio for o in known], [o.true_ratio for o in known])
        )
        names = group or (f"all {len(some)}", "", "")
        lines.append(
            f"{names[0]:18s} {names[1]:8s} {names[2]:13s}"
            + "".join(
                f"{n:10d}"
                for n in (*counts, sum(o.is_fit for o in some), sum(o.wrong for o in some))
            )
            + f"{said:10.2f}{true:7.2f}"
        )
    return "\n".join([*lines, "d/b: medians, at the worst airspeed of each flight"])


def main(arguments: Sequence[str] | None = None) -> None:
    """`python -m evidence.marks.fit_for_control`."""
    parser = parser_of(__doc__, "1000-1009")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS[:1])
    given = parser.parse_args(arguments)
    outcomes = []
    for one in over_seeds(given, campaign(seeds_of(given), given.methods)):
        outcomes.append(one)
        progress(f"{len(outcomes)} {one.vehicle} {one.kind} {one.seed}: {one.verdict}")
        if given.json:
            print(json.dumps(asdict(one)), flush=True)
    if not given.json:
        print(table(outcomes))


if __name__ == "__main__":
    from evidence.marks import fit_for_control  # under its own name: other processes import it

    fit_for_control.main()
