"""A few random plants of every kind of statement: no proof is false, and the truth is near."""

import math

import pytest

from evidence.attack import KINDS, attacked, table

LONG = ("robust margin",)
"""Kinds of which one trial may take a minute, because of thousands of intervals of frequency."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_proof_is_false(kind):
    count = 1 if kind in LONG else 3
    row = attacked(kind, count, seed=10_000)
    assert row.trials == count
    assert row.false == ()
    assert not row.largest > 1 + 1e-6


def test_a_false_proof_would_be_counted(monkeypatch):
    """A kind whose bound is too small by a tenth."""
    from evidence import attack

    monkeypatch.setitem(attack.KINDS, "l2 gain", lambda rng: attack.Trial(1.0 / 0.9))
    row = attack.attacked("l2 gain", 4)
    assert row.false == (0, 1, 2, 3)
    assert "| l2 gain | 4 | 4 | 0 | 4 | 1.1111" in table([row])
    monkeypatch.setitem(attack.KINDS, "l2 gain", lambda rng: attack.NOTHING)
    assert math.isnan(attack.attacked("l2 gain", 2).median)
