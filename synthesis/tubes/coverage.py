"""Which flights a proven tube speaks of, and which hypothesis fails first for the others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import casadi
import numpy as np

from symheli import Helicopter
from symheli.errors import InputError
from symheli.records.flight_record import FlightRecord
from symheli.values.summary import summarized
from synthesis.tubes.controllers import Choice
from synthesis.tubes.reference import Reference
from synthesis.tubes.tube import Tube

SAME = 1e-9
"""Difference between two controllers, relative to the largest entry, up to which they are one."""
SLACK = 1e-9
"""Share by which a command may exceed its limits: rounding of its samples."""


class Check(NamedTuple):
    """A hypothesis of a tube in words, whether a flight keeps to it, and the numbers, if any: what
    the tube allows and what was flown, SI.
    """

    words: str
    kept: bool
    allowed: float = math.nan
    flown: float = math.nan

    def __str__(self) -> str:
        if math.isnan(self.flown):
            return self.words
        return f"{self.words}: {self.flown:.3g} flown, {self.allowed:.3g} in the tube"


@dataclass(frozen=True, eq=False)
class Coverage:
    """The hypotheses of a tube on one flight, in the order in which they are looked at.

    Examples
    --------
    >>> Coverage((Check("gusts, m/s", False, 0.25, 3.1),)).fails
    'gusts, m/s: 3.1 flown, 0.25 in the tube'
    """

    checks: tuple[Check, ...]

    __repr__ = summarized

    @property
    def covered(self) -> bool:
        """Whether the tube's statement is about this flight."""
        return all(check.kept for check in self.checks)

    @property
    def fails(self) -> str:
        """The first hypothesis that fails, with its numbers; empty where none does."""
        return next((str(check) for check in self.checks if not check.kept), "")


def coverage(tube: Tube, flight: FlightRecord) -> Coverage:
    """Whether a simulated flight keeps to the hypotheses of a proven tube: controller, sensors,
    servos and delay, excitation, gusts, command, and a start within the tube.

    Parameters
    ----------
    tube : Tube
        Of a helicopter, proven.
    flight : FlightRecord
        As `fly` and `fly_batch` return it, with its plan.

    Returns
    -------
    Coverage

    Raises
    ------
    InputError
        A tube without a proof or of another model, a record without a plan.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> calm = symheli.AirspeedSchedule((3.0,), (1.0,), (0.5,), lead=0.1, start=3.0)
    >>> flight = symheli.fly(heli, calm, wind=symheli.Wind((0.3, 0.0, 0.0)))
    >>> coverage(tube(heli, 3.0, gust=0.1), flight).covered
    False
    """
    loop, plan = tube.deviations, flight.meta.get("plan")
    reference, heli = loop.reference, loop.model
    if not (tube.verified and isinstance(reference, Reference) and isinstance(heli, Helicopter)):
        raise InputError("coverage needs a proven tube of a helicopter")
    if plan is None:
        raise InputError("the record has no plan: it must be that of a simulated flight")
    equipment, command = reference.equipment, flight["airspeed_command"]
    servos = _plain(plan.servos) == _plain(equipment.actuation.servos)
    late = math.isclose(plan.delay, equipment.actuation.delay, abs_tol=1e-9)
    quiet = plan.noise_db is None and all(
        s.noise == s.bias == 0 for s in (plan.sensors or {}).values()
    )
    wind = plan.wind.history(flight.time, command)
    return Coverage(
        (
            Check("the controller is that of the tube", _same(reference, heli, plan.controller)),
            Check("governor", ("Om" in flight.signals) == (heli.governor == "pi")),
            Check("sensors without noise and bias", quiet),
            Check("servos and delay are those of the tube", servos and late),
            Check("no excitation", plan.excitation is None),
            _at_most("gusts, m/s", loop.gust, np.linalg.norm(wind, axis=1).max()),
            *_commanded(reference, flight),
            _start(tube, heli, flight),
        )
    )


def _at_most(words: str, allowed: float, flown: float) -> Check:
    kept = bool(flown <= allowed * (1 + SLACK) + SLACK)
    return Check(words, kept, float(allowed), float(flown))


def _plain(servos: Mapping[str, Any] | None) -> dict[str, Any]:
    return {str(name): servo for name, servo in (servos or {}).items()}


def _same(reference: Reference, heli: Helicopter, controller: object) -> bool:
    """Whether a flown controller has the matrices of the tube's at the nodes of its airspeed."""
    p, z = reference.airspeeds, reference.steady[:, 0, 0]
    n = reference.own
    try:
        choice = Choice(controller, period=reference.equipment.period)
        gain, _ = choice.gains(heli, z[:, :n], z[:, n:], p)
    except InputError:
        return False
    own = reference.gain
    return gain.shape == own.shape and bool(np.abs(gain - own).max() <= SAME * np.abs(own).max())


def _commanded(reference: Reference, flight: FlightRecord) -> Iterator[Check]:
    """Range of the command and its derivatives, those above the second by differences."""
    p, a = flight["airspeed_command"], flight["acceleration_command"]
    low, high = reference.airspeeds[[0, -1]]
    yield Check("commanded airspeed, m/s, not below", bool(p.min() >= low - SLACK), low, p.min())
    yield _at_most("commanded airspeed, m/s, at most", high, p.max())
    rate, limits = a, reference.limits
    for words, limit in zip(("m/s^2", "m/s^3", "m/s^4"), limits, strict=True):
        yield _at_most(f"derivative of the commanded airspeed, {words}", limit, np.abs(rate).max())
        rate = np.diff(rate) / flight.dt if len(rate) > 1 else np.zeros(1)


def _start(tube: Tube, heli: Helicopter, flight: FlightRecord) -> Check:
    """Whether the first deviation lies in the tube; controller and servos at rest."""
    reference, p = cast(Reference, tube.deviations.reference), float(flight["airspeed_command"][0])
    inside = float(np.clip(p, *reference.airspeeds[[0, -1]]))
    i, s = (np.zeros(1, int), np.zeros(1)) if reference.sampled else reference.place([inside])
    c = np.zeros(1 + len(reference.ranges) + len(reference.whole))
    c[0] = s[0]
    x = np.asarray(casadi.evalf(casadi.SX(reference.between(reference.data[i[0]], c)[0])))[:, 0]
    at = [flight[str(name)][0] if name in flight.signals else np.nan for name in heli.states]
    e = np.zeros(len(x))
    e[: reference.own] = np.array(at) - x[: reference.own]
    P = tube.at(tube.nodes[0] if reference.sampled else inside)
    size = float(np.sqrt(e @ P @ e))
    return Check("start, share of the tube", size <= 1, 1.0, size)
