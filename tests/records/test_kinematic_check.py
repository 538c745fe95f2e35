"""Attitude, rates, velocities and specific forces held against each other: faults that were put in
come back, with errors that say how far to trust them, and sound records pass.
"""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import symheli
from symheli import FlightRecord
from symheli.errors import InputError
from symheli.records import check_kinematics
from symheli.values.kinematics import GRAVITY as G

NOISE = {
    **dict.fromkeys("pqr", 0.01),
    **dict.fromkeys(("phi", "theta", "psi"), 0.004),
    **dict.fromkeys("uvw", 0.1),
    **dict.fromkeys(("ax", "ay", "az"), 0.2),
}
UNITS = {
    **dict.fromkeys("pqr", "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi"), "rad"),
    **dict.fromkeys("uvw", "m/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
}


def analytic(seed=0, n=2000, dt=0.02, noise=1.0):
    """Angles and velocities are sums of sines; rates and specific forces follow by calculus, from
    the rotation matrix and not from the equations under test.
    """
    rng, t = np.random.default_rng(seed), dt * np.arange(n)

    def sines(size, mean):
        w, f = rng.uniform(0.3, 4.0, 6), rng.uniform(0, 2 * np.pi, 6)
        a = size * rng.uniform(0.5, 1.0, 6)
        wave = w[:, None] * t + f[:, None]
        return mean + a @ np.sin(wave), (a * w) @ np.cos(wave)

    sizes = (("phi", 0.08, 0.1), ("theta", 0.06, 0.0), ("psi", 0.2, 1.0))
    angles = {name: sines(size, mean) for name, size, mean in sizes}
    sizes = (("u", 0.6, 8.0), ("v", 0.4, 0.0), ("w", 0.3, 0.5))
    velocities = {name: sines(size, mean) for name, size, mean in sizes}

    def turn(axis, angle):  # from earth to body axes about one of them
        c, s, i, j = np.cos(angle), np.sin(angle), (axis + 1) % 3, (axis + 2) % 3
        out = np.zeros((n, 3, 3))
        out[:, axis, axis], out[:, i, i], out[:, j, j] = 1.0, c, c
        out[:, i, j], out[:, j, i] = s, -s
        return out

    roll, pitch, yaw = (turn(i, angles[name][0]) for i, name in enumerate(("phi", "theta", "psi")))
    x, y, z = np.eye(3)
    omega = (
        angles["phi"][1][:, None] * x
        + angles["theta"][1][:, None] * (roll @ y)
        + angles["psi"][1][:, None] * (roll @ pitch @ z)
    )
    V, rate = (np.stack([velocities[n][i] for n in "uvw"], axis=1) for i in (0, 1))
    force = rate + np.cross(omega, V) - (roll @ pitch @ yaw) @ (G * z)
    found = {
        **dict(zip("pqr", omega.T, strict=True)),
        **{name: pair[0] for name, pair in (angles | velocities).items()},
        **dict(zip(("ax", "ay", "az"), force.T, strict=True)),
    }
    noisy = {k: v + noise * NOISE[k] * rng.standard_normal(n) for k, v in found.items()}
    return FlightRecord.from_arrays(t, UNITS, **noisy)


def changed(record, **columns):
    return record.with_signals({name: UNITS[name] for name in columns}, **columns)


def late(record, name, seconds):
    """The same signal later, between samples by a spline."""
    past = np.maximum(record.time - seconds, record.time[0])
    return CubicSpline(record.time, record[name])(past)


def flown(heli, seed, noise_db=30.0):
    return symheli.fly(
        heli,
        symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=3.0, laps=2),
        excitation=symheli.Excitation(
            {"d_lon": 0.012, "d_lat": 0.012, "d_col": 0.010, "d_ped": 0.03}, seed=seed
        ),
        noise_db=noise_db,
        seed=seed,
    )


def within(estimate, true, limit):
    return abs(estimate.value - true) <= limit * estimate.standard_error


