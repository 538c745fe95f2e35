"""Data that cannot be meant: a sentence that says what is wrong, never somebody else's traceback
nor a number.
"""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from symheli.errors import ExcitationError, InputError, SymheliError
from symheli.records import FlightRecord, smooth

TRUTH = Truth(structure())
RECORD = TRUTH.record(moving(300))


def with_columns(dt=0.1, units=None, **over):
    columns = {name: RECORD[name] for name in "yup"} | over
    n = len(next(iter(over.values()), RECORD.time))
    return FlightRecord.from_arrays(
        dt * np.arange(n),
        dict.fromkeys("yup", "1") | (units or {}),
        **{k: v[:n] for k, v in columns.items()},
    )


@pytest.mark.parametrize("method", ["ls", "rls", "ridge", idn.methods.InstrumentalVariables("u")])
@pytest.mark.parametrize(
    "over",
    [dict(y=np.full(300, np.nan)), dict(y=np.zeros(2)), dict(p=np.full(300, np.nan))],
    ids=["no output", "two samples", "no p"],
)
def test_a_record_without_a_single_regressor_is_refused_with_the_count(over, method):
    with pytest.raises(ExcitationError, match="0 usable samples cannot determine 12 coefficients"):
        idn.fit(TRUTH.arx, with_columns(**over), method=method)


def test_a_memory_longer_than_the_record_is_refused():
    with pytest.raises(ExcitationError, match="0 usable samples"):
        idn.fit(structure(delay=5000), RECORD)


@pytest.mark.parametrize("size", [1e-150, 1e100])
@pytest.mark.parametrize("method", ["ls", "rls", "oe"])
def test_sizes_whose_squares_no_float_holds_are_refused(size, method):
    with pytest.raises(InputError, match=r"y reaches .* check its unit"):
        idn.fit(TRUTH.arx, with_columns(y=size * RECORD["y"]), method=method)


@pytest.mark.parametrize(
    "method",
    [
        *("ls", "rls", "ridge", "lasso", "oe"),
        idn.methods.InstrumentalVariables("u"),
        idn.methods.RefinedInstruments("u"),
    ],
)
def test_sizes_of_signals_do_not_matter_to_any_method(method):
    """An altitude of 1e5 m beside a rate of 1e-3 rad/s: predictions are those of the scaled
    record.
    """
    truth = Truth(structure(outputs=("h", "q"), offset=True))
    record, sizes = truth.record(moving(400)), np.array([1e5, 1e-3, 1e-2, 1.0])
    scaled = FlightRecord(record.time, record.values * sizes, record.signals)
    model = idn.fit(truth.arx, scaled, method=method)
    # 1e-9: as exact as without scales (test_exact_recovery); ridge and lasso keep no weight on
    # noise-free data
    np.testing.assert_allclose(
        (model.predict(scaled, 1) / sizes[:2])[2:],
        record.columns(["h", "q"])[2:],
        rtol=0,
        atol=1e-9,
    )


def test_a_model_is_not_applied_to_records_of_another_unit_or_step():
    model = idn.fit(TRUTH.arx, RECORD)
    feet, slow = with_columns(units={"u": "deg"}), with_columns(dt=0.2)
    uses = (
        model.score,
        model.simulate,
        lambda r: model.predict(r, 1),
        lambda r: idn.residual_analysis(model, r),
        lambda r: idn.uncertainty(model, r),
        lambda r: idn.judge.dependence_report(model, r),
    )
    for use in uses:
        with pytest.raises(
            InputError, match="'u' is in rad in the record, the model was identified in 1"
        ):
            use(feet)
        with pytest.raises(InputError, match=r"identified at dt = 0.1 s, the record has 0.2 s"):
            use(slow)


def test_a_wrong_regressor_leaves_the_estimator_as_it_was():
    rls = idn.RecursiveLeastSquares(TRUTH.arx)
    state = rls.run(RECORD).state
    for phi, y in (
        (np.full(12, np.nan), [1.0]),
        (np.zeros(12), [np.inf]),
        (np.zeros(3), [1.0]),
        (["a"] * 12, [1.0]),
    ):
        with pytest.raises(InputError, match="phi"):
            rls.absorb(state, phi, y)
    online = rls.online(state)
    for phi in (np.zeros(3), ["a"] * 12):
        with pytest.raises(InputError, match="phi"):
            online.absorb(phi, np.ones(1))
    np.testing.assert_array_equal(online.state.memory, state.memory)
    online.absorb([1] * 12, [1])  # anything that is a number works, as in update
    np.testing.assert_array_equal(
        online.coefficients, rls.absorb(state, np.ones(12), [1.0])[0].theta
    )


WRONG = {
    "no names": (lambda: structure(outputs=None), "outputs: expected names"),
    "a word for a flag": (lambda: structure(offset="yes"), "offset: expected True or False"),
    "no structure": (lambda: idn.fit("arx", RECORD), "structure: expected LPVARX"),
    "no structure to follow": (
        lambda: idn.RecursiveLeastSquares("arx"),
        "structure: expected LPVARX",
    ),
    "no record": (lambda: idn.fit(TRUTH.arx, None), "expected a FlightRecord"),
    "two records to run": (
        lambda: idn.RecursiveLeastSquares(TRUTH.arx).run([RECORD, RECORD]),
        "run takes one record, got 2",
    ),
    "no state": (
        lambda: idn.RecursiveLeastSquares(TRUTH.arx).update("state", 1.0, 0.0, 5.0),
        "state: expected one from init",
    ),
    "level in percent": (lambda: _band().interval(95), "level: expected a share"),
    "half a lag": (
        lambda: idn.uncertainty(idn.fit(TRUTH.arx, RECORD), RECORD, lags=2.5),
        "lags: expected",
    ),
    "no window": (
        lambda: idn.frequency_response(RECORD, "y", "u", window=np.nan),
        "window: expected",
    ),
    "nothing to scan": (
        lambda: idn.order_scan(TRUTH.arx, RECORD, RECORD, orders=()),
        "name at least one",
    ),
    "complex": (lambda: with_columns(y=RECORD["y"] * 1j), "y: expected numbers"),
    "no time": (
        lambda: FlightRecord.from_arrays(None, {"y": "1"}, y=np.zeros(3)),
        "y: expected shape",
    ),
    "no unit": (
        lambda: FlightRecord.from_arrays(np.arange(3.0), {"y": None}, y=np.zeros(3)),
        "unit",
    ),
    "a billion samples": (lambda: RECORD.resample(1e-9), "dt is in seconds"),
    "an endless step": (lambda: RECORD.resample(np.inf), "dt must be a positive number"),
    "means of none": (lambda: RECORD.decimate(0), "whole number of samples"),
    "means of too many": (lambda: RECORD.decimate(1000), "leaves fewer than two"),
    "half an order": (lambda: RECORD.low_pass(1.0, 2.5), "order: expected a whole number"),
    "time runs back": (lambda: smooth(RECORD, "p", -1.0), "positive time constant"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_meant_gets_a_sentence(case):
    ask, message = WRONG[case]
    with pytest.raises(SymheliError, match=message):
        ask()


def _band():
    return idn.uncertainty(idn.fit(TRUTH.arx, RECORD), RECORD).bands([1.0])[0]
