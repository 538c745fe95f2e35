"""Flights under feedback: in machine code, side by side or alone, or in NumPy one at a time."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symheli.codegen import Layout
from symheli.errors import InputError
from symheli.flight.controller import ROTOR, SCHEDULING, ScheduledController
from symheli.flight.course import Clock, Course
from symheli.flight.disturbance import Disturbances
from symheli.flight.equipment import Equipment
from symheli.flight.in_numpy import MAX_BANK, InNumpy
from symheli.flight.parameter_change import ParameterChange
from symheli.flight.plan import READ
from symheli.helicopter import Helicopter
from symheli.integrate.equations import equations
from symheli.integrate.kernel import structure
from symheli.physics.attitude import flight_state
from symheli.values.arrays import Array
from symheli.values.controllers import begun
from symheli.values.named_vector import NamedVector
from symheli.values.signal import signals

KERNEL = ("integrate/rk4.c", "flight/closed_loop.c")
READINGS = (*signals(READ), *ROTOR)


@dataclass(frozen=True, eq=False)
class LoopResults:
    """Results of N flights: `out` (N, kept, nx + 9) with the states as measured, inputs, commands
    and airspeed at the record's samples, undefined after the end of a flight; `lost` (N,) the
    control sample at which a flight was lost, or -1.
    """

    out: Array
    lost: Array


class Changes(NamedTuple):
    """Parameters (N, NP) of each of N flights from a sample (N,) on; -1: never."""

    parameters: Array
    samples: Array

    @classmethod
    def of(
        cls, heli: Helicopter, changes: Sequence[ParameterChange | None], dt: float
    ) -> Changes | None:
        """Collect the changes of flights whose controller has this period (s); None without any."""
        if not any(changes):
            return None
        after = [heli.parameters.array if one is None else one.of(heli) for one in changes]
        samples = [-1 if one is None else one.sample(dt) for one in changes]
        return cls(np.array(after), np.array(samples, np.int_))


class Loops:
    """N flights with one equipment and clock, along the courses they choose."""

    def __init__(
        self,
        heli: Helicopter,
        clock: Clock,
        equipment: Equipment,
        courses: Sequence[Course],
        chosen: Sequence[int],
        disturbances: Disturbances,
        noise: Array,
        changes: Changes | None = None,
    ):
        """Flight i flies courses[chosen[i]] under its disturbances; `noise` (N or 1, 9) are the
        standard deviations of its sensors.
        """
        self.heli, self.clock, self.equipment = heli, clock, equipment
        self.courses, self.chosen, self.disturbances = courses, list(chosen), disturbances
        self.noise, self.changes = noise, changes
        self.samples = np.array([len(courses[i].time) for i in self.chosen], np.int_)
        self._stop = np.zeros(1, np.intc)

    def stop(self) -> None:
        """Stop every running flight at its next sample."""
        self._stop[0] = 1

    def fly(self, layout: Layout) -> LoopResults:
        """Fly them all; the bits are the same in every layout. Raises `KeyboardInterrupt` where it
        was stopped.
        """
        code = library(self.heli, layout)
        if code is None or not isinstance(self.equipment.controller, ScheduledController):
            return self._one_by_one(code if layout.lanes == 1 else library(self.heli, Layout()))
        found = self._empty()
        done = code.fly_loops(
            ctypes.byref(self._arguments(found)),
            ctypes.c_long(0),
            ctypes.c_long(len(self.chosen)),
        )
        if done < 0:
            raise MemoryError("no memory for the flights")
        if done:
            raise KeyboardInterrupt
        return found

    def _empty(self) -> LoopResults:
        kept = -(-int(self.samples.max()) // self.clock.every)
        count = len(self.chosen)
        return LoopResults(
            np.empty((count, kept, len(self.heli.states) + 9)), np.full(count, -1, np.int_)
        )

    # --- machine code ----------------------------------------------------------------------------

    def _arguments(self, found: LoopResults) -> ctypes.Structure:
        longest = int(self.samples.max())
        d, e, controller = self.disturbances, self.equipment, self.equipment.controller
        scheduled = controller if isinstance(controller, ScheduledController) else None
        pieces = scheduled and scheduled.pieces
        tabled = scheduled is not None and pieces is None
        own = scheduled.order if scheduled else 0
        which = scheduled.scheduled[0] if scheduled else 0
        servos = e.servos
        members: dict[str, object] = {
            "reference": _courses([c.reference for c in self.courses], longest),
            "scheduling": _courses([c.p[:, [which]] for c in self.courses], longest),
            "matrices": (
                _courses([scheduled.matrices(c.p) for c in self.courses], longest)
                if scheduled and tabled
                else None
            ),
            "start": np.stack([flight_state(self._x0(c)) for c in self.courses]),
            "longest": longest,
            "course": np.array(self.chosen, np.int_),
            "samples": self.samples,
            "wind": d.wind,
            **dict(zip(("wind_flight", "wind_sample"), _strides(d.wind), strict=True)),
            "added": d.added,
            **dict(zip(("added_flight", "added_sample"), _strides(d.added), strict=True)),
            "white": d.white,
            "white_air": d.white_air,
            "p": self.heli.parameters.array[None].copy(),
            "p_flight": 0,
            "changed": None if self.changes is None else self.changes.parameters,
            "change_at": None if self.changes is None else self.changes.samples,
            "noise": self.noise,
            "noise_flight": self.noise.shape[1] if len(self.noise) > 1 else 0,
            "bias": e.readings.bias,
            "quantum": e.readings.quantum,
            "delay": e.readings.delay,
            "period": e.readings.period,
            "own": own,
            "pieces": len(pieces.coefficients) if pieces else 0,
            "degree": pieces.coefficients.shape[1] - 1 if pieces else 0,
            "by_reading": int(scheduled is not None and scheduled.follow == "reading"),
            "governed": int(governed(self.heli)),
            "breaks": pieces and np.ascontiguousarray(pieces.breaks),
            "coefficients": pieces and np.ascontiguousarray(pieces.coefficients),
            **{
                name: servos and np.ascontiguousarray(getattr(servos, name))
                for name in ("A", "B", "C", "settled", "change", "resolution")
            },
            "travel": e.travel,
            "late": min(e.late, longest * self.clock.substeps),
            "out": found.out,
            "lost": found.lost,
            "slots": found.out.shape[1],
            "every": self.clock.every,
            "substeps": self.clock.substeps,
            "step": self.clock.step,
            "level": MAX_BANK,
            "stop": self._stop,
        }
        return structure(members)

    def _x0(self, course: Course) -> Array:
        return course.reference[0, : len(self.heli.states)]

    # --- a controller in Python, or no machine code ----------------------------------------------

    def _one_by_one(self, code: ctypes.CDLL | None) -> LoopResults:
        found = self._empty()
        arguments = self._arguments(found) if code is not None else None
        for i in range(len(self.chosen)):
            plant = (
                InNumpy(self, i, found) if code is None else _InSteps(code, arguments, i, self.heli)
            )
            self._answered(plant, self.courses[self.chosen[i]])
        return found

    def _answered(self, plant: _InSteps | InNumpy, course: Course) -> None:
        """Measure, call the controller, advance, to the end of a course or until the flight is
        lost.
        """
        answer = begun(self.equipment.controller)
        names = signals((*self.heli.states, *self.heli.inputs))
        readings = READINGS if governed(self.heli) else READINGS[: len(READ)]
        try:
            for k in range(len(course.time)):
                reading = plant.read(k)
                if reading is None:
                    break
                if self._stop[0]:
                    raise KeyboardInterrupt
                command = answer(
                    NamedVector(readings, reading[: len(readings)]),
                    NamedVector(names, course.reference[k]),
                    NamedVector(SCHEDULING, course.p[k]),
                )
                plant.command(k, _four(command, float(course.time[k])))
        finally:
            plant.end()


def governed(heli: Helicopter) -> bool:
    """Whether the rotor speed is a state, with its integral the last two."""
    return heli.governor == "pi"


def library(heli: Helicopter, layout: Layout) -> ctypes.CDLL | None:
    """The compiled loop, None without a compiler."""
    code = equations(heli).machine_code(KERNEL, layout=layout)
    if code is not None:
        code.begin_loops.restype = ctypes.c_void_p
    return code


def _four(command: object, time: float) -> Array:
    try:
        u = np.array(command, float)
    except (TypeError, ValueError):
        u = np.zeros(0)
    if u.shape != (4,) or not np.isfinite(u).all():
        raise InputError(
            f"the controller returned {command!r:.80} at {time:g} s: expected d_lon d_lat d_col"
            " d_ped, four finite numbers in rad"
        )
    return u


class _InSteps:
    """A flight in machine code that waits for its command at every sample."""

    def __init__(self, code: ctypes.CDLL, arguments: object, i: int, heli: Helicopter):
        self._code, self._arguments = code, ctypes.byref(arguments)  # type: ignore[arg-type]
        self._block = ctypes.c_void_p(
            code.begin_loops(self._arguments, ctypes.c_long(i), ctypes.c_long(i + 1))
        )
        if not self._block:
            raise MemoryError("no memory for the flight")
        self._readings = np.zeros(len(READINGS))
        self._out = ctypes.c_void_p(self._readings.ctypes.data)

    def read(self, k: int) -> Array | None:
        flying = self._code.read_loops(self._arguments, self._block, ctypes.c_long(k), self._out)
        return self._readings if flying else None

    def command(self, k: int, u: Array) -> None:
        self._code.command_loops(
            self._arguments, self._block, ctypes.c_long(k), ctypes.c_void_p(u.ctypes.data)
        )

    def end(self) -> None:
        self._code.end_loops(self._arguments, self._block)


def _courses(arrays: Sequence[Array], longest: int) -> Array:
    """(courses, longest, ...) with the last sample of each repeated."""
    return np.ascontiguousarray(
        np.stack([a[np.minimum(np.arange(longest), len(a) - 1)] for a in arrays]), float
    )


def _strides(array: Array) -> tuple[int, int]:
    """Return the strides of (N, n, m) from flight to flight and sample to sample, 0 along a shared
    axis.
    """
    flights, samples, width = array.shape
    return samples * width if flights > 1 else 0, width if samples > 1 else 0