@pytest.mark.slow
def test_exact_motion_has_no_fault_to_the_error_of_splines():
    """Steps of 0.02 s of sines up to 4 rad/s: (4 * 0.02)^4 / 384 is 1e-7."""
    found = check_kinematics(analytic(noise=0.0))
    for row in found.rows:
        assert row.verdict == "consistent"
        for estimate, true in ((row.bias, 0.0), (row.scale, 1.0), (row.delay, 0.0)):
            assert estimate is None or abs(estimate.value - true) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_faults_of_every_kind_come_back_within_their_errors(seed):
    record = analytic(seed)
    record = changed(
        record,
        p=record["p"] - 0.03,
        q=1.1 * record["q"],
        psi=late(record, "psi", 0.07),
        u=late(record, "u", 0.05),
        az=record["az"] + 0.6,
        ay=0.9 * record["ay"],
    )
    found = check_kinematics(record)
    put_in = (
        *((found["p"].bias, -0.03), (found["q"].scale, 1.1), (found["psi"].delay, 0.07)),
        *((found["u"].delay, 0.05), (found["az"].bias, 0.6), (found["ay"].scale, 0.9)),
    )
    for estimate, true in put_in:
        assert within(estimate, true, found.limit)
        assert estimate.standard_error < 0.2 * abs(true)
    assert {row.signal for row in found.inconsistent} == {"p", "q", "psi", "u", "az", "ay"}
    assert "(3.5 samples) after the rates" in found["psi"].verdict
    with pytest.raises(
        InputError, match=r"p: it reads -0\.03\d* rad/s too much: subtract it; q: it"
    ):
        found.require()


@pytest.mark.slow
def test_faults_put_into_flights_come_back_and_errors_tell_the_scatter(ideal):
    """Three standard errors, as often as a normal number may: of 6 flights x 4 numbers the worst
    below the limit of one in a thousand, the mean square near one (0.4 to 1.9: 24 numbers).
    """
    z = []
    for seed in range(6):
        record = flown(ideal, seed)
        clean = flown(ideal, seed, noise_db=None)
        found = check_kinematics(
            changed(
                record,
                p=record["p"] + 0.02,
                q=1.05 * record["q"],
                phi=late(clean, "phi", 0.04) + record["phi"] - clean["phi"],
            )
        )
        for estimate, true in (
            (found["p"].bias, 0.02),
            (found["q"].scale, 1.05),
            (found["phi"].delay, 0.04),
            (found["theta"].delay, 0.0),
        ):
            z.append((estimate.value - true) / estimate.standard_error)
        assert {row.signal for row in found.inconsistent} == {"p", "q", "phi"}
    assert np.abs(z).max() < found.limit
    assert 0.4 < np.mean(np.square(z)) < 1.9


@pytest.mark.slow
def test_sound_flights_are_consistent_with_noise_and_without(ideal):
    for seed in range(4):
        found = flown(ideal, seed, noise_db=30.0 if seed % 4 else None).check_kinematics()
        found.require()
        verdicts = {row.signal: row.verdict for row in found.rows}
        for name in ("p", "q", "r", "phi", "theta"):
            assert verdicts[name] == "consistent"
        assert verdicts["u"].endswith("held against specific forces; there is no ax, ay, az")


DEG = 180 / np.pi


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factors", "said"),
    [
        ({"p": DEG}, {"p": "it is in deg/s"}),
        ({"q": -1.0}, {"q": "its sign is turned, or that of theta"}),
        ({"r": -1.0, "psi": -1.0}, {"r": "its sign is turned", "psi": "its sign is turned"}),
        ({"ax": 1 / G}, {"ax": "it is in g"}),
        ({"ay": -1.0}, {"ay": "its sign is turned, or that of v"}),
        ({"r": 0.8}, {"r": "of what psi moves by: divide by it"}),
    ],
    ids=str,
)
def test_wrong_units_and_signs_are_called_by_their_name(factors, said):
    record = analytic()
    found = check_kinematics(changed(record, **{n: f * record[n] for n, f in factors.items()}))
    assert {row.signal for row in found.inconsistent} == set(said)
    for name, words in said.items():
        assert words in found[name].verdict


