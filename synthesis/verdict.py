"""What every analysis answers: the truth between two bounds, under which hypotheses, and by which
route.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Literal, NamedTuple, Protocol, Self, get_args

import numpy as np

from symheli.errors import CertificateError, InputError
from synthesis.program.cone_program import Answer
from synthesis.worst.trajectory import Trajectory

Array = np.ndarray
Kind = Literal["l2 gain", "stability", "energy-to-peak gain", "decay rate"]


class Status(Enum):
    """How a certificate came out; the value is the sentence to print."""

    PROVEN = "proven on the whole interval"
    UNSTABLE = "no certificate exists: a model frozen at some p is not stable"
    GROWING = (
        "no certificate exists: a scheduling trajectory within the limits makes the state grow"
    )
    INFEASIBLE = (
        "no Lyapunov function of this form exists, to the solver's accuracy; the model may still be"
        " stable"
    )
    UNPROVEN = (
        "unproven on a grid: the inequalities hold at its points, between them nothing is known"
    )
    FAILED = "solver failed: what it returned could not be verified"
    UNTRIED = "not tried: the programs of this form are too large for the solver; nothing is known"

    @classmethod
    def without_proof(cls, answer: Answer) -> Status:
        """What is known where nothing was proven and the last program tried was answered so."""
        return {Answer.INFEASIBLE: cls.INFEASIBLE, Answer.UNTRIED: cls.UNTRIED}.get(
            answer, cls.FAILED
        )


class Seconds(NamedTuple):
    """Wall time of each stage, s."""

    build: float = 0.0
    solve: float = 0.0
    verify: float = 0.0
    bounds: float = 0.0

    def __str__(self) -> str:
        return (
            f"build {self.build:.2f} s, solve {self.solve:.2f} s, verify {self.verify:.2f} s,"
            f" bounds {self.bounds:.2f} s"
        )


class Judge(Protocol):
    """A model with its hypotheses, against which a Lyapunov function (with its multipliers) and a
    bound are checked.
    """

    def fault(self, proof: Any, kind: Kind, rates: tuple[float, ...], /) -> str | None:
        """What is wrong with the form of the proof, or keeps it from being about this claim; None
        where nothing does.
        """
        ...

    def floating(self, proof: Any, bound: float, /) -> bool:
        """In floating point, with a margin for rounding."""
        ...

    def exact(self, proof: Any, bound: float, /) -> bool:
        """In rational arithmetic."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict(ABC):
    """A bound that holds for every p(t) within its range and rates, with its proof and its
    hypotheses.

    kind          "l2 gain", "energy-to-peak gain", "decay rate" or "stability" gamma         proven
    upper bound of a gain; inf where nothing was proven; NaN for the other kinds lower         no
    upper bound can be smaller: from trajectories actually computed (inf: the state grows) alpha
    proven decay rate, 1/s: |x(t)| <= c exp(-alpha t) |x(0)|; -inf where nothing was proven; NaN for
    other kinds upper         no larger decay rate can be proven, 1/s frozen        the same from p
    constant alone; NaN for stability status        a `Status`; its value is a sentence verified
    recomputed in floating point from the model and the proof alone rates         bound on the rate
    of each parameter, in its units per second (inf: arbitrary; 0: frozen) hypotheses    what the
    bound rests on, in sentences solver        name, version and tolerance seconds       wall time
    of each stage conditioning  largest condition number of P in scaled coordinates, inf where there
    is none attempts      every cone program that was tried; printed as a line each worst
    scheduling trajectory behind `lower` or `upper`, None where p is constant there
    """

    kind: Kind
    gamma: float = math.nan
    lower: float = math.nan
    alpha: float = math.nan
    upper: float = math.nan
    frozen: float = math.nan
    status: Status
    verified: bool
    rates: tuple[float, ...]
    hypotheses: tuple[str, ...]
    solver: str
    seconds: Seconds
    conditioning: float
    attempts: tuple[Any, ...]
    worst: Trajectory | None = None

    def __post_init__(self) -> None:
        """The form of the claim, then the order of the bounds.

        Raises `InputError` for what is no claim, `CertificateError` where two numbers contradict
        each other: one of them is wrong.
        """
        self._check_form()
        sign, moving = (-1.0, "upper bound") if self.kind == "decay rate" else (1.0, "lower bound")
        what = self.kind.split()[-1] if self.kind.endswith("gain") else self.kind
        # frozen and limit are computed to 1e-8, what is proven is loosened by 5e-7 at least
        slack = 1e-6 * abs(self.proven) if math.isfinite(self.proven) else 0.0
        for name, bound in ((f"frozen {what}", self.frozen), (moving, self.limit)):
            if self.verified and sign * (bound - self.proven) > slack:
                raise CertificateError(
                    f"the {name} {bound:.9g} contradicts the certified {self.kind}"
                    f" {self.proven:.9g}; one of the two is wrong"
                )
        if sign * (self.frozen - self.limit) > 1e-9 * abs(self.frozen):
            raise CertificateError(
                f"the {moving} {self.limit:.9g} forgets the frozen {what} {self.frozen:.9g}"
            )
        if self.verified and self.status is not Status.PROVEN:
            raise CertificateError(f"a verified certificate cannot have the status {self.status}")
        if self.verified and self.kind == "decay rate" and not self.alpha >= 0:
            raise CertificateError(
                f"a decay rate of {self.alpha:.6g} is growth, and proves nothing"
            )

    def _check_form(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in get_args(Kind):
            raise InputError(
                f"expected one of the kinds {', '.join(get_args(Kind))}, got {self.kind!r:.60}"
            )
        if not isinstance(self.rates, tuple):
            raise InputError(
                f"expected a tuple of rates, one each parameter, got {self.rates!r:.60}"
            )
        for bound in (self.gamma, self.lower, self.alpha, self.upper, self.frozen, *self.rates):
            if not isinstance(bound, float):
                raise InputError(
                    f"bounds and rates must be floats (NaN where there is none), got {bound!r:.60}"
                )

    @property
    def proven(self) -> float:
        """`gamma` of a gain, `alpha` of a decay rate, NaN for stability."""
        return self.alpha if self.kind == "decay rate" else self.gamma

    @property
    def limit(self) -> float:
        """What no proof can beat: `lower` of a gain, `upper` of a decay rate, NaN for stability."""
        return self.upper if self.kind == "decay rate" else self.lower

    @property
    def gap(self) -> float:
        """gamma / lower, or upper / alpha: 1 means exact, inf that nothing is known; NaN for
        stability.
        """
        above, below = (
            (self.upper, self.alpha) if self.kind == "decay rate" else (self.gamma, self.lower)
        )
        return above / below if below > 0 else math.nan if math.isnan(below) else math.inf

    @property
    def rate(self) -> float:
        """The rate of the one parameter; the largest of `rates` where there are several, 0 where
        there is none.
        """
        return max(self.rates, default=0.0)

    def verify(self, rigorous: bool = False) -> bool:
        """Verify proof and bound anew; `rigorous`: in exact rational arithmetic (python-flint makes
        it fast).

        Exact: the doubles of the model, of the proof, of rates and bound are taken as the rationals
        they are, and LDL' factorisations decide; nothing between grid points is left out. Without a
        proof nothing is verified.
        """
        proof, judge = self._proof
        if proof is None or judge is None or self.fault is not None:
            return False
        try:
            with np.errstate(all="ignore"):
                return (judge.exact if rigorous else judge.floating)(proof, self.proven)
        except (np.linalg.LinAlgError, OverflowError):
            # numbers too large to compute with show nothing
            return False

    def resting_on(self, sentences: Iterable[str]) -> Self:
        """The same with further hypotheses."""
        return replace(self, hypotheses=(*self.hypotheses, *sentences))

    @property
    def fault(self) -> str | None:
        """Why the claim cannot be what was proven, by its form alone: a sentence, None where
        nothing is wrong or nothing is proven.
        """
        proof, judge = self._proof
        if proof is None or judge is None:
            return None
        if self.kind != "decay rate" and not math.isnan(self.alpha):
            return f"a proof of the {self.kind} has no decay rate"
        if not self.kind.endswith("gain") and not math.isnan(self.gamma):
            return f"a proof of the {self.kind} has no gain"
        if self.kind != "stability" and not 0 <= self.proven < math.inf:
            return f"the bound of a {self.kind} must be a finite number >= 0, got {self.proven}"
        try:
            return judge.fault(proof, self.kind, self.rates)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError) as error:
            return f"the evidence is none that an analysis made: {error}"

    @property
    @abstractmethod
    def _proof(self) -> tuple[Any, Judge | None]:
        """What `verify` checks, and who judges it."""

    @property
    @abstractmethod
    def _setting(self) -> str:
        """How the bound was looked for, in some words."""

    @property
    @abstractmethod
    def _form(self) -> str | None:
        """The Lyapunov function in some words, None where there is none."""

    def __str__(self) -> str:
        lines = [f"{self.kind}, {self._setting}: {self.status.value}"]
        if self.kind.endswith("gain"):
            lines.append(
                f"  frozen {self.frozen:.6g} <= lower {self.lower:.6g} <= gain <= {self.gamma:.6g}"
            )
        elif self.kind == "decay rate":
            lines.append(
                f"  {self.alpha:.6g} <= decay rate <= {self.upper:.6g} <= frozen"
                f" {self.frozen:.6g}, 1/s"
            )
        if self._form is not None:
            lines.append(f"  {self._form}, condition number {self.conditioning:.2g}")
        lines.append(f"  {self.solver}; {self.seconds}")
        lines += [f"  tried: {attempt}" for attempt in self.attempts]
        lines += [f"  - {sentence}" for sentence in self.hypotheses]
        return "\n".join(lines)
