"""A vehicle file that is wrong says in which line, which entry, and what was expected."""

from __future__ import annotations

import math
import re

import pytest
from airframes import XCELL, write

import symheli
from symheli.airframe.vehicle import load_vehicle
from symheli.values.units import dimension, quotient, text, to_si

MASS = 'mass = { value = 8.2, unit = "kg", source = "G15 Table 15.1" }'
RADIUS = 'radius = { value = 0.775, unit = "m", source = "G15 Table 15.1" }'
BLADES = 'blades = { value = 2, unit = "1", source = "G15 text, solidity 2 c/(pi R)" }'


def line_of(entry):
    return 1 + XCELL.splitlines().index(entry)


@pytest.mark.parametrize(
    ("entry", "instead", "message"),
    [
        (
            MASS,
            'mass = { value = 8.2, unit = "kilo", source = "x" }',
            "unknown unit 'kilo'; expected kg",
        ),
        (
            MASS,
            'mass = { value = 18, unit = "lbb", source = "x" }',
            "did you mean 'lb', 18 lb = 8.16466 kg?",
        ),
        (
            MASS,
            'mass = { value = 8.2, unit = "m", source = "x" }',
            "expected kg (or gram, lb, oz, slug), got 8.2 m, which is another kind",
        ),
        (MASS, "mass = 8.2", "a bare number has no unit: write { value = 8.2, unit = 'kg'"),
        (MASS, 'mass = { value = 8.2, source = "x" }', "the unit is missing: expected unit = 'kg'"),
        (
            MASS,
            'mass = { value = nan, unit = "kg", source = "x" }',
            "expected a finite number as value, got nan",
        ),
        (
            MASS,
            'mass = { value = "8", unit = "kg", source = "x" }',
            "expected a finite number as value, got '8'",
        ),
        (MASS, 'mass = { value = 8.2, unit = "kg" }', "every number needs a source"),
        (
            MASS,
            'mass = { value = 8.2, unit = "kg", source = "x", asumed = true }',
            "unknown key 'asumed'; did you mean 'assumed'",
        ),
        (
            MASS,
            'mass = { value = 8.2, unit = "kg", source = "x", assumed = 1 }',
            "assumed must be true or false",
        ),
        (
            MASS,
            'mass = { value = -8.2, unit = "kg", source = "x" }',
            "body.mass: must be > 0 kg, got -8.2",
        ),
        (
            RADIUS,
            'radius = { value = 0.0, unit = "m", source = "x" }',
            "main_rotor.radius: must be > 0 m, got 0",
        ),
        (
            RADIUS,
            'radius = { value = 0.775, unit = "rad", source = "x" }',
            "expected m (or cm, mm, km, ft, in), got 0.775 rad",
        ),
        (RADIUS, 'radius = { ref = "body.radius" }', "must name an entry with a value"),
        (
            RADIUS,
            'radius = { ref = "body.mass" }',
            "expected m, got the kg of body.mass, which is another kind of quantity",
        ),
        *(
            (
                BLADES,
                BLADES.replace("value = 2", f"value = {n}"),
                f"main_rotor.blades: must be a whole number >= 2, got {n}",
            )
            for n in (1, 0, -2, 2.5)
        ),
        (
            'Izz = { value = 0.28, unit = "kg m^2", source = "G15 Table 15.1" }',
            'Izz = { value = 0.9, unit = "kg m^2", source = "x" }',
            "body.Izz: no body has Izz = 0.9 > Ixx + Iyy = 0.52 kg m^2",
        ),
        (
            'd_lon = { value = 0.096, unit = "rad", source = "G15 text, servo travel, symmetric" }',
            'd_lon = { value = 5.5, unit = "degs", source = "x" }',
            (
                "unknown unit 'degs'; expected rad (or deg, mrad, rev); did you mean 'deg', 5.5 deg ="
                " 0.0959931 rad?"
            ),
        ),
        (
            'area_x = { value = 0.1, unit = "m^2", source = "G15 Table 15.1" }',
            'area_x = { value = -0.1, unit = "m^2", source = "x" }',
            "fuselage.area_x: an area must be >= 0 m^2",
        ),
    ],
)
def test_a_wrong_entry_is_named_with_its_line_and_what_was_expected(
    tmp_path, entry, instead, message
):
    path = write(tmp_path, replace={entry: instead})
    with pytest.raises(symheli.InputError, match=re.escape(message)) as caught:
        load_vehicle(path)
    assert str(caught.value).startswith(str(path))
    assert f"line {line_of(entry)}, " in str(caught.value)


