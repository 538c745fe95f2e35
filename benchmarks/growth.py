"""How processor time and memory of a proof and of a design grow with states and parameters, beside
the LMI on a grid in cvxpy and point designs by SLICOT.

Models are random: affine in parameters between 0 and 1, rates of 1/s, stable by their numerical
range. Each cell is one call in a process of its own with one thread, after a small one of its kind
that pays for what is imported and compiled. A call that takes longer than the limit is ended and
printed as such; larger ones of its kind are not tried.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import signal
import subprocess
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

from benchmarks.memory import peak  # noqa: E402
from benchmarks.race import table  # noqa: E402
from studies.progress import displayed  # noqa: E402
from symheli import LPVStateSpace, Scheduling  # noqa: E402
from symheli.errors import SymheliError  # noqa: E402
from symheli.progress import tracked  # noqa: E402

STATES, PARAMETERS = (5, 10, 15, 20, 30, 40), (1, 2, 3)
POINTS, RATE, SEED = 5, 1.0, 0
"""Points of a grid in each parameter; largest |dp/dt|, 1/s; of the models."""
LIMIT = 60.0
"""Seconds of the processor for a call."""
SIGNALS = 2
"""Inputs, outputs, disturbances of the states, controls and measurements."""
SMALL = 3
"""States of the call that comes first."""
LONG = 0.2
"""Seconds that a cell takes at least to count for an exponent."""
SHARE, SWING = 0.4, 2.0
"""Of the damping that the parameters move at most, and how much faster than that states turn."""


class Affine(NamedTuple):
    """x' = (A[0] + p1 A[1] + ...) x + B u, y = C x."""

    A: list[np.ndarray]
    B: np.ndarray
    C: np.ndarray

    def at(self, p: np.ndarray) -> np.ndarray:
        """The matrix of the states where the parameters are p."""
        return sum((w * M for w, M in zip(p, self.A[1:], strict=True)), self.A[0])


def affine(states: int, parameters: int) -> Affine:
    """A model whose x'x falls for every p(t): A + A' is below zero on the box."""
    rng = np.random.default_rng(SEED)
    turn = rng.normal(size=(states, states)) * SWING / math.sqrt(states)
    A = [turn - turn.T - np.diag(rng.uniform(0.5, 2.0, states))]
    for _ in range(parameters):
        M = rng.normal(size=(states, states))
        A.append(0.5 * SHARE / parameters * M / np.linalg.norm(M, 2))
    B, C = rng.normal(size=(states, SIGNALS)), rng.normal(size=(SIGNALS, states))
    return Affine(A, B / math.sqrt(states), C / math.sqrt(states))


def lpv(own: Affine, B: np.ndarray, C: np.ndarray, D: np.ndarray, **names: Any) -> LPVStateSpace:
    """The model with these inputs and outputs."""
    parameters = len(own.A) - 1
    none = (0,) * parameters
    powers = [none, *(tuple(row) for row in np.eye(parameters, dtype=int).tolist())]
    ranges = [Scheduling(f"p{i + 1}", "1", 0.0, 1.0, rate=RATE) for i in range(parameters)]
    A = dict(zip(powers, own.A, strict=True))
    return LPVStateSpace.polynomial(A, {none: B}, {none: C}, {none: D}, ranges, **names)


def proof(own: Affine, **options: Any) -> float:
    """The gain that `l2_gain` proves."""
    from synthesis import l2_gain

    none = np.zeros((SIGNALS, SIGNALS))
    return l2_gain(lpv(own, own.B, own.C, none), **options).gamma


def default_proof(own: Affine) -> float:
    """With the default form and search."""
    return proof(own)


def one_form(own: Affine) -> float:
    """With P affine, as on the grid, and no search for bad trajectories."""
    from synthesis.forms import Spline

    return proof(own, form=Spline(degree=1, segments=1), search=None)


