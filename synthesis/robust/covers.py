"""Weights that cover the relative error of a delay or a servo at every frequency.

For each G of a family around G0: |G/G0 - 1| <= |W| on the whole imaginary axis, so that G = G0 (1 +
W Delta) with a stable Delta of gain at most one. That is shown in exact arithmetic of the doubles
of each weight that is returned: of a delay and a lag by polynomials in the squared frequency, of a
servo by Bernstein coefficients over frequency, bandwidth and damping.

References
----------
Skogestad and Postlethwaite, Multivariable Feedback Control (2005), sec. 7.4.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize

from symheli import LinearModel
from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from synthesis.numerics.polynomial.definite import negative_definite, negative_definite_exactly
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.positive import positive, product
from synthesis.numerics.polynomial.transfer import Transfer

CORNER, ZEROS, POLES = Fraction(2363, 1000), Fraction(838, 1000), Fraction(685, 1000)
"""Corner frequency (times the delay) and damping of the second-order factor of the weight of a
delay: Skogestad and Postlethwaite, eq. 7.27 (published). At every frequency it is above the error,
by 2.1 % at most.
"""
POINTS = 200, 9
"""Frequencies, and values of bandwidth and damping each, at which a weight of a servo is fitted."""
DECADES = 2.0
"""Decades of frequency about the bandwidth at which it is."""
SPARE = 1 + 1e-12
"""Factor by which the weight of a delay or a lag is raised: more than its rounding."""
TAYLOR, BELOW, ABOVE = 7, Fraction(986, 100), Fraction(987, 100)
"""Terms of the Taylor sum of 2 - 2 cos; numbers next to pi^2."""
RAISED = 1.001
"""Factor by which a weight is raised until it is shown to cover."""
MAX_RAISES = 200
CELLS = 20000
"""Boxes of (frequency, bandwidth, damping) after which a weight counts as not shown."""


class PositiveRange(NamedTuple):
    """A number between `low` and `high`, both > 0, and that of the model, `nominal`."""

    low: float
    nominal: float
    high: float

    @classmethod
    def of(cls, given: object, nominal: object, name: str) -> PositiveRange:
        """Return the range; the middle is nominal where none is given. Raises `InputError`."""
        try:
            low, high = (float(v) for v in given)  # type: ignore[attr-defined]
            middle = 0.5 * (low + high) if nominal is None else float(nominal)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            low = high = middle = math.nan
        if not (0 < low < high < math.inf and 0 < middle < math.inf):
            raise InputError(
                f"{name}: expected (low, high) with 0 < low < high, and a nominal value > 0, got"
                f" {given!r:.60} and {nominal!r:.40}"
            )
        return cls(low, middle, high)


def delay_weight(longest: object) -> LinearModel:
    """Return W of order 3 with |exp(-j w T) - 1| <= |W(j w)| for every |T| <= `longest`, s.

    Raises `InputError` unless it is a finite number > 0.
    """
    if isinstance(longest, bool) or not isinstance(longest, int | float | np.number):
        longest = math.nan
    T = float(longest)
    if not 0 < T < math.inf:
        raise InputError(f"longest: expected a delay > 0 s, got {longest!r:.40}")
    c, zeros, poles = (float(v) for v in (CORNER, ZEROS, POLES))
    numerator = np.polymul([1.0, 0.0], [1 / c**2, 2 * zeros / c, 1.0])
    denominator = np.polymul([0.5, 1.0], [1 / c**2, 2 * poles / c, 1.0])
    return _shown(rational(SPARE * numerator, denominator, 1 / T), lambda W: covers_delay(W, T))


def covers_delay(W: LinearModel, T: float) -> bool:
    """Whether |exp(-j w T) - 1| <= |W(j w)| at every w, and for shorter delays; exact.

    With t = (w T)^2 the squared error of the longest delay is 2 - 2 cos sqrt(t), below any Taylor
    sum that ends on a positive term; that of a shorter one is below it up to t = pi^2, and any
    below 4.
    """
    N, D = squared(W, Fraction(T))
    sum_, factor = [Fraction(0)], Fraction(2)
    for k in range(TAYLOR):
        factor = factor / ((2 * k + 1) * (2 * k + 2))
        sum_.append((-1) ** k * factor)
    return _positive(_minus(N, product(D, sum_)), ABOVE) and positive(
        _integers(_minus(N, 4 * D)), BELOW, None
    )


def squared(W: LinearModel, T: Fraction) -> tuple[Array, Array]:
    """Return N and D with |W(j w)|^2 = N(t)/D(t), t = (w T)^2, ascending rationals."""
    G = Transfer.of(W.A, W.B, W.C, W.D)
    unit = Fraction(2) ** G.pace * T
    out = []
    for c in (G.above[:, 0, 0], G.gain * G.below):
        c = [v / unit**k for k, v in enumerate(c)]
        both = product(c, [v * (-1) ** k for k, v in enumerate(c)])
        out.append(np.array([v * (-1) ** k for k, v in enumerate(both[0::2])], dtype=object))
    return out[0], out[1]


def _shown(W: LinearModel, covers: Callable[[LinearModel], bool]) -> LinearModel:
    """Return a weight that is shown to cover; raise `InputError` for another."""
    if not covers(W):
        raise InputError(
            "no weight is shown to cover this block in doubles: give its time or bandwidth in"
            " another unit"
        )
    return W


def _positive(p: Array, high: Fraction | None) -> bool:
    """Whether p > 0 on [0, high], or p(0) = 0 and p/t > 0 there."""
    return positive(_integers(p[1:] if p[0] == 0 else p), 0, high)


def _minus(a: Array, b: Array) -> Array:
    out = np.zeros(max(len(a), len(b)), dtype=object)
    out[: len(a)] += a
    out[: len(b)] -= b
    return out


def _integers(p: Array) -> Array:
    common = math.lcm(*(Fraction(v).denominator for v in p))
    return np.array([int(v * common) for v in p], dtype=object)


def lag_weight(bandwidth: PositiveRange) -> LinearModel:
    """Return W of order 1 that covers b/(s + b) around that of the nominal bandwidth, rad/s.

    The error of b is h s/(s + b) with h = b/b0 - 1; of any b between, it is below that of an end.
    h s/(s + h/k) with the larger |h| and the larger |h|/b of the ends is above both. About the
    middle of the range it is the error of the slowest lag itself.
    """
    ends = np.array([bandwidth.low, bandwidth.high])
    sizes = np.abs(ends / bandwidth.nominal - 1)
    h, k = sizes.max(), (sizes / ends).max()
    W = rational(SPARE * np.array([h, 0.0]), np.array([1.0, h / k]), 1.0)
    return _shown(W, lambda W: covers_lag(W, bandwidth))


def covers_lag(W: LinearModel, bandwidth: PositiveRange) -> bool:
    """Whether |W| is above the errors h s/(s + b) of both ends b, h = b/b0 - 1, at every frequency;
    exact. That of any b between is below one of them.
    """
    N, D = squared(W, Fraction(1))
    for b in (Fraction(bandwidth.low), Fraction(bandwidth.high)):
        h = b / Fraction(bandwidth.nominal) - 1
        if not _positive(_minus(product(N, [b * b, 1]), product(D, [0, h * h])), None):
            return False
    return True


def servo_weight(bandwidth: PositiveRange, damping: PositiveRange) -> LinearModel:
    """Return W of order 2 that covers w^2/(s^2 + 2 z w s + w^2) around the nominal w (rad/s), z.

    With s in units of the nominal w, k = w/w0 and t = -s^2 the squared error is t E(t, k, z)/F(t,
    k, z), the squared weight t (a t + c)/G(t): a and c are the least for the best G found, and
    raised until the weight is shown to cover, for all t >= 0, k and z, as it is returned.

    Raises `InputError` where none is found, for ranges that are too wide.
    """
    k = np.array([bandwidth.low, bandwidth.high]) / bandwidth.nominal
    z0, z = damping.nominal, np.array([damping.low, damping.high])
    t = np.geomspace(10**-DECADES, 10**DECADES, POINTS[0]) ** 2
    lines = (np.linspace(low, high, POINTS[1]) for low, high in (k, z))
    kk, zz = (g.ravel() for g in np.meshgrid(*lines))
    E, F = _servo_error(t[:, None], kk, zz, z0)
    worst = (E / F).max(axis=1)

    def fitted(x: Array) -> tuple[float, Array]:
        """Return the largest excess of the least weight with these n, z and c/a, and (a, c)."""
        n, own, ratio = np.exp(x)
        most, own = worst * _denominator(t, n, own), t + ratio
        a = max((most / own).max(), ends[1], ends[0] * n**4 / ratio)
        return (a * own / most).max(), a * np.array([1.0, ratio])

    # of frequency 0 and infinite
    ends = [(E0 / F0).max() for E0, F0 in (_servo_error(0.0, kk, zz, z0), ((kk**2 - 1) ** 2, 1.0))]
    starts = itertools.product(np.log(k), np.log([*z, 1.0]), [-1.0, 1.0])
    tried = [optimize.minimize(lambda x: fitted(x)[0], x, method="Nelder-Mead") for x in starts]
    x = min(tried, key=lambda found: found.fun).x
    a, c = fitted(x)[1]
    n, own = np.exp(x[:2])
    for _ in range(MAX_RAISES):
        a, c = RAISED * a, RAISED * c
        W = rational(
            np.array([math.sqrt(a), math.sqrt(c), 0.0]),
            np.array([1.0, 2 * own * n, n * n]),
            bandwidth.nominal,
        )
        if covers_servo(W, bandwidth, damping):
            return W
    raise InputError("bandwidth, damping: no weight is found that covers them: narrow the ranges")


def _servo_error(t: Any, k: Array, z: Array, z0: float) -> tuple[Array, Array]:
    """Return E and F: the squared relative error is t E/F."""
    return (k * k - 1) ** 2 * t + 4 * k * k * (z0 * k - z) ** 2, (k * k - t) ** 2 + (
        4 * z * z * k * k * t
    )


def _denominator(t: Array, n: float, own: float) -> Array:
    return (n * n - t) ** 2 + 4 * own * own * n * n * t


def covers_servo(W: LinearModel, bandwidth: PositiveRange, damping: PositiveRange) -> bool:
    """Whether |W| is above the relative error of every servo of these ranges, at every frequency;
    exact.

    With |W|^2 = N/D, N F - t E D > 0 for t >= 0 as a polynomial in u = t/(1 + t), k and z.
    """
    w0, z0 = Fraction(bandwidth.nominal), Fraction(damping.nominal)
    N, D = squared(W, 1 / w0)
    # powers (of t, k, z)
    F = {(0, 4, 0): 1, (1, 2, 0): -2, (2, 0, 0): 1, (1, 2, 2): 4}
    E = {
        **{(2, 4, 0): 1, (2, 2, 0): -2, (2, 0, 0): 1},
        **{(1, 4, 0): 4 * z0 * z0, (1, 3, 1): -8 * z0, (1, 2, 2): 4},
    }
    terms: dict[tuple[int, int, int], Fraction] = {}
    for known, factors in ((F, N), (E, -D)):
        for (i, j, l), value in known.items():
            for power, factor in enumerate(factors):
                at = i + power - (N[0] == 0), j, l
                terms[at] = terms.get(at, Fraction(0)) + factor * value
    top = max(i for (i, _, _), value in terms.items() if value)
    # t^i (1 - u)^top = u^i (1 - u)^(top - i)
    whole: dict[tuple[int, int, int], Fraction] = {}
    for (i, j, l), value in terms.items():
        for m in range(top + 1 - i):
            at = i + m, j, l
            more = value * math.comb(top - i, m) * (-1) ** m
            whole[at] = whole.get(at, Fraction(0)) + more
    box = (
        (Fraction(0), Fraction(1)),
        (Fraction(bandwidth.low) / w0, Fraction(bandwidth.high) / w0),
        (Fraction(damping.low), Fraction(damping.high)),
    )
    coefficients = np.zeros((top + 1, 5, 3), dtype=object)
    for at, value in whole.items():
        coefficients[at] = -value
    for axis, (low, high) in enumerate(box):
        change = _power_to_bernstein(coefficients.shape[axis] - 1, low, high)
        coefficients = np.moveaxis(np.tensordot(change, coefficients, (1, axis)), 0, axis)
    exact = PolynomialMatrix(box, coefficients[..., None, None])
    rough = PolynomialMatrix(exact.box, exact.coefficients.astype(float))
    return negative_definite(rough, CELLS) and negative_definite_exactly(exact, CELLS)


def _power_to_bernstein(degree: int, low: Fraction, high: Fraction) -> Array:
    """Return the Bernstein coefficients over [low, high] of p^e in column e, in rationals."""
    out = np.zeros((degree + 1, degree + 1), dtype=object)
    for i, e, k in itertools.product(range(degree + 1), repeat=3):
        if k <= e:
            share = Fraction(math.comb(i, k) * math.comb(degree - i, e - k), math.comb(degree, e))
            out[i, e] += share * low ** (e - k) * high**k
    return out


def rational(numerator: Sequence[float] | Array, denominator: Array, pace: float) -> LinearModel:
    """Return N(s)/D(s) of equal degrees, s in units of `pace` (rad/s), in controllable form."""
    scale = denominator[0]
    low, top = denominator[1:] / scale, np.asarray(numerator) / scale
    n = len(low)
    A = np.eye(n, k=1)
    A[-1] = -low[::-1]
    C = (top[1:] - top[0] * low)[::-1]
    states = tuple(Signal(f"weight_{i + 1}") for i in range(n))
    ends = (Signal("in"),), (Signal("out"),)
    D = np.array([[top[0]]])
    return LinearModel(pace * A, pace * np.eye(n)[:, -1:], C[None], D, states, *ends)
