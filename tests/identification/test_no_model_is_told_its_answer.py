"""Scheduling signals that carry the outputs, samples made of others, regressors that repeat each
other: said, and kept out of scores.
"""

import warnings

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from symheli import lpv
from symheli.errors import DataWarning, ExcitationError, InputError
from symheli.records import FlightRecord

STRUCTURES = {
    "lag": dict(
        outputs=("a", "b"), inputs=("u",), na=3, nb=2, delay=1, offset=True, offset_rate=True
    ),
    "now": dict(
        outputs=("a", "b"), inputs=("u",), na=3, nb=1, delay=2, offset=True, scheduling_at="now"
    ),
    "feedthrough": dict(
        outputs=("a", "b"), inputs=("u",), na={"a": 1, "b": {"a": 0, "b": 2}}, nb=2, delay=0
    ),
    "inputs alone": dict(outputs=("a", "b"), inputs=("u",), na=0, nb=2, delay=1),
}


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("horizon", [1, 2, 3, 7])
def test_holding_p_is_a_free_run_of_a_record_whose_p_stays_where_the_prediction_starts(
    name, horizon
):
    truth = Truth(structure(**STRUCTURES[name]))
    record = truth.record(moving(200), noise=0.2)
    model = idn.fit(truth.arx, record)
    ahead, memory = model.predict(record, horizon, hold_p=True), truth.arx.memory
    for last in (memory - 1, memory, 90, 150):
        held = record["p"].copy()
        held[last + 1 :] = held[last]
        still = record.with_signals({"p": "1"}, p=held).rows(slice(last + 1 - memory, None))
        np.testing.assert_allclose(
            ahead[last + horizon], model.simulate(still)[memory + horizon - 1], atol=1e-11
        )
    assert np.isnan(ahead[: memory + horizon - 1]).all()
    assert np.isfinite(ahead[memory + horizon - 1 :]).all()


def test_holding_p_reaches_over_no_gap_and_no_missing_sample_and_changes_nothing_where_p_rests():
    truth = Truth(structure(**STRUCTURES["lag"]))
    record = truth.record(moving(200), noise=0.2)
    model = idn.fit(truth.arx, record)
    time, values = record.time.copy(), record.values.copy()
    time[100:] += 3.0
    values[150, 0] = np.nan
    holed = FlightRecord(time, values, record.signals)
    open_, held = (
        np.isfinite(model.predict(holed, 4, hold_p=hold)).all(axis=1) for hold in (False, True)
    )
    np.testing.assert_array_equal(open_, held)
    rests = record.with_signals({"p": "1"}, p=np.full(200, 5.0))
    np.testing.assert_allclose(
        model.predict(rests, 9, hold_p=True), model.predict(rests, 9), atol=1e-11
    )
    with pytest.raises(InputError, match="a free run follows p from its start"):
        model.score(record, hold_p=True)
    with pytest.raises(InputError, match="horizon"):
        model.predict(record, 0, hold_p=True)


def wandering(n=4000, seed=0):
    """An output that wanders by itself and hardly by its input, and itself through a low-pass as a
    scheduling signal.
    """
    rng = np.random.default_rng(seed)
    u, y, p = rng.standard_normal(n), np.zeros(n), np.zeros(n)
    for k in range(1, n):
        y[k] = 0.97 * y[k - 1] + 0.02 * u[k - 1] + 0.2 * rng.standard_normal()
        p[k] = p[k - 1] + 0.2 * (y[k] - p[k - 1])
    return FlightRecord.from_arrays(0.05 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p)


def test_a_filtered_output_as_p_predicts_everything_until_p_is_held():
    record = wandering()
    basis = idn.Polynomial(1, *np.quantile(record["p"], [0, 1]))
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis, offset=True, offset_rate=True)
    with pytest.warns(
        DataWarning, match=r"p is made of the outputs \(100 % of what is new .* with offset_rate"
    ):
        told = idn.fit(arx, record)
    assert told.score(record)["y"] > 99  # 200 s in free run of a process that nobody can predict
    honest = told.score(record, 20, hold_p=True)["y"]
    # what is left of it: 0.97^20 of the value now
    best = 100 * (1 - np.sqrt(1 - 0.97**40))
    assert honest < best + 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (
            idn.fit(
                idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis, offset=True), record
            ).score(record, 20)["y"]
            < 60
        )


