"""Candidates for V of listed models, by semidefinite programs, and products that bound it from
below.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import linalg, optimize

from symheli.progress import task
from symheli.values.arrays import Array
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.program.affine_program import CONSTANT, POINT, AffineProgram
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, solve
from synthesis.numerics.program.effort import Effort, work
from synthesis.switching.listed_inequality import Listed, Word, lifted, words

SPARE = 1e-7
"""Least multiple of the identity that a candidate leaves in every inequality, P at most one."""
CLOSE = 1e-4
"""Relative distance of the bounds at which the search ends."""
ACCURACY = 2e-5
"""Relative accuracy of a level."""
PRODUCTS, KEPT, LONGEST = 20_000, 500, 24
"""Products of one length up to which all are looked at, those kept of more, and the longest."""
LETTERS, DEGREES, MONOMIALS = 5, 8, 84
"""Most letters of a word, highest degree of the monomials, and most of them."""
BACK_OFFS = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""Relative back-offs of a level until the exact check passes."""


class Attained(NamedTuple):
    """A level that the modes of `word` in turn attain, each for its `times` (s, or samples)."""

    level: float
    word: Word
    times: tuple[float, ...]


class Candidate(NamedTuple):
    """P (words, n, n) of words of so many letters, for monomials of this degree, at a level."""

    level: float
    P: Array
    letters: int
    degree: int


def balanced(models: Listed) -> tuple[Listed, Array]:
    """Return the models in units of the states in which they are of one size, and the units (n,),
    powers of two.
    """
    size = np.abs(models.A).sum(axis=0)
    _, (units, _) = linalg.matrix_balance(size, permute=False, separate=True)
    B, C = models.B / units[:, None], models.C * units
    return models._replace(A=models.A * units / units[:, None], B=B, C=C), units


def growing(models: Listed) -> Attained:
    """Return the fastest growth found: a factor a sample, or an exponent, 1/s."""
    return _sampled(models.A) if models.dt is not None else _continuous(models.A)


def _radius(M: Array) -> Array:
    return np.abs(np.linalg.eigvals(M)).max(axis=-1)


def _sampled(A: Array) -> Attained:
    """Return the largest root of the spectral radius of a product."""
    count, best = len(A), Attained(0.0, (0,), (1.0,))
    each, made = A, [(i,) for i in range(count)]
    for length in range(1, LONGEST + 1):
        found = _radius(each) ** (1.0 / length)
        i = int(np.argmax(found))
        if found[i] > best.level * (1 + 1e-12):
            best = Attained(float(found[i]), made[i][::-1], (1.0,) * length)
        if len(each) * count > PRODUCTS:
            size = np.linalg.norm(each, axis=(1, 2))
            keep = np.argsort(size)[::-1][:KEPT]
            each, made = each[keep], [made[i] for i in keep]
        each = (each[:, None] @ A[None]).reshape(-1, *A.shape[1:])
        made = [(*word, i) for word in made for i in range(count)]
        largest = float(np.abs(each).max())
        if not 1e-200 < largest < 1e200:
            break
    return best


def _continuous(A: Array) -> Attained:
    """Return the largest exponent of one mode, or of a cycle of two or three."""
    own = np.linalg.eigvals(A).real.max(axis=-1)
    best = Attained(float(own.max()), (int(own.argmax()),), (1.0,))
    pace = 1.0 / max(float(np.abs(np.linalg.eigvals(A)).max()), 1e-300)
    cycles = [w for k in (2, 3) for w in words(len(A), k) if w[0] == min(w)]
    cycles = [w for w in cycles if all(w[i] != w[i - 1] for i in range(len(w)))]
    for word in cycles[:40]:

        def grown(log: Array, word: Word = word) -> float:
            times = pace * np.exp(np.clip(log, -12.0, 6.0))
            through = np.eye(len(A[0]))
            for i, t in zip(word, times, strict=True):
                through = linalg.expm(A[i] * t) @ through
            radius = float(_radius(through))
            return -math.log(radius) / times.sum() if radius > 0 else math.inf

        for start in (-1.0, 0.5):
            first = np.full(len(word), start)
            found = optimize.minimize(grown, first, method="Nelder-Mead", options={"maxiter": 200})
            if -found.fun > best.level + 1e-9 * abs(best.level):
                times = tuple(pace * np.exp(np.clip(found.x, -12.0, 6.0)))
                best = Attained(float(-found.fun), word, times)
    return best


