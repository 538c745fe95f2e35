"""The dwell time for which a switched linear model is proven stable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy import linalg

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.riccati import lyapunov
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive, whole
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.program.affine_program import CONSTANT, POINT, AffineProgram
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.switching.inequality import DEGREE, Modes, holds, long_enough

SPARE = 1e-8
"""Least multiple of the identity that a candidate leaves in every inequality, P of at most one in
coordinates in which the modes' own P add up to it and the slowest mode decays at rate one.
"""
FLOOR = 1e-4
"""Part of P that stays in P(t) while the rest moves: room for the rounding of what fast modes leave
of that.
"""
SHORT = 1 / 8
"""Part of a given dwell time that is tried first: a shorter one covers it, with less to check."""
SPARE_DECAYS = (0.002, 0.02, 0.1, 0.3, 0.6)
"""Fractions of the decay rate of the slowest mode by which V falls faster than it must: room for
cubic functions of time; tried in turn.
"""
FINER = 4
"""Factor of the number of segments where the first number is too small."""
DECAYS = (0.3, 0.5, 0.7, 0.85, 0.95, 0.99)
"""Fractions of it that are tried for an average dwell time, and where A moves with p."""
ACCURACY = 1e-3
"""Relative accuracy of the least dwell time."""
LEAST_RADIUS = 1e-3
"""Spectral radius of a sampled mode below which it counts as one of this: a nilpotent mode has no
decay rate, and fractions of one that is too large leave no P.
"""
LONGEST, LARGEST_GROWTH = 1e4, 1e6
"""Longest dwell time that is tried, in time constants of the slowest mode, and largest mu."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DwellTime(ProvenStatement):
    """The dwell time for which a switched model is proven exponentially stable.

    Attributes
    ----------
    seconds : float
        The dwell time, s; inf where none was proven.
    average : bool
        Whether every signal whose average dwell time is longer is covered (bursts of any number of
        switches), or every signal that stays at least so long in each mode.
    verified : bool
        Checked in rational arithmetic, see `synthesis.switching.inequality`.
    P : tuple of array
        Of every mode: Bernstein coefficients (3 K + 1, n, n) over time; sampled (samples + 1, n,
        n).
    lengths : array (K,)
        Of the segments of time, s; sampled: ones.
    decay, growth : float
        lambda, 1/s (sampled: the part of V lost in a sample), and mu of an average dwell time.
    modes : Modes
        What it is proven of.
    why : str
        Why there is no proof.

    Examples
    --------
    x' = -x, and at every switch x triples: it must fall by as much before.

    >>> import numpy as np
    >>> three = {(0, 1): [[3.0]], (1, 0): [[3.0]]}
    >>> found = synthesis.switching.dwell_time([[[-1.0]], [[-1.0]]], three)
    >>> bool(np.log(3) < found.seconds < 1.005 * np.log(3)), found.verified
    (True, True)
    """

    seconds: float
    average: bool
    verified: bool
    P: tuple[Array, ...]
    lengths: Array
    decay: float
    growth: float
    modes: Modes
    why: str = ""

    reader: ClassVar[str] = "dwell-time"

    __repr__ = summarized

    def verify(self, rigorous: bool = True) -> bool:
        """Check it again from the numbers it has, in rational arithmetic always."""
        return (
            len(self.P) > 0
            and self.average == (not len(self.lengths))
            and long_enough(self.seconds, self.lengths, self.decay, self.growth, self.modes.dt)
            and holds(self.modes, self.P, self.lengths, self.decay, self.growth)
        )

    @property
    def bound(self) -> float:
        """The dwell time, s."""
        return self.seconds

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        signals = (
            f"whose average dwell time is above {self.seconds:.6g} s"
            if self.average
            else f"that stays at least {self.seconds:.6g} s in each mode"
        )
        return f"exponentially stable for every signal {signals}"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        dt = self.modes.dt
        time = "in continuous time" if dt is None else f"sampled every {dt!r} s"
        n = self.modes.A[0][0].shape[0]
        pairs = ", ".join(f"{i} to {j}" for i, j in sorted(self.modes.jumps))
        ranges = [
            f"A of mode {i} is anywhere in its range at every time, over {len(own[0].box)}"
            f" parameter(s) in {len(own)} piece(s)"
            for i, own in enumerate(self.modes.A)
            if any(any(piece.degrees) for piece in own)
        ]
        return (
            f"{len(self.modes.A)} linear modes of {n} states, {time}",
            f"switches happen from {pairs or 'no mode to another'}, with the jumps in the file",
            *ranges,
        )

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        kind = "average dwell time" if self.average else "dwell time"
        return {"kind": kind, "seconds": self.seconds, "modes": len(self.modes.A)}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: modes, jumps and P, as JSON holds them."""
        if not self.verified:
            raise InputError(f"only a proven dwell time is saved; here {self.why}")
        names = ("seconds", "average", "P", "lengths", "decay", "growth")
        jumps = [[i, j, encoded(np.array(J))] for (i, j), J in self.modes.jumps.items()]
        return {
            "kind": self.facts["kind"],
            **{name: encoded(getattr(self, name)) for name in names},
            "modes": [encoded(each) for each in self.modes.A],
            "jumps": jumps,
            "dt": self.modes.dt,
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> DwellTime:
        """Return the dwell time of a file, proven anew."""
        values = {name: decoded(content[name]) for name in ("P", "lengths")}
        numbers = {name: float(content[name]) for name in ("seconds", "decay", "growth")}
        A = tuple(decoded(each) for each in content["modes"])
        n = A[0][0].shape[0]
        for piece in (piece for each in A for piece in each):
            if not isinstance(piece, PolynomialMatrix) or piece.shape != (n, n):
                raise InputError("modes: expected square polynomial matrices of one size")
        jumps = {
            (int(i), int(j)): frozen(decoded(J), "jump", (n, n)) for i, j, J in content["jumps"]
        }
        if not all(i != j and {i, j} <= set(range(len(A))) for i, j in jumps):
            raise InputError("jumps: expected pairs of different modes")
        dt = content["dt"]
        modes = Modes(A, jumps, None if dt is None else positive(dt, "dt"))
        P = tuple(frozen(M, "P", (None, n, n)) for M in values["P"])
        own = len(values["lengths"])
        count = own + 1 if dt is not None else DEGREE * own + 1
        if len(P) != len(A) or any(len(M) != count for M in P):
            raise InputError(f"P: expected {count} matrices of each of {len(A)} modes")
        found = cls(
            average=content["average"] is True, verified=False, P=P,
            lengths=frozen(values["lengths"], "lengths", (None,)), modes=modes,
            why="the inequalities do not hold in exact arithmetic", **numbers,
        )  # fmt: skip
        return replace(found, verified=True, why="") if found.verify() else found

    def __str__(self) -> str:
        kind = "average dwell time" if self.average else "dwell time"
        return f"proven: {self.claim}" if self.verified else f"no {kind} proven: {self.why}"


@with_one_thread
def dwell_time(
    modes: Sequence[Any],
    jumps: Mapping[tuple[int, int], Any] | None = None,
    *,
    average: bool = False,
    within: float | None = None,
    parts: int = 32,
    dt: float | None = None,
    solver: Solver | str = "CLARABEL",
) -> DwellTime:
    """Prove the least time that a switched linear model must stay in each mode to be stable.

    Parameters
    ----------
    modes : sequence of LinearModel, LPVStateSpace or array (n, n)
        Of n states each, stable; of a model over p, p moves within its range in any way.
    jumps : mapping of (int, int) to array (n, n), optional
        {(from, to): x after over x before}, for every switch that may happen; default: all of them,
        and the state goes on.
    average : bool
        Of an average dwell time, with one constant P for each mode.
    within : float, optional
        Prove that dwell time, s, or a shorter one, instead of the least.
    parts : int
        Number of segments of continuous time in which P(t) is cubic.
    dt : float, optional
        Sample period of arrays, s; models have their own.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    DwellTime
        Where nothing is proven `seconds` is inf, and `why` says why.

    Raises
    ------
    InputError
        Modes of different states or sample periods, jumps to modes that are not there.

    References
    ----------
    Allerhand and Shaked (2011); Geromel and Colaneri (2006); Hespanha and Morse (1999).

    Examples
    --------
    The example of Geromel and Colaneri (2006); the least is 2.7508 s.

    >>> A1, A2 = [[0.0, 1.0], [-10.0, -1.0]], [[0.0, 1.0], [-0.1, -0.5]]
    >>> print(synthesis.switching.dwell_time([A1, A2], within=2.8))
    proven: exponentially stable for every signal that stays at least 2.8 s in each mode
    """
    solver = general_solver(solver)
    own = _modes(modes, jumps, dt)
    parts = whole(parts, "parts", 1)
    if within is not None:
        within = positive(within, "within")
    search = _ModeSearch(own, parts, solver)
    if search.unstable:
        return _none(own, average, f"mode {search.unstable} is not stable")
    if average:
        found = search.average()
        if within is None or found is None:
            return found or _refused(own, True)
        too_long = found.seconds > within
        return _none(own, True, f"{found.seconds:g} s were proven") if too_long else found
    found = search.least() if within is None else search.at(SHORT * within) or search.at(within)
    return found or _refused(own, False)


SOLVED_NONE = "the inequalities have no solution that passes the exact check"


def _refused(modes: Modes, average: bool) -> DwellTime:
    """No proof, with what may bring one: continuous P(t) has parts, sampled P has every sample."""
    more = "" if average or modes.dt is not None else "; try more parts"
    return _none(modes, average, SOLVED_NONE + more)


def _none(modes: Modes, average: bool, why: str) -> DwellTime:
    none = np.zeros(0)
    return DwellTime(
        seconds=math.inf,
        average=average,
        verified=False,
        P=(),
        lengths=none,
        decay=0.0,
        growth=1.0,
        modes=modes,
        why=why,
    )


def _modes(given: Sequence[Any], jumps: Mapping[Any, Any] | None, dt: float | None) -> Modes:
    models = [_model(one, dt) for one in given]
    if not models:
        raise InputError("modes: expected at least one")
    n, period = len(models[0].states), models[0].dt
    if any(len(m.states) != n or m.dt != period for m in models):
        sizes = ", ".join(f"{len(m.states)} states, dt {m.dt}" for m in models)
        raise InputError(f"modes: expected the same states and sample period of all, got {sizes}")
    count = range(len(models))
    every = {(i, j): np.eye(n) for i in count for j in count if i != j}
    resets = every if jumps is None else dict(jumps)
    if wrong := [key for key in resets if key not in every]:
        raise InputError(f"jumps: {wrong[0]!r} is no pair of different modes of {len(models)}")
    own = {key: frozen(J, f"jump {key}", (n, n)) for key, J in resets.items()}
    A = tuple(tuple(M[0] for M in pieces(m).models.values()) for m in models)
    return Modes(A, own, period)


def _model(given: Any, dt: float | None) -> LPVStateSpace:
    if isinstance(given, LPVStateSpace):
        return given
    if not isinstance(given, LinearModel):
        A = frozen(given, "mode", (None, None))
        n = len(A)
        names = tuple(Signal(f"x{i}") for i in range(n))
        given = LinearModel(
            frozen(A, "mode", (n, n)), np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, 0)),
            names, (), (), dt,
        )  # fmt: skip
    return LPVStateSpace.constant(given)


class _ModeSearch:
    """Candidates by semidefinite programs in one P a mode, each verified before it is returned."""

    def __init__(self, modes: Modes, parts: int, solver: Solver) -> None:
        self.modes, self.parts, self.solver = modes, parts, solver
        self.corners = [[A for F in each for A in F.coefficients.reshape(-1, *F.shape)]
                        for each in modes.A]  # fmt: skip
        self.middle = [np.mean(each, axis=0) for each in self.corners]
        self.fixed = [all(np.array_equal(A, each[0]) for A in each) for each in self.corners]
        rates = [_decay(A, modes.dt) for A in self.middle]
        self.unstable = next((str(i) for i, rate in enumerate(rates) if not rate > 0), "")
        self.rate = min(rates)
        self.T = np.eye(len(self.middle[0])) if self.unstable else self._first()

    def least(self) -> DwellTime | None:
        """Return the least dwell time that is proven, to `ACCURACY`, by bisection."""
        shortest = 0.0 if self.modes.dt is None else self.modes.dt
        low, high = 0.0, max(1.0 / self.rate, shortest)
        while (best := self.at(high)) is None:
            low, high = high, 4 * high
            if high * self.rate > LONGEST:
                return None
        while best.seconds - low > max(ACCURACY * best.seconds, ACCURACY / self.rate, shortest):
            middle = max(0.5 * (low + best.seconds), shortest)
            found = self.at(middle)
            low, best = (middle, best) if found is None else (low, found)
        return best

    def at(self, seconds: float) -> DwellTime | None:
        """Return a proof of at most this dwell time; None: none was found."""
        dt = self.modes.dt
        if dt is not None:
            steps = math.floor(seconds / dt * (1 + 1e-9))
            if steps < 1:
                return None  # every switch comes after a sample at least
            seconds = math.nextafter(steps * dt, math.inf)  # not below the exact product
        fixed = all(self.fixed)
        fractions = SPARE_DECAYS if fixed else DECAYS
        if dt is not None:
            fractions = (0.0, *fractions)  # no cubic function of time that would need the room
        for fraction in fractions:
            decay = fraction * self.rate
            motions = [self._motion(i, decay) for i in range(len(self.middle))]
            P = self._candidate(decay, [self._through(G, seconds) for G in motions], 1.0 + FLOOR)
            if P is None and fixed:
                return None  # less is left with every larger decay
            for finer in () if P is None else (1, FINER) if dt is None else (1,):
                lengths = self._graded(seconds, finer) if dt is None else np.ones(steps)
                paths = (self._path(*one, lengths) for one in zip(P or [], motions, strict=True))
                found = replace(
                    _none(self.modes, False, ""), seconds=seconds, lengths=lengths, P=tuple(paths)
                )
                if found.verify():
                    return replace(found, verified=True)
        return None

    def average(self) -> DwellTime | None:
        """Return the least average dwell time of the decay rates that are tried."""
        best, dt, none = None, self.modes.dt, np.zeros(0)
        for fraction in DECAYS:
            rate = fraction * self.rate
            low, high = 1.0, LARGEST_GROWTH
            P = None
            while math.log(high) > (1 + ACCURACY) * math.log(low) + ACCURACY:
                growth = math.sqrt(low * high)
                found = self._candidate(rate, None, growth)
                low, high, P = (growth, high, P) if found is None else (low, growth, found)
            if P is None:
                continue
            decay = rate if dt is None else -math.expm1(-2 * rate * dt)
            least = 2 * decay if dt is None else -math.log1p(-decay) / dt  # as it is proven
            made = replace(
                _none(self.modes, True, ""),
                seconds=math.log(high) / least * (1 + 64 * np.finfo(float).eps),
                P=tuple(M[None] for M in P), lengths=none, decay=decay, growth=high,
            )  # fmt: skip
            if (best is None or made.seconds < best.seconds) and made.verify():
                best = replace(made, verified=True)
        return best

    def _graded(self, seconds: float, finer: int) -> Array:
        """Return the lengths of the segments: at equal distances of log(1 + t / fastest time
        constant) before the end, where P moves fast.
        """
        fastest = 1 / max(float(np.abs(np.linalg.eigvals(A)).max()) for A in self.middle)
        logs = np.linspace(math.log1p(seconds / fastest), 0.0, finer * self.parts + 1)
        # a little less, so that the sum of the rounded lengths is not above the dwell time
        return -np.diff(fastest * np.expm1(logs)) * (1 - 8 * np.finfo(float).eps)

    def _motion(self, i: int, decay: float) -> Array:
        """Return the matrix of the motion by which P of a mode moves: of a fixed A its own, grown
        by the decay that V has to spare; of one that moves with p the decay itself.
        """
        dt, eye = self.modes.dt, np.eye(len(self.T))
        if dt is None:
            return self.middle[i] + decay * eye if self.fixed[i] else -decay * eye
        return (self.middle[i] if self.fixed[i] else math.exp(-2 * decay * dt) * eye) * math.exp(
            decay * dt
        )

    def _through(self, motion: Array, seconds: float) -> Array:
        """Return x so many seconds later per x."""
        if self.modes.dt is None:
            return linalg.expm(motion * seconds)
        return np.linalg.matrix_power(motion, round(seconds / self.modes.dt))

    def _path(self, P: Array, motion: Array, lengths: Array) -> Array:
        """Return E(t)'P E(t) + `FLOOR` P, E(t) the motion to the end: cubic between the knots."""
        dt = self.modes.dt
        ahead = np.cumsum([0.0, *lengths[::-1]])[::-1] * (1.0 if dt is None else dt)
        through = [self._through(motion, t) for t in ahead]
        values = [_even(E.T @ P @ E + FLOOR * P) for E in through]
        if dt is not None:
            return np.array(values)
        slopes = [-_even(2 * E.T @ P @ motion @ E) for E in through]
        out = [values[0]]
        for k, third in enumerate(lengths / 3):
            out += [values[k] + third * slopes[k], values[k + 1] - third * slopes[k + 1]]
            out.append(values[k + 1])
        return np.array(out)

    def _first(self) -> Array:
        """Return coordinates in which the sum of the modes' own P is the identity."""
        size = sum(np.abs(A) for A in self.middle)
        _, (units, _) = linalg.matrix_balance(size, permute=False, separate=True)
        total = np.zeros_like(size)
        for A in self.middle:
            own = (A * units / units[:, None]).T
            P = lyapunov(own, np.eye(len(own)), self.modes.dt)
            total += P / np.trace(P)
        return units[:, None] * np.linalg.inv(np.linalg.cholesky(_even(total))).T

    def _candidate(
        self, decay: float, through: Sequence[Array] | None, growth: float
    ) -> list[Array] | None:
        """Return P of every mode with most to spare in

            A'P_i + P_i A + 2 decay P_i < 0,  J'(E_j'P_j E_j + `FLOOR` P_j) J < growth P_i,

        E_j the motion `through` mode j; without it J'P_j J < growth P_i.
        """
        T, n, dt = self.T, len(self.T), self.modes.dt
        back = np.linalg.inv(T)
        program = AffineProgram()
        P = [program.symmetric(n, CONSTANT) for _ in self.corners]
        last = program.variable(np.ones((1, 1, 1)), CONSTANT)
        spare = program.value(last) * np.eye(n)
        values = [program.value(M) for M in P]
        for own, corners in zip(values, self.corners, strict=True):
            program.positive(POINT, program.known(np.eye(n)) - own)
            program.positive(POINT, own - spare)
            for A in (back @ corner @ T for corner in corners):
                if dt is None:
                    change = A.T @ own + own @ A + 2 * decay * own
                else:
                    change = (A.T @ own @ A * math.exp(2 * decay * dt) - own) / dt
                program.positive(POINT, -change / self.rate - spare)
        for (i, j), J in self.modes.jumps.items():
            jump = back @ J @ T
            after = values[j]
            if through is not None:
                E = back @ through[j] @ T
                after = E.T @ after @ E + FLOOR * after
            program.positive(POINT, growth * values[i] - jump.T @ after @ jump - spare)
        cost = np.zeros(program.count)
        cost[last.columns.ravel()] = -1.0
        found = program.minimise(cost, self.solver)
        if found.x is None or found.answer is Answer.INFEASIBLE:
            return None
        if float(found.x[last.columns.ravel()][0]) < SPARE:
            return None
        return [_even(back.T @ M.coefficients(found.x)[0] @ back) for M in P]


def _even(M: Array) -> Array:
    return 0.5 * (M + M.T)


def _decay(A: Array, dt: float | None) -> float:
    """Return the decay rate of the slowest state, 1/s."""
    poles = np.linalg.eigvals(A)
    if dt is None:
        return -float(poles.real.max(initial=-math.inf))
    return -math.log(max(float(np.abs(poles).max(initial=0.0)), LEAST_RADIUS)) / dt
