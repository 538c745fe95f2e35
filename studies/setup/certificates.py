"""One certificate for results.json."""

from __future__ import annotations

from typing import Any

from studies.setup.bounds import Bound, unit_of
from studies.setup.quantities import value


def bound_to_dict(b: Bound, proof: str | None = None) -> dict[str, Any]:
    """One certificate, and the file beside results.json that proves it."""
    c, unit = b.certificate, unit_of(b.channel)
    return {
        "model": b.model,
        "channel": b.channel,
        "kind": c.kind,
        "form": b.form,
        "permitted_acceleration": value(b.rate, "m/s^2"),
        "proven_gain": value(c.gamma, unit),
        "lower_bound": value(c.lower, unit),
        "frozen_gain": value(c.frozen, unit),
        "status": c.status.value,
        "verified": c.verified,
        "solver": c.solver,
        "time": value(sum(c.seconds), "s"),
        "hypotheses": list(c.hypotheses),
        "proof": proof,
    }
