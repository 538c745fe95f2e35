"""symheli synthesize: a controller asked for in a file, designed, certified as it flies, flown."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import identification
import symheli
import synthesis
from evidence import impossible, random_designs
from studies import cli
from studies.controllers import starting
from studies.controllers.design_choices import DesignChoices
from studies.controllers.measures import _left
from studies.controllers.synthesized import (
    BesideAutopilot,
    model_of,
    plants,
    synthesized,
    tabulated,
)
from studies.controllers.synthesized_report import TABLE, gains, text
from symheli.errors import InputError, SynthesisError
from symheli.progress import watched
from synthesis.numerics.linear.norm import norm

SMALL = """
vehicle = ""
model = "family.json"
out = "made"
airspeeds = [0.0, 8.0]
acceleration = 2.0
degree = 1
controls = ["d_lat"]
measurements = ["v"]
disturbances = ["v_w", "d_lat"]
delay = 0.0
sizes = { v = 1.0, d_lat = 0.05, v_w = 1.0 }
noise = { v = 0.3 }
servos = {}
"""
"""A lag over airspeed, from gusts and what is added to the control."""

MEASURED = ("speed", "attitude", "outside", "faster", "ratio")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small")
    models = [
        symheli.LinearModel(
            [[0.2 - 0.1 * V]], [[5.0, 1.0]], [[1.0]], [[0.0, 0.0]], ["v"], ["d_lat", "v_w"], ["v"]
        )
        for V in (0.0, 4.0, 8.0)
    ]
    symheli.LinearFamily.from_models([0.0, 4.0, 8.0], models).save(folder / "family.json")
    (folder / "my.toml").write_text(SMALL)
    return folder / "my.toml"


@pytest.fixture(scope="module")
def family(small):
    return symheli.LinearFamily.load(small.parent / "family.json")


@pytest.fixture(scope="module")
def found(small, family):
    return synthesized(DesignChoices.read(small, {}), family)


def test_what_is_written_with_the_defaults_asks_for_the_defaults(tmp_path):
    path = DesignChoices().write(tmp_path / "my.toml")
    assert DesignChoices.read(path, {"out": DesignChoices().out}) == DesignChoices()
    assert max(map(len, path.read_text().splitlines())) <= 120


def test_the_choices_beside_the_results_name_their_folder_again(tmp_path):
    asked = DesignChoices(out=tmp_path / "controller")
    assert DesignChoices.read(asked.write(asked.out / "synthesize.toml"), {}) == asked


def test_everything_that_is_wrong_in_the_file_is_said_at_once(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text(
        'airspeeds = [5, 2]\ndelay = 0.03\nmeasurements = ["v", "xi"]\nsizes = { v = 1 }\n'
        "servos = { d_lon = [36] }\nback_off = [1.0]\n"
    )
    with pytest.raises(InputError) as told:
        DesignChoices.read(path, {})
    for said in (
        "airspeeds: expected [LOW, HIGH], got [5.0, 2.0]",
        "delay: 0.03 s are no whole samples of 0.02 s",
        "noise: give xi a number > 0",
        "sizes: give d_ped a number > 0",
        "servos: d_lon expected 2 or 4 numbers, got [36.0]",
        "back_off: expected numbers > 1",
    ):
        assert said in str(told.value)
    path.write_text("[sizes]\nv = 'large'\n")
    with pytest.raises(InputError, match="sizes: expected of v a number, got"):
        DesignChoices.read(path, {})
    path.write_text("ordre = 4\n")
    with pytest.raises(InputError, match="ordre is unknown; did you mean order"):
        DesignChoices.read(path, {})


def test_the_table_the_proof_and_the_page_are_of_what_was_asked_for(
    small, family, found, capsys, monkeypatch
):
    """A lag that is unstable in hover: no loop is without a controller."""
    monkeypatch.setattr("studies.controllers.synthesized.synthesized", lambda *_: found)
    status = cli.main(["synthesize", str(small), "--json"])
    told = json.loads(capsys.readouterr().out)
    out = small.parent / "made"
    assert status == 0
    assert told["verified"]
    assert told["flown"] is None
    assert told["frozen"] <= told["proven"] < math.inf
    assert {path.name for path in out.iterdir()} == {
        *("certificate.json", "controller.json", "numbers.json", "report.html", "synthesize.toml"),
        "figures",
    }
    assert symheli.TableController.load(out / TABLE).matrices.tobytes() == (
        found.table.matrices.tobytes()
    )
    assert synthesis.Certificate.load(out / "certificate.json").verify()
    assert "keeps a gain of" in (out / "report.html").read_text()
    assert DesignChoices.read(out / "synthesize.toml", {}).sizes == found.choices.sizes
    # the loop of the proof is this table around this plant
    _, plant = plants(model_of(found.choices, family), found.choices)
    assert "d_lat_disturbance" in plant.disturbances
    loop = plant.close(found.table)
    for p in (0.0, 3.0, 8.0):
        np.testing.assert_allclose(found.sampled.loop.at(p).A, loop.at(p).A, atol=1e-12)


def test_what_is_shown_fits_a_terminal_and_names_what_is_known(found):
    assert [name for name, *_ in gains(found)] == ["promised", "frozen", "proven"]
    said = text(found, [])
    assert max(map(len, said.splitlines())) <= 100
    assert f"{found.sampled.gamma:.3g}" in said.splitlines()[0]
    flight = SimpleNamespace(**dict.fromkeys(MEASURED, 0.5), lost=True, left=("d_lat at its stop",))
    said = " ".join(text(replace(found, measures=(flight,)), []).split())
    assert "1 of 1 were lost" in said
    assert "Flight 1 left the hypotheses: d_lat at its stop." in said
    above = SimpleNamespace(**{**dict.fromkeys(MEASURED, 0.5), "ratio": 99.0}, lost=False, left=())
    said = " ".join(text(replace(found, measures=(above,)), []).split())
    assert "Flight 1 reached 99, above the proven gain, and left no hypothesis" in said


@pytest.mark.slow
def test_as_many_states_and_airspeeds_as_are_asked_for(family, found):
    _, plant = plants(model_of(found.choices, family), found.choices)
    for asked in (replace(found.choices, knots=5), replace(found.choices, order=1)):
        table = tabulated(found.made, plant, asked)
        assert len(table.knots) == (asked.knots or len(found.table.knots))
        assert table.order == (asked.order or found.table.order)


def test_a_model_sampled_otherwise_than_the_controller_is_refused(small, family):
    asked = DesignChoices.read(small, {})
    whole = model_of(asked, family)

    class Sampled:
        def to_state_space(self):
            return whole.discretize(0.1)

    with pytest.raises(InputError, match=r"sampled every 0\.1 s, the controller every 0\.02 s"):
        model_of(asked, Sampled())  # type: ignore[arg-type]


# --- what is possible -----------------------------------------------------------------------------


def test_an_impossible_design_is_refused_with_what_to_add_and_possible_with_it():
    name = "two lags, one control"
    changes = impossible.CASES[name]
    said = impossible.refusal(name, changes)
    assert "the mode at" in said
    assert "add to controls d_lon and to measurements u: least gain" in said
    every = {"controls": ("d_lat", "d_lon"), "measurements": ("v", "u")}
    assert impossible.refusal(name, {**changes, **every}) == ""


@pytest.mark.slow
def test_twenty_impossible_designs_are_answered_without_a_program():
    """`python -m evidence.impossible` tells the seconds; they are the machine's."""
    assert len(impossible.CASES) == 20
    heard = []
    with watched(heard.append):
        for name, said, _ in impossible.answers():
            advice = "add to", "divided by", "times 10", "delay"
            assert any(words in said for words in advice), name
    assert "designing" not in {p.task for p in heard}


