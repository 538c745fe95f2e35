"""The circle around a helicopter in one process, sample by sample, without sockets or clocks."""

from collections import deque
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np

import identification
import symheli
from studies.circle.alarm import deviations
from studies.circle.circle import Circle
from studies.circle.designed import Designed, with_controls
from studies.circle.vehicle import PERIOD, excitation_of
from studies.known_kinematics.models import structure
from studies.live.peer import OnTheWire
from studies.live.sample import STICKS
from studies.live.stream import Row
from symheli import TableController
from symheli.flight import gain_scheduled_lqr
from symheli.values.kinematics import RIGID_BODY

RATE = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, rate=3.0)


class AtOnce:
    """An executor that computes where it is asked."""

    def submit(self, function, *arguments):
        made = Future()
        made.set_result(function(*arguments))
        return made


class InProcess:
    """A line whose samples the circle takes at once; `lost` ones are unknown, commands `late`."""

    def __init__(self, lost=lambda k: False, late=0):
        self.circle, self.lost, self.samples = None, lost, 0
        self.sticks, self.under_way = {}, deque([{}] * late)

    def send(self, at, values):
        names = (*map(str, RIGID_BODY), *STICKS, "airspeed")
        row = np.array([values[name] for name in names])
        if self.lost(self.samples):
            row[:] = np.nan
        self.samples += 1
        self.circle.take(Row(at, row))

    def wait(self, timeout):
        self.under_way.append(self.sticks)
        self.sticks = {}
        return self.under_way.popleft()

    def command(self, sticks):
        self.sticks = {**self.sticks, **sticks}

    def close(self):
        pass


def flown(vehicle, make, lost=lambda k: False, watched=lambda circle: None, late=0):
    """The circle and the record of the whole flight; `watched` sees the circle at each sample."""
    heli, said, line = vehicle.helicopter, [], InProcess(lost, late)
    plan = vehicle.plan(heli)
    line.circle = Circle(vehicle, line, AtOnce(), said.append, make)
    take = line.circle.take

    def seen(row):
        again = take(row)
        watched(line.circle)
        return again

    line.circle.take = seen
    wire = OnTheWire(plan.controller, [line], heli.travel, np.inf, excitation_of(plan))
    record = symheli.fly(heli, plan, controller=wire, excitation=None)
    return line.circle, record


def judged(fit="fit", share=0.5, verified=True):
    """What a judge and a certificate say of a design."""
    verdict = SimpleNamespace(
        bound=np.array([share]),
        margin=np.array([1.0]),
        criteria=[SimpleNamespace(decides=True, verdict=fit, name="J")],
        verdict=fit,
    )
    certificate = SimpleNamespace(bound=2.0)
    return {"verdict": verdict, "certificate": certificate, "exact": verified, "proven": RATE}


def quick(record, vehicle):
    """A design in a second: least squares of a flight without noise, the schedule of another
    helicopter.
    """
    model = identification.fit(structure(), record, method="ls")
    other = symheli.Helicopter.load("xcell_kahn_hudson", governor="ideal")
    lqr = gain_scheduled_lqr(other, 0.0, 13.0, PERIOD).scheduled_controller.model
    return Designed(
        model=model,
        table=TableController.of(lqr.with_scheduling(RATE)),
        trim=with_controls(model, record),
        deviations=deviations(model, record),
        seconds={},
        **judged(),
    )
