"""Whether a P, K or V that somebody else computed proves what it says of a plant."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.threads import with_one_thread
from synthesis.claims import contradicted, departed, lyapunov, on_model, region, terminal
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import GridPlant, LimitedPlant, PolynomialPlant, VertexPlant
from synthesis.claims.proven_claim import ProvenClaim
from synthesis.claims.region_claim import RegionClaim
from synthesis.claims.terminal_claim import TerminalClaim
from synthesis.claims.verdict import FALSE, NOT_BY_THIS, PROVEN, Verdict


@with_one_thread
def check(plant: Any, claim: Any, *, refute: bool = True) -> Verdict:
    """Decide in exact arithmetic whether a P, K or V proves a claim about a plant.

    Every double is the rational that it is. Where the proof fails, motions that contradict the
    claim itself are looked for.

    Parameters
    ----------
    plant : VertexPlant, GridPlant, PolynomialPlant, LimitedPlant, LPVStateSpace or LinearModel
        The plant of the claim.
    claim : LyapunovClaim, RegionClaim or TerminalClaim
        The claim with what is said to prove it: the first about vertices, a grid or a model, the
        second about polynomials, the third about a plant with limits.
    refute : bool
        Whether motions are looked for, which takes some seconds.

    Returns
    -------
    Verdict
        Proven; this P does not prove it, with the place; the claim is false, with a motion; or not
        decided, with the reason.

    Raises
    ------
    InputError
        For a plant and a claim that do not fit each other.

    Examples
    --------
    Two modes of Sename's book, in exact arithmetic: no constant P exists.

    >>> from synthesis.claims import LyapunovClaim, VertexPlant
    >>> plant = VertexPlant([[[0, 1], [-1, -2]], [[0, 1], [-100, -20]]])
    >>> found = check(plant, LyapunovClaim("stability", [[2, 1], [1, 1]]), refute=False)
    >>> found.answer
    'this P does not prove it'
    >>> round(found.place.short, 3)
    0.354
    """
    if isinstance(plant, LinearModel):
        plant = VertexPlant(plant.A, plant.B, plant.C, plant.D, plant.dt)
    if isinstance(plant, LPVStateSpace) and isinstance(claim, LyapunovClaim):
        return _on_model(plant, claim, refute)
    for plants, kind, decide, _ in ROUTES:
        if isinstance(plant, plants) and isinstance(claim, kind):
            return decide(ProvenClaim(plant=plant, given=claim), refute)
    raise _unknown(plant, claim)


def proven(plant: Any, claim: Any) -> bool:
    """Whether the claim is proven, in rational arithmetic."""
    for plants, kind, _, holds in ROUTES:
        if isinstance(plant, plants) and isinstance(claim, kind):
            return bool(holds(plant, claim))
    raise _unknown(plant, claim)


def _unknown(plant: Any, claim: Any) -> InputError:
    return InputError(
        f"a {type(claim).__name__} about a {type(plant).__name__} is not known: a LyapunovClaim is"
        " about a VertexPlant or GridPlant, a RegionClaim about a PolynomialPlant, a TerminalClaim"
        " about a LimitedPlant"
    )


def _established(given: ProvenClaim) -> ProvenClaim:
    """Return the claim that has just been proven in rational arithmetic, as verified."""
    return replace(given, verified=True, why="")


def _head(given: ProvenClaim) -> dict[str, Any]:
    return {"claim": given.claim, "hypotheses": given.conditions}


def _linear(given: ProvenClaim, refute: bool) -> Verdict:
    plant, claim = given.plant, given.given
    head = _head(given)
    answer, reason, place = lyapunov.judged(plant, claim)
    if answer == PROVEN:
        return Verdict(answer=PROVEN, statement=_established(given), **head)
    found = contradicted.contradiction(plant, claim) if refute else None
    if found is not None:
        shown = {"place": found.place or place, "motion": found.motion, "exact": found.exact}
        return Verdict(answer=FALSE, reason=found.reason, **shown, **head)
    if answer == NOT_BY_THIS and len(claim.fitting(plant)[0]) == 1:
        reason = " ".join(filter(None, (reason, contradicted.no_common(plant, claim))))
    proves = lyapunov.proven_bound(plant, claim)
    proves = math.nan if claim.kind == "stability" else proves
    return Verdict(answer=answer, reason=reason, place=place, proves=proves, **head)


def _region(given: ProvenClaim, refute: bool) -> Verdict:
    plant, claim = given.plant, given.given
    answer, reason, place = region.judged(plant, claim)
    if answer == PROVEN:
        return Verdict(answer=PROVEN, statement=_established(given), **_head(given))
    small = reason != region.TOO_LARGE
    found = departed.departure(plant, claim) if refute and small else None
    if found is not None:
        shown = {"place": place, "motion": found.motion, "exact": found.exact}
        return Verdict(answer=FALSE, reason=found.reason, **shown, **_head(given))
    proves = region.proven_level(plant, claim) if small else math.nan
    return Verdict(answer=answer, reason=reason, place=place, proves=proves, **_head(given))


def _terminal(given: ProvenClaim, refute: bool) -> Verdict:
    answer, reason, place, motion = terminal.judged(given.plant, given.given)
    statement = _established(given) if answer == PROVEN else None
    shown = {"reason": reason, "place": place, "motion": motion, "statement": statement}
    return Verdict(answer=answer, **shown, **_head(given))


def _on_model(model: LPVStateSpace, claim: LyapunovClaim, refute: bool) -> Verdict:
    cert = on_model.certificate(model, claim)
    head: dict[str, Any] = {"claim": claim.sentence, "hypotheses": cert.conditions}
    answer, reason, place = on_model.judged(model, claim)
    if answer == PROVEN:
        return Verdict(answer=PROVEN, statement=cert if cert.verify() else None, **head)
    found = on_model.contradiction(model, claim) if refute else None
    if found is not None:
        shown = {"place": place, "motion": found.motion, "exact": found.exact}
        return Verdict(answer=FALSE, reason=found.reason, **shown, **head)
    if answer == NOT_BY_THIS and claim.P.ndim == 2:
        reason = "; ".join(filter(None, (reason, on_model.witness(model))))
    return Verdict(answer=answer, reason=reason, place=place, **head)


ROUTES: tuple[tuple[Any, Any, Any, Any], ...] = (
    (VertexPlant | GridPlant, LyapunovClaim, _linear, lyapunov.holds),
    (PolynomialPlant, RegionClaim, _region, region.holds),
    (LimitedPlant, TerminalClaim, _terminal, terminal.holds),
)
"""Plants, claims, what decides, and what proves again."""
