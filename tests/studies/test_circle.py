"""symheli circle: the controls change hands without a bump, only where the lamp is green, and go
back where the vehicle has changed.
"""

import time
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest
from circle_in_process import AtOnce, flown, judged, quick

import symheli
from studies.circle import alarm, circle
from studies.circle.circle import HYPOTHESES, Phase
from studies.circle.vehicle import PERIOD, Vehicle, VehicleProcess
from studies.live.stream import Row
from symheli.errors import InputError
from symheli.flight import HypothesisEvents
from symheli.values.kinematics import INPUTS
from symheli.worker import ProcessEndedError

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
        ({"verified": False}, "certificate of its loop is not verified in exact"),
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
    """The design has one sample from measurement to control; three are another loop."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    found, record = flown(SHORT, lambda record, vehicle: design, late=2)
    given_back = next(event for event in found.events if "arrive later" in event.what)
    assert given_back.time <= found.events[1].time + 1.0
    assert found.phase is Phase.IDENTIFYING
    assert np.abs(record["phi"]).max() < 0.7


def test_a_sample_more_puts_the_lamp_out(design, monkeypatch):
    """The flight goes on; what is proven is of one sample."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    reasons = []
    found, record = flown(
        SHORT,
        lambda record, vehicle: design,
        late=1,
        watched=lambda found: reasons.extend(found.reasons()),
    )
    assert found.phase is Phase.CONTROLLING
    assert any("arrive later" in reason for reason in reasons)
    after = record.time > found.events[1].time + 2.0
    assert np.abs(record["airspeed"] - record["airspeed_command"])[after].max() < 1.5


# --- what goes wrong ------------------------------------------------------------------------------


class Later:
    """An executor that is asked, and never answers by itself."""

    def submit(self, function, *arguments):
        self.made = Future()
        return self.made


class Answering:
    """A line to a vehicle that flies each command a sample later, whatever its rows say; nobody is
    alarmed.
    """

    def __init__(self, design, monkeypatch, executor=None):
        monkeypatch.setattr(circle, "LEARN", 55.0)
        monkeypatch.setattr(alarm, "THRESHOLD", np.inf)
        self.sticks, self.said = np.zeros(4), []
        plan = replace(SHORT.plan(SHORT.helicopter), change=None)
        record = symheli.fly(SHORT.helicopter, plan)
        names = [*map(str, circle.SIGNALS[:8]), *map(str, INPUTS), "airspeed"]
        self.rows = record.columns(names)
        self.rows[:, 8:12] /= SHORT.helicopter.travel
        self.circle = circle.Circle(
            SHORT, self, executor or AtOnce(), self.said.append, lambda record, vehicle: design
        )

    def command(self, sticks):
        self.sticks = np.array(list(sticks.values()))

    def fly(self, first, last, jump=0.0):
        for k in range(first, last):
            row = self.rows[k].copy()
            if self.circle.phase is Phase.CONTROLLING:
                row[8:12] = np.clip(self.sticks, -1, 1)
            self.circle.take(Row(k * PERIOD + jump, row))


@pytest.mark.parametrize(("last", "kept"), [(3020, True), (3050, False), (9999, False)])
def test_rows_that_stay_unknown_give_the_sticks_back(design, monkeypatch, last, kept):
    """An old command is not flown on and on: after half a second at the latest."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    reasons = {}

    def watched(found):
        reasons[found._last] = found.reasons()

    found, record = flown(SHORT, lambda record, vehicle: design, lambda k: 3000 < k < last, watched)
    assert (found.phase is Phase.CONTROLLING) == kept
    assert not reasons[3000]
    assert "a measurement is missing" in reasons[3010]
    assert any("rows are unknown" in reason for reason in reasons[3010])
    given_back = [event.time for event in found.events if "rows are unknown" in event.what]
    assert given_back == ([] if kept else [pytest.approx(60.5)])
    assert np.abs(record["airspeed"] - record["airspeed_command"]).max() < 2.0


def test_a_change_that_could_not_be_noticed_is_no_green_lamp(design, monkeypatch):
    """A row that is lost in each second leaves no prediction of a second."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    reasons = {}
    found, _ = flown(
        SHORT,
        lambda record, vehicle: design,
        lambda k: k > 3000 and k % 40 == 0,
        lambda found: reasons.update({found._last: found.reasons()}),
    )
    assert found.phase is Phase.CONTROLLING
    assert not reasons[3000]
    assert "no prediction of the last" in reasons[found._last][0]


