"""The flights of the study: where the data come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from symheli import AirspeedSchedule, Excitation, FlightRecord, Helicopter, Wind, fly
from symheli.environment import Dryden
from symheli.flight import XCELL_SERVOS, Autopilot, gain_scheduled_lqr
from symheli.lpv.tools import Actuation

TOP = 13.0
"""Upper end of the transition, m/s (Budiyono & Sutarto: 0 <= p <= 13 m/s)."""

AMPLITUDE = {"d_lon": 0.012, "d_lat": 0.012, "d_col": 0.010, "d_ped": 0.020}
"""Multisine amplitude of each input, rad: an eighth of the cyclic travel, less of the others."""

ACCELERATIONS = (1.5, 3.0, 4.0, 2.0, 3.5, 2.5, 3.0, 1.5, 4.0, 3.0, 2.0, 3.5)
"""Peak accelerations of the ramps of the training flight, m/s^2."""

NOISE_DB = 30.0
NOISES = ("noise-free", f"{NOISE_DB:g} dB")
"""Labels of the flights of a plan and of `TransitionPlan.noisy`."""

BREEZE, BREEZE_AT_20FT, ABOVE_GROUND = (-2.0, 1.0, 0.0), 7.7, 20.0
"""A steady wind (north, east, down, m/s) and the turbulence of a mean wind of 15 kt ("light"),
flown 20 m above ground.
"""

ACTUATION = Actuation(XCELL_SERVOS, delay=0.02)
"""The servos of the X-Cell, 20 ms behind their commands."""


def light_turbulence(seed: int) -> Wind:
    """The breeze and the light turbulence of a seed."""
    return Wind(BREEZE, turbulence=Dryden(BREEZE_AT_20FT, ABOVE_GROUND), seed=seed)


@dataclass(frozen=True)
class TransitionPlan:
    """Seed and lengths of the flights of the transition study; `noise_db` None flies without sensor
    noise, `windy` in the breeze above.
    """

    seed: int = 0
    dt: float = 0.02
    ramps: int = len(ACCELERATIONS)
    noise_db: float | None = None
    windy: bool = False

    def noisy(self, db: float = NOISE_DB) -> TransitionPlan:
        """The same flights with sensor noise."""
        return replace(self, noise_db=db)

    def training(self, heli: Helicopter, autopilot: Autopilot) -> FlightRecord:
        """Ramps between random airspeeds of [0, 13] m/s at 1.5 to 4 m/s^2, multisines on all four
        inputs.
        """
        schedule = AirspeedSchedule.varied(
            0.0, TOP, ACCELERATIONS[: self.ramps], 1.5, seed=1000 + self.seed
        )
        return self._fly(heli, schedule, autopilot, 2000)

    def test(
        self, heli: Helicopter, autopilot: Autopilot, acceleration: float = 3.2
    ) -> FlightRecord:
        """Return a transition for validation: hover, 13 m/s, hover at 3.2 m/s^2, other multisines,
        other noise.
        """
        return self._fly(
            heli, AirspeedSchedule.transition(0.0, TOP, acceleration, hold=2.0), autopilot, 3000
        )

    def gentle(self, heli: Helicopter, autopilot: Autopilot, ramps: int = 10) -> FlightRecord:
        """Return slow ramps (1 m/s^2) with long holds and lower frequencies, which excite the
        lightly damped slow modes.
        """
        schedule = AirspeedSchedule.varied(0.0, TOP, (1.0,) * ramps, 4.0, seed=4000 + self.seed)
        return self._fly(heli, schedule, autopilot, 5000, lowest=0.03)

    def _fly(
        self,
        heli: Helicopter,
        schedule: AirspeedSchedule,
        autopilot: Autopilot,
        offset: int,
        lowest: float = 0.1,
    ) -> FlightRecord:
        seed = offset + self.seed
        excitation = Excitation(AMPLITUDE, "multisine", (lowest, 5.0), seed)
        wind = light_turbulence(seed) if self.windy else Wind()
        return fly(
            heli,
            schedule,
            dt=self.dt,
            excitation=excitation,
            noise_db=self.noise_db,
            seed=seed,
            wind=wind,
            controller=autopilot,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyRecords:
    """Records for identification and for validation, each {noise: record}, and the gentle
    flight.
    """

    training: Mapping[str, FlightRecord]
    test: Mapping[str, FlightRecord]
    gentle: FlightRecord

    def named(self) -> dict[str, FlightRecord]:
        """Every record under a name of its own."""
        each = {
            f"{which}, {noise}": records[noise]
            for noise in NOISES
            for which, records in (("training", self.training), ("test", self.test))
        }
        return each | {"gentle": self.gentle}


def fly_transitions(heli: Helicopter, seed: int, ramps: int, gentle_ramps: int) -> StudyRecords:
    """Simulate training and test flights without and with noise, and the gentle flight."""
    autopilot = autopilot_for(heli)
    clean = TransitionPlan(seed, ramps=ramps)
    plans = dict(zip(NOISES, (clean, clean.noisy()), strict=True))
    training, test = {}, {}
    for noise, plan in plans.items():
        training[noise] = plan.training(heli, autopilot)
        test[noise] = plan.test(heli, autopilot)
    return StudyRecords(
        training=training, test=test, gentle=clean.gentle(heli, autopilot, gentle_ramps)
    )


def autopilot_for(heli: Helicopter, dt: float = 0.02) -> Autopilot:
    """Return the gain-scheduled LQR common to all flights of the study."""
    return gain_scheduled_lqr(heli, 0.0, TOP, dt)
