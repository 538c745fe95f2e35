"""The verdict "fit for control" counted against the exact models."""

from dataclasses import replace

import pytest

from evidence.marks.fit_for_control import KINDS, Outcome, campaign, outcome, table

FIT = Outcome("a", "long", "filter error", 1, "fit", {"J": "fit"}, 0.2, 0.25, 0.1, False)


def test_only_what_is_said_to_be_fit_and_is_not_is_wrong():
    assert not FIT.wrong
    assert replace(FIT, true_ratio=0.4).wrong
    assert replace(FIT, lost=True).wrong
    assert not replace(FIT, true_ratio=0.4, verdict="not known").wrong
    assert not replace(FIT, true_ratio=float("nan"), verdict="refused").is_fit


def test_the_table_counts_every_flight_once():
    some = [
        FIT,
        replace(FIT, true_ratio=0.4),
        replace(FIT, verdict="not known"),
        replace(FIT, kind="short", verdict="refused", ratio=float("nan"), true_ratio=float("nan")),
    ]
    rows = [line.split() for line in table(some).splitlines()]
    # fit, not known, not fit, refused, truly fit, wrong, d/b said, true
    assert rows[1][-8:] == ["2", "1", "0", "0", "2", "1", "0.25", "0.10"]
    assert rows[2][-8:] == ["0", "0", "0", "1", "0", "0", "nan", "nan"]
    assert rows[3] == ["all", "4", "2", "1", "0", "1", "2", "1", "0.25", "0.10"]


@pytest.mark.slow
def test_least_squares_never_says_that_a_model_is_fit():
    found = outcome("xcell60", "short", "ls", 1)
    assert found.verdict in ("not known", "not fit")
    assert found.rows["nu-gap over margin"] == "not known"
    assert found.true_ratio > 1 / 3  # and rightly: noise biases it


@pytest.mark.slow
def test_no_flight_of_a_small_campaign_is_wrongly_called_fit():
    found = [call() for call in campaign([1000])]
    assert len(found) == 2 * len(KINDS)
    assert not any(o.wrong for o in found)
    assert any(o.verdict == "fit" for o in found)  # saying nothing would be no art
