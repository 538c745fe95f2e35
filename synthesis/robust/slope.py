"""Loops around one static function of bounded slope: multipliers of Popov, and of Zames and Falb.

For d = phi(v), phi(0) = 0, slopes of phi between 0 and k, v = G d with a stable G: the loop is
stable if for some multiplier M

    Re M(j w) (1/k - G(j w)) > 0   at every frequency,   M = 1 - H + q j w.

M = 1 is the circle criterion and q that of Popov; h, the impulse response of H on both sides of
time zero, has an integral of |h| below 1, and h >= 0 unless phi is odd. Here H is a sum of powers
of a/(s + a), found by a linear program over frequencies. Between them the eigenvalues of a
Hamiltonian matrix say where the inequality is lost, and these frequencies join the program.

Which of these eigenvalues are imaginary is decided by a tolerance. With lightly damped or slow
poles in mixed coordinates a crossing moves off the axis by more than the tolerance and is missed.
So a slope found here is computed, not verified.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import optimize
from scipy.linalg import block_diag

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.threads import with_one_thread
from symheli.values.signal import indices
from symheli.values.summary import summarized
from synthesis.numerics.linear.model import as_model

Array = np.ndarray

UNVERIFIED = "computed, not verified"
REASON = "frequencies are decided by eigenvalues in floating point and a tolerance"
"""Why no slope found here is a proof."""

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
LARGEST = 1e6
"""Largest slope, in units of the inverse of the norm of G, that is looked for."""
NORM = 1 - 1e-6
"""Largest integral of |h|."""
CROSSING = 1e-7
"""A real part of an eigenvalue below this share of its modulus counts as zero: the frequency then
joins the program.
"""
LEAST = 1e-9
"""The left side, by its largest size, counts as positive above this."""


class SlopeMargin(NamedTuple):
    """Functions of slopes from 0 to `slope` leave the loop stable, as computed; with the straight
    line of slope `limit` it is not stable (inf: no such line was found).

    `status` is always "computed, not verified": the inequality of the multiplier is held at the
    frequencies that eigenvalues in floating point and a tolerance point out. Where poles are
    lightly damped and coordinates badly mixed, `slope` may be too large by orders of magnitude.

    The multiplier is 1 - sum c (a/(s + a))^r + q s, with a/(a - s) for those that act ahead of
    time: `poles` a (rad/s), `causal` and `ahead` their c (powers, poles), `popov` q (s).
    """

    slope: float
    limit: float
    poles: Array
    causal: Array
    ahead: Array
    popov: float
    status: str = UNVERIFIED

    __repr__ = summarized

    @property
    def verified(self) -> bool:
        """False: a slope is computed, not proven."""
        return False

    def __str__(self) -> str:
        return (
            f"slopes from 0 to {self.slope:.6g}: stable ({self.status}: {REASON}); a line of slope"
            f" {self.limit:.6g} is not"
        )

    def multiplier(self, omega: Array) -> Array:
        """Return M (K,) at frequencies omega (K,), rad/s."""
        s = 1j * np.asarray(omega, float)
        E = _kernels(s, self.poles)
        both = np.hstack([E, E.conj()]) @ np.r_[self.causal.ravel(), self.ahead.ravel()]
        return 1 - both + self.popov * s


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
    """Compute the largest slope of a static function d = phi(v) for which the loop is stable
    whatever the function: a saturation, a dead zone, a soft stop. Computed, not verified.

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
        `slope` computed, not verified: frequencies are decided by eigenvalues and a tolerance. Plot
        Re M(j w) (1/k - G(j w)) about lightly damped poles before it is relied on. `limit` is where
        no proof can be.

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
    if model.dt is not None or not model.is_stable():
        raise InputError("model: expected a stable continuous one; close its loops first")
    if model.D[j, i] != 0 and criterion != "circle":
        raise InputError(f"expected no feedthrough from {input} to {output}: put a filter between")
    loop = _ScalarLoop(model.A, model.B[:, i], model.C[j], float(model.D[j, i]), criterion, odd)
    return loop.margin()