def generalized(own: Affine) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """B, C, D from disturbances of the states and of the measurements, and controls, to outputs,
    weighted controls, and measurements.
    """
    rng, k, n = np.random.default_rng(SEED + 1), SIGNALS, len(own.A[0])
    B = np.hstack([own.B, np.zeros((n, k)), rng.normal(size=(n, k)) / math.sqrt(n)])
    C = np.vstack([own.C, np.zeros((k, n)), rng.normal(size=(k, n)) / math.sqrt(n)])
    D = np.zeros((3 * k, 3 * k))
    D[k : 2 * k, 2 * k :], D[2 * k :, k : 2 * k] = np.eye(k), 0.1 * np.eye(k)
    return B, C, D


def design(own: Affine) -> float:
    """The gain that `output_feedback` promises."""
    from synthesis import Plant, output_feedback

    def names(*heads: str) -> list[str]:
        return [f"{head}{i}" for head in heads for i in range(SIGNALS)]

    model = lpv(own, *generalized(own), inputs=names("w", "n", "u"), outputs=names("z", "e", "y"))
    plant = Plant(
        model,
        disturbances=names("w", "n"),
        performance=names("z", "e"),
        controls=names("u"),
        measurements=names("y"),
    )
    return output_feedback(plant).promised


def gridded(solver: str) -> Callable[[Affine], float]:
    """The bounded real lemma on a grid, solved by this solver."""

    def call(own: Affine) -> float:
        from benchmarks.opponents import gridded_box

        return gridded_box.gain(*own, RATE, POINTS, solver)

    return call


def slicot(own: Affine) -> float:
    """The largest gamma of H-infinity designs for the frozen models of the grid."""
    import control

    B, C, D = generalized(own)
    grid = np.meshgrid(*[np.linspace(0, 1, POINTS)] * (len(own.A) - 1))
    found = [
        control.hinfsyn(control.ss(own.at(p), B, C, D), SIGNALS, SIGNALS)[2]
        for p in np.stack(grid, axis=-1).reshape(-1, len(grid))
    ]
    return float(max(found))


def here(package: str) -> bool:
    """Whether this package is installed."""
    import importlib.util

    return importlib.util.find_spec(package) is not None


CALLS: dict[str, tuple[Callable[[Affine], float], str]] = {
    "l2_gain": (default_proof, "synthesis"),
    "l2_gain, P affine, search=None": (one_form, "synthesis"),
    "grid, P affine, Clarabel": (gridded("CLARABEL"), "clarabel"),
    "grid, P affine, SCS": (gridded("SCS"), "scs"),
    "output_feedback": (design, "synthesis"),
    "point designs on the grid, SLICOT": (slicot, "slycot"),
}
"""What is called, and the package that it needs."""


class Cell(NamedTuple):
    """Seconds of the processor, growth of the largest resident memory (MiB), and the gain found."""

    seconds: float
    memory: float
    gain: float


def cell(name: str, states: int, parameters: int, limit: float) -> Cell:
    """One call, in this process, which the system ends at the limit."""
    call, _ = CALLS[name]
    call(affine(SMALL, parameters))
    before, own, begin = peak(), affine(states, parameters), time.process_time()
    spent = math.ceil(begin + limit)
    resource.setrlimit(resource.RLIMIT_CPU, (spent, spent + 5))
    found = call(own)
    return Cell(time.process_time() - begin, peak() - before, found)


def measured(name: str, states: int, parameters: int, limit: float) -> Cell | None:
    """`cell` in a process of its own; None where that was ended at the limit."""
    words = ["--cell", name, str(states), str(parameters), "--limit", str(limit)]
    done = subprocess.run(
        [sys.executable, __file__, *words], capture_output=True, text=True, env=os.environ
    )
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return None
    if done.returncode:
        raise SymheliError(f"{name}, {states} states, {parameters} parameters:\n{done.stderr}")
    found = Cell(*json.loads(done.stdout.splitlines()[-1]))
    return found if found.seconds <= limit else None


