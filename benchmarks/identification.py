"""Recursive identification in real time: one update that yields the coefficients against what
others write, its cost, and an LPV analysis.

The race is run twice where the processor has AVX-512: as it is, and with both sides kept to AVX2,
in a process of its own. Times are those of one thread at work: what else the computer does is not
counted.

--plot FILE draws the cost against outputs and regressors.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()  # one core, as in flight

import numpy as np  # noqa: E402

from benchmarks.opponents.covariance_rls import (  # noqa: E402
    CovarianceRLS,
    Padasip,
    TunedCovarianceRLS,
    padasip_is_installed,
)
from benchmarks.timing import arguments, keep, lines, medians  # noqa: E402
from benchmarks.unfused import unfused_peak  # noqa: E402
from identification import LPVARX, KinematicARX, Polynomial, RecursiveLeastSquares  # noqa: E402
from identification.forgetting import Directional  # noqa: E402
from identification.recursive import kernel  # noqa: E402
from identification.recursive.online import Online  # noqa: E402
from symheli.lpv import Product  # noqa: E402

BASIS = Polynomial(2, 0.0, 13.0)
CASES = {
    "TIMO": LPVARX(("a", "b", "c", "d"), ("u", "v"), "p", na=3, nb=3, delay=1, basis=BASIS),
    "MIMO": LPVARX(
        tuple("abcdefghijkl"), ("s", "t", "u", "v"), "p", na=2, nb=2, delay=1, basis=BASIS
    ),
}
GOALS = {
    "TIMO: covariance RLS (NumPy) / ours": 10.0,
    "TIMO: padasip once an output / ours": 60.0,
    "MIMO: covariance RLS (NumPy) / ours": 7.0,
    "MIMO: padasip once an output / ours": 200.0,
}
BODY_GOAL = 1.2
"""An update with known kinematics takes at most so many times that of LPV-ARX with as many
regressors.
"""
LEVEL_GOAL = 1.6
"""Kernel alone: AVX2 takes at most so many times as long as AVX-512."""
KEPT_TO = "SYMHELI_BENCHMARK_LEVEL"
"""Environment variable of the process that races at a lesser level than the processor's."""
WARM, CALLS = 300, 100


def main() -> None:
    options = arguments(__doc__, plot=True, write=True)
    seconds = 0.4 if options.quick else 6.0
    if level := os.environ.get(KEPT_TO):
        keep_to(level)
        print(json.dumps(race(seconds)))
        return
    notes, kernels = [], {}
    if kernel.compiled_kernel("double"):
        kernels = kernel.compiled_kernels("double")
    else:
        notes.append("the kernel is not compiled: this is its NumPy twin")
    if not padasip_is_installed():
        notes.append("padasip is not installed (pip install padasip): its ratios are left out")
    times, ratios = race(seconds)
    goals = [goal(name, ratios[name], wanted) for name, wanted in GOALS.items() if name in ratios]
    if {"avx512", "avx2"} <= set(kernels):
        lesser_times, lesser = raced_at("avx2")
        times |= {f"{name}, AVX2": t for name, t in lesser_times.items()}
        ratios |= {f"{name}, AVX2": ratio for name, ratio in lesser.items()}
        goals += [
            goal(f"{name}, AVX2", lesser[name], wanted)
            for name, wanted in GOALS.items()
            if name in lesser
        ]
    else:
        notes.append("no AVX-512 here, or no kernel for it: the race is run at one level only")
    alone = at_levels(kernels, seconds / 6) if kernels else {}
    ratios |= alone
    goals += [goal(name, alone[name], LEVEL_GOAL, most=True) for name in alone if "AVX2 /" in name]
    bodies, body_lines = rigid_bodies(seconds / 3)
    ratios |= bodies
    goals += [goal(name, bodies[name], BODY_GOAL, most=True) for name in bodies if "/" in name]
    cost = costs(0.01 if options.quick else 0.3)
    ratios |= analysis()
    if options.json:
        print(json.dumps(ratios, indent=1))
    else:
        text = "\n".join([*lines(times, ratios), *body_lines, table(cost), *goals, *notes])
        print(text)
        if options.write:
            keep("identification", text)
    if options.plot:
        draw(cost, options.plot)


def goal(name: str, value: float, wanted: float, most: bool = False) -> str:
    met = value <= wanted if most else value >= wanted
    bound = "at most" if most else "at least"
    return f"goal {name}: {value:.2f}, {bound} {wanted:g}: {'met' if met else 'MISSED'}"


