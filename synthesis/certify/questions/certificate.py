"""The result of every analysis: upper and lower bound, hypotheses, and the proof."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from symheli import Scheduling
from symheli.errors import CertificateError, InputError
from symheli.lazy import former_attribute
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.certify.statement.kind import Kind
from synthesis.certify.statement.outcome import Attempt, Seconds, Status
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.certify.statement.sentences import claim, conditions
from synthesis.certify.statement.trajectory import SchedulingTrajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BOUNDS = ("gamma", "lower", "alpha", "upper", "index", "index_limit")
"""Fields that hold the bounds of some kind."""


class Evidence(Protocol):
    """A model with the units and rates of a statement, against which a Lyapunov function (with its
    multiplier) and a bound are checked.
    """

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters of the model."""
        ...

    @property
    def matrices(self) -> Any:
        """The model, as matrices with their functions of p."""
        ...

    def fault(self, lyapunov: Any, kind: Kind, rates: tuple[float, ...], /) -> str | None:
        """Return why the proof is invalid in form or not one of this statement; None where it is
        valid.
        """
        ...

    def floating(self, lyapunov: Any, bound: float, /) -> bool:
        """Check in floating point, with a margin for rounding."""
        ...

    def exact(self, lyapunov: Any, bound: float, /) -> bool:
        """Check in rational arithmetic."""
        ...


class Proof(NamedTuple):
    """A Lyapunov function with the data needed to verify it: the model and its units.

    `lyapunov` is a `SplineLyapunov`, `MemoryLyapunov` or `BoxLyapunov`, or for an LFT a `Quadratic`
    with its multiplier.
    """

    evidence: Evidence
    lyapunov: Any

    __repr__ = summarized

    def fault(self, kind: Kind, rates: tuple[float, ...]) -> str | None:
        """Return why this is not a proof of such a statement; None where it is."""
        return self.evidence.fault(self.lyapunov, kind, rates)

    def floating(self, bound: float) -> bool:
        """Whether the inequalities hold with this bound, in floating point."""
        return self.evidence.floating(self.lyapunov, bound)

    def exact(self, bound: float) -> bool:
        """Whether they hold in rational arithmetic, and at some p through the model's own
        matrices.
        """
        return self.evidence.exact(self.lyapunov, bound)


