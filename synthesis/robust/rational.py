"""Gain and stability of an LFT whose parameters move at limited rates, exactly as a rational
function of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar

import numpy as np
from scipy import linalg

from symheli import LFT
from symheli.errors import InputError
from symheli.lpv import Polynomial, Product
from symheli.lpv.lft_matrices import LFTMatrices
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.certify.statement.rates import Rate, limits
from synthesis.certify.statement.sentences import motion
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.program.affine_program import AffineProgram
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.numerics.program.expression import times_identity
from synthesis.robust.rational_inequality import Parts, box_of, delta_rates, holds, inequalities

KIND = {True: "gain of a rational model", False: "stability of a rational model"}
MOST = 3
"""Most parameters of a rational model."""
SAMPLES = 9
"""Samples of each parameter at which frozen models are looked at."""
BACK_OFFS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Relative increases of the square of the gain until the exact check passes."""
SPARE, LEAST = 1e-9, 1e-6
"""Least multiple of the identity that a candidate leaves in every inequality, and in P, in its own
units.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class RationalGain(ProvenStatement):
    """A gain, or stability, of an LFT whose parameters move within their ranges and rates.

    Attributes
    ----------
    gamma : float
        Proven bound of the L2 gain, y per u; NaN of stability, inf where nothing is proven.
    frozen : float
        Largest gain of the models looked at frozen, computed; a lower bound.
    lft : LFTMatrices
        The model, its parameters with the rates of the claim.
    P, F : array
        Bernstein coefficients over the normalised parameters of V = x' P x and of the matrix F of
        `synthesis.robust.rational_inequality`.

    Examples
    --------
    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.2)
    >>> lag = symheli.LFT.from_expressions([[-1 / (1 + p.symbol)]], [[1]], [[1]], [[0]], p)
    >>> found = synthesis.robust.rational_gain(lag)
    >>> found.verify(), found.P.shape
    (True, (3, 1, 1))
    """

    gamma: float
    frozen: float
    lft: LFTMatrices
    P: Array
    F: Array
    verified: bool = False
    why: str = ""

    reader: ClassVar[str] = "rational-gain"

    __repr__ = summarized

    @property
    def bound(self) -> float:
        """The proven gain; NaN of stability."""
        return self.gamma

    def verify(self, rigorous: bool = True) -> bool:
        """Check the inequalities again, in rational arithmetic always."""
        gain = self.gamma if self.lft.inputs else 0.0
        return bool(self.P.size) and math.isfinite(gain) and holds(self.lft, self.P, self.F, gain)

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        if not self.lft.inputs:
            return "the free state decays exponentially, and the loop is well posed"
        return f"the energy of the outputs is at most {self.gamma!r}^2 times that of the inputs"

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, made from the numbers of the proof."""
        n, sizes = len(self.lft.states), ", ".join(str(b.size) for b in self.lft.blocks)
        moving = (motion(b.scheduling, b.scheduling.limit) for b in self.lft.blocks)
        return (f"an LFT of {n} states in continuous time, blocks of {sizes} copies", *moving)

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind and bounds as data that JSON holds."""
        kind = KIND[bool(self.lft.inputs)]
        return {"kind": kind, "gamma": self.gamma, "frozen": self.frozen}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: the LFT, P and F."""
        if not self.verified:
            raise InputError(f"only a proven bound is saved; here {self.why}")
        values = {name: getattr(self, name) for name in ("gamma", "frozen", "lft", "P", "F")}
        kind = KIND[bool(self.lft.inputs)]
        return {"kind": kind, **{name: encoded(value) for name, value in values.items()}}

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> RationalGain:
        """Return the bound of a file, proven anew."""
        lft = decoded(content["lft"])
        if not isinstance(lft, LFTMatrices):
            raise InputError("the file holds no LFT")
        _check(lft)
        n, m = len(lft.states), len(lft.blocks)
        order, width = lft.order, n + lft.order + len(lft.inputs)
        P = frozen(decoded(content["P"]), "P", (*(None,) * m, n, n))
        F = frozen(decoded(content["F"]), "F", (*(None,) * m, width, order))
        gamma, low = (float(decoded(content[name])) for name in ("gamma", "frozen"))
        why = "the inequalities do not hold in exact arithmetic"
        found = cls(gamma=gamma, frozen=low, lft=lft, P=P, F=F, why=why)
        return replace(found, verified=True, why="") if found.verify() else found

    def __str__(self) -> str:
        if not self.verified:
            return f"nothing is proven: {self.why}"
        if not self.lft.inputs:
            return f"proven: {self.claim}"
        degrees = tuple(k - 1 for k in self.P.shape[:-2])
        numbers = f"{self.frozen:.6g} (frozen, computed) <= gain <= {self.gamma:.6g}"
        return f"{numbers}\n  proven: P of degrees {degrees}"


