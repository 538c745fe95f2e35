"""results.json is what its schema says, with nothing left out and nothing more."""

import copy
import json
import re
from pathlib import Path

import pytest
from json_schema import faults

import studies
from studies.transition.outcome import Outcome
from studies.transition.results import SCHEMA, to_dict

ROOT = Path(studies.__file__).parent
SCHEMA_FILE = json.loads((ROOT / "transition" / "results.schema.json").read_text(encoding="utf-8"))


def keys(schema):
    """Every property that the schema names, wherever."""
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        for part in schema.values():
            yield from keys(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from keys(part)


def test_an_empty_outcome_is_valid():
    found = to_dict(Outcome(vehicle="xcell60", quick=True, seed=0))
    assert not list(faults(found, SCHEMA_FILE))
    assert found["schema"] == SCHEMA == SCHEMA_FILE["properties"]["schema"]["const"]


def test_keys_are_snake_case():
    assert not [key for key in keys(SCHEMA_FILE) if not re.fullmatch(r"[a-z][a-z0-9_]*", key)]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda r: r.pop("seed"), "$: seed is missing"),
        (lambda r: r.update(more=1), "$: more is not in the schema"),
        (lambda r: r["horizon"].update(unit="ms"), "$.horizon.unit: expected 's', got 'ms'"),
        (lambda r: r.update(complete=1), "$.complete: expected boolean, got 1"),
        (lambda r: r["horizon"].update(value=None), "$.horizon.value: expected"),
        (lambda r: r.update(flights=[{}]), "$.flights[0]: samples is missing"),
    ],
)
def test_what_the_schema_forbids_is_found(change, sentence):
    found = copy.deepcopy(to_dict(Outcome(vehicle="xcell60", quick=True, seed=0)))
    change(found)
    assert any(sentence in fault for fault in faults(found, SCHEMA_FILE))
