"""symheli circle: the controls change hands without a bump, only where the lamp is green, and go
back where the vehicle has changed.
"""

from dataclasses import replace

import numpy as np
import pytest
from circle_in_process import flown, judged, quick

import symheli
from studies.circle import circle
from studies.circle.circle import HYPOTHESES, Phase
from studies.circle.vehicle import PERIOD, Vehicle
from symheli.flight import HypothesisEvents
from symheli.values.kinematics import INPUTS

SHORT = Vehicle(duration=75.0, noise=False)
CALM = Vehicle(duration=150.0, noise=False)
HEAVIER = Vehicle(duration=160.0, noise=False, heavier=1.1, change_at=130.0)


@pytest.fixture(autouse=True)
def _short(monkeypatch):
    monkeypatch.setattr(circle, "LEARN", 110.0)
    monkeypatch.setattr(circle, "MORE", 15.0)


@pytest.fixture(scope="module")
def design():
    """From 110 s without noise."""
    plan = replace(CALM.plan(CALM.helicopter), change=None)
    return quick(symheli.fly(CALM.helicopter, plan).between(0.0, 110.0), "xcell60")


def test_what_is_identified_from_is_the_flight_that_its_plan_flies_again():
    """Instruments of a simulator are flown by that plan; the change of the vehicle is not in it."""
    grabbed = []
    flown(HEAVIER, lambda record, vehicle: grabbed.append(record) or "none")
    (plan,) = {id(r.meta["plan"]): r.meta["plan"] for r in grabbed}.values()
    again = symheli.fly(HEAVIER.helicopter, plan)
    first = grabbed[0]
    assert plan.change is None
    assert len(first) == round(110.0 / PERIOD) + 1
    for name in map(str, first.signals):
        np.testing.assert_allclose(first[name], again[name][: len(first)], rtol=0, atol=1e-9)


def test_the_controls_change_hands_without_a_bump(design):
    """No command steps by 2 % of its travel, the flight goes on as commanded, the lamp is green."""
    found, record = flown(CALM, lambda record, vehicle: design)
    assert found.phase is Phase.CONTROLLING
    assert [event.what[:20] for event in found.events] == [
        "the flight is identi",
        "the certified contro",
    ]
    (switch,) = found.switches
    assert switch.at < 0.02
    assert switch.before < 0.02
    assert switch.after < 0.02
    after = (record.time > found.events[1].time) & (record.time < found.events[1].time + 3.0)
    pushed = np.abs(record["theta"] - record["theta_reference"])[after]
    assert pushed.max() < 0.15
    after = record.time > found.events[1].time + 1.0
    assert np.abs(record["airspeed"] - record["airspeed_command"])[after].max() < 1.5
    assert found.reasons() == []
    last = round(found.events[1].time / PERIOD)
    travel = CALM.helicopter.travel
    u = record.columns(map(str, INPUTS)) / travel
    assert np.abs(u[last + 1] - u[last]).max() < 1e-6


@pytest.mark.slow
def test_the_controller_that_was_designed_is_what_flies(design):
    """Its commands, a sample later, are the deflections of the vehicle."""
    sent = []

    def remember(found):
        if found.phase is Phase.CONTROLLING:
            sent.append((found._last, found._state.command.copy()))

    _, record = flown(CALM, lambda record, vehicle: design, watched=remember)
    u = record.columns(map(str, INPUTS))
    for k, command in sent[100:-1:50]:
        np.testing.assert_allclose(u[k + 1], command, rtol=0, atol=1e-6)


@pytest.mark.slow(but=["1.1"])
@pytest.mark.parametrize("heavier", [1.1, 0.9])
def test_another_mass_is_noticed_and_the_controls_are_given_back(heavier, design):
    """Within five seconds; then all begins anew."""
    vehicle = Vehicle(duration=140.0, noise=False, heavier=heavier, change_at=130.0)
    found, _ = flown(vehicle, lambda record, vehicle: design)
    alarm = next(event for event in found.events if "has changed" in event.what)
    assert 130.0 < alarm.time <= 135.0
    assert "w is" in alarm.what
    assert found.phase is Phase.IDENTIFYING
    assert "has changed" in found.reasons()[0]


@pytest.mark.slow
def test_without_a_change_nobody_is_alarmed(design):
    """Over twenty times the time in which one is noticed."""
    found, _ = flown(Vehicle(duration=210.0, noise=False), lambda record, vehicle: design)
    assert not any("changed" in event.what for event in found.events)


@pytest.mark.slow(but=["how0-nu-gap bound 1.20 times the margin"])
@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"share": 1.2}, "nu-gap bound 1.20 times the margin"),
        ({"share": np.nan}, "nu-gap bound nan"),
        ({"fit": "not known"}, "J: not known"),
        ({"verified": False}, "certificate of its loop is not verified"),
    ],
)
def test_what_is_not_fit_never_flies(how, said, design, monkeypatch):
    """More is flown, and it is said why."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    unfit = replace(design, **judged(**how))
    found, _ = flown(SHORT, lambda record, vehicle: unfit)
    assert not found.designs
    assert said in found.events[1].what
    assert found.events[2].time >= found.events[1].time + 15.0


def test_a_design_that_fails_says_why(monkeypatch):
    """In its own words."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    found, _ = flown(SHORT, lambda record, vehicle: "no controller keeps this gain")
    assert "no controller keeps this gain" in found.events[1].what


@pytest.mark.slow
def test_rows_that_are_lost_are_flown_over(design):
    """The controller keeps its command; no number is invented."""
    reasons = []
    found, record = flown(
        CALM,
        lambda record, vehicle: design,
        lost=lambda k: 7000 < k and k % 40 < 2,
        watched=lambda found: reasons.append(found.reasons()),
    )
    assert found.phase is Phase.CONTROLLING
    after = record.time > found.events[1].time + 1.0
    assert np.abs(record["airspeed"] - record["airspeed_command"])[after].max() < 1.5
    window = found.record(5.0)
    assert np.isnan(window["u"]).any()
    assert np.isfinite(window["u"]).any()
    assert reasons[6900] == []
    assert "a measurement is missing" in reasons[7040]
    assert reasons[7045] == [HYPOTHESES[HypothesisEvents.UNKNOWN]]
    assert reasons[7065] == []


def test_a_command_at_its_limit_is_no_green_lamp(design):
    """The certificate is of commands within their limits."""
    reasons = []

    def squeezed(record, vehicle):
        table = symheli.TableController.of(
            design.table.model, limits={str(u): (-0.001, 0.001) for u in INPUTS}
        )
        return replace(design, table=table)

    flown(CALM, squeezed, watched=lambda found: reasons.extend(found.reasons()))
    assert "a command is at its limit" in reasons


def test_commands_that_arrive_late_are_given_back(design, monkeypatch):
    """The design has one sample from measurement to control; two are another loop."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    found, record = flown(SHORT, lambda record, vehicle: design, late=1)
    given_back = next(event for event in found.events if "arrive later" in event.what)
    assert given_back.time <= found.events[1].time + 1.0
    assert found.phase is Phase.IDENTIFYING
    assert np.abs(record["phi"]).max() < 0.7
