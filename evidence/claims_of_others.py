"""Claims of papers, books and toolboxes as files of a plant and a claim, and the answers to them.

    python -m evidence.claims_of_others            the answers
    python -m evidence.claims_of_others --write    the files in examples/claims, the table of
                                                   docs/howto/claims.md

Where a source has no P, one is found here by the inequalities of the source: the claim is about the
number, and a P of another solver differs in its last digits only.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from evidence.tables import DOCS, keep, markdown
from symheli.values.arrays import Array
from synthesis.claims import check, read_claim, read_plant

PAGE, SECTION = DOCS / "howto" / "claims.md", "claims of others"
FOLDER = DOCS.parent / "examples" / "claims"
DIGITS = 7
"""Decimals to which a P of a solver is rounded."""

Document = dict[str, Any]


class Published(NamedTuple):
    """A claim: where it stands, what is claimed in words, and the plant and claim as documents."""

    source: str
    words: str
    made: Callable[[], tuple[Document, Document]]


def common_p(A: Sequence[Array], sampled: bool) -> Array:
    """Return P with A'P + PA < 0 (sampled A'PA < P) of all A, as far from singular as can be."""
    import cvxpy as cp

    n = len(A[0])
    P, margin = cp.Variable((n, n), symmetric=True), cp.Variable()
    falls = [M.T @ P @ M - P if sampled else M.T @ P + P @ M for M in A]
    limits = [np.eye(n) << P, P << 1e3 * np.eye(n)]
    program = cp.Problem(cp.Maximize(margin), [*limits, *(F << -margin * np.eye(n) for F in falls)])
    program.solve(solver="CLARABEL")
    found = np.asarray(P.value, float)
    return np.round((found + found.T) / 2, DIGITS)


def ball(rho: float) -> tuple[Document, Document]:
    """x' = (U - 1) dU/dx, U = (x'A1'A1x)(x'A2'A2x), A1 = [1 2; 3 4], A2 = A1 diag(-1, 1)."""
    a, b = "((x + 2*y)^2 + (3*x + 4*y)^2)", "((-x + 2*y)^2 + (-3*x + 4*y)^2)"
    ax, ay = "(2*(x + 2*y) + 6*(3*x + 4*y))", "(4*(x + 2*y) + 8*(3*x + 4*y))"
    bx, by = "(-2*(-x + 2*y) - 6*(-3*x + 4*y))", "(4*(-x + 2*y) + 8*(-3*x + 4*y))"
    f = [f"({a}*{b} - 1)*({p}*{b} + {a}*{q})" for p, q in ((ax, bx), (ay, by))]
    claim = {"claim": "region of attraction", "V": "x^2 + y^2", "rho": rho}
    return {"states": ["x", "y"], "f": f}, claim


def cubic(rho: float) -> tuple[Document, Document]:
    """x' = -x + x^3."""
    claim = {"claim": "region of attraction", "V": "x^2", "rho": rho}
    return {"states": ["x"], "f": ["-x + x^3"]}, claim


def book(feedback: Callable[[float], list[float]], decay: float) -> tuple[Document, Document]:
    """A = [0 1; -r^2 2 r], B = [0; 1] at r = 1 and 10, u = F(r) x."""
    A = [[[0, 1], [-(r**2), 2 * r]] for r in (1.0, 10.0)]
    K = [[feedback(r)] for r in (1.0, 10.0)]
    loops = [np.array(M) + np.array([[0], [1]]) @ F for M, F in zip(A, K, strict=True)]
    P = common_p([M + decay * np.eye(2) for M in loops], False)
    plant = {"A": A, "B": [[0], [1]], "axis": "first"}
    kind = {"claim": "decay rate", "alpha": decay} if decay else {"claim": "stability"}
    return plant, {**kind, "P": P.tolist(), "K": K, "axis": "first"}


def oscillator(size: float) -> tuple[Document, Document]:
    """x' = [-.21 -1; 1 0] x + [.8; 0] delta [0 1] x."""
    A = [[[-0.21, -1 + 0.8 * d], [1, 0]] for d in (-size, size)]
    P = common_p([np.array(M) for M in A], False)
    return {"A": A, "axis": "first"}, {"claim": "stability", "P": P.tolist()}


