"""LPV beside LTI on flights: what the table says is what was flown."""

from dataclasses import replace

import numpy as np
import pytest

from identification import fit, scores
from identification.judge.against_constant import HORIZONS
from studies.campaigns import pays
from studies.campaigns.runners import Here
from studies.setup.axes import LATERAL
from studies.setup.flights import TransitionPlan, autopilot_for


@pytest.mark.slow
def test_every_output_of_every_axis_is_judged_and_counted():
    short = {"short": TransitionPlan(ramps=2)}
    with Here() as here:
        lines = list(pays.where_scheduling_pays(0, "xcell60", short, on=here))
    assert [line.output for line in lines] == [
        output for axis in pays.AXES for output in axis.outputs
    ]
    for line in lines:
        gains = [line.lpv[h][0] - line.lti[h][0] for h in HORIZONS[1:]]
        assert line.pays in (0, 1)
        assert not line.pays or max(gains) > 1.0
    text = pays.table(lines)
    assert text.count("longitudinal-vertical") == 2  # medians, then the worst
    assert len(pays.data(lines)) == len(lines)
    # noise-free, degree 2 contains degree 0: in sample and one step ahead it cannot do visibly
    # worse held out
    assert np.all([line.lpv[HORIZONS[0]][0] > line.lti[HORIZONS[0]][0] - 5 for line in lines])


@pytest.mark.slow
def test_the_models_are_those_of_the_study_with_a_moving_trim(ideal):
    plan = TransitionPlan(ramps=3)
    autopilot = autopilot_for(ideal)
    training, test = plan.training(ideal, autopilot), plan.test(ideal, autopilot)
    own = scores(fit(LATERAL.structure(), training), test).by_horizon
    assert LATERAL.structure().offset_rate
    for line in pays.where_scheduling_pays(0, "xcell60", {"short": plan}, on=Here()):
        if line.axis == LATERAL.name:
            assert {h: line.lpv[h][0] for h in HORIZONS} == {h: own[h][line.output] for h in own}


def test_the_table_gives_the_median_and_the_worst_of_the_seeds():
    fits = {h: np.array([90.0, -20.0, 70.0]) for h in HORIZONS}
    text = pays.table(
        [pays.OutputFits("still", "pitch", "q", fits, {h: v + 1 for h, v in fits.items()}, 2)]
    )
    median, worst = (line.split() for line in text.splitlines() if line.startswith("  q"))
    assert median == ["q", *["70.0", "/", "71.0"] * 3, "2/3"]
    assert worst == ["q", *["-20.0", "/", "-19.0"] * 3]


def test_the_breeze_blows_in_the_record(ideal):
    plan = TransitionPlan(ramps=2, windy=True)
    record = plan.training(ideal, autopilot_for(ideal))
    assert record["wind_n"].mean() < 0 < record["wind_n"].std()
    assert "wind_n" not in replace(plan, windy=False).training(ideal, autopilot_for(ideal)).signals
