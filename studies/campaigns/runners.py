"""Runners of the cases of a campaign: a cluster of dask.distributed, processes of this machine, or
this process.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing
from typing import TYPE_CHECKING, Any

from studies.output import progress
from studies.processes import Processes
from symheli.errors import InputError
from symheli.extras import extra
from symheli.integrate.side_by_side import as_done, workers_of
from symheli.worker import ProcessEndedError

if TYPE_CHECKING:
    import distributed

SCHEDULER_TIMEOUT = 10.0
"""Longest time to wait for a scheduler, s."""

CALLS_PER_THREAD = 3
"""Number of calls handed to the cluster for each of its threads, so that no thread waits for this
process.
"""


class Runner(Executor):
    """Takes calls as any executor does; `window` of them are handed to it at a time."""

    window: int = 1
    tries: int = 1
    """How often a call is handed out whose process ends under it."""

    def lost(self, error: BaseException) -> bool:
        """Whether the process that computed the call has ended, which is a fault of the call."""
        return False


class Here(Runner):
    """Runner in this process, one case after the other."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class InProcesses(Processes, Runner):
    """Runner in `count` processes of this machine (default: one a core)."""

    tries = 3

    def __init__(self, count: int | None = None):
        super().__init__(count)
        self.window = 2 * workers_of(count)

    def lost(self, error: BaseException) -> bool:
        """Whether the process has ended; what a trial raises is an outcome."""
        return isinstance(error, ProcessEndedError)


class Cluster(Runner):
    """Runner on dask.distributed: processes of this machine (`local`), or an existing scheduler
    (`at`). A call whose worker is lost is given to another.
    """

    def __init__(self, connect: Callable[[], distributed.Client], window: int):
        self._connect, self.window = connect, window
        self._client: distributed.Client | None = None

    @classmethod
    def local(cls, count: int) -> Cluster:
        """`count` workers of one thread on the loopback interface, without dashboard: they start
        with the first call, and end with this process, however it ends.
        """
        with extra("campaigns", "a campaign on a cluster"):
            import distributed

        def connect() -> distributed.Client:
            own = distributed.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                memory_limit=0,  # type: ignore[arg-type]
                silence_logs=logging.CRITICAL,
            )
            return distributed.Client(own, set_as_default=False)

        return cls(connect, CALLS_PER_THREAD * count)

    @classmethod
    def at(cls, address: str) -> Cluster:
        """The workers of the scheduler at `address`, which have this project installed.

        Raises `InputError` where none answers.
        """
        with extra("campaigns", "a campaign on a cluster"):
            import distributed
        try:
            client = distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(
                f"no scheduler of dask.distributed answers at {address!r} ({error}); start one with"
                " `dask scheduler`, or leave --scheduler out for the cores of this machine"
            ) from error
        threads: Any = client.ncores()
        there = cls(lambda: client, CALLS_PER_THREAD * max(sum(threads.values()), 1))
        there._client = client
        return there

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A result to come."""
        self._client = self._client or self._connect()
        return self._client.get_executor(pure=False).submit(fn, *args, **kwargs)

    def lost(self, error: BaseException) -> bool:
        """The scheduler gives a call to another worker, and says when it has seen enough end."""
        return type(error).__name__ == "KilledWorker"

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the scheduler; a cluster of its own ends."""
        if self._client is not None:
            own = self._client.cluster
            self._client.close()
            if own is not None:
                own.close()


def runner(workers: int | None = None, scheduler: str | None = None) -> Runner:
    """Return the available runner: the scheduler at that address, else a cluster of this machine,
    else processes of it, with a message; with one worker this process.

    Raises `InputError` where no scheduler answers, or dask.distributed is not there to ask it.
    """
    if scheduler is not None:
        return Cluster.at(scheduler)
    count = workers_of(workers)
    if count == 1:
        return Here()
    try:
        return Cluster.local(count)
    except InputError as error:
        progress(f"{error}; going on in {count} processes of this machine")
        return InProcesses(count)


def answers(
    on: Runner, calls: Sequence[Callable[[], Any]]
) -> Generator[tuple[int, Future[Any]], None, None]:
    """The number of each call with its finished future, as they are done."""
    with closing(as_done(on, _called, list(enumerate(calls)), on.window)) as found:
        for (i, _), future in found:
            yield i, future


def results(on: Runner, calls: Sequence[Callable[[], Any]]) -> Iterator[Any]:
    """Yield the results of the calls in their order, as soon as they are done; the first exception
    ends it.
    """
    found: dict[int, Any] = {}
    due = 0
    with closing(answers(on, calls)) as done:
        for i, future in done:
            found[i] = future.result()
            while due in found:
                yield found.pop(due)
                due += 1


def _called(numbered: tuple[int, Callable[[], Any]]) -> Any:
    return numbered[1]()
