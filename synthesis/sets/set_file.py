"""Invariant sets as JSON files that are sufficient to prove them again."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from symheli.values.whole_files import write_text
from synthesis.certificate_file import DAMAGED, content_of, decoded, encoded
from synthesis.sets.statement import Statement

if TYPE_CHECKING:
    from synthesis.sets.invariant_set import InvariantSet

SCHEMA, VERSION = "symheli set", 1
SIZES = ("disturbance", "state_bounds", "input_bounds")
"""Fields of a statement that are names and numbers; stored as pairs."""


def written(found: InvariantSet, path: str | os.PathLike[str]) -> Path:
    """Write the set; see `InvariantSet.save`."""
    if not found.proven:
        raise InputError(f"only a proven set is saved; here {found.why}")
    own = found.statement
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        **{name: list(getattr(own, name).items()) for name in SIZES},
        "controls": list(own.controls),
        "model": encoded(own.model),
        "feedback": encoded(own.feedback),
        "shape": encoded(found.shape),
        "alpha": encoded(found.alpha),
        "shares": encoded(found.shares),
    }
    return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str]) -> InvariantSet:
    """Read a set and prove it again; see `InvariantSet.load`."""
    content = content_of(path, SCHEMA, VERSION, "an invariant set", "InvariantSet.save")
    try:
        with np.errstate(all="ignore"):
            return _proven(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except DAMAGED as error:
        raise InputError(f"{path}: damaged, a value is invalid or missing ({error})") from None


def _proven(content: dict[str, Any]) -> InvariantSet:
    from synthesis.sets.invariant_set import InvariantSet

    model, shape, feedback = (decoded(content[name]) for name in ("model", "shape", "feedback"))
    for value in (model, shape, *([] if feedback is None else [feedback])):
        if not isinstance(value, LPVStateSpace):
            raise InputError(f"expected an LPVStateSpace, got {value!r:.60}")
    sizes = {name: dict(content[name]) for name in SIZES}
    controls = tuple(map(str, content["controls"]))
    statement = Statement(model=model, controls=controls, feedback=feedback, **sizes)
    found = InvariantSet(
        statement, shape, float(content["alpha"]), np.asarray(decoded(content["shares"]), float),
        False, "the inequalities do not hold in exact arithmetic",
    )  # fmt: skip
    return found.established()
