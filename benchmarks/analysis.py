"""The proven gain of the lateral loop: against the same LMI on a grid in cvxpy, against D-scaled
LFTs; growth, memory, shares.

Opponent: benchmarks/opponents/gridded_lmi.py. Each proof is timed whole, frozen gain and
verification included, without the search for a lower bound, which the opponent has no counterpart
of.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import symheli  # noqa: E402
from benchmarks.memory import alone, peak  # noqa: E402
from benchmarks.opponents import gridded_lmi  # noqa: E402
from benchmarks.timing import arguments, keep  # noqa: E402
from studies.loops.lateral import HOLD, OUTPUTS, lateral_loop  # noqa: E402
from studies.setup.axes import LATERAL  # noqa: E402
from symheli import LFT, LPVStateSpace, Scheduling  # noqa: E402
from symheli.flight import XCELL_SERVOS  # noqa: E402
from symheli.lpv.tools import pade_delay  # noqa: E402
from synthesis import Certificate, l2_gain, lft_gain  # noqa: E402
from synthesis.forms import Spline  # noqa: E402

RATE = 1.0
"""Acceleration, m/s^2."""
PROOF = Spline(segments=8)
"""Cubic spline on 8 segments: 25 matrices."""
DELAY = 0.02
"""Before the servo, s."""
NARROW = (5.5, 7.5)
"""m/s; over the whole range the D-scaled LFT is infeasible."""


class Goal(NamedTuple):
    """A ratio that should not exceed `most`."""

    name: str
    value: float
    most: float


def behind_servo(heli: symheli.Helicopter, delay: int) -> LPVStateSpace:
    """The lateral loop with the servo of d_lat (3 states) and Pade's delay of order `delay` before
    it: 8 + `delay` states.

    Cubic element-wise, as the loop of five states is; parts that do not depend on the airspeed stay
    as they are.
    """
    airspeeds = np.linspace(0.0, 13.0, 27)
    family = symheli.sweep(heli, airspeeds, inputs=("d_lat", "v_w")).select(
        LATERAL.states, ("d_lat", "v_w")
    )  # type: ignore[arg-type]
    models = []
    for k in range(len(family)):
        model = family[k].driven_by({"d_lat": XCELL_SERVOS["d_lat"].linear("d_lat")})
        if delay:
            model = model.driven_by({"d_lat": pade_delay("d_lat", DELAY, delay)})
        models.append(
            model.feedback({("d_lat", "phi"): HOLD}).select(inputs=("v_w",), outputs=OUTPUTS)
        )
    powers = (
        np.linalg.lstsq(
            np.vander(airspeeds / 13.0, 4, increasing=True),
            np.stack(
                [
                    np.concatenate([m.A.ravel(), m.B.ravel(), m.C.ravel(), m.D.ravel()])
                    for m in models
                ]
            ),
            rcond=None,
        )[0]
        / 13.0 ** np.arange(4)[:, None]
    )
    first = models[0]
    cuts = np.cumsum([first.A.size, first.B.size, first.C.size])
    A, B, C, D = (
        list(part.reshape(4, *like.shape))
        for part, like in zip(
            np.split(powers, cuts, axis=1), (first.A, first.B, first.C, first.D), strict=True
        )
    )
    return LPVStateSpace.polynomial(A, B, C, D, Scheduling("airspeed", "m/s", 0.0, 13.0, RATE))


def springs(parameters: int) -> LFT:
    """Masses of 1 kg in a row, as many as `parameters`, damped; each spring between 1 and 2 N/m, as
    it likes.
    """
    m = parameters
    none = (0,) * m
    A: dict[tuple[int, ...], np.ndarray] = {none: np.zeros((2 * m, 2 * m))}
    A[none][:m, m:], A[none][m:, m:] = np.eye(m), -2.0 * np.eye(m)
    for i in range(m):
        stretch = np.eye(m)[i] - (np.eye(m)[i - 1] if i else 0.0)
        A[tuple(int(i == k) for k in range(m))] = np.block(
            [[np.zeros((m, 2 * m))], [-np.outer(stretch, stretch), np.zeros((m, m))]]
        )
    B, C = np.zeros((2 * m, 1)), np.zeros((1, 2 * m))
    B[-1], C[0, m - 1] = 1.0, 1.0
    ranges = [Scheduling(f"k{i + 1}", "N/m", 1.0, 2.0, math.inf) for i in range(m)]
    return LFT.polynomial(A, {none: B}, {none: C}, {none: np.zeros((1, 1))}, ranges).reduce()


def proof(loop: LPVStateSpace, form: Spline = PROOF) -> Certificate:
    return l2_gain(loop, RATE, form=form, search=None)


def gridded(loop: LPVStateSpace, degree: int) -> tuple[float, float]:
    """What a user of cvxpy computes, in the units of the model."""

    def matrices(p: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        m = loop.matrices(p)
        return m.A, m.B, m.C, m.D

    return gridded_lmi.gain(matrices, loop.scheduling.low, loop.scheduling.high, RATE, degree)


def d_scaled(loop: LPVStateSpace) -> Certificate:
    return lft_gain(loop.to_lft().reduce(1e-12), "D", search=None)


def alternating(
    candidates: dict[str, Callable[[], Any]], runs: int
) -> tuple[dict[str, float], dict[str, Any]]:
    """Median times, s, of `runs` calls each, taking turns, and the last results; calls of a minute
    cannot be warmed up first.
    """
    spent: dict[str, list[float]] = {name: [] for name in candidates}
    results = {}
    for _ in range(runs):
        for name, call in candidates.items():
            begin = time.perf_counter()
            results[name] = call()
            spent[name].append(time.perf_counter() - begin)
    return {name: statistics.median(times) for name, times in spent.items()}, results


def _memory(call: Callable[..., Any], *args: Any) -> float:
    """Growth of the largest resident size over one call, MiB, with both contestants' libraries
    loaded before.
    """
    import clarabel  # noqa: F401
    import cvxpy  # noqa: F401

    before = peak()
    call(*args)
    return peak() - before


def memory(call: Callable[..., Any], *args: Any) -> float:
    """`_memory` in a process of its own."""
    return alone(_memory, call, *args)


def exponent(sizes: list[int], times: list[float]) -> float:
    """Slope of log time against log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def growth(loops: dict[int, LPVStateSpace], quick: bool) -> dict[str, list[tuple[int, float]]]:
    """Times, s, against states, degree of P, and parameters of an LFT."""
    few = Spline(segments=4, degree=2)

    def timed(call: Callable[[], object]) -> float:
        begin = time.perf_counter()
        call()
        return time.perf_counter() - begin

    degrees, masses = ((1, 2, 3), (1, 2)) if quick else ((1, 2, 3, 4), (1, 2, 3, 4))
    lfts = {m: springs(m) for m in masses}
    return {
        "states (P: 4 segments of degree 2)": [
            (n, timed(lambda loop=loop: proof(loop, few))) for n, loop in loops.items()
        ],
        "degree of P (5 states, 4 segments)": [
            (d, timed(lambda d=d: proof(loops[5], Spline(segments=4, degree=d)))) for d in degrees
        ],
        "parameters, LFT test D/G (twice as many states)": [
            (m, timed(lambda lft=lft: lft_gain(lft, "DG", search=None))) for m, lft in lfts.items()
        ],
        "parameters, LFT test full block": [
            (m, timed(lambda lft=lft: lft_gain(lft, "full block", search=None)))
            for m, lft in lfts.items()
        ],
    }


