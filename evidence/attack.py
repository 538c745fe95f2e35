"""Random plants near the limit, for every kind of proven statement: how many proofs are false.

python -m evidence.attack --kinds "l2 gain" stability --count 100

Truth is found by another way than the proof: responses and Gramians of frozen models, products of
transition matrices, eigenvalues over real parameters, points on the border of a set. A trial is
false where what was attained is beyond what was proven by more than the rounding of doubles.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import casadi
import numpy as np
from scipy import linalg

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import SymheliError
from symheli.values.signal import signals
from synthesis import decay_rate, h2_gain, l2_gain, lft_gain, stability
from synthesis.analysis import (
    energy_to_peak,
    output_strictness,
    passivity_index,
    sector_radius,
)
from synthesis.forms import Spline
from synthesis.robust import (
    DelayBlock,
    DynamicBlock,
    ParameterBlock,
    StaticBlock,
    multiplier_gain,
    robust_margin,
    slope_margin,
    uncertain,
    worst_case_gain,
)
from synthesis.sets import invariant_set, low_complexity_set
from synthesis.switching import dwell_time
from synthesis.tubes import Motions, tube

Array = np.ndarray
QUICK = {"form": Spline(degree=1, segments=1), "search": None}
ROUNDED = 1e-6
"""Relative excess of what is attained over what is proven that rounding of the truth may have."""
POINTS = 9
"""Values of p at which frozen models are looked at."""
ANGLES = np.exp(1j * np.linspace(0.0, 2 * np.pi, 16, endpoint=False))


class Trial(NamedTuple):
    """The `ratio` of what was attained to what is proven, above 1 for a false proof; NaN where
    nothing was proven.
    """

    ratio: float


NOTHING = Trial(math.nan)


def lightly_damped(rng: np.random.Generator, n: int, pace: float, dt: float | None) -> Array:
    """Return a stable matrix (n, n): real poles and pairs, damped by 1e-4 to 1, in mixed
    coordinates of a condition up to 1e3.
    """
    blocks, left = [], n
    while left:
        omega, damping = pace * 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-4, 0)
        pair = left > 1 and rng.random() < 0.6
        s = complex(-damping * omega, omega if pair else 0.0)
        z = s if dt is None else np.exp(s * dt)
        blocks.append(np.array([[z.real, z.imag], [-z.imag, z.real]]) if pair else [[z.real]])
        left -= 1 + pair
    mixed: Any = linalg.qr(rng.standard_normal((n, n)))[0] * 10 ** rng.uniform(-1.5, 1.5, n)
    return mixed @ linalg.block_diag(*blocks) @ np.linalg.inv(mixed)


def plant(
    rng: np.random.Generator,
    inputs: int = 1,
    outputs: int = 1,
    through: float = 0.0,
    dt: float | None = None,
    states: int = 3,
) -> LPVStateSpace:
    """Return a random plant over one parameter, in random units: time from 1e-3 to 1e3, signals
    from 1e-4 to 1e4, ranges far from zero or narrow; stable at both ends.
    """
    n = int(rng.integers(1, states + 1))
    pace = 10 ** rng.uniform(-3, 3) if dt is None else 1.0 / (10 * dt)
    low, width = (rng.choice([0.0, -1.0, 1e3]), rng.choice([1.0, 1e-3, 10.0]))
    rate = float(rng.choice([0.0, 0.1, 1.0, math.inf])) * width * pace
    p = Scheduling("p", "1", low, low + width, 0.0 if math.isnan(rate) else rate)
    size = 10 ** rng.uniform(-4, 4)
    A, change = lightly_damped(rng, n, pace, dt), rng.standard_normal((n, n))
    change *= rng.uniform(0, 0.3) * np.linalg.norm(A) / max(np.linalg.norm(change), 1e-300)
    while not all(slow(A + t * change, dt) < 0 for t in (0.0, 0.25, 0.5, 0.75, 1.0)):
        change *= 0.5
        if np.linalg.norm(change) < 1e-12 * np.linalg.norm(A):
            change = 0 * change
            break
    B, C = rng.standard_normal((n, inputs)), size * rng.standard_normal((outputs, n))
    D = size * through * np.eye(outputs, inputs)
    slope = change / width
    return LPVStateSpace.polynomial([A - low * slope, slope], [B], [C], [D], p, dt=dt)


def slow(A: Array, dt: float | None) -> float:
    """Return the growth of the slowest mode of a frozen model, 1/s or per sample."""
    poles = np.linalg.eigvals(A)
    return float(poles.real.max()) if dt is None else float(np.log(np.abs(poles).max() + 1e-300))


def frozen(model: LPVStateSpace) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield the matrices of the model at values of p, its ends first."""
    s = model.scheduling
    for p in np.linspace(s.low, s.high, POINTS):
        yield tuple(model.matrices(p))  # type: ignore[misc]


