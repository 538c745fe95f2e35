"""`python -m evidence.sets`: nonlinear flights of helicopters whose commanded airspeed jumps, with
and without the reference governor of a proven set.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np

import symheli
from evidence.tables import DOCS, keep, markdown, parsed
from symheli import Helicopter
from synthesis.sets import InvariantSet, ReferenceGovernor, invariant_set, reference_governor

Array = np.ndarray

VEHICLES = ("xcell60", "xcell_kahn_hudson")
AIRSPEEDS = (3.0, 13.0)
"""m/s."""
GUST = 0.25
"""Largest gust along each body axis, m/s."""
STATE_BOUNDS = {
    **{"u": 2.0, "v": 2.0, "w": 2.0, "p": 0.8, "q": 0.8, "r": 0.8, "phi": 0.25, "theta": 0.25},
    **{"a1": 0.1, "b1": 0.1},
}
"""Largest deviations from steady flight: m/s, rad/s, rad."""
INPUT_BOUNDS = {"d_lon": 0.1, "d_lat": 0.1, "d_col": 0.1, "d_ped": 0.2}
"""Of the controls, rad."""
FLIGHTS, SECONDS = 500, 10.0
SAMPLE, STEP = 0.02, 0.01
"""Of the governor, and of Runge and Kutta's method, s."""
LOST = 1e3
"""Size at which a state of a flight that diverges is held, SI."""


def proven_set(heli: Helicopter) -> InvariantSet:
    """The set at every held airspeed, of the models along it."""
    inputs = (*INPUT_BOUNDS, "u_w", "v_w", "w_w")
    speeds = np.linspace(*AIRSPEEDS, 11).tolist()
    model = symheli.sweep(heli, speeds, inputs=inputs).interpolate("polynomial", 4, rate=0.0)
    return invariant_set(
        model,
        state_bounds=STATE_BOUNDS,
        input_bounds=INPUT_BOUNDS,
        disturbance=dict.fromkeys(inputs[4:], GUST),
        degree=2,
    )


@dataclass(frozen=True)
class Flown:
    """Of each flight: the largest sqrt(V) reached, the largest part of a limit of state or control
    used, and when the airspeed command was reached, s (infinite: never).
    """

    size: Array
    used: Array
    arrived: Array


def flown(
    heli: Helicopter, found: InvariantSet, start: Array, wanted: Array, governed: bool
) -> Flown:
    """Nonlinear flights (N,) from steady flight at one commanded airspeed to another, in gusts
    that change at random.
    """
    by, trim, count = reference_governor(found), found.statement.model.trim, len(start)
    assert trim is not None
    rate = _closed(heli).map(count)
    rng = np.random.default_rng(1)
    hold = rng.integers(1, 100, count)
    bounds = np.array([*STATE_BOUNDS.values()]), np.array([*INPUT_BOUNDS.values()])
    at, v, gust = trim.state(start), start.copy(), np.zeros((count, 3))
    size, used, arrived = np.zeros(count), np.zeros(count), np.full(count, np.inf)
    for k in range(round(SECONDS / SAMPLE)):
        v = by.next(at, wanted, v) if governed else wanted
        arrived = np.where((v == wanted) & np.isinf(arrived), k * SAMPLE, arrived)
        new = GUST * rng.choice([-1.0, 1.0], (count, 3))
        gust = np.where((k % hold == 0)[:, None], new, gust)
        K, x_r = gains(found, v), trim.state(v)
        u_r = trim.input(v)[:, : len(INPUT_BOUNDS)]
        given = (x_r.T, u_r.T, np.concatenate([*np.swapaxes(K, 1, 2)], axis=1), gust.T)
        for _ in range(round(SAMPLE / STEP)):
            a = _rates(rate, at, given)
            b = _rates(rate, at + STEP / 2 * a, given)
            c = _rates(rate, at + STEP / 2 * b, given)
            d = _rates(rate, at + STEP * c, given)
            at = at + STEP / 6 * (a + 2 * b + 2 * c + d)
        at = np.nan_to_num(np.clip(at, -LOST, LOST), nan=LOST)
        size = np.maximum(size, np.sqrt(by.level(at, v)))
        e = at - x_r
        u = np.einsum("kij,kj->ki", K, e)
        parts = [np.abs(own / bound).max(axis=1) for own, bound in zip((e, u), bounds, strict=True)]
        used = np.maximum.reduce([used, *parts])
    return Flown(size, used, arrived)


def _closed(heli: Helicopter) -> casadi.Function:
    """dx/dt of x, the steady state and controls, K and the gust."""
    x, x_r = casadi.SX.sym("x", 10), casadi.SX.sym("x_r", 10)
    u_r, K, w = casadi.SX.sym("u_r", 4), casadi.SX.sym("K", 10, 4), casadi.SX.sym("w", 3)
    rates = heli.rhs(x, u_r + K.T @ (x - x_r), w)
    return casadi.Function("closed", [x, x_r, u_r, K, w], [rates])


def _rates(rate: casadi.Function, at: Array, given: tuple[Array, ...]) -> Array:
    return np.asarray(rate(at.T, *given)).T


def gains(found: InvariantSet, v: Array) -> Array:
    """K (N, nu, n) at airspeeds (N,)."""
    at = found.shape.matrices(v)
    return np.swapaxes(np.linalg.solve(at.A, np.swapaxes(at.C, -1, -2)), -1, -2)


def commands(by: ReferenceGovernor, count: int) -> tuple[Array, Array]:
    """Steps of the commanded airspeed (N,) from and to, each of which leaves the set at once."""
    rng = np.random.default_rng(0)
    start, wanted = rng.uniform(*AIRSPEEDS, (2, 40 * count))
    leaves = by.level(by.steady(start), wanted) > 1
    return start[leaves][:count], wanted[leaves][:count]


def row(name: str, found: InvariantSet, flights: int) -> list[str]:
    """The row of one helicopter."""
    heli, by = Helicopter.load(name, governor="ideal"), reference_governor(found)
    steps = commands(by, flights)
    with_it, without = (flown(heli, found, *steps, governed=g) for g in (True, False))
    return [
        name,
        f"{len(steps[0])}",
        *(f"{np.sum(one.size > 1)}, {np.sum(one.used > 1)}" for one in (with_it, without)),
        *(f"{one.size.max():.3f}" for one in (with_it, without)),
        f"{np.median(with_it.arrived):.1f}, {with_it.arrived.max():.1f}",
    ]


def table(vehicles: Sequence[str], flights: int) -> str:
    """The flights of each helicopter, in Markdown."""
    rows = []
    for name in vehicles:
        found = proven_set(Helicopter.load(name, governor="ideal"))
        rows.append(row(name, found, flights) if found.verified else [name, found.why, *[""] * 5])
        print(*rows[-1], flush=True)
    both = "left the set, a limit"
    head = ["helicopter", "flights", f"governed: {both}", f"without: {both}"]
    head += ["governed: largest sqrt(V)", "without", "governed: arrival, s: median, last"]
    return markdown(head, rows)


def main() -> None:
    """Print the table, or keep it in docs/sets.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="20 flights of one helicopter")
    given = parsed(parser, "sets.md", timed=False)
    text = table(VEHICLES[:1], 20) if given.quick else table(VEHICLES, FLIGHTS)
    if given.write:
        keep(DOCS / "sets.md", "jumps", text)
    else:
        print(text)


if __name__ == "__main__":
    main()
