"""The packaged airframes: converted from their sources, scaled exactly, and a linear model from the
literature.
"""

from __future__ import annotations

import re
import tomllib
from importlib import resources

import numpy as np
import pytest

import symheli
from evidence import r50
from symheli.airframe.vehicle import load_vehicle, vehicles
from symheli.values.units import to_si

R50 = (resources.files("symheli.airframe.vehicles") / "r50_hover.linear.toml").read_text(
    encoding="utf-8"
)


@pytest.mark.slow(but="xcell_kahn_hudson-ideal")
@pytest.mark.parametrize("governor", ["ideal", "pi"])
@pytest.mark.parametrize("name", vehicles())
def test_every_packaged_airframe_trims_along_the_transition(name, governor):
    family = symheli.sweep(
        symheli.Helicopter.load(name, governor=governor), [0.0, 3.0, 6.0, 10.0, 15.0]
    )
    assert all(point.attainable for point in family.trims)


def test_kahn_hudson_values_are_the_source_values_converted():
    """Each source ends in its own value and unit; six digits are written down."""
    vehicle = load_vehicle("xcell_kahn_hudson")
    checked = 0
    for name, quantity in vehicle.quantities.items():
        stated = re.fullmatch(r"KH[^:]*: ([\d.]+) (.+)", quantity.source)
        if stated:
            factor, _ = to_si(stated[2])
            assert quantity.value == pytest.approx(factor * float(stated[1]), rel=5e-6), name
            checked += 1
    assert checked == 27
    assert set(vehicle.assumed) == {
        n for n, q in vehicle.quantities.items() if not q.source.startswith("KH")
    }
    blade, offset = 0.0847 * to_si("slug ft^2")[0], 0.0225 / 2.25  # I_b, e/R
    stiffness = (
        0.75
        * vehicle.values("main_rotor")["blades"]
        * blade
        * vehicle.values("drivetrain")["nominal_speed"] ** 2
        * offset
    )
    assert vehicle.values("vertical_fin")["lift_slope"] == pytest.approx(1.4339 / 0.275, rel=1e-5)
    assert vehicle.values("main_rotor")["hub_stiffness"] == pytest.approx(stiffness, rel=1e-5)


def test_r50_is_guessed_from_its_hover_model_and_the_scaled_x_cell():
    """One entry is published; the others follow from where their source says; six digits are
    written down.
    """
    vehicle, packaged = load_vehicle("yamaha_r50"), load_vehicle("xcell60")
    assert set(vehicle.quantities) - set(vehicle.assumed) == {"main_rotor.radius"}
    rotor, drive = vehicle.values("main_rotor"), vehicle.values("drivetrain")
    scale = rotor["radius"] / packaged.values("main_rotor")["radius"]
    copy = packaged.scaled(scale)
    scaled = [n for n, q in vehicle.quantities.items() if q.source == "scaled"]
    assert len(scaled) == 15
    found = {n: vehicle.quantities[n].value for n in scaled}
    assert found == pytest.approx({n: copy.quantities[n].value for n in scaled}, rel=5e-6)
    given = {n: q["value"] for n, q in tomllib.loads(R50)["parameters"].items()}
    tau = given["tau_f"] + (given["A_c"] + given["B_d"]) / 2 * given["tau_s"]
    beta = 1.225 * rotor["lift_slope"] * rotor["chord"] * rotor["radius"] ** 4 / 16
    beta *= given["tau_f"] * drive["nominal_speed"]
    derived = {
        "bar_lock_number": 16 / (tau * drive["nominal_speed"]),
        "lateral_gain": 1 + given["B_d"] * given["D_lat"] / given["B_lat"],
        "longitudinal_gain": 1 + given["A_c"] * given["C_lon"] / given["A_lon"],
    }
    assert {n: rotor[n] for n in derived} == pytest.approx(derived, rel=5e-6)
    assert drive["inertia"] == pytest.approx(2.5 * beta, rel=5e-6)
    hover = dict(zip(("identified", "guessed"), r50.models(), strict=True))
    for row, columns in (("p", ("b", "b1")), ("q", ("a", "a1"))):
        one, other = (
            m.A[m.states.index(row), m.states.index(c)]
            for m, c in zip(hover.values(), columns, strict=True)
        )
        assert other == pytest.approx(one, rel=2e-5)