def exponent(cells: dict[int, Cell | None]) -> str:
    """Slope of log time against log states, of the cells that take `LONG`."""
    at = [(n, one.seconds) for n, one in cells.items() if one and one.seconds >= LONG]
    if len(at) < 2:
        return ""
    sizes, times = zip(*at, strict=True)
    return f"{np.polyfit(np.log(sizes), np.log(times), 1)[0]:.1f}"


def plot(found: dict[tuple[str, int], dict[int, Cell | None]], path: Path) -> None:
    """A panel for each number of parameters: time against states."""
    from matplotlib.figure import Figure

    counts = sorted({parameters for _, parameters in found})
    figure = Figure(figsize=(4 * len(counts), 4), layout="constrained")
    panels = figure.subplots(1, len(counts), sharey=True, squeeze=False)[0]
    for ax, parameters in zip(panels, counts, strict=True):
        for name in CALLS:
            cells = found.get((name, parameters), {})
            points = [(n, one.seconds) for n, one in cells.items() if one]
            if points:
                ax.loglog(*zip(*points, strict=True), marker="o", label=name)
        ax.set(xlabel="states", title=f"{parameters} parameter{'s' * (parameters > 1)}")
        ax.grid(True, which="both", alpha=0.3)
    panels[0].set_ylabel("processor time, s")
    panels[0].legend(fontsize="x-small")
    figure.savefig(path, dpi=110)


def rows(
    found: dict[tuple[str, int], dict[int, Cell | None]], states: list[int], limit: float
) -> list[tuple[str, ...]]:
    """A row for each call and number of parameters: seconds and MiB by states, exponent, gain."""
    out = []
    for (name, parameters), cells in found.items():
        if not cells:
            out.append((name, str(parameters), *["not installed"] * len(states), "", ""))
            continue
        told, there = [], [one for one in cells.values() if one]
        for n in states:
            one = cells.get(n)
            cut = f"> {limit:g}" if n in cells else ""
            told.append(f"{one.seconds:.2f} ({one.memory:.0f})" if one else cut)
        gain = f"{next(iter(cells.values())).gain:.4g}" if there else ""  # type: ignore[union-attr]
        out.append((name, str(parameters), *told, exponent(cells), gain))
    return out


def main() -> None:
    """Print the table, and draw it where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few and small: under 40 s")
    parser.add_argument("--limit", type=float, default=LIMIT, metavar="S", help="for a call")
    parser.add_argument(
        "--parameters", nargs="+", type=int, choices=PARAMETERS, default=PARAMETERS, help="how many"
    )
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw it (needs matplotlib)")
    parser.add_argument("--json", action="store_true", help="print every cell")
    parser.add_argument("--cell", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.cell:
        name, states, parameters = options.cell
        print(json.dumps(cell(name, int(states), int(parameters), options.limit)))
        return
    sizes = list(STATES[:2] if options.quick else STATES)
    limit = min(options.limit, 3.0) if options.quick else options.limit
    found: dict[tuple[str, int], dict[int, Cell | None]] = {}
    each = [(m, name) for m in options.parameters[: 1 if options.quick else None] for name in CALLS]
    with displayed():
        for m, name in tracked("rows", each):
            cells = found.setdefault((name, m), {})
            for n in sizes if here(CALLS[name][1]) else ():
                cells[n] = measured(name, n, m, limit)
                if cells[n] is None:
                    break
    if options.json:
        print(json.dumps([[*key, cells] for key, cells in found.items()]))
    else:
        head = ("", "parameters", *(f"{n} states" for n in sizes), "exponent", f"gain, {sizes[0]}")
        title = "### Seconds of the processor (and MiB) of one call"
        print(table(title, rows(found, sizes, limit), head))
    if options.plot:
        plot(found, options.plot)


if __name__ == "__main__":
    main()
