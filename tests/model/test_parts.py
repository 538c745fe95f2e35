"""A part is a file and a section: a wing of one's own, a second rotor, a rotor off the centre of
gravity.
"""

from __future__ import annotations

import math
import os
import re

import numpy as np
import pytest
from airframes import AFT_ROTOR, DOCS, FORWARD, WING, WING_COMPONENT, write

import symheli
from studies import cli
from symheli.airframe.vehicle import load_vehicle
from symheli.components import Component
from symheli.errors import InputError


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    """These airframes are looked at once: compiling them would cost more than it saves. The numbers
    are the same.
    """
    monkeypatch.setattr("symheli.helicopter.compiled", lambda function: function)


@pytest.fixture(scope="module")
def ideal():
    """An X-Cell of this module's own, as it stays interpreted."""
    return symheli.Helicopter.load("xcell60", governor="ideal")


def load(path, governor="ideal"):
    return symheli.Helicopter.load(path, governor=governor, allow_code=True)


def test_a_wing_of_ones_own_changes_z_w_as_its_closed_form_says(tmp_path, ideal):
    """Z_w of the wing is -0.5 rho S C_La u0/m, Z_u the same with w0; nothing else of the model
    changes at the same state.
    """
    (tmp_path / "wing.py").write_text(WING_COMPONENT)
    winged = load(write(tmp_path, WING))
    point = symheli.trim(ideal, 9.0)
    A, Aw = (h.numeric("jacobian")(point.x.array, point.u.array, 0.0)[0] for h in (ideal, winged))
    change, k = Aw - A, 0.5 * 1.225 * 0.3 * 4.5 / 8.2
    w = ideal.states.index("w")
    assert change[w, w] == pytest.approx(-k * point.x["u"], rel=1e-12)
    assert change[w, 0] == pytest.approx(-k * point.x["w"], rel=1e-12)
    change[w, [0, w]] = 0.0
    np.testing.assert_allclose(change, 0.0, atol=1e-12)  # rounding of entries up to 300
    assert symheli.trim(winged, 9.0).success


@pytest.mark.slow(but="pi")
@pytest.mark.parametrize("governor", ["ideal", "pi"])
def test_a_second_rotor_trims_and_linearizes_under_names_of_its_own(tmp_path, governor):
    """Two rotors fore and aft, collectives mixed for pitch: the names of the first stay, the second
    adds its section.
    """
    heli = load(write(tmp_path, AFT_ROTOR, replace={"[main_rotor]": FORWARD}), governor)
    assert heli.states[8:12] == ("a1", "b1", "a1_aft_rotor", "b1_aft_rotor")
    assert heli.states[10].unit == "rad"
    assert {"V_imr", "V_imr_aft_rotor", "switch_aft_rotor_vortex_ring"} <= set(
        heli.diagnostics.name_out()
    )
    for speed in (0.0, 6.0):
        lin = symheli.linearize(heli, symheli.trim(heli, speed))
        assert np.all(np.isfinite(lin.A))
        assert lin.A.shape == (len(heli.states),) * 2


def test_a_rotor_off_the_centre_of_gravity_adds_its_arm_to_pitch(tmp_path, ideal):
    """In hover, for a rotor at x: M gains x T, the flow at the hub -q x, so M_q gains m x^2 Z_w
    (Z_w of the rotor alone).
    """
    x = 0.1
    moved = load(
        write(
            tmp_path,
            replace={
                "[main_rotor]": f'[main_rotor]\nx = {{ value = {x}, unit = "m", source = "test" }}'
            },
        )
    )
    point = symheli.trim(ideal, 0.0)
    at = (point.x.array, point.u.array, 0.0)
    w, q = ideal.states.index("w"), ideal.states.index("q")
    thrust = float(ideal.numeric("diagnostics")(*at)[ideal.diagnostics.name_out().index("T_mr")][0])
    pitch = [h.numeric("rhs")(*at)[0][q] for h in (ideal, moved)]
    assert pitch[1] - pitch[0] == pytest.approx(x * thrust / 0.34, rel=1e-12)
    A, Am = (h.numeric("jacobian")(*at)[0] for h in (ideal, moved))
    bare = symheli.Helicopter(ideal.vehicle, "ideal").with_parameters(
        {f"fuselage.area_{axis}": 0.0 for axis in "xyz"} | {"horizontal_tail.area": 0.0}
    )
    z_w = bare.numeric("jacobian")(*at)[0][w, w] * 8.2  # N s/m, rotor alone
    # fuselage and tail in the changed downwash take part in Am - A by under 1 % of the rotor's own
    # effect; flapping not at all
    assert (Am - A)[q, q] == pytest.approx(x**2 * z_w / 0.34, rel=0.02)


LEGS = """
from symheli.components import Component, Effect, Entry


def evaluate(par, motion, controls, own, flow):
    return Effect(force=(-par.drag * motion.u_a, 0.0, 0.0))


COMPONENT = Component(
    evaluate, parameters={"drag": Entry("N s/m", "drag by speed")}, place=("x", "z")
)
"""