def test_more_blades_of_less_chord_are_the_same_rotor(ideal):
    """Blades enter by the solidity b c/(pi R) alone; one blade more of the same chord is another
    rotor.
    """
    chord = ideal.vehicle.values("main_rotor")["chord"]
    for other, same in (({"blades": 4, "chord": chord / 2}, True), ({"blades": 3}, False)):
        changed = ideal.with_parameters(
            {f"main_rotor.{entry}": value for entry, value in other.items()}
        )
        one, two = (symheli.trim(heli, 8.0) for heli in (ideal, changed))
        assert (
            np.allclose(two.u.array, one.u.array, rtol=0, atol=1e-13) == same
        )  # rounding of the solidity through Newton's method


@pytest.mark.slow(only="xcell_kahn_hudson-0.3")
@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
@pytest.mark.parametrize("factor", [0.3, 5.0])
@pytest.mark.parametrize("name", vehicles())
def test_froude_scaling_is_exact_similarity(name, factor):
    """At sqrt(N) times the speed the same angles hold the scaled helicopter; its eigenvalues are
    N^-0.5 times, forces N^3.
    """
    heli = symheli.Helicopter.load(name, governor="pi")
    copy = heli.scaled(factor)
    for speed in (0.0, 4.0, 11.0):
        one, other = symheli.trim(heli, speed), symheli.trim(copy, speed * factor**0.5)
        np.testing.assert_allclose(
            other.u.array, one.u.array, atol=1e-12
        )  # rounding through Newton's method
        angles = [heli.states.index(s) for s in ("phi", "theta", "a1", "b1")]
        np.testing.assert_allclose(other.x.array[angles], one.x.array[angles], atol=1e-12)
        assert other.x["Om"] == pytest.approx(one.x["Om"] * factor**-0.5, rel=1e-14)
        poles, copies = (
            np.sort_complex(symheli.linearize(h, p).poles())
            for h, p in ((heli, one), (copy, other))
        )
        np.testing.assert_allclose(
            copies * factor**0.5, poles, atol=1e-11
        )  # entries up to 300, rounding 1e-14 of them
        thrust = [
            h.compiled("diagnostics")(x=p.x.array, u=p.u.array, wind=0)["T_mr"]
            for h, p in ((heli, one), (copy, other))
        ]
        assert float(thrust[1]) == pytest.approx(float(thrust[0]) * factor**3, rel=1e-12)


def test_scaling_follows_the_units_of_the_entries(ideal):
    copy = ideal.scaled(4.0).vehicle
    ratio = {
        name: q.value / ideal.vehicle.quantities[name].value for name, q in copy.quantities.items()
    }
    assert ratio["body.mass"] == pytest.approx(4.0**3)
    assert ratio["body.Izz"] == pytest.approx(4.0**5)
    assert ratio["main_rotor.hub_stiffness"] == pytest.approx(4.0**4)
    assert ratio["drivetrain.max_power"] == pytest.approx(4.0**3.5)
    assert ratio["drivetrain.nominal_speed"] == pytest.approx(0.5)
    assert ratio["drivetrain.governor_kp"] == pytest.approx(2.0)
    assert (
        ratio["drivetrain.governor_ki"]
        == ratio["controls.d_lon"]
        == ratio["main_rotor.lift_slope"]
        == 1.0
    )
    assert "Froude-scaled by 4" in copy.title
    assert copy.values("tail_wake")["rotor_radius"] == copy.values("main_rotor")["radius"]
    for wrong in (0.0, -1.0, np.inf):
        with pytest.raises(symheli.errors.InputError, match="factor > 0"):
            ideal.scaled(wrong)