def gaining(models: Listed) -> Attained:
    """Return the largest gain found of one model or, sampled, of a sequence that repeats."""
    best = Attained(0.0, (0,), (1.0,))
    lengths = (1,) if models.dt is None else (1, 2, 3, 4, 6)
    for length in lengths:
        every = words(len(models.A), length)
        if len(every) > KEPT:
            break
        for word in every:
            level = norm(*_repeated(models, word), models.dt)[0]
            if level > best.level * (1 + 1e-12):
                best = Attained(float(level), word, (1.0,) * length)
    return best


def _repeated(models: Listed, word: Word) -> tuple[Array, Array, Array, Array]:
    """Return the model of all inputs and outputs of one turn of a sequence."""
    A, B, C, D = (M[list(word)] for M in models.matrices)
    if len(word) == 1:
        return A[0], B[0], C[0], D[0]
    nu, ny, k = B.shape[-1], C.shape[-2], len(word)
    through, into = np.eye(A.shape[-1]), np.zeros((A.shape[-1], k * nu))
    rows, feed = [], np.zeros((k * ny, k * nu))
    for i in range(k):
        rows.append(C[i] @ through)
        feed[i * ny : (i + 1) * ny] = C[i] @ into
        feed[i * ny : (i + 1) * ny, i * nu : (i + 1) * nu] = D[i]
        through, into = A[i] @ through, A[i] @ into
        into[:, i * nu : (i + 1) * nu] = B[i]
    return through, into, np.vstack(rows), feed


