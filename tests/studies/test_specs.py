"""symheli specs: from a vehicle to design margins, proofs that are kept, flights, and a page."""

import json
import math
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from studies.controllers.designs import LQR, Design, Designs
from studies.controllers.flown import plan
from studies.setup.stored_stages import NotUsable, Stored
from studies.specs.flown import at_a_switch, flown, measured, quickness
from studies.specs.of_vehicle import OfVehicle, share_met
from studies.transition import study
from studies.transition.configuration import Configuration
from symheli import AirspeedSchedule, Helicopter, TableController
from symheli.errors import InputError
from symheli.flight import XCELL_SERVOS, fly_batch, gain_scheduled_lqr
from synthesis.sheet import Sheet
from synthesis.sheet.evaluation import worst

NAME = "mine"


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("specs")
    return OfVehicle(name="xcell60", points=2, folder=folder, sheet=Sheet.load().select(["roll"]))


@pytest.fixture(scope="module")
def lqr(vehicle):
    """The schedule of the study at five airspeeds."""
    autopilot = gain_scheduled_lqr(vehicle.heli, 0.0, 13.0, 0.02, 5, XCELL_SERVOS)
    return autopilot.scheduled_controller.model


@pytest.fixture(scope="module")
def file(lqr, tmp_path_factory):
    return TableController.of(lqr, 9).save(tmp_path_factory.mktemp("table") / f"{NAME}.json")


@pytest.fixture
def words(file):
    return ("specs", "--controller", file, "--points", "2", "--axes", "roll")


def test_what_is_kept_is_not_made_again(vehicle):
    made = []

    def make():
        made.append(1)
        return 3.5

    assert [vehicle.kept("design", "one", make) for _ in range(2)] == [3.5, 3.5]
    assert len(made) == 1
    other = replace(vehicle, points=3)
    assert other.kept("design", "one", make) == 3.5
    assert len(made) == 2  # of other airspeeds: not the same question


@pytest.mark.slow
def test_the_design_of_the_study_is_evaluated_and_kept(vehicle, monkeypatch):
    made = next(vehicle.designs([LQR])).controller
    assert vehicle.frozen({LQR: made}).stable[LQR].all()
    monkeypatch.setattr("studies.specs.of_vehicle.design", lambda *_: pytest.fail("made again"))
    again = next(vehicle.designs([LQR])).controller
    assert np.array_equal(again.A, made.A)
    assert np.array_equal(again.D, made.D)


@pytest.mark.slow
def test_the_command_says_what_the_table_says(run, words, vehicle, file):
    table = vehicle.frozen({NAME: TableController.load(file).model})
    status, out, _ = run(*words, "--json")
    assert status == 0
    data = json.loads(out)["controllers"][NAME]
    found = {s["name"]: s for s in data["specifications"]}
    for reached in table.reached(NAME):
        if not math.isnan(reached.margin):
            one = found[reached.specification.name]
            assert one["margin"] == pytest.approx(reached.margin, rel=1e-9)
            assert one["at"] == reached.at
    assert data["verdict"] == table.verdict(NAME)


@pytest.fixture(scope="module")
def finished(lqr, vehicle, tmp_path_factory):
    """Folder of a study of which only two controllers are stored, one that was not found."""
    made = Configuration(out=tmp_path_factory.mktemp("study"), quick=True)
    made.write(made.out / "study.toml")
    none = Design(name="LFT", controller=None, reason="not feasible")
    kept = Designs(designs=(Design(name=LQR, controller=lqr), none), plant=None)
    stored = study.stored_of(made, vehicle.heli, study.stages(made.effort))
    stored.save("controllers", Stored(result=kept, seconds=0.0))
    return made.out


def test_the_controllers_of_a_finished_study_are_found_in_its_folder(finished, tmp_path):
    configuration, found = study.designs_of(finished)
    assert configuration.vehicle == "xcell60"
    assert [d.name for d in found.designs] == [LQR, "LFT"]
    Configuration(out=tmp_path, quick=True).write(tmp_path / "study.toml")
    with pytest.raises(InputError, match="no finished controllers"):
        study.designs_of(tmp_path)
    Configuration(out=finished, quick=True, seed=1).write(tmp_path / "study.toml")
    shutil.copytree(finished / "stages", tmp_path / "stages")
    with pytest.raises(NotUsable, match="another version, vehicle, effort or seed"):
        study.designs_of(tmp_path)


