"""A vehicle file that is wrong says in which line, which entry, and what was expected."""

from __future__ import annotations

import math
import re

import pytest
from airframes import AFT_ROTOR, DOCS, FORWARD, XCELL, write

import symheli
from studies import cli
from symheli.airframe.plausibility import RANGES, implausibilities
from symheli.airframe.vehicle import load_vehicle, vehicles
from symheli.airframe.written import as_toml, reference, with_reference
from symheli.components import find, packaged
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
                "unknown unit 'degs'; expected rad (or deg, mrad, rev); did you mean"
                " 'deg', 5.5 deg = 0.0959931 rad?"
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
    with pytest.raises(symheli.errors.InputError, match=re.escape(message)) as caught:
        load_vehicle(path)
    assert str(caught.value).startswith(str(path))
    assert f"line {line_of(entry)}, " in str(caught.value)


def test_a_missing_entry_is_named_with_its_section_and_the_unknown_one_beside_it(tmp_path):
    path = write(tmp_path, replace={RADIUS: RADIUS.replace("radius", "radios")})
    with pytest.raises(
        symheli.errors.InputError,
        match=(
            f"line {line_of(RADIUS)}, main_rotor.radios: unknown entry 'radios'; did you mean"
            " 'radius'"
        ),
    ):
        load_vehicle(path)
    path = write(tmp_path, replace={RADIUS: ""})
    with pytest.raises(
        symheli.errors.InputError,
        match=rf"line {line_of('[main_rotor]')}, main_rotor.radius: missing .*; add radius = .*'m'",
    ):
        load_vehicle(path)
    path = write(tmp_path, replace={"[body]": "[boddy]"})
    with pytest.raises(
        symheli.errors.InputError, match=r"section \[body\] is missing|unknown component 'boddy'"
    ):
        load_vehicle(path)


def test_broken_toml_says_line_and_column(tmp_path):
    path = write(tmp_path, replace={MASS: "mass = {"})
    with pytest.raises(
        symheli.errors.InputError,
        match=rf"line {line_of(MASS)}, not valid TOML: .*column \d+.*ends in }}",
    ):
        load_vehicle(path)


