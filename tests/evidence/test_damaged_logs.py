"""Damaged logs end in a model, a warning or a sentence: never in a traceback, never in a wrong
model without a word.
"""

import subprocess
import sys

import numpy as np
import pytest

from evidence import damaged_logs
from evidence.damaged_logs import all_of, damages, judged, logs, pitch_with_lost_rows, run


def unexpected(found):
    """The runs that end in a traceback or in a silent wrong model."""
    return [one for one in found if one[-1].kind in ("traceback", "wrong")]


@pytest.fixture
def short(monkeypatch):
    """One log of a minute in place of the five."""
    log = pitch_with_lost_rows(lost=30, seconds=60.0)
    monkeypatch.setattr(damaged_logs, "logs", lambda: (log,))
    return log


def test_one_damage_of_each_kind(short):
    found = all_of(every=4)
    assert len(found) == 10
    assert not unexpected(found)
    assert {one[-1].kind for one in found} > {"warned", "sound"}


def test_a_wrong_model_is_seen(tmp_path):
    """An input read at a third ties no two signals: nothing is said, and the measure finds it."""
    log = pitch_with_lost_rows()
    whole = run(log, log.rows, ",", tmp_path)

    def smaller(rows, rng):
        return damaged_logs._scaled(rows, rng, "d_lon", 0.3)

    assert judged(log, "unit", smaller, 0, whole, tmp_path).kind == "wrong"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1000])
def test_all_of_five_logs(seed):
    found = all_of(seed=seed)
    assert len(found) == 200
    assert not unexpected(found)


@pytest.mark.slow
def test_a_process_says_the_same(tmp_path):
    log = logs()[0]
    for k, (kind, _, damage) in enumerate(damages(log)):
        if k % 8 == 0:
            rows, by = damage(log.rows, np.random.default_rng(k))
            file = tmp_path / "log.csv"
            here = run(log, rows, by, tmp_path)
            words = [
                "-m",
                "studies.cli",
                "identify",
                str(file),
                *log.options,
                "--offset-rate",
                "no",
            ]
            there = subprocess.run(
                [sys.executable, *words], capture_output=True, text=True, timeout=60
            )
            assert "Traceback" not in there.stderr
            assert there.returncode == int(here.kind == "refused"), kind
