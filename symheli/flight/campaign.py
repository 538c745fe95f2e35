"""Campaigns: flights stored on disk as they are done, which can be resumed."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from symheli.errors import InputError
from symheli.flight.batch import CHUNK, Progress, Schedules, fly_in_chunks, plans_of
from symheli.flight.flight_data import FlightData, signals_of
from symheli.flight.flight_dataset import FlightDataset
from symheli.flight.plan import FlightPlan, Options
from symheli.flight.plan_text import described
from symheli.flight.validity import warn_of_plans
from symheli.helicopter import Helicopter
from symheli.integrate.side_by_side import as_done, workers_of
from symheli.progress import task
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices


def fly_campaign(
    heli: Helicopter,
    schedules: Schedules,
    path: str | os.PathLike[str],
    *,
    seeds: Iterable[int] | None = None,
    signals: Sequence[str] | None = None,
    workers: int | Executor | None = None,
    progress: Progress | None = None,
    **options: Unpack[Options],
) -> FlightDataset:
    """Run `fly_batch` into one dataset on disk; a repeated call after an interruption flies only
    what is missing.

    Flights are written as they are done, in chunks that are whole or not there; a flight has the
    same bits whether it was flown before the stop or after. Memory: a few chunks.

    Parameters
    ----------
    heli : Helicopter
        The model.
    schedules : AirspeedSchedule, FlightPlan or a sequence of them
        As in `fly_batch`; one sample period for all.
    path : str or path
        Folder of the dataset, by habit named *.zarr; made where it is not there.
    seeds, progress, **options
        As in `fly_batch`; `progress` counts the flights that were there too.
    workers : int or Executor, optional
        Threads of this process, default one a core; or where chunks of flights are flown, such as
        `distributed.Client(...).get_executor(pure=False)`: the flights have the same bits.
    signals : sequence of str, optional
        What to keep of each flight; default all.

    Returns
    -------
    FlightDataset
        With every flight.

    Raises
    ------
    InputError
        Something does not fit, or the folder holds something else: another vehicle, other plans.
    SymheliError
        The disk is full or the folder cannot be written; what is finished stays.

    Warns
    -----
    ValidityWarning
        Faster flights are commanded than the equations are known to hold for.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp()) / "monte-carlo.zarr"
    >>> climb = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> flights = symheli.flight.fly_campaign(
    ...     heli, climb, folder, seeds=range(4), signals=["q", "theta"])
    >>> flights["theta"].shape, [str(s) for s in flights.signals]
    ((4, 307), ['q', 'theta'])
    """
    plans = plans_of(schedules, seeds, options)
    periods = {plan.dt for plan in plans}
    if len(periods) > 1:
        raise InputError(f"one dataset has one sample period, got dt = {sorted(periods)} s")
    warn_of_plans(heli, plans)
    kept = _kept(heli, plans, signals)
    dataset = _dataset(heli, plans, Path(path), kept)
    missing = sum(len(dataset.flights_of(chunk)) for chunk in dataset.missing_chunks)
    done = len(plans) - missing
    if progress is not None:
        progress(done, len(plans))
    if not missing:
        return dataset
    with task("flying", missing) as flying:
        for chunk, flown in _flown(heli, plans, dataset, workers):
            dataset.write(chunk, *flown)
            done += len(dataset.flights_of(chunk))
            flying.to(done - len(plans) + missing)
            if progress is not None:
                progress(done, len(plans))
    return dataset


Rows = tuple[Array, Array, Array]
"""Of a chunk of flights: values (flight, time, signal), duration and lost (flight)."""


def _flown(
    heli: Helicopter,
    plans: Sequence[FlightPlan],
    dataset: FlightDataset,
    workers: int | Executor | None,
) -> Iterator[tuple[int, Rows]]:
    """Every missing chunk of the dataset, as it is flown."""
    chunks = {k: [plans[i] for i in dataset.flights_of(k)] for k in dataset.missing_chunks}
    rows = partial(_rows, kept=dataset.signals, longest=len(dataset.time))
    if isinstance(workers, Executor):
        work = [_Chunk(k, heli, tuple(some)) for k, some in chunks.items()]
        ahead = 2 * workers_of(None)
        with closing(as_done(workers, partial(_elsewhere, rows), work, ahead)) as answers:
            for chunk, future in answers:
                yield chunk.number, future.result()
        return
    missing = [plan for some in chunks.values() for plan in some]
    ends = list(accumulate(map(len, chunks.values()), initial=0))
    number = dict(zip(ends, chunks, strict=False))
    places = [range(first, end) for first, end in pairwise(ends)]
    for done, flown in fly_in_chunks(heli, missing, workers, places):
        yield number[done[0]], rows(flown)


class _Chunk(NamedTuple):
    number: int
    heli: Helicopter
    plans: tuple[FlightPlan, ...]


def _elsewhere(rows: Callable[[list[FlightData]], Rows], chunk: _Chunk) -> Rows:
    every = range(len(chunk.plans))
    ((_, flown),) = fly_in_chunks(chunk.heli, chunk.plans, 1, [every])
    return rows(flown)


def _rows(flown: Sequence[FlightData], kept: Sequence[Signal], longest: int) -> Rows:
    return (
        np.stack([_values(data, kept, longest) for data in flown]),
        np.array([(data.kept - 1) * data.plan.dt for data in flown]),
        np.array([data.lost >= 0 for data in flown]),
    )


def _kept(
    heli: Helicopter, plans: Sequence[FlightPlan], wanted: Sequence[str] | None
) -> tuple[Signal, ...]:
    """Return the signals of the dataset: those of any plan, or the requested ones of them."""
    every = tuple(dict.fromkeys(s for plan in plans for s in signals_of(heli, plan)))
    return every if wanted is None else tuple(every[i] for i in indices(wanted, every, "signal"))


def _dataset(
    heli: Helicopter, plans: Sequence[FlightPlan], path: Path, kept: tuple[Signal, ...]
) -> FlightDataset:
    """The one in the folder where it is of these flights, else a new one."""
    texts = _texts(plans)
    about = {
        "vehicle": heli.vehicle.title,
        "governor": heli.governor,
        "parameters": {str(n): heli.parameters[n] for n in heli.parameters},
    }
    whole = json.dumps([about, texts, [str(s) for s in kept]], sort_keys=True)
    fingerprint = hashlib.sha256(whole.encode()).hexdigest()
    if (path / ".zattrs").is_file():
        found = FlightDataset(path)
        if found.attributes.get("fingerprint") != fingerprint:
            raise InputError(
                f"{path} holds flights of another vehicle, other plans, seeds or signals; give"
                " another folder, or remove it"
            )
        return found
    if (
        path.exists()
        and not (path / ".zgroup").is_file()
        and (path.is_file() or any(path.iterdir()))
    ):
        raise InputError(f"{path} exists and does not hold flights; give another folder")
    longest = max(int(np.floor(p.schedule.duration / p.dt + 1e-9)) for p in plans)
    return FlightDataset.create(
        path,
        flights=len(plans),
        chunk=CHUNK,
        time=plans[0].dt * np.arange(longest),
        signals=kept,
        seeds=[plan.seed for plan in plans],
        attributes={**about, "plans": _without_seeds(texts), "fingerprint": fingerprint},
    )


def _texts(plans: Sequence[FlightPlan]) -> list[dict[str, Any]]:
    """Every plan as JSON; a controller, which may be large, by its content once."""
    controllers: dict[int, str] = {}
    out = []
    for plan in plans:
        if (key := id(plan.controller)) not in controllers:
            text = json.dumps(described(plan.controller), sort_keys=True)
            kind = type(plan.controller).__name__
            controllers[key] = f"{kind} {hashlib.sha256(text.encode()).hexdigest()[:16]}"
        out.append(described(replace(plan, controller=None)) | {"controller": controllers[key]})
    return out


def _without_seeds(texts: Sequence[Any]) -> list[Any]:
    """Return the plans that differ in more than seeds."""

    def bare(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: bare(v) for k, v in value.items() if k != "seed"}
        return [bare(v) for v in value] if isinstance(value, list) else value

    return [json.loads(t) for t in dict.fromkeys(json.dumps(bare(text)) for text in texts)]


def _values(data: FlightData, kept: Sequence[Signal], longest: int) -> Array:
    columns, out = data.columns(), np.full((longest, len(kept)), np.nan)
    for i, name in enumerate(kept):
        if name in columns:
            out[: data.kept, i] = columns[name]
    return out
