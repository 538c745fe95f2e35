"""Predicted margins and responses after a change of gains beside the true ones: simulated flights
of an X-Cell under ArduPilot-like loops, calibrated from the log of the flight.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import symheli
from evidence.marks.calibrated import start_of
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import calibrate
from studies.autopilot.tuned import LEAST, LoopAt, loop_margins
from studies.known_kinematics.models import PAIRS
from studies.output import as_json
from symheli import AirspeedSchedule, Excitation, Helicopter
from symheli.flight import HelicopterLoops
from synthesis.design.loops.loop_measures import MEASURES

TRUTH = "xcell60"
AIRSPEEDS = (0.0, 4.0, 8.0, 12.0)
"""Where margins are predicted, m/s."""

GAINS = {
    "RLL": {"P": 0.02, "I": 0.05, "D": 0.0002, "FF": 0.05, "attitude": 4.5},
    "PIT": {"P": 0.03, "I": 0.05, "D": 0.0003, "FF": 0.06, "attitude": 4.5},
    "YAW": {"P": 0.08, "I": 0.1, "D": 0.0, "FF": 0.02, "attitude": 4.5},
}
THROW = {"d_lat": 0.15, "d_lon": 0.15, "d_ped": 0.3}
"""Deflections at full output, rad."""

CHANGED = ("P", "D", "I")
FACTORS = (0.3, 30.0)
"""Range of the factor by which one gain is changed, even in its logarithm."""

DRAWS = 12
"""Helicopters drawn from the uncertainty of the calibration."""

ENOUGH = (6.0, 45.0)
"""Margins, dB and degrees, that are to be called stable."""


def parameters() -> dict[str, float]:
    """Parameters of the loops that flew."""
    found = {"SCHED_LOOP_RATE": 50.0, "INS_GYRO_FILTER": 20.0}
    for axis, gains in GAINS.items():
        found |= {f"ATC_RAT_{axis}_{n}": v for n, v in gains.items() if n != "attitude"}
        found |= {f"ATC_RAT_{axis}_IMAX": 0.3, f"ATC_RAT_{axis}_ILMI": 0.02}
        found |= {f"ATC_RAT_{axis}_FLTT": 20.0, f"ATC_RAT_{axis}_FLTE": 0.0}
        found |= {f"ATC_RAT_{axis}_FLTD": 20.0, f"ATC_ANG_{axis}_P": gains["attitude"]}
    return found


def change_of(seed: int) -> dict[str, float]:
    """One gain of one axis, times a factor."""
    rng = np.random.default_rng(seed)
    axis = ("RLL", "PIT", "YAW")[int(rng.integers(3))]
    entry = CHANGED[int(rng.integers(2 if GAINS[axis]["D"] else 1))]
    factor = np.exp(rng.uniform(*np.log(FACTORS)))
    name = f"ATC_RAT_{axis}_{entry}"
    return {name: float(factor * parameters()[name])}


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Of one flight: the change, and each loop's margins as predicted and as they are."""

    seed: int
    change: dict[str, float]
    predicted: list[LoopAt]
    true: list[LoopAt]

    @property
    def pairs(self) -> list[tuple[LoopAt, LoopAt]]:
        """Predicted and true margins of each loop at each airspeed."""
        return list(zip(self.predicted, self.true, strict=True))

    @property
    def stable(self) -> bool:
        """Whether the changed loops are stable at all airspeeds."""
        return all(true.stable for true in self.true)

    @property
    def called(self) -> bool | None:
        """What the prediction says of that; None: not known."""
        words = {row.stable for row in self.predicted}
        return False if False in words else None if None in words else True

    @property
    def inside(self) -> bool:
        """Whether all true margins of loops that are stable lie in their bands."""
        return all(self.held("gain")) and all(self.held("phase"))

    def held(self, name: str) -> list[bool]:
        """Of one of `LEAST`, whether each true value of a loop that is stable, and called so,
        lies in its band.
        """
        found = []
        for predicted, true in self.pairs:
            if predicted.stable and true.stable:
                value, band = predicted.measures.banded(name)
                found.append(abs(value - true.measures.banded(name)[0]) <= band)
        return found

    @property
    def enough(self) -> bool:
        """Whether the true loops keep 6 dB and 45 degrees everywhere."""
        return self.stable and all(
            t.measures["gain"] >= ENOUGH[0] and t.measures["phase"] >= ENOUGH[1] for t in self.true
        )