@with_one_thread
def rational_gain(
    lft: LFT,
    rate: Rate = None,
    *,
    degree: int = 2,
    solver: Solver | str = "CLARABEL",
) -> RationalGain:
    """Certify the L2 gain of an LFT while its parameters move at limited rates; without inputs and
    outputs its stability.

    Nothing is fitted: the signals between the model and its parameters stay in the inequality,
    which is polynomial although the model is rational.

    Parameters
    ----------
    lft : LFT
        In continuous time, with up to three parameters.
    rate : float, sequence or mapping, optional
        Largest |dp/dt| in units of p per second, as of `l2_gain`.
    degree : int
        Degree of P in every parameter whose rate is limited, and of the multiplier.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    RationalGain
        `gamma` is proven, `frozen` attained.

    Raises
    ------
    InputError
        A sampled model, too many parameters, a rate that has no meaning.

    See Also
    --------
    synthesis.lft_gain : the same for parameters that may jump
    synthesis.l2_gain : gain of a model that is polynomial in its parameters

    References
    ----------
    Coutinho, Bazanella, Trofino and Silva, Int. J. Robust and Nonlinear Control 14 (2004).

    Examples
    --------
    x' = -x/(1 + p) + u/(1 + p): a lag whose time constant moves, of gain 1.

    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.2)
    >>> s = p.symbol
    >>> lag = symheli.LFT.from_expressions([[-1 / (1 + s)]], [[1 / (1 + s)]], [[1]], [[0]], p)
    >>> found = synthesis.robust.rational_gain(lag)
    >>> print(f"{found.frozen:.3f} <= gain <= {found.gamma:.2f}, proven: {found.verified}")
    1.000 <= gain <= 1.06, proven: True
    """
    if not isinstance(lft, LFT):
        raise InputError(f"expected an LFT, got {type(lft).__name__}; a polynomial model: l2_gain")
    degree, solver = whole(degree, "degree", 1), general_solver(solver)
    moving = limits([b.scheduling for b in lft.blocks], rate)
    blocks = [b._replace(scheduling=s) for b, s in zip(lft.blocks, moving, strict=True)]
    matrices = LFTMatrices(
        lft.M11, lft.M12, lft.M21, lft.M22, tuple(blocks), lft.states, lft.inputs, lft.outputs,
        lft.dt,
    )  # fmt: skip
    _check(matrices)
    low = _frozen(lft)
    nothing = RationalGain(
        gamma=math.inf if lft.inputs else math.nan,
        frozen=low,
        lft=matrices,
        P=np.zeros(0),
        F=np.zeros(0),
        why="a frozen model is not stable",
    )
    if math.isinf(low):
        return nothing
    nothing = replace(nothing, why="the inequalities have no solution that passes the exact check")
    return _searched(nothing, degree, solver)


