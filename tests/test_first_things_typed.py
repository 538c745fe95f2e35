"""What a newcomer types and prints first: it works, or the refusal says exactly what to write."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from executed import blocks

import identification
import symheli
import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError

ROOT = Path(__file__).resolve().parents[1]
CLIMB = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=1.0)
T = 0.02 * np.arange(5)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda heli: symheli.trim(5.0, heli), "trim(heli, airspeed=5.0)"),
        (lambda heli: symheli.sweep([0.0, 5.0], heli), "sweep(heli, [0.0, 5.0, 10.0])"),
        (lambda heli: symheli.fly(CLIMB, heli), "fly(heli, schedule)"),
        (lambda heli: symheli.linearize(5.0, heli), "linearize(heli, trim(heli, airspeed=5.0))"),
        (lambda heli: symheli.linearize(heli), "linearize(heli, airspeed=5.0)"),
        (lambda heli: symheli.linearize(heli, "5"), "linearize(heli, trim(heli, airspeed=5.0))"),
        (lambda heli: symheli.fly(heli, CLIMB, delay=20), "20 ms are delay=0.02"),
        (lambda heli: symheli.Wind(5.0), "(-5.0, 0.0, 0.0) for 5 m/s from the north"),
        (
            lambda heli: symheli.FlightRecord.from_arrays(T, {"q": np.zeros(4)}),
            "from_arrays(t, {'q': '...'}, q=q)",
        ),
        (lambda heli: symheli.FlightRecord.from_arrays(T, {"q": "rad/s"}), "q=q"),
        (lambda heli: symheli.sweep(heli, [2.0, 5.0])["M_u"], "symheli.derivatives(family)['M_u']"),
    ],
)
def test_a_refusal_shows_what_to_write(ideal, call, says):
    with pytest.raises(InputError) as found:
        call(ideal)
    assert says in str(found.value)


def test_linearize_takes_an_airspeed(ideal):
    model = symheli.linearize(ideal, symheli.trim(ideal, airspeed=5.0))
    for other in (symheli.linearize(ideal, 5.0), symheli.linearize(ideal, airspeed=5)):
        np.testing.assert_array_equal(other.A, model.A)
    assert symheli.linearize(ideal, 5.0, inputs=["d_lon"]).B.shape == (10, 1)


def test_an_entry_of_a_family_has_its_name(ideal):
    family = symheli.sweep(ideal, [2.0, 5.0])
    np.testing.assert_array_equal(family["A[q, u]"], family.A[:, 4, 0])
    assert family[1].point.airspeed == 5.0
    with pytest.raises(UnknownNameError, match=r"A\[q, u\]"):
        family["A[q, uu]"]


def test_vectors_with_names_count_as_arrays(ideal):
    u = symheli.trim(ideal, airspeed=5.0).u
    for found, expected in (
        (2 * u, 2 * u.array),
        (u * 2, 2 * u.array),
        (u + u, 2 * u.array),
        (u - 0.5 * u, 0.5 * u.array),
        (1.0 - u, 1.0 - u.array),
        (-u / 2, -0.5 * u.array),
        (np.ones(4) + u, 1.0 + u.array),
    ):
        assert type(found) is np.ndarray
        np.testing.assert_array_equal(found, expected)


def test_derivatives_of_states_have_units_of_rates(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    for vector in (point.xdot, point.residual):
        assert [s.unit for s in vector.signals[:8:3]] == ["m/s^2", "rad/s^2", "rad/s"]
    assert point.xdot["theta"] == pytest.approx(0.0, abs=1e-9)


def test_prints_show_what_was_asked_for(ideal):
    point = symheli.trim(ideal, airspeed=5.0)
    lines = str(point).splitlines()
    assert lines[0] == point.outcome
    assert "  theta    -0.0211491    rad   -1.212 deg" in lines
    assert repr(ideal) == "Helicopter('xcell60', governor='ideal'): MIT X-Cell .60 SE"
    model = symheli.linearize(ideal, point).select(["q", "a1"], ["d_lon"], ["q"])
    assert str(model).splitlines() == [
        "linear model, continuous, about 5 m/s: 2 states, 1 inputs, 1 outputs; SI and radians",
        "A (rows: derivative of the state)",
        "            q      a1",
        "q   -0.040796  215.65",
        "a1         -1   -8.35",
        "B",
        "    d_lon",
        "q       0",
        "a1  35.07",
        "C (rows: outputs)",
        "   q  a1",
        "q  1   0",
    ]
    assert "sampled every 0.02 s" in str(model.discretize(0.02))
    assert identification.__version__ == symheli.__version__


@pytest.mark.slow
def test_a_certificate_is_three_lines_and_a_sampled_controller_says_so():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    cert = synthesis.l2_gain(lag, search=None)
    claim, numbers, form = str(cert).splitlines()
    assert claim.startswith("l2 gain, ")
    assert f"gain <= {cert.gamma:.6g}" in numbers
    assert "hypotheses" in form
    for sentence in (*cert.hypotheses, cert.solver, *map(str, cert.attempts)):
        assert sentence in cert.details
    names = dict(disturbances=["w"], performance=["z", "u"], controls=["u"], measurements=["y"])
    model = LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]],
        [[[1.0, 1.0]]],
        [[[1.0], [1.0]]],
        [[[0.0, 0.0], [0.0, 0.0]]],
        p,
        states=["x"],
        inputs=["w", "u"],
        outputs=["z", "y"],
    )
    plant = synthesis.Plant(model, **names).with_noise({"y": 0.1})
    made = synthesis.output_feedback(plant)
    first, second = str(made).splitlines()[:2]
    assert "continuous, y -> u over p" in first
    assert f"promised gain {made.promised:.6g}" in second
    assert "sampled every 0.05 s" in str(made.discretize(0.05))


@pytest.mark.slow
def test_a_type_checker_accepts_the_first_pages(tmp_path):
    """Names as lists and matrices as nested lists, as an editor shows them while one types."""
    for name in ("README.md", "docs/plant.md", "docs/structured.md", "docs/lft.md"):
        code = [b.code for b in blocks((ROOT / name).read_text()) if b.kind == "python"]
        (tmp_path / f"{Path(name).stem}.py").write_text("\n".join(code))
    settings = {"extraPaths": [str(ROOT)], "typeCheckingMode": "basic"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    checked = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "-p", str(tmp_path)],
        capture_output=True,
        text=True,
    )
    assert " 0 errors" in f" {checked.stdout}", checked.stdout
