"""A word where the model is asked for more than its equations are known to hold for, and none
where it is not.
"""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest
from scipy.optimize import brentq

import symheli
from studies.cli import main
from symheli.errors import DataWarning, TrimError, ValidityWarning
from symheli.steady.validity import ADVANCE_RATIO, MACH, REYNOLDS, Validity

TIP_SPEED = 167.0 * 0.775  # of the X-Cell, m/s
FASTEST = ADVANCE_RATIO * TIP_SPEED
SWIFT = 24.0


def said(work):
    """The `ValidityWarning`s of a call, in its order."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        work()
    return [str(w.message) for w in found if w.category is ValidityWarning]


@pytest.fixture(scope="module")
def fast(ideal):
    """A trim beyond the advance ratio."""
    with pytest.warns(ValidityWarning):
        return symheli.trim(ideal, SWIFT)


def held(point, n):
    return np.tile(point.u.array, (n, 1))


def test_the_limit_of_the_source_is_about_20_metres_a_second():
    """G15 gives both numbers; at its tip speed the one is the other, rounded."""
    assert round(20.0 / TIP_SPEED, 2) == 0.15
    assert pytest.approx(FASTEST, abs=0.1) == 20.0


def test_the_critical_mach_number_is_that_of_an_unlifting_naca_0012():
    """Where the pressure at the largest velocity, 1.188 of the stream, by von Karman and Tsien is
    that of the speed of sound.
    """
    still = 1 - 1.188**2

    def corrected(mach):
        beta = math.sqrt(1 - mach**2)
        return still / (beta + mach**2 / (1 + beta) * still / 2)

    def sonic(mach):
        return 2 / (1.4 * mach**2) * (((1 + 0.2 * mach**2) / 1.2) ** 3.5 - 1)

    found = brentq(lambda mach: corrected(mach) - sonic(mach), 0.5, 0.95)
    assert pytest.approx(MACH, abs=0.005) == found


def test_nothing_is_said_within_the_limits(ideal):
    def work():
        level = symheli.trim(ideal, 20.0)
        symheli.linearize(ideal, level)
        symheli.trim(ideal, 5.0, climb_rate=-1.5)  # slower than half the inflow in hover, 4.4 m/s
        symheli.sweep(ideal, np.linspace(0.0, 20.0, 6))
        symheli.trim_map(ideal, [5.0, 20.0], [-3.0, 3.0])
        symheli.steady.sweep_grid(ideal, [5.0, 18.0], altitude=[0.0, 2000.0])
        symheli.trim(ideal.scaled(0.45), 2.0)  # Reynolds number 1.2e5
        symheli.trim(ideal.scaled(3.0), 2.0)  # 224 m/s at the tip, Mach 0.66
        start = symheli.trim(ideal, 18.0)
        symheli.simulate(ideal, start, held(start, 25), dt=0.02)
        symheli.integrate.simulate_batch(
            ideal, start.x.array[None], held(start, 25), dt=0.02, keep=5
        )

    assert not said(work)


CALLS = {
    "trim": lambda heli, fast: symheli.trim(heli, SWIFT),
    "trim_batch": lambda heli, fast: symheli.steady.trim_batch(heli, [10.0, 22.0, SWIFT]),
    "linearize": lambda heli, fast: symheli.linearize(heli, fast),
    "sweep": lambda heli, fast: symheli.sweep(heli, [10.0, 22.0, SWIFT]),
    "sweep_grid": lambda heli, fast: symheli.steady.sweep_grid(
        heli, [10.0, SWIFT], mass=[8.0, 9.0]
    ),
    "trim_map": lambda heli, fast: symheli.trim_map(heli, [10.0, SWIFT], [0.0, 3.0]),
    "simulate": lambda heli, fast: symheli.simulate(heli, fast, held(fast, 10), dt=0.02),
    "simulate_batch": lambda heli, fast: symheli.integrate.simulate_batch(
        heli, np.tile(fast.x.array, (3, 1)), held(fast, 10), dt=0.02
    ),
}


@pytest.mark.parametrize("call", CALLS)
def test_too_fast_is_said_once_with_its_numbers(ideal, fast, call):
    (text,) = said(lambda: CALLS[call](ideal, fast))
    found = re.search(r"an advance ratio of (\S+) .*at (\S+) m/s", text)
    ratio, speed = map(float, found.groups())
    assert speed == pytest.approx(SWIFT, abs=0.2)
    body = np.hypot(*(fast.x[name] for name in "uv"))
    assert ratio == pytest.approx(body / TIP_SPEED, abs=0.01)
    assert "0.15 (Gavrilets 2015)" in text
    assert "about 20 m/s" in text


def test_the_word_names_the_line_that_called(ideal):
    with pytest.warns(ValidityWarning) as found:
        symheli.sweep(ideal, [10.0, SWIFT])
    assert found[0].filename == __file__


SWIFTLY = symheli.AirspeedSchedule.transition(20.0, 22.0, acceleration=2.0, hold=0.5)


@pytest.mark.parametrize("many", [False, True], ids=["fly", "fly_batch"])
def test_a_flight_says_how_fast_it_was(ideal, many):
    flown = []

    def work():
        given = {"seeds": range(3), "noise_db": 30.0} if many else {}
        flown.append((symheli.flight.fly_batch if many else symheli.fly)(ideal, SWIFTLY, **given))

    (text,) = said(work)
    speed = float(re.search(r"at (\S+) m/s, flown", text)[1])
    fastest = flown[0].column("airspeed").max() if many else flown[0]["airspeed"].max()
    assert speed == pytest.approx(fastest, abs=0.01)
    assert ("3 of 3" in text) == many


def test_a_campaign_says_what_it_is_commanded_and_not_again_in_its_flights(ideal, tmp_path):
    (text,) = said(
        lambda: symheli.flight.fly_campaign(ideal, SWIFTLY, tmp_path / "a.zarr", seeds=[1, 2])
    )
    assert "at 22 m/s, commanded in flight 0 (2 of 2)" in text


def test_gusts_count_in_simulations(ideal):
    start = symheli.trim(ideal, 18.0)
    head = np.array([-3.0, 0.0, 0.0])  # wind from the north on the nose
    (text,) = said(lambda: symheli.simulate(ideal, start, held(start, 3), head, dt=0.02))
    speed = float(re.search(r"at (\S+) m/s after 0 s", text)[1])
    assert speed == pytest.approx(21.0, abs=0.05)  # the wake of the trim is not exactly level
    assert not said(lambda: symheli.simulate(ideal, start, held(start, 3), -head, dt=0.02))


def test_the_vortex_ring_is_said(ideal):
    (text,) = said(lambda: symheli.trim(ideal, 3.0, climb_rate=-3.0))
    assert "a rotor in a vortex ring at 3 m/s, descending at 3 m/s" in text
    (text,) = said(lambda: symheli.steady.trim_batch(ideal, [3.0, 9.0], climb_rate=[-3.0, -1.0]))
    assert "(1 of 2)" in text
    flagged = symheli.trim_map(ideal, [3.0], [-3.0])
    assert flagged.vortex_ring.all()


def test_a_flight_that_sinks_into_its_wake_is_said(ideal):
    """At the moment when the sink rate passes half the inflow of hover, 2.2 m/s."""
    start = symheli.trim(ideal, 0.0)
    u = held(start, 100)
    u[:, 2] -= 0.02
    flown = []
    (text,) = said(lambda: flown.append(symheli.simulate(ideal, start, u, dt=0.02)))
    k = round(float(re.search(r"vortex ring after (\S+) s", text)[1]) / 0.02)
    inflow = math.sqrt(8.2 * 9.81 / (2 * 0.9 * 1.225 * math.pi * 0.775**2))
    assert flown[0]["w"][k - 1] <= 0.5 * inflow < flown[0]["w"][k]


def test_flights_are_judged_by_their_own_parameters(ideal):
    start = symheli.trim(ideal, 19.0)
    radii = np.array([0.775, 0.7, 0.8])
    (text,) = said(
        lambda: symheli.integrate.simulate_batch(
            ideal,
            start.x.array,
            held(start, 2),
            dt=0.02,
            keep=1,
            parameters={"main_rotor.radius": radii},
        )
    )
    assert "of flight 1 (1 of 3)" in text
    assert "about 18 m/s" in text  # 0.155 of 167 x 0.7


@pytest.mark.parametrize(
    ("factor", "words", "number"),
    [
        (0.3, "a Reynolds number of", 0.75 * 1.225 * TIP_SPEED * 0.058 / 1.79e-5 * 0.3**1.5),
        (4.0, "a Mach number of", TIP_SPEED * 2.0 / 340.3),
    ],
)
def test_a_copy_of_another_size_is_doubted(ideal, factor, words, number):
    (text,) = said(lambda: symheli.trim(ideal.scaled(factor), 0.0))
    assert words in text
    found = float(re.search(rf"{words} (\S+)", text)[1])
    assert found == pytest.approx(number, rel=0.02)  # printed with two digits
    assert (number < REYNOLDS) if "Reynolds" in words else (number > MACH)


def test_air_that_nobody_flies_in_is_doubted(ideal):
    (text,) = said(lambda: symheli.trim(ideal.in_air(2.0), 0.0))
    assert "air of 2 kg/m^3" in text
    assert not said(lambda: symheli.trim(ideal.at_altitude(4000.0), 0.0))


def test_a_trim_that_fails_says_that_nobody_promised_it(ideal):
    with pytest.raises(TrimError, match=r"beyond validity, an advance ratio of 0\.4"):
        symheli.trim(ideal, 60.0)


def test_a_vehicle_without_a_main_rotor_is_not_judged_by_one(ideal):
    judge = Validity(ideal, ideal.parameters.array[None])
    judge.rotors = []
    assert judge.beyond(lambda _: "here", np.array([[80.0, 0.0, 0.0]])) == []
    assert not judge.in_vortex_ring(np.array([[[0.0, 0.0, 3.0]]])).any()
    assert judge.harmless == (math.inf, math.inf)


@pytest.mark.slow
@pytest.mark.filterwarnings("always::symheli.errors.ValidityWarning")
def test_the_command_line_says_it_once(capsys):
    assert main(["linearize", "--airspeed", "24"]) == 0  # a trim and a linear model
    said = capsys.readouterr().err
    assert said.count("symheli: note:") == said.count("advance ratio") == 1
    assert main(["linearize", "--airspeed", "15"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.filterwarnings("always::symheli.errors.ValidityWarning")
def test_the_command_line_says_it_of_a_vehicle_file(capsys, tmp_path, ideal):
    from symheli.airframe.written import as_toml

    path = tmp_path / "large.toml"
    path.write_text(as_toml(ideal.scaled(4.0).vehicle), encoding="utf-8")
    assert main(["vehicles", str(path)]) == 0
    assert "a Mach number of 0.761 at the advancing tip in hover" in capsys.readouterr().err


# --- numbers that no helicopter has --------------------------------------------------------------


def test_an_implausible_value_is_doubted_as_in_a_file(ideal):
    with pytest.warns(DataWarning, match=r"body\.mass: 9000 kg is disc loading") as found:
        heavy = ideal.with_parameters({"body.mass": 9000.0})
    assert "did you mean 9000 gram, 9 kg" in str(found[0].message)
    assert found[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        heavy.in_air(1.0)  # what is known is not said again
        heavy.with_parameters({"body.Ixx": 0.2})
        ideal.with_parameters({"body.mass": 9.5, "main_rotor.radius": 0.8})
    with pytest.warns(DataWarning, match="7000 kg"):
        heavy.with_parameters({"body.mass": 7000.0})


def test_a_value_that_is_meant_is_not_doubted(ideal):
    sections = {s: dict(entries) for s, entries in ideal.vehicle.sections.items()}
    sections["body"]["mass"] = sections["body"]["mass"]._replace(unusual=True)
    vehicle = type(ideal.vehicle)("own", "own", "own", sections, ideal.vehicle.components)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        vehicle.with_values({"body.mass": 9000.0})


def test_a_copy_that_no_helicopter_is_like_is_doubted(ideal):
    with pytest.warns(DataWarning, match=r"main_rotor\.radius: 46\.5 m"):
        ideal.scaled(60.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ideal.scaled(9.0)  # 388 m/s at the tip, of 400