def responses(A: Array, B: Array, C: Array, D: Array, dt: float | None) -> Iterator[Array]:
    """Yield responses of a frozen model about its poles and over frequency, the limit first."""
    if dt is None:
        yield D
    poles: Any = np.linalg.eigvals(A).astype(complex)
    s: Any = poles if dt is None else np.log(poles + 1e-300)
    near = np.abs(s.imag) + np.multiply.outer(np.linspace(-2, 2, 9), np.abs(s.real)).ravel().max(
        initial=0.0
    )
    near = np.unique(np.r_[np.abs(s.imag), np.abs(s), near, 0.0])
    pace = max(float(np.abs(s).max()), 1e-300)
    grid = np.r_[near, pace * np.geomspace(1e-3, 1e2, 60)]
    for omega in grid if dt is None else np.minimum(grid, np.pi):
        z = 1j * omega if dt is None else np.exp(1j * omega)
        yield C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D


def largest(model: LPVStateSpace, size: Callable[[Array], float]) -> float:
    """Return the largest size of the responses of all frozen models."""
    return max(size(G) for M in frozen(model) for G in responses(*M, model.dt))


def gain(G: Array) -> float:
    """Return the largest singular value."""
    return float(np.linalg.norm(G, 2))


def least_real(G: Array) -> float:
    """Return the least eigenvalue of the Hermitian part."""
    return float(np.linalg.eigvalsh(0.5 * (G + G.conj().T))[0])


def proven_gain(cert: Any, attained: float) -> Trial:
    """Return the trial of an upper bound."""
    return Trial(attained / cert.bound) if cert.verified and cert.verify(True) else NOTHING


def proven_index(cert: Any, attained: float, unit: float) -> Trial:
    """Return the trial of an index: 1 plus what is proven above what was attained, in a unit."""
    if not (cert.verified and cert.verify(True)):
        return NOTHING
    return Trial(1.0 + (cert.bound - attained) / unit)


def growth_by_products(A: list[Array], dt: float | None, rng: np.random.Generator) -> float:
    """Return the largest growth per second, or sample, along random periodic products."""
    worst = -math.inf
    for _ in range(60):
        product, seconds = np.eye(len(A[0])), 0.0
        for _ in range(int(rng.integers(2, 6))):
            M = A[int(rng.integers(len(A)))]
            if dt is None:
                pace = max(float(np.abs(np.linalg.eigvals(M)).max()), 1e-300)
                t = 10 ** rng.uniform(-1, 1) / pace
                product, seconds = linalg.expm(M * t) @ product, seconds + t
            else:
                count = int(rng.integers(1, 6))
                product, seconds = np.linalg.matrix_power(M, count) @ product, seconds + count
        radius = float(np.abs(np.linalg.eigvals(product)).max())
        worst = max(worst, math.log(max(radius, 1e-300)) / seconds)
    return worst


def _period(rng: np.random.Generator) -> float | None:
    """Return no sample period, or 0.1 s."""
    return None if rng.random() < 0.5 else 0.1


# one function a kind: a random plant, a proof, the truth


def _gain(rng: np.random.Generator) -> Trial:
    model = plant(rng, 2, 2, rng.choice([0.0, 0.3]), _period(rng))
    return proven_gain(l2_gain(model, **QUICK), largest(model, gain))


def _stability(rng: np.random.Generator) -> Trial:
    model = plant(rng, dt=_period(rng)).with_rate(math.inf)
    cert = stability(model, **QUICK)
    if not (cert.verified and cert.verify(True)):
        return NOTHING
    ends = [next(iter([A])) for A, *_ in frozen(model)]
    growth = growth_by_products(ends, model.dt, rng)
    return Trial(1.0 + growth / abs(slow(ends[0], model.dt)))