def of_seed(seed: int) -> Prediction:
    """Fly the old gains, calibrate from the log, predict the new gains, compare with the truth."""
    heli = Helicopter.load(TRUTH, governor="ideal")
    other = Helicopter.load(PAIRS[TRUTH], governor="ideal")
    loops = HelicopterLoops.from_parameters(parameters(), throw=THROW)
    flight = symheli.fly(
        heli,
        AirspeedSchedule((12.0, 3.0, 8.0, 0.0), (2.0,) * 4, (3.0,) * 4),
        controller=loops,
        excitation=Excitation(
            {"d_lon": 0.005, "d_lat": 0.004, "d_col": 0.008, "d_ped": 0.012},
            "multisine",
            (0.05, 4.0),
            seed,
        ),
        noise_db=30.0,
        seed=seed,
    )
    found = calibrate(start_of(heli, other, seed), flight)
    change = change_of(seed)
    changed = loops.with_parameters(change)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        predicted = loop_margins([found.heli, *found.draws(DRAWS, seed)], changed, AIRSPEEDS)
        true = loop_margins([heli], changed, AIRSPEEDS)
    return Prediction(seed=seed, change=change, predicted=predicted, true=true)


def table(found: Sequence[Prediction]) -> str:
    """How often predictions held."""
    unstable = [p for p in found if not p.stable]
    enough = [p for p in found if p.enough]
    bands = np.array(
        [
            [r.measures.bands[name] for name in ("gain", "phase")]
            for p in found
            for r in p.predicted
            if r.stable
        ]
    )
    inside = sum(p.inside for p in found)
    called = sum(p.called is False for p in unstable)
    said = sum(p.called is True for p in enough)
    rows = [
        (
            "all true margins in their bands",
            f"{inside} of {len(found)}",
            "93 of 100",
            "met" if inside >= 0.93 * len(found) else "MISSED",
        ),
        (
            "changes that destabilize, called so",
            f"{called} of {len(unstable)}",
            "every one",
            "met" if called == len(unstable) else "MISSED",
        ),
        (
            "changes that leave 6 dB and 45 deg, called stable",
            f"{said} of {len(enough)}",
            "80 of 100",
            "met" if said >= 0.8 * len(enough) else "MISSED",
        ),
        (
            "half width of the bands, median",
            f"{np.median(bands[:, 0]):.2f} dB, {np.median(bands[:, 1]):.2f} deg",
            "2 dB, 10 deg",
            "met" if np.all(np.median(bands, axis=0) <= (2.0, 10.0)) else "MISSED",
        ),
    ]
    head = ("", "measured", "mark", "")
    pooled = []
    for name in LEAST:
        held = [h for p in found for h in p.held(name)]
        half = np.median([r.measures.bands[name] for p in found for r in p.predicted if r.stable])
        words = f"{half:.2g} {MEASURES[name].unit}"
        pooled.append((MEASURES[name].words, f"{sum(held)} of {len(held)}", words))
    return "\n".join(
        [
            f"Flights of {TRUTH} under loops as ArduPilot's, start of the calibration"
            f" {PAIRS[TRUTH]}, {len(found)} seeds from {found[0].seed} to {found[-1].seed}; one"
            f" gain of one axis changed by a factor of {FACTORS[0]:g} to {FACTORS[1]:g}; margins of"
            f" three loops at {', '.join(f'{v:g}' for v in AIRSPEEDS)} m/s.",
            "",
            markdown(head, rows),
            "",
            "Each quantity, pooled over flights, loops and airspeeds:",
            "",
            markdown(("", "true values in their bands", "half width, median"), pooled),
        ]
    )


def main() -> None:
    """Print how predictions held, and keep it in docs/identified.md."""
    options = parsed(parser_of(__doc__, "0-99"), "identified.md", timed=False)
    found = list(over_seeds(options, [partial(of_seed, s) for s in seeds_of(options)]))
    text = table(found)
    print(as_json([vars(p) for p in found]) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", "changed gains", text)


if __name__ == "__main__":
    from evidence import tuning  # under its own name: its results are handed on and stored by it

    tuning.main()
