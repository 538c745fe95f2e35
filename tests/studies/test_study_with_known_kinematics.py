"""What the study says of models with known kinematics is what their numbers say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import symheli
import synthesis
from studies.known_kinematics.truth import AXES, Truth, frozen_axes
from studies.loops.lateral import ATTITUDE_HOLD
from studies.loops.robust_lateral import margin
from studies.setup.bounds import PLAIN, Bound, rate_text
from studies.transition import conclusions, tables
from studies.transition.baseline import build_baseline
from studies.transition.guarantees import ALLOWED, ESTIMATE
from studies.transition.known_kinematics import (
    ALL_AXES,
    CUBIC,
    KNOWN,
    SPLINE,
    TWO_INPUTS,
    identify_with_known_kinematics,
)
from studies.transition.outcome import Outcome
from studies.transition.proofs import RobustProofs
from symheli import LPVStateSpace, Scheduling

ALONE, BOTH = "over airspeed", "over airspeed and acceleration"


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found(ideal):
    """From one short flight."""
    baseline = build_baseline(ideal)
    return identify_with_known_kinematics(ideal, "xcell60", baseline, 0, 100.0, False)


def test_the_instruments_are_flown_in_another_vehicle(found):
    assert found.simulator == "xcell_kahn_hudson"
    own = found.rivals[-1]
    assert found.simulator in own.name
    assert not own.ahead
    assert max(own.gaps["lateral"]) > 0.3  # a wrong simulator


def test_the_second_parameter_pays_for_the_baseline(found):
    both, alone = (found.of(SPLINE[kind]).ahead for kind in (BOTH, ALONE))
    for output in ("v", "r", "phi"):
        assert both[output] > alone[output] + 10


def test_known_kinematics_come_closer_for_feedback_than_lpv_arx_from_the_same_flight(found):
    """The wrong simulator its instruments are flown in is farther from the truth too."""
    arx, own, simulator = (
        found.of(name).gaps["lateral"].max()
        for name in (TWO_INPUTS, KNOWN[BOTH], found.rivals[-1].name)
    )
    assert own < arx / 3
    assert own < simulator / 3


def test_the_baseline_frozen_is_the_exact_model_where_nothing_is_interpolated(found):
    """The splines pass through exact models at the airspeeds that are held."""
    for name in SPLINE.values():
        assert max(gap.max() for gap in found.of(name).gaps.values()) < 1e-3
    assert found.of(CUBIC).gaps["lateral"].max() > 1e-3


def test_gaps_on_fewer_frequencies_are_those_on_many(ideal, found):
    truth = Truth.of(ideal)
    axis = {"lateral": frozen_axes(found.model, truth)["lateral"]}
    for name, beside in truth.compare(axis).items():
        gaps = beside["model"].gap
        np.testing.assert_allclose(found.of(KNOWN[BOTH]).gaps[name], gaps, atol=1e-3)


def test_the_margin_of_the_attitude_hold_is_below_that_of_the_other_loop(ideal, found):
    hover = symheli.linearize(ideal, symheli.trim(ideal, 0.0))
    axis = AXES["lateral"]
    lateral = hover.select(states=axis.states).select(inputs=axis.inputs, outputs=axis.outputs)
    assert found.margins["attitude hold"][0] == pytest.approx(
        margin(lateral.discretize(0.02), ATTITUDE_HOLD)
    )
    assert found.margins["loop with a margin"].min() > 0.25 > found.margins["attitude hold"].min()


def test_the_tables_have_every_model_and_blanks_where_there_is_no_axis(found):
    fits, held = tables.known_kinematics(found)
    names = [rival.name for rival in found.rivals]
    assert [row[0] for row in held.rows] == names
    assert [row[0] for row in fits.rows] == names[:-1]
    for table in (fits, held):
        assert {len(row) for row in table.rows} == {len(table.columns)}
    arx = next(row for row in held.rows if row[0] == ALL_AXES)
    assert arx[1:3] == ["", ""]
    assert arx[3]


def test_the_conclusions_tell_the_numbers_of_the_tables(found):
    study = Outcome(vehicle="xcell60", quick=True, seed=0, known_kinematics=found)
    text = " ".join(conclusions.conclusions(study))
    own = found.of(KNOWN[BOTH]).gaps["lateral"].max()
    assert f"{own:.3f} with scheduled ones" in text
    both, alone = (found.of(SPLINE[kind]).ahead for kind in (BOTH, ALONE))
    most = max(both, key=lambda y: abs(both[y] - alone[y]))
    assert f"the most by {both[most] - alone[most]:+.0f} ({most})" in text


@pytest.mark.parametrize(
    ("allowed", "estimate", "of_the_set", "of_the_estimate"),
    [
        (3.0, 1.0, "holds for the helicopter", "FAILS for the helicopter"),
        (1.0, 3.0, "FAILS for the helicopter", "holds for the helicopter"),
        (math.inf, 3.0, "could not be given", "holds for the helicopter"),
    ],
)
def test_a_certificate_is_said_to_hold_where_the_exact_loop_is_below_it(
    allowed, estimate, of_the_set, of_the_estimate
):
    """A lag of gain 2 as the exact loop."""

    def bound(model, gain):
        lag = LPVStateSpace.polynomial(
            [[[-1.0]]], [[[gain]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
        )
        certificate = synthesis.l2_gain(lag, 0.0)
        return Bound(model, "robust", 0.0, PLAIN, certificate)

    def unproven(b):
        return replace(b, certificate=replace(b.certificate, gamma=math.inf))

    found = [bound("exact", 2.0), bound(ESTIMATE, estimate)]
    found += [bound(ALLOWED, allowed) if math.isfinite(allowed) else unproven(found[0])]
    found[-1] = replace(found[-1], model=ALLOWED)
    study = Outcome(vehicle="xcell60", quick=True, seed=0, robust=RobustProofs(bounds=tuple(found)))
    (sentence,) = conclusions.certificates(study)
    assert f"the certificate from the flights {of_the_set}" in sentence
    assert f"that of the estimate alone {of_the_estimate}" in sentence
    assert rate_text(0.0) in sentence