def test_a_missing_entry_is_named_with_its_section_and_the_unknown_one_beside_it(tmp_path):
    path = write(tmp_path, replace={RADIUS: RADIUS.replace("radius", "radios")})
    with pytest.raises(
        symheli.InputError,
        match=(
            f"line {line_of(RADIUS)}, main_rotor.radios: unknown entry 'radios'; did you mean"
            " 'radius'"
        ),
    ):
        load_vehicle(path)
    path = write(tmp_path, replace={RADIUS: ""})
    with pytest.raises(
        symheli.InputError,
        match=rf"line {line_of('[main_rotor]')}, main_rotor.radius: missing .*; add radius = .*'m'",
    ):
        load_vehicle(path)
    path = write(tmp_path, replace={"[body]": "[boddy]"})
    with pytest.raises(
        symheli.InputError, match=r"section \[body\] is missing|unknown component 'boddy'"
    ):
        load_vehicle(path)


def test_broken_toml_says_line_and_column(tmp_path):
    path = write(tmp_path, replace={MASS: "mass = {"})
    with pytest.raises(
        symheli.InputError, match=rf"line {line_of(MASS)}, not valid TOML: .*column \d+.*ends in }}"
    ):
        load_vehicle(path)


def test_lines_are_found_in_every_way_toml_writes_an_entry(tmp_path):
    """A header with a comment, a dotted key, a table of its own."""
    for instead in ("[ body ]  # of the airframe", '[fuselage.more]\nx = 1\n["body"]'):
        path = write(tmp_path, replace={"[body]": instead, MASS: MASS.replace("8.2", "-1")})
        with pytest.raises(
            symheli.InputError, match=r"line \d+, (body\.mass: must be|fuselage\.more)"
        ):
            load_vehicle(path)
    own = XCELL.replace(MASS, "") + '\n[body.mass]\nvalue = -3.0\nunit = "kg"\nsource = "x"\n'
    path = tmp_path / "own.toml"
    path.write_text(own)
    with pytest.raises(
        symheli.InputError, match=rf"line {1 + own.splitlines().index('[body.mass]')}, body\.mass"
    ):
        load_vehicle(path)


def test_values_in_other_units_arrive_in_si(tmp_path):
    """Single units, and products of known ones such as lb ft^2."""
    values = load_vehicle(
        write(
            tmp_path,
            replace={
                MASS: MASS.replace("8.2", "19.5").replace('"kg"', '"lb"'),
                RADIUS: RADIUS.replace("0.775", "2.25").replace('"m"', '"ft"'),
                'value = 167.0, unit = "rad/s"': 'value = 1500, unit = "rpm"',
                'value = 0.34, unit = "kg m^2"': 'value = 8.0, unit = "lb ft^2"',
            },
        )
    )
    assert values.values("body")["mass"] == pytest.approx(19.5 * 0.45359237, rel=1e-15)
    assert values.values("body")["Iyy"] == pytest.approx(8 * 0.45359237 * 0.3048**2, rel=1e-15)
    assert (
        values.values("main_rotor")["radius"]
        == values.values("tail_wake")["rotor_radius"]
        == pytest.approx(0.6858)
    )
    assert values.values("main_rotor")["nominal_speed"] == pytest.approx(50 * math.pi)


@pytest.mark.parametrize(
    ("unit", "powers", "si"),
    [
        ("N m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}, "kg m^2/s^2/rad"),
        ("W", {"kg": 1, "m": 2, "s": -3}, "kg m^2/s^3"),
        ("1/(ft s)", {"m": -1, "s": -1}, "1/s/m"),
        ("ft/s^2/rad", {"m": 1, "s": -2, "rad": -1}, "m/s^2/rad"),
        ("%", {}, "1"),
    ],
)
def test_units_are_products_of_known_ones(unit, powers, si):
    assert dimension(unit) == powers
    assert dimension(si) == powers
    assert dimension(text(powers)) == powers


def test_quotients_of_units_and_ambiguous_products():
    assert quotient("m/s^2", "rad") == "m/s^2/rad"
    assert quotient("rad/s^2", "rad") == "1/s^2"
    assert quotient("m/s^2", "m/s") == "1/s"
    assert to_si("ft/s^2/rad")[0] == pytest.approx(0.3048)
    with pytest.raises(symheli.InputError, match="brackets"):
        to_si("m/s rad")
    for wrong in ("foo/s", "m^", "m^x", "", "m//s"):
        with pytest.raises(symheli.InputError, match="unit"):
            to_si(wrong)
