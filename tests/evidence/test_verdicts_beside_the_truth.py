"""The verdict "fit for control" counted against the exact models."""

from dataclasses import replace

import numpy as np

from evidence.marks.fit_for_control import (
    CASES,
    Outcome,
    by_correlation,
    table,
)

FIT = Outcome(
    seed=1,
    loop="lateral",
    verdict="fit",
    rows={"J": "fit"},
    said=0.5,
    true=0.2,
    bounds=(0.1, 0.2),
    gaps=(0.05, 0.3),
)


def test_the_table_counts_what_is_called_fit_beside_what_is():
    some = [
        FIT,
        replace(FIT, true=1.2),
        replace(FIT, verdict="not known"),
        replace(FIT, true=1.2, verdict="not known"),
        Outcome(seed=2, loop="lateral", verdict="refused", rows={}),
    ]
    rows = table("xcell60", {"ideal": [some]}).splitlines()
    cells = [cell.strip() for cell in rows[-1].strip("|").split("|")]
    assert cells == ["all", "1 of 2", "1 of 2", "1.20 (1)", "50.0", "1.33", "1"]


def test_verdicts_are_counted_again_for_other_correlations():
    """Gaps of .3 and .4 at two points, margin .6: .5, .61 and .7 with correlations 0, .5 and 1."""
    close = replace(
        FIT,
        rows={"nu-gap over margin": "not known", "J": "fit"},
        gaps=(0.55, 0.65),
        within=(0.3, 0.3),
        left=(0.4, 0.4),
        margins=(0.6, 0.6),
    )
    noisy = replace(close, rows={**close.rows, "J": "not known"}, true=1.2)
    some = [close, replace(close, true=1.2), noisy]
    rows = by_correlation({"ideal": [some]}).splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert cells[0] == ["0", "1 of 2", "1 of 1", "0.0"]
    assert cells[2] == ["0.5", "0 of 2", "0 of 1", "50.0"]
    assert cells[4] == ["1", "0 of 2", "0 of 1", "100.0"]


def test_an_estimate_whose_own_loop_is_unstable_is_not_fit():
    assert not replace(FIT, true=np.inf).is_fit


def test_what_is_not_said_is_not_in_the_log():
    """Commands stand where deflections would, and the plan has neither servos nor delay."""
    case = CASES["servos untold"]
    record = case.flown.flights(case.flown.helicopter("xcell60"), 1000)[0].between(0.0, 10.0)
    log = case.log(record)
    assert np.array_equal(log["d_lat"], record["d_lat_command"])
    assert (log.meta["plan"].servos, log.meta["plan"].delay) == (None, 0.0)
    assert CASES["servos"].log(record) is record
