"""Invariant sets as JSON files that are sufficient to prove them again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.values.arrays import frozen
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.sets.proven_set import ProvenSet
from synthesis.sets.statement import SetStatement

SIZES = ("disturbance", "state_bounds", "input_bounds")
"""Fields of a statement that are names and numbers; stored as pairs."""


def written(found: ProvenSet) -> dict[str, Any]:
    """Return what a file holds of the set; see `ProvenSet.stored`."""
    if not found.verified:
        raise InputError(f"only a proven set is saved; here {found.why}")
    own = found.statement
    return {
        "kind": type(found).__name__,
        **{name: list(getattr(own, name).items()) for name in SIZES},
        "controls": list(own.controls),
        "model": encoded(own.model),
        "feedback": encoded(own.feedback),
        **encoded(dict(found.shape_stored)),
    }


def read(content: Mapping[str, Any]) -> ProvenSet:
    """Return the set that a file holds, not yet verified."""
    from synthesis.sets.invariant_set import InvariantSet
    from synthesis.sets.low_complexity import LowComplexitySet

    model, feedback = _model(content["model"]), content["feedback"]
    feedback = None if feedback is None else _model(feedback)
    sizes = {name: dict(content[name]) for name in SIZES}
    controls = tuple(map(str, content["controls"]))
    statement = SetStatement(model=model, controls=controls, feedback=feedback, **sizes)
    why = "the inequalities do not hold in exact arithmetic"
    if content["kind"] == "LowComplexitySet":
        n = len(model.states)
        return LowComplexitySet(statement, frozen(decoded(content["V"]), "V", (n, n)), False, why)
    if content["kind"] != "InvariantSet":
        raise InputError(f"unknown kind of set {content['kind']!r:.60}")
    shape = _model(content["shape"])
    shares = frozen(decoded(content["shares"]), "shares", (None,))
    return InvariantSet(statement, shape, float(content["alpha"]), shares, False, why)


def _model(content: Any) -> LPVStateSpace:
    value = decoded(content)
    if not isinstance(value, LPVMatrices):
        raise InputError(f"expected an LPVStateSpace, got {value!r:.60}")
    return LPVStateSpace(**{f.name: getattr(value, f.name) for f in fields(value)})
