"""An aggressive flight for identification, and one for validation."""

from __future__ import annotations

from collections.abc import Mapping

from studies.setup.flights import AMPLITUDE as STUDY_AMPLITUDE
from studies.setup.flights import NOISE_DB, TOP
from symheli import AirspeedSchedule, Excitation, FlightPlan, Wind
from symheli.flight import Autopilot
from symheli.lpv.tools import Actuation

TARGETS = (
    *(13.0, 0.0, 6.5, 13.0, 3.0, 10.0, 0.0, 13.0, 5.0, 0.0),
    *(9.0, 13.0, 0.0, 7.0, 2.0, 12.0, 0.0, 13.0, 0.0, 8.0),
)
"""Airspeeds reached in turn, m/s: both ends of the range several times, since nothing beyond an end
helps to tell what is there.
"""

RAMPS = (1.5, 3.0, 4.0, 2.0, 3.5, 2.5)
"""Peak accelerations, m/s^2, in turn."""

HOLD = 3.0
"""Time at each airspeed, s."""

LONGEST = 150.0
"""Length of the aggressive flight, s."""

LINES = (0.02, 4.0)
"""Lines of the multisines, Hz."""

AMPLITUDE = {"d_lon": 0.018, "d_lat": 0.010, "d_col": 0.015, "d_ped": 0.016}
"""Amplitudes of the multisines, rad: louder where the slow longitudinal modes are, and low enough
sideways that the flapping stays linear.
"""

GENTLE_TARGETS = (0.0, 2.0, 0.0, 4.0, 0.0, 13.0, 0.0, 1.0, 0.0, 7.0, 0.0, 3.0, 0.0)
GENTLE_LONGEST = 230.0
GENTLE_HOLD = 12.0
GENTLE_LINES = (0.01, 4.0)
"""The same of the gentle flight at 1 m/s^2: slow modes take time, and the slowest are those of
hover.
"""

HELD_TARGETS = (0.0, 3.0, 6.0, 9.0, 13.0, 7.0, 2.0, 0.0)
HELD, HELD_LOUDNESS, HELD_RAMP = 40.0, 0.4, 0.5
"""Airspeeds of a flight that tells slow modes, how long each is held (s), amplitude over that of
`AMPLITUDE`, and the acceleration between them (m/s^2). What a structure leaves out grows with all
that moves; with it the growth rates are off.
"""

TEST_LINES = (0.1, 5.0)
TEST_AMPLITUDE = STUDY_AMPLITUDE
"""Amplitudes of the flight that judges: those of the study."""


def aggressive(
    seed: int,
    autopilot: Autopilot,
    *,
    noise_db: float | None = NOISE_DB,
    servos: Actuation | None = None,
    wind: Wind | None = None,
    longest: float = LONGEST,
    louder: float = 1.0,
) -> FlightPlan:
    """Ramps at 1.5 to 4 m/s^2 between 0 and 13 m/s, multisines on all inputs, `louder` times as
    large as `AMPLITUDE`, at most `longest` (s).
    """
    schedule = _ramps(RAMPS, HOLD, longest)
    amplitude = {u: louder * size for u, size in AMPLITUDE.items()}
    return _plan(schedule, seed, autopilot, noise_db, servos, wind, amplitude=amplitude)


def gentle(
    seed: int,
    autopilot: Autopilot,
    *,
    noise_db: float | None = NOISE_DB,
    servos: Actuation | None = None,
    wind: Wind | None = None,
) -> FlightPlan:
    """Hover again and again, and what lies between at 1 m/s^2: long holds, lower lines, 230 s."""
    schedule = _ramps((1.0,), GENTLE_HOLD, GENTLE_LONGEST, GENTLE_TARGETS)
    return _plan(schedule, 5000 + seed, autopilot, noise_db, servos, wind, GENTLE_LINES)


def held(seed: int, autopilot: Autopilot, *, noise_db: float | None = NOISE_DB) -> FlightPlan:
    """Eight airspeeds from 0 to 13 m/s, each held for 40 s, with small multisines: 400 s."""
    count = len(HELD_TARGETS)
    schedule = AirspeedSchedule(HELD_TARGETS, (HELD_RAMP,) * count, (HELD,) * count)
    amplitude = {u: HELD_LOUDNESS * size for u, size in AMPLITUDE.items()}
    return _plan(schedule, 5000 + seed, autopilot, noise_db, None, None, GENTLE_LINES, amplitude)


def transition(
    seed: int,
    autopilot: Autopilot,
    *,
    noise_db: float | None = NOISE_DB,
    servos: Actuation | None = None,
    wind: Wind | None = None,
) -> FlightPlan:
    """Hover, 13 m/s, hover at 3.2 m/s^2 with other multisines: the study's test flight."""
    schedule = AirspeedSchedule.transition(0.0, TOP, 3.2, hold=2.0)
    return _plan(
        schedule, 3000 + seed, autopilot, noise_db, servos, wind, TEST_LINES, TEST_AMPLITUDE
    )


def _ramps(
    accelerations: tuple[float, ...],
    hold: float,
    longest: float,
    targets: tuple[float, ...] = TARGETS,
) -> AirspeedSchedule:
    """Return as many of the targets as `longest` (s) allows."""
    for count in range(len(targets), 0, -1):
        peaks = tuple(accelerations[i % len(accelerations)] for i in range(count))
        schedule = AirspeedSchedule(targets[:count], peaks, (hold,) * count)
        if schedule.duration <= longest:
            break
    return schedule


def _plan(
    schedule: AirspeedSchedule,
    seed: int,
    autopilot: Autopilot,
    noise_db: float | None,
    servos: Actuation | None,
    wind: Wind | None,
    lines: tuple[float, float] = LINES,
    amplitude: Mapping[str, float] = AMPLITUDE,
) -> FlightPlan:
    return FlightPlan(
        schedule,
        excitation=Excitation(amplitude, "multisine", lines, seed),
        noise_db=noise_db,
        seed=seed,
        controller=autopilot,
        wind=wind or Wind(),
        servos=servos,
    )