def test_a_command_is_not_taken_for_a_measurement():
    arx = structure(offset=True, offset_rate=True)
    record = Truth(arx).record(moving(600), noise=0.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        idn.fit(arx, record)


@pytest.mark.parametrize("flag", [dict(offset_rate=True), dict(scheduling_at="now")])
def test_an_output_that_would_predict_itself_is_refused(flag):
    with pytest.raises(InputError, match="its own value at k would predict it"):
        idn.LPVARX("y", "u", "y", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0), **flag)


@pytest.mark.parametrize(
    "basis",
    [
        idn.Polynomial(2, -9.0, 9.0),
        lpv.BSpline(2, (-9.0, 0.0, 9.0)),
        lpv.PiecewiseLinear((-9.0, 0.0, 9.0)),
    ],
)
@pytest.mark.parametrize("twice", ["y", "u"])
def test_an_output_or_input_that_schedules_itself_is_told_that_excitation_cannot_help(basis, twice):
    """theta(k-1) f0 is f1: by algebra, on whatever record."""
    record = wandering()
    arx = idn.LPVARX("y", "u", twice, na=1, nb=1, delay=1, basis=basis, offset=True)
    with pytest.raises(
        ExcitationError,
        match=(
            f"{twice} schedules .* by algebra, so that more excitation cannot help; set"
            " offset=False"
        ),
    ):
        idn.fit(arx, record)
    idn.fit(
        idn.LPVARX("y", "u", twice, na=1, nb=1, delay=1, basis=basis), record
    )  # the cure that is named


def test_poor_excitation_of_a_model_that_schedules_itself_is_still_called_so():
    record = wandering()
    still = record.with_signals({"u": "1"}, u=np.zeros(len(record)))
    with pytest.raises(ExcitationError, match="excite the inputs more richly"):
        idn.fit(
            idn.LPVARX("y", "u", "y", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -9.0, 9.0)),
            still,
        )


def delayed(n=8000, seed=0):
    """y(k) = 0.98 y(k-1) + u(k-1), p at rest, u a random walk of steps."""
    rng = np.random.default_rng(seed)
    u, y = np.repeat(rng.standard_normal(n // 10), 10), np.zeros(n)
    for k in range(1, n):
        y[k] = 0.98 * y[k - 1] + 0.1 * u[k - 1]
    return FlightRecord.from_arrays(
        0.01 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=np.zeros(n)
    )


@pytest.mark.parametrize(
    "slower",
    [
        lambda r: r.decimate(4),
        lambda r: r.resample(0.04),
        lambda r: r.low_pass(5.0).resample(0.04),
        lambda r: r.resample(0.013),
    ],
)
def test_samples_made_of_others_hear_their_input_at_once_and_the_record_remembers(slower):
    """An output that hears its input one sample later hears it in the same mean, or between the
    samples that are left.
    """
    record = slower(delayed())
    fits = {}
    for delay in (0, 1):
        arx = idn.LPVARX("y", "u", "p", na=1, nb=2, delay=delay, basis=idn.Polynomial(0, -1.0, 1.0))
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            fits[delay] = idn.fit(arx, record).score(record, 1)["y"]
        told = [str(w.message) for w in said if w.category is DataWarning]
        assert len(told) == delay
        assert all(
            f"the samples are {record.resampled}: y(k) may depend on u(k), and delay 1 leaves"
            " that out" in t
            for t in told
        )
    assert 100 - fits[0] < 0.8 * (100 - fits[1])


def test_what_leaves_samples_as_they_are_leaves_no_mark():
    record = delayed()
    assert not record.resampled
    for same in (
        record.resample(0.01),
        record.low_pass(5.0),
        record.select(["y"]),
        record.rows(slice(5, 90)),
        record.decimate(1),
    ):
        assert not same.resampled
    assert record.decimate(2).select(["y"]).rows(slice(9)).resampled == "means of 2 samples"