class _ScalarLoop(NamedTuple):
    """G = c (s - A)^-1 b + d, and the class of multipliers."""

    A: Array
    b: Array
    c: Array
    d: float
    criterion: str
    odd: bool

    def response(self, omega: Array) -> Array:
        """Return G (K,) at frequencies (K,)."""
        pencil = 1j * omega[:, None, None] * np.eye(len(self.A)) - self.A
        into = np.broadcast_to(self.b[:, None], (len(omega), len(self.b), 1))
        return np.linalg.solve(pencil, into)[..., 0] @ self.c + self.d

    def margin(self) -> SlopeMargin:
        """Search the largest slope between that of the small gain theorem and the limit."""
        paces = np.abs(np.linalg.eigvals(self.A))
        line = np.geomspace(paces.min() / 100, 100 * paces.max(), FREQUENCIES)
        size = np.abs(self.response(line)).max()
        poles = np.geomspace(paces.min() / 10, 10 * paces.max(), POLES)
        none = np.zeros((ORDER, POLES))
        found = SlopeMargin(math.inf, math.inf, poles, none, none, 0.0)
        if size == 0.0:
            return found
        found = found._replace(slope=0.0, limit=self._limit(0.5 / size, LARGEST / size))
        low, high = 0.5 / size, min(found.limit, LARGEST / size)
        k = high / math.sqrt(GROWTH)
        while high > GROWTH * low:
            made, line = self._found(k, found, line)
            low, high = (low, k) if made is None else (k, high)
            found, k = made or found, math.sqrt(low * high)
        if not found.slope:
            found = self._found(low, found, line)[0] or found
        return found

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

    def _found(self, k: float, at: SlopeMargin, line: Array) -> tuple[SlopeMargin | None, Array]:
        """Return a multiplier for the slope k, None where none is found, and the frequencies."""
        for _ in range(ROUNDS):
            trial = self._least(k, at, line)
            if trial is None:
                return None, line
            crossings = self._crossings(trial)
            if crossings is None:
                return None, line
            if not len(crossings):
                return trial, line
            between = np.sqrt(crossings[1:] * crossings[:-1])
            line = np.unique(np.r_[line, crossings, between])
        return None, line

    def _least(self, k: float, at: SlopeMargin, line: Array) -> SlopeMargin | None:
        """Return the multiplier with the largest least real part, relative to |1/k - G|."""
        F = 1 / k - self.response(line)
        size, s = np.abs(F), 1j * line
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
                    np.column_stack([-terms, -popov, np.ones(len(line))]),
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
            c[: len(part)] += sign * part
        causal, ahead = c.reshape(2, *at.causal.shape)
        return at._replace(slope=k, causal=causal, ahead=ahead, popov=float(found.x[n] / pace))

    def _crossings(self, trial: SlopeMargin) -> Array | None:
        """Return the frequencies at which the left side is zero; None where it is not positive at
        the highest.
        """
        a = np.tile(trial.poles, ORDER)
        n, m, q = len(self.A), len(a), len(trial.poles)
        chain = np.diag(a[q:], -q) - np.diag(a)
        A = np.array(block_diag(self.A, chain, chain))
        A[n : n + q, :n] = np.array(-np.outer(a[:q], self.c))  # filters of F, then of the input
        top = 1 / trial.slope - self.d
        first = np.r_[a[:q], np.zeros(m - q)]
        B = np.r_[self.b, first * top, first]
        u = np.r_[np.zeros(n + 2 * m), 1.0]
        F = np.r_[-self.c, np.zeros(2 * m), top]
        P = F - np.r_[np.zeros(n), trial.causal.ravel(), np.zeros(m), 0.0]
        if trial.popov:
            P = P - trial.popov * np.r_[self.c @ self.A, np.zeros(2 * m), self.c @ self.b]
        Q = np.r_[np.zeros(n + m), trial.ahead.ravel(), 0.0]
        W = 0.5 * (np.outer(u, P) + np.outer(P, u) - np.outer(Q, F) - np.outer(F, Q))
        R = W[-1, -1]
        if R <= LEAST * abs(top):
            return None
        S = W[:-1, -1:]
        flow = A - B[:, None] @ S.T / R
        values = np.linalg.eigvals(
            np.block([[flow, -np.outer(B, B) / R], [S @ S.T / R - W[:-1, :-1], -flow.T]])
        )
        near = np.abs(values.real) <= CROSSING * np.maximum(np.abs(values), 1e-6 * a.max())
        return np.unique(np.abs(values.imag[near]))