def test_a_gain_above_the_largest_is_refused_before_any_program(small, family):
    asked, heard = replace(DesignChoices.read(small, {}), gain=0.01), []
    no_controller = "by Riccati equations: no controller keeps a gain"
    with watched(heard.append), pytest.raises(SynthesisError, match=no_controller):
        synthesized(asked, family)
    assert {p.task for p in heard} == {"looking for what is possible"}


def test_the_count_of_programs_does_not_begin_again(small, family):
    heard = []
    with watched(heard.append):
        synthesized(DesignChoices.read(small, {}), family)
    counts = [p.done for p in heard if p.task == "designing"]
    assert counts == sorted(counts)
    assert counts[-1] >= 1


# --- first choices, references, flights ----------------------------------------------------------


def test_first_choices_of_the_x_cell_are_the_defaults_and_others_have_its_effects():
    assert starting.for_vehicle(DesignChoices()) == DesignChoices()
    other = starting.for_vehicle(DesignChoices(vehicle="yamaha_r50"))
    hover = symheli.linearize(symheli.Helicopter.load("yamaha_r50", governor="ideal"), 0.0)
    a1, d_lon = list(hover.states).index("a1"), list(hover.inputs).index("d_lon")
    tilt = hover.B[a1, d_lon] / hover.A[a1, a1]
    assert other.sizes["d_lon"] == pytest.approx(min(0.0378 / abs(tilt), 0.025), rel=0.05)


