"""Delay, servos, a governed rotor, a steady wind and late sensors are part of a rigid-body
structure: known, they leave the coefficients exact; unknown, they are found beside them.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import CONTROLS, DT, HIGH, LOW, STATES, UNITS, Pilot, Vehicle, rates

import identification as idn
from symheli import FlightRecord, LinearModel, Servo
from symheli.errors import InputError

SERVOS = {
    u: Servo(natural_frequency=w, damping=0.7)
    for u, w in zip(CONTROLS, (33.0, 36.0, 30.0, 44.0), strict=True)
}
NOISE = dict(zip(STATES, (3e-4,) * 3 + (1e-4,) * 5, strict=True))
WIND = (3.0, -2.0)


def body_axes(phi, theta, psi):
    """Rotation from north, east, down into the axes of the body."""
    c, s = math.cos, math.sin
    yaw = np.array([[c(psi), s(psi), 0], [-s(psi), c(psi), 0], [0, 0, 1]])
    pitch = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
    roll = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
    return roll @ pitch @ yaw


class Chain:
    """A command after another through the models that `Actuators.sampled` gives."""

    def __init__(self, actuators):
        from symheli.values import Signal

        controls = {u: Signal(u, "rad") for u in CONTROLS}
        self.models = [] if actuators is None else list(actuators.sampled(controls, DT).values())
        self.x = [np.zeros(len(m.A)) for m in self.models]

    def step(self, command):
        """Mean deflections (4,) of the sample that begins with this command."""
        if not self.models:
            return command
        out = np.array([m.C[0] @ x + m.D[0, 0] * c for m, x, c in self._each(command)])
        self.x = [m.A @ x + m.B[:, 0] * c for m, x, c in self._each(command)]
        return out

    def _each(self, command):
        return zip(self.models, self.x, command, strict=True)


def flown(vehicle, n=500, actuators=None, wind=(0.0, 0.0), heading=0.0, seed=1, sensors=None):
    """A record of commands: the vehicle feels the deflections behind them, and the air."""
    rng, noise = np.random.default_rng(seed), np.random.default_rng((seed, 1))
    e = np.repeat(0.05 * rng.normal(size=(n // 7 + 1, 4)), 7, axis=0)[:n]
    p = 0.5 * (LOW + HIGH) + 4.5 * np.sin(2 * np.pi * DT / 3.0 * np.arange(n) + 0.3)
    f = vehicle.kin.aerodynamics.basis(p)
    y, air, u, command = (np.zeros((n, m)) for m in (8, 8, 4, 4))
    psi, chain, pilot = np.full(n, heading), Chain(actuators), Pilot()
    blur = noise.normal(size=(n, 8)) * (np.zeros(8) if sensors is None else sensors)
    for k in range(n):
        if k < vehicle.kin.memory:
            y[k] = 0.05 * rng.normal(size=8)
        else:
            added = np.append(vehicle.added(k, air, u, p, f[k]), [0.0, 0.0])
            y[k] = y[k - 1] + added + DT * rates(y[k - 1])
            for _ in range(30):
                y[k] = y[k - 1] + added + 0.5 * DT * (rates(y[k - 1]) + rates(y[k]))
            q, r, phi, theta = y[k, 4:].tolist()
            turn = (q * math.sin(phi) + r * math.cos(phi)) / math.cos(theta)
            psi[k] = psi[k - 1] + DT * turn
        blown = body_axes(*y[k, 6:], psi[k]) @ np.array([*wind, 0.0])
        air[k] = y[k] - np.append(blown, np.zeros(5))
        command[k] = pilot.step(air[k] + blur[k], None, None) + e[k]
        u[k] = chain.step(command[k])
    names = [f"{c}_command" for c in CONTROLS]
    columns = dict(zip((*STATES, *names), np.column_stack([y + blur, command]).T, strict=True))
    ahead = wind[0] * np.cos(psi) + wind[1] * np.sin(psi)
    columns |= {"airspeed_command": p, "psi": psi, "over_ground": p + ahead, "truth": u[:, 0]}
    units = UNITS | dict.fromkeys((*names, "psi", "truth"), "rad")
    units |= dict.fromkeys(("airspeed_command", "over_ground"), "m/s")
    return FlightRecord.from_arrays(DT * np.arange(n), units, **columns)


def commanded(vehicle, **parts):
    inputs = tuple(f"{c}_command" for c in CONTROLS)
    return replace(vehicle.kin, inputs=inputs, nb=1, na=1, **parts)


class Clean:
    """The same flight without noise, by its record."""

    def __init__(self, *pairs):
        self.pairs = pairs

    def flown(self, record):
        return next(c for noisy, c in self.pairs if noisy["u"][0] == record["u"][0])


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle(na=1, nb=1)


def close(found, vehicle, tolerance):
    return np.abs(found.theta - vehicle.theta).max() < tolerance * np.abs(vehicle.theta).max()


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.02, 0.047])
@pytest.mark.parametrize("servos", [None, SERVOS], ids=["delay", "servos"])
def test_the_chain_before_a_model_is_what_the_regression_takes(delay, servos):
    """Two routes: a state space stepped, and filters with two inputs."""
    actuators = idn.Actuators(servos, delay=delay)
    commands = np.random.default_rng(0).normal(size=(60, 4))
    chain = Chain(actuators)
    commands[0] = 0.0  # both begin at rest at the first one
    stepped = [chain.step(c) for c in commands]
    # rounding of filters of third order with poles within .5 of 1
    np.testing.assert_allclose(stepped, actuators.deflections(commands, DT), atol=1e-10)


def test_behind_known_actuators_the_coefficients_are_exact(vehicle):
    actuators = idn.Actuators(SERVOS, delay=0.033)
    record = flown(vehicle, 300, actuators)
    found = idn.fit(commanded(vehicle, actuators=actuators), record)
    # half a second, after which samples count, leaves exp(-.7 30 .5) of how a servo began
    assert close(found, vehicle, 1e-3)
    assert [str(u) for u in found.inputs] == [f"{c}_command" for c in CONTROLS]
    without = idn.fit(commanded(vehicle), record)
    assert not close(without, vehicle, 0.1)


def test_a_log_with_every_second_command_is_interpolated():
    """A ramp is interpolated exactly: the mean over 40 ms of steps of 20 ms."""
    fine = np.arange(40.0)[:, None] * np.ones(4)
    actuators = idn.Actuators(period=DT)
    found = actuators.deflections(fine[::2], 2 * DT)
    np.testing.assert_allclose(found[:-1], fine[0:-2:2] + 0.5)
    with pytest.raises(InputError, match="does not divide"):
        idn.Actuators(period=0.03).deflections(fine, DT)


def test_in_a_known_wind_the_coefficients_are_exact(vehicle):
    records = [flown(vehicle, 250, wind=WIND, heading=h, seed=s) for s, h in ((1, 0.3), (2, 2.0))]
    wind = idn.structure.SteadyWind(*WIND, over_ground="over_ground")
    basis = idn.Polynomial(1, LOW - 5.0, HIGH + 5.0)
    kin = commanded(vehicle, wind=wind, scheduling="over_ground", basis=basis)
    found = idn.fit(kin, records)
    for p in (1.0, 8.0):  # the same functions of the airspeed, whatever their range
        own = (basis(np.array([p])) @ found.theta.reshape(-1, basis.size, 6))[:, 0]
        true = vehicle.kin.basis(np.array([p])) @ vehicle.theta.reshape(-1, basis.size, 6)
        np.testing.assert_allclose(own, true[:, 0], atol=1e-7)
    # one step, with the wind in what is predicted
    ahead = found.predict(records[0], 1)
    np.testing.assert_allclose(ahead[5:], records[0].columns(STATES)[5:], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["delay", "wind", "sensors"])
def test_what_is_not_known_is_found_beside_the_coefficients(vehicle, part):
    """Five of the standard deviations that are handed out, which leave out what of the
    discretization of splines and delays is no noise: a fiftieth of a sample more, .1 m/s.
    """
    sizes = np.array(list(NOISE.values()))
    told = {
        "delay": {"actuators": idn.Actuators(delay=0.02, delay_deviation=0.02)},
        "wind": {"wind": idn.structure.SteadyWind(deviation=5.0)},
        "sensors": {"sensors": idn.structure.LateSensors(deviation=0.02)},
    }[part]
    flying = {
        "delay": {"actuators": idn.Actuators(delay=0.033)},
        "wind": {"wind": WIND},
        "sensors": {},
    }[part]
    pairs = []
    for seed, heading in ((1, 0.3), (2, 2.0)):
        noisy, clean = (
            flown(vehicle, 300, heading=heading, seed=seed, sensors=s, **flying)
            for s in (sizes, None)
        )
        if part == "sensors":
            noisy = idn.structure.LateSensors(delay=-0.025).along(noisy)
        pairs.append((noisy, clean))
    found = idn.fit(
        commanded(vehicle, **told),
        [noisy for noisy, _ in pairs],
        idn.methods.FilterError(Clean(*pairs), noise=NOISE),
    )
    estimates = next(
        found.details[n] for n in ("actuators", "wind", "sensors") if n in found.details
    )
    true = {
        "delay": {"delay": 0.033},
        "wind": dict(zip(("north", "east"), WIND, strict=True)),
        "sensors": {"delay": 0.025},
    }[part]
    besides = {"delay": 4e-4, "wind": 0.1, "sensors": 4e-4}[part]
    for name, (value, deviation) in estimates.items():
        assert abs(value - true[name]) < 5 * deviation + besides
    kept = getattr(found.structure, {"delay": "actuators"}.get(part, part))
    assert not kept.unknown


def test_a_governed_rotor_is_a_state_of_the_model(vehicle):
    """Its rows, stepped along the record, leave what the regression of the speed leaves."""
    record = flown(vehicle, 400)
    rng = np.random.default_rng(5)
    speed = 160.0 + np.cumsum(0.1 * rng.normal(size=len(record)))
    record = record.with_signals({"Om": "rad/s"}, Om=speed)
    kin = commanded(vehicle, rotor_speed="Om", governed_at=160.0)
    kin = replace(kin, basis=idn.Polynomial(0, LOW, HIGH), offset_rate=False)
    model = idn.fit(kin, record)
    assert [str(s) for s in model.realization.states[-2:]] == ["Om", "Om_integral"]
    x, u = model.states(record), record.columns(map(str, model.inputs))
    linear = model.at(5.0)
    left = (x[1:] - x[:-1] @ linear.A.T - u[:-1] @ linear.B.T)[1:, -2:]
    offset = model.drive.theta[-1, 0]
    regression = model.drive.structure.prepared(record)
    change = regression["Om_change"][2:]
    rows = regression.columns(model.drive.structure.inputs)[1:-1]
    residual = change - rows @ model.drive.theta[:-1, 0] - offset
    np.testing.assert_allclose(left[:, 0] - offset, residual, atol=1e-9)
    half = 0.5 * DT * (left[:, 0])  # the step of the integral takes the predicted speed
    np.testing.assert_allclose(left[:, 1] + half, 160.0 * DT, atol=1e-9)


@pytest.mark.slow
def test_a_saved_model_keeps_its_parts(vehicle, tmp_path):
    actuators = idn.Actuators(SERVOS, delay=0.033)
    record = flown(vehicle, 300, actuators, WIND)
    record = record.with_signals({"Om": "rad/s"}, Om=160.0 + 0.1 * record["p"])
    wind, sensors = idn.structure.SteadyWind(*WIND), idn.structure.LateSensors(delay=0.01)
    kin = commanded(vehicle, actuators=actuators, wind=wind, sensors=sensors, rotor_speed="Om")
    model = idn.fit(kin, record)
    again = idn.model.KinematicModel.load(model.save(tmp_path / "model.json"))
    assert again.structure == model.structure
    for p in (1.0, 7.0):
        one, other = model.at(p), again.at(p)
        assert isinstance(one, LinearModel)
        np.testing.assert_array_equal(one.A, other.A)
    lpv = model.to_state_space()
    np.testing.assert_allclose(lpv.at(7.0).A, model.at(7.0).A, atol=1e-8)


def test_what_cannot_stand_between_is_refused(vehicle):
    record = flown(vehicle, 120)
    late = idn.Actuators(delay_deviation=0.01)
    with pytest.raises(InputError, match="delay of the actuators: estimated by FilterError"):
        idn.fit(commanded(vehicle, actuators=late), record)
    with pytest.raises(InputError, match="none given for d_lon"):
        commanded(vehicle, actuators=idn.Actuators({}))
    with pytest.raises(InputError, match=r"wind: expected SteadyWind"):
        commanded(vehicle, wind=(1.0, 2.0, 0.0))
    with pytest.raises(InputError, match="over ground"):
        commanded(vehicle, wind=idn.structure.SteadyWind(over_ground="speed"))
    with pytest.raises(InputError, match="a state or an input already"):
        commanded(vehicle, rotor_speed="p")
    with pytest.raises(InputError, match="without actuators"):
        idn.RecursiveLeastSquares(commanded(vehicle, actuators=idn.Actuators(delay=0.02)))
    for wrong in ({"deviation": -1.0}, {"north": float("nan")}):
        with pytest.raises(InputError):
            idn.structure.SteadyWind(**wrong)
    with pytest.raises(InputError, match="finite delay"):
        idn.structure.LateSensors(delay=float("inf"))