def sampled(matrices: Sequence[Any], scale: float, P: Any = None) -> tuple[Document, Document]:
    """The matrices over `scale`, switched in any way."""
    A = [np.array(M) / scale for M in matrices]
    P = common_p(A, True) if P is None else np.array(P)
    plant = {"A": [M.tolist() for M in A], "dt": 1.0, "axis": "first"}
    return plant, {"claim": "stability", "P": P.tolist(), "axis": "first"}


GOLDEN = [[1, 1], [0, 1]], [[1, 0], [1, 1]]
ANDO = [[1, 0], [1, 0]], [[0, 1], [0, -1]]
FOUR = (
    [[0, 1, 7, 4], [1, 6, -2, -3], [-1, -1, -2, -6], [3, 0, 9, 1]],
    [[-3, 3, 0, -2], [-2, 1, 4, 9], [4, -3, 1, 1], [1, -5, -1, -2]],
    [[1, 4, 5, 10], [0, 5, 1, -4], [0, -1, 4, 6], [-1, 5, 0, 1]],
)


def positioning(robust: bool) -> tuple[Document, Document]:
    """A = [1 .1; 0 1 - .1 a], a from .1 to 10, B = [0; .0787]: K and P of the regulator at a = 1,
    or of one inequality for both ends.
    """
    A = [np.array([[1, 0.1], [0, 1 - 0.1 * a]]) for a in (0.1, 1.0, 10.0)]
    B = np.array([[0.0], [0.0787]])
    if robust:
        K, P = _robust_feedback([A[0], A[2]], B)
    else:
        P = solve_discrete_are(A[1], B, np.diag([1.0, 0.0]), [[2e-5]])
        K = -np.linalg.solve(2e-5 + B.T @ P @ B, B.T @ P @ A[1])
        P = (P + P.T) / 2
    plant = {"A": [A[0].tolist(), A[2].tolist()], "B": B.tolist(), "dt": 0.1, "axis": "first"}
    return plant, {"claim": "stability", "P": P.tolist(), "K": K.tolist()}


def _robust_feedback(A: Sequence[Array], B: Array) -> tuple[Array, Array]:
    """Return K and P by [Q (AQ + BY)'; . Q] > 0 of all A, K = Y Q^-1, P = Q^-1."""
    import cvxpy as cp

    n, m = B.shape
    Q, Y, margin = cp.Variable((n, n), symmetric=True), cp.Variable((m, n)), cp.Variable()
    forms = [cp.bmat([[Q, (M @ Q + B @ Y).T], [M @ Q + B @ Y, Q]]) for M in A]
    limits: list[Any] = [np.eye(n) >> Q, *(F >> margin * np.eye(2 * n) for F in forms)]
    cp.Problem(cp.Maximize(margin), limits).solve(solver="CLARABEL")
    P = np.linalg.inv(np.asarray(Q.value, float))
    return np.round(np.asarray(Y.value, float) @ P, 3), np.round((P + P.T) / 2, 6)


def terminal(more: float, level: float) -> tuple[Document, Document]:
    """A = [1 1; 0 1], B = [.5; 1], |x| <= 5, |u| <= 1, Q = I, R = 1: the regulator and its cost."""
    A, B, Q, R = np.array([[1.0, 1], [0, 1]]), np.array([[0.5], [1.0]]), np.eye(2), np.eye(1)
    P = solve_discrete_are(A, B, Q, R)
    K = -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    plant = {"A": A.tolist(), "B": B.tolist(), "x_max": [5, 5], "u_max": [1]}
    P = (P + P.T) / 2 * more
    claim = {"P": P.tolist(), "K": K.tolist(), "Q": Q.tolist(), "R": R.tolist(), "level": level}
    return plant, {"claim": "terminal set", **claim}