def test_what_is_written_for_a_model_has_its_range_signals_and_controls_and_runs(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    identified(tmp_path / "model.json", dt=0.05)
    assert cli.main(["synthesize", "--model", "model.json", "--write-config", "my.toml"]) == 0
    asked = DesignChoices.read(tmp_path / "my.toml", {})
    assert (asked.vehicle, asked.airspeeds, asked.period) == ("", (0.0, 10.0), 0.05)
    assert (asked.controls, asked.measurements) == (("d_lat",), ("v",))
    assert asked.disturbances == ("d_lat",)
    assert cli.main(["synthesize", "my.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.split("\n", 1)[1])["verified"]


def test_a_command_is_followed_where_one_is_asked_for(small, family):
    asked = replace(DesignChoices.read(small, {}), references=("v",))
    made = synthesized(asked, family)
    assert "v_reference" in made.sampled.loop.inputs
    assert "weighted_v_error" in made.sampled.loop.outputs
    assert tuple(map(str, made.table.inputs)) == ("v",)
    assert made.sampled.certificate.verified
    with pytest.raises(InputError, match="references: q not among the measurements, v"):
        replace(asked, references=("q",))


def test_a_flight_says_which_hypothesis_it_left_and_when():
    time, asked = 0.02 * np.arange(100), DesignChoices()
    forward, change = np.where(time > 1.0, 13.5, 5.0), np.where(time > 0.5, 3.4, 0.0)
    commands = np.zeros((100, 4))
    commands[80:, 2] = 0.2
    said = list(_left(time, forward, change, commands, np.full(4, 0.2), asked))
    assert said[0].startswith(
        "airspeed above 13 m/s at 1.0 s first, 49.0 % of the time, by 0.5 m/s"
    )
    assert said[1].startswith("|dV/dt| above 3 m/s^2 at 0.5 s first")
    assert said[2] == "d_col at its stop at 1.6 s first: no linear model"
    assert not list(_left(time, 5 + 0 * time, 0 * time, 0 * commands, np.full(4, 0.2), asked))


# --- a model that symheli identify has saved ------------------------------------------------------


def identified(path, dt=0.02, high=10.0, parameter="airspeed", unit="m/s"):
    """Saved by a fit to v(k) = (1.004 - 0.002 V(k-1)) v(k-1) + 0.1 d_lat(k-1)."""
    k, rng = np.arange(600), np.random.default_rng(0)
    V, u, v = 0.5 * high * (1 + np.sin(0.05 * k)), rng.uniform(-0.05, 0.05, 600), np.zeros(600)
    for i in range(1, 600):
        v[i] = (1.004 - 0.002 * V[i - 1]) * v[i - 1] + 0.1 * u[i - 1]
    units = {"v": "m/s", "d_lat": "rad", parameter: unit}
    record = symheli.FlightRecord.from_arrays(dt * k, units, v=v, d_lat=u, **{parameter: V})
    basis = identification.Polynomial(1, 0.0, high)
    arx = identification.LPVARX("v", "d_lat", parameter, na=1, nb=1, delay=1, basis=basis)
    return identification.fit(arx, record).save(path)


OF_IDENTIFIED = SMALL.replace('["v_w", "d_lat"]', '["d_lat"]').replace("family", "model")


def said_of(tmp_path, capsys, choices=OF_IDENTIFIED):
    """What `symheli synthesize` refuses these choices with."""
    (tmp_path / "my.toml").write_text(choices)
    assert cli.main(["synthesize", str(tmp_path / "my.toml")]) == 1
    assert not (tmp_path / "made").exists()
    return capsys.readouterr().err


@pytest.mark.slow
def test_a_controller_for_a_saved_identified_model_is_proven_around_that_model(tmp_path, capsys):
    """Known to higher airspeeds than are asked for; the loop of the proof is by hand that of the
    coefficients that made the record.
    """
    identified(tmp_path / "model.json")
    (tmp_path / "my.toml").write_text(OF_IDENTIFIED)
    assert cli.main(["synthesize", str(tmp_path / "my.toml"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verified"]
    assert told["frozen"] <= told["proven"] < math.inf
    assert "keeps a gain of" in (tmp_path / "made" / "report.html").read_text()
    table = symheli.TableController.load(tmp_path / "made" / TABLE)
    assert table.dt == 0.02
    proof = synthesis.Certificate.load(tmp_path / "made" / "certificate.json")
    assert proof.verify()
    asked = DesignChoices.read(tmp_path / "my.toml", {})
    given = identification.model.LPVARXModel.load(tmp_path / "model.json")
    _, plant = plants(model_of(asked, given), asked)
    worst = 0.0
    for V in (0.0, 3.0, 8.0):
        K = table.model.at(V)
        A = np.block([[np.atleast_2d(1.004 - 0.002 * V) + 0.1 * K.D, 0.1 * K.C], [K.B, K.A]])
        loop = plant.close(table).at(V)
        own, of_loop = (np.sort_complex(np.linalg.eigvals(M)) for M in (A, loop.A))
        np.testing.assert_allclose(of_loop, own, atol=1e-6)
        worst = max(worst, norm(loop.A, loop.B, loop.C, loop.D, 0.02)[0])
    assert worst <= told["proven"]


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"dt": 0.05}, "sampled every 0.05 s, the controller every 0.02 s; give the same"),
        ({"high": 5.0}, "airspeeds: the model is known from 0 to 5 m/s; ask for no more"),
        ({"parameter": "rpm", "unit": "rad/s"}, "one over rpm (rad/s); make it over airspeed"),
        ({"parameter": "mixture", "unit": "1"}, "one over mixture (1); make it over airspeed"),
    ],
)
def test_an_identified_model_over_something_else_is_refused(tmp_path, capsys, other, said):
    identified(tmp_path / "model.json", **other)
    assert said in said_of(tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_settings_of_identified_models_end_in_a_design_or_a_sentence(seed, record):
    """`evidence.random_designs` runs eighty."""
    assert random_designs.outcome(seed, record)


@pytest.fixture(scope="module")
def record():
    return random_designs.flown()


@pytest.mark.slow
def test_the_first_choices_for_a_longitudinal_log_end_in_a_controller(tmp_path, capsys, record):
    structure = identification.LPVARX(
        outputs=("u", "w", "q", "theta"),
        inputs=("d_lon", "d_col"),
        scheduling="airspeed_command",
        na=2,
        nb=2,
        delay=1,
        basis=identification.Polynomial(2, 0.0, 10.0),
        offset=True,
    )
    model = identification.fit(structure, record).save(tmp_path / "model.json")
    mine = tmp_path / "my.toml"
    assert cli.main(["synthesize", "--model", str(model), "--write-config", str(mine)]) == 0
    assert cli.main(["synthesize", str(mine), "--out", str(tmp_path / "made")]) == 0
    assert "Misses Level 1" in capsys.readouterr().out


def test_what_an_identified_model_does_not_have_is_not_asked_of_it(tmp_path, capsys):
    identified(tmp_path / "model.json")
    gusts = OF_IDENTIFIED.replace('["d_lat"]\ndelay', '["v_w", "d_lat"]\ndelay')
    assert "the model has no v_w; give names of d_lat" in said_of(tmp_path, capsys, gusts)
    states = OF_IDENTIFIED.replace("degree = 1", 'degree = 1\nstates = ["v"]')
    assert "an identified model keeps its own; leave them out" in said_of(tmp_path, capsys, states)


def test_a_file_that_holds_no_model_over_airspeed_is_refused(tmp_path, capsys, family):
    path = tmp_path / "model.json"
    assert "symheli identify --save FILE writes one" in said_of(tmp_path, capsys)
    for content in ("u v w", '{"schema": "symheli table controller"}', "[1, 2]"):
        path.write_text(content)
        assert "model.json: expected a model of symheli identify" in said_of(tmp_path, capsys)
    axes, speeds = (
        (symheli.values.Signal("airspeed", "m/s"), symheli.values.Signal("altitude", "m")),
        (0.0, 8.0),
    )
    models = [family.models[0]] * 4
    symheli.LinearFamily(axes, (speeds, (0.0, 100.0)), models).save(path)
    said = said_of(tmp_path, capsys)
    assert "got one over airspeed (m/s), altitude (m)" in said
    assert "LinearFamily.fix" in said


@pytest.mark.slow
def test_a_controller_whose_loop_does_not_stand_the_delay_is_refused_with_what_to_change(
    family, found
):
    """Designed without a delay, flown so late."""
    late = replace(found.choices, delay=1.2)
    _, plant = plants(model_of(late, family), late)
    with pytest.raises(SynthesisError, match=r"a delay of 1\.2 s.*unstable.*ask for less"):
        tabulated(found.made, plant, late)


def test_what_is_not_commanded_is_flown_by_the_autopilot():
    class Four:
        dt, outputs = 0.02, ("d_lat", "d_ped")

        def __init__(self, *u):
            self.u = u

        def init(self):
            return 1.0

        def step(self, state, *_):
            return state * np.array(self.u), 2.0 * state

    own, rest = Four(0.0, 2.0, 0.0, 4.0), Four(10.0, 20.0, 30.0, 40.0)
    both = BesideAutopilot(own, rest)  # type: ignore[arg-type]
    first, state = both.step(both.init(), None, None, None)  # type: ignore[arg-type]
    np.testing.assert_array_equal(first, [10.0, 2.0, 30.0, 4.0])
    second, _ = both.step(state, None, None, None)  # type: ignore[arg-type]
    np.testing.assert_array_equal(second, [20.0, 4.0, 60.0, 8.0])


@pytest.mark.slow
def test_the_defaults_give_a_proven_controller_that_flies(tmp_path, capsys):
    """What --write-config writes works as it is."""
    assert cli.main(["synthesize", "--write-config", str(tmp_path / "my.toml")]) == 0
    capsys.readouterr()
    assert cli.main(["synthesize", str(tmp_path / "my.toml"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verified"]
    assert told["flown"]["largest"] < told["proven"] < 1.3 * told["frozen"]
    assert told["states"]["flown"] < told["states"]["designed"]
    assert not any(flight["lost"] for flight in told["flights"])
    assert told["met_every_hypothesis"] >= 3
    assert told["sheet"]["missed"]


def with_known_kinematics():
    """A rigid body, damped and driven axis by axis, whose u is its airspeed."""
    controls = ("d_lon", "d_lat", "d_col", "d_ped")
    basis = identification.Polynomial(1, 0.0, 10.0)
    kin = identification.KinematicARX(controls, "airspeed_command", na=1, nb=1, basis=basis)
    own = np.zeros((12, 6))  # of one second: from u v w p q r, the controls, offset and increment
    own[range(6), range(6)] = [-0.4, -0.5, -0.8, -6.0, -5.0, -4.0]
    own[[0, 1, 1], [4, 3, 5]] = [0.3, -0.4, 0.2]  # speed to pitch, roll and yaw
    own[[6, 7, 8, 9], [4, 3, 2, 5]] = [30.0, 40.0, -50.0, 25.0]
    V = np.array([0.0, 5.0, 10.0])
    aerodynamics = identification.model.LPVARXModel(
        structure=kin.aerodynamics,
        theta=np.vstack([basis.fit(V, np.tile(0.02 * row, (3, 1))) for row in own]),
        dt=0.02,
        outputs=kin.aerodynamics.outputs,
        inputs=kin.aerodynamics.inputs,
        scheduling=symheli.values.Signal("airspeed_command", "m/s"),
        residual_covariance=np.eye(6),
        rows_used=100,
    )
    trim = basis.fit(V, np.outer(V, np.eye(8)[0]))
    return identification.model.KinematicModel(structure=kin, aerodynamics=aerodynamics, trim=trim)


def test_to_a_model_with_known_kinematics_a_gust_is_the_opposite_velocity(tmp_path):
    """In its forces: what a gust adds to velocities is what they lose of the same velocity."""
    path = with_known_kinematics().save(tmp_path / "model.json")
    asked = DesignChoices(vehicle="", model=str(path), airspeeds=(0.0, 8.0), delay=0.0, servos={})
    model = model_of(asked, identification.model.KinematicModel.load(path))
    at = model.at(3.0)
    gust = [list(map(str, model.inputs)).index(name) for name in ("u_w", "v_w", "w_w")]
    np.testing.assert_allclose(at.B[:, gust], np.eye(8)[:, :3] - at.A[:, :3], atol=1e-12)
    continuous, sampled = plants(model, asked)
    assert (continuous.model.dt, sampled.model.dt) == (None, 0.02)
    # Tustin's rule back: its poles, but for those of the hold
    z = np.linalg.eigvals(at.A)
    s = np.linalg.eigvals(continuous.model.at(3.0).A)
    np.testing.assert_allclose(
        np.sort_complex(s), np.sort_complex(2 / 0.02 * (z - 1) / (z + 1)), atol=1e-3
    )


@pytest.mark.slow
def test_a_controller_for_a_model_with_known_kinematics_is_proven(tmp_path, capsys):
    with_known_kinematics().save(tmp_path / "model.json")
    (tmp_path / "my.toml").write_text(
        'vehicle = ""\nmodel = "model.json"\nairspeeds = [0, 8]\nacceleration = 2.0\n'
        "delay = 0.0\nback_off = [1.6]\norder = 8\nknots = 3\n[servos]\n"
    )
    assert cli.main(["synthesize", str(tmp_path / "my.toml"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verified"]
    assert told["frozen"] <= told["proven"] < 2 * told["promised"]


@pytest.mark.slow
def test_sideways_alone_the_rest_is_flown_by_an_autopilot(tmp_path):
    asked = DesignChoices(
        out=tmp_path / "lateral",
        states=("v", "p", "r", "phi", "b1"),
        controls=("d_lat", "d_ped"),
        measurements=("v", "p", "r", "phi"),
        disturbances=("v_w",),
    )
    found = synthesized(asked)
    assert found.sampled.certificate.verified
    assert found.lost == 0
