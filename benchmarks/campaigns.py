"""Cases of half a second through a campaign (scheduled, sent, stored, each as it is found), beside
a bare loop and concurrent.futures over the same cases, which keep nothing.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import count as from_zero
from pathlib import Path

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()

from benchmarks.race import Ratio, present, readable, table  # noqa: E402
from benchmarks.timing import arguments, medians  # noqa: E402
from studies.campaigns.campaign import Campaign  # noqa: E402
from studies.campaigns.dataset import CampaignDataset  # noqa: E402
from studies.campaigns.run import run  # noqa: E402
from studies.campaigns.runners import Cluster, Here, InProcesses, Runner  # noqa: E402
from studies.campaigns.trial import Trial  # noqa: E402
from symheli.integrate.side_by_side import workers_of  # noqa: E402

LONG = 0.5
"""Of a case, s."""
LIMIT = 1.05
SHORT_CASES, CASES = 4, 12
"""In a run of --quick, and in another, for each worker."""
QUANTITIES = {f"quantity {i}": "1" for i in range(25)}
"""As many as the trial `identification` has."""


def half_a_second(*, number: int = 0, run: int = 0) -> dict[str, float]:
    """Processor time of this thread, whatever else the machine does."""
    end, total = time.thread_time() + LONG, float(number)
    while time.thread_time() < end:
        total += 1e-9
    return dict.fromkeys(QUANTITIES, total)


def waited(*, number: int = 0, run: int = 0) -> dict[str, float]:
    """Nothing but the time: what is added to it is not hidden by other work."""
    time.sleep(LONG)
    return dict.fromkeys(QUANTITIES, float(number))


KINDS = ((waited, "waiting"), (half_a_second, "computing"))


def numbered(call: Callable[..., object], number: int) -> object:
    """What concurrent.futures is handed."""
    return call(number=number)


def through(trial: Trial, on: Runner, folder: Path, cases: int) -> Callable[[], CampaignDataset]:
    """A campaign of new cases into a new dataset at every call."""
    runs = from_zero()

    def campaign() -> CampaignDataset:
        asked = Campaign(trial, grid={"number": range(cases)}, fixed={"run": next(runs)})
        path = folder / f"{trial.name}-{type(on).__name__}-{asked.cases[0].key}.zarr"
        return run(asked, path, on)

    return campaign


def main() -> None:
    options = arguments(__doc__, write=True)
    workers = workers_of(None)
    cases = SHORT_CASES if options.quick else CASES
    ways: dict[str, Runner] = {"dask.distributed": Cluster.local(workers)}
    ways["processes of this project"] = InProcesses(workers)
    times: dict[str, float] = {}
    ratios: list[Ratio] = []
    with (
        tempfile.TemporaryDirectory() as away,
        ProcessPoolExecutor(workers) as pool,
        ways["dask.distributed"],
        ways["processes of this project"],
    ):
        for on in (pool, *ways.values()):  # workers that have started, and imported what they need
            list(map(Future.result, [on.submit(half_a_second) for _ in range(2 * workers)]))
        for call, what in KINDS[: 1 if options.quick else None]:
            trial, every = Trial(call, QUANTITIES), range(cases * workers)
            loop, futures = f"{what}: a loop", f"{what}: concurrent.futures"
            here = f"{what}: a campaign in this process"
            candidates: dict[str, Callable[[], object]] = {
                loop: lambda call=call: [call(number=i) for i in range(cases)],
                here: through(trial, Here(), Path(away), cases),
                futures: lambda call=call, every=every: list(
                    pool.map(numbered, [call] * len(every), every)
                ),
            }
            names = {name: f"{what}: a campaign on {name}" for name in ways}
            candidates |= {
                names[name]: through(trial, on, Path(away), len(every)) for name, on in ways.items()
            }
            found = medians(candidates, 0.0, warm=False)
            ratios.append(Ratio(f"{here}, over a loop", found[here] / found[loop], LIMIT, True))
            ratios += [
                Ratio(f"{name}, over concurrent.futures", found[name] / found[futures], LIMIT, True)
                for name in names.values()
            ]
            times |= found
    rows: Sequence[tuple[str, ...]] = [(name, readable(t)) for name, t in times.items()]
    title = (
        f"### {cases} cases of {LONG:g} s in one process, {cases * workers} in {workers} workers"
    )
    present(
        "campaigns",
        options,
        [table(title, list(rows), ("", "median"))],
        ratios,
        ["workers are there before the clock starts; every run keeps its cases in a new dataset"],
    )


if __name__ == "__main__":
    from benchmarks import campaigns  # under its own name: workers import it

    campaigns.main()