def scheduled(gamma: float, points: int = 41) -> tuple[Document, Document]:
    """The gain-scheduled PI of LPVTools' `lpvnorm`, |dp/dt| <= .1; P over 1, p, p^2, 1/p, sqrt p by
    the inequality at six points, as there.
    """
    p = np.linspace(2, 7, points)
    A, B, C, D = _scheduled_loop(p)
    matrices = _on_functions(np.linspace(2, 7, 6))
    P = np.round(np.einsum("ip,ijk->pjk", _functions(p)[0], matrices), DIGITS)
    P = (P + np.swapaxes(P, 1, 2)) / 2
    plant = {"p": p, "A": A, "B": B, "C": C, "D": D, "rate": 0.1}
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in plant.items()}
    return {**plain, "axis": "first"}, {
        "claim": "l2 gain", "gamma": gamma, "P": P.tolist(), "axis": "first",
    }  # fmt: skip


def _scheduled_loop(p: Array) -> tuple[Array, ...]:
    """Return A, B, C, D at p: x_G, the delay of .5 s in two states, the integrator."""
    tau, k = np.sqrt(133.6 - 16.8 * p), np.sqrt(4.8 * p - 8.6)
    gain, integral, y, one = (0.35 * tau - 1) / k, 0.0625 * tau / k, 1.1 * k, np.ones_like(p)
    zero = 0 * p
    rows = [
        [(-1 - gain * y) / tau, zero, -24 / tau / 7, one / tau],
        [zero, zero, 48 * one / 7, zero],
        [-7 * gain * y, -7 * one, -12 * one, 7 * one],
        [-integral * y, zero, zero, zero],
    ]
    A = np.moveaxis(np.array(rows), 2, 0)
    B = np.stack([gain / tau, zero, 7 * gain, integral], -1)[..., None]
    C = np.stack([-y, zero, zero, zero], -1)[:, None, :]
    return A, B, C, np.ones((len(p), 1, 1))


def _functions(p: Array) -> tuple[Array, Array]:
    """Return combinations of 1, p, p^2, 1/p, sqrt p, orthonormal on [2, 7], and their slopes."""
    powers, grid = (0, 1, 2, -1, 0.5), np.linspace(2, 7, 200)
    R = np.linalg.qr(np.stack([grid**e for e in powers], -1))[1] / np.sqrt(len(grid))
    change = np.linalg.inv(R).T
    slopes = np.stack([e * p ** (e - 1.0) for e in powers])
    return change @ np.stack([p**e for e in powers]), change @ slopes


def _on_functions(points: Array) -> Array:
    """Return the matrices of P with the least gain for which the inequality holds at points."""
    import cvxpy as cp

    P, g = [cp.Variable((4, 4), symmetric=True) for _ in range(5)], cp.Variable()
    limits, (f, df) = [], _functions(points)
    for k, (A, B, C, D) in enumerate(zip(*_scheduled_loop(points), strict=True)):
        here = sum(v * M for v, M in zip(f[:, k], P, strict=True))
        slope = sum(v * M for v, M in zip(df[:, k], P, strict=True))
        limits.append(here >> 0)
        for rate in (-0.1, 0.1):
            top, side = A.T @ here + here @ A + rate * slope + C.T @ C, here @ B + C.T @ D
            limits.append(cp.bmat([[top, side], [side.T, D.T @ D - g * np.eye(1)]]) << 0)
    cp.Problem(cp.Minimize(g), limits).solve(solver="CLARABEL")
    return np.array([M.value for M in P])