def _decay(rng: np.random.Generator) -> Trial:
    model = plant(rng, dt=_period(rng)).with_rate(rng.choice([0.0, math.inf]))
    cert = decay_rate(model, **QUICK)
    slowest = -max(slow(A, model.dt) for A, *_ in frozen(model)) / (model.dt or 1.0)
    if not (cert.verified and cert.verify(True)):
        return NOTHING
    if math.isinf(model.scheduling.limit):
        found = growth_by_products([A for A, *_ in frozen(model)], model.dt, rng)
        slowest = min(slowest, -found / (model.dt or 1.0))
    return Trial(float(cert.alpha / slowest))


def _variance(model: LPVStateSpace) -> Iterator[Array]:
    for A, B, C, D in frozen(model):
        if model.dt is None:
            yield C @ linalg.solve_continuous_lyapunov(A, -B @ B.T) @ C.T
        else:
            yield C @ linalg.solve_discrete_lyapunov(A, B @ B.T) @ C.T + D @ D.T


def _peak(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 2, dt=_period(rng))
    attained = math.sqrt(max(float(np.linalg.eigvalsh(V)[-1]) for V in _variance(model)))
    return proven_gain(energy_to_peak(model, **QUICK), attained)


def _h2(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 2, dt=_period(rng))
    attained = math.sqrt(max(float(np.trace(V)) for V in _variance(model)))
    return proven_gain(h2_gain(model, **QUICK), attained)


def _passivity(rng: np.random.Generator) -> Trial:
    model = plant(rng, 2, 2, 0.5, _period(rng))
    attained = -largest(model, lambda G: -least_real(G))
    return proven_index(passivity_index(model, **QUICK), attained, largest(model, gain))


def _strictness(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 1, 0.5, _period(rng))
    attained = -largest(model, lambda G: -float((1 / G[0, 0]).real))
    return proven_index(output_strictness(model, **QUICK), attained, abs(attained) + 1e-300)


def _sector(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 1, 0.3, _period(rng))
    c = float(rng.uniform(-1, 1) * largest(model, gain))
    return proven_gain(sector_radius(model, c, **QUICK), largest(model, lambda G: abs(G[0, 0] - c)))


def _lft(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 1, dt=_period(rng))
    cert = lft_gain(model.to_lft(), str(rng.choice(["D", "DG", "full block"])), search=None)
    return proven_gain(cert, largest(model, gain))


def _uncertain(rng: np.random.Generator) -> Trial:
    model = plant(rng, 2, 2, 0.2)
    largest_block = largest(model, lambda G: abs(G[1, 1]))
    bound = float(rng.uniform(0.3, 0.95) / largest_block)
    d, v = [str(model.inputs[1])], [str(model.outputs[1])]
    whole = uncertain(model, [DynamicBlock(d, v, bound)])
    cert = l2_gain(whole, **QUICK)

    def perturbed(G: Array) -> float:
        loop = G[0, 1] * bound * ANGLES / (1 - G[1, 1] * bound * ANGLES) * G[1, 0]
        return float(np.abs(G[0, 0] + loop).max())

    return proven_gain(cert, largest(model, perturbed))


def _dwell(rng: np.random.Generator) -> Trial:
    dt = _period(rng)
    n, pace = int(rng.integers(1, 3)), 1.0
    modes = [lightly_damped(rng, n, pace, dt) for _ in range(2)]
    jumps = {key: np.eye(n) + 0.3 * rng.standard_normal((n, n)) for key in ((0, 1), (1, 0))}
    found = dwell_time(modes, jumps, dt=dt, parts=4, average=bool(rng.random() < 0.5))
    if not (found.verified and found.verify()):
        return NOTHING
    worst = 0.0
    for stay in (1.0, 1.0 + rng.random(), 1.0 + 3 * rng.random()):
        seconds = np.array([found.seconds, stay * found.seconds]) * (1 + 1e-9)
        if dt is None:
            flows = [linalg.expm(A * t) for A, t in zip(modes, seconds, strict=True)]
        else:
            counts = np.ceil(seconds / dt - 1e-6).astype(int)
            pairs = zip(modes, counts, strict=True)
            flows = [np.linalg.matrix_power(A, max(int(k), 1)) for A, k in pairs]
        cycle = jumps[1, 0] @ flows[1] @ jumps[0, 1] @ flows[0]
        worst = max(worst, float(np.abs(np.linalg.eigvals(cycle)).max()))
    return Trial(float(worst))


