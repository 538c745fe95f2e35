"""How long `symheli study` takes until the page stands and until it ends, on this checkout and on
an earlier one: the full study, a quick look, and a quick look at other vehicles.

Each run begins with an empty folder and an empty cache, and is one process with those that it
starts: seconds on the wall, seconds of the processor, and the largest resident memory of all of
them together, where a page that several share counts for each. `--against REF` builds that commit
in a worktree of its own and measures it in turns with this one. `--schedule` draws when each call
of one quick study was computed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

from benchmarks.gantt import drawn  # noqa: E402
from benchmarks.race import table  # noqa: E402
from studies.progress import displayed  # noqa: E402
from studies.transition.configuration import Configuration  # noqa: E402
from studies.transition.schedule import Span  # noqa: E402
from studies.transition.study import run_study  # noqa: E402
from symheli.errors import SymheliError  # noqa: E402
from symheli.progress import tracked  # noqa: E402

BEFORE = "3fea9f6d"
"""The commit that is measured beside this one."""
VEHICLES = ("xcell_kahn_hudson", "yamaha_r50")
"""Of the package; vehicle files may be given in their place."""
TRIMS = 'id="figure-trim"'
"""A page with this shows the trims."""
EVERY = 0.1
"""Seconds between two looks at the page and the memory."""


class Run(NamedTuple):
    """Seconds on the wall and of the processor, MiB, and when report.html and its trims were there
    (s; None where they never were).
    """

    wall: float
    processor: float
    memory: float
    page: float | None
    trims: float | None


def measured(root: Path, options: Sequence[str], until_trims: bool = False) -> Run:
    """One run of `symheli study` of the checkout at `root`; `until_trims` ends it there."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "study"
        environment = {
            **os.environ,
            "PYTHONPATH": str(root),
            "SYMHELI_CACHE": str(Path(folder) / "cache"),
        }
        words = [sys.executable, "-m", "studies.cli", "study", "--out", str(out), *options]
        begin = time.perf_counter()
        with tempfile.TemporaryFile("w+") as said:
            child = subprocess.Popen(
                words, cwd=folder, env=environment, stdout=said, stderr=subprocess.STDOUT
            )
            memory, found = 0.0, dict.fromkeys(("page", "trims"))
            while (ended := os.wait4(child.pid, os.WNOHANG))[0] == 0:
                memory = max(memory, resident(child.pid))
                found = {
                    name: at or there
                    for (name, at), there in zip(
                        found.items(), looked(out / "report.html", begin), strict=True
                    )
                }
                if until_trims and found["trims"]:
                    child.send_signal(signal.SIGINT)
                    until_trims = False
                time.sleep(EVERY)
            _, status, usage = ended
            child.returncode = os.waitstatus_to_exitcode(status)
            if child.returncode not in (0, 130):
                said.seek(0)
                raise SymheliError(f"{' '.join(words)} failed:\n{said.read()[-2000:]}")
        wall, processor = time.perf_counter() - begin, usage.ru_utime + usage.ru_stime
        at_end = looked(out / "report.html", begin)
        page, trims = (at or there for at, there in zip(found.values(), at_end, strict=True))
        return Run(wall, processor, memory, page, trims)


def looked(page: Path, begin: float) -> tuple[float | None, float | None]:
    """Seconds since `begin` if the page is there, and if it shows the trims."""
    try:
        text = page.read_text(encoding="utf-8")
    except OSError:
        return None, None
    now = time.perf_counter() - begin
    return now, now if TRIMS in text else None


def resident(pid: int) -> float:
    """Resident memory of a process and of all below it, MiB; 0 where the system does not say."""
    parents: dict[int, list[int]] = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            own, _, rest = status.read_text().rpartition(")")
            parents.setdefault(int(rest.split()[1]), []).append(int(own.split()[0]))
    total, wanted = 0.0, [pid]
    while wanted:
        one = wanted.pop()
        wanted += parents.get(one, [])
        with contextlib.suppress(OSError):
            size = re.search(r"VmRSS:\s*(\d+)", Path(f"/proc/{one}/status").read_text())
            total += int(size[1]) / 1024 if size else 0.0
    return total


