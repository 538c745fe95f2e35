"""What is done to a log, what is read of it again, and what the table says of it."""

import warnings

import numpy as np
import pytest

import symheli
from evidence.marks import damaged
from symheli.errors import DataWarning


@pytest.fixture(scope="module")
def flight(ideal):
    plan = symheli.AirspeedSchedule((6.0, 0.0), (2.0, 2.0), (4.0, 4.0), start=3.0)
    excitation = symheli.Excitation(dict.fromkeys(ideal.inputs, 0.01), seed=3)
    return symheli.fly(ideal, plan, excitation=excitation, noise_db=30.0, seed=1)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("rows", None),
        ("jitter", "the stamps scatter by up to 0.0002 s"),
        ("gap", None),
        ("frozen", "stands still from"),
        ("25 Hz", "u, v, w: a new value every 2 samples"),
    ],
)
def test_a_damage_is_said_and_what_is_left_is_of_the_flight(ideal, flight, tmp_path, name, said):
    logged = damaged.DAMAGES[name][1](flight, np.random.default_rng(1))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = damaged.read_again(logged, tmp_path)
    notes = [str(w.message) for w in told if w.category is DataWarning]
    assert len(notes) == bool(said)
    assert all(said in note for note in notes)
    rows = np.rint(found.time / flight.dt).astype(int)
    np.testing.assert_allclose(found.time, flight.time[rows], rtol=0, atol=1e-4)
    known = np.isfinite(found.values)
    np.testing.assert_array_equal(found.values[known], flight.values[rows][known])
    assert len(symheli.flight.SimulatedFlight(ideal).flown(found)) == len(found)


def test_a_row_compares_medians_and_names_the_seed_that_loses_most():
    marks = [
        damaged.Marks(seed=k, gaps={"none": 0.1, "gap": g}, wrong={"none": 1, "gap": k}, said={})
        for k, g in enumerate((0.1, 0.11, 0.3))
    ]
    row = damaged.row("filter error", "gap", marks)
    assert row[2:8] == ("0.100, 0.100", "0.110, 0.300", "1.10", "3.00 (2)", "met", "3, 3 of 81")
    assert damaged.row("filter error", "gap", marks[1:])[6] == "MISSED"


def test_the_comparison_has_twice_the_variance_of_noise_and_no_mark(ideal, flight):
    clean = symheli.flight.SimulatedFlight(ideal).flown(flight)
    noisier = damaged.more_noise(flight, np.random.default_rng(1))
    added = [np.std(noisier[name] - flight[name]) / clean[name].std() for name in damaged.SLOW]
    np.testing.assert_allclose(added, 10 ** (-30 / 20), rtol=0.1)
    np.testing.assert_array_equal(noisier["q"], flight["q"])
    marks = [damaged.Marks(seed=0, gaps={"none": 0.1, "noise": 0.2}, wrong={}, said={})]
    assert damaged.row("filter error", "noise", marks)[6] == ""
