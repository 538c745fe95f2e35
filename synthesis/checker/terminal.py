"""Sets x'P x <= alpha of x in continuous time or samples, with u = K x, V = x'P x:

    dV/dt, or V(f) - V, + x'(Q + K'R K) x < 0 in the set, but at 0

as `regions` has it, Q + K'R K >= 0, and |k x| <= b of every limit where b^2 P - alpha k k' > 0.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from . import regions
from .demands import Claim, Demand
from .exact import nonnegative
from .polynomials import Polynomial, combined, even, matrix, scalar, variable
from .reading import Unreadable, array, number, period

KIND = "terminal set"


def _form(M: list[list[Fraction]], x: list[Polynomial]) -> Polynomial:
    """Return x'M x."""
    n = range(len(M))
    return combined([x[i] @ x[j] for i in n for j in n], [scalar(M[i][j]) for i in n for j in n])


def claimed(content: Any) -> Claim:
    """Return what a file of a terminal set claims."""
    states, controls = ([str(name) for name in content[k]] for k in ("states", "controls"))
    n, m, total = len(states), len(controls), regions.named([*states, *controls])
    dt, alpha = period(content["dt"]), number(content["alpha"], "alpha")
    f = [regions.read(each, total) for each in content["f"]]
    sizes = {"Q": (n, n), "R": (m, m), "K": (m, n), "P": (n, n)}
    Q, R, K, P = (array(content[k], k, *size) for k, size in sizes.items())
    bounds = [(str(k), number(b, "a limit")) for k, b in content["bounds"]]
    known = {name: [Fraction(i == j) for j in range(n)] for i, name in enumerate(states)}
    known |= dict(zip(controls, K, strict=True))
    if len(f) != n or not (n and m) or any(k not in known or b <= 0 for k, b in bounds):
        raise Unreadable("the file is damaged: equations or limits that do not fit the states")
    feedback = matrix(K, n)
    stage = even(Q) + feedback.T @ even(R) @ feedback
    x = [variable(i) for i in range(n)]
    u = regions.linear(K)
    closed, V = [regions.composed(p, [*x, *u], n) for p in f], _form(P, x)
    change = combined([V.derivative(i) for i in range(n)], closed)
    if dt is not None:
        change = regions.composed(V, closed, n) - V
    demands, refused = regions.decrease(content, V, change + _form(Q, x) + _form(R, u), alpha)
    if not refused and not nonnegative(stage.terms[()]):
        refused = "a cost below zero may fall while the set is left"
    for name, bound in bounds:
        row = matrix([known[name]], n)
        form = even(P) * (bound * bound) - row.T @ row * alpha
        demands.append(Demand(f"the limit of {name}", form))
    falls = "in continuous time" if dt is None else f"in samples of {float(dt)!r} s"
    claim = f"with u = K x no motion leaves x'P x <= {float(alpha)!r} or a limit, and x'P x falls"
    said = [f"{n} states, {m} controls, {falls}; x'P x falls by the cost x'Q x + u'R u at least"]
    said += [f"|{name}| <= {float(bound)!r}" for name, bound in bounds]
    return Claim(claim, said, demands, refused=refused)
