"""The command line as a user types it, and one outcome of the study with every stage."""

from __future__ import annotations

import json
import math
from functools import partial

import pytest

from studies import cli
from studies.controllers import designs
from studies.known_kinematics.robust_loop import FORM
from studies.transition import known_kinematics
from studies.transition import study as stages
from studies.transition.effort import Effort
from symheli import Helicopter
from synthesis import output_feedback
from synthesis.analysis import LowerBoundSearch

GLIMPSE = LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1, samples=100)


@pytest.fixture
def run(capsys):
    """Status, stdout and stderr of one command line."""

    def call(*arguments):
        status = cli.main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture
def answer(run):
    """What a program reads from a command that succeeds."""

    def call(*arguments):
        status, out, err = run(*arguments, "--json")
        assert status == 0, err
        return json.loads(out)

    return call


@pytest.fixture(scope="session")
def full():
    """Every stage, as short as it gets: LPV designs have constant X and Y, nu-gaps few
    frequencies.
    """
    effort = Effort(
        ramps=6,
        gentle_ramps=4,
        gust_rates=(0.0, math.inf),
        gust_segments=(2,),
        exact_rates=(0.0,),
        longitudinal_rates=(0.0,),
        thorough=False,
        aggressive=60.0,
        gentle_flight=False,
        robust_rates=(0.0,),
        robust_form=FORM,
        servo_rates=(0.0, math.inf),
        servo_segments=(2,),
        design_points=4,
        certified_controllers=False,
        first_certificate=False,
        controller_seeds=2,
        search=GLIMPSE,
    )
    heli = Helicopter.load("xcell60", governor="ideal")
    study = stages.Study(vehicle="xcell60", quick=True, seed=0, heli=heli)
    with pytest.MonkeyPatch.context() as shorter:
        shorter.setattr(designs, "output_feedback", partial(output_feedback, X=0, Y=0))
        shorter.setattr(known_kinematics, "FREQUENCIES", 60)
        for stage in stages.stages(effort):
            study = stages.with_stage(study, stage, stages.computed(stage, study, effort))
    return study
