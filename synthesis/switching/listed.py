"""Growth and gain of listed models that follow one another, or mix, in any way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive, whole
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.questions.questions import EFFORT
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.numerics.program.effort import Effort
from synthesis.switching.listed_inequality import Listed, holds
from synthesis.switching.listed_search import (
    DEGREES,
    LETTERS,
    Candidate,
    ListedSearch,
    gaining,
    growing,
    levels,
)

GROWTH, GAIN = "growth of listed models", "l2 gain of listed models"
NOTHING = Candidate(math.inf, np.zeros((0, 0, 0)), 0, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class ListedBound(ProvenStatement):
    """A bound that holds for every sequence, and every mixture, of listed models.

    Attributes
    ----------
    kind : str
        `GROWTH` or `GAIN`.
    bound : float
        Proven. Of growth: sampled the factor a sample, which is at least the joint spectral radius;
        in continuous time an exponent, 1/s. Of the gain: in units of y per unit of u.
    lower : float
        Computed: what the modes of `word` in turn attain, each for its `times` (s; samples).
    candidate : Candidate
        P, the letters of the words that it depends on, the degree of the monomials.
    models : Listed
        The matrices, stacked.
    left : tuple of str
        Forms of P that were left untried.

    Examples
    --------
    >>> found = synthesis.switching.growth_rate([[[0.5, 1.0], [0.0, 0.5]], [[0.5]*2]*2], dt=1.0)
    >>> found.verify(), found.word
    (True, (1,))
    """

    kind: str
    value: float
    lower: float
    word: tuple[int, ...]
    times: tuple[float, ...]
    candidate: Candidate
    models: Listed
    left: tuple[str, ...] = ()
    verified: bool = False
    why: str = ""

    reader: ClassVar[str] = "listed-models"

    __repr__ = summarized

    @property
    def bound(self) -> float:
        """The proven number."""
        return self.value

    @property
    def P(self) -> Array:
        """Matrices (words, m, m) of V, m monomials of the states."""
        return self.candidate.P

    def verify(self, rigorous: bool = True) -> bool:
        """Check the inequalities again, in rational arithmetic always."""
        c = self.candidate
        if not len(c.P) or not math.isfinite(self.value):
            return False
        return holds(self.models, c.P, c.letters, self.value, c.degree, self.kind == GAIN)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        if self.kind == GAIN:
            return f"the energy of the outputs is at most {self.value!r}^2 times that of the inputs"
        if self.models.dt is None:
            return f"every state stays below a constant times exp({self.value!r} t), t in s"
        return f"every state stays below a constant times {self.value!r}^k after k samples"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, made from the numbers of the proof."""
        count, n = self.models.A.shape[:2]
        dt = self.models.dt
        time = "in continuous time" if dt is None else f"sampled every {dt!r} s"
        return (
            f"{count} linear models of {n} states, {time}, with the matrices in the file",
            "any of them, or any mixture of them, acts at every time",
        )

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind and bounds as data that JSON holds."""
        return {"kind": self.kind, "bound": self.value, "lower": self.lower}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the models and P."""
        if not self.verified:
            raise InputError(f"only a proven bound is saved; here {self.why}")
        c = self.candidate
        return {
            "kind": self.kind,
            "bound": encoded(self.value),
            "lower": encoded(self.lower),
            "word": list(self.word),
            "times": [float(t) for t in self.times],
            "letters": c.letters,
            "degree": c.degree,
            "P": encoded(c.P),
            **{name: encoded(getattr(self.models, name)) for name in "ABCD"},
            "dt": self.models.dt,
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> ListedBound:
        """Return the bound of a file, proven anew."""
        dt, kind = content["dt"], content["kind"]
        shape = (None, None, None)
        A, B, C, D = (frozen(decoded(content[name]), name, shape) for name in "ABCD")
        models = _checked(Listed(A, B, C, D, None if dt is None else positive(dt, "dt")))
        letters = whole(content["letters"], "letters", 0)
        degree = whole(content["degree"], "degree", 1)
        count, n = models.A.shape[:2]
        m = math.comb(n + degree - 1, degree)
        lettered, risen = (
            letters > (LETTERS if dt else 0),
            degree > (DEGREES if kind == GROWTH else 1),
        )
        if kind not in (GROWTH, GAIN) or lettered or risen:
            raise InputError("the file holds no bound of listed models of a known form")
        P = frozen(decoded(content["P"]), "P", (count**letters, m, m))
        found = cls(
            kind=kind,
            value=float(decoded(content["bound"])),
            lower=float(decoded(content["lower"])),
            word=tuple(int(i) for i in content["word"]),
            times=tuple(float(t) for t in content["times"]),
            candidate=Candidate(float(decoded(content["bound"])), P, letters, degree),
            models=models,
            why="the inequalities do not hold in exact arithmetic",
        )
        return replace(found, verified=True, why="") if found.verify() else found

    def __str__(self) -> str:
        what = "gain" if self.kind == GAIN else "growth"
        unit = "" if self.kind == GAIN else " 1/s" if self.models.dt is None else " a sample"
        after = f"modes {', '.join(map(str, self.word))} in turn"
        lines = [f"{self.lower:.6g} ({after}, computed) <= {what} <= {self.value:.6g}{unit}"]
        if self.verified:
            c = self.candidate
            form = f"monomials of degree {c.degree}" if c.degree > 1 else "V = x'Px"
            lines.append(f"  proven: {form}, P of {len(c.P)} word(s) of {c.letters} letter(s)")
        else:
            lines.append(f"  nothing is proven: {self.why}")
        return "\n".join([*lines, *(f"  {each}" for each in self.left)])


@with_one_thread
def growth_rate(
    models: Sequence[Any],
    *,
    dt: float | None = None,
    effort: float = EFFORT,
    solver: Solver | str = "CLARABEL",
) -> ListedBound:
    """Bound the growth of listed models in any order: the joint spectral radius, or an exponent in
    1/s.

    From above by V of words of modes and of monomials of the states, verified exactly; from below
    by products. Growth below one a sample, or below 0 1/s, is decay.

    Parameters
    ----------
    models : sequence of LinearModel or array (n, n)
        Of the same states and sample period.
    dt : float, optional
        Sample period of arrays, s; None: continuous time. Models have their own.
    effort : float
        Work, in seconds of one common core; the result names what was left untried.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    ListedBound
        `bound` is proven, `lower` attained.

    Raises
    ------
    InputError
        No models, or such of different sizes or sample periods.

    See Also
    --------
    synthesis.switching.dwell_time : how long each mode must last
    synthesis.decay_rate : decay while a parameter moves

    References
    ----------
    Jungers, "The Joint Spectral Radius" (2009); Ahmadi, Jungers, Parrilo and Roozbehani, SIAM J.
    Control and Optimization 52 (2014).

    Examples
    --------
    The pair of the golden ratio, 1.6180:

    >>> pair = [[[1.0, 1.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]]]
    >>> found = synthesis.switching.growth_rate(pair, dt=1.0)
    >>> print(f"{found.lower:.4f} <= growth <= {found.bound:.4f}, proven: {found.verified}")
    1.6180 <= growth <= 1.6181, proven: True
    """
    own = _listed(models, dt)
    low = growing(own)
    search = ListedSearch(own, general_solver(solver), Effort.of(effort))
    size = search.size(low.level)
    found = _nothing(GROWTH, own, low.level, low.word, low.times)
    for candidate in search.growth(low.level):
        found = _proven(found, candidate, size, search.effort)
    return replace(found, left=tuple(search.left))


@with_one_thread
def listed_gain(
    models: Sequence[LinearModel],
    *,
    effort: float = EFFORT,
    solver: Solver | str = "CLARABEL",
) -> ListedBound:
    """Certify the L2 gain of listed models in any order: P constant or, sampled, of words of modes.

    Parameters
    ----------
    models : sequence of LinearModel
        Of the same states, inputs, outputs and sample period.
    effort, solver
        As of `growth_rate`.

    Returns
    -------
    ListedBound
        `bound` is proven, in units of y per unit of u, `lower` attained.

    Raises
    ------
    InputError
        As of `growth_rate`, and models without inputs or outputs.

    See Also
    --------
    synthesis.l2_gain : gain of a model whose parameters move at limited rates

    References
    ----------
    Daafouz and Bernussou, Systems and Control Letters 43 (2001).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> lags = [LinearModel([[a]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"], dt=1.0)
    ...         for a in (-0.5, 0.5)]
    >>> found = synthesis.switching.listed_gain(lags)
    >>> print(f"{found.lower:.3f} <= gain <= {found.bound:.3f}")
    2.000 <= gain <= 2.000
    """
    own = _listed(models, None)
    if not own.B.shape[-1] or not own.C.shape[-2]:
        raise InputError("a gain needs inputs and outputs; use growth_rate without channels")
    search = ListedSearch(own, general_solver(solver), Effort.of(effort))
    low = gaining(own)
    found = _nothing(GAIN, own, low.level, low.word, low.times)
    if math.isinf(low.level):
        return replace(found, why=f"the model of modes {low.word} in turn is not stable")
    for candidate in search.gain(low.level):
        found = _proven(found, candidate, low.level or 1e-6, search.effort)
    return replace(found, left=tuple(search.left))


def _proven(found: ListedBound, by: Candidate, size: float, effort: Effort) -> ListedBound:
    """Return the better of a bound and what a candidate proves."""
    for level in levels(by.level, size):
        if level >= found.value:
            return found
        tried = replace(found, value=level, candidate=by, why="")
        if tried.verify():
            effort.proven = True
            return replace(tried, verified=True)
    return found


def _nothing(
    kind: str, models: Listed, lower: float, word: tuple[int, ...], times: tuple[float, ...]
) -> ListedBound:
    why = "the inequalities have no solution that passes the exact check"
    return ListedBound(
        kind=kind,
        value=math.inf,
        lower=lower,
        word=word,
        times=times,
        candidate=NOTHING,
        models=models,
        why=why,
    )


def _listed(given: Sequence[Any], dt: float | None) -> Listed:
    if not isinstance(given, Sequence | np.ndarray) or len(given) == 0:
        raise InputError("models: expected a list of at least one model or matrix")
    period = None if dt is None else positive(dt, "dt")
    each = [_matrices(one, period) for one in given]
    if len({tuple(M.shape for M in one[:4]) for one in each}) > 1:
        raise InputError("models: expected the same states, inputs and outputs of all")
    if len({one[4] for one in each}) > 1:
        raise InputError("models: expected one sample period of all")
    A, B, C, D = (np.array([one[k] for one in each]) for k in range(4))
    return _checked(Listed(A, B, C, D, each[0][4]))


def _matrices(given: Any, dt: float | None) -> tuple[Array, Array, Array, Array, float | None]:
    if isinstance(given, LinearModel):
        return given.A, given.B, given.C, given.D, given.dt
    A = frozen(given, "model", (None, None))
    n = len(A)
    frozen(A, "model", (n, n))
    return A, np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, 0)), dt


def _checked(own: Listed) -> Listed:
    count, n = own.A.shape[:2]
    nu, ny = own.B.shape[-1], own.C.shape[-2]
    shapes = {"A": (count, n, n), "B": (count, n, nu), "C": (count, ny, n), "D": (count, ny, nu)}
    return own.changed(lambda name, M: frozen(M, name, shapes[name]))
