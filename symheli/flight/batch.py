"""Closed-loop flights by the thousand."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Unpack, overload

import numpy as np

from symheli.codegen import Layout
from symheli.errors import CompilerWarning, FlightLostError, InputError
from symheli.flight.controller import ScheduledController
from symheli.flight.flight_data import FlightData
from symheli.flight.flights import Flights
from symheli.flight.plan import FlightPlan, Options, plan_of
from symheli.flight.schedule import AirspeedSchedule
from symheli.flight.validity import warn_of_flown
from symheli.helicopter import Helicopter
from symheli.integrate.side_by_side import SIDE_BY_SIDE, over_the_cores, workers_of
from symheli.progress import task
from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.summary import summarized

CHUNK = 2 * SIDE_BY_SIDE.lanes
"""Number of flights that a worker process takes at a time."""
MAX_SINGLE_FLIGHTS = 3
"""Largest number of flights that are simulated one by one: this is faster than with empty lanes."""

Schedules = AirspeedSchedule | FlightPlan | Sequence[AirspeedSchedule | FlightPlan]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class FlightBatch(Sequence[FlightRecord]):
    """Records of N flights; flights[i] is one record, flights.column("phi") a signal of all
    flights.

    Parameters
    ----------
    data : tuple of FlightData
        What was flown, in the order of the plans.

    Examples
    --------
    >>> climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> flights = symheli.flight.fly_batch(heli, climb, seeds=range(3), noise_db=30.0)
    >>> len(flights), bool(flights.lost.any()), flights[2].meta["plan"].seed
    (3, False, 2)
    """

    data: tuple[FlightData, ...]

    __repr__ = summarized
    _repr_html_ = as_table

    def __len__(self) -> int:
        return len(self.data)

    @overload
    def __getitem__(self, index: int) -> FlightRecord: ...
    @overload
    def __getitem__(self, index: slice) -> FlightBatch: ...
    def __getitem__(self, index: int | slice) -> FlightRecord | FlightBatch:
        """The record of one flight, of a lost one until it was; raises `FlightLostError` where that
        is less than two samples.
        """
        if isinstance(index, slice):
            return FlightBatch(self.data[index])
        flown = self.data[index]
        record = flown.record()
        if record is None:
            raise FlightLostError(flown.cause())
        return record

    @property
    def plans(self) -> tuple[FlightPlan, ...]:
        """Plans of the flights."""
        return tuple(flown.plan for flown in self.data)

    @property
    def lost(self) -> Array:
        """Which flights (N,) were lost."""
        return np.array([flown.lost >= 0 for flown in self.data])

    @property
    def causes(self) -> dict[int, str]:
        """{i: when and how flight i was lost}."""
        return {i: flown.cause() for i, flown in enumerate(self.data) if flown.lost >= 0}

    def column(self, name: str) -> Array:
        """One signal of every flight (N, kept), NaN after the end of each."""
        out = np.full((len(self), max(len(flown.out) for flown in self.data)), np.nan)
        for row, flown in zip(out, self.data, strict=True):
            row[: flown.kept] = flown.column(name)
        return out


def fly_batch(
    heli: Helicopter,
    schedules: Schedules,
    *,
    seeds: Iterable[int] | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> FlightBatch:
    """Fly every schedule with every seed, vectorised and in parallel over the cores.

    A flight comes out the same to the bit as `fly` alone makes it, whatever its neighbours, the
    number of workers and, where there are fused multiply-adds, the processor. Controllers written
    in Python are called flight by flight, a hundred times slower, with a `CompilerWarning`.
    Ctrl-C ends within a sample and raises `KeyboardInterrupt`; see `fly_campaign` for flights that
    are kept as they are done.

    Parameters
    ----------
    heli : Helicopter
        The model.
    schedules : AirspeedSchedule, FlightPlan or a sequence of them
        What is commanded.
    seeds : iterable of int, optional
        Each schedule is flown with each of these: noise of the sensors from the seed, turbulence
        and excitation from their own seed plus this one (`FlightPlan.seeded`). Default: as planned.
    workers : int, optional
        Threads; default the cores this process may use.
    progress : callable, optional
        Called with the flights done and their number.
    **options
        As `fly` takes them; a plan's own entries give way.

    Returns
    -------
    FlightBatch
        The flights in the order of the schedules, for each in the order of the seeds.

    Raises
    ------
    InputError
        Something does not fit.
    TrimError
        There is no trim to be held to.

    Warns
    -----
    ValidityWarning
        Flights go faster than the equations are known to hold for, gusts included.

    Examples
    --------
    >>> climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> flights = symheli.flight.fly_batch(heli, climb, seeds=[3, 8], noise_db=30.0)
    >>> alone = symheli.fly(heli, climb, seed=8, noise_db=30.0)
    >>> bool((flights[1].values == alone.values).all())
    True
    """
    plans = plans_of(schedules, seeds, options)
    found: dict[int, FlightData] = {}
    with task("flying", len(plans)) as flying:
        for done, flown in fly_in_chunks(heli, plans, workers):
            found.update(zip(done, flown, strict=True))
            flying.to(len(found))
            if progress is not None:
                progress(len(found), len(plans))
    flights = FlightBatch(tuple(found[i] for i in range(len(plans))))
    warn_of_flown(heli, flights.data)
    return flights


def plans_of(
    schedules: Schedules, seeds: Iterable[int] | None, options: Options
) -> list[FlightPlan]:
    """Every schedule or plan with every seed."""
    given = [schedules] if isinstance(schedules, AirspeedSchedule | FlightPlan) else list(schedules)
    plans = [plan_of(one, options) for one in given]
    if seeds is not None:
        if "seed" in options:
            raise InputError("give either seed or seeds")
        numbers = list(seeds)
        plans = [plan.seeded(seed) for plan in plans for seed in numbers]
    if not plans:
        raise InputError("nothing to fly: give at least one schedule and one seed")
    return plans


def fly_in_chunks(
    heli: Helicopter,
    plans: Sequence[FlightPlan],
    workers: int | None,
    chunks: Sequence[Sequence[int]] | None = None,
) -> Iterator[tuple[Sequence[int], list[FlightData]]]:
    """Yield positions of plans that were flown together, with their results, as they are done;
    `chunks` lists those that belong together.
    """
    if not isinstance(heli, Helicopter):
        raise InputError(f"expected a Helicopter, got {heli!r:.80}; try Helicopter.load('xcell60')")
    flights, threads, every = Flights(heli), workers_of(workers), range(len(plans))
    for plan in plans:  # what they share is made before the threads start
        flights.equipment(plan)
    if any(not isinstance(flights.controller(p), ScheduledController) for p in plans):
        threads = 1  # Python answers one flight at a time, and an object may keep its state
        warnings.warn(
            f"a controller written in Python is asked at every sample of {len(plans)} flights, one"
            " flight after the other: a hundred times slower than an Autopilot, a LinearModel or an"
            " LPVStateSpace",
            CompilerWarning,
            stacklevel=3,
        )

    def run(chunk: Sequence[int]) -> list[FlightData]:
        alike: dict[int, list[int]] = {}
        for i in chunk:
            alike.setdefault(id(flights.equipment(plans[i])), []).append(i)
        flown: dict[int, FlightData] = {}
        for group in alike.values():
            layout = SIDE_BY_SIDE if len(group) > MAX_SINGLE_FLIGHTS else Layout()
            flown |= zip(group, flights.fly([plans[i] for i in group], layout), strict=True)
        return [flown[i] for i in chunk]

    cut = chunks or [every[k : k + CHUNK] for k in range(0, len(plans), CHUNK)]
    yield from over_the_cores(run, cut, threads, flights.stop)