def test_r50_in_hover_keeps_the_constraints_of_its_identification():
    """X_a = -g, Y_b = g, N_rfb = -N_ped and K_rfb = 2 N_r were held; the roll mode follows
    sqrt(L_b) where flapping is slow.
    """
    model = symheli.airframe.identified_model("r50_hover")
    par = {name: quantity.value for name, quantity in model.parameters.items()}
    assert par["X_a"] == -par["g"]
    assert par["Y_b"] == par["g"]
    assert par["N_rfb"] == -par["N_ped"]
    assert par["K_rfb"] == pytest.approx(2 * par["N_r"], rel=1e-15)
    assert {"N_v", "N_w"} <= set(model.assumed)
    assert "disputed" in model.parameters["N_v"].source
    # p' = L_b b, b' = -p - b/tau_f: s^2 + s/tau_f + L_b
    np.testing.assert_allclose(
        np.sort(model.select(["p", "b"]).poles()),
        np.sort(np.roots([1, 1 / 0.0463, 166.1])),
        rtol=1e-12,
    )
    yaw = np.sort_complex(
        model.select(["r", "r_fb"]).poles()
    )  # s^2 + 12.39 s + N_r K_rfb - N_rfb K_r
    np.testing.assert_allclose(
        yaw, np.sort_complex(np.roots([1, 12.39, 4.13 * 8.26 + 33.1 * 2.16])), rtol=1e-12
    )
    assert not model.is_stable()  # a hovering helicopter without autopilot


def test_r50_in_feet_and_in_si_have_the_same_poles(tmp_path):
    """Every length in ft or m: the same motion."""
    path = tmp_path / "r50.toml"
    path.write_text(R50)
    model = symheli.airframe.identified_model(path)
    feet = np.array([1 / 0.3048 if s.unit == "m/s" else 1.0 for s in model.states])
    A = model.A * feet[:, None] / feet
    assert A[0, 0] == pytest.approx(-0.0505)
    assert A[8, 7] == pytest.approx(-131.2)  # Z_b in ft/s^2
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(A)), np.sort_complex(model.poles()), atol=1e-9
    )
    assert [s.unit for s in model.states[:3]] == ["m/s", "m/s", "rad/s"]
    assert model.select(["r", "r_fb"], ["ped"]).title == model.title


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'L_v = { value = 0.143, unit = "rad/ft/s"',
            'L_v = { value = 0.143, unit = "rad/s"',
            "equations.p: the units do not fit: the term with v",
        ),
        ("X_u*u", "X_uu*u", "unknown name 'X_uu'; did you mean 'X_u'"),
        ("X_u*u", "X_u*u*u", "must be linear"),
        ("X_u*u", "X_u*u + 1", "must be linear"),
        ("X_u*u", "abs(u)", "expected names, numbers and"),
        ("X_u*u", "X_u*(u", "cannot be evaluated"),
        ('phi = "p"\n', "", "one equation a state"),
        (
            'X_u = { value = -0.0505, unit = "1/s"',
            'X_u = { value = -0.0505, unit = "1/sec"',
            "unknown unit '1/sec'",
        ),
        ("[inputs]", "[input]", r"section \[inputs\] is missing"),
    ],
)
def test_a_wrong_model_file_says_what_is_wrong(tmp_path, old, new, message):
    path = tmp_path / "wrong.linear.toml"
    assert old in R50
    path.write_text(R50.replace(old, new, 1))
    with pytest.raises(symheli.errors.InputError, match=message):
        symheli.airframe.identified_model(path)