@dataclass(frozen=True, eq=False, kw_only=True)
class Certificate(ProvenStatement):
    """A certificate is a bound that holds for every p(t) within its range and rates, with its proof
    and its hypotheses.

    Made by `l2_gain`, `stability`, `decay_rate`, `energy_to_peak`, `h2_gain`, `lft_gain` and
    `lft_stability`.

    Attributes
    ----------
    kind : str
        "l2 gain", "energy-to-peak gain", "h2 gain", "decay rate", "stability", or another name that
        `synthesis.certify.statement.kind` knows.
    gamma : float
        Proven upper bound of a gain; inf where nothing was proven, NaN for the other kinds.
    lower : float
        No upper bound can be smaller: from trajectories actually computed (inf: the state grows);
        NaN for the other kinds.
    alpha : float
        Proven decay rate, 1/s: |x(t)| <= c exp(-alpha t) |x(0)|; below 0, and not verified, where
        the best bound found is one of growth; -inf where there is none, NaN for the other kinds.
    upper : float
        No larger decay rate can be proven, 1/s; NaN for the other kinds.
    index, index_limit : float
        Proven index of passivity or another supply rate, and the one that no proof exceeds; NaN for
        the other kinds.
    frozen : float
        The same from p constant alone; NaN for stability.
    status : Status
        How it came out; its value is a sentence.
    verified : bool
        Recomputed in floating point from the model and the proof alone.
    rates : tuple of float
        Bound on the rate of each parameter, in its units per second (inf: arbitrary; 0: frozen).
    hypotheses : tuple of str
        What the bound rests on, in sentences.
    method : str
        How the bound was looked for, in some words.
    solver : str
        Name, version and settings.
    seconds : Seconds
        Wall time of each stage.
    conditioning : float
        Largest condition number of P in scaled coordinates, inf where there is none.
    attempts : tuple of Attempt
        Every cone program that was tried; printed as a line each.
    worst : SchedulingTrajectory or None
        Scheduling trajectory behind `lower` or `upper`, None where p is constant there.
    perturbation : array (nd, nv) or None
        Delta of the model of an uncertain one behind `lower`, None where the model is one.
    indicative : float
        The bound at the points of a grid, where the user requested one: no proof. Else NaN.
    proof : Proof or None
        The Lyapunov function and what verifies it.

    Raises
    ------
    InputError
        For an invalid field.
    CertificateError
        If two of its numbers contradict each other, or a verified certificate has no proof.

    See Also
    --------
    synthesis.l2_gain, synthesis.stability, synthesis.decay_rate

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = l2_gain(lag)
    >>> cert.save("proof.json").name
    'proof.json'
    >>> Certificate.load("proof.json").verify(rigorous=True)
    True
    """

    kind: Kind
    gamma: float = math.nan
    lower: float = math.nan
    alpha: float = math.nan
    upper: float = math.nan
    index: float = math.nan
    index_limit: float = math.nan
    frozen: float = math.nan
    status: Status
    verified: bool
    rates: tuple[float, ...]
    hypotheses: tuple[str, ...]
    method: str
    solver: str
    seconds: Seconds
    conditioning: float = math.inf
    attempts: tuple[Attempt, ...] = ()
    worst: SchedulingTrajectory | None = None
    perturbation: Array | None = None
    indicative: float = math.nan
    proof: Proof | None = field(default=None, repr=False)

    __repr__ = summarized

    def __post_init__(self) -> None:
        """Check the form of the statement, then the order of the bounds.

        Raises `InputError` for an invalid statement, `CertificateError` for contradictory numbers.
        """
        self._check_form()
        sense = self.kind.facets.sense
        sign, moving = (-1.0, "upper bound") if sense < 0 else (1.0, "lower bound")
        what = "gain" if self.kind.endswith("gain") else self.kind
        # frozen and limit are computed to 1e-8, what is proven is loosened by 5e-7 at least
        slack = 1e-6 * abs(self.bound) if math.isfinite(self.bound) else 0.0
        for name, bound in ((f"frozen {what}", self.frozen), (moving, self.limit)):
            if self.verified and sign * (bound - self.bound) > slack:
                raise CertificateError(
                    f"the {name} {bound:.9g} contradicts the certified {self.kind}"
                    f" {self.bound:.9g}; one of the two is wrong"
                )
        if sign * (self.frozen - self.limit) > 1e-9 * abs(self.frozen):
            raise CertificateError(
                f"the {moving} {self.limit:.9g} is inconsistent with the frozen {what}"
                f" {self.frozen:.9g}"
            )
        if self.verified and self.status is not Status.PROVEN:
            raise CertificateError(f"a verified certificate cannot have the status {self.status}")
        if self.verified and self.proof is None:
            raise CertificateError("a verified certificate needs its proof, which is missing")
        if self.verified and self.kind.facets.decays and not self.alpha >= 0:
            raise CertificateError(
                f"a decay rate of {self.alpha:.6g} is growth, and proves nothing"
            )

    def _check_form(self) -> None:
        object.__setattr__(self, "kind", Kind.named(self.kind))
        if not isinstance(self.rates, tuple):
            raise InputError(
                f"expected a tuple of rates, one each parameter, got {self.rates!r:.60}"
            )
        bounds = (getattr(self, name) for name in BOUNDS)
        for bound in (*bounds, self.frozen, *self.rates):
            if not isinstance(bound, float):
                raise InputError(
                    f"bounds and rates must be floats (NaN where there is none), got {bound!r:.60}"
                )

    @property
    def lyapunov(self) -> Any:
        """The Lyapunov function of the proof, None where there is none."""
        return None if self.proof is None else self.proof.lyapunov

    @property
    def bound(self) -> float:
        """The proven bound: `gamma` of a gain, `alpha` of a decay rate, `index` of an index, NaN
        for stability.
        """
        fields = self.kind.facets.fields
        return getattr(self, fields[0]) if fields else math.nan

    proven = former_attribute("proven", "bound")

    @property
    def limit(self) -> float:
        """The bound no proof can improve on: `lower` of a gain, `upper` of a decay rate or index,
        NaN for stability.
        """
        fields = self.kind.facets.fields
        return getattr(self, fields[1]) if fields else math.nan

    @property
    def gap(self) -> float:
        """Ratio gamma / lower, or upper / alpha: 1 means exact, inf that nothing is proven; NaN for
        stability.
        """
        above, below = self.bound, self.limit
        if self.kind.facets.sense < 0:
            above, below = below, above
        return above / below if below > 0 else math.nan if math.isnan(below) else math.inf

    @property
    def rate(self) -> float:
        """The rate of the one parameter; the largest of `rates` where there are several, 0 where
        there is none.
        """
        return max(self.rates, default=0.0)

    def verify(self, rigorous: bool = False) -> bool:
        """Verify proof and bound anew; `rigorous`: in exact rational arithmetic.

        Exact: the doubles of the model, of the proof, of rates and bound are taken as the rationals
        they are. Factorisations with a bound of their rounding decide, else exact ones; nothing
        between grid points is left out. Without a proof nothing is verified.
        """
        if self.proof is None or self.status is Status.UNPROVEN or self.fault is not None:
            return False
        try:
            with np.errstate(all="ignore"):
                return (self.proof.exact if rigorous else self.proof.floating)(self.bound)
        except (np.linalg.LinAlgError, OverflowError, ValueError, ZeroDivisionError):
            # numbers too large or of no use to compute with show nothing
            return False

    reader: ClassVar[str] = "certificate"

    @property
    def why(self) -> str:  # type: ignore[override]
        """Why nothing is proven; empty where something is."""
        if self.verified:
            return ""
        witness = next((each for each in self.hypotheses if each.startswith("no constant P")), "")
        return self.fault or "; ".join(filter(None, (self.status.value, witness)))

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers and units."""
        return claim(self.kind, self.bound)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, made from the numbers of the proof: how the parameters move, the
        perturbations, the model in the file.
        """
        return () if self.proof is None else conditions(self.proof.evidence, self.rates)

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        own = {name: getattr(self, name) for name in ("rates", "gamma", "alpha")}
        more = {"bound": self.bound, "unit": self.kind.facets.unit, "status": self.status.name}
        return {"kind": str(self.kind), **own, **more}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file. The trim schedule and the misfit of the model stay behind: what they
        mean is among the hypotheses.
        """
        from synthesis.certify.questions.certificate_file import written

        return written(self)

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> Self:
        """Return the certificate of a file, its bound checked against its proof in floating point;
        `verify()` then decides in exact arithmetic.

        Raises `InputError` for a file that is not a certificate, `CertificateError` if it is
        inconsistent or its proof does not hold. Lower bounds, trajectories and hypotheses on the
        model are as they were written.
        """
        from synthesis.certify.questions.certificate_file import read

        return read(content)  # type: ignore[return-value]

    def proven_of(self, model: Any) -> bool:
        """Return whether the claim is about exactly this model: the same matrices at every p, the
        same ranges and sample period; names of signals may differ.
        """
        from synthesis.certify.questions.certificate_file import same_model

        return self.proof is not None and same_model(self.proof.evidence.matrices, model)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Frozen, attained and proven bound, the bracket between the last two shaded; returns the
        axes. Raises `InputError` for stability, which has no numbers.
        """
        from synthesis.certify.questions.certificate_plot import plot_certificate

        return plot_certificate(self, ax)

    def resting_on(self, sentences: Iterable[str]) -> Self:
        """Return the same certificate with further hypotheses."""
        return replace(self, hypotheses=(*self.hypotheses, *sentences))

    @property
    def fault(self) -> str | None:
        """Reason why the statement cannot follow from the proof, by its form alone: a sentence,
        None where nothing is wrong or nothing is proven.
        """
        if self.proof is None:
            return None
        facets = self.kind.facets
        for name in BOUNDS:
            if name not in facets.fields and not math.isnan(getattr(self, name)):
                return f"a proof of the {self.kind} has no {name}"
        signed = facets.sense < 0 and not facets.decays
        if facets.sense and not (math.isfinite(self.bound) and (signed or self.bound >= 0)):
            return f"the bound of a {self.kind} must be a finite number >= 0, got {self.bound}"
        try:
            return self.proof.fault(self.kind, self.rates)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError) as error:
            return f"the proof was not made by an analysis: {error}"

    def __str__(self) -> str:
        """Return the result in three lines; `details` has the rest."""
        lines = self._summary()
        if self.lyapunov is not None:
            lines.append(
                f"  {self.lyapunov.form}; {len(self.hypotheses)} hypotheses and the programs tried"
                " in .details"
            )
        elif self.attempts or self.hypotheses:
            lines.append(f"  {len(self.attempts)} programs tried, in .details")
        lines += [f"  {each.program}: {each.answer}" for each in self.attempts if each.left]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        lines = "".join(f"<tr><td>{escape(line)}</td></tr>" for line in str(self).splitlines())
        return f"<table><tbody>{lines}</tbody></table>"

    def _summary(self) -> list[str]:
        """Return the first lines: kind, status and numbers."""
        lines = [f"{self.kind}, {self.method}: {self.status.value}"]
        sense, what = self.kind.facets.sense, "gain" if self.kind.endswith("gain") else self.kind
        if sense > 0:
            lines.append(
                f"  frozen {self.frozen:.6g} <= lower {self.limit:.6g} <= {what} <="
                f" {self.bound:.6g}"
            )
        elif sense < 0:
            lines.append(
                f"  {self.bound:.6g} <= {what} <= {self.limit:.6g} <= frozen"
                f" {self.frozen:.6g}, {self.kind.facets.unit}"
            )
        if not math.isnan(self.indicative):
            lines.append(f"  at the points of the grid {self.indicative:.6g}, which proves nothing")
        return lines

    @property
    def details(self) -> str:
        """All of the certificate: numbers, the form of the Lyapunov function, solver and times, all
        programs tried, all hypotheses.
        """
        lines = self._summary()
        if self.lyapunov is not None:
            lines.append(f"  {self.lyapunov.form}, condition number {self.conditioning:.2g}")
        lines.append(f"  {self.solver}; {self.seconds}")
        lines += [f"  tried: {attempt}" for attempt in self.attempts]
        lines += [f"  - {sentence}" for sentence in self.hypotheses]
        return "\n".join(lines)
