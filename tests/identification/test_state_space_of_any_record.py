"""State-space models of records as others log them: any units, trims, holes, sensors that do not
move.
"""

import numpy as np
import pytest
from test_state_space_methods import OMEGA, POINTS, System

import identification as idn

SYSTEM = System.drawn(3, 2, 2, 1, 1)


def changed(record, **columns):
    return record.with_signals(dict.fromkeys(columns, "1"), **columns)


@pytest.mark.parametrize("method", ["oe", "innovations"])
def test_units_of_signals_do_not_change_the_model(method):
    """Steps count as small in the unit of each unknown: a search must not end because one of them
    is a large number.
    """
    sizes = {"y0": 1e6, "y1": 1e-6, "u0": 1e-6, "u1": 1e6}
    record = SYSTEM.record(400, 2, noise=0.1)
    other = changed(record, **{name: size * record[name] for name, size in sizes.items()})
    mine, theirs = (idn.fit(SYSTEM.structure, each, method) for each in (record, other))
    per = np.outer([1e6, 1e-6], [1e6, 1e-6])
    for p in POINTS:
        exact = mine.at(p).frequency_response(OMEGA)
        found = theirs.at(p).frequency_response(OMEGA) / per
        # ends of two searches, which rounding leads apart
        np.testing.assert_allclose(found, exact, atol=1e-4 * np.abs(exact).max())
    np.testing.assert_allclose(theirs.score(other, 1).array, mine.score(record, 1).array, atol=0.01)


@pytest.mark.parametrize("n", [250, 400])
def test_rounding_does_not_choose_the_ridge_of_short_records(n):
    """As many features as windows: what is left and its freedom both vanish with the weight."""
    record = SYSTEM.record(n, 1, noise=0.1)
    beside = changed(record, y0=record["y0"] * (1.0 + 1e-12 * np.arange(n)))
    errors = [
        SYSTEM.error(idn.fit(SYSTEM.structure, each, "subspace")) for each in (record, beside)
    ]
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
    assert max(errors) < 0.1


def test_a_step_that_damping_keeps_short_does_not_end_a_search():
    """The likelihood of two ends that began a rounding error apart."""
    record = SYSTEM.record(400, 1, noise=0.1)
    beside = changed(record, y0=record["y0"] * (1.0 + 1e-12 * np.arange(400)))
    ends = [idn.fit(SYSTEM.structure, each, "innovations") for each in (record, beside)]
    left = [np.linalg.slogdet(found.residual_covariance)[1] for found in ends]
    assert left[0] == pytest.approx(left[1], abs=1e-4)
    assert all(found.details["converged"] for found in ends)