def test_lines_are_found_in_every_way_toml_writes_an_entry(tmp_path):
    """A header with a comment, a dotted key, a table of its own."""
    for instead in ("[ body ]  # of the airframe", '[fuselage.more]\nx = 1\n["body"]'):
        path = write(tmp_path, replace={"[body]": instead, MASS: MASS.replace("8.2", "-1")})
        with pytest.raises(
            symheli.errors.InputError, match=r"line \d+, (body\.mass: must be|fuselage\.more)"
        ):
            load_vehicle(path)
    own = XCELL.replace(MASS, "") + '\n[body.mass]\nvalue = -3.0\nunit = "kg"\nsource = "x"\n'
    path = tmp_path / "own.toml"
    path.write_text(own)
    with pytest.raises(
        symheli.errors.InputError,
        match=rf"line {1 + own.splitlines().index('[body.mass]')}, body\.mass",
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
    with pytest.raises(symheli.errors.InputError, match="brackets"):
        to_si("m/s rad")
    for wrong in ("foo/s", "m^", "m^x", "", "m//s"):
        with pytest.raises(symheli.errors.InputError, match="unit"):
            to_si(wrong)


TEN_MISTAKES = {
    MASS: 'mass = { value = 8200, unit = "kg", source = "scales" }',  # grams
    'Ixx = { value = 0.18, unit = "kg m^2", source = "G15 Table 15.1" }': "Ixx = 0.18",
    "nominal_speed = { value = 167.0, unit": "nominal_speed = { value = 1600, unit",
    'd_col = { value = 0.183, unit = "rad"': 'd_col = { value = 12, unit = "rad"',
    RADIUS: RADIUS.replace("radius", "radios"),
    "[fuselage]": "[fuselag]",
    'area_y = { value = 0.22, unit = "m^2"': 'area_y = { value = 0,22, unit = "m^2"',
    'hub_height = { value = 0.235, unit = "m", source = "G15 Table 15.1" }\n': "",
    'max_power = { value = 2000.0, unit = "W"': 'max_power = { value = 2000.0, unit = "N"',
    'gear_ratio = { value = 4.66, unit = "1", source = "G15 Table 15.1" }': (
        'gear_ratio = { value = 4.66, unit = "1" }'
    ),
}


def test_one_message_lists_ten_different_mistakes_and_the_corrected_file_loads(tmp_path):
    """A vehicle file written from the documentation once took a new user 47 runs."""
    path = write(tmp_path, replace=TEN_MISTAKES)
    with pytest.raises(symheli.errors.InputError) as caught:
        load_vehicle(path)
    first, *said = str(caught.value).splitlines()
    assert first == f"{path}: 10 things to put right"
    expected = [
        "body.mass: 8200 kg is disc loading m g/(pi R^2) = 4.263e+04 N/m^2, plausible is 2 to"
        " 3000 N/m^2; did you mean 8200 gram, 8.2 kg",
        "body.Ixx: a bare number has no unit: write { value = 0.18, unit = 'kg m^2'",
        "drivetrain.nominal_speed: 1600 rad/s is tip speed Om R = 1240 m/s, plausible is 10 to 400"
        " m/s; did you mean 1600 rpm, 167.6 rad/s",
        "drivetrain.max_power: expected W (or kW, hp, PS), got 2000.0 N, which is another kind",
        "controls.d_col: 12 rad is 687.5 deg, plausible is 0.005 to 1 rad; did you mean 12 deg,"
        " 0.2094 rad",
        "main_rotor.hub_height: missing (height of the hub above the centre of gravity)",
        "main_rotor.radios: unknown entry 'radios'; did you mean 'radius'",
        "[fuselag]: unknown component 'fuselag'; did you mean 'fuselage'?",
        "not valid TOML: ",
        "tail_rotor.gear_ratio: every number needs a source",
    ]
    for line, message in zip(said, expected, strict=True):
        assert message in line
    assert "write numbers with a point, as 8.2" in said[8]
    numbers = [int(re.match(r"  line (\d+), ", line)[1]) for line in said]
    assert numbers == sorted(numbers)
    text = path.read_text(encoding="utf-8")
    for right, wrong in TEN_MISTAKES.items():
        if wrong:
            text = text.replace(wrong, right)
    hub = next(line for line in XCELL.splitlines() if line.startswith("hub_height"))
    path.write_text(text.replace(RADIUS, f"{RADIUS}\n{hub}"), encoding="utf-8")
    assert load_vehicle(path).sections["body"] == load_vehicle("xcell60").sections["body"]


@pytest.mark.parametrize(
    ("entry", "value", "unit", "meant"),
    [
        ("lift_slope", 0.1, "1/rad", "did you mean 0.1 1/deg, 5.73 1/rad?"),
        ("radius", 775, "m", "did you mean 775 mm, 0.775 m"),
        ("chord", 58, "m", "did you mean 58 mm, 0.058 m"),
    ],
)
def test_a_number_in_the_wrong_unit_is_doubted_with_the_unit_that_would_do(
    tmp_path, entry, value, unit, meant
):
    old = next(line for line in XCELL.splitlines() if line.startswith(f"{entry} ="))
    new = f'{entry} = {{ value = {value}, unit = "{unit}", source = "x" }}'
    with pytest.raises(symheli.errors.InputError, match=re.escape(meant)):
        load_vehicle(write(tmp_path, replace={old: new}))
    told = write(tmp_path, replace={old: new.replace("source", "unusual = true, source")})
    if entry != "radius":  # with which everything else is compared
        assert load_vehicle(told).sections["main_rotor"][entry].unusual


@pytest.mark.parametrize("name", vehicles())
@pytest.mark.parametrize("factor", [0.3, 5.0])
def test_ranges_serve_every_size(name, factor):
    """A scaled airframe is as plausible as its original: the ranges are ratios, or angles."""
    scaled = load_vehicle(name).scaled(factor)
    assert not list(implausibilities(scaled.sections, scaled.entries))


@pytest.mark.parametrize("name", vehicles())
def test_the_template_of_an_airframe_is_the_airframe(tmp_path, name, capsys):
    """`symheli vehicles NAME --toml > mine.toml`, loaded, has every part and number unchanged, and
    says above each entry what it means.
    """
    assert cli.main(["vehicles", name, "--toml"]) == 0
    text = capsys.readouterr().out
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    one, other = load_vehicle(name), load_vehicle(path)
    assert (one.sections, one.components) == (other.sections, other.components)
    assert (one.title, one.source) == (other.title, other.source)
    lines = text.splitlines()
    for section, entries in one.entries.items():
        for entry, asked in entries.items():
            at = next(
                i
                for i in range(lines.index(f"[{section}]"), len(lines))
                if lines[i].startswith(f"{entry} =")
            )
            assert lines[at - 1].startswith(f"# {asked.meaning}")


def test_a_template_keeps_the_wiring_of_its_parts(tmp_path):
    one = load_vehicle(write(tmp_path, AFT_ROTOR, replace={"[main_rotor]": FORWARD}))
    (tmp_path / "again.toml").write_text(as_toml(one), encoding="utf-8")
    other = load_vehicle(tmp_path / "again.toml")
    assert other.components == one.components
    assert other.values("aft_rotor") == one.values("aft_rotor")


def test_the_page_has_the_reference_of_the_code():
    """To renew it: symheli vehicles --reference --write docs/vehicles.md."""
    assert reference() in DOCS
    assert with_reference(DOCS) == DOCS


def test_the_reference_is_written_in_its_place_or_at_the_end(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("# Parts\n\n## Every part and entry\n\nold\n\n## More\n\nnew\n", "utf-8")
    for _ in range(2):
        assert cli.main(["vehicles", "--reference", "--write", str(page)]) == 0
        assert page.read_text("utf-8") == f"# Parts\n\n{reference()}\n## More\n\nnew\n"
    page.write_text("# Parts\n\n", "utf-8")
    assert cli.main(["vehicles", "--reference", "--write", str(page)]) == 0
    assert page.read_text("utf-8") == f"# Parts\n\n{reference()}"
    assert cli.main(["vehicles", "--write", str(page)]) == 1
    assert "--write: no effect without --reference" in capsys.readouterr().err


def test_every_packaged_entry_says_what_it_means_and_has_a_known_range():
    for kind in packaged():
        for name, entry in find(kind).entries.items():
            assert entry.meaning, f"{kind}.{name}"
            assert entry.kind in RANGES, f"{kind}.{name}"


@pytest.mark.parametrize(
    "encoded",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.encode("utf-16"),
    ],
    ids=["mark", "crlf", "utf-16"],
)
def test_files_of_other_editors_are_read(tmp_path, encoded):
    path = tmp_path / "mine.toml"
    path.write_bytes(encoded(XCELL))
    assert load_vehicle(path).sections == load_vehicle("xcell60").sections


def test_a_file_in_another_encoding_says_in_which_line(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(XCELL.replace("G15 text", "Müller", 1).encode("latin-1"))
    with pytest.raises(symheli.errors.InputError, match=r"line \d+: not a text file in UTF-8"):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("written", "expected", "si"),
    [
        *((u, "", to_si("N m")) for u in ("N*m", "N·m", "N-m", "Nm")),
        *((u, "", to_si("kg m^2")) for u in ("kg*m**2", "kg·m²", "kg m2", "Kg m^2")),
        *((u, "N m", to_si("ft lbf")) for u in ("ft lb", "lb ft", "ft-lb", "lbf*ft")),
        ("lb", "kg", (0.45359237, "kg")),
        ("lb", "N", (4.4482216152605, "N")),
        ("g", "kg", (1e-3, "kg")),
        ("g", "m/s^2", (9.80665, "m/s^2")),
        ("kn", "", to_si("kt")),
        ("RPM", "", to_si("rpm")),
        ("rev/min", "", to_si("rpm")),
        ("m s^-1", "", (1.0, "m/s")),
        ("slug-ft²", "", to_si("slug ft^2")),
    ],
)
def test_units_are_read_as_people_write_them(written, expected, si):
    factor, unit = to_si(written, expected)
    assert factor == pytest.approx(si[0], rel=1e-12)
    assert dimension(unit) == dimension(si[1])
