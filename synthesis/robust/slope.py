"""Loops around one static function of bounded slope: multipliers of Popov, and of Zames and Falb.

For d = phi(v), phi(0) = 0, slopes of phi between 0 and k, v = G d with a stable G: the loop is
stable if for some multiplier M

    Re M(j w) (1/k - G(j w)) > 0   at every frequency,   M = 1 - H + q j w.

M = 1 is the circle criterion and q that of Popov; h, the impulse response of H on both sides of
time zero, has an integral of |h| below 1, and h >= 0 unless phi is odd. Here H is a sum of powers
of a/(s + a), found by a linear program over frequencies. The inequality is that of a polynomial in
w^2 with integer coefficients, which is decided exactly: where it is lost, that frequency joins the
program.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy import optimize

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import as_model
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.signal import indices
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.polynomial.positive import bernstein, positive_until, product
from synthesis.numerics.polynomial.transfer import Transfer
from synthesis.robust import witness

CRITERIA = ("circle", "Popov", "Zames-Falb")
"""The classes of multipliers, each with those before it."""
POLES, ORDER = 10, 6
"""Number of poles a on each side of time zero, over those of G and a decade beyond, and largest
power of a/(s + a): kernels that are positive, of integral one, narrower the higher.
"""
FREQUENCIES = 200
"""Frequencies of the first program."""
ROUNDS = 25
"""Largest number of programs with one slope."""
GROWTH = 1.001
"""Ratio of a slope without a multiplier to one with it at which the search ends."""
LARGEST = 1e12
"""Largest slope, in units of the inverse of the norm of G, that is looked for."""
NORM = 1 - 1e-6
"""Largest integral of |h|."""
LEAST = 1e-9
"""The left side, by its largest size, is asked to be above this at the frequencies of a program."""
NEAR = 1e-12
"""A frequency nearer than this to one of the program, relative, is the same: the program cannot
help.
"""
AROUND = 1e-6, 1e-3
"""Relative distances of the frequencies that join the program with one at which it is lost."""
BITS = 12, 40
"""Bits of a pole a, and binary places of a coefficient c: integers of the proof stay short."""


class SlopeProof(NamedTuple):
    """The numbers of the proof that functions of slopes from 0 to `slope` leave the loop of G = c
    (s - A)^-1 b + d stable: the multiplier, as of `SlopeMargin`, and whether phi must be odd.
    """

    A: Array
    b: Array
    c: Array
    d: float
    slope: float
    poles: Array
    causal: Array
    ahead: Array
    popov: float
    criterion: str
    odd: bool

    def multiplier(self, omega: Array) -> Array:
        """Return M (K,) at frequencies omega (K,), rad/s."""
        s = 1j * np.asarray(omega, float)
        E = _kernels(s, self.poles)
        both = np.hstack([E, E.conj()]) @ np.r_[self.causal.ravel(), self.ahead.ravel()]
        return 1 - both + self.popov * s

    @property
    def admissible(self) -> bool:
        """Whether the multiplier is one of its class; exact."""
        numbers = [*self.poles, *self.causal.ravel(), *self.ahead.ravel(), self.popov, self.d]
        if not (np.all(np.isfinite(numbers)) and np.all(self.poles > 0) and self.slope > 0):
            return False
        weights = [Fraction(v) for v in (*self.causal.ravel(), *self.ahead.ravel())]
        kinds = {
            "circle": not (any(weights) or self.popov),
            "Popov": not any(weights) and self.d == 0,
            "Zames-Falb": sum(map(abs, weights)) < 1 and self.d == 0,
        }
        return kinds.get(self.criterion, False) and (self.odd or min(weights, default=0) >= 0)

    def verified(self) -> bool:
        """Whether G is stable, the multiplier one of its class, and the inequality true at every
        frequency and in the limit; all in integers.
        """
        G = Transfer.of(self.A, self.b[:, None], self.c[None], np.array([[self.d]]))
        return G.stable and self.lost(G) is None

    def lost(self, G: Transfer) -> float | None:
        """Return a frequency (rad/s) at or near which the inequality is not shown; None where it is
        shown at all.
        """
        if not self.admissible:
            return 0.0
        if math.isinf(self.slope):
            return 0.0 if np.any(G.above) else None
        p = self._polynomial(G)
        u = positive_until(bernstein(p, 0, None))
        if u == 1:
            return None
        return math.ldexp(math.sqrt(max(u, Fraction(0)) / (1 - u)), G.pace)

    def _polynomial(self, G: Transfer) -> Array:
        """Return the coefficients of Re M (1/k - G) |d e|^2 in w^2, times a positive number, w in
        the units of G; e the product of the (s + a)^r that are needed.
        """
        unit, k = Fraction(2) ** G.pace, Fraction(self.slope)
        used = {}  # powers of each pole
        for r, j in zip(*np.nonzero(np.abs(self.causal) + np.abs(self.ahead)), strict=True):
            used[j] = int(r) + 1
        a = {j: Fraction(float(self.poles[j])) / unit for j in used}
        # (a - s)(a + s) to the powers needed, without the factors that a term has
        whole = product([1], *[[a[j] ** 2, 0, -1] for j, r in used.items() for _ in range(r)])
        M = product(whole, [1, Fraction(self.popov) * unit])
        for sign, weights in ((1, self.causal), (-1, self.ahead)):
            for r, j in zip(*np.nonzero(weights), strict=True):
                rest = [
                    [a[i] ** 2, 0, -1]
                    for i, most in used.items()
                    for _ in range(most - (i == j) * (int(r) + 1))
                ]
                number = Fraction(float(weights[r, j])) * a[j] ** (int(r) + 1)
                term = product([number], *rest, *[[a[j], -sign]] * (int(r) + 1))
                M[: len(term)] -= term
        F = G.gain * G.below - k * G.above[:, 0, 0]
        back = [v * (-1) ** i for i, v in enumerate(G.below)]
        even = product(M, F, back)[0::2]
        real = [v * (-1) ** i for i, v in enumerate(even)]
        common = math.lcm(*(Fraction(v).denominator for v in real))
        return np.array([int(v * common) for v in real], dtype=object)


@dataclass(frozen=True, eq=False)
class SlopeMargin(ProvenStatement):
    """Functions of slopes from 0 to `slope` are proven to leave the loop stable; with the straight
    line of slope `limit` it is not stable (inf: no such line was found).

    The multiplier is 1 - sum c (a/(s + a))^r + q s, with a/(a - s) for those that act ahead of
    time: `poles` a (rad/s), `causal` and `ahead` their c (powers, poles), `popov` q (s). `proof`
    has all numbers that the statement rests on; None: nothing is proven, and `slope` is 0.
    """

    slope: float
    limit: float
    poles: Array
    causal: Array
    ahead: Array
    popov: float
    proof: SlopeProof | None = None
    reader: ClassVar[str] = "slope-margin"

    __repr__ = summarized

    @property
    def verified(self) -> bool:  # type: ignore[override]
        """Whether there is a proof, which was checked as it was found."""
        return self.proof is not None

    @property
    def why(self) -> str:  # type: ignore[override]
        """Why nothing is proven; empty where something is."""
        return "" if self.verified else "no multiplier was found that holds at every frequency"

    @property
    def bound(self) -> float:
        """The largest slope that is proven."""
        return self.slope

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return (
            f"slope margin {self.slope:.9g}: the loop is stable with every function d = phi(v) of"
            f" slopes from 0 to {self.slope:.6g}"
        )

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        own = self.proof
        if own is None:
            return ()
        moving = "phi may change in time" if own.criterion == "circle" else "phi is constant"
        shape = "phi is odd" if own.odd else "phi has any shape"
        sizes = f"the loop in the file, {len(own.A)} states, in continuous time, positive feedback"
        return (sizes, f"{moving}, phi(0) = 0", shape)

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": "slope margin", "bound": self.slope}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the loop and its multiplier."""
        if self.proof is None:
            raise InputError("only a proven slope is saved")
        return {"kind": "slope margin", **encoded(self.proof._asdict())}

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> SlopeMargin:
        """Return the slope of a file, proven anew."""
        values = {name: decoded(content[name]) for name in SlopeProof._fields}
        n = len(values["A"])
        counts = values["causal"].shape
        shapes = {"A": (n, n), "b": (n,), "c": (n,), "poles": counts[1:], "ahead": counts}
        for name, shape in shapes.items():
            values[name] = frozen(values[name], name, shape)
        proof = SlopeProof(**values)
        own = (proof.slope, math.nan, proof.poles, proof.causal, proof.ahead, proof.popov)
        return cls(*own, proof if proof.verified() else None)

    def verify(self, rigorous: bool = True) -> bool:
        """Check the proof again from its numbers, in integers; `rigorous`: and that the inequality
        holds at single frequencies, by a second writing of it.
        """
        own = self.proof
        if own is None or own.slope != self.slope or not own.verified():
            return False
        return not rigorous or witness.slope_is_borne(own)

    def __str__(self) -> str:
        if self.proof is None:
            return f"no slope is proven; a line of slope {self.limit:.6g} is not stable"
        return (
            f"slopes from 0 to {self.slope:.6g}: proven stable, in exact arithmetic at every"
            f" frequency; a line of slope {self.limit:.6g} is not"
        )

    def multiplier(self, omega: Array) -> Array:
        """Return M (K,) at frequencies omega (K,), rad/s."""
        if self.proof is None:
            raise InputError("no slope is proven: there is no multiplier")
        return self.proof.multiplier(omega)