def _check(lft: LFTMatrices) -> None:
    if lft.dt is not None:
        raise InputError("a rational gain is for continuous time; take lft_gain for sampled models")
    if not 1 <= len(lft.blocks) <= MOST:
        raise InputError(f"expected 1 to {MOST} parameters, got {len(lft.blocks)}")
    if not lft.states:
        raise InputError("the model has no states; its gain is the largest norm of D(p)")
    if bool(lft.inputs) != bool(lft.outputs):
        raise InputError("expected inputs and outputs, or neither of them: model.select(...)")
    if any(isinstance(b.scheduling.rate, str) for b in lft.blocks):
        raise InputError("the rate of a parameter is a number here, not another parameter")


def _frozen(lft: LFT) -> float:
    """Return the largest gain of models frozen in the box; inf where one is not stable, 0 without
    inputs where all are.
    """
    ranges = [np.linspace(b.scheduling.low, b.scheduling.high, SAMPLES) for b in lft.blocks]
    worst = 0.0
    for p in product(*ranges):
        model = lft.at(*p)
        if not model.is_stable():
            return math.inf
        if lft.inputs:
            worst = max(worst, norm(model.A, model.B, model.C, model.D, None)[0])
    return worst


def _searched(start: RationalGain, degree: int, solver: Solver) -> RationalGain:
    """Return what a program in units of order one proves."""
    lft, own = start.lft, Parts.of(start.lft)
    n = own.states
    size = np.abs(own.moves[:, :n])
    _, (units, _) = linalg.matrix_balance(size, permute=False, separate=True)
    channel = 2.0 ** round(math.log2(start.frozen)) if start.frozen > 0 else 1.0
    right = np.concatenate([units, np.ones(own.moves.shape[1] - n)])
    scaled = own._replace(
        moves=own.moves / units[:, None] * right,
        into=own.into * right,
        shows=own.shows * right / channel,
    )
    candidate = _candidate(scaled, delta_rates(lft), degree, solver)
    if candidate is None:
        return start
    P, F, level = candidate
    left = 1.0 / right
    P = P * channel**2 / np.outer(units, units)
    F = F * channel**2 * left[:, None]
    for back_off in BACK_OFFS if own.inputs else (0.0,):
        gamma = channel * math.sqrt(level * (1 + back_off)) if own.inputs else math.nan
        found = replace(start, gamma=gamma, P=P, F=F, why="")
        if found.verify():
            return replace(found, verified=True)
    return start


def _candidate(
    own: Parts, rates: Sequence[Any], degree: int, solver: Solver
) -> tuple[Array, Array, float] | None:
    """Return Bernstein coefficients of P and F, and the square of the gain; None without them."""
    box, (order, width) = box_of(own.sizes), own.into.shape
    program = AffineProgram()
    moving = [0 if rate is None else degree for rate in rates]
    P = program.symmetric(own.states, _space(moving)).on(box)
    F = program.full(width, order, _space([degree] * len(box))).on(box)
    g = program.full(1, 1, _space([0] * len(box))).on(box)
    eye = PolynomialMatrix.constant(np.eye(own.inputs), box)
    level = times_identity(g, own.inputs) if own.inputs else eye
    limits_ = [0.0 if rate is None else float(rate) for rate in rates]
    program.require(P >> LEAST, "P > 0")
    for i, form in enumerate(inequalities(own, P, F, limits_, level)):
        program.require(form << -SPARE, f"V falls, corner {i} of the rates")
    program.require(g >> 0.0, "level")
    found = program.minimise(g, solver)
    if found.x is None or found.answer is Answer.INFEASIBLE:
        return None
    p, f = (M.at(found.x).coefficients for M in (P, F))
    square = float(g.at(found.x).coefficients.ravel()[0])
    return 0.5 * (p + np.swapaxes(p, -1, -2)), f, max(square, 1e-12)


def _space(degrees: Sequence[int]) -> Any:
    each = tuple(Polynomial(d, -1.0, 1.0) for d in degrees)
    return each[0] if len(each) == 1 else Product(each)
