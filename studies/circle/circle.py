"""The circle: identify while the vehicle's own autopilot flies, design and certify beside it, take
the controls where the lamp is green, give them back where the vehicle has changed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np

from studies.circle.alarm import HORIZON, VehicleAlarm
from studies.circle.designed import Designed, designed
from studies.circle.vehicle import Vehicle
from studies.known_kinematics.models import SCHEDULING
from studies.live.identifier import STATES
from studies.live.sample import EXCITATION, STICKS
from studies.live.stream import Row
from symheli import FlightRecord
from symheli.errors import SymheliError
from symheli.flight import HypothesisEvents, HypothesisMonitor, TableState
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.values.signal import Signal

LEARN = 240.0
"""Seconds of a flight that a model is identified from, at least."""
MORE = 60.0
"""Seconds more after a model that was not fit."""
LATE, TOO_LATE = 5, 25
"""Samples of the last second that were not known, or whose command came late: so many put the lamp
out, at so many that came later than `TOLERATED` the sticks are given back.
"""
TOLERATED = 2
"""Samples from a command to the vehicle that a flight goes on with; one is what is certified."""
HYPOTHESES = {
    HypothesisEvents.RANGE: "the commanded airspeed is outside what is proven",
    HypothesisEvents.RATE: "the commanded airspeed changes faster than is proven",
    HypothesisEvents.SATURATED: "a command is at its limit",
    HypothesisEvents.PERIOD: "a sample did not come in its time",
    HypothesisEvents.MISSING: "a measurement is missing",
    HypothesisEvents.UNKNOWN: "the hypotheses are not known yet: the last samples were not whole",
}
COMMAND_ERROR = 1e-3
"""Rounding of a commanded airspeed, m/s."""
LONGEST = 60.0
"""Seconds from a row to the next beyond which the clock of the vehicle has jumped."""
BLIND = 5
"""Seconds in a row whose prediction is not known, at which a change would not be noticed."""
LATER = "commands arrive later than a sample of {:g} s, or rows are unknown"
SAME = 1e-4
"""Difference of a command and what is flown, as a part of its travel, that is rounding."""
KEPT = 10.0
"""Seconds of rows that are kept while the controller flies."""
QUIET = 2.0
"""Seconds without excitation before the switch: what is in force then would fade as a push."""
AROUND = 0.5
"""Seconds before and after the switch over which the steps of the commands are looked at."""
SIGNALS = (
    *map(Signal, (*STATES, *map(str, INPUTS), "airspeed", SCHEDULING[0])),
    Signal(SCHEDULING[1], "m/s^2"),
)


class Phase(Enum):
    """A phase of the circle."""

    IDENTIFYING = "the vehicle's own autopilot flies and excites"
    DESIGNING = "a controller is designed, certified and judged; the vehicle's own autopilot flies"
    SETTLING = "a controller may fly; the vehicle's own autopilot ends its excitation"
    CONTROLLING = "the certified controller flies"


class Event(NamedTuple):
    """An event at a time of the flight, s."""

    time: float
    what: str


@dataclass
class Switch:
    """Largest step of a command from a sample to the next, as a part of its travel: `at` the
    switch, in the half second `before`, under the autopilot, and `after`.
    """

    at: float
    before: float
    after: float = 0.0


class Commanded(Protocol):
    """A line to the sticks of a vehicle."""

    def command(self, sticks: Mapping[str, float]) -> None:
        """Send the sticks, each -1 to 1, or whether the vehicle excites itself."""


class Circle:
    """The pilot of a `Watch`: takes its rows, commands its vehicle where the lamp is green.

    Parameters
    ----------
    vehicle : Vehicle
        Whose plan is flown; its change is not looked at.
    source : Commanded
        Where commands go.
    executor : Executor
        Where designs are made.
    say : callable
        Takes a sentence about what happens.
    make : callable
        (record, name of the vehicle) -> `Designed` or a sentence.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        source: Commanded,
        executor: Executor,
        say: Callable[[str], None],
        make: Callable[[FlightRecord, str], Designed | str] = designed,
    ):
        self.vehicle, self._source, self._executor = vehicle, source, executor
        self._say, self._make = say, make
        heli = vehicle.helicopter
        self._plan = replace(vehicle.plan(heli), change=None)
        self._dt, self._travel = self._plan.dt, np.asarray(heli.travel)
        self.phase, self.events = Phase.IDENTIFYING, list[Event]()
        self.designs: list[Designed] = []
        self.alarm: str | None = None
        self.switches: list[Switch] = []
        self._rows: dict[int, Array] = {}
        self._last, self._enough = -1, LEARN
        self._future: Future[Designed | str] | None = None
        self._state: TableState | None = None
        self._alarm: VehicleAlarm | None = None
        self._asked = 0
        self._switched = 0
        self._events = HypothesisEvents.UNKNOWN
        self._sent: dict[int, Array] = {}
        self._lags: deque[float] = deque(maxlen=round(1.0 / self._dt))

    # --- row by row -------------------------------------------------------------------------------

    def take(self, row: Row) -> bool:
        """Take in a row of states, sticks and airspeed, and command where it is this circle's turn;
        return whether it is another vehicle from now on.
        """
        k = round(row.time / self._dt)
        if k == self._last:
            return False
        before, self._last = self._last, k
        if before >= 0 and not 0 < k - before <= LONGEST / self._dt:
            self._give_back(k, "the clock of the vehicle has jumped")
        values = np.array(row.values)
        values[len(STATES) : len(STATES) + 4] *= self._travel
        self._rows[k] = values
        if self.phase is Phase.CONTROLLING:
            self._lags.extend([math.inf] * (k - before - 1))
            self._look_at_delay(k, values)
        if self.phase is Phase.CONTROLLING:
            self._fly(k, values, (k - before) * self._dt)
            self._look_at_steps(k)
        if k % round(HORIZON / self._dt) == 0:
            self._look(k)
        return not self._rows  # begun anew

    def _fly(self, k: int, values: Array, elapsed: float) -> None:
        design, state = self.designs[-1], self._state
        assert state is not None  # noqa: S101
        V, a = (float(x[0]) for x in self._plan.schedule(np.array([k * self._dt])))
        x, u = design.at_rest(V, a)
        command, self._state = design.table.update(state, values[: len(STATES)], x, u, V)
        self._events, self._monitored = self._monitor.update(
            self._monitored, V, elapsed, command, valid=bool(np.isfinite(values).all())
        )
        if np.isfinite(command).all():
            sticks = command / self._travel
            self._source.command(dict(zip(STICKS, sticks.tolist(), strict=True)))
            self._sent = {j: u for j, u in self._sent.items() if j > k - TOLERATED} | {k: sticks}

    def _look_at_delay(self, k: int, values: Array) -> None:
        """Keep whether the vehicle flies what was commanded a sample ago, as the design has it; an
        unknown row is flown by an old command.
        """
        flown = values[len(STATES) : len(STATES) + 4] / self._travel
        if not np.isfinite(values[: len(STATES) + 4]).all():
            self._lags.append(math.inf)
        elif self._sent:
            self._lags.append(self._lag(k, flown))
        if sum(lag > TOLERATED for lag in self._lags) >= TOO_LATE:
            self.alarm = None
            self._give_back(k, LATER.format(self._dt))

    def _lag(self, k: int, flown: Array) -> float:
        """Samples since the command that is flown was computed; inf of an older one."""
        for j in sorted(self._sent, reverse=True):
            if np.abs(flown - np.clip(self._sent[j], -1, 1)).max() <= SAME:
                return max(k - j, 1)
        return math.inf

    def _look_at_steps(self, k: int) -> None:
        """Keep what the commands do after the switch."""
        last, step = self.switches[-1], self._step(k)
        if math.isnan(last.at) and self._lags and math.isfinite(self._lags[-1]):
            last.at = step  # the first command that is flown
        elif math.isfinite(last.at + step) and k - self._switched <= AROUND / self._dt:
            last.after = max(last.after, step)

    def _step(self, k: int) -> float:
        """Largest step of a command before sample k, as a part of its travel; NaN where a row is
        unknown.
        """
        if k not in self._rows or k - 1 not in self._rows:
            return math.nan
        change = (self._rows[k] - self._rows[k - 1])[len(STATES) : len(STATES) + 4]
        return float(np.max(np.abs(change) / self._travel))

    # --- once a second ----------------------------------------------------------------------------

    def _look(self, k: int) -> None:
        flown = len(self._rows) * self._dt
        if self.phase is Phase.IDENTIFYING and flown >= self._enough:
            self._happens(k, "the flight is identified, a controller is designed beside it")
            self._future = self._executor.submit(self._make, self.record(), self.vehicle.name)
            self.phase, self._asked = Phase.DESIGNING, k
        elif self.phase is Phase.DESIGNING and self._future is not None and self._future.done():
            self._judge(k, _result(self._future))
        elif self.phase is Phase.SETTLING:
            self._source.command({EXCITATION: 0.0})  # again: one may have been lost
            if k >= self._switched:
                self._switch(k)
        elif self.phase is Phase.CONTROLLING and self._alarm is not None:
            self.alarm = self._alarm.take(self.record(2.0 * HORIZON + 0.5))
            self._rows = {j: row for j, row in self._rows.items() if j > k - KEPT / self._dt}
            if self.alarm is not None:
                self._give_back(k, f"the vehicle has changed ({self.alarm})")

    def _judge(self, k: int, found: Designed | str) -> None:
        objections = [found] if isinstance(found, str) else found.objections
        if isinstance(found, str) or objections:
            self._enough = len(self._rows) * self._dt + MORE
            self.phase = Phase.IDENTIFYING
            self._happens(k, f"not fit to fly, {MORE:g} s more are flown: {'; '.join(objections)}")
            return
        self._ready = found
        self.phase, self._switched = Phase.SETTLING, k + round(QUIET / self._dt)
        self._source.command({EXCITATION: 0.0})

    def _switch(self, k: int) -> None:
        """Take the sticks, beginning at the commands in force."""
        found, now = self._ready, self._rows[k][len(STATES) : len(STATES) + 4]
        if not np.isfinite(now).all() or not self._is_still(k, found):
            return  # at the next look
        self.designs.append(found)
        self.alarm = None
        self._state = found.table.init(command=now)
        self._monitor = HypothesisMonitor.of(found.table, found.proven, noise=COMMAND_ERROR)
        self._monitored = self._monitor.init()
        self._switched = k
        before = [self._step(j) for j in range(k - round(AROUND / self._dt), k + 1)]
        self.switches.append(Switch(math.nan, float(np.nanmax([0.0, *before]))))
        self.phase = Phase.CONTROLLING
        self._happens(
            k,
            f"the certified controller has the sticks: gain {found.certificate.bound:.3g} proven"
            f" to {found.proven.rate:g} m/s^2, nu-gap bound {found.share:.2f} of the margin",
        )
        self._fly(k, self._rows[k], self._dt)

    def _is_still(self, k: int, found: Designed) -> bool:
        """Whether the vehicle is the one that was identified. The flight since then is looked at a
        second before the switch, which it would delay.
        """
        begun = self._alarm is not None
        self._alarm = self._alarm or VehicleAlarm(found.model, found.deviations)
        seconds = 1 if begun else round((k - self._asked) * self._dt / HORIZON)
        self.alarm = self._alarm.take(self.record((seconds + 1) * HORIZON + 0.5), seconds)
        seen = self._alarm.unknown < BLIND
        if self.alarm is not None:
            self._give_back(k, f"the vehicle has changed meanwhile ({self.alarm})")
        return begun and seen and self.alarm is None

    def _give_back(self, k: int, why: str) -> None:
        """Leave the sticks to the vehicle's own autopilot, and begin to identify anew."""
        self._happens(k, f"{why}: its own autopilot has the sticks")
        self.phase, self._enough = Phase.IDENTIFYING, LEARN
        self._rows, self._state, self._alarm = {}, None, None
        self._sent = {}
        self._lags.clear()
        self._source.command({EXCITATION: 1.0})

    def _happens(self, k: int, what: str) -> None:
        self.events.append(Event(k * self._dt, what))
        self._say(f"{k * self._dt:8.1f} s; {what}")

    # --- what is known ----------------------------------------------------------------------------

    def record(self, seconds: float = math.inf) -> FlightRecord:
        """Return the rows since the circle began anew, or of the last seconds (s), with the plan;
        unknown rows are NaN.
        """
        first = max(min(self._rows), self._last - seconds / self._dt)
        numbers = range(math.ceil(first), self._last + 1)
        none = np.full(len(SIGNALS) - len(SCHEDULING), math.nan)
        seen = np.array([self._rows.get(k, none) for k in numbers])
        time = np.array(numbers) * self._dt
        return FlightRecord(
            time,
            np.column_stack([seen, *self._plan.schedule(time)]),
            SIGNALS,
            meta={"plan": self._plan},
        )

    def reasons(self) -> list[str]:
        """Return why the lamp is not green; empty where every hypothesis holds."""
        if self.alarm is not None:
            return [f"the vehicle has changed: {self.alarm}"]
        if self.phase is not Phase.CONTROLLING:
            return [f"no controller flies yet: {self.phase.value}"]
        design = self.designs[-1]
        found = [words for event, words in HYPOTHESES.items() if event in self._events]
        if sum(lag > 1 for lag in self._lags) >= LATE:
            found.append(LATER.format(self._dt))
        if self._alarm is not None and self._alarm.unknown >= BLIND:
            found.append(f"no prediction of the last {self._alarm.unknown} s is known")
        return found + design.objections

    def data(self) -> Mapping[str, Any]:
        """Return the numbers for a program."""
        return {
            "phase": self.phase.name,
            "doing": self.phase.value,
            "events": [event._asdict() for event in self.events],
            "designs": [
                {
                    "proven": one.certificate.bound,
                    "verified": one.exact,
                    "rate": one.proven.rate,
                    "nu_gap_over_margin": one.share,
                    "verdict": one.verdict.verdict,
                    "order": one.table.order,
                    "seconds": dict(one.seconds),
                }
                for one in self.designs
            ],
            "switches": [asdict(switch) for switch in self.switches],
        }


def _result(future: Future[Designed | str]) -> Designed | str:
    """Return the design, or in words why there is none."""
    try:
        return future.result()
    except SymheliError as error:
        return str(error)
