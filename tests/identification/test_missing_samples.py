"""Samples that are missing, of any signal, cost their rows and nothing else: all judges answer."""

import numpy as np
import pytest
from known_systems import Truth, moving, moving_box, structure

import identification as idn
from symheli import lpv
from symheli.records import FlightRecord


def holed(record, name, rows):
    """The same without these samples of one signal."""
    column = np.array(record[name])
    column[rows] = np.nan
    return record.with_signals({name: "1"}, **{name: column})


JUDGES = {
    "slow modes": lambda model, record: idn.judge.slow_modes(model, record),
    "excitation": lambda model, record: idn.excitation_report(model.structure, record),
    "residuals": lambda model, record: idn.residual_analysis(model, record, 10),
    "scores": lambda model, record: idn.scores(model, record),
    "dependence": lambda model, record: idn.judge.dependence_report(model, record),
    "orders": lambda model, record: idn.order_scan(
        model.structure, *record.split(0.7), orders=(1,), degrees=(0, 1)
    ),
    "against a constant": lambda model, record: idn.judge.compare_constant(
        model.structure, record, None
    ).verdict(),
}


@pytest.mark.parametrize("name", ["p", "y", "u"])
@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("at", ["lag", "now"])
def test_every_judge_of_a_model_answers_in_numbers(name, several, at):
    box = dict(
        scheduling=("p", "density"),
        basis=lpv.Product((idn.Polynomial(1, 0.0, 13.0), idn.Polynomial(1, 0.9, 1.3))),
    )
    arx = structure(scheduling_at=at, nb=1, **(box if several else {}))
    record = Truth(arx).record(moving_box(700) if several else moving(700), noise=0.05)
    rows = np.random.default_rng(3).choice(len(record), 60, replace=False)
    record = holed(record, name, rows)
    model = idn.fit(arx, record)
    for what, judge in JUDGES.items():
        if several and what == "orders":
            continue  # of a polynomial in one parameter
        assert "nan" not in str(judge(model, record)).lower(), what


def test_scheduling_that_is_there_every_second_sample_only_is_enough():
    arx = structure(na=1, nb=1)
    whole = Truth(arx).record(moving(700), noise=0.01)
    record = holed(whole, "p", slice(1, None, 2))
    model = idn.fit(arx, record)
    assert model.excitation.occupancy.sum() == model.rows_used
    assert "nan" not in str(idn.judge.slow_modes(model, record))


def test_slow_modes_are_those_of_the_record_without_holes():
    k = np.arange(3000)
    rng = np.random.default_rng(0)
    p, u, y = np.sin(0.02 * k), np.repeat(rng.choice([-1.0, 1.0], 100), 30), np.zeros(3000)
    for i in k[1:]:
        y[i] = (0.99 - 0.005 * p[i - 1]) * y[i - 1] + 0.1 * u[i - 1]
    y += 0.02 * y.std() * rng.standard_normal(3000)
    whole = FlightRecord.from_arrays(0.02 * k, dict.fromkeys("yup", "1"), y=y, u=u, p=p)
    arx = structure(na=1, nb=1, basis=idn.Polynomial(1, -1.0, 1.0))
    answers = [
        idn.judge.slow_modes(idn.fit(arx, record), record, points=3).modes
        for record in (whole, holed(whole, "p", rng.choice(3000, 100, replace=False)))
    ]
    assert len(answers[0]) == 3
    for one, other in zip(*answers, strict=True):
        # noise of the sensor makes residuals whose neighbours nearly cancel: a gap costs the error
        assert abs(one.s - other.s) < 2 * other.standard_error
        assert other.shift == pytest.approx(one.shift, rel=0.2)
