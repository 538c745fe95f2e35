"""Flights side by side: the same bits as alone, the same numbers as without a compiler."""

import platform

import numpy as np
import pytest
from flight.flown import EVERYTHING, SHORT, STIRRED, STORM, InPython, differences, dynamic

import symheli
from symheli import AirspeedSchedule, FlightPlan, fly
from symheli.codegen import compile as compiling
from symheli.errors import CompilerWarning, FlightLostError, InputError
from symheli.flight import XCELL_SERVOS, fly_batch, gain_scheduled_lqr

LONG = AirspeedSchedule.transition(0.0, 13.0, 3.0, hold=12.2)


@pytest.fixture(scope="module")
def pilot():
    return gain_scheduled_lqr(symheli.Helicopter.load("xcell60", governor="ideal"), 0.0, 13.0, 0.02)


@pytest.fixture(scope="module")
def mixed(pilot):
    """Plans that differ in length, wind, trims, equipment and controller."""
    ideal = symheli.Helicopter.load("xcell60", governor="ideal")
    follows = dynamic(ideal, "reading")
    plans = []
    for seed in range(7):
        longer = AirspeedSchedule((3.0 + seed, 1.0), (3.0, 2.0), (0.2, 0.2), lead=0.1)
        plans += [
            FlightPlan(SHORT, controller=follows, **EVERYTHING).seeded(seed),
            FlightPlan(longer, controller=follows, **EVERYTHING).seeded(seed),
            FlightPlan(longer, controller=pilot, noise_db=30.0, excitation=STIRRED, seed=seed),
            FlightPlan(SHORT, controller=pilot, wind=(float(seed), 0.0, 0.0), trims="level"),
        ]
    return plans


@pytest.fixture(scope="module")
def together(mixed):
    return fly_batch(symheli.Helicopter.load("xcell60", governor="ideal"), mixed)


def test_a_flight_has_the_same_bits_alone_and_beside_any_others(ideal, mixed, together):
    for i in (0, 1, 2, 3, 13, 22, 27):
        alone = fly(ideal, mixed[i])
        np.testing.assert_array_equal(together[i].values, alone.values)
        assert together[i].signals == alone.signals
    turned = fly_batch(ideal, mixed[::-1], workers=1)
    for i in range(len(mixed)):
        np.testing.assert_array_equal(turned[-1 - i].values, together[i].values)


@pytest.mark.parametrize("workers", [1, 3])
def test_the_number_of_workers_changes_no_bit(ideal, mixed, together, workers):
    again = fly_batch(ideal, mixed[:20], workers=workers)
    for first, second in zip(again, together, strict=False):
        np.testing.assert_array_equal(first.values, second.values)


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="levels of x86-64")
@pytest.mark.skipif(compiling.compiler() is None, reason="no compiler")
def test_the_level_of_instructions_changes_no_bit(pi, monkeypatch):
    native = fly_batch(pi, SHORT, seeds=range(5), controller=dynamic(pi), **EVERYTHING)
    flags = tuple("-march=x86-64-v3" if f == "-march=native" else f for f in compiling.FLAGS)
    monkeypatch.setattr(compiling, "FLAGS", flags)
    other = symheli.Helicopter(pi.vehicle, pi.governor, pi.density)
    plain = fly_batch(other, SHORT, seeds=range(5), controller=dynamic(pi), **EVERYTHING)
    for first, second in zip(native, plain, strict=True):
        np.testing.assert_array_equal(first.values, second.values)


@pytest.mark.slow
@pytest.mark.parametrize("governor", ["ideal", pytest.param("pi", marks=pytest.mark.slow)])
def test_without_a_compiler_a_long_flight_is_the_same_to_its_promise(governor, monkeypatch):
    heli = symheli.Helicopter.load("xcell60", governor=governor)
    loop = dynamic(heli)
    compiled = fly(heli, LONG, controller=loop, **EVERYTHING)
    monkeypatch.setattr("symheli.integrate.equations.library", lambda source, name: None)
    other = symheli.Helicopter(heli.vehicle, heli.governor, heli.density)
    plain = fly(other, LONG, controller=loop, **EVERYTHING)
    assert len(plain) == 2000
    assert differences(plain, compiled) < 1e-9


def test_seeds_stir_noise_turbulence_and_excitation(ideal, pilot):
    flights = fly_batch(
        ideal, SHORT, seeds=[0, 4], controller=pilot, excitation=STIRRED, wind=STORM, noise_db=30
    )
    assert [p.seed for p in flights.plans] == [0, 4]
    assert [p.wind.seed for p in flights.plans] == [STORM.seed, STORM.seed + 4]
    assert [p.excitation.seed for p in flights.plans] == [STIRRED.seed, STIRRED.seed + 4]
    for name in ("wind_n", "e_d_lat", "phi"):
        first, second = flights.column(name)
        assert np.corrcoef(first, second)[0, 1] < 0.9


