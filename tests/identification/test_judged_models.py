"""Identified models judged beside a baseline and against a constant model: an aeroplane's short
period, whose signals are called otherwise than a helicopter's.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import identification as idn
import symheli
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases import Polynomial
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.records import FlightRecord

DT, N = 0.02, 1500
UNITS = {
    "alpha": "rad",
    "pitch_rate": "rad/s",
    "load": "1",
    "elevator": "rad",
    "flap": "rad",
    "tas": "m/s",
}
SPEED = symheli.Scheduling("true_airspeed", "m/s", 20.0, 40.0)
BASIS = Polynomial(1, 20.0, 40.0)


def aeroplane(trimmed=True):
    """alpha and pitch rate under elevator and flap; the load factor is no state."""
    names = {
        "states": ["alpha", "pitch_rate"],
        "inputs": ["elevator", "flap"],
        "outputs": ["alpha", "pitch_rate", "load"],
    }
    model = symheli.LPVStateSpace.polynomial(
        A=[[[-0.5, 1.0], [-1.0, -0.6]], [[-0.05, 0.0], [-0.2, -0.04]]],
        B=[[[0.0, -0.1], [-2.0, 0.5]], [[-0.005, 0.0], [-0.3, 0.0]]],
        C=[[[1.0, 0.0], [0.0, 1.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]]],
        D=[[[0.0, 0.0], [0.0, 0.0], [0.3, 0.0]]],
        scheduling=SPEED,
        **names,
    )
    if not trimmed:
        return model
    p = np.array([20.0, 40.0])
    x0 = BASIS.fit(p, np.array([[0.15, 0.0], [0.03, 0.0]]))
    u0 = BASIS.fit(p, np.array([[-0.05, 0.1], [-0.01, 0.0]]))
    return replace(model, trim=TrimSchedule(BASIS, x0, u0))


def flown(model, seed=0):
    """The model from sample to sample, as its equations with p and u held; columns by name."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    tas = 30 + 8 * np.sin(0.5 * t)
    u = 0.03 * np.repeat(rng.standard_normal((N // 10, 2)), 10, axis=0)
    x, speed = np.zeros((N, 2)), np.gradient(tas, t)
    trim = model.trim
    x0 = np.zeros((N, 2)) if trim is None else trim.state(tas)
    u0 = np.zeros((N, 2)) if trim is None else trim.input(tas)
    moved = np.zeros((N, 2)) if trim is None else -trim.state(tas, 1) * speed[:, None]
    x[0], u = x0[0], u + u0
    for k in range(N - 1):
        A, B, *_ = (M[0] for M in model.matrices(tas[k : k + 1]))
        grown = np.zeros((5, 5))
        grown[:2] = np.column_stack([A, B @ (u[k] - u0[k]) + moved[k], np.zeros((2, 2))])
        x[k + 1] = x0[k + 1] + (expm(DT * grown) @ np.array([*(x[k] - x0[k]), 1.0, 0, 0]))[:2]
    _, _, C, D = model.matrices(tas)
    y = np.einsum("kij,kj->ki", C, x) + np.einsum("kij,kj->ki", D, u)
    columns = dict(zip(("alpha", "pitch_rate", "load"), y.T, strict=True))
    columns |= {"elevator": u[:, 0], "flap": u[:, 1], "tas": tas}
    return symheli.FlightRecord.from_arrays(t, UNITS, **columns)


def identified(record, degree=1):
    arx = idn.LPVARX(
        ("alpha", "pitch_rate"),
        ("elevator", "flap"),
        "tas",
        na=1,
        nb=1,
        delay=1,
        basis=idn.Polynomial(degree, 20.0, 40.0),
        offset=True,
        offset_rate=True,
    )
    return idn.fit(arx, record)


@pytest.fixture(scope="module")
def transition():
    return flown(aeroplane(), seed=1)


def test_the_model_that_flew_predicts_itself_whatever_its_signals_are_called(transition):
    own = idn.judge.BaselineModel(model=aeroplane(), scheduling="tas")
    blind = idn.judge.BaselineModel(model=aeroplane(), scheduling="tas", drift=False)
    found = idn.judge.compare_baseline(
        {}, {"own": own, "blind": blind}, transition, ("load", "alpha", "pitch_rate")
    )
    itself, still = found.predictions
    for fits in itself.scores.by_horizon.values():
        assert min(fits.values()) > 100 - 1e-6
    assert still.scores.ahead["alpha"] < itself.scores.ahead["alpha"] - 3
    assert found.best("load").name == "own"


def test_identified_and_baseline_are_judged_on_the_same_samples(transition):
    model = identified(flown(aeroplane()))
    found = idn.judge.compare_baseline(
        {"identified": model},
        {"equations": idn.judge.BaselineModel(model=aeroplane(), scheduling="tas")},
        transition,
        ("pitch_rate",),
        horizon=0.5,
    )
    one, two = found.predictions
    assert (one.identified, two.identified) == (True, False)
    assert one.scores == idn.judge.Scores(
        horizon=0.5,
        one_step={"pitch_rate": float(model.score(transition, 1)["pitch_rate"])},
        ahead={"pitch_rate": float(model.score(transition, 25)["pitch_rate"])},
        free_run={"pitch_rate": float(model.score(transition)["pitch_rate"])},
    )
    assert one.scores.ahead["pitch_rate"] > 90
    assert np.isnan(two.ahead[:25]).all()
    assert np.isfinite(two.ahead[25:]).all()
    assert list(one.scores.by_horizon) == ["one step", "0.5 s", "free run"]


def test_a_model_without_trim_and_a_sampled_one_predict_too():
    lpv = aeroplane(trimmed=False)
    record = flown(lpv)
    sampled = lpv.discretize(DT, degree=4)
    found = idn.judge.compare_baseline(
        {},
        {
            name: idn.judge.BaselineModel(model=model, scheduling="tas")
            for name, model in {"continuous": lpv, "sampled": sampled}.items()
        },
        record,
        ("alpha",),
    )
    assert [round(p.scores.ahead["alpha"], 3) for p in found.predictions] == [100.0, 100.0]
    late = lpv.discretize(2 * DT, degree=4)
    with pytest.raises(InputError, match=r"sampled at 0.04 s, the record at 0.02 s"):
        idn.judge.BaselinePredictor(late, record, scheduling="tas")


def test_an_input_that_the_record_does_not_hold_stays_at_its_trim(transition):
    alone = idn.judge.BaselinePredictor(
        aeroplane(), transition, scheduling="tas", inputs=("elevator",)
    )
    both = idn.judge.BaselinePredictor(aeroplane(), transition, scheduling="tas")
    one, two = (along.predict(["alpha"], 5)[5:] for along in (alone, both))
    assert one.shape == two.shape
    assert np.abs(one - two).max() > 1e-5


def test_a_gap_in_the_record_is_no_fast_trim(transition):
    """The first samples behind a gap are predicted as if the record began there."""
    cut = np.arange(len(transition)) < 100
    late = np.arange(len(transition)) >= 260
    predictor = lambda record: idn.judge.BaselinePredictor(aeroplane(), record, scheduling="tas")  # noqa: E731
    gap = predictor(transition.rows(cut | late)).predict(["alpha"], 5)[100:]
    alone = predictor(transition.rows(late)).predict(["alpha"], 5)
    np.testing.assert_allclose(gap[5:], alone[5:], atol=1e-12)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({}, UnknownNameError, "true_airspeed"),
        ({"scheduling": "elevator"}, InputError, "never lies within the baseline's range 20 to 40"),
        ({"scheduling": "tas", "inputs": ("elevators",)}, UnknownNameError, "elevator"),
    ],
)
def test_what_drives_a_baseline_is_asked_for_by_name(transition, options, error, message):
    with pytest.raises(error, match=message):
        idn.judge.BaselinePredictor(aeroplane(), transition, **options)


def test_an_output_no_model_has_is_named(transition):
    own = idn.judge.BaselineModel(model=aeroplane(), scheduling="tas")
    with pytest.raises(UnknownNameError, match="unknown output 'flap'"):
        idn.judge.compare_baseline({}, {"own": own}, transition, ("flap",))
    with pytest.raises(InputError, match="nothing to compare"):
        idn.judge.compare_baseline({}, {}, transition, ("alpha",))
    found = idn.judge.compare_baseline({}, {"own": own}, transition, ("alpha",))
    with pytest.raises(InputError, match="among alpha, own"):
        found.best("load")


def test_frozen_models_of_an_aeroplane(transition):
    lpv, model = aeroplane(), identified(flown(aeroplane()), degree=3)
    exact = {v: lpv.at(v) for v in (25.0, 30.0, 35.0)}
    short_period = {v: complex(m.poles()[m.poles().imag > 0][0]) for v, m in exact.items()}
    outputs = lpv.select(outputs=["alpha", "pitch_rate"])
    sizes = {"alpha": 0.1, "pitch_rate": 0.5, "elevator": 0.05, "flap": 0.05}
    options = {"mode": short_period, "channel": ("elevator", "pitch_rate"), "scales": sizes}
    models = {"baseline": outputs, "identified": model}
    options |= {"inputs": model.inputs, "outputs": model.outputs, "fast": 3.0}
    found = idn.compare_frozen(models, exact, **options)
    assert found.responses_at == 30.0
    assert found["baseline"].miss.max() < 1e-6
    assert found["baseline"].gap.max() < 1e-9 < found["identified"].gap.min()
    assert found["identified"].miss.max() < 0.1
    for one in (found.reference, found["baseline"], found["identified"]):
        assert one.response.shape == found.omega.shape
        assert one.stable.all()
    assert found.otherwise_stable("identified") == 0
    with pytest.raises(UnknownNameError, match="lft"):
        found["lft"]
    with pytest.raises(InputError, match="lft: expected a model at the points"):
        idn.compare_frozen({"lft": {25.0: exact[25.0]}}, exact, **options)
    with pytest.raises(InputError, match="all models are continuous"):
        idn.compare_frozen({"baseline": outputs}, exact, **options)
    del sizes["flap"]
    with pytest.raises(UnknownNameError, match="flap"):
        idn.compare_frozen(models, exact, **options)


def test_a_horizon_is_in_seconds_and_positive(transition):
    model = identified(transition)
    assert idn.scores(model, transition, horizon=DT / 10).ahead == (
        idn.scores(model, transition).one_step
    )
    with pytest.raises(InputError, match="horizon: expected seconds greater than 0, got -1"):
        idn.scores(model, transition, horizon=-1.0)


def test_scheduling_pays_where_the_aeroplane_is_told_by_it():
    record = flown(aeroplane(trimmed=False))
    arx = idn.LPVARX(
        ("alpha", "pitch_rate"),
        ("elevator", "flap"),
        "tas",
        na=1,
        nb=1,
        delay=1,
        basis=idn.Polynomial(1, 20.0, 40.0),
    )
    found = idn.judge.compare_constant(arx, *record.split(0.6))
    assert [scored.label for scored in found.models] == ["LPV, degree 1", "LTI"]
    assert found.pays("pitch_rate")
    alone = idn.judge.compare_constant(arx, record, None)
    assert "nothing was held out" in alone.verdict()[0]
    with pytest.raises(InputError, match="nothing was held out"):
        alone.pays("pitch_rate")


@pytest.mark.parametrize(("own", "lag"), [(True, 1), (True, 2), (False, 1)])
def test_a_free_run_on_its_own_measured_past_is_warned_of(own, lag):
    """p(k) = y(k-1)^2: measured, it tells a free run the answer."""
    rng = np.random.default_rng(0)
    u, y, p = rng.standard_normal(400), np.zeros(400), np.zeros(400)
    for k in range(lag, 400):
        p[k] = y[k - lag] ** 2 if own else np.sin(0.1 * k)
        y[k] = (0.6 - 0.1 * min(p[k - 1], 2.0)) * y[k - 1] + u[k - 1] if k else 0.0
    units = dict.fromkeys("yup", "1")
    record = FlightRecord.from_arrays(0.1 * np.arange(400), units, y=y, u=u, p=p)
    basis = idn.Polynomial(1, float(p.min()), float(p.max()))
    model = idn.fit(idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=basis), record)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        idn.scores(model, record)
    words = [str(w.message) for w in said if "is made of the outputs" in str(w.message)]
    assert len(words) == own
    assert not own or f"{lag} sample" in words[0]


def test_instruments_reach_over_ten_samples_where_a_second_holds_fewer():
    """A record of 5 s a sample had two lags, too few for any model."""
    assert idn.structure.LaggedSignals("u").instrument_lags(dt=5.0, first=1, memory=1) == (
        *range(1, 11),
    )
    assert idn.structure.LaggedSignals("u").instrument_lags(dt=0.02, first=1, memory=1)[-1] == 50