@pytest.mark.parametrize("jump", [-30.0, -0.5, 1000.0, 1e9])
def test_a_jump_of_the_clock_gives_the_sticks_back(design, monkeypatch, jump):
    """Rows that went back in time were ignored, under a green lamp; 1e9 s of rows had no end."""
    line = Answering(design, monkeypatch)
    line.fly(0, 3000)
    assert line.circle.phase is Phase.CONTROLLING
    assert line.circle.reasons() == []
    line.fly(3000, 3001, jump)
    assert line.circle.phase is Phase.IDENTIFYING
    assert "clock of the vehicle has jumped" in line.said[-1]
    line.fly(3001, 3100, jump)
    assert len(line.circle.record()) == 100


def test_a_gap_counts_as_rows_that_are_unknown(design, monkeypatch):
    """After it the vehicle has flown by itself: an old state does not take it over."""
    line = Answering(design, monkeypatch)
    line.fly(0, 3000)
    line.fly(3300, 3301)
    assert line.circle.phase is Phase.IDENTIFYING
    assert "rows are unknown" in line.said[-1]


def test_a_design_whose_process_ends_is_said_and_asked_for_again(design, monkeypatch):
    """The flight goes on."""
    executor = Later()
    line = Answering(design, monkeypatch, executor)
    line.fly(0, 2760)
    executor.made.set_exception(ProcessEndedError("it may have run out of memory"))
    line.fly(2760, 2810)
    assert "run out of memory" in line.said[-1]
    assert line.circle.phase is Phase.IDENTIFYING


@pytest.mark.parametrize("heavier", [1.0, 1.1])
def test_a_vehicle_that_changes_while_it_is_designed_for_is_not_taken(heavier, design, monkeypatch):
    """What flew since the design was asked for is looked at before the switch."""
    monkeypatch.setattr(circle, "LEARN", 55.0)
    monkeypatch.setattr("circle_in_process.AtOnce", Later)
    vehicle = replace(SHORT, heavier=heavier, change_at=58.0)

    def answer(found):
        if found._last == 3500:
            found._future.set_result(design)

    found, _ = flown(vehicle, lambda record, vehicle: design, watched=answer)
    assert len(found.designs) == (heavier == 1.0)
    assert ("has changed meanwhile" in found.events[1].what) == (heavier != 1.0)
    assert "has changed" in found.reasons()[0] if found.alarm else heavier == 1.0


def test_a_vehicle_whose_process_is_killed_is_an_error_and_one_that_is_left_is_none():
    """It looked like the end of the flight."""
    with VehicleProcess(SHORT) as process:
        process._worker.kill()
        until = time.monotonic() + 10.0
        while not process.over and time.monotonic() < until:
            time.sleep(0.01)
    assert isinstance(process.error, ProcessEndedError)
    with VehicleProcess(SHORT) as left:
        pass
    assert left.error is None


@pytest.mark.parametrize("duration", [0.0, 1e6, 1e12, np.nan, np.inf])
def test_a_flight_without_an_end_is_refused(duration):
    """Its plan was made without a word, for hours."""
    with pytest.raises(InputError, match="up to 36000 s"):
        Vehicle(duration=duration)


def test_the_schedule_is_the_shortest_that_lasts():
    for duration in (0.1, 30.0, 601.3, 36_000.0):
        found = Vehicle(duration=duration).schedule
        less = (
            replace(
                found,
                targets=found.targets[:-1],
                accelerations=found.accelerations[:-1],
                holds=found.holds[:-1],
            )
            if len(found.targets) > 1
            else None
        )
        assert found.duration >= duration
        assert less is None or less.duration < duration