def race(seconds: float) -> tuple[dict[str, float], dict[str, float]]:
    """Times of one update of each side in s, and ratios to ours, of every case."""
    times: dict[str, float] = {}
    ratios: dict[str, float] = {}
    for case, arx in CASES.items():
        measured, extra = updates(case, arx, seconds)
        times |= measured
        own = measured[f"{case}: ours"]
        ratios |= {
            f"{name} / ours": t / own
            for name, t in measured.items()
            if name != f"{case}: ours" and "ours" not in name
        }
        ratios |= {f"{case}: {name}": value for name, value in extra.items()}
    return times, ratios


def keep_to(level: str) -> None:
    """Our kernel uses no instruction above `level`."""
    levels = kernel.processor_levels()
    kept = levels[levels.index(level) :]
    kernel.processor_levels = lambda: kept
    kernel.compiled_kernel.cache_clear()


def raced_at(level: str) -> tuple[dict[str, float], dict[str, float]]:
    """`race` where NumPy, SciPy and ours are kept to AVX2: each chooses when it is loaded, so in a
    process of its own.
    """
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    above = [name for name in found if name.startswith("AVX512") or name == "X86_V4"]
    limits = {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": " ".join(above)}
    quick = ["--quick"] if "--quick" in sys.argv else []
    done = subprocess.run(
        [sys.executable, __file__, *quick],
        env={**os.environ, **limits, KEPT_TO: level},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    times, ratios = json.loads(done.stdout)
    return times, ratios


def at_levels(kernels: dict[str, Any], seconds: float) -> dict[str, float]:
    """An update in a loop in C at each level of vector instructions, in us, interleaved; its
    operations a second, as a share of the peak at that level; and AVX2 against AVX-512.
    """
    told: dict[str, float] = {}
    peaks = {level: unfused_peak(level) for level in kernels}
    for level, peak in peaks.items():
        if peak:
            told[f"GFLOP/s of products and sums, peak at {level}"] = 1e-9 * peak
    for case, arx in CASES.items():
        rng, rls = np.random.default_rng(0), RecursiveLeastSquares(arx)
        rows = np.column_stack(
            [rng.standard_normal((WARM, arx.ny + arx.nu)), rng.uniform(0.0, 13.0, WARM)]
        )
        some, runs = rows[:CALLS], {}
        for level, module in kernels.items():
            online = Online(
                rls.configuration, module.Kernel(*rls.configuration.arguments), rls.init()
            )
            online.run(rows, history=False)
            runs[level] = lambda online=online, some=some: online.run(some, history=False)
        times = medians(runs, seconds, time.thread_time, settled=True)
        count = operations(arx.n_regressors, arx.ny)
        for level, t in times.items():
            told[f"{case}: update in a loop in C, {level}, us"] = 1e6 * t / CALLS
            speed = count / (t / CALLS)
            told[f"{case}: GFLOP/s of it, {level}"] = 1e-9 * speed
            if peak := peaks[level]:
                told[f"{case}: share of the peak at {level}"] = speed / peak
        if {"avx512", "avx2"} <= set(times):
            told[f"{case}: kernel alone, AVX2 / AVX-512"] = times["avx2"] / times["avx512"]
    return told


def updates(case: str, arx: LPVARX, seconds: float) -> tuple[dict[str, float], dict[str, float]]:
    """Median time of one update of each, in s, from a complete regressor unless it says "with
    lags"; and speeds in GFLOP/s.

    Every side is given the rows as arrays of their own: taking them out of a matrix is not part of
    an update.
    """
    from scipy.linalg.blas import dgemv

    rng, n, m = np.random.default_rng(0), arx.n_regressors, arx.ny
    phi, y = rng.standard_normal((WARM, n)), rng.standard_normal((WARM, m))
    u, p = rng.standard_normal((WARM, arx.nu)), rng.uniform(0.0, 13.0, WARM)
    rls = RecursiveLeastSquares(arx)
    online, flying = rls.online(), rls.online()
    slow, single = (
        RecursiveLeastSquares(arx, Directional(0.99)).online(),
        RecursiveLeastSquares(arx, precision="single").online(),
    )
    forgetful = RecursiveLeastSquares(arx, 0.999).online()
    others = {
        "covariance RLS (NumPy)": CovarianceRLS,
        "covariance RLS (BLAS in place)": TunedCovarianceRLS,
    }
    if padasip_is_installed():
        others["padasip once an output"] = Padasip
    built = {name: make(n, m) for name, make in others.items()}
    for k in range(WARM):
        for one in (online, slow, single, forgetful):
            one.absorb(phi[k], y[k])
        flying.update(y[k], u[k], float(p[k]))
        for one in built.values():
            one.update(phi[k], y[k])
    # the race is only worth something where all arrive at the same coefficients: 1e-6 is their
    # prior, 1 / P(0)
    assert all(
        np.allclose(np.array(built[name].theta), online.coefficients, atol=1e-5)
        for name in list(others)[:2]
    )
    rows, matrix = np.column_stack([y, u, p]), np.asfortranarray(rng.standard_normal((n, n)))
    regressors = [(phi[k].copy(), y[k].copy()) for k in range(CALLS)]
    samples = [(y[k].copy(), u[k].copy(), float(p[k])) for k in range(CALLS)]

    def absorb(one):
        def call():
            for phi, y in regressors:
                one.absorb(phi, y)
                one.coefficients  # noqa: B018 what the update is for

        return call

    def update(one):
        def call():
            for phi, y in regressors:
                one.update(phi, y)

        return call

    def fly():
        for y, u, p in samples:
            flying.update(y, u, p)
            flying.coefficients  # noqa: B018

    candidates = {
        "ours": absorb(online),
        "ours, with lags and basis": fly,
        "ours, factor 0.999": absorb(forgetful),
        "ours, directional": absorb(slow),
        "ours, single precision": absorb(single),
        "ours, loop in C": lambda: flying.run(rows[:CALLS], history=False),
        "DGEMV of that size": lambda: [dgemv(1.0, matrix, x) for x in phi[:CALLS]],
        **{name: update(one) for name, one in built.items()},
    }
    measured = {
        name: t / CALLS
        for name, t in medians(candidates, seconds, time.thread_time, settled=True).items()
    }
    speed = {
        "GFLOP/s of an update": operations(n, m) / measured["ours"] / 1e9,
        "GFLOP/s in a loop in C": operations(n, m) / measured["ours, loop in C"] / 1e9,
        "GFLOP/s of DGEMV of that size": 2 * n * n / measured.pop("DGEMV of that size") / 1e9,
    }
    return {f"{case}: {name}": t for name, t in measured.items()}, speed


def operations(n: int, m: int) -> int:
    """Additions and multiplications of one update: rotations, back substitution, predictions and
    coefficients.
    """
    N = n + m
    return 2 * N * (N + 1) + n * (n - 1) + 4 * n * m


def costs(seconds: float) -> dict[tuple[int, int], float]:
    """Time of one update in s, by (outputs, regressors); no lags, so that both can be chosen."""
    found = {}
    for outputs in (1, 2, 4, 8, 12, 16):
        found |= dict.fromkeys((outputs, n) for n in (12, 24, 48, 96, 192))
    rng = np.random.default_rng(0)
    for outputs, n in found:
        names = tuple(f"y{j}" for j in range(outputs))
        arx = LPVARX(
            names, tuple(f"u{i}" for i in range(n // 3)), "p", na=0, nb=1, delay=1, basis=BASIS
        )
        online = RecursiveLeastSquares(arx).online()
        rows = np.column_stack(
            [rng.standard_normal((300, outputs + arx.nu)), rng.uniform(0.0, 13.0, 300)]
        )
        online.run(rows, history=False)
        some = rows[:50]
        spent = medians(
            {"": lambda online=online, some=some: online.run(some, history=False)},
            seconds,
            time.thread_time,
        )
        found[outputs, n] = spent[""] / len(some)
    return found


def rigid_bodies(seconds: float) -> tuple[dict[str, float], list[str]]:
    """Updates of a rigid vehicle with known kinematics beside LPV-ARX with as many regressors, one
    by one and as a whole record; and what a second scheduling parameter costs.
    """
    controls = ("d_lon", "d_lat", "d_col", "d_ped")
    acceleration = Polynomial(1, -3.0, 3.0)
    sizes = {
        "airspeed": ("V", BASIS),
        "airspeed x acceleration": (("V", "a"), Product((BASIS, acceleration), None)),
    }
    ratios, told, rng = {}, [], np.random.default_rng(0)
    for name, (scheduling, basis) in sizes.items():
        kin = KinematicARX(controls, scheduling, na=2, nb=2, basis=basis)
        velocities = tuple(f"{s}_" for s in "uvwpqr")
        arx = LPVARX(
            velocities,
            controls,
            scheduling,
            na=2,
            nb=2,
            delay=1,
            basis=basis,
            scheduling_at="now",
            offset=True,
            offset_rate=True,
        )
        assert kin.n_regressors == arx.n_regressors
        y, u = 0.1 * rng.standard_normal((WARM, 8)), rng.standard_normal((WARM, 4))
        p = np.column_stack([rng.uniform(low, high, WARM) for low, high in basis.ranges])
        runs = {}
        for kind, rls, states in (("body", kin, y), ("arx", arx, y[:, :6].copy())):
            made = RecursiveLeastSquares(rls)
            online = made.online(dt=0.02)
            rows = np.column_stack([states, u, p])
            online.run(rows, history=False)
            some = [(states[k].copy(), u[k].copy(), p[k].copy()) for k in range(CALLS)]
            runs[kind] = lambda online=online, some=some: [online.update(*one) for one in some]
            runs[f"{kind}, record"] = lambda online=online, rows=rows[:CALLS]: online.run(
                rows, history=False
            )
        times = medians(runs, seconds, time.thread_time, settled=True)
        told.append(
            f"rigid body, {name}: {kin.n_regressors} regressors, an update"
            f" {1e6 * times['body'] / CALLS:.2f} us, of a record"
            f" {1e6 * times['body, record'] / CALLS:.2f} us; LPV-ARX"
            f" {1e6 * times['arx'] / CALLS:.2f} and {1e6 * times['arx, record'] / CALLS:.2f} us"
        )
        ratios[f"rigid body by {name}: update / LPV-ARX"] = times["body"] / times["arx"]
        ratios[f"rigid body by {name}: record / LPV-ARX"] = (
            times["body, record"] / times["arx, record"]
        )
    return ratios, told


def table(cost: dict[tuple[int, int], float]) -> str:
    """In microseconds, and the dearest as a share of a 20 ms period."""
    outputs, sizes = (sorted({key[i] for key in cost}) for i in (0, 1))
    lines = ["one update, us       regressors", "outputs " + "".join(f"{n:9d}" for n in sizes)]
    lines += [f"{m:7d} " + "".join(f"{1e6 * cost[m, n]:9.2f}" for n in sizes) for m in outputs]
    (m, n), dearest = max(cost.items(), key=lambda item: item[1])
    lines.append(
        f"{m} outputs with {n} regressors take {100 * dearest / 0.02:.2f} % of a 20 ms period on"
        " this computer"
    )
    return "\n".join(lines)


def analysis() -> dict[str, float]:
    """Time and memory of a gridded rate-bounded analysis with 5 states against identifying 5
    outputs from a minute at 50 Hz.
    """
    script = Path(__file__).with_name("opponents") / "gridded_analysis.py"
    try:
        done = subprocess.run(
            [sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=120
        )
    except (subprocess.SubprocessError, OSError):
        return {}
    told = json.loads(done.stdout)
    arx = LPVARX(tuple("abcde"), ("u", "v"), "p", na=1, nb=1, delay=1, basis=BASIS)
    rls = RecursiveLeastSquares(arx)
    rng = np.random.default_rng(0)
    rows = np.column_stack([rng.standard_normal((3000, 7)), rng.uniform(0.0, 13.0, 3000)])
    seconds = medians({"": lambda: rls.online().run(rows, history=False)}, 0.2, time.thread_time)[
        ""
    ]
    memory = 8 * sum(rls.configuration.sizes)
    return {
        "gridded analysis, seconds": told["seconds"],
        "identification of a minute of flight, seconds": seconds,
        "time of gridded analysis / identification of a minute": told["seconds"] / seconds,
        "gridded analysis, MB": told["bytes"] / 1e6,
        "identification, kB": memory / 1e3,
        "memory of gridded analysis / identification": told["bytes"] / memory,
    }


def draw(cost: dict[tuple[int, int], float], path: Path) -> None:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("matplotlib is not installed: no plot", file=sys.stderr)
        return
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    for m in sorted({key[0] for key in cost}):
        sizes = sorted(n for outputs, n in cost if outputs == m)
        axes.loglog(sizes, [1e6 * cost[m, n] for n in sizes], "o-", label=f"{m} outputs")
    axes.set(
        xlabel="regressors of each output",
        ylabel="one update, us",
        title="Outputs that share a regressor share its factor",
    )
    for ticks, put in (
        (sorted({n for _, n in cost}), axes.set_xticks),
        ([1, 2, 5, 10, 20], axes.set_yticks),
    ):
        put(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.grid(visible=True, alpha=0.3)
    axes.legend()
    figure.savefig(path)


if __name__ == "__main__":
    main()