def _kernels(s: Array, poles: Array) -> Array:
    """Return (a/(s + a))^r (K, powers poles), the first power of all poles first."""
    E = poles / (poles + s[:, None])
    return np.hstack([E**r for r in range(1, ORDER + 1)])


@with_one_thread
def slope_margin(
    model: LinearModel,
    input: str,
    output: str,
    criterion: str = "Zames-Falb",
    *,
    odd: bool = False,
) -> SlopeMargin:
    """Prove the largest slope of a static function d = phi(v) for which the loop is stable
    whatever the function: a saturation, a dead zone, a soft stop.

    Parameters
    ----------
    model : LinearModel or system of python-control
        Stable and continuous; positive feedback, as of `UncertainStateSpace.in_sector`.
    input, output : str
        d and v; without feedthrough from one to the other, or "circle".
    criterion : str
        "circle", for functions in a sector that may depend on time; "Popov", in a sector and
        constant; "Zames-Falb", of bounded slope and constant.
    odd : bool
        Whether phi(-v) = -phi(v), which allows more multipliers.

    Returns
    -------
    SlopeMargin
        `slope` is proven in exact arithmetic at every frequency; its `proof` checks itself again.
        `limit` is where no proof can be.

    Raises
    ------
    InputError
        A model that is sampled or not stable, feedthrough.
    UnknownNameError
        A signal that the model does not have, another criterion.

    References
    ----------
    Zames and Falb, SIAM J. Control 6 (1968); Khalil, Nonlinear Systems (2002), sec. 7.1; Carrasco,
    Turner and Heath, European J. Control 28 (2016).

    Examples
    --------
    1/(s + 1)^3 under negative feedback: 4 by the circle criterion, and 8 by Popov's, as of a gain.

    >>> from symheli import LinearModel
    >>> A = [[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]]
    >>> lags = LinearModel(
    ...     A, [[0.0], [0.0], [-1.0]], [[1.0, 0.0, 0.0]], [[0.0]], ["a", "b", "c"], ["d"], ["v"])
    >>> print(*(f"{slope_margin(lags, 'd', 'v', each).slope:.2f}" for each in ("circle", "Popov")))
    4.00 8.00
    """
    model = as_model(model)
    if criterion not in CRITERIA:
        raise UnknownNameError("criterion", criterion, CRITERIA)
    (i,), (j,) = indices([input], model.inputs, "input"), indices([output], model.outputs, "output")
    G = (
        None
        if model.dt is not None
        else Transfer.of(model.A, model.B[:, [i]], model.C[[j]], model.D[[j], [i]][:, None])
    )
    if G is None or not G.stable:
        raise InputError("model: expected a stable continuous one; close its loops first")
    if model.D[j, i] != 0 and criterion != "circle":
        raise InputError(f"expected no feedthrough from {input} to {output}: put a filter between")
    own = model.A, model.B[:, i], model.C[j], float(model.D[j, i])
    return _ScalarLoop(*own, criterion, odd, G).margin()


