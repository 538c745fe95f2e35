"""Flights beside what this processor can do: operations counted from the generated code, peak and
latencies measured in the same run.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

import symheli
from benchmarks.peak import Processor, flop
from benchmarks.race import Ratio, table
from benchmarks.waiting import Waiting
from symheli.codegen import evaluate
from symheli.integrate.equations import equations

STAGES, NX = 4, 15
STEP = Counter(fma=6 * NX + 2, add=NX + 1, mul=6, sqrt=1, div=1)
"""Operations of one classical Runge-Kutta step besides its right-hand sides (rk4.c)."""
QUATERNION = ("mul", "fma", "add", "sqrt", "div", "mul")
"""Operations, one after the other, by which it is brought back to unit length."""


@dataclass(frozen=True)
class Flown:
    """A way to fly, measured: Runge-Kutta steps of all its flights together, s, threads."""

    name: str
    steps: int
    seconds: float
    threads: int


@dataclass(frozen=True)
class Work:
    """Of one Runge-Kutta step: operations of a flight alone, which computes only the sides that are
    taken, and of one among many, which computes all; and the least time of a flight alone (s), for
    no operation begins before its arguments are there.
    """

    alone: Counter[str]
    among_many: Counter[str]
    least: float


def work(
    heli: symheli.Helicopter,
    states: np.ndarray,
    inputs: np.ndarray,
    steps: int,
    wait: dict[str, float],
) -> Work:
    """On a flight in still air: states (n, nx), inputs (n, 4), `steps` steps a sample, and the
    latencies of this processor.
    """
    held, rest = equations(heli).hoisted("rates")
    given = inputs.T, np.zeros((3, 1)), heli.parameters.array[:, None]
    kept = np.array([np.broadcast_to(v, len(states)) for v in evaluate(held, *given)[0]])
    point = Waiting(rest, states.T, kept)
    sample = Waiting(held, *given).count()
    return Work(
        _step(point.count(), sample, steps),
        _step(rest.count(), held.count(), steps),
        float(_least(point, wait).mean()),
    )


def _step(rates: Counter[str], sample: Counter[str], steps: int) -> Counter[str]:
    names = {*STEP, *rates, *sample}
    return Counter({n: STEP[n] + STAGES * rates[n] + sample[n] / steps for n in names})  # type: ignore[misc]


def _least(point: Waiting, wait: dict[str, float]) -> np.ndarray:
    """Time (N,) from step to step, s, once they follow one another; each state goes on as soon as
    it is there.
    """
    x, ends = [np.zeros(point.points)] * NX, []
    for _ in range(4):
        k = point.ready(wait, {0: x})
        for _ in range(1, STAGES):
            k = point.ready(
                wait, {0: [np.maximum(a, b) + wait["fma"] for a, b in zip(x, k, strict=True)]}
            )
        x = [np.maximum(a, b + wait["add"]) + wait["fma"] for a, b in zip(x, k, strict=True)]
        x[6:10] = [np.max(x[6:10], axis=0) + sum(wait[name] for name in QUATERNION)] * 4
        ends.append(np.max(x, axis=0))
    return ends[-1] - ends[-2]


def limits(
    alone: Flown, batch: Flown, work: Work, processors: dict[int, Processor]
) -> tuple[str, list[Ratio]]:
    """A table of a flight alone and a batch beside their limits, and the shares, for orientation.

    `processors`: this processor by the number of threads.
    """
    chain = work.least * alone.steps / alone.seconds
    busy = processors[batch.threads].divider(
        {name: n * batch.steps for name, n in work.among_many.items()}, batch.seconds
    )
    rows, ratios = [], [Ratio(f"{alone.name}: share of its time that operations wait", chain)]
    for flown, count, other in (
        (alone, work.alone, f"longest chain of operations: {chain:.0%} of its time"),
        (batch, work.among_many, f"roots and quotients alone: {busy:.0%} of its time"),
    ):
        rate, processor = flop(count) * flown.steps / flown.seconds, processors[flown.threads]
        share = rate / processor.peak
        peak = f"{1e-9 * processor.peak:.0f} on {flown.threads} thread{'s' * (flown.threads > 1)}"
        rows.append(
            (
                flown.name,
                f"{flop(count) / STAGES:.0f}",
                f"{1e-9 * rate:.1f}",
                peak,
                f"{share:.1%}",
                other,
            )
        )
        ratios.append(Ratio(f"{flown.name}: share of this processor's peak", share))
    head = (
        "",
        "FLOP a right-hand side",
        "GFLOP/s",
        "peak, GFLOP/s",
        "share",
        "what else bounds it",
    )
    return table("### What this processor could do", rows, head), ratios


def described(count: Counter[str]) -> str:
    """Operations of one right-hand side in words."""
    kinds = {
        "fused multiply-adds": ("fma", "fms", "fnma"),
        "products": ("mul",),
        "sums": ("add", "sub"),
        "quotients": ("div",),
        "roots": ("sqrt",),
    }
    named = [f"{sum(count[n] for n in names):.0f} {kind}" for kind, names in kinds.items()]
    rest = sum(count.values()) - sum(count[n] for names in kinds.values() for n in names)
    return f"{', '.join(named)}, {rest:.0f} comparisons, selections and signs"