def _ellipsoid(rng: np.random.Generator) -> Trial:
    model = plant(rng, 1, 1, dt=_period(rng)).with_rate(0.0)
    found = invariant_set(
        model, disturbance={str(model.inputs[0]): 1.0}, state_bounds=_wide(model), degree=1
    )
    if not (found.verified and found.verify()):
        return NOTHING
    worst = 0.0
    for p, (A, B, *_) in zip(_values(model), frozen(model), strict=True):
        Q = found.gramian(p)
        root, inner = np.linalg.cholesky(Q), np.linalg.inv(Q)
        z = rng.standard_normal((400, len(A)))
        x = (root @ (z / np.linalg.norm(z, axis=1, keepdims=True)).T).T
        if model.dt is None:
            rise = np.einsum("ki,ij,kj->k", x, inner @ A, x) + np.abs(x @ inner @ B[:, 0])
            size = np.linalg.norm(np.linalg.inv(root) @ A @ root, 2)
            worst = max(worst, 1.0 + float(rise.max()) / max(size, 1e-300))
        else:
            for sign in (-1.0, 1.0):
                after = x @ A.T + sign * B[:, 0]
                worst = max(worst, float(np.einsum("ki,ij,kj->k", after, inner, after).max()))
    return Trial(float(worst))


def _wide(model: LPVStateSpace) -> dict[str, float]:
    """Return a bound of every state that a disturbance of 1 comes near."""
    sizes = np.zeros(len(model.states))
    for A, B, *_ in frozen(model):
        each = LPVStateSpace.polynomial([A], [B], [np.eye(len(A))], [0 * B], model.parameters)
        peak = [gain(G[i : i + 1]) for i in range(len(A)) for G in responses(*_of(each), model.dt)]
        sizes = np.maximum(sizes, 20 * np.max(np.reshape(peak, (len(A), -1)), axis=1))
    return {str(x): float(s) for x, s in zip(model.states, sizes, strict=True)}


def _of(model: LPVStateSpace) -> tuple[Array, Array, Array, Array]:
    return tuple(model.matrices(model.scheduling.low))  # type: ignore[return-value]


def _values(model: LPVStateSpace) -> Array:
    return np.linspace(model.scheduling.low, model.scheduling.high, POINTS)


def _parallelepiped(rng: np.random.Generator) -> Trial:
    n = int(rng.integers(1, 4))
    A = lightly_damped(rng, n, 5.0, 0.1)
    A *= rng.uniform(0.3, 0.9) / max(float(np.abs(np.linalg.eigvals(A)).max()), 1e-300)
    one, nothing = np.eye(n), np.zeros((n, 1))
    p = Scheduling("p", "1", 0.0, 1.0, 0.0)
    names = [f"x{i}" for i in range(n)]
    model = LPVStateSpace.polynomial(
        [A, 0.1 * A], [rng.standard_normal((n, 1))], [one], [nothing], p, states=names,
        inputs=["w"], outputs=[f"y{i}" for i in range(n)], dt=0.1,
    )  # fmt: skip
    found = low_complexity_set(
        model, state_bounds=dict.fromkeys(names, 1.0), disturbance={"w": 0.05}
    )
    if not (found.verified and found.verify()):
        return NOTHING
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * n)).reshape(n, -1)
    W, worst = np.linalg.inv(found.V), 0.0
    for A, B, *_ in frozen(model):
        for sign in (-0.05, 0.05):
            after = W @ (A @ found.V @ corners + sign * B)
            worst = max(worst, float(np.abs(after).max()))
    return Trial(worst)


def _slope(rng: np.random.Generator) -> Trial:
    model = plant(rng, states=4)
    A, B, C, _ = next(frozen(model))
    names: Any = [f"x{i}" for i in range(len(A))]
    into: Any = ["d"]
    out: Any = ["v"]
    loop = LinearModel(A, B, C, np.zeros((1, 1)), names, into, out)
    kind = str(rng.choice(["circle", "Popov", "Zames-Falb"]))
    found = slope_margin(loop, "d", "v", kind, odd=bool(rng.random() < 0.5))
    if not 0 < found.slope < math.inf:
        return NOTHING
    limit = found.slope * np.geomspace(1e-3, 1.0, 400)
    unstable = [k for k in limit if slow(A + k * B @ C, None) > 0]
    if not unstable:
        return Trial(_first(A, B @ C, found.slope))
    return Trial(found.slope / unstable[0])


