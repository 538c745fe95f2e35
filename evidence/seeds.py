"""Programs that measure the same for many seeds: their arguments, and the results of the seeds in
order, those that are finished kept in a folder.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from studies.campaigns.runners import results, runner
from studies.output import progress
from studies.setup.stored_stages import PACKAGES, Stored, StoredStages, code_digest


def parser_of(about: str | None, seeds: str, quick: int = 2) -> argparse.ArgumentParser:
    """A parser with --seeds (default: `seeds`), --quick (the first `quick` of them), --json,
    --processes and --out; see `seeds_of` and `over_seeds`.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument(
        "--seeds", default=seeds, metavar="A-B", help=f'"A-B" or "A,B,C" (default: {seeds})'
    )
    parser.add_argument(
        "--quick", action="store_const", const=quick, help=f"the first {quick} of the seeds"
    )
    parser.add_argument("--json", action="store_true", help="print what a program would read")
    parser.add_argument("--processes", type=int, metavar="N", help="default: one a core")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder where finished seeds are kept and found"
    )
    return parser


def seeds_of(options: argparse.Namespace) -> list[int]:
    """The seeds of --seeds, "0-20" or "3,5,7", or the first of them."""
    text = options.seeds
    if "-" in text:
        first, last = text.split("-")
        return list(range(int(first), int(last) + 1))[: options.quick]
    return [int(s) for s in text.split(",")][: options.quick]


def over_seeds(options: argparse.Namespace, calls: Sequence[partial[Any]]) -> Iterator[Any]:
    """Yield the result of each call in their order, from the processes of --processes. Where --out
    names a folder, each is stored there when it is due, and what the same code has stored of the
    same call is read instead.
    """
    keys = [_key(call) for call in calls] if options.out else []
    names = [key[:16] for key in keys]
    stages = StoredStages(options.out or Path(), dict(zip(names, keys, strict=True)))
    known = {i: stored for i, name in enumerate(names) if (stored := stages.usable(name))}
    progress(f"{len(calls)} to compute" + f", {len(known)} of them are there" * bool(known))
    begin = time.perf_counter()
    with runner(options.processes) as on:
        computed = results(on, [call for i, call in enumerate(calls) if i not in known])
        for i in range(len(calls)):
            if i not in known:
                known[i] = Stored(result=next(computed), seconds=time.perf_counter() - begin)
                if options.out:
                    stages.save(names[i], known[i])
                progress(f"{i + 1} of {len(calls)}")
            yield known.pop(i).result


def by_name(
    options: argparse.Namespace, of_seed: Callable[..., Any], names: Sequence[str]
) -> dict[str, list[Any]]:
    """The results of of_seed(name, seed, --truth) by name, each for the seeds of --seeds."""
    seeds = seeds_of(options)
    calls = [partial(of_seed, name, seed, options.truth) for name in names for seed in seeds]
    every = iter(list(over_seeds(options, calls)))
    return {name: [next(every) for _ in seeds] for name in names}


def _key(call: partial[Any]) -> str:
    """A digest of the code, these programs too, and of the call."""
    function = f"{call.func.__module__}.{call.func.__qualname__}"
    text = f"{code_digest((*PACKAGES, 'evidence'))}\n{function}\n{call.args!r}\n{call.keywords!r}"
    return hashlib.sha256(text.encode()).hexdigest()
