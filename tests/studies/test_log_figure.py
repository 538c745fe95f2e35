"""The picture of a fit shows what was scored."""

import numpy as np
import pytest

from identification import LPVARX, Polynomial
from identification.judge import compare_constant
from studies.log.figure import COLOURS, _until_lost, figure
from symheli.records import FlightRecord


def test_the_picture_holds_the_predictions_that_were_scored():
    t = 0.05 * np.arange(400)
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal(400), np.zeros(400)
    for k in range(1, 400):
        y[k] = (0.9 - 0.05 * np.sin(t[k - 1])) * y[k - 1] + u[k - 1] + 0.1 * rng.standard_normal()
    record = FlightRecord.from_arrays(t, {"y": "rad", "u": "1", "p": "m/s"}, y=y, u=u, p=np.sin(t))
    training, test = record.split(0.7)
    result = compare_constant(
        LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=Polynomial(1, -1.0, 1.0)), training, test
    )
    drawn, close, scheduling, _ = figure(result).axes
    lines = {}
    for line in drawn.lines:
        lines.setdefault(line.get_color(), []).append(line.get_ydata())
    model = result.scheduled
    for horizon, n in (("one step", 1), ("1 s", 20), ("free run", None)):
        own = [line for line in lines[COLOURS[horizon]] if len(line) == len(test)]
        np.testing.assert_array_equal(
            own[0], (model.simulate(test) if n is None else model.predict(test, n))[:, 0]
        )
    assert drawn.get_title(loc="left").startswith("y (rad): LPV, degree 1 ")
    assert scheduling.get_title(loc="left") == "p (m/s)"
    assert close.get_xlim() == pytest.approx((test.time[0], test.time[-1]))


def test_a_run_that_leaves_is_drawn_to_there_and_begins_anew_behind_a_gap():
    t = 0.1 * np.arange(60)
    t[30:] += 5.0
    y = np.sin(t)
    record = FlightRecord.from_arrays(t, {"y": "rad"}, y=y)
    away = y.copy()
    away[10:30] *= 10.0 ** np.arange(20)
    shown = _until_lost(record, away[:, None], y[:, None])[:, 0]
    lost = np.flatnonzero(np.isnan(shown))
    np.testing.assert_array_equal(lost, np.arange(lost[0], 30))
    assert 10 < lost[0] < 14
    np.testing.assert_array_equal(np.delete(shown, lost), np.delete(away, lost))