MISTAKES = (
    ('u = "ft/s"', 'u = "ft/sek"', "states.u: unknown unit 'ft/sek'"),
    ('phi = "rad"', "phi = 1", "states.phi: unit: expected a text"),
    ('ped = "1"', "ped = 1,0", "not valid TOML"),
    ("Y_v*v + g*phi", "Y_v*v + G*phi", "equations.v: unknown name 'G'"),
    ("M_u*u + M_v*v", "M_u*u*M_v*v", "equations.q: must be linear"),
    ("+ A_b*b + A_c*c", "+ A_b*b + (A_c*c", "equations.a: '-q + (-a"),
    ('phi = "p"\n', 'phy = "p"\n', "equations.phy: unknown state 'phy'"),
    (
        'Y_b = { value = 32.2, unit = "ft/s^2/rad", source = "MTK, held at g" }',
        'Y_b = { value = "32.2", unit = "ft/s^2/rad" }',
        "parameters.Y_b: expected a finite number as value, got '32.2'; every number",
    ),
    (
        'L_v = { value = 0.143, unit = "rad/ft/s"',
        'L_v = { value = 0.143, unit = "rad/s"',
        "equations.p: the units do not fit: the term with v",
    ),
    (
        'M_a = { value = 82.57, unit = "1/s^2", source = "MTK" }',
        "M_a = 82.57",
        "parameters.M_a: write { value = ..., unit = ..., source = ... }, got 82.57",
    ),
)
"""What is right, what was typed, and what is said of it."""


def test_ten_mistakes_in_a_model_file_are_one_message_of_ten(tmp_path):
    text = R50
    for right, typed, _ in MISTAKES:
        assert right in text
        text = text.replace(right, typed, 1)
    path = tmp_path / "typed.linear.toml"
    path.write_text(text)
    with pytest.raises(symheli.errors.InputError) as caught:
        symheli.airframe.identified_model(path)
    head, *said = str(caught.value).split("\n  ")
    assert head == f"{path}: {len(MISTAKES)} things to put right"
    assert len(said) == len(MISTAKES)
    for *_, words in MISTAKES:
        assert sum(words in line for line in said) == 1, words
    lines = [int(re.match(r"line (\d+), ", line)[1]) for line in said]
    assert lines == sorted(lines)
    for line, words in zip(lines, said, strict=True):
        entry = re.search(r"(?:states|parameters|equations)\.(\w+):", words)
        assert text.splitlines()[line - 1].startswith(entry[1] if entry else "ped")
    for right, typed, _ in MISTAKES:
        text = text.replace(typed, right, 1)
    path.write_text(text)
    np.testing.assert_array_equal(
        symheli.airframe.identified_model(path).A, symheli.airframe.identified_model("r50_hover").A
    )


@pytest.mark.parametrize(("right", "typed", "words"), MISTAKES, ids=lambda text: text[:12])
def test_each_mistake_alone_is_said_alone(tmp_path, right, typed, words):
    path = tmp_path / "typed.linear.toml"
    path.write_text(R50.replace(right, typed, 1))
    with pytest.raises(symheli.errors.InputError) as caught:
        symheli.airframe.identified_model(path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('lat = "1"', 'u = "1"', r"inputs\.u: is the name of one of \[states\], too"),
        ('lat = "1"', '"d-lat" = "1"', "'d-lat' cannot stand in an equation"),
        ("X_u*u", "X_u*u/(1 - 1)", "cannot be evaluated: .*division by zero"),
        ("X_u*u", "1e200*1e200*u", "must be linear"),
        ("X_u*u", f"{'9' * 400}*u", "cannot be evaluated: .*too large"),
        ("X_u*u", "(" * 5000 + "u" + ")" * 5000, "cannot be evaluated"),
        ("[equations]", "[equation]", r"did you mean \[equations\] by \[equation\]"),
    ],
    ids=lambda text: text[:20],
)
def test_what_else_a_model_file_may_say(tmp_path, old, new, message):
    path = tmp_path / "typed.linear.toml"
    path.write_text(R50.replace(old, new, 1))
    with pytest.raises(symheli.errors.InputError, match=message):
        symheli.airframe.identified_model(path)


def test_the_equations_may_stand_in_any_order(tmp_path):
    first = next(line for line in R50.splitlines(True) if line.startswith('u = "X_u'))
    path = tmp_path / "turned.linear.toml"
    path.write_text(R50.replace(first, "").replace("\n[parameters]", first + "\n[parameters]"))
    model = symheli.airframe.identified_model(path)
    np.testing.assert_array_equal(model.A, symheli.airframe.identified_model("r50_hover").A)


def test_an_unknown_model_is_named():
    with pytest.raises(symheli.errors.UnknownNameError, match="r50_hover"):
        symheli.airframe.identified_model("r50")