def test_each_schedule_is_flown_with_each_seed(ideal, pilot):
    longer = AirspeedSchedule((2.0,), (2.0,), (2.5,), lead=0.1)
    seen = []
    flights = fly_batch(
        ideal,
        [SHORT, longer],
        seeds=(1, 5),
        controller=pilot,
        progress=lambda done, count: seen.append((done, count)),
    )
    assert [(p.schedule, p.seed) for p in flights.plans] == [
        (SHORT, 1),
        (SHORT, 5),
        (longer, 1),
        (longer, 5),
    ]
    assert seen[-1] == (4, 4)
    q = flights.column("q")
    lengths = [len(record) for record in flights]
    assert q.shape == (4, max(lengths))
    assert np.isfinite(q).sum(axis=1).tolist() == lengths


def test_a_lost_flight_takes_nobody_with_it(ideal, pilot):
    wild = symheli.Excitation({"d_lon": 0.5, "d_lat": 0.5}, band=(0.1, 0.5))
    plans = [FlightPlan(SHORT, controller=pilot, seed=i) for i in range(6)]
    plans[2] = FlightPlan(SHORT, controller=pilot, excitation=wild)
    flights = fly_batch(ideal, plans)
    assert flights.lost.tolist() == [False, False, True, False, False, False]
    assert list(flights.causes) == [2]
    assert "at its stop" in flights.causes[2]
    np.testing.assert_array_equal(flights[3].values, fly(ideal, plans[3]).values)
    with pytest.raises(FlightLostError) as alone:
        fly(ideal, plans[2])
    np.testing.assert_array_equal(flights[2].values, alone.value.record.values)
    assert np.isnan(flights.column("phi")[2, len(flights[2]) :]).all()


def test_a_python_controller_flies_too_and_says_that_it_is_slow(ideal, pilot):
    short = AirspeedSchedule((2.0,), (2.0,), (0.2,), lead=0.1)
    with pytest.warns(CompilerWarning, match="written in Python is asked at every sample of 2"):
        asked = fly_batch(
            ideal, short, seeds=range(2), controller=InPython(pilot.scheduled_controller)
        )
    compiled = fly_batch(ideal, short, seeds=range(2), controller=pilot)
    for first, second in zip(asked, compiled, strict=True):
        assert differences(first, second) < 1e-11


def test_what_is_kept_of_a_plan_flies_again(ideal, together):
    record = together[1]
    np.testing.assert_array_equal(fly(ideal, record.meta["plan"]).values, record.values)


def test_batches_that_are_none_are_refused(ideal, pilot):
    with pytest.raises(InputError, match="nothing to fly"):
        fly_batch(ideal, [])
    with pytest.raises(InputError, match="nothing to fly"):
        fly_batch(ideal, SHORT, seeds=[])
    with pytest.raises(InputError, match="either seed or seeds"):
        fly_batch(ideal, SHORT, seeds=[1], seed=2)
    with pytest.raises(InputError, match=r"seed: expected a whole number >= 0, got 1\.5"):
        fly_batch(ideal, SHORT, seeds=[1.5])
    with pytest.raises(InputError, match="workers must be at least 1"):
        fly_batch(ideal, SHORT, workers=0)
    with pytest.raises(InputError, match="expected a Helicopter"):
        fly_batch("xcell60", SHORT)


def test_plans_say_what_does_not_fit(ideal):
    for options, error in (
        ({"excitation": {"d_lon": 0.01}}, "excitation: expected an Excitation"),
        ({"excitation": symheli.Excitation({"d_roll": 0.1})}, "unknown input of the excitation"),
        ({"servos": {"d_lon": 3.0}}, r"servos\['d_lon'\]: expected a Servo, got 3"),
        ({"servos": list(XCELL_SERVOS)}, "servos: expected {signal: Servo}"),
        ({"sensors": {"q": 0.1}}, r"sensors\['q'\]: expected a Sensor"),
        ({"noise_db": "30 dB"}, "noise_db: expected a number of decibels"),
        ({"noise_db": np.nan}, "noise_db: expected a number of decibels"),
        ({"seed": -1}, "seed: expected a whole number"),
        ({"wind": (np.nan, 0.0, 0.0)}, "steady: expected three finite numbers"),
        ({"wind": "north"}, "wind: expected a Wind or"),
        ({"dt": "fast"}, "dt: expected a positive number of seconds"),
        ({"dt": -0.02}, "dt must be a positive number of seconds"),
        ({"dt": 30.0}, "less than two samples"),
        ({"delay": -0.1}, "delay: expected a number of seconds >= 0"),
        ({"trims": "none"}, "unknown kind of trims 'none'"),
        ({"exitation": None}, "unknown option of a flight 'exitation'; did you mean 'excitation'"),
    ):
        with pytest.raises(InputError, match=error):
            fly(ideal, SHORT, **options)
    with pytest.raises(InputError, match="schedule: expected an AirspeedSchedule"):
        fly(ideal, 5.0)
    with pytest.raises(InputError, match="expected a Helicopter"):
        fly(symheli.vehicles, SHORT)