def _first(A: Array, BC: Array, k: float) -> float:
    """Return k over the first larger gain of an unstable loop; 0 for none below 1e6 k."""
    for factor in np.geomspace(1.0, 1e6, 400):
        if slow(A + k * factor * BC, None) > 0:
            return float(1.0 / factor)
    return 0.0


def _robust(rng: np.random.Generator) -> Trial:
    model = plant(rng, states=4)
    (s,) = model.parameters
    found = robust_margin(model.with_rate(0.0))
    if not 0 < found.lower < math.inf:
        return NOTHING
    middle, radius = s.middle, s.radius
    A0 = model.matrices(middle).A
    A1 = (model.matrices(s.high).A - model.matrices(s.low).A) / 2
    for t in found.lower * np.geomspace(1e-2, 1e3, 2000):
        if max(slow(A0 + sign * t * A1, None) for sign in (-1.0, 1.0)) > 0:
            return Trial(found.lower / t)
    del middle, radius
    return Trial(0.0)


def _worst_case(rng: np.random.Generator) -> Trial:
    model = plant(rng, 2, 2, 0.2)
    A, B, C, D = next(frozen(model))
    still = LPVStateSpace.polynomial([A], [B], [C], [D], model.parameters)
    G = list(responses(A, B, C, D, None))
    bound = float(rng.uniform(0.3, 0.95) / max(abs(each[1, 1]) for each in G))
    d, v = [str(still.inputs[1])], [str(still.outputs[1])]
    found = worst_case_gain(still, [DynamicBlock(d, v, bound)])
    if not math.isfinite(found.upper):
        return NOTHING
    block = bound * ANGLES
    closed = (M[0, 0] + M[0, 1] * block / (1 - M[1, 1] * block) * M[1, 0] for M in G)
    return Trial(max(float(np.abs(each).max()) for each in closed) / found.upper)


def _multipliers(rng: np.random.Generator) -> Trial:
    """One block near its limit; members by their own responses, with w = Delta v."""
    A, B, C, _ = next(frozen(plant(rng, 2, 2)))
    x, u, y = map(signals, ([f"x{i}" for i in range(len(A))], ["f", "d"], ["y", "v"]))
    loop = LinearModel(A, B, C, np.zeros((2, 2)), x, u, y)
    grid = np.geomspace(1e-2, 1e2, 1500) * np.abs(np.linalg.eigvals(A)).max()
    grid = np.unique(np.r_[grid, np.abs(np.linalg.eigvals(A))])
    G, s = loop.frequency_response(grid), 1j * grid
    k = float(rng.uniform(0.2, 1.5) / np.abs(G[:, 1, 1]).max())
    T = float(rng.uniform(0.1, 3.0) / np.abs(np.linalg.eigvals(A)).max())
    kind = str(rng.choice(["sector", "slope", "parameter", "dynamics", "delay", "window"]))
    block, delta = {
        "sector": (StaticBlock("d", "v", sector=(-k, k)), lambda t: k * t),
        "slope": (StaticBlock("d", "v", slope=(-k, k), odd=True), lambda t: k * t),
        "parameter": (ParameterBlock("d", "v", -k, k), lambda t: k * t),
        "dynamics": (DynamicBlock(["d"], ["v"], k), lambda t: k * np.exp(1j * np.pi * t)),
        "delay": (DelayBlock("d", "v", T), lambda t: np.exp(-s * T * abs(t)) - 1),
        "window": (DelayBlock("d", "v", T, "window"), lambda t: (np.exp(-s * T * abs(t)) - 1) / s),
    }[kind]
    found = multiplier_gain(loop, block)
    if not (found.verified and found.verify()):
        return NOTHING
    worst = found.lower
    for t in rng.uniform(-1, 1, 60):
        own = delta(t)
        closed = G[:, 0, 0] + G[:, 0, 1] * own / (1 - G[:, 1, 1] * own) * G[:, 1, 0]
        worst = max(worst, float(np.abs(closed).max()))
        if kind in ("sector", "slope", "parameter") and slow(A + own * B[:, 1:] @ C[1:], None) > 0:
            worst = math.inf
    return Trial(worst / found.upper)


