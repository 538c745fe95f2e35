"""What may be done to a record before a fit, and what must survive it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification import LPVARX, Polynomial, fit
from symheli import FlightRecord
from symheli.errors import InputError, UnknownNameError
from symheli.records import decimate, low_pass, split, with_norm

DT = 0.02


def record(n=2000, noise=0.0):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(n)
    y = lfilter([0.0, 0.5], [1.0, -1.5, 0.7], u) + noise * rng.standard_normal(n)
    return FlightRecord.from_arrays(
        DT * np.arange(n), {"y": "rad", "u": "1", "p": "m/s"}, y=y, u=u, p=np.full(n, 5.0)
    )


ARX = LPVARX(("y",), ("u",), "p", na=2, nb=1, delay=1, basis=Polynomial(0, 0.0, 13.0))


@pytest.mark.parametrize("zero_phase", [False, True])
def test_one_filter_on_all_signals_keeps_a_linear_relation(zero_phase):
    clean = record()
    filtered = low_pass(clean, 8.0, 2, zero_phase=zero_phase, leave=["p"])
    theta = fit(ARX, filtered.between(2.0, 38.0)).theta[:, 0]
    # away from the ends the filter has forgotten how it started
    np.testing.assert_allclose(theta, [-1.5, 0.7, 0.5], atol=1e-6)
    assert (
        filtered["u"].std() < 0.9 * clean["u"].std()
    )  # white noise loses what is above the corner
    np.testing.assert_array_equal(filtered["p"], clean["p"])


def test_a_filter_starts_settled_and_passes_what_is_below_its_corner():
    t = DT * np.arange(1000)
    rec = FlightRecord.from_arrays(
        t, {"a": "1", "b": "1"}, a=np.full(1000, 3.0), b=np.sin(2 * np.pi * 0.2 * t)
    )
    out = low_pass(rec, 5.0, zero_phase=True)
    np.testing.assert_allclose(out["a"], 3.0, rtol=1e-9)
    np.testing.assert_allclose(out["b"][50:-50], rec["b"][50:-50], atol=1e-3)
    np.testing.assert_allclose(low_pass(rec, 5.0)["a"], 3.0, rtol=1e-9)


def test_nothing_crosses_a_gap_or_a_missing_sample():
    rec = record(400)
    values, time = rec.values.copy(), rec.time.copy()
    values[100, 0] = np.nan
    time[200:] += 5.0
    holed = FlightRecord(time, values, rec.signals)
    out = low_pass(holed, 5.0)
    assert np.isnan(out["y"]).sum() == 1
    alone = low_pass(FlightRecord(time[200:], values[200:], rec.signals), 5.0)
    np.testing.assert_allclose(
        out["y"][200:], alone["y"], rtol=1e-9
    )  # the median step rounds differently
    changed = values.copy()
    changed[50, 0] += 1.0
    again = low_pass(FlightRecord(time, changed, rec.signals), 5.0)
    np.testing.assert_array_equal(out["y"][101:], again["y"][101:])


def test_the_callers_record_is_never_changed():
    rec = record(300)
    before = rec.values.copy()
    low_pass(rec, 5.0), decimate(rec, 3), split(rec, 0.5), with_norm(rec.select(["u"]), ["u"])
    np.testing.assert_array_equal(rec.values, before)


def test_impossible_filters_are_refused():
    with pytest.raises(InputError, match="half the sampling frequency"):
        low_pass(record(100), 25.0)
    with pytest.raises(UnknownNameError):
        low_pass(record(100), 5.0, leave=["speed"])


@pytest.mark.parametrize("n", [2, 3, 7])
@pytest.mark.parametrize("lost", [(40,), (40, 44, 90), (50, 51), tuple(range(60, 73))])
def test_means_lie_inside_parts_and_show_the_gaps(n, lost):
    time = 0.02 * np.arange(200)
    kept = np.delete(np.arange(200), lost)
    rec = FlightRecord.from_arrays(time[kept], {"k": "1"}, k=kept.astype(float))
    slow = decimate(rec, n)
    assert slow.dt == pytest.approx(0.02 * n)
    np.testing.assert_allclose(slow["k"], slow.time / 0.02)  # means of instants in a row
    spans = [slow["k"] - (n - 1) / 2, slow["k"] + (n - 1) / 2]
    for k in lost:
        assert not np.any((spans[0] <= k) & (k <= spans[1]))
        assert any(
            slow["k"][part.start] > k for part in slow.segments()[1:]
        )  # a part begins behind it


def test_more_samples_than_any_part_has_are_refused():
    kept = np.delete(np.arange(60), [10, 20, 30, 40, 50])
    rec = FlightRecord.from_arrays(0.02 * kept, {"k": "1"}, k=kept.astype(float))
    with pytest.raises(InputError, match="the longest part without a gap has 10 of the 55"):
        decimate(rec, 9)
