"""The command line as a user types it, and one outcome of the study with every stage."""

from __future__ import annotations

import json
import math

import pytest

from studies import cli
from studies.controllers import designs
from studies.known_kinematics.robust_loop import FORM
from studies.transition import known_kinematics
from studies.transition import study as stages
from studies.transition.effort import Effort
from symheli import Helicopter
from symheli.errors import SynthesisError
from synthesis.analysis import LowerBoundSearch
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.point_schedule import hinf_at

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


def of_one_airspeed(plant, *_, **__):
    """In place of an LPV design, which takes a minute."""
    found = hinf_at(plant, [designs.TOP / 2], designs.BACK_OFF)
    return Controller.of(plant, found.controller, "H-infinity of one airspeed")


def of_none(*_, **__):
    raise SynthesisError("nothing moves it")


@pytest.fixture(scope="session")
def full():
    """Every stage, as short as it gets: for LPV designs stand those of one airspeed, the LFT finds
    none, nu-gaps have few frequencies.
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
        shorter.setattr(designs, "output_feedback", of_one_airspeed)
        shorter.setattr(designs, "lft_feedback", of_none)
        shorter.setattr(known_kinematics, "FREQUENCIES", 60)
        for stage in stages.stages(effort):
            study = stages.with_stage(study, stage, stages.computed(stage, study, effort))
    return study