def _tube(rng: np.random.Generator) -> Trial:
    """A random oscillator with a sine, a cubic and a saturation, about rest in gusts: dV/dt on the
    border by the function alone.
    """
    x, u, w, c = (casadi.SX.sym(n, k) for n, k in (("x", 2), ("u", 1), ("w", 1), ("c", 0)))
    a, b, d, s = rng.uniform(-1, 1, 4)
    own = a * casadi.sin(x[0]) + b * x[0] ** 3 + d * casadi.fabs(x[1]) * x[1]
    force = own + 0.1 * s * casadi.fmin(x[0], 0.1)
    model = casadi.Function("drawn", [x, u, w], [casadi.vertcat(x[1], force + u + w)])
    rest = casadi.Function("rest", [c], [casadi.SX.zeros(2), casadi.SX.zeros(1)])
    K = -np.array([[rng.uniform(1, 5), rng.uniform(1, 4)]])
    gust = float(10 ** rng.uniform(-2, -0.3))
    found = tube(model, Motions(rest, K), gust=gust, sizes=[0.5 * gust, 0.7 * gust])
    if not (found.verified and found.verify()):
        return NOTHING
    P = found.P[0]
    z = rng.standard_normal((2000, 2))
    e = np.linalg.solve(np.linalg.cholesky(P).T, (z / np.linalg.norm(z, axis=1)[:, None]).T)
    worst, size = -math.inf, 0.0
    for sign in (-gust, gust):
        rise = 2 * np.einsum("ik,ij,jk->k", e, P, np.array(model(e, K @ e, sign)))
        worst, size = max(worst, float(rise.max())), max(size, float(np.abs(rise).max()))
    return Trial(1.0 + worst / size)


KINDS: dict[str, Callable[[np.random.Generator], Trial]] = {
    "l2 gain": _gain,
    "stability": _stability,
    "decay rate": _decay,
    "energy-to-peak gain": _peak,
    "h2 gain": _h2,
    "passivity index": _passivity,
    "output strictness": _strictness,
    "sector": _sector,
    "LFT gain": _lft,
    "uncertain gain": _uncertain,
    "dwell time": _dwell,
    "ellipsoid": _ellipsoid,
    "parallelepiped": _parallelepiped,
    "tube": _tube,
    "slope margin": _slope,
    "robust margin": _robust,
    "worst-case gain": _worst_case,
    "multiplier gain": _multipliers,
}


class Row(NamedTuple):
    """The trials of one kind: how many, with a proof, refused with a sentence, false; the median
    and the largest ratio of attained to proven; seconds of a trial.
    """

    kind: str
    trials: int
    proven: int
    refused: int
    false: tuple[int, ...]
    median: float
    largest: float
    seconds: float


def attacked(kind: str, count: int, seed: int = 0) -> Row:
    """Return the row of so many random trials of a kind; the seeds of false ones are kept."""
    ratios, refused, false = [], 0, []
    start = time.perf_counter()
    for k in range(seed, seed + count):
        try:
            ratio = KINDS[kind](np.random.default_rng([k, sum(map(ord, kind))])).ratio
        except SymheliError:
            refused += 1
            continue
        if not math.isnan(ratio):
            ratios.append(ratio)
            if ratio > 1 + ROUNDED:
                false.append(k)
    spent = (time.perf_counter() - start) / count
    median, most = (float(np.median(ratios)), max(ratios)) if ratios else (math.nan, math.nan)
    return Row(kind, count, len(ratios), refused, tuple(false), median, most, spent)


def table(rows: Iterable[Row]) -> str:
    """Return the rows as a table."""
    head = "| kind | trials | proven | refused | false | attained / proven: median, largest | s |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    lines += [
        f"| {r.kind} | {r.trials} | {r.proven} | {r.refused} | {len(r.false)} | {r.median:.4f},"
        f" {r.largest:.7f} | {r.seconds:.2f} |"
        for r in rows
    ]
    return "\n".join(lines)


def main() -> None:
    """Print a row a kind, and the seeds of false proofs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rows = []
    for kind in asked.kinds:
        rows.append(attacked(kind, asked.count, asked.seed))
        print(table(rows[-1:]).splitlines()[-1], *rows[-1].false, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
