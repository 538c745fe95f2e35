"""Functions V = x' P(p, e) x that know a lag of p: e = p - q, T dq/dt = p - q from q = p.

The lag error stays in lower(p) <= e <= upper(p), straight lines between knots, while |dp/dt| <= r:
at the upper limit e must not rise faster than it, |1 - upper'| r <= upper / T, and |1 - lower'| r
<= -lower / T; e = 0 lies inside. P is a spline in p and in the share s of e = lower + s h, h =
upper - lower, of which h ds/dt = dp/dt - e / T - (lower' + s h') dp/dt. The inequalities of dV/dt
are those of a P without lag, with dP/dt = dp/dt dP/dp + ds/dt dP/ds; here times h > 0.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from . import words
from .cells import cells
from .demands import Claim, Demand
from .polynomials import combined, scalar, symmetric, variable, zero
from .reading import Model, Unreadable, array, ascending, bound_of, number, whole
from .storage import Proof, Spline


def claimed(kind: str, content: Any) -> Claim:
    """Return what a certificate with a lag claims."""
    proof, bound = content["proof"], bound_of(kind, content)
    model, V = Model.read(proof["lpv"]), proof["lyapunov"]
    region, (p,) = V["region"], model.parameters
    knots, T = ascending(region["knots"], "knots"), number(region["time"], "a lag")
    lower, upper = (array(region[name], name, len(knots)) for name in ("lower", "upper"))
    rate = number(proof["rate"], "the rate")
    if model.dt is not None or kind not in ("l2 gain", "stability") or proof["block"] is not None:
        raise Unreadable("a lag is known for gains and stability in continuous time only")
    if content["rates"] != [proof["rate"]] or rate < 0 or T <= 0:
        raise Unreadable("the rates of the claim are not those of the proof")
    motion, n = (p._replace(rate=rate),), len(model.states)
    degrees = [whole(V[name], "a degree", 1) for name in ("degree", "lead_degree")]
    P = Spline.read([region["knots"], V["lead_knots"]], degrees, V["coefficients"], n)
    plain, shares = Proof(kind, model, motion, P), P.knots[1]
    refused = ""
    if (knots[0], knots[-1], shares[0], shares[-1]) != (p.low, p.high, 0, 1):
        refused = "V is not known on the whole range of p and of its lag"
    segments = range(len(knots) - 1)
    slopes = [
        [(v[k + 1] - v[k]) / (knots[k + 1] - knots[k]) for k in segments] for v in (lower, upper)
    ]
    for k in segments:
        for i in (k, k + 1):
            low, high = -lower[i], upper[i]
            if min(low, high) < 0 or low + high <= 0:
                refused = "the limits of the lag error do not lie around zero"
            rises, falls = abs(1 - slopes[1][k]) * rate * T, abs(1 - slopes[0][k]) * rate * T
            if rises > high or falls > low:
                refused = f"the lag error may leave its limits at p1 = {float(knots[i]):.9g}"

    def demands() -> Iterator[Demand]:
        for cell in cells(model, motion, [knots], [False]):
            ((j,), (q,), strip) = cell.segments, cell.here, cell.strips[0]
            u = (q - scalar(knots[j])) * (1 / (knots[j + 1] - knots[j]))
            ends = [scalar(v[j]) + u * (v[j + 1] - v[j]) for v in (lower, upper)]
            height, system = ends[1] - ends[0], model.on(cell.middle, cell.here)
            for i, (a, b) in enumerate(pairwise(shares)):
                s = scalar(a) + variable(1) * (b - a)
                here = P.on((j, i), (q, s))
                wide = cell._replace(variables=2)
                yield Demand("V > 0", here, wide)
                form, paid = plain.falling(wide, system, here, here, here * 0)
                for speed in (-rate, rate):
                    widens = slopes[1][j] - slopes[0][j]
                    pace = scalar(speed * (1 - slopes[0][j])) - s * (speed * widens)
                    pace = pace - (ends[0] + s @ height) * (1 / T)
                    along = here.derivative(0) * (speed / (strip.high - strip.low))
                    across = here.derivative(1) * (1 / (b - a))
                    drift = combined([height, pace], [along, across])
                    nu = form.shape[0] - drift.shape[0]
                    whole_drift = symmetric([[drift], [zero(nu, drift.shape[0]), zero(nu, nu)]])
                    scaled = None if paid is None else combined([height], [paid])
                    name = f"V falls with dp1/dt = {float(speed):.6g}"
                    yield Demand(name, combined([height], [form]) - whole_drift, wide, scaled)

    said = words.model(*model.sizes, motion)
    return Claim(words.gain(kind, bound), said, demands(), bound, lambda g: g * g, refused=refused)