@pytest.mark.slow
def test_the_sheet_of_a_study_goes_beside_its_report(run, answer, finished):
    asked = ("specs", "--study", finished, "--points", "2", "--axes", "roll")
    data = answer(*asked)
    assert list(data["controllers"]) == [LQR]
    assert data["missing"] == {"LFT": "not feasible"}
    assert "LQR schedule" in (finished / "specs.html").read_text(encoding="utf-8")
    status, _, err = run("specs", "xcell60", "--study", finished)
    assert status == 1
    assert "leave out" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--only", "nobody"), "LQR schedule"),
        (("--axes", "rol"), "roll"),
        (("--airspeeds", "5", "2"), "LOW < HIGH"),
        (("--controller", "no.json", "--only", "LQR"), "leave out"),
    ],
)
def test_what_cannot_be_asked_for_is_refused_in_words(run, words, said):
    status, _, err = run("specs", *words)
    assert status == 1
    assert said in err


def test_the_share_of_flights_that_keep_to_a_value():
    """95 % of 20 flights are 19: the second largest; a lost one is infinite."""
    values = np.arange(1.0, 21.0)
    assert share_met(values, 0.95) == 19.0
    assert share_met(np.append(values[:-1], math.inf), 0.95) == 19.0
    assert share_met(np.append(values[:-2], [math.inf, math.inf]), 0.95) == math.inf


def test_a_flight_along_its_reference_misses_nothing(lqr):
    """Made of its own reference: no error of altitude, track, heading or rotor, and no command
    beside the trim; as it flew it has some.
    """
    heli = Helicopter.load("xcell60", governor="pi")
    slow = AirspeedSchedule((4.0,), (2.0,), (1.0,))
    short = replace(plan(lqr, 7.7), schedule=slow, sensors={})
    (one,) = fly_batch(heli, [short], seeds=[0], workers=1).data
    column = one.columns()
    for y in ("u", "v", "w", "phi", "theta", "Om"):
        column[y] = column[f"{y}_reference"]
    for y in ("p", "q", "r"):  # a reference that pitches while it banks would turn
        column[y] = np.zeros_like(column[y])
    for u in ("d_lon", "d_lat", "d_col", "d_ped"):
        column[f"{u}_command"] = column[f"{u}_reference"]
    names = ("lost", "heli", "plan", "clock", "course", "kept")
    ideal = SimpleNamespace(columns=lambda: column, **{name: getattr(one, name) for name in names})
    found, flew = measured(ideal), measured(one)
    for key in (("altitude", ""), ("track", ""), ("rotor_speed", ""), ("effort", "d_lat")):
        assert found[key] == pytest.approx(0.0, abs=1e-9)
        assert flew[key] > 1e-4


def test_taking_over_from_oneself_changes_little_and_from_others_more(vehicle, monkeypatch):
    """The first command of who takes over is the one in force: a sample late, and no more of
    oneself. A regulator with half as much gain again changes more, within the entries.
    """
    monkeypatch.setattr("studies.specs.flown.HELD_AT", (6.5,))
    own = gain_scheduled_lqr(vehicle.heli, 0.0, 13.0, 0.02).scheduled_controller.model
    heli = Helicopter.load("xcell60", governor="pi")
    found, harder = at_a_switch(heli, own), at_a_switch(heli, replace(own, D=1.5 * own.D))
    assert 0 < found["switch_attitude"] < 0.5
    assert found["switch_attitude"] < harder["switch_attitude"] < 3
    assert 0 < found["switch_acceleration"] < 0.05
    assert found["switch_acceleration"] < harder["switch_acceleration"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "step", "gain"),
    [("yaw", 0.05, 20.0), ("roll", 0.1745, 1.0)],
)
def test_quickness_in_flight_is_that_of_the_frozen_loop(lqr, axis, step, gain, monkeypatch):
    """Within 10 %: servos move in steps and the governed rotor's speed varies. A pulse of two
    samples is nearly the impulse of the frozen loop. The pedal's gain is raised to where it moves
    by many steps of the servo.
    """
    monkeypatch.setattr("studies.specs.flown.HELD_AT", (6.5,))
    monkeypatch.setattr("studies.specs.flown.PULSE", 0.04)
    sheet = Sheet.load()
    vehicle = OfVehicle(name="xcell60", points=3, sheet=sheet.select([axis]))
    D = np.array(lqr.D)
    D[:, lqr.outputs.index("d_ped")] *= gain
    K = replace(lqr, D=D)
    flew = quickness(
        Helicopter.load("xcell60", governor="pi"), K, replace(sheet.axes[axis], step=step)
    )
    (spec,) = (s for s in vehicle.scaled.specifications if s.name.startswith("quickness, linear"))
    _, frozen, _ = vehicle.frozen({NAME: K}).over(NAME, axis, spec.name)
    assert flew == pytest.approx(frozen, rel=0.1)


