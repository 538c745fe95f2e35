"""A claim by V = x'Px about an LPV model: the inequalities of a certificate, with the given P."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.lpv_matrices import Matrices
from symheli.values.tracking import tracked
from synthesis.certify.lower_bounds.frozen import frozen_gain
from synthesis.certify.lower_bounds.no_common import no_common
from synthesis.certify.proof.box import BoxEvidence, polynomials
from synthesis.certify.questions.certificate import Certificate, Proof
from synthesis.certify.questions.hypotheses import hypotheses
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import Kind
from synthesis.certify.statement.outcome import Seconds, Status
from synthesis.certify.statement.units import Scaling
from synthesis.claims.contradicted import Found, driven, moving
from synthesis.claims.inequality import value_at
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.verdict import NOT_BY_THIS, PROVEN, UNDECIDED, Place
from synthesis.numerics.polynomial.definite import first_miss
from synthesis.numerics.polynomial.direction import not_positive
from synthesis.numerics.polynomial.exact import rational
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import pieces

FROZEN = 201
"""Values of one parameter at which the model at rest is looked at."""
SLACK = 1e-6
"""Part by which a computed gain or rate has to miss the bound before a claim is called false."""


def certificate(model: LPVStateSpace, claim: LyapunovClaim) -> Certificate:
    """Return the certificate that the claim would be; nothing is checked but its form.

    Raises `InputError` where P does not fit the model.
    """
    if claim.K is not None:
        raise InputError("close the loop of a model first: model.feedback(...), or --feedback")
    kind, motion = Kind.named(claim.kind), Motion.of(model.parameters)
    n = len(model.states)
    units = Scaling(np.eye(n), np.eye(n), 1.0, 1.0, np.eye(n))
    evidence = BoxEvidence(pieces(model), units, Demand(kind, motion))
    P = _function(model, claim)
    fault = evidence.fault(P, kind, motion.rates)
    if fault:
        raise InputError(fault)
    bounds: dict[str, Any] = dict.fromkeys(kind.facets.fields[:1], claim.bound)
    bounds |= {"l2 gain": {"lower": 0.0}, "decay rate": {"upper": math.inf}}.get(claim.kind, {})
    return Certificate(
        kind=kind, **bounds, status=Status.PROVEN, verified=True, rates=motion.rates,
        hypotheses=hypotheses(kind, model.parameters, motion.rates, model, ()),
        method="P given", solver="none", seconds=Seconds(), proof=Proof(evidence, P),
    )  # fmt: skip


def _function(model: LPVStateSpace, claim: LyapunovClaim) -> BoxLyapunov:
    ranges = [np.array([s.low, s.high]) for s in model.parameters]
    if claim.P.ndim == 2:
        one = claim.P.reshape(*(1,) * len(ranges), *claim.P.shape)
        return BoxLyapunov(tuple(ranges), (0,) * len(ranges), one)
    if claim.p is None or len(ranges) != 1 or len(claim.p) != len(claim.P):
        raise InputError(
            "P of several points is for a model of one parameter: give p, the points, one a P"
        )
    return BoxLyapunov((claim.p,), (1,), claim.P)


def judged(model: LPVStateSpace, claim: LyapunovClaim) -> tuple[str, str, Place | None]:
    """Return the answer about this P alone, the reason and the place."""
    cert = certificate(model, claim)
    assert cert.proof is not None  # noqa: S101
    evidence, P = cert.proof
    own: Any = evidence
    if not own.demand.meaningful(model.dt, P.degrees):
        return UNDECIDED, "P depends on p, and p may jump. The rate of p would decide", None
    every = list(polynomials(own.model, P, own.demand, claim.bound, rational()))
    open_: tuple[str, str, Place | None] | None = None
    for F in tracked("checking in rational arithmetic", every, len(every)):
        miss = first_miss(F)
        if miss is None:
            continue
        place = _place(F, miss.point, model) if miss.certain else None
        if place is not None and place.short > 0:
            return NOT_BY_THIS, "The inequality does not hold.", place
        near = ", ".join(f"{float(v):.6g}" for v in miss.point[: len(model.parameters)])
        open_ = (UNDECIDED, f"undecided near p = {near}: equality, or too little margin", place)
    if open_ is None and not own.checked_independently(P, claim.bound, rational()):
        open_ = UNDECIDED, "the model's own matrices do not confirm its polynomial pieces", None
    return open_ or (PROVEN, "", None)


def _place(F: Any, point: Sequence[Any], model: LPVStateSpace) -> Place | None:
    M = -value_at(F, tuple(point))
    found = not_positive(M)
    if found is None:
        return None
    form, x = found
    size = sum(v * v * abs(M[i, i]) for i, v in enumerate(x)) or sum(v * v for v in x)
    own = [float(v) for v in point[: len(model.parameters)]]
    words = ", ".join(f"{s.name} = {v:.9g}" for s, v in zip(model.parameters, own, strict=True))
    x = np.array([float(v) for v in x])
    return Place(words, own[0], x / np.abs(x).max(), float(-form / size))


@dataclass(frozen=True)
class ShiftedModel:
    """A model of one parameter whose states grow faster by the decay rate of a claim."""

    model: LPVStateSpace
    shift: float

    @property
    def scheduling(self) -> Any:
        """The parameter: its range and rate."""
        return self.model.scheduling

    @property
    def states(self) -> Any:
        """Names of the states."""
        return self.model.states

    @property
    def dt(self) -> float | None:
        """Sample period, s."""
        return self.model.dt

    def matrices(self, p: Any, /) -> Matrices:
        """A + shift I (sampled: exp(shift dt) A), B, C, D at p (...)."""
        A, B, C, D = self.model.matrices(p)
        if self.dt is None:
            return Matrices(A + self.shift * np.eye(A.shape[-1]), B, C, D)
        return Matrices(A * math.exp(self.shift * self.dt), B, C, D)


def contradiction(model: LPVStateSpace, claim: LyapunovClaim) -> Found | None:
    """Return what shows, computed, that the claim is false; None where nothing was found, and of
    several parameters but for models at rest.
    """
    if claim.kind == "l2 gain":
        own = frozen_gain(model)
        if own.gain > claim.bound * (1 + SLACK):
            return _at_rest(f"amplifies by {own.gain:.9g}, at {own.omega:.6g} rad/s", own.p)
    if len(model.parameters) != 1:
        return None
    shifted = ShiftedModel(model, claim.bound if claim.kind == "decay rate" else 0.0)
    (s,) = model.parameters
    for p in np.linspace(s.low, s.high, FROZEN):
        values = np.linalg.eigvals(shifted.matrices(float(p)).A)
        excess = values.real.max() if model.dt is None else np.abs(values).max() - 1
        if excess > SLACK * max(float(np.abs(values).max()), 1e-12):
            return _at_rest("does not decay as claimed", float(p))
    return moving([shifted], claim) or (
        driven([shifted], claim) if claim.kind == "l2 gain" else None
    )


def _at_rest(what: str, p: Any) -> Found:
    return Found(f"The model at rest at p = {p} {what}.", None, None, False)


def witness(model: LPVStateSpace) -> str:
    """Return the sentence that names two models without a common x'Px; empty where none is."""
    return no_common(pieces(model))