ON_LEGS = """
[legs]
component = "./legs.py"
drag = { value = 2.0, unit = "N s/m", source = "test" }
x = { value = 0.0, unit = "m", source = "test" }
z = { value = 30.0, unit = "cm", source = "test" }
"""


def test_a_part_may_require_its_place(tmp_path, ideal):
    """Drag d u at z below the c.g.: X_u loses d/m, M_u d z/I_yy, M_q d z^2/I_yy. Without z it is
    refused.
    """
    (tmp_path / "legs.py").write_text(LEGS, encoding="utf-8")
    path = write(tmp_path, ON_LEGS)
    placed = symheli.Helicopter.load(str(path), governor="ideal", allow_code=True)
    point = symheli.trim(ideal, 0.0)
    at = (point.x.array, point.u.array, 0.0)
    A, Ap = (h.numeric("jacobian")(*at)[0] for h in (ideal, placed))
    u, q = ideal.states.index("u"), ideal.states.index("q")
    assert (Ap - A)[u, u] == pytest.approx(-2.0 / 8.2, rel=1e-9)
    assert (Ap - A)[q, u] == pytest.approx(-2.0 * 0.3 / 0.34, rel=1e-9)
    assert (Ap - A)[q, q] == pytest.approx(-2.0 * 0.3**2 / 0.34, rel=1e-9)
    write(tmp_path, "\n".join(line for line in ON_LEGS.splitlines() if line[:1] != "z"))
    with pytest.raises(InputError) as caught:
        symheli.Helicopter.load(str(path), governor="ideal", allow_code=True)
    said = "legs.z: missing (reference point from the centre of gravity, down); add z = { value"
    assert said in str(caught.value)
    assert "unit = 'm'" in str(caught.value)


def test_a_place_that_is_given_twice_is_refused(tmp_path):
    """The advice of the message is followed, and x stands beside a height."""
    x = 'x = { value = 0.1, unit = "m", source = "test" }\n'
    z = 'z = { value = 0.1, unit = "m", source = "test" }\n'
    path = write(tmp_path, replace={"[tail_rotor]\n": f"[tail_rotor]\n{x}{z}"})
    with pytest.raises(InputError) as caught:
        load(path)
    for said in (
        "arm gives it, x = -arm: leave x out",
        "height gives it, z = -height: leave z out",
    ):
        assert said in str(caught.value)
    load(write(tmp_path, replace={"[main_rotor]\n": f"[main_rotor]\n{x}"}))
    with pytest.raises(InputError, match="place: expected x, y or z, got h"):
        Component(None, {}, place=("h",))


def test_a_second_rotor_far_away_in_still_air_doubles_the_hover_force(tmp_path, ideal):
    """At the same pitch two equal rotors at the same place give twice the thrust and twice the
    torque of one.
    """
    twin = AFT_ROTOR.replace("controls = { d_col = { d_col = 1.0, d_lon = -0.5 } }\n", "").replace(
        "value = -0.4", "value = 0.0"
    )
    heli = load(write(tmp_path, twin))
    point = symheli.trim(ideal, 0.0)
    x = np.concatenate([point.x.array, point.x.array[8:]])
    values = dict(
        zip(
            heli.diagnostics.name_out(),
            heli.numeric("diagnostics")(x, point.u.array, 0.0),
            strict=True,
        )
    )
    for name in ("T_mr", "Q_mr", "V_imr"):
        assert values[f"{name}_aft_rotor"] == pytest.approx(values[name], rel=1e-14)


def test_flow_may_be_taken_from_the_rotor_that_is_named(tmp_path):
    """The fuselage under the second rotor: without flight speed its drag follows that rotor's
    downwash.
    """
    fuselage = '[fuselage]\nflow = { V_imr = "V_imr_aft_rotor" }'
    aft = AFT_ROTOR.replace("d_lon = -0.5", "d_lon = 0.0, d_lat = 1.0")
    first, second = (
        load(write(tmp_path, aft, name=f"{k}.toml", replace={"[fuselage]": text}))
        for k, text in enumerate(("[fuselage]", fuselage))
    )
    x = np.zeros(len(first.states))
    gain = [
        h.rhs(x, [0, 0.02, 0.09, 0.2], [0, 0, 0]) - h.rhs(x, [0, 0.0, 0.09, 0.2], [0, 0, 0])
        for h in (first, second)
    ]
    w = first.states.index("w")
    assert float(gain[1][w]) > float(gain[0][w])  # more downwash on the fuselage pushes it down
    assert float(gain[1][0]) == float(gain[0][0])


def test_the_documented_variants_exist(ideal):
    """The two lines of docs/vehicles.md under "Other numbers"."""
    copies = {"heli": ideal}
    exec(re.findall(r"```python\n(.*?)```", DOCS, re.DOTALL)[1], copies)
    assert copies["heavy"].parameters["body.mass"] == 9.0
    assert copies["large"].parameters["main_rotor.radius"] == pytest.approx(4 * 0.775)