@pytest.mark.slow
def test_a_controller_that_loses_every_flight_is_lost_and_not_left_out(vehicle, lqr):
    """Every entry that a flight has is infinite of a lost one; the sheet then says so."""
    heli = Helicopter.load("xcell60", governor="pi")
    slow = AirspeedSchedule((4.0,), (2.0,), (1.0,))
    (one,) = fly_batch(heli, [replace(plan(lqr, 7.7), schedule=slow)], seeds=[0], workers=1).data
    fell = measured(SimpleNamespace(lost=10, heli=one.heli))
    assert set(fell) == set(measured(one))
    assert set(fell.values()) == {math.inf}
    found = {("roll", "actuator in turbulence"): math.inf}
    table = vehicle.frozen({LQR: lqr}).with_flown({LQR: found}, 0.0)
    (cell,) = (r for r in table.reached(LQR) if r.specification.name == "actuator in turbulence")
    assert cell.margin == -math.inf
    assert worst(cell) == "lost"


@pytest.mark.slow
def test_flown_and_proven_entries_stand_beside_the_frozen_ones(vehicle, lqr):
    """One proof and few flights of the LQR schedule: the proof is no better than the worst frozen
    model of the same fit, and close to it; flights are kept.
    """
    proofs = vehicle.proven({LQR: lqr}, 0.0, ["roll"])[LQR]
    assert [p.specification.name for p in proofs] == [
        "disk gain margin",
        "disk phase margin",
        "sensitivity peak at the servo",
        "disturbance rejection peak",
    ]
    for one in proofs:
        assert one.certificate.verified
        worst = one.specification.design_margin(one.frozen)
        assert one.margin <= worst + 1e-6
        assert one.margin == pytest.approx(worst, abs=1.0)  # percent of the width of Level 2
    values = flown(vehicle, {LQR: lqr}, 2)[LQR]
    assert set(values) >= {("roll", "actuator in turbulence"), ("roll", "quickness, flown")}
    assert flown(vehicle, {LQR: lqr}, 2)[LQR] == values


@pytest.mark.slow
def test_the_page_shows_every_axis_and_every_source(run, words, tmp_path):
    page = tmp_path / "specs.html"
    assert run(*words, "--page", page, "--figure", tmp_path / "margins.svg")[0] == 0
    text = page.read_text(encoding="utf-8")
    assert "MIL-F-9490D" in text
    assert text.count("<figure>") == 1
    assert "not confirmed" in text
    assert (tmp_path / "margins.svg").stat().st_size > 1000


@pytest.mark.slow
def test_the_page_fits_a_phone_and_a_screen(run, words, tmp_path):
    page = tmp_path / "specs.html"
    assert run(*words, "--page", page)[0] == 0
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="wants playwright")
    if chromium is None:
        pytest.skip("wants Chromium")
    with playwright.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for width in (390, 1280):
            shown = browser.new_page(viewport={"width": width, "height": 900})
            said = []
            shown.on("console", lambda message, said=said: said.append(message.text))
            shown.goto(page.as_uri())
            beyond = shown.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert beyond <= 0
            assert not said
        browser.close()
