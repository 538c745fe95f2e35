"""ArduPilot's helicopter loops: closed forms of their parts, their linear model, refusals, and what
a public log confirms of them.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import symheli
from evidence.tuning import THROW, parameters
from symheli.errors import InputError, UnknownNameError
from symheli.flight import HelicopterLoops, RateController
from symheli.logs.parameters import read_parameters
from symheli.values import NamedVector

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data" / "xplane"
FOLDER = Path(os.environ.get("SYMHELI_PUBLIC_LOGS", BESIDE))
QUIET = {"P": 0.0, "I": 0.0, "D": 0.0, "FF": 0.0, "IMAX": 1.0, "ILMI": 1.0} | dict.fromkeys(
    ("FLTT", "FLTE", "FLTD"), 0.0
)
SEEN = ("u", "v", "w", "p", "q", "r", "phi", "theta")
ALL = (*SEEN, "d_lon", "d_lat", "d_col", "d_ped")


def one(dt=0.01, **entries):
    """Loops with the same axis three times."""
    axis = RateController(**(QUIET | entries))
    return HelicopterLoops(dict.fromkeys(("RLL", "PIT", "YAW"), axis), dt)


def flown(loops, samples):
    """Deflections (n, 3) d_lat, d_lon, d_ped of samples (n, 5) of p, q, r, phi, theta."""
    state, zero = loops.init(), np.zeros(len(ALL))
    reference, out = NamedVector(ALL, zero), []
    for row in samples:
        values = dict.fromkeys(ALL, 0.0) | dict(zip(SEEN[3:], row, strict=True))
        measured = NamedVector(ALL, [values[name] for name in ALL])
        u, state = loops.step(state, measured, reference, NamedVector(["airspeed"], [0.0]))
        out.append([u[1], u[0], u[3]])
    return np.array(out)


def response(model, samples):
    x, out = np.zeros(len(model.A)), []
    for y in samples:
        out.append(model.C @ x + model.D @ y)
        x = model.A @ x + model.B @ y
    return np.array(out)


def test_within_limits_the_loops_are_their_linear_model():
    """Gyro low-pass, notch, three filters, integrator and attitude at once; the integrator stays
    below the level from which it leaks.
    """
    given = parameters() | {
        "INS_HNTCH_ENABLE": 1.0,
        "INS_HNTCH_FREQ": 15.0,
        "INS_HNTCH_BW": 8.0,
        "INS_HNTCH_ATT": 30.0,
        "ATC_RAT_RLL_FLTE": 12.0,
    }
    loops = HelicopterLoops.from_parameters(given, throw=THROW)
    samples = 0.02 * np.random.default_rng(0).standard_normal((50, 5))
    seen = flown(loops, samples)
    assert np.abs(seen).max() > 1e-4
    np.testing.assert_allclose(seen, response(loops.linear, samples), atol=1e-15)  # sums of ~1e-3


@pytest.mark.parametrize("filtered", ["FLTT", "FLTE", "FLTD"])
def test_a_first_order_filter_has_the_step_response_of_its_corner(filtered):
    """1 - (1 - a)^n, a = w dt/(1 + w dt): backward differences; 63 % after 1/w as dt goes to 0."""
    corner, dt = 5.0, 0.001
    entry = {"FLTT": "FF", "FLTE": "P", "FLTD": "D"}[filtered]
    loops = one(dt, **{entry: 1.0, filtered: corner})
    n, zero = np.arange(1, 201), np.zeros(200)
    target = dt * n if filtered == "FLTD" else np.ones(200)  # of a ramp the derivative steps
    got = loops.replay("PIT", target, zero)[entry]
    w = 2 * np.pi * corner
    np.testing.assert_allclose(got, 1 - (1 + w * dt) ** -n, rtol=1e-11)
    assert got[round(1 / (w * dt)) - 1] == pytest.approx(1 - np.exp(-1), abs=w * dt)


def test_the_gyro_is_filtered_as_scipy_filters():
    loops = HelicopterLoops(one(P=1.0).axes, 0.0025, gyro=20.0, throw=dict.fromkeys(THROW, 1.0))
    rates = 0.2 * np.random.default_rng(1).standard_normal(200)
    samples = np.zeros((200, 5))
    samples[:, 1] = rates
    b, a = butter(2, 20.0, fs=400.0)
    np.testing.assert_allclose(flown(loops, samples)[:, 1], -lfilter(b, a, rates), atol=1e-14)


def test_the_notch_has_its_attenuation_at_its_center_and_half_power_at_its_edges():
    """Without attenuation far away: 40 dB at 60 Hz; 3 dB about at 60 -+ 15 Hz, of a width of 30."""
    loops = HelicopterLoops(one(P=1.0).axes, 1 / 400, notch=(60.0, 30.0, 40.0))
    hertz = np.array([0.5, 60.0, 45.0, 75.0])
    L = np.abs(loops.linear.select(inputs=["p"]).frequency_response(2 * np.pi * hertz))
    gain = 20 * np.log10(L[:, 0, 0] / (np.pi / 4))  # throw where none is measured
    assert gain[0] == pytest.approx(0.0, abs=0.01)
    assert gain[1] == pytest.approx(-40.0, abs=1e-6)
    # edges of an analog notch; bilinear transformation bends 75 Hz by some 5 %
    np.testing.assert_allclose(gain[2:], -3.0, atol=0.7)


def test_the_integrator_stops_at_its_limit_and_leaks_towards_its_level():
    """0.1/s of an error of 1, each 0.01 s: 0.001 a step up to 0.003. Above 0.002 2 % of the excess
    leaks each step, by hand.
    """
    error, zero = np.ones(5), np.zeros(5)
    held = one(I=0.1, IMAX=0.003).replay("RLL", error, zero)["I"]
    np.testing.assert_allclose(held, [0.001, 0.002, 0.003, 0.003, 0.003], rtol=1e-12)
    leaking = one(I=0.1, IMAX=0.003, ILMI=0.002)
    third, fourth = 0.003 - 0.02 * 0.001, 0.003 - 0.02 * 0.001  # limited first: 0.00298 + 0.001
    expected = [0.001, 0.002, third, fourth]
    np.testing.assert_allclose(
        leaking.replay("RLL", error[:4], zero[:4])["I"], expected, rtol=1e-12
    )
    stopped = leaking.replay("RLL", np.array([1.0, 1.0, 1.0, *zero]), np.zeros(8))["I"]
    np.testing.assert_allclose(stopped[2:] - 0.002, 0.98e-3 * 0.98 ** np.arange(6), rtol=1e-9)
    assert np.all(
        leaking.replay("YAW", -error, zero)["I"] == -leaking.replay("YAW", error, zero)["I"]
    )


def test_outputs_are_limited_to_full_deflection():
    loops = HelicopterLoops(one(P=5.0).axes, 0.01, throw={"d_lat": 0.2, "d_lon": 0.1, "d_ped": 0.3})
    samples = np.array([[-1.0, 1.0, -1.0, 0.0, 0.0]])
    np.testing.assert_allclose(flown(loops, samples), [[0.2, -0.1, 0.3]])


def test_parameters_are_read_by_axis():
    loops = HelicopterLoops.from_parameters(parameters(), throw=THROW)
    assert loops.dt == 0.02
    assert loops.gyro == 20.0
    assert loops.axes["PIT"].P == parameters()["ATC_RAT_PIT_P"]
    assert loops.axes["YAW"].attitude == 4.5


def test_all_missing_parameters_are_named_at_once():
    given = parameters()
    del given["ATC_RAT_RLL_FLTD"], given["ATC_ANG_YAW_P"]
    with pytest.raises(InputError, match=r"missing: ATC_RAT_RLL_FLTD, ATC_ANG_YAW_P;.*\.param"):
        HelicopterLoops.from_parameters(given)
    with pytest.raises(InputError, match="missing: INS_HNTCH_BW, INS_HNTCH_ATT"):
        HelicopterLoops.from_parameters(
            parameters() | {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_FREQ": 40.0}
        )


@pytest.mark.parametrize(
    "name", ["ATC_RAT_RLL_NTF", "ATC_RAT_PIT_SMAX", "ATC_RAT_YAW_D_FF", "ATC_RAT_RLL_PDMX"]
)
def test_what_is_set_and_not_modelled_is_named(name):
    with pytest.raises(InputError, match=f"not modelled are set: {name} = 2"):
        HelicopterLoops.from_parameters(parameters() | {name: 2.0})
    HelicopterLoops.from_parameters(parameters() | {name: 0.0})  # off


def test_a_notch_that_follows_the_rotor_is_refused():
    following = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 3.0, "INS_HNTCH_FREQ": 80.0}
    with pytest.raises(InputError, match="INS_HNTCH_MODE = 3"):
        HelicopterLoops.from_parameters(parameters() | following)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ATC_RAT_PIT_P": -0.1}, "PIT P: expected a number >= 0, got -0.1"),
        ({"ATC_ANG_RLL_P": float("nan")}, "RLL attitude: expected a number >= 0, got nan"),
        ({"INS_GYRO_FILTER": 25.0}, "expected a corner frequency below 25 Hz, got 25"),
    ],
)
def test_numbers_out_of_range_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        HelicopterLoops.from_parameters(parameters() | change)


def test_a_change_of_one_parameter_changes_one_number():
    before = HelicopterLoops.from_parameters(parameters(), throw=THROW)
    for name, value in {
        "ATC_RAT_YAW_D": 0.01,
        "ATC_ANG_RLL_P": 6.0,
        "INS_GYRO_FILTER": 15.0,
    }.items():
        after = before.with_parameters({name: value})
        assert after == HelicopterLoops.from_parameters(parameters() | {name: value}, throw=THROW)
        assert after != before


def test_a_parameter_of_no_loop_is_refused_with_the_nearest():
    loops = HelicopterLoops.from_parameters(parameters())
    with pytest.raises(UnknownNameError, match="did you mean 'ATC_RAT_RLL_P'"):
        loops.with_parameters({"ATC_RAT_ROLL_P": 0.1})


def test_a_flight_leaves_the_loops_as_they_were(ideal):
    """Two flights with one object, and one with another like it: the same bits."""
    loops = HelicopterLoops.from_parameters(parameters(), throw=THROW)
    schedule = symheli.AirspeedSchedule((2.0, 4.0), (2.0, 2.0), (0.5, 0.5), lead=0.5)
    first, second = (symheli.fly(ideal, schedule, controller=loops) for _ in range(2))
    other = HelicopterLoops.from_parameters(parameters(), throw=THROW)
    third = symheli.fly(ideal, schedule, controller=other)
    np.testing.assert_array_equal(first.values, second.values)
    np.testing.assert_array_equal(first.values, third.values)
    assert np.ptp(first["u"]) > 1.0


# --- replay --------------------------------------------------------------------------------------


def test_the_replayed_terms_are_those_of_the_loops():
    """P + I + D + FF times the throw, of a target of an attitude and an unfiltered gyro."""
    loops = one(P=0.1, I=0.2, D=0.003, FF=0.05, FLTT=10.0, FLTE=8.0, FLTD=6.0, attitude=4.0)
    samples = 0.05 * np.random.default_rng(2).standard_normal((60, 5))
    terms = loops.replay("PIT", -4.0 * samples[:, 4], samples[:, 1])
    np.testing.assert_allclose(
        sum(terms.values()) * np.pi / 4, flown(loops, samples)[:, 1], atol=1e-15
    )


@pytest.mark.parametrize(
    ("target", "measured", "words"),
    [
        (np.zeros(3), np.zeros(4), r"one length, got \(3,\) and \(4,\)"),
        (np.zeros((3, 1)), np.zeros((3, 1)), "one length"),
        (np.array([0.0, np.nan]), np.zeros(2), "are missing"),
    ],
)
def test_what_cannot_be_replayed_is_refused(target, measured, words):
    with pytest.raises(InputError, match=words):
        one().replay("RLL", target, measured)
    with pytest.raises(UnknownNameError, match="unknown axis 'ROLL'"):
        one().replay("ROLL", np.zeros(2), np.zeros(2))


AIRBORNE = ((215.0, 250.0), (888.0, 908.0))
"""s on the clock of sample.bin."""
WITHIN = {"RLL": 0.10, "PIT": 0.09, "YAW": 0.025}
"""Root mean square of the error over the range of the logged output. Read off this log: 10 Hz show
the 2.5 Hz of the yaw's filter, but a part only of what passes the 20 Hz of roll and pitch.
"""


@pytest.mark.parametrize(
    "axis", ["YAW", *(pytest.param(axis, marks=pytest.mark.slow) for axis in ("RLL", "PIT"))]
)
def test_outputs_of_a_public_copter_log_are_replayed_from_its_targets_and_rates(axis):
    """What a helicopter shares with a copter: P, I, D and the filter of the error. Of this firmware
    one corner frequency, FILT, filters the error; nothing leaks. In yaw every number and the filter
    are confirmed to a quarter; of roll and pitch 10 Hz tell no more than that I acts and P is no
    half of what is set (twice the P would fit the roll as well).
    """
    file = FOLDER / "sample.bin"
    if not file.is_file():
        pytest.skip("sample.bin is not here: python -m evidence.logs --folder DIR --fetch-only")
    pytest.importorskip("pymavlink")
    from symheli.logs.dataflash import dataflash_columns

    given = read_parameters(file)
    found = {
        name: given[f"ATC_RAT_{axis}_{name}"] for name in ("P", "I", "D", "FF", "IMAX", "FILT")
    }
    corner, none = found.pop("FILT"), {"FLTT": 0.0, "FLTD": 0.0, "ILMI": found["IMAX"]}
    dt = 1 / given["SCHED_LOOP_RATE"]
    columns = dataflash_columns(file)
    names = {
        "RLL": ("RDes", "R", "ROut"),
        "PIT": ("PDes", "P", "POut"),
        "YAW": ("YDes", "Y", "YOut"),
    }
    target, rate, output = (columns[f"RATE.{name}"] for name in names[axis])
    for start, stop in AIRBORNE:
        fine = np.arange(start, stop, dt)
        wanted, got = (np.interp(fine, c.time, np.radians(c.values)) for c in (target, rate))
        here = (output.time > start) & (output.time < fine[-1])

        def error(wanted=wanted, got=got, fine=fine, here=here, **entries):
            terms = one(dt, **(found | none | entries)).replay(axis, wanted, got)
            replayed = np.interp(output.time[here], fine, sum(terms.values()))
            out = output.values[here]
            return np.sqrt(np.mean((replayed - out) ** 2)) / np.ptp(out)

        as_set = error(FLTE=corner)
        assert as_set < WITHIN[axis]
        assert as_set < error(FLTE=corner, I=0.0)
        assert as_set < error(FLTE=corner, P=0.5 * found["P"])
        if axis == "YAW":
            for changed in ({"P": 0.8}, {"P": 1.25}, {"I": 0.8}, {"I": 1.25}):
                (name, factor), *_ = changed.items()
                assert as_set < error(**({"FLTE": corner} | {name: factor * found[name]}))
            assert as_set < error(FLTE=0.0)