SENAME = "Sename's book on LPV control"
SWITCH = "examples of SwitchOnSafety.jl"
PUBLISHED = {
    "drake": Published(
        "Drake, issue 12876", "CSDP: {x'x <= .067} is a region of attraction",
        lambda: ball(0.067),
    ),
    "drake-below": Published(
        "the same, below the truth 1/20", "{x'x <= .0499} is one", lambda: ball(0.0499)
    ),
    "cubic": Published("x' = -x + x^3", "{x^2 <= 1} is one", lambda: cubic(1.0)),
    "cubic-below": Published("the same", "{x^2 <= .999} is one", lambda: cubic(0.999)),
    "lpvnorm": Published(
        "LPVTools, `lpvnorm`", "gain 1.2968, by P(p) at six points", lambda: scheduled(1.2968)
    ),
    "sename-3.3": Published(
        f"{SENAME}, 3.3", "stable by a constant P, rho at its ends",
        lambda: book(lambda r: [0, -4 * r], 0.0),
    ),
    "sename-3.2": Published(
        f"{SENAME}, 3.2", "decay rate .9 by a constant P, rho at its ends",
        lambda: book(lambda r: [r**2 - 1, -2 - 2 * r], 0.9),
    ),
    "iqc-tvscalar": Published(
        "IQC toolbox, iqc_tvscalar", "stable for delta in [-.26, .26], any rate",
        lambda: oscillator(0.26),
    ),
    "iqc-beyond": Published(
        "the same, beyond", "stable for delta in [-.27, .27], constant P", lambda: oscillator(0.27)
    ),
    "golden": Published(
        f"golden pair, {SWITCH}", "stable when divided by 1.6181",
        lambda: sampled(GOLDEN, 1.6181, np.eye(2)),
    ),
    "golden-below": Published(
        "the same", "stable when divided by 1.618", lambda: sampled(GOLDEN, 1.618, np.eye(2))
    ),
    "ando-shih": Published(
        "Ando and Shih (1998)", "stable times .708 > 1/sqrt 2, by P = I",
        lambda: sampled(ANDO, 1 / 0.708, np.eye(2)),
    ),
    "ando-shih-each": Published(
        "the same", "stable times .99, by a P of each mode",
        lambda: sampled(ANDO, 1 / 0.99, [np.diag([1, 0.01]), np.diag([0.01, 1])]),
    ),
    "four-states": Published(
        f"three matrices, {SWITCH}", "stable when divided by 9.77, constant P",
        lambda: sampled(FOUR, 9.77),
    ),
    "four-states-below": Published(
        "the same, radius 8.914964", "stable when divided by 8.9149",
        lambda: sampled(FOUR, 8.9149),
    ),
    "positioning": Published(
        "after Kothare et al. (1996), example 1", "the regulator at a = 1 serves a in [.1, 10]",
        lambda: positioning(False),
    ),
    "positioning-robust": Published(
        "the same", "K and P of one inequality serve it", lambda: positioning(True)
    ),
    "mpc": Published(
        "MPT 3, double integrator", "regulator, its Riccati P, x'Px <= 1: set and cost",
        lambda: terminal(1.0, 1.0),
    ),
    "mpc-more": Published(
        "the same", "1.000001 P as cost, the level alike", lambda: terminal(1.000001, 1.0)
    ),
    "mpc-large": Published("the same", "x'Px <= 5", lambda: terminal(1.000001, 5.0)),
}  # fmt: skip


def written(name: str, folder: Path) -> tuple[Path, Path]:
    """Write the plant and the claim of an entry, and return their files."""
    files = folder / f"{name}.plant.json", folder / f"{name}.claim.json"
    for path, content in zip(files, PUBLISHED[name].made(), strict=True):
        path.write_text(json.dumps(content) + "\n", encoding="utf-8")
    return files


def row(name: str, folder: Path) -> list[str]:
    """Return the row of the table of an entry, from its files."""
    plant, claim = folder / f"{name}.plant.json", folder / f"{name}.claim.json"
    found = check(read_plant(plant), read_claim(claim))
    shown = found.reason.split(". ")[-1] if found.reason else ""
    how = "" if found.exact else " (computed)"
    one = PUBLISHED[name]
    answer = f"**{found.answer}**{how}"
    return [f"`{name}`", one.source, _cell(one.words), answer, _cell(shown)]


def _cell(text: str) -> str:
    return text.replace("|", "&#124;").rstrip(".")


def main() -> None:
    """Print the answers, or keep the files and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the files and the table")
    given = parser.parse_args()
    rows = []
    for name in PUBLISHED:
        if given.write:
            FOLDER.mkdir(exist_ok=True)
            written(name, FOLDER)
        rows.append(row(name, FOLDER))
        print(*rows[-1], sep=" | ", flush=True)
    if given.write:
        head = ["files", "source", "claim", "answer", "what shows it"]
        keep(PAGE, SECTION, markdown(head, rows))


if __name__ == "__main__":
    main()
