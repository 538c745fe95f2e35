"""Every public entry with one argument changed at a time and every reader with damaged files: how
often what came back, and what failed.

    python benchmarks/fuzz.py --write

The inputs are the same ones every time, others with each --seed. --write keeps a table a package in
docs/checks.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # not benchmarks/, whose files are named after the rooms they measure

from evidence.tables import DOCS, keep, markdown  # noqa: E402
from studies.threads import one_thread  # noqa: E402

one_thread()
sys.path.append(str(ROOT / "tests" / "reliability"))

import damaged_files  # noqa: E402
import entries  # noqa: E402
import fuzzed  # noqa: E402
import good_files  # noqa: E402
from valid_calls import PACKAGES, ValidCall, caught  # noqa: E402

OUTCOMES = ("refused", "refused by Python", "result", "another exception", "too long", "crash")


def rows(package: str, quick: bool, seed: int | None) -> dict[str, fuzzed.Tally]:
    """{entry: tally} of a package, or of the readers."""
    if package == "readers":
        with tempfile.TemporaryDirectory() as folder:
            return {
                reader.entry: damaged_files.tally(
                    reader,
                    16 if quick else damaged_files.USUAL,
                    first=damaged_files.USUAL * (seed or 0),
                )
                for reader in good_files.readers(Path(folder))
            }
    calls: dict[str, list[ValidCall]] = {}
    for call in caught(lambda name: name.startswith(package + ".")):
        if entries.asked(call.entry) and not (quick and call.entry in entries.SLOW):
            calls.setdefault(call.entry, []).append(call)
    return {
        entry: fuzzed.tally(of, 2 if quick else entries.inputs(entry), seed)
        for entry, of in sorted(calls.items())
    }


def table(found: dict[str, fuzzed.Tally]) -> str:
    """Markdown: an entry a row, and all together."""
    head = ("entry", "inputs", *OUTCOMES, "faults")
    rows: list[list[str]] = []
    total: Counter[str] = Counter()
    faults = 0
    for entry, tally in found.items():
        total += tally.outcomes
        faults += len(tally.faults)
        rows.append(_row(f"`{entry}`", tally.outcomes, len(tally.faults)))
    return markdown(head, [*rows, _row("**together**", total, faults)])


def _row(name: str, outcomes: Counter[str], faults: int) -> list[str]:
    counts = [outcomes.total(), *(outcomes[word] for word in OUTCOMES), faults]
    return [name, *(str(n) if n else "" for n in counts)]


def main() -> None:
    """Count and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a few of each, under 40 s")
    parser.add_argument("--json", action="store_true", help="print the counts by entry")
    parser.add_argument("--write", action="store_true", help="keep them in docs/checks.md")
    parser.add_argument(
        "--only", choices=(*PACKAGES, "readers"), action="append", help="default: all"
    )
    parser.add_argument("--seed", type=int, help="other inputs than the usual ones; no --write")
    options = parser.parse_args()
    if options.write and options.seed is not None:
        parser.error("--write keeps the usual inputs: leave out --seed")
    warnings.simplefilter("ignore")
    found: dict[str, fuzzed.Tally] = {}
    home = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # what is saved by a changed path stays here
        for package in options.only or (*PACKAGES, "readers"):
            one = rows(package, options.quick, options.seed)
            if options.write:
                keep(DOCS / "checks.md", f"fuzzing {package}", table(one))
            found |= one
        os.chdir(home)
    faults = [str(fault) for tally in found.values() for fault in tally.faults]
    if options.json:
        counts = {entry: dict(tally.outcomes) for entry, tally in found.items()}
        print(json.dumps({"counts": counts, "faults": faults}, indent=1))
    else:
        print(table(found), *faults, sep="\n")


if __name__ == "__main__":
    main()
