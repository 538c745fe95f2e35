"""Plants and claims as JSON holds them, in the files of proven claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from symheli.errors import InputError
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.claims import monomials
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import (
    GridPlant,
    LimitedPlant,
    PolynomialPlant,
    VertexPlant,
    rationals,
)
from synthesis.claims.region import region_of
from synthesis.claims.region_claim import RegionClaim
from synthesis.claims.terminal import highest, rows
from synthesis.claims.terminal_claim import TerminalClaim

PLANTS: dict[str, Any] = {
    "vertices": VertexPlant,
    "grid": GridPlant,
    "polynomial": PolynomialPlant,
    "limited": LimitedPlant,
}
CLAIMS: dict[str, Any] = {
    "lyapunov": LyapunovClaim,
    "region": RegionClaim,
    "terminal": TerminalClaim,
}


def written(plant: Any, claim: Any) -> dict[str, Any]:
    """Return what a file holds of a plant and a claim."""
    found = {
        "kind": "claim",
        "plant": {"type": _word(plant, PLANTS), **_values(plant)},
        "claim": {"type": _word(claim, CLAIMS), **_values(claim)},
    }
    if isinstance(plant, PolynomialPlant):
        V = monomials.monomials(claim.V, plant.states)
        found["plant"]["f"] = [monomials.stored(f) for f in plant.fields]
        found["claim"] |= {"V": monomials.stored(V), "rho": str(claim.rho)}
        region = region_of(plant, claim)
        found["box"] = [] if region is None else [str(u) for u in region.units]
    if isinstance(plant, LimitedPlant) and claim.H is not None:
        found["multipliers"] = _multipliers(plant, claim)
    return found


def _word(value: Any, among: Mapping[str, Any]) -> str:
    return next(word for word, kind in among.items() if type(value) is kind)


def _values(value: Any) -> dict[str, Any]:
    skipped = {PolynomialPlant: {"f"}, RegionClaim: {"V", "rho"}}.get(type(value), set())
    return {f.name: encoded(getattr(value, f.name)) for f in fields(value) if f.name not in skipped}


def _multipliers(plant: LimitedPlant, claim: TerminalClaim) -> list[Any]:
    """Return y >= 0 of every condition on the polytope, as rationals in texts."""
    H, h = rationals(claim.H), rationals(claim.h)
    found = (highest(H, h, row.a, row.b).y for row in rows(plant, claim))
    return [[] if y is None else [str(v) for v in y] for y in found]


def restored(content: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the plant and the claim of `written`; raises `InputError` for other values."""
    kinds = content["plant"]["type"], content["claim"]["type"]
    if content["kind"] != "claim" or kinds[0] not in PLANTS or kinds[1] not in CLAIMS:
        raise InputError(f"expected a claim about a plant, got {kinds!r:.60}")
    plant, claim = (
        {name: value for name, value in content[part].items() if name != "type"}
        for part in ("plant", "claim")
    )
    if kinds[0] == "polynomial":
        states = tuple(map(str, plant["states"]))
        f = [monomials.restored(each, len(states)) for each in plant["f"]]
        V = monomials.restored(claim["V"], len(states))
        return PolynomialPlant(states, f), RegionClaim(V, str(claim["rho"]))
    own = ({name: decoded(value) for name, value in values.items()} for values in (plant, claim))
    return PLANTS[kinds[0]](**next(own)), CLAIMS[kinds[1]](**next(own))