@pytest.mark.slow
def test_a_heading_that_starts_anew_at_north_is_one_heading():
    record = analytic()
    wrapped = changed(record, psi=np.mod(record["psi"] - 1.0, 2 * np.pi))
    assert np.abs(np.diff(wrapped["psi"])).max() > 6
    assert check_kinematics(wrapped)["psi"].verdict == "consistent"


@pytest.mark.slow
def test_gaps_and_missing_samples_are_left_out():
    record = analytic(n=1500)
    values = record.values.copy()
    values[700:703, 0] = np.nan
    holed = FlightRecord(record.time, values, record.signals).rows(
        np.r_[0:900, 1000:1500]  # 2 s are gone
    )
    found = check_kinematics(holed)
    assert not found.inconsistent
    assert FlightRecord(record.time, values, record.signals).check_kinematics().windows == 13
    assert found.windows == 11


@pytest.mark.slow
def test_another_column_is_no_rate_of_roll():
    record = analytic(n=1000)
    found = check_kinematics(changed(record, p=np.random.default_rng(1).permutation(record["p"])))
    assert "check which columns phi and p are" in found["phi"].verdict


@pytest.mark.slow
def test_what_does_not_move_is_not_known_and_its_bias_is():
    n, rng = 2000, np.random.default_rng(0)
    still = {name: NOISE[name] * rng.standard_normal(n) for name in ("p", "q", "r")}
    still |= {name: NOISE[name] * rng.standard_normal(n) for name in ("phi", "theta")}
    still["p"] += 0.02
    found = check_kinematics(FlightRecord.from_arrays(0.02 * np.arange(n), UNITS, **still))
    assert found["p"].scale.standard_error == np.inf
    assert within(found["p"].bias, 0.02, found.limit)
    assert {row.signal for row in found.inconsistent} == {"p"}
    assert "not known" in str(found)


def test_a_short_record_and_one_without_rates_say_what_they_lack():
    short = check_kinematics(analytic(n=600))
    assert {row.verdict for row in short.rows} == {
        "not known: 5 windows of 2 s without a gap, 8 are needed"
    }
    short.require()  # nothing is known against it
    with pytest.raises(InputError, match="the record lacks r, theta"):
        check_kinematics(analytic().select(["p", "q", "phi"]))
    with pytest.raises(InputError, match="'d_lon' was not checked; there are p, q"):
        short["d_lon"]


@pytest.mark.slow
def test_a_long_record_is_compared_in_pieces_spread_over_it():
    """An hour at 10 Hz: a bias that comes in the last half is seen, and the time is bounded."""
    record = analytic(n=36000, dt=0.1)
    late_bias = record["q"] + 0.02 * (record.time > 1800.0)
    found = check_kinematics(changed(record, q=late_bias))
    assert found.windows <= 120
    assert "q" in {r.signal for r in found.inconsistent}


@pytest.mark.slow
def test_a_record_is_corrected_by_what_contradicts_the_others(ideal):
    """A scale and a bias of q, and roll three samples late, are taken off; the others stay."""
    flight = flown(ideal, 1, noise_db=30.0)
    late = np.concatenate([np.full(3, np.nan), flight["phi"][:-3]])
    wrong = flight.with_signals({"q": "rad/s", "phi": "rad"}, q=1.1 * flight["q"] + 0.03, phi=late)
    mended = wrong.corrected()
    assert not mended.check_kinematics().inconsistent
    # what the check bears of a rate: 2 % and .3 deg/s
    assert np.abs(mended["q"] - flight["q"]).max() < 0.02 * np.abs(flight["q"]).max() + 0.005
    assert np.nanstd(mended["phi"] - flight["phi"]) < 0.1 * np.nanstd(late - flight["phi"])
    np.testing.assert_array_equal(mended["theta"], wrong["theta"])
    assert flight.corrected().values.shape == flight.values.shape