def plot(curves: dict[str, list[tuple[int, float]]], path: Path) -> Path | None:
    """The growth of time as a figure, where matplotlib is installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return None
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    ax = figure.add_subplot()
    for name, points in curves.items():
        ax.loglog(*zip(*points, strict=True), marker="o", label=name)
    ax.set(xlabel="number", ylabel="time of one proof, s")
    ax.grid(True, which="both", alpha=0.3)
    ax.legend(fontsize="small")
    figure.savefig(path, dpi=110)
    return path


def main() -> None:
    options = arguments(__doc__, write=True)
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    loops = {5: lateral_loop(heli)}
    loops |= {8 + d: behind_servo(heli, d) for d in ((2,) if options.quick else (0, 2, 4))}
    s = loops[5].scheduling
    narrow = loops[5].with_scheduling(Scheduling(s.name, s.unit, *NARROW, RATE))
    lines: list[str] = []
    goals: list[Goal] = []
    ratios: dict[str, float] = {}

    def compare(states: int, degree: int, runs: int) -> None:
        loop, name = loops[states], f"grid of 51, degree {degree}"
        times, results = alternating(
            {"proof": lambda: proof(loop), name: lambda: gridded(loop, degree)}, runs
        )
        certificate, (gain, solving) = results["proof"], results[name]
        seconds = certificate.seconds
        lines.append(
            f"{states} states, proof: gain {certificate.gamma:.4f}, {times['proof']:.2f} s,"
            f" {certificate.status.name}"
        )
        lines.append(
            f"{states} states, {name}: gain {gain:.4f} (not proven), {times[name]:.2f} s,"
            f" {solving:.2f} s of it in the solver"
        )
        goals.append(
            Goal(f"{states} states: time of the proof / {name}", times["proof"] / times[name], 1.0)
        )
        goals.append(
            Goal(
                f"{states} states: proven gain / gain of the {name}", certificate.gamma / gain, 1.01
            )
        )
        goals.append(
            Goal(
                f"{states} states: building / solving, beside the {name}",
                seconds.build / seconds.solve,
                1.0,
            )
        )
        ratios[f"{states} states: time of the proof / solver of the {name}"] = (
            times["proof"] / solving
        )

    compare(5, 3, 1 if options.quick else 3)
    if not options.quick:
        compare(5, 12, 1)
        compare(10, 3, 1)

    times, results = alternating(
        {"proof": lambda: proof(narrow), "D": lambda: d_scaled(narrow)}, 1 if options.quick else 3
    )
    lines.append(
        f"{NARROW[0]:g} to {NARROW[1]:g} m/s: proof {results['proof'].gamma:.3f} in"
        f" {times['proof']:.2f} s, D-scaled LFT {results['D'].gamma:.3f} in {times['D']:.2f} s"
    )
    lines.append(f"0 to 13 m/s: D-scaled LFT {d_scaled(loops[5]).status.name}")
    ratios["narrow range: gain of the D-scaled LFT / proven gain"] = (
        results["D"].gamma / results["proof"].gamma
    )
    ratios["narrow range: time of the proof / D-scaled LFT"] = times["proof"] / times["D"]

    if not options.quick:
        ours, theirs = memory(proof, loops[5]), memory(gridded, loops[5], 3)
        lines.append(
            f"peak memory, 5 states: proof {ours:.0f} MiB, grid of 51 with degree 3"
            f" {theirs:.0f} MiB"
        )
        if theirs > 0:
            ratios["peak memory of the proof / grid of 51, degree 3"] = ours / theirs

    curves = growth(loops, options.quick)
    for name, points in curves.items():
        power = exponent([n for n, _ in points], [t for _, t in points])
        lines.append(
            f"time against {name}: "
            + ", ".join(f"{n}: {t:.2f} s" for n, t in points)
            + f"; exponent {power:.1f}"
        )
        ratios[f"exponent of time against {name}"] = power
    if options.json:
        print(json.dumps({g.name: g.value for g in goals} | ratios, indent=1))
        return
    lines += [
        f"{g.name:60s}{g.value:10.3f} x, at most {g.most:g}:"
        f" {'met' if g.value <= g.most else 'MISSED'}"
        for g in goals
    ]
    lines += [f"{name:60s}{value:10.3f}" for name, value in ratios.items()]
    print("\n".join(lines))
    if options.write:
        keep("analysis", "\n".join(lines))
    if not options.quick:
        plot(curves, ROOT / "docs" / "analysis-growth.png")


if __name__ == "__main__":
    main()
