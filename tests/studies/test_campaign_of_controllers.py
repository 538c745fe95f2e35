"""A synthesized controller is an axis of a campaign: it flies as in the study, over vehicles that
are not quite what it was designed for.
"""

import numpy as np
import pytest

from studies.campaigns.campaign_file import campaign_of
from studies.campaigns.run import run
from studies.campaigns.runners import Here
from studies.campaigns.trials.control import control, designed, plants
from studies.controllers.designs import Designs
from studies.controllers.flown import WINDS, fly_controllers


@pytest.mark.slow
def test_it_flies_what_the_study_flies():
    row = control(controller="lqr", wind=WINDS[0], flights=2, seed=5)
    designs = Designs(designs=(designed("xcell60", "lqr", 0),), plant=plants("xcell60")[1])
    (flown,) = fly_controllers("xcell60", designs, [5, 6]).at(WINDS[0])
    median, worst = flown.of(lambda flight: flight.ratio)
    assert (row["energy ratio, median"], row["energy ratio, worst"]) == (median, worst)
    assert row["lost"] == flown.lost == 0
    assert row["frozen gain"] > worst


def test_a_controller_that_is_not_there_is_a_row_with_its_reason(tmp_path):
    grid = {"controller": ["lqr", "pid"], "mass": [1.0, 1.1]}
    asked = campaign_of({"trial": "control", "grid": grid, "fixed": {"flights": 1}})
    with Here() as here:
        found = run(asked, tmp_path / "c.zarr", here)
    assert {k: "'pid'" in why for k, why in found.reasons.items()} == {2: True, 3: True}
    ratios = found["energy ratio, median"]
    assert np.isfinite(ratios).tolist() == [True, True, False, False]
    assert ratios[0] != ratios[1]
