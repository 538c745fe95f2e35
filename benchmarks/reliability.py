"""Random plants close to the limit, and every proof of them looked at by another route.

    python benchmarks/reliability.py --plants 10000

Plant k is made from the seed k alone: two or three states in units spread over up to twelve
decades, polynomial in p, continuous or sampled, its worst frozen pole between 1e-2 and 1e-10 of its
own pace from the border, on either side. Stability and gains are asked for, by splines, over a box
and as an LFT; for every sixth plant the search for P is asked past the look at the frozen poles. A
proof is false where, in 40 digits, a frozen pole is on the wrong side or a frozen gain exceeds the
bound, or where an explicit switching p(t) within the limits grows.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from typing import NamedTuple

import mpmath
import numpy as np

from symheli import LPVStateSpace, Scheduling
from symheli.lpv.exponential import expm
from synthesis import Solver, l2_gain, lft_gain, stability
from synthesis.certify.questions.certify import route as searching
from synthesis.certify.questions.problem import pose
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares

ROUTES = (
    "stability by splines",
    "stability over a box",
    "gain by splines",
    "gain over a box",
    "gain as an LFT",
    "past the frozen poles",
)
COARSE = Spline(segments=2, degree=2)
SPLINES = {"form": COARSE}
BOX = {"form": Spline(segments=1, degree=1), "impose": SumOfSquares()}


class Plant(NamedTuple):
    """A model and the p of its worst frozen pole."""

    lpv: LPVStateSpace
    worst: float


def plant(seed: int) -> Plant:
    """Plant number `seed`."""
    rng = np.random.default_rng(seed)
    n, dt = int(rng.integers(2, 4)), None if rng.random() < 0.75 else 0.1
    A = [rng.standard_normal((n, n)) * s for s in (1.0, 0.6, 0.3)]
    grid = np.linspace(0.0, 1.0, 2001)
    poles = np.linalg.eigvals(sum(M * grid[:, None, None] ** i for i, M in enumerate(A)))
    growth = poles.real.max(axis=1)
    k = int(growth.argmax())
    margin = float(rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-10, -2) * np.abs(poles[k]).max())
    A[0] = A[0] - (growth[k] + margin) * np.eye(n)
    if dt is not None:
        A = [np.eye(n) + dt * A[0], *(dt * M for M in A[1:])]
        radius = np.abs(
            np.linalg.eigvals(sum(M * grid[:, None, None] ** i for i, M in enumerate(A)))
        ).max(axis=1)
        k = int(radius.argmax())
        A = [M * (1 - margin) / radius[k] for M in A]
    T = np.diag(10 ** rng.uniform(-6, 6, n))
    back = np.linalg.inv(T)
    B, C = T @ rng.standard_normal((n, 1)), rng.standard_normal((1, n)) @ back
    rate = float(rng.choice([0.0, 0.1, 1.0, math.inf]))
    scheduling = Scheduling("p", "1", 0.0, 1.0, rate)
    return Plant(
        LPVStateSpace.polynomial([T @ M @ back for M in A], [B], [C], [[[0.0]]], scheduling, dt=dt),
        float(grid[k]),
    )


def judge(seed: int) -> tuple[str, bool, str]:
    """(route, whether something was proven, why that is false: empty where it is not) for one
    plant.
    """
    lpv, worst = plant(seed)
    route = ROUTES[seed % len(ROUTES)]
    gamma = math.inf
    if route == "past the frozen poles":
        asked = pose(lpv, None, "stability", COARSE, None, Solver(), None)
        proven = searching(asked).search(math.inf).proof is not None
    else:
        if route.endswith("LFT"):
            cert = lft_gain(lpv.to_lft().reduce(1e-12), search=None)
        else:
            analysis = stability if route.startswith("stability") else l2_gain
            cert = analysis(lpv, **(SPLINES if "splines" in route else BOX), search=None)
        proven, gamma = cert.verified, cert.gamma
    return (
        route,
        proven,
        (
            _refuted(lpv, worst, gamma, math.inf if route.endswith("LFT") else lpv.scheduling.rate)
            if proven
            else ""
        ),
    )


def _refuted(lpv: LPVStateSpace, worst: float, gamma: float, rate: float) -> str:
    if _unstable(lpv, worst):
        return f"a pole at p = {worst}"
    if math.isfinite(gamma) and _gain(lpv, worst) > gamma:
        return f"the frozen gain at p = {worst}"
    if math.isinf(rate) and _switching(lpv) > 1 + 1e-6:
        return "growth by switching"
    return ""


def _unstable(lpv: LPVStateSpace, p: float) -> bool:
    with mpmath.workdps(40):
        poles = mpmath.eig(mpmath.matrix(lpv.matrices(p).A.tolist()), left=False, right=False)
        return any(mpmath.re(pole) >= 0 if lpv.dt is None else abs(pole) >= 1 for pole in poles)


def _gain(lpv: LPVStateSpace, p: float) -> float:
    """Largest |C (s - A)^-1 B| at the frequencies of the poles and at rest."""
    A, B, C, _ = lpv.matrices(p)
    with mpmath.workdps(40):
        M, b, c = (mpmath.matrix(X.tolist()) for X in (A, B, C))
        poles = mpmath.eig(M, left=False, right=False)
        points = (
            [mpmath.mpc(0, mpmath.im(q)) for q in poles]
            if lpv.dt is None
            else [mpmath.expjpi(mpmath.arg(q) / mpmath.pi) for q in poles]
        )
        points.append(mpmath.mpf(0 if lpv.dt is None else 1))
        return float(
            max(abs((c * mpmath.lu_solve(s * mpmath.eye(len(A)) - M, b))[0]) for s in points)
        )


def _switching(lpv: LPVStateSpace) -> float:
    """Largest factor of the state over a cycle of two values of p, each held for one of some
    times.
    """
    ends = _balanced(lpv.matrices(np.array([0.0, 0.5, 1.0])).A)
    pace = float(np.abs(np.linalg.eigvals(ends)).max())
    if lpv.dt is None:
        steps = [[expm(M * t) for t in np.linspace(0.2, 4.0, 8) / pace] for M in ends]
    else:
        steps = [[np.linalg.matrix_power(M, k) for k in (1, 2, 4, 8)] for M in ends]
    return max(
        float(np.abs(np.linalg.eigvals(a @ b)).max())
        for i in range(3)
        for j in range(i)
        for a in steps[i]
        for b in steps[j]
    )


def _balanced(stack: np.ndarray) -> np.ndarray:
    size = np.abs(stack).max(axis=0)
    d = np.ones(len(size))
    for _ in range(50):
        for i in range(len(d)):
            row, column = (
                float(size[i] @ d / d[i] - size[i, i]),
                float(size[:, i] @ (1 / d) * d[i] - size[i, i]),
            )
            d[i] *= math.sqrt(row / column) if row > 0 and column > 0 else 1.0
    return stack * d / d[:, None]


def count(first: int, plants: int) -> tuple[Counter[str], Counter[str], list[str]]:
    """(plants and proofs a route, the false ones in words) of so many plants from number `first`
    on.
    """
    asked, proven, wrong = Counter[str](), Counter[str](), []
    for seed in range(first, first + plants):
        # a frozen gain is infinite at an unstable p, which SciPy's bounded search subtracts from
        # itself
        with np.errstate(invalid="ignore"):
            route, proof, refuted = judge(seed)
        asked[route] += 1
        proven[route] += proof
        wrong += [f"plant {seed}, {route}: {refuted}"] * bool(refuted)
    return asked, proven, wrong


def main() -> None:
    """Count and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--plants", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first plant")
    options = parser.parse_args()
    asked, proven, wrong = count(options.first, options.plants)
    print("| route | plants | proofs |\n|---|---|---|")
    for route in ROUTES:
        print(f"| {route} | {asked[route]} | {proven[route]} |")
    print(f"| together | {asked.total()} | {proven.total()} |\n\nFalse proofs: {len(wrong)}.")
    print("\n".join(wrong))


if __name__ == "__main__":
    main()
