"""`python -m evidence.tubes`: the largest gusts for which a tube is proven, beside the worst gust
found, of both packaged helicopters.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

import casadi
import numpy as np
from scipy.linalg import expm

from evidence.tables import DOCS, keep, markdown
from symheli import Helicopter
from synthesis import Tube, tube

Array = np.ndarray

VEHICLES = ("xcell60", "xcell_kahn_hudson")
AIRSPEEDS = (0.0, 3.0, 6.0, 8.0, 10.0, 13.0)
GUSTS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.25, 1.5)
"""Amplitudes that are tried, m/s."""
STEP = 0.005
"""Of Runge and Kutta's method, s; the fastest pole of the loops is near -40 1/s."""
HORIZON = 1000
"""Steps of a flight in the worst gusts."""
DIRECTIONS = 60
"""In which the deviation is driven."""


def largest(heli: Helicopter, airspeed: float) -> tuple[float, Tube | None]:
    """The largest amplitude of `GUSTS` for which a tube is proven, by bisection, with the tube."""
    low, high, found = -1, len(GUSTS), None
    while high - low > 1:
        middle = (low + high) // 2
        trial = tube(heli, airspeed, gust=GUSTS[middle])
        low, high, found = (middle, high, trial) if trial.proven else (low, middle, found)
    return (GUSTS[low] if found else 0.0), found


def flown(found: Tube, e: Array, gust: Callable[[int], Array], steps: int) -> float:
    """The largest e'P e of nonlinear flights from deviations e (N, n) in gusts gust(k) (N, 3), m/s.

    Runge and Kutta's method of order 4.
    """
    loop, count = found.deviations, len(e)
    x, u, w = casadi.SX.sym("x", len(loop.x)), casadi.SX.sym("u", 4), casadi.SX.sym("w", 3)
    rhs = casadi.Function("rhs", [x, u, w], [loop.heli.rhs(x, u, w)]).map(count)

    def rate(e: Array, w: Array) -> Array:
        return np.asarray(rhs((loop.x + e).T, (loop.u + e @ loop.gain.T).T, w.T)).T

    most = 0.0
    for k in range(steps):
        w = gust(k)
        a = rate(e, w)
        b = rate(e + STEP / 2 * a, w)
        c = rate(e + STEP / 2 * b, w)
        e = e + STEP / 6 * (a + 2 * b + 2 * c + rate(e + STEP * c, w))
        most = max(most, np.einsum("ki,ij,kj->k", e, found.P, e).max())
    return float(most)


def worst(found: Tube) -> float:
    """The largest sqrt(e'P e) of nonlinear flights from steady flight, each in the gust that drives
    the linear loop furthest in one direction.
    """
    loop = found.deviations
    A, B, E = (np.asarray(m) for m in loop.heli.jacobian(loop.x, loop.u, np.zeros(3)))
    root = np.linalg.cholesky(found.P)
    rng = np.random.default_rng(0)
    drawn = rng.standard_normal((DIRECTIONS - 2 * len(A), len(A)))
    unit = np.vstack([np.eye(len(A)), -np.eye(len(A)), drawn])
    adjoint = (root @ unit.T).T  # direction of e'P e at the end
    back, rows = expm((A + B @ loop.gain).T * STEP), []
    for _ in range(HORIZON):
        rows.append(adjoint @ E)
        adjoint = adjoint @ back.T
    history = np.array(rows[::-1])
    history *= loop.gust / np.maximum(np.linalg.norm(history, axis=-1, keepdims=True), 1e-300)
    return flown(found, np.zeros((len(unit), len(A))), lambda k: history[k], HORIZON) ** 0.5


def table(vehicles: Sequence[str], airspeeds: Sequence[float]) -> str:
    """The table in Markdown, a row for each vehicle and airspeed."""
    rows = []
    for name in vehicles:
        heli = Helicopter.load(name, governor="ideal")
        for airspeed in airspeeds:
            gust, found = largest(heli, airspeed)
            if found is None:
                rows.append([name, f"{airspeed:g}", "none", "", "", ""])
                continue
            widths = [f"{w:.2g}" for w in found.half_widths[:8]]
            rows.append(
                [
                    *(name, f"{airspeed:g}", f"{gust:g}"),
                    *(" ".join(widths[:3]) + "; " + " ".join(widths[3:6]), " ".join(widths[6:])),
                    f"{worst(found):.2f}",
                ]
            )
            print(*rows[-1], flush=True)
    head = [
        "helicopter",
        "airspeed, m/s",
        "gusts, m/s",
        "u v w, m/s; p q r, rad/s",
        "phi theta, rad",
    ]
    return markdown([*head, "worst gust found"], rows)


def main() -> None:
    """Print the table, or keep it in docs/tubes.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the table in docs/tubes.md")
    parser.add_argument("--quick", action="store_true", help="one helicopter at 0 and 8 m/s")
    given = parser.parse_args()
    if given.write and given.quick:
        parser.error("--write keeps the whole table: leave out --quick")
    text = table(VEHICLES[:1], (0.0, 8.0)) if given.quick else table(VEHICLES, AIRSPEEDS)
    if given.write:
        keep(DOCS / "tubes.md", "amplitudes", text)
    else:
        print(text)


if __name__ == "__main__":
    main()
