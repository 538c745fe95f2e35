"""A hundred million recursive updates in double and single precision: no NaN, no growth, and when
single precision is full.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

from benchmarks.timing import arguments  # noqa: E402
from identification import LPVARX, Polynomial, RecursiveLeastSquares  # noqa: E402
from identification.forgetting import Directional  # noqa: E402

CHUNK = 100_000
WAYS = {"no forgetting": 1.0, "factor 0.999": 0.999, "directional 0.99": Directional(0.99)}


def flight(noise: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """Rows [y, u, p] of y(k) = (0.8 - 0.3 x) y(k-1) + (0.5 + 0.2 x) u(k-1) + noise, x = p/5 - 1,
    and the four coefficients.
    """
    rng = np.random.default_rng(0)
    p = 5 + 5 * np.sin(0.01 * np.arange(CHUNK))
    x, u, y = p / 5 - 1, rng.standard_normal(CHUNK), np.zeros(CHUNK)
    for k in range(1, CHUNK):
        y[k] = (
            (0.8 - 0.3 * x[k - 1]) * y[k - 1]
            + (0.5 + 0.2 * x[k - 1]) * u[k - 1]
            + noise * rng.standard_normal()
        )
    rows = np.column_stack([y, u, p])
    rows[0] = np.nan  # each repetition starts its lags afresh
    return rows, np.array([-0.8, 0.3 / np.sqrt(3), 0.5, 0.2 / np.sqrt(3)])  # f1 = sqrt(3) x


def main() -> None:
    options = arguments(__doc__)
    total = 2_000_000 if options.quick else 100_000_000
    rows, truth = flight()
    arx = LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=Polynomial(1, 0.0, 10.0))
    found: dict[str, float] = {}
    for precision in ("double", "single"):
        for name, way in WAYS.items():
            online = RecursiveLeastSquares(arx, way, precision=precision).online()
            worst, full, begin = 0.0, 0, time.thread_time()
            for chunk in range(total // CHUNK):
                online.run(rows, history=False)
                if chunk:  # the first determines the coefficients
                    worst = max(worst, float(np.abs(online.coefficients[:, 0] - truth).max()))
                full = full or (online.saturated and online.state.count)
            spent = time.thread_time() - begin
            assert np.isfinite(online.state.memory).all()
            label = f"{precision}, {name}"
            found[f"{label}: largest error after any chunk"] = worst
            found[f"{label}: ns an update"] = 1e9 * spent / total
            found[f"{label}: saturated after updates"] = float(full)
            found[f"{label}: updates"] = float(online.state.count)
            if not options.json:
                said = f"full after {full} updates" if full else "not full"
                print(
                    f"{label:28s} {online.state.count:>11d} updates, {spent:6.1f} s, largest error"
                    f" {worst:.2e}, finite, {said}",
                    flush=True,
                )
    if options.json:
        print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