@contextlib.contextmanager
def checkout(ref: str) -> Iterator[Path]:
    """A worktree of this repository at `ref` with its compiled parts, removed at the end."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        try:
            subprocess.run(
                [*git, "add", "--detach", str(tree), ref],
                check=True,
                capture_output=True,
                text=True,
            )
        except subprocess.CalledProcessError as error:
            raise SymheliError(f"--against {ref}: {error.stderr.strip()}") from error
        try:
            build = [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"]
            built = subprocess.run(build, cwd=tree, capture_output=True, text=True)
            if built.returncode:
                last = built.stderr.strip().splitlines()[-1:]
                print(f"{ref} is measured without its compiled estimator: {last}", file=sys.stderr)
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True, capture_output=True)


def works(asked: Sequence[str], vehicles: Sequence[str]) -> dict[str, list[str]]:
    """The options of each run by its name, of those asked for."""
    every = {"study": [], "study --quick": ["--quick"]}
    every |= {f"study --quick, {Path(v).stem}": ["--quick", "--vehicle", v] for v in vehicles}
    return {name: words for name, words in every.items() if not asked or name in asked}


def row(name: str, of: str, runs: Sequence[Run]) -> tuple[str, ...]:
    """Medians of the runs of one work of one checkout."""
    each = [[value for value in column if value is not None] for column in zip(*runs, strict=True)]
    middle = [f"{statistics.median(values):.1f}" if values else "never" for values in each]
    wall, processor, memory, page, trims = middle
    return name, of, page, trims, wall, processor, f"{float(memory):.0f}"


def schedule(vehicle: str) -> str:
    """The drawn schedule of a quick study of a vehicle, computed here."""
    spans: list[Span] = []
    with tempfile.TemporaryDirectory() as folder, displayed():
        begin = time.time()
        asked = {"vehicle": vehicle, "quick": True, "out": Path(folder)}
        run_study(Configuration.of(asked), watch=spans.append)
        return drawn(spans, begin, time.time())


def main() -> None:
    """Print the table, or the schedule."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="of each (default: 3)")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="rows by name")
    parser.add_argument(
        "--vehicles", nargs="*", default=VEHICLES, metavar="FILE", help="of quick looks"
    )
    parser.add_argument(
        "--against", default=BEFORE, metavar="REF", help=f"(default: {BEFORE}; none: this alone)"
    )
    parser.add_argument("--schedule", metavar="VEHICLE", help="draw one quick study instead")
    parser.add_argument(
        "--quick", action="store_true", help="until the trims, once, this checkout: under 40 s"
    )
    parser.add_argument("--json", action="store_true", help="print every run")
    options = parser.parse_args()
    if options.schedule:
        print(schedule(options.schedule))
        return
    asked = ["study --quick"] if options.quick else options.only
    chosen = works(asked, options.vehicles)
    if not chosen or options.runs < 1:
        parser.error(f"no run: --only takes {', '.join(works([], options.vehicles))}; --runs 1 up")
    with contextlib.ExitStack() as stack:
        trees = {"this": ROOT}
        if options.against != "none" and not options.quick:
            trees[options.against] = stack.enter_context(checkout(options.against))
        found: dict[tuple[str, str], list[Run]] = {}
        turns = range(1 if options.quick else options.runs)
        each = [(name, of) for _ in turns for name in chosen for of in trees]
        for name, of in tracked("runs", each):
            run = measured(trees[of], chosen[name], options.quick)
            found.setdefault((name, of), []).append(run)
    if options.json:
        print(json.dumps([[*key, [r._asdict() for r in runs]] for key, runs in found.items()]))
        return
    head = ("", "checkout", "page, s", "trims, s", "wall, s", "processor, s", "memory, MiB")
    title = f"### Studies, medians of {len(turns)}" + ", stopped at the trims" * options.quick
    print(table(title, [row(*key, runs) for key, runs in found.items()], head))


if __name__ == "__main__":
    main()