class ListedSearch:
    """The least level that a V proves, in the form and the units of the `models`."""

    def __init__(self, models: Listed, solver: Solver, effort: Effort) -> None:
        self.models, self.units = balanced(models)
        self.solver, self.effort = solver, effort
        self.lifted = cache(self.models.lifted)
        self.left: list[str] = []

    def forms(self, gain: bool) -> Iterator[tuple[int, int]]:
        """Yield letters and degree of V, the cheapest first."""
        sampled = self.models.dt is not None
        most = LETTERS if sampled and len(self.models.A) > 1 else 0
        n, count = self.models.A.shape[-1], len(self.models.A)

        def rows(degree: int) -> int:
            return math.comb(n + degree - 1, degree)

        degrees = [d for d in range(1, 1 if gain else DEGREES + 1) if rows(d) <= MONOMIALS] or [1]
        every = [(k, d) for k in range(most + 1) for d in degrees]
        yield from sorted(every, key=lambda f: count ** f[0] * rows(f[1]) ** 3)

    def growth(self, low: float) -> Iterator[Candidate]:
        """Yield candidates of ever smaller growth, until one is next to `low`."""
        best = math.inf
        with task("searching a bound of growth") as progress:
            for letters, degree in self.forms(gain=False):
                found = self._least(letters, degree, low, best)
                progress.step(f"words of {letters}, degree {degree}")
                if found is None:
                    continue
                if found.level < best:
                    best = found.level
                    yield found
                if best - low <= CLOSE * self.size(low):
                    return

    def size(self, level: float) -> float:
        """Return what a level is compared with: of an exponent at least the pace of the modes."""
        if self.models.dt is not None:
            return max(abs(level), 1e-12)
        return max(abs(level), float(np.abs(np.linalg.eigvals(self.models.A)).max()), 1e-12)

    def _least(self, letters: int, degree: int, low: float, best: float) -> Candidate | None:
        """Return the least level of one form, by bisection; None where it is not below `best`."""
        size = self.size(low)
        if math.isinf(best):
            high, found = low + size, None
            for _ in range(40):
                found = self._at(letters, degree, high)
                if found is not None:
                    break
                high = low + 2 * (high - low)
            if found is None:
                return None
        else:
            high = best - ACCURACY * size
            found = self._at(letters, degree, high)
            if found is None:
                return None
        while high - low > ACCURACY * size:
            middle = 0.5 * (low + high)
            other = self._at(letters, degree, middle)
            low, high, found = (middle, high, found) if other is None else (low, middle, other)
        return found

    def _at(self, letters: int, degree: int, level: float) -> Candidate | None:
        """Return P at a level, None where there is none with something to spare."""
        models = self.lifted(degree)
        sampled = models.dt is not None
        if sampled:  # of growth one a sample
            models = models._replace(A=models.A / level**degree)
        program, P = AffineProgram(), []
        n, count = models.A.shape[-1], len(models.A)
        P = [program.symmetric(n, CONSTANT) for _ in range(count**letters)]
        last = program.variable(np.ones((1, 1, 1)), CONSTANT)
        spare = program.value(last) * np.eye(n)
        values = [program.value(each) for each in P]
        place = {word: i for i, word in enumerate(words(count, letters))}
        scale = 1.0 if sampled else degree * self.size(0.0)
        for own in values:
            program.positive(POINT, program.known(np.eye(n)) - own)
            program.positive(POINT, own - spare)
        for word in words(count, letters + 1 if sampled else 1):
            A = models.A[word[0]]
            own, after = values[place[word[:letters]]], values[place[word[1:] if letters else ()]]
            moved = A.T @ own + own @ A
            form = own - A.T @ after @ A if sampled else (2 * degree * level * own - moved) / scale
            program.positive(POINT, form - spare)
        cost = np.zeros(program.count)
        cost[last.columns.ravel()] = -1.0
        x = self._solved(program, cost, f"words of {letters} letters, degree {degree}")
        if x is None or x[last.columns.ravel()][0] < SPARE:
            return None
        back = lifted(np.diag(1.0 / self.units), degree, True)
        each = np.array([back.T @ one.coefficients(x)[0] @ back for one in P])
        return Candidate(level, 0.5 * (each + each.transpose(0, 2, 1)), letters, degree)

    def gain(self, low: float) -> Iterator[Candidate]:
        """Yield candidates of ever smaller gains, until one is next to `low`."""
        best = math.inf
        with task("searching a gain") as progress:
            for letters, _ in self.forms(gain=True):
                found = self._gain(letters, low)
                progress.step(f"words of {letters} letters")
                if found is None:
                    continue
                gained, best = best - found.level, min(best, found.level)
                if gained > 0:
                    yield found
                if best - low <= CLOSE * low or (letters > 1 and gained <= CLOSE * best):
                    return

    def _gain(self, letters: int, low: float) -> Candidate | None:
        models, unit = self.models, low or 1.0
        models = models._replace(C=models.C / unit, D=models.D / unit)
        program = AffineProgram()
        count, n = models.A.shape[:2]
        nu = models.B.shape[-1]
        own = [program.symmetric(n, CONSTANT) for _ in range(count**letters)]
        level = program.variable(np.ones((1, 1, 1)), CONSTANT)
        values = [program.value(each) for each in own]
        g = program.value(level)
        for each in values:
            program.positive(POINT, each)
        place = {word: i for i, word in enumerate(words(count, letters))}
        for word in words(count, letters + 1 if models.dt is not None else 1):
            A, B, C, D = (M[word[0]] for M in models.matrices)
            before = values[place[word[:letters]]]
            after = values[place[word[1:] if letters else ()]]
            J = np.hstack([A, B])
            first = np.hstack([np.eye(n), np.zeros((n, nu))])
            last = np.hstack([np.zeros((nu, n)), np.eye(nu)])
            if models.dt is None:
                change = -(first.T @ before @ J + J.T @ before @ first)
            else:
                change = first.T @ before @ first - J.T @ after @ J
            CD = np.hstack([C, D])
            supply = last.T @ (g * np.eye(nu)) @ last - program.known(CD.T @ CD)
            program.positive(POINT, change + supply)
        cost = np.zeros(program.count)
        cost[level.columns.ravel()] = 1.0
        x = self._solved(program, cost, f"words of {letters} letters")
        if x is None or not x[level.columns.ravel()][0] > 0:
            return None
        back = unit / self.units
        P = np.array([one.coefficients(x)[0] * np.outer(back, back) for one in own])
        gamma = unit * math.sqrt(float(x[level.columns.ravel()][0]))
        return Candidate(gamma, 0.5 * (P + P.transpose(0, 2, 1)), letters, 1)

    def _solved(self, program: AffineProgram, cost: Array, name: str) -> Array | None:
        cone = program.cone_program(cost)
        refused = self.effort.refused(work(cone))
        if refused:
            if not any(each.startswith(name) for each in self.left):
                self.left.append(f"{name}: {refused}")
            return None
        found = solve(cone, self.solver)
        return None if found.answer is Answer.INFEASIBLE else found.x


def levels(level: float, size: float) -> Iterator[float]:
    """Yield the level with ever larger back-offs."""
    yield level
    for back_off in BACK_OFFS:
        yield level + back_off * size
