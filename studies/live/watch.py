"""The loop of `symheli live`: receive, record, align, identify, say once a second what is known."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from studies.live.identifier import EVERYTHING, LiveIdentifier, Prediction
from studies.live.lamp import Lamp, Pilot
from studies.live.recorder import Recorder
from studies.live.sample import Sample, Source
from studies.live.stream import Stream, StreamState

SIGNALS = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "airspeed")
"""Signals that are recorded of every vehicle, beside its controls."""
PATIENCE = 0.05
"""Longest time without a look at the clock, s."""
EVERY = 1.0
"""Seconds between two lines."""
NOBODY = ("no certified controller is given: symheli circle designs one",)
"""Why the lamp is not green where nobody flies."""
SLOWER = 1.2
"""Times the period of the rows that samples may be apart before it is said."""


@dataclass
class Watch:
    """A source that is watched: samples that came, the model they give, and who flies."""

    source: Source
    identifier: LiveIdentifier
    stream: Stream
    recorder: Recorder | None = None
    pilot: Pilot | None = None
    prediction: Prediction | None = None
    received: int = 0
    last: float = math.nan
    airspeed: float = math.nan
    latest: Sequence[Sample] = ()
    looks: list[Callable[[Watch], None]] = field(default_factory=list)
    """Called after each receive, whose samples are `latest`, in the thread that receives."""
    _stopped: bool = False

    def run(
        self,
        seconds: float,
        say: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        over: Callable[[], bool] = lambda: False,
    ) -> None:
        """Watch for so long (s), or until nothing more can come, it is `over`, or Ctrl-C; what
        came is recorded and identified from then.
        """
        begun = said = clock()
        alone = threading.current_thread() is threading.main_thread()
        heard = alone and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if heard:
            signal.signal(signal.SIGINT, self._interrupted)
        try:
            while (now := clock()) - begun < seconds and not (self._stopped or over()):
                self.latest = self.source.receive(PATIENCE)
                for sample in self.latest:
                    self.take(sample, clock())
                self.stream.idle(now)
                for look in self.looks:
                    look(self)
                if now - said >= EVERY:
                    said = now
                    self.prediction = self.identifier.prediction()
                    say(self.line())
        except EOFError:
            pass
        except OSError as error:
            say(f"{self.source.name} has ended: {error}")
        finally:
            if heard:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            self.prediction = self.identifier.prediction() or self.prediction
            self.source.close()
            if self.recorder is not None:
                self.recorder.close()
                if self.recorder.problem:
                    say(f"RECORD: {self.recorder.path} is not whole: {self.recorder.problem}")

    def _interrupted(self, *_: Any) -> None:
        """End at the next look at the clock; a second Ctrl-C does not wait for it."""
        self._stopped = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    def take(self, sample: Sample, now: float) -> None:
        """Record and learn a sample that came at `now` (s), unless another vehicle sent it."""
        rows = self.stream.take(sample, now)
        if sample.sender != self.stream.sender:
            return
        self.received += 1
        if self.recorder is not None:
            self.recorder.add(sample, now)
        for row in rows:
            self.identifier.take(row)
            if self.pilot is not None and self.pilot.take(row):
                self.identifier = self.identifier.afresh()
        self.last = sample.time
        self.airspeed = float(sample.values.get("airspeed", math.nan))

    def line(self) -> str:
        """One line: time, airspeed, state of the stream, what is known, what to fly next."""
        if not self.received:
            return f"waiting: nothing has come from {self.source.name} yet"
        cells = self.identifier.coverage()
        whole = sum(not cell.missing(self.identifier.largest) for cell in cells)
        parts = [
            f"{self.last:8.1f} s",
            f"airspeed {self.airspeed:4.1f} m/s",
            f"{self.identifier.learnt} samples learnt",
            f"{whole} of {len(cells)} airspeeds covered",
            *self._predicted(),
            *self._said(),
        ]
        if self.stream.state is not StreamState.GOOD:
            parts.append(f"{self.stream.state.name}: {self.stream.state.value}")
        if self.recorder is not None and self.recorder.problem:
            parts.append(f"RECORD: {self.recorder.problem}")
        return "; ".join(parts)

    def _said(self) -> list[str]:
        """Return what to do or, where a pilot flies, whether it may be relied on."""
        if self.pilot is not None:
            return [f"lamp {self.lamp}"]
        return self.problems() or [self.identifier.next_to_fly()]

    @property
    def lamp(self) -> Lamp:
        """Green only where samples come as they should, every airspeed is covered, and the pilot
        has nothing against its controller.
        """
        found = list(self.problems())
        if self.stream.state is not StreamState.GOOD:
            found.append(f"{self.stream.state.name}: {self.stream.state.value}")
        if (left := self.identifier.next_to_fly()) != EVERYTHING:
            found.append(left)
        reasons = NOBODY if self.pilot is None else self.pilot.reasons()
        return Lamp((*found, *reasons))

    def problems(self) -> list[str]:
        """Return what keeps the stream from teaching, and what to do."""
        found, rate = [], 1.0 / self.stream.period
        if self.stream.missing:
            names = ", ".join(self.stream.missing)
            found.append(f"nothing can be learnt: no number has come of {names}")
        if rate * SLOWER * self.stream.dt < 1.0:
            found.append(f"only {rate:.3g} samples come a second: give --rate {max(rate, 1):.0f}")
        return found

    def _predicted(self) -> list[str]:
        if self.prediction is None:
            return []
        worst, fit = min(self.prediction.fit.items(), key=lambda item: item[1])
        fits = f"{fit:.0f} %" if fit >= 0 else "worse than the mean"
        return [f"1 s prediction: worst {worst}, {fits}"]

    def data(self) -> Mapping[str, Any]:
        """Return the numbers for a program."""
        identifier = self.identifier
        middles = [cell.low for cell in identifier.coverage()][1::3]
        return {
            "source": self.source.name,
            "samples": self.received,
            "states": {state.name: count for state, count in self.stream.counts.items()},
            "learnt": identifier.learnt,
            "outside_the_range": identifier.outside,
            "coverage": [
                {
                    "airspeed": cell.low,
                    "samples": cell.samples,
                    "motion": cell.motion,
                    "missing": cell.missing(identifier.largest),
                }
                for cell in identifier.coverage()
            ],
            "next": identifier.next_to_fly(),
            "prediction": None if self.prediction is None else self.prediction.fit,
            "control_power": [p._asdict() for p in identifier.control_powers(middles)],
            "lamp": {"green": self.lamp.green, "reasons": list(self.lamp.reasons)},
            "alarm": None if self.pilot is None else self.pilot.alarm,
            "pilot": None if self.pilot is None else self.pilot.data(),
            "record": None if self.recorder is None else self.recorder.path,
            "units": {"airspeed": "m/s", "prediction": "%"},
        }
