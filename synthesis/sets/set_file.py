"""Invariant sets as JSON files that are sufficient to prove them again."""

from __future__ import annotations

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.values.arrays import frozen
from symheli.values.whole_files import write_text
from synthesis.certify.questions.certificate_file import DAMAGED, content_of, decoded, encoded
from synthesis.sets.proven_set import ProvenSet
from synthesis.sets.statement import SetStatement

SCHEMA, VERSION = "symheli set", 1
SIZES = ("disturbance", "state_bounds", "input_bounds")
"""Fields of a statement that are names and numbers; stored as pairs."""


def written(found: ProvenSet, path: str | os.PathLike[str]) -> Path:
    """Write the set; see `InvariantSet.save`."""
    if not found.verified:
        raise InputError(f"only a proven set is saved; here {found.why}")
    own = found.statement
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        "kind": type(found).__name__,
        **{name: list(getattr(own, name).items()) for name in SIZES},
        "controls": list(own.controls),
        "model": encoded(own.model),
        "feedback": encoded(own.feedback),
        **encoded(dict(found.stored)),
    }
    return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str], kind: type[Any] | None = None) -> Any:
    """Read a set, of this kind where one is given, and prove it again; see `InvariantSet.load`."""
    content = content_of(path, SCHEMA, VERSION, "a set", "InvariantSet.save")
    try:
        with np.errstate(all="ignore"):
            found = _read(content)
            if kind is not None and not isinstance(found, kind):
                raise InputError(f"expected {kind.__name__}, got {type(found).__name__}")
            return found.established()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except DAMAGED as error:
        raise InputError(f"{path}: damaged, a value is invalid or missing ({error})") from None


def _read(content: dict[str, Any]) -> ProvenSet:
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