class _ScalarLoop(NamedTuple):
    """G = c (s - A)^-1 b + d, and the class of multipliers."""

    A: Array
    b: Array
    c: Array
    d: float
    criterion: str
    odd: bool
    exact: Transfer

    def response(self, omega: Array) -> Array:
        """Return G (K,) at frequencies (K,)."""
        return np.array([self.exact.response(float(w)).item() for w in omega])

    def margin(self) -> SlopeMargin:
        """Search the largest slope between that of the small gain theorem and the limit."""
        modes = np.linalg.eigvals(self.A)
        paces = np.abs(modes)
        paces = paces[paces > 0] if np.any(paces) else np.ones(1)
        line = np.geomspace(paces.min() / 100, 100 * paces.max(), FREQUENCIES)
        line = np.unique(np.r_[line, paces, np.abs(modes.imag)])
        size = np.abs(self.response(line)).max()
        poles = _shortened(np.geomspace(paces.min() / 10, 10 * paces.max(), POLES))
        none = np.zeros((ORDER, POLES))
        found = SlopeProof(*self[:4], math.inf, poles, none, none, 0.0, self.criterion, self.odd)
        if size == 0.0 and found.lost(self.exact) is None:
            return SlopeMargin(math.inf, math.inf, poles, none, none, 0.0, found)
        size = size or 1.0
        limit = self._limit(0.5 / size, LARGEST / size)
        low, high = 0.5 / size, min(limit, LARGEST / size)
        points = _Points(line, self.response(line))
        best, points = self._found(low, found, points)
        while best is None and low > LEAST / size:  # a peak between the frequencies
            low, high = 0.5 * low, low
            best, points = self._found(low, found, points)
        if best is None:
            return SlopeMargin(0.0, limit, poles, none, none, 0.0)
        k = high / math.sqrt(GROWTH)
        while high > GROWTH * low:
            made, points = self._found(k, found, points)
            low, high = (low, k) if made is None else (k, high)
            best, k = made or best, math.sqrt(low * high)
        return SlopeMargin(best.slope, limit, *best[5:9], best)

    def _limit(self, low: float, high: float) -> float:
        """Return the least slope of a line with which the loop is not stable; inf where none is
        found.
        """

        def growth(k: float) -> float:
            loop = self.A + np.outer(self.b, self.c) * k / (1 - k * self.d)
            return float(np.linalg.eigvals(loop).real.max()) if k * self.d < 1 else math.inf

        before = low
        for k in np.geomspace(low, high, FREQUENCIES):
            if growth(float(k)) >= 0:
                while k > before * (1 + 1e-9):
                    middle = math.sqrt(before * k)
                    before, k = (before, middle) if growth(middle) >= 0 else (middle, k)
                return float(k)
            before = float(k)
        return math.inf

    def _found(
        self, k: float, at: SlopeProof, points: _Points
    ) -> tuple[SlopeProof | None, _Points]:
        """Return a proof of the slope k, None where none is found, and the frequencies."""
        for _ in range(ROUNDS):
            trial = self._least(k, at, points)
            if trial is None:
                return None, points
            lost = trial.lost(self.exact)
            if lost is None:
                return trial, points
            if np.any(np.abs(points.omega - lost) <= NEAR * lost):
                return None, points
            around = np.array(
                [lost, *(lost * (1 + sign * step) for step in AROUND for sign in (-1, 1))]
            )
            points = points.joined(around, self.response(around))
        return None, points

    def _least(self, k: float, at: SlopeProof, points: _Points) -> SlopeProof | None:
        """Return the multiplier with the largest least real part, relative to |1/k - G|."""
        F = 1 / k - points.response
        size, s = np.abs(F), 1j * points.omega
        pace = math.exp(np.log(at.poles).mean())
        E = _kernels(s, at.poles)
        both = np.hstack([E, E.conj()])
        if self.odd:
            both = np.hstack([both, -both])
        if self.criterion != "Zames-Falb":
            both = both[:, :0]
        terms = -np.real(both * F[:, None]) / size[:, None]
        popov = np.real(s / pace * F) / size
        n, free = both.shape[1], (0.0, 0.0) if self.criterion == "circle" else (None, None)
        found = optimize.linprog(
            np.r_[np.zeros(n + 1), -1.0],
            np.vstack(
                [
                    np.column_stack([-terms, -popov, np.ones(len(s))]),
                    np.r_[np.ones(n), 0.0, 0.0],
                ]
            ),
            np.r_[F.real / size, NORM],
            bounds=[*[(0.0, None)] * n, free, (None, 1.0)],  # type: ignore[arg-type]
        )
        if found.x is None or found.x[-1] <= LEAST:
            return None
        c = np.zeros(2 * at.causal.size)
        for sign, part in zip(
            (1.0, -1.0), np.split(found.x[:n], 2 if self.odd else 1), strict=False
        ):
            c[: len(part)] += sign * np.maximum(part, 0.0)
        c = np.trunc(np.ldexp(c, BITS[1])) * 2.0 ** -BITS[1]
        causal, ahead = c.reshape(2, *at.causal.shape)
        q = float(found.x[n] / pace)
        return at._replace(slope=k, causal=causal, ahead=ahead, popov=q)


class _Points(NamedTuple):
    """Frequencies (K,), rad/s, and the response there."""

    omega: Array
    response: Array

    def joined(self, omega: Array, response: Array) -> _Points:
        """Return these and more, each frequency once."""
        both, first = np.unique(np.r_[self.omega, omega], return_index=True)
        return _Points(both, np.r_[self.response, response][first])


def _shortened(poles: Array) -> Array:
    """Return numbers with fewer bits."""
    m, e = np.frexp(poles)
    return np.ldexp(np.rint(np.ldexp(m, BITS[0])), e - BITS[0])
