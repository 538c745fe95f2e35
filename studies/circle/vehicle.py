"""The vehicle of the circle: this project's helicopter, whose own autopilot excites it while it
flies, in a process of its own.
"""

from __future__ import annotations

import math
import socket
import threading
from bisect import bisect_left
from dataclasses import dataclass, field
from types import TracebackType

import numpy as np

import symheli
from studies.known_kinematics.flights import AMPLITUDE, HOLD, LINES, TARGETS
from studies.setup.flights import TOP
from symheli import AirspeedSchedule, Excitation, FlightPlan, Helicopter, Sensor
from symheli.errors import InputError
from symheli.flight import ParameterChange, gain_scheduled_lqr
from symheli.flight.course import Clock
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.worker import ProcessEndedError, Worker, pickled

PERIOD = 0.02
"""Period of its samples, s."""
RAMPS = (1.5, 3.0, 2.0, 2.5)
"""Peak accelerations, m/s^2, in turn: none above the rate that is certified."""
HOVER = 10.0
"""Time in each hover, s: the slowest modes are there."""
LONGEST = 36_000.0
"""Longest flight, s: every sample of its plan is known before it."""
NOISE = {
    **dict.fromkeys(("u", "v", "w"), 0.1),
    **dict.fromkeys(("p", "q", "r"), 0.01),
    **dict.fromkeys(("phi", "theta"), 0.005),
}
"""Standard deviations of its sensors, m/s, rad/s, rad."""
MASS = "body.mass"


@dataclass(frozen=True)
class Vehicle:
    """A vehicle and its flight: `duration` (s); random numbers from `seed`; with `noise` of small
    sensors; `heavier` times the mass from `change_at` (s) on, None: never.
    """

    name: str = "xcell60"
    duration: float = 600.0
    seed: int = 0
    noise: bool = True
    heavier: float = 1.0
    change_at: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.duration <= LONGEST:
            raise InputError(
                f"duration: expected a flight of up to {LONGEST:g} s, got {self.duration:g}"
            )

    @property
    def helicopter(self) -> Helicopter:
        """Equations, with the rotor speed held."""
        return Helicopter.load(self.name, governor="ideal")

    @property
    def schedule(self) -> AirspeedSchedule:
        """Its commanded airspeeds: the targets of the identification flights again and again."""

        def targets(count: int) -> list[float]:
            return [TARGETS[k % len(TARGETS)] for k in range(count)]

        counts = range(1, math.ceil(self.duration / min(HOVER, HOLD)) + 2)
        least = bisect_left(counts, self.duration, key=lambda n: _schedule(targets(n)).duration)
        return _schedule(targets(counts[least]))

    def plan(self, heli: Helicopter) -> FlightPlan:
        """The whole flight, as long as nobody takes the controls."""
        change = None
        if self.change_at is not None:
            mass = self.heavier * float(heli.parameters[MASS])
            change = ParameterChange(self.change_at, {MASS: mass})
        sensors = {name: Sensor(noise=sd) for name, sd in NOISE.items()} if self.noise else None
        return FlightPlan(
            self.schedule,
            dt=PERIOD,
            controller=gain_scheduled_lqr(heli, 0.0, TOP, PERIOD).scheduled_controller,
            excitation=Excitation(AMPLITUDE, "multisine", LINES, self.seed),
            sensors=sensors,
            seed=self.seed,
            change=change,
        )


def _schedule(targets: list[float]) -> AirspeedSchedule:
    peaks = tuple(RAMPS[k % len(RAMPS)] for k in range(len(targets)))
    holds = tuple(HOVER if target == 0.0 else HOLD for target in targets)
    return AirspeedSchedule(tuple(targets), peaks, holds)


def fly(vehicle: Vehicle, port: int, speed: float) -> int:
    """Fly, and speak X-Plane's protocol at a UDP port of this machine, `speed` times real time;
    return how many samples were late.
    """
    from studies.live.peer import OnTheWire, XPlaneLine

    heli = vehicle.helicopter
    plan = vehicle.plan(heli)
    line = XPlaneLine(port=port)
    try:
        wire = OnTheWire(plan.controller, [line], heli.travel, speed, excitation_of(plan))
        symheli.fly(heli, plan, controller=wire, excitation=None)
    finally:
        line.close()
    return wire.late


def excitation_of(plan: FlightPlan) -> Array:
    """Return what is added to the controls (samples, 4), rad: the multisine of the whole flight."""
    assert plan.excitation is not None  # noqa: S101
    signals = plan.excitation(PERIOD * np.arange(Clock.of(plan, PERIOD).samples(plan)))
    return np.column_stack([signals[str(u)] for u in INPUTS])


@dataclass
class VehicleProcess:
    """A vehicle that flies in a process of its own until it is left.

    `port`: where it listens; `error`: what ended its flight, None while it flies and at its end.
    """

    vehicle: Vehicle
    speed: float = 1.0
    port: int = 0
    error: Exception | None = None
    over: bool = False
    _worker: Worker = field(default_factory=Worker)
    _left: bool = False

    def __enter__(self) -> VehicleProcess:
        self.port = self.port or free_port()
        threading.Thread(target=self._flown, daemon=True).start()
        return self

    def _flown(self) -> None:
        try:
            self._worker(pickled(fly, self.vehicle, self.port, self.speed))
        except Exception as error:
            if not (self._left and isinstance(error, ProcessEndedError)):
                self.error = error
        self.over = True

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._left = True
        self._worker.__exit__(kind, error, trace)


def free_port() -> int:
    """Return a UDP port of this machine that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])
