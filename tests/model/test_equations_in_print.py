"""The printed equations are those of the code, complete, and can be set."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import sympy
from airframes import AFT_ROTOR, WING, WING_COMPONENT, write

import symheli
from symheli.airframe.printed_forms import PRINTED
from symheli.equations.listing import listing
from symheli.equations.notation import dot, printed, real, symbol_of, upright

MODELS = ({}, {"governor": "ideal"}, {"smoothing": 0.1}, {"printed": sorted(PRINTED)})


def model(options):
    return symheli.Helicopter.load("xcell60", **options)


@pytest.mark.slow
def test_every_equation_and_symbol_can_be_set_and_fits_a_page():
    from matplotlib.mathtext import MathTextParser

    sections = [section for options in MODELS for section in listing(model(options))]
    every = {
        e
        for section in sections
        for e in (*section.equations, *(p.symbol for p in section.parameters))
    }
    parser = MathTextParser("path")
    for equation in every:
        width = parser.parse(f"${equation}$", dpi=72)[0]
        assert width < 482, equation  # points; the text of an A4 page with 20 mm margins


def test_every_component_every_parameter_and_every_state_derivative_is_there(heli):
    sections = {section.title: section for section in listing(heli)}
    for name, part in heli.vehicle.components.items():
        section = sections[name.replace("_", " ").capitalize()]
        assert {p.entry for p in section.parameters} == {
            f"{name}.{entry}" for entry in heli.vehicle.sections[name]
        }
        assert all(p.unit and p.source for p in section.parameters)
        for state in part.states:
            assert any(e.startswith(dot(symbol_of(str(state)))) for e in section.equations)
    every = [e for section in sections.values() for e in section.equations]
    for state in heli.states:
        assert sum(e.startswith(f"{dot(symbol_of(str(state)))} = ") for e in every) == 1


def test_every_parameter_a_component_uses_occurs_in_its_equations(pi):
    for section in listing(pi):
        text = " ".join(section.equations)
        for p in section.parameters:
            unused = {"tail_rotor.trim_pitch"}  # of the linear tail rotor only
            assert p.symbol in text or p.entry in unused, p.entry


@pytest.mark.slow
def test_printed_forms_change_what_is_printed():
    """Each option that changes an equation changes its line; the relaxed iteration has the same
    root and the same line.
    """
    plain = model({}).latex()
    for option in PRINTED:
        changed = model({"printed": [option]}).latex()
        assert (changed == plain) == (option == "relaxed_inflow"), option


def test_document_is_balanced_and_every_section_has_equations(heli):
    whole = heli.latex(standalone=True)
    assert heli.latex() in whole
    assert whole.startswith(r"\documentclass")
    assert whole.rstrip().endswith(r"\end{document}")
    for opening, closing in ((r"\[", r"\]"), (r"\begin{", r"\end{"), (r"\left", r"\right")):
        assert whole.count(opening) == whole.count(closing)
    without_escapes = re.sub(r"\\[{}]", "", whole)
    assert without_escapes.count("{") == without_escapes.count("}")
    text = re.sub(r"\\\[.*?\\\]|\$.*?\$", "", whole)
    assert not re.search(
        r"(?<!\\)[_#%^]", text.split(r"\maketitle")[1]
    )  # outside mathematics these need a backslash


def test_printed_numbers_are_the_fractions_the_code_means():
    x = real("x")
    assert printed(x / 3.0) == printed(x / 3)
    assert printed(0.75 * x / np.pi) == printed(sympy.Rational(3, 4) * x / sympy.pi)
    assert printed(x + 1e-20) == "x + 10^{-20}"
    assert printed(9.81 * x) == "9.81 x"
    assert upright("C_{T max,mr}") == r"C_{T \mathrm{max},\mathrm{mr}}"
    assert upright(r"C_{L\alpha,ht}") == r"C_{L\alpha,\mathrm{ht}}"
    assert [symbol_of(name) for name in ("d_col", "a1", "om_i", "lam0", "x_d")] == [
        r"\delta_{col}",
        "a_{1}",
        r"\omega_{i}",
        r"\lambda_{0}",
        "x_{d}",
    ]


def test_the_documentation_is_what_the_command_writes(tmp_path):
    from studies.cli import main

    assert (
        main(["export", "markdown", "--governor", "pi", "--out", str(tmp_path / "equations.md")])
        == 0
    )
    committed = Path(__file__).resolve().parents[2] / "docs" / "equations.md"
    fresh = (tmp_path / "equations.md").read_text(encoding="utf-8")
    assert fresh == committed.read_text(encoding="utf-8"), (
        "run: symheli export markdown --governor pi --out docs/equations.md"
    )


def test_latex_is_written_by_the_command(tmp_path):
    from studies.cli import main

    target = tmp_path / "model.tex"
    assert main(["export", "latex", "--printed", "fuselage_downwash", "--out", str(target)]) == 0
    assert "fuselage\\_downwash" in target.read_text(encoding="utf-8")
    assert main(["export", "latex", "--printed", "fuselage_downwsh", "--out", str(target)]) == 1


def test_a_second_rotor_and_a_part_of_ones_own_are_printed_under_their_names(tmp_path):
    (tmp_path / "wing.py").write_text(WING_COMPONENT)
    heli = symheli.Helicopter.load(write(tmp_path, WING, AFT_ROTOR), allow_code=True)
    sections = {section.title: section for section in listing(heli)}
    assert (
        r"Z_{\mathrm{wing}} = - \frac{\mathrm{area} \mathrm{lift\_slope} \rho u_{a} w_{a}}{2}"
        in sections["Wing"].equations
    )
    assert sections["Wing"].text == "wing.py: lift along z, in linear attached flow."
    assert any(
        e.startswith(r"\dot{a}_{1,\mathrm{aft},\mathrm{rotor}} = ")
        for e in sections["Aft rotor"].equations
    )
    total = next(e for e in sections["Rigid body"].equations if e.startswith("Z = "))
    assert r"Z_{\mathrm{mr},\mathrm{aft},\mathrm{rotor}}" in total
    assert r"Z_{\mathrm{wing}}" in total
