"""Gain and stability of a model whose parameters move in a known periodic way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from scipy.integrate import solve_ivp

from symheli import LPVStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import Polynomial
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive, whole
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.program.affine_program import AffineProgram
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.numerics.program.expression import times_identity
from synthesis.switching.periodic_inequality import Half, Turning, holds, inequalities

KIND = {True: "gain of a periodic model", False: "stability of a periodic model"}
BOX = ((-1.0, 1.0),)
CONSTANT = Polynomial(0, -1.0, 1.0)
BACK_OFFS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Relative increases of the square of the gain until the exact check passes."""
SPARE, LEAST = 1e-9, 1e-6
"""Least multiple of the identity that a candidate leaves in every inequality, and in P."""
PARTS = 16
"""Parts of each half of the circle in which the program has its inequalities."""
MOST = 20
"""Most harmonics of P."""
HARMONICS, SAMPLES, FREQUENCIES = 12, 64, 61
"""Harmonics on each side of the harmonic transfer function, samples of a period, and frequencies
from 0 to half of omega at which it is computed.
"""
ACCURACY = 1e-10
"""Relative accuracy of the monodromy."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PeriodicGain(ProvenStatement):
    """A gain, or stability, of a model whose parameters are known periodic functions of time.

    Attributes
    ----------
    gamma : float
        Proven bound of the L2 gain, y per u; NaN of stability, inf where nothing is proven.
    lower : float
        Gain of the harmonics of the motion by a truncated harmonic transfer function, computed.
    multiplier : float
        Largest absolute Floquet multiplier of a period, computed: below 1 the model is stable.
    turning : Turning
        Matrices, ranges, motion and speed of the claim.
    P : array (1 + 2 K, n, n)
        V = x' P x: mean, cosines and sines in turn.

    Examples
    --------
    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", -1.0, 1.0)
    >>> lag = symheli.LPVStateSpace.from_expressions(
    ...     [[-1 - p.symbol / 2]], [[1]], [[1]], [[0]], p)
    >>> found = synthesis.switching.periodic_gain(lag, {"p": (0.0, 1.0, 0.0)}, 2.0, harmonics=2)
    >>> found.verify(), found.P.shape
    (True, (5, 1, 1))
    """

    gamma: float
    lower: float
    multiplier: float
    turning: Turning
    P: Array
    verified: bool = False
    why: str = ""

    reader: ClassVar[str] = "periodic-gain"

    __repr__ = summarized

    @property
    def bound(self) -> float:
        """The proven gain; NaN of stability."""
        return self.gamma

    @property
    def _driven(self) -> bool:
        return self.turning.matrices[1].shape[-1] > 0

    def verify(self, rigorous: bool = True) -> bool:
        """Check the inequalities again, in rational arithmetic always."""
        gain = self.gamma if self._driven else 0.0
        return bool(len(self.P)) and math.isfinite(gain) and holds(self.turning, self.P, gain)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        if not self._driven:
            return "the free state decays exponentially"
        return f"the energy of the outputs is at most {self.gamma!r}^2 times that of the inputs"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, made from the numbers of the proof."""
        n, count = self.turning.matrices[0].shape[-1], len(self.turning.motion)
        return (
            f"a model of {n} states in continuous time, whose {count} parameter(s) have the mean"
            " and the harmonics in the file",
            f"the angle of the first harmonic turns at {self.turning.omega!r} rad/s",
        )

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind and bounds as data that JSON holds."""
        numbers = {name: getattr(self, name) for name in ("gamma", "lower", "multiplier")}
        return {"kind": KIND[self._driven], **numbers}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: model, motion and P."""
        if not self.verified:
            raise InputError(f"only a proven bound is saved; here {self.why}")
        own = self.turning
        return {
            "kind": KIND[self._driven],
            "gamma": encoded(self.gamma),
            "lower": encoded(self.lower),
            "multiplier": encoded(self.multiplier),
            **{name: encoded(M) for name, M in zip("ABCD", own.matrices, strict=True)},
            "ranges": encoded(own.ranges),
            "motion": encoded(own.motion),
            "omega": own.omega,
            "P": encoded(self.P),
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> PeriodicGain:
        """Return the bound of a file, proven anew."""
        motion = frozen(decoded(content["motion"]), "motion", (None, None))
        m = len(motion)
        ranges = frozen(decoded(content["ranges"]), "ranges", (m, 2))
        each = [np.asarray(decoded(content[name]), float) for name in "ABCD"]
        n, nu, ny = each[0].shape[-1], each[1].shape[-1], each[2].shape[-2]
        shapes = {"A": (n, n), "B": (n, nu), "C": (ny, n), "D": (ny, nu)}
        A, B, C, D = (
            frozen(M, name, (*(None,) * m, *shapes[name]))
            for name, M in zip("ABCD", each, strict=True)
        )
        omega = positive(content["omega"], "omega")
        P = frozen(decoded(content["P"]), "P", (None, n, n))
        gamma, lower, multiplier = (
            float(decoded(content[k])) for k in ("gamma", "lower", "multiplier")
        )
        own = Turning((A, B, C, D), ranges, motion, omega)
        if not motion.shape[1] % 2 or not len(P) % 2:
            raise InputError("motion and P: expected a mean, and a cosine and a sine each harmonic")
        why = "the inequalities do not hold in exact arithmetic"
        found = cls(gamma=gamma, lower=lower, multiplier=multiplier, turning=own, P=P, why=why)
        return replace(found, verified=True, why="") if found.verify() else found

    def __str__(self) -> str:
        said = f"largest Floquet multiplier {self.multiplier:.4g} (computed)"
        if not self.verified:
            return f"{said}; nothing is proven: {self.why}"
        numbers = f"{self.lower:.6g} (computed) <= gain <= {self.gamma:.6g}, proven"
        what = numbers if self._driven else f"proven: {self.claim}"
        return f"{what}; {said}; P of {len(self.P) // 2} harmonic(s)"


@with_one_thread
def periodic_gain(
    model: LPVStateSpace,
    motion: Mapping[str, Sequence[float]],
    omega: float,
    *,
    harmonics: int = 4,
    solver: Solver | str = "CLARABEL",
) -> PeriodicGain:
    """Certify the L2 gain of a model whose parameters move in a known periodic way; without inputs
    and outputs its stability.

    Parameters
    ----------
    model : LPVStateSpace
        In continuous time, polynomial in its parameters; their rates play no part.
    motion : mapping of str to sequence of float
        Of every parameter its mean, then a cosine and a sine of each harmonic, in its own unit;
        within its range.
    omega : float
        Speed of the first harmonic, rad/s.
    harmonics : int
        Of the function V = x' P(t) x.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    PeriodicGain
        `gamma` is proven; `multiplier` says whether the model is stable at all.

    Raises
    ------
    InputError
        A sampled model, or one in pieces; a motion of another form.
    UnknownNameError
        A motion of a parameter that the model does not have.

    See Also
    --------
    synthesis.l2_gain : gain for every motion within range and rate

    References
    ----------
    Bittanti and Colaneri, "Periodic Systems" (2009).

    Examples
    --------
    y'' + y' + (1 + 2.5 p) y = f with p = cos 3 t, which is not stable for p at rest at -1:

    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", -1.0, 1.0)
    >>> A = [[0, 1], [-1 - 2.5 * p.symbol, -1]]
    >>> spring = symheli.LPVStateSpace.from_expressions(A, [[0], [1]], [[1, 0]], [[0]], p)
    >>> found = synthesis.switching.periodic_gain(spring, {"p": (0.0, 1.0, 0.0)}, 3.0)
    >>> print(f"{found.lower:.3f} <= gain <= {found.gamma:.3f}, proven: {found.verified}")
    1.502 <= gain <= 1.507, proven: True
    """
    omega, harmonics = positive(omega, "omega"), whole(harmonics, "harmonics", 0)
    if harmonics > MOST:
        raise InputError(f"harmonics: expected at most {MOST}, got {harmonics}")
    own = _turning(model, motion, omega)
    multiplier = _multiplier(model, own)
    nothing = PeriodicGain(
        gamma=math.inf if model.inputs else math.nan,
        lower=math.nan,
        multiplier=multiplier,
        turning=own,
        P=np.zeros((0, 0, 0)),
        why="the model is not stable",
    )
    if multiplier >= 1:
        return nothing
    nothing = replace(nothing, lower=_harmonic(model, own)) if model.inputs else nothing
    return _searched(nothing, harmonics, general_solver(solver))


def _turning(model: LPVStateSpace, motion: Mapping[str, Sequence[float]], omega: float) -> Turning:
    if not isinstance(model, LPVStateSpace) or model.dt is not None or not model.states:
        raise InputError("model: expected an LPVStateSpace with states, in continuous time")
    names = [s.name for s in model.parameters]
    for name in motion:
        if name not in names:
            raise UnknownNameError("parameter", name, names)
    if missing := [name for name in names if name not in motion]:
        raise InputError(f"motion: expected one of {missing[0]}, too")
    if bool(model.inputs) != bool(model.outputs):
        raise InputError("expected inputs and outputs, or neither of them: model.select(...)")
    own = pieces(model)
    if len(own.models) > 1:
        raise InputError("model: expected one that is polynomial over its whole range")
    ((A, B, C, D),) = own.models.values()
    longest = max(len(motion[name]) for name in names)
    longest += 1 - longest % 2
    rows = np.zeros((len(names), max(longest, 3)))
    for row, name in zip(rows, names, strict=True):
        given = frozen(motion[name], f"motion of {name}", (None,))
        row[: len(given)] = given
    ranges = np.array([(s.low, s.high) for s in model.parameters])
    matrices = (A.coefficients, B.coefficients, C.coefficients, D.coefficients)
    return Turning(matrices, ranges, rows, omega)


def _at(own: Turning, t: float) -> Array:
    """Return the parameters at a time, s."""
    k = np.arange(1, own.motion.shape[1] // 2 + 1)
    angle = own.omega * t * k
    waves = np.ravel(np.column_stack([np.cos(angle), np.sin(angle)]))
    return own.motion @ np.concatenate([[1.0], waves])


def _multiplier(model: LPVStateSpace, own: Turning) -> float:
    """Return the largest absolute eigenvalue of the state after a period per state before."""
    n = len(model.states)

    def slope(t: float, x: Array) -> Array:
        A = _matrices(model, own, t)[0]
        return (A @ x.reshape(n, n)).ravel()

    period = 2 * math.pi / own.omega
    flown = solve_ivp(slope, (0, period), np.eye(n).ravel(), method="DOP853", rtol=ACCURACY,
                      atol=ACCURACY)  # fmt: skip
    return float(np.abs(np.linalg.eigvals(flown.y[:, -1].reshape(n, n))).max())


def _matrices(model: LPVStateSpace, own: Turning, t: float) -> list[Array]:
    """Return A, B, C, D at a time, s."""
    p = _at(own, t)
    return [M[0] for M in model.matrices(p if len(own.ranges) == 1 else p[None])]


def _harmonic(model: LPVStateSpace, own: Turning) -> float:
    """Return the largest gain of the harmonic transfer function of so many harmonics on each side:
    from inputs to outputs at a frequency and its distances of whole multiples of omega.
    """
    times = 2 * math.pi / own.omega * np.arange(SAMPLES) / SAMPLES
    at = [_matrices(model, own, t) for t in times]
    span = range(-HARMONICS, HARMONICS + 1)

    def toeplitz(each: Array) -> Array:
        waves = np.fft.fft(each, axis=0) / SAMPLES
        return np.block([[waves[i - j] for j in span] for i in span])

    A, B, C, D = (toeplitz(np.array([one[k] for one in at])) for k in range(4))
    places = np.repeat(1j * own.omega * np.array(span), len(model.states))
    largest = 0.0
    for turn in np.linspace(0.0, 0.5, FREQUENCIES):
        left = np.diag(places + 1j * own.omega * turn) - A
        gain = np.linalg.norm(C @ np.linalg.solve(left, B) + D, 2)
        largest = max(largest, float(gain))
    return largest


def _searched(start: PeriodicGain, harmonics: int, solver: Solver) -> PeriodicGain:
    """Return what the program of all angles proves."""
    own = start.turning
    n, nu = own.matrices[0].shape[-1], own.matrices[1].shape[-1]
    program = AffineProgram()
    P = [program.symmetric(n, CONSTANT).on(BOX) for _ in range(1 + 2 * harmonics)]
    g = program.full(1, 1, CONSTANT).on(BOX)
    level = times_identity(g, nu) if nu else None
    for side in (1, -1):
        half = Half(side, 0.0)
        first, falls = inequalities(own, P, level, half)
        ends = np.linspace(-1.0, 1.0, PARTS + 1)
        for part in pairwise(ends):
            program.require(first.restrict((part,)) << -LEAST, f"P > 0, half {side}")
            program.require(falls.restrict((part,)) << -SPARE, f"V falls, half {side}")
    program.require(g >> 0.0, "level")
    found = program.minimise(g, solver)
    nothing = replace(start, why="the inequalities have no solution that passes the exact check")
    if found.x is None or found.answer is Answer.INFEASIBLE:
        return nothing
    terms = np.array([each.at(found.x).coefficients[0] for each in P])
    terms = 0.5 * (terms + terms.transpose(0, 2, 1))
    square = max(float(g.at(found.x).coefficients.ravel()[0]), 1e-12)
    for back_off in BACK_OFFS if nu else (0.0,):
        gamma = math.sqrt(square * (1 + back_off)) if nu else math.nan
        made = replace(start, gamma=gamma, P=terms, why="")
        if made.verify():
            return replace(made, verified=True)
    return nothing