def test_the_printed_names_stay_for_one_rotor(heli):
    assert heli.states[8:10] == ("a1", "b1")
    assert "V_imr" in heli.diagnostics.name_out()


@pytest.mark.parametrize(
    ("section", "message"),
    [
        (WING, "no component file at .*wing.py"),
        (
            WING.replace("./wing.py", "wings"),
            r"line \d+, wing.component: unknown component 'wings'",
        ),
        (
            AFT_ROTOR.replace("d_lon = -0.5", "d_lno = -0.5"),
            "aft_rotor.controls: unknown control 'd_lno'; did you mean 'd_lon'",
        ),
        (AFT_ROTOR.replace("-0.5", "nan"), "gain must be a finite number"),
        (
            "[wake]\ncomponent = 'tail_wake'\nflow = { V_mr = 'V_imr' }",
            "wake.flow: unknown flow 'V_mr'",
        ),
    ],
)
def test_a_section_that_cannot_be_says_where_and_why(tmp_path, section, message):
    with pytest.raises(symheli.errors.InputError, match=message):
        load(write(tmp_path, section))


def test_a_component_file_that_fails_is_named(tmp_path):
    for content, message in (
        ("x = 1", "must define COMPONENT"),
        ("1/0", "does not run: ZeroDivisionError"),
        (WING_COMPONENT.replace('"area"', '"x"'), "place x y z already"),
    ):
        (tmp_path / "wing.py").write_text(content)
        with pytest.raises(symheli.errors.InputError, match=message):
            load(write(tmp_path, WING))


def test_flow_that_nobody_makes_is_named(tmp_path):
    with pytest.raises(symheli.errors.InputError, match="V_imr_front"):
        _ = load(
            write(tmp_path, replace={"[fuselage]": "[fuselage]\nflow = { V_imr = 'V_imr_front' }"})
        ).states


def test_other_numbers_share_the_compiled_equations(ideal):
    """with_parameters gives what a file with these numbers gives, follows references, and compiles
    nothing.
    """
    heavy = ideal.with_parameters({"body.mass": 9.0, "density": 1.1, "main_rotor.radius": 0.8})
    assert heavy._functions is ideal._functions
    assert heavy.vehicle.values("tail_wake")["rotor_radius"] == 0.8
    assert heavy.parameters["density"] == heavy.density == 1.1
    point = symheli.trim(heavy, 4.0)
    rhs = np.array(
        heavy.rhs(point.x.array, point.u.array, [0, 0, 0])
    ).ravel()  # numbers written in, not passed
    np.testing.assert_allclose(
        rhs, heavy.numeric("rhs")(point.x.array, point.u.array, 0.0)[0], atol=1e-12
    )
    assert point.u["d_col"] > symheli.trim(ideal, 4.0).u["d_col"]
    with pytest.raises(symheli.errors.UnknownNameError, match=r"body\.mass"):
        ideal.with_parameters({"body.mas": 1.0})
    with pytest.raises(symheli.errors.InputError, match=r"mass.*must be > 0"):
        ideal.with_parameters({"body.mass": -1.0})
    with pytest.raises(symheli.errors.InputError, match="finite"):
        ideal.with_parameters({"body.mass": math.nan})


def test_a_part_in_python_is_run_only_where_that_is_asked_for(tmp_path, monkeypatch, capsys):
    """What loads a vehicle unasked runs nothing: the file would leave a trace."""
    trace = tmp_path / "trace"
    (tmp_path / "wing.py").write_text(f"open({str(trace)!r}, 'w').close()\n{WING_COMPONENT}")
    path = write(tmp_path, WING)
    with pytest.raises(InputError, match=r"run the Python file .*wing\.py.*allow_code=True"):
        symheli.Helicopter.load(path)
    for words in (["vehicles", str(path)], ["trim", str(path)], ["trim", "--vehicle", str(path)]):
        assert cli.main(words) == 1
        assert "--allow-code" in capsys.readouterr().err
    assert not trace.exists()
    assert cli.main(["trim", str(path), "--airspeed", "5", "--allow-code"]) == 0
    assert trace.exists()
    assert "SYMHELI_ALLOW_CODE" not in os.environ  # asked for once, not from then on
    trace.unlink()
    monkeypatch.setenv("SYMHELI_ALLOW_CODE", "1")
    assert "wing" in load_vehicle(path).sections
    assert trace.exists()
    assert cli.main(["trim", "xcell60", "--allow-code"]) == 1
    assert "no such file is given" in capsys.readouterr().err


def test_a_campaign_file_imports_no_module_unasked(tmp_path, monkeypatch, capsys):
    trace = tmp_path / "trace"
    (tmp_path / "own_trial.py").write_text(f"open({str(trace)!r}, 'w').close()\n")
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "campaign.toml"
    file.write_text('trial = "own_trial:TRIAL"\ndraws = 2\n')
    assert cli.main(["campaign", str(file)]) == 1
    assert "--allow-code" in capsys.readouterr().err
    assert not trace.exists()
    assert cli.main(["campaign", str(file), "--allow-code"]) == 1  # it has no TRIAL
    assert trace.exists()
