"""Known kinematics around identified aerodynamics: recovered exactly, stepped, flown in the loop,
linearized.
"""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import CONTROLS, DT, STATES, G, Pilot, Vehicle

import identification as idn
from identification.model import kinematic_run
from identification.structure.kinematic_arx import INCREMENTS, increments
from symheli.errors import InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.kinematics import kinematic_rates

CONVERGED = 40  # corrections: each leaves a tenth, and then nothing changes any more


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle()


@pytest.fixture(scope="module")
def flight(vehicle):
    return vehicle.record()


@pytest.fixture
def converged(monkeypatch):
    """Steps of the model solved to convergence, as those of the vehicle are."""
    monkeypatch.setattr(kinematic_run, "CORRECTIONS", CONVERGED)


def missing(record, at, names=STATES):
    """The record with these samples not measured."""
    columns = {name: record[name].copy() for name in names}
    for column in columns.values():
        column[list(at)] = np.nan
    return record.with_signals({s: s.unit for s in record.signals if str(s) in columns}, **columns)


# --- what is identified --------------------------------------------------------------------------


def test_the_number_of_coefficients():
    kin = idn.KinematicARX(
        CONTROLS, "airspeed_command", na=2, nb=2, basis=idn.Polynomial(2, 0.0, 13.0)
    )
    assert kin.n_regressors == (6 * 2 + 4 * 2) * 3 + 3 + 3 == 66
    leaner = replace(kin, na={"p": 2, "q": 2}, offset_rate=False)  # the others have one lag
    assert leaner.na == (1, 1, 1, 2, 2, 1)
    assert leaner.n_regressors == (8 + 4 * 2) * 3 + 3


@pytest.mark.slow(but="options0")
@pytest.mark.parametrize(
    "options", [dict(), dict(na=1, nb=1), dict(degree=2), dict(na={"q": 3}, nb=1)]
)
def test_coefficients_come_back_from_a_flight_without_noise(options):
    vehicle = Vehicle(**options)
    record = vehicle.record(900)
    found = idn.fit(vehicle.kin, record)
    condition = found.aerodynamics.excitation.condition
    # the data are known to eps, T is a difference of numbers up to 3.5, and the regressors scaled
    # to one tell the least direction apart by 1 / condition
    scale = np.abs(vehicle.theta).max()
    assert np.abs(found.theta - vehicle.theta).max() < 20 * np.finfo(float).eps * condition * scale
    # one step of two corrections instead of a converged one: (dt/2 |rates|)^3 of the step's turn
    assert min(found.score(record, 1).values()) > 99.99


def test_attitude_is_known_without_coefficients(vehicle, flight):
    T = increments(flight.columns(STATES), DT)
    assert np.isnan(T[0]).all()
    used = slice(vehicle.kin.memory, None)
    assert np.abs(T[used, 6:]).max() < 1e-15  # solved to convergence: a rounding of angles of 0.1
    prepared = vehicle.kin.aerodynamics.prepared(flight)
    np.testing.assert_array_equal(prepared.columns(map(str, INCREMENTS))[1:], T[1:, :6])
    assert vehicle.kin.aerodynamics.prepared(prepared) is prepared


def test_recursive_and_batch_least_squares_agree(vehicle, flight):
    batch, recursive = (idn.fit(vehicle.kin, flight, method=m) for m in ("ls", "rls"))
    condition = batch.aerodynamics.excitation.condition
    bound = 20 * np.finfo(float).eps * condition**1.5 * np.abs(batch.theta).max()
    assert np.abs(batch.theta - recursive.theta).max() < bound


def test_what_a_record_lacks_is_named(vehicle, flight):
    with pytest.raises(UnknownNameError, match="theta"):
        idn.fit(vehicle.kin, flight.select([s for s in map(str, flight.signals) if s != "theta"]))
    used = flight.select([*STATES, *CONTROLS, "airspeed_command"])
    signals = tuple(Signal("u", "m") if s == "u" else s for s in used.signals)
    lengths = FlightRecord(used.time, used.columns(map(str, used.signals)), signals)
    with pytest.raises(InputError, match="u is in m; kinematics need it in m/s"):
        idn.fit(vehicle.kin, lengths)
    with pytest.raises(InputError, match="a state of the body cannot be an input"):
        idn.KinematicARX(("d_lon", "theta"), "p", basis=idn.Polynomial(1, 0.0, 1.0))
    with pytest.raises(InputError, match="at least one lag"):
        idn.KinematicARX("d_lon", "p", na={"w": 0}, basis=idn.Polynomial(1, 0.0, 1.0))


# --- along a record ------------------------------------------------------------------------------


def test_predictions_are_those_of_stepping_one_sample_at_a_time(vehicle, flight, converged):
    """The vehicle's own loop, from the measured past: the same numbers by another route."""
    model = vehicle.model(flight)
    y, u, p = flight.columns(STATES), flight.columns(CONTROLS), flight["airspeed_command"]
    f = vehicle.kin.aerodynamics.basis(p)
    for horizon in (1, 7):
        guess = model.predict(flight, horizon)
        first = vehicle.kin.memory - 1 + horizon
        assert np.isnan(guess[:first]).all()
        assert np.isfinite(guess[first:]).all()
        for k in (first, 100, len(y) - 1):
            past = y[: k + 1].copy()
            for j in range(k - horizon + 1, k + 1):
                past[j] = vehicle.advanced(j, past, u, p, f[j])
            np.testing.assert_allclose(guess[k], past[k], rtol=1e-13, atol=1e-14)


def test_two_corrections_leave_the_cube_of_a_turn(vehicle, flight):
    """The trapezoid's equation y = a + h k(y) by iteration: an error of (h |k'|)^3 of the first
    guess.
    """
    y = flight.columns(STATES)
    error = np.abs(vehicle.model(flight).predict(flight, 1) - y)[vehicle.kin.memory :]
    turn = 0.5 * DT * (np.abs(y[:, 3:6]).max() * 2 + 9.81 * 0.5 * DT + 0.3)
    step = np.abs(np.diff(y, axis=0)).max()
    assert 0 < error.max() < turn**3 * step * 3


@pytest.mark.slow
def test_free_run_and_closed_loop_reproduce_the_flight(vehicle, flight, converged):
    model = vehicle.model(flight)
    y, first = flight.columns(STATES), vehicle.kin.memory
    for run in (model.simulate(flight), model.closed_loop(flight, Pilot())):
        assert np.isnan(run[:first]).all()
        # roundings of 600 steps, in a loop whose slowest mode forgets within a second or two
        np.testing.assert_allclose(run[first:], y[first:], atol=1e-11)
    assert min(model.score(flight, None).values()) > 100 - 1e-8


def test_in_the_loop_nothing_measured_is_used(vehicle, flight):
    """Other measurements after the first samples change nothing but the reference of the score."""
    model = vehicle.model(flight)
    blur = 0.01 * np.sin(np.arange(len(flight))) * (np.arange(len(flight)) > 5)
    blurred = flight.with_signals(
        {s: s.unit for s in flight.signals if str(s) in STATES},
        **{s: flight[s] + blur for s in STATES},
    )
    np.testing.assert_array_equal(
        model.closed_loop(blurred, Pilot()), model.closed_loop(flight, Pilot())
    )


def test_a_replay_flies_a_controller_with_its_state_inside_or_outside(vehicle, flight):
    """The attitude answered is filtered: half of it is new at every sample."""

    class Outside:
        def init(self):
            return np.zeros(4)

        def step(self, state, *asked):
            u = 0.5 * (state + Pilot().step(*asked))
            return u, u

    class Inside:
        def reset(self):
            self.state = np.zeros(4)

        def step(self, *asked):
            u, self.state = Outside().step(self.state, *asked)
            return u

    model = vehicle.model(flight)
    outside, inside = Outside(), Inside()
    runs = [model.closed_loop(flight, c) for c in (outside, inside, inside, outside)]
    for run in runs[1:]:
        np.testing.assert_array_equal(run, runs[0])
    assert np.isfinite(runs[0][vehicle.kin.memory :]).all()


def test_a_closed_loop_needs_its_controller_and_its_reference(vehicle, flight):
    model = vehicle.model(flight)
    with pytest.raises(InputError, match="name the controller of the flight"):
        model.closed_loop(flight)
    bare = flight.select([*STATES, *CONTROLS, "airspeed_command"])
    with pytest.raises(InputError, match="needs the trim that was followed"):
        model.closed_loop(bare, Pilot())


def test_nothing_reaches_across_a_gap_or_a_missing_sample(vehicle, flight):
    model, memory = vehicle.model(flight), vehicle.kin.memory
    parts = flight.rows(np.arange(len(flight)) < 250), flight.rows(np.arange(len(flight)) >= 260)
    gap = flight.rows((np.arange(len(flight)) < 250) | (np.arange(len(flight)) >= 260))
    for horizon in (1, 5):
        apart = np.vstack([model.predict(part, horizon) for part in parts])
        np.testing.assert_array_equal(model.predict(gap, horizon), apart)
    np.testing.assert_array_equal(
        model.simulate(gap), np.vstack([model.simulate(part) for part in parts])
    )
    np.testing.assert_array_equal(
        model.closed_loop(gap, Pilot()),
        np.vstack([model.closed_loop(part, Pilot()) for part in parts]),
    )
    np.testing.assert_allclose(
        idn.fit(vehicle.kin, gap).theta, idn.fit(vehicle.kin, parts).theta, rtol=0, atol=1e-15
    )
    holed = missing(flight, [300])
    lost = np.isnan(model.predict(holed, 1)).any(axis=1)
    assert np.flatnonzero(lost).tolist() == [*range(memory), *range(301, 301 + memory)]
    fit = idn.fit(vehicle.kin, holed)
    # 300 itself, and the samples whose increment or past it enters
    assert fit.aerodynamics.rows_dropped == memory + 1 + memory
    assert np.abs(fit.theta - vehicle.theta).max() < 1e-12


def test_a_run_that_leaves_all_bounds_is_infinite_to_the_end(vehicle, flight):
    wild = vehicle.theta.copy()
    wild[: 6 * vehicle.kin.basis.size] += 3.0
    model = vehicle.model(flight, wild)
    run = model.simulate(flight)
    start = int(np.flatnonzero(np.isinf(run).all(axis=1))[0])
    assert np.isinf(run[start:]).all()
    assert np.isfinite(run[vehicle.kin.memory : start]).all()


def test_another_sample_period_or_unit_is_refused(vehicle, flight):
    model = vehicle.model(flight)
    with pytest.raises(InputError, match="the model was identified at dt ="):
        model.predict(flight.rows(np.arange(len(flight)) % 2 == 0), 1)


# --- for design ----------------------------------------------------------------------------------


class Balanced:
    """A model whose equilibrium is u = v = .. = 0 at every p: deviations are the states."""

    p = 3.0

    def __init__(self, vehicle, flight):
        theta = vehicle.theta.copy()
        offset = next(
            i for i, e in enumerate(vehicle.kin.aerodynamics.entries) if e.kind == "offset"
        )
        size = vehicle.kin.basis.size
        theta[offset * size :] = 0.0
        points = np.linspace(0.0, 10.0, size)
        weight = np.tile(np.append(-DT * G, np.zeros(3)), (size, 1))
        theta[offset * size : (offset + 1) * size] = vehicle.kin.basis.fit(points, weight)
        self.model = replace(vehicle.model(flight, theta), trim=np.zeros((size, 8)))
        self.flight = flight

    def response(self, size, moving):
        """A record of the model's own free run, deviations of `size`."""
        n, rng = 120, np.random.default_rng(3)
        record = self.flight.rows(np.arange(len(self.flight)) < n)
        y = size * rng.normal(size=(n, 8))
        u = 0.1 * size * np.repeat(rng.normal(size=(n // 5, 4)), 5, axis=0)
        p = record["airspeed_command"] if moving else np.full(n, self.p)
        columns = dict(zip((*STATES, *CONTROLS), np.column_stack([y, u]).T, strict=True))
        units = {s: s.unit for s in record.signals if str(s) in columns}
        start = record.with_signals(
            units | {"airspeed_command": "m/s"}, **columns, airspeed_command=p
        )
        run, first = self.model.simulate(start), self.model.structure.memory
        y[first:] = run[first:]
        columns = dict(zip(STATES, y.T, strict=True))
        return start.with_signals({s: u for s, u in units.items() if str(s) in STATES}, **columns)


def misfit(model, record, matrices_at):
    """Largest |x(k+1) - A x(k) - B u(k)| over states along a record, matrices at p of k + 1."""
    x, u, p = model.states(record), record.columns(CONTROLS), record["airspeed_command"]
    out = 0.0
    for k in range(model.structure.memory, len(x) - 1):
        A, B = matrices_at(p[k + 1])
        out = max(out, np.abs(x[k + 1] - A @ x[k] - B @ u[k]).max())
    return out


@pytest.mark.slow(but="True")
@pytest.mark.parametrize("moving", [False, True])
def test_the_state_space_is_the_nonlinear_step_for_small_deviations(
    vehicle, flight, converged, moving
):
    """In every state, remembered ones too; what is left falls with the square of the deviation."""
    balanced = Balanced(vehicle, flight)
    model = balanced.model
    whole = model.to_state_space()
    assert tuple(map(str, whole.states)) == tuple(map(str, model.at(3.0).states))

    def matrices(p):
        at = whole.at(p)
        return at.A, at.B

    large, small = (
        misfit(model, balanced.response(size, moving), matrices) for size in (1e-3, 1e-4)
    )
    assert 0 < large < 1e-4
    assert 80 < large / small < 125  # 100 but for the next order
    if not moving:
        held = model.at(balanced.p)
        assert misfit(
            model, balanced.response(1e-4, moving), lambda p: (held.A, held.B)
        ) == pytest.approx(small, rel=1e-6)


def test_the_matrices_are_finite_differences_of_the_step(vehicle, flight, converged):
    """About an equilibrium that flies: forward speed, pitch and bank."""
    model = vehicle.model(flight)
    size, p = vehicle.kin.basis.size, 4.0
    f = vehicle.kin.basis(np.array([p]))[0]
    y = np.array([4.0, 0.3, 0.2, 0, 0, 0, 0.05, -0.08])
    trim = np.zeros((size, 8))
    trim += np.outer(f, y) / (f @ f)  # f @ trim = y
    model = replace(model, trim=trim)
    still = flight.with_signals({"airspeed_command": "m/s"}, airspeed_command=np.full(600, p))
    run = model._along(still)
    names = [str(s) for s in model.at(p).states]
    memory = vehicle.kin.memory

    # an equilibrium of the aerodynamics too: c(p) makes up for kinematics, damping and inputs
    lagged = np.concatenate([y[:6], np.zeros(4)])[run.columns]
    balance = -DT * kinematic_rates(y)[:6] - lagged @ run.C[5]
    run = replace(run, known=run.known * 0 + balance)

    def step(x, u):
        state, past_u = dict(zip(names, x, strict=True)), [u]
        past = [x[:8]]
        for back in range(1, memory):
            older = np.append([state[f"{s}_lag{back}"] for s in STATES[:6]], [0.0, 0.0])
            past.append(older)
            past_u.append(np.array([state[f"{c}_lag{back}"] for c in CONTROLS]))
        return run.step(5, past, past_u)

    at_rest = dict.fromkeys(CONTROLS, 0.0) | dict(zip(STATES, y, strict=True))
    x0 = np.array([at_rest[name.partition("_lag")[0]] for name in names])
    np.testing.assert_allclose(step(x0, np.zeros(4)), y, atol=1e-14)
    h = 1e-6  # central differences: h^2 of the third derivative, 1e-12, and eps / h = 2e-10
    found = model.at(p)
    for i in range(len(names)):
        e = h * (np.arange(len(names)) == i)
        slope = (step(x0 + e, np.zeros(4)) - step(x0 - e, np.zeros(4))) / (2 * h)
        np.testing.assert_allclose(found.A[:8, i], slope, atol=2e-8)
    for i in range(4):
        e = h * (np.arange(4) == i)
        slope = (step(x0, e) - step(x0, -e)) / (2 * h)
        np.testing.assert_allclose(found.B[:8, i], slope, atol=2e-8)


def test_polynomials_of_the_state_space_are_exact_at_every_p(vehicle, flight):
    model = vehicle.model(flight)
    whole, part = model.to_state_space(), model.to_state_space(["v", "p", "r", "phi"], ["d_lat"])
    for p in np.random.default_rng(0).uniform(0, 10, 7):
        exact, found = model.at(p), whole.at(p)
        size = np.abs(exact.A).max()
        assert np.abs(found.A - exact.A).max() < 1e-9 * size  # what interpolation stops at
        assert np.abs(found.B - exact.B).max() < 1e-9 * size
        kept, some = model.at(p, outputs=["v", "p", "r", "phi"], inputs=["d_lat"]), part.at(p)
        assert some.states == kept.states
        np.testing.assert_allclose(some.A, kept.A, atol=1e-9 * size)
    with pytest.raises(InputError, match="leave at least one parameter moving"):
        model.to_state_space(held={"airspeed_command": 3.0})


def test_remembered_states_are_the_samples_their_names_say(vehicle, flight):
    model = vehicle.model(flight)
    x = model.states(flight)
    for i, name in enumerate(map(str, model.at(2.0).states)):
        signal, _, back = name.partition("_lag")
        back = int(back or 0)
        assert np.isnan(x[:back, i]).all()
        np.testing.assert_array_equal(x[back:, i], flight[signal][: len(flight) - back])


def test_scores_are_those_of_its_predictions_at_every_horizon(vehicle, flight):
    model = vehicle.model(flight)
    found = idn.scores(model, flight, horizon=10 * DT)
    for fits, horizon in ((found.one_step, 1), (found.ahead, 10), (found.free_run, None)):
        assert fits == {str(y): v for y, v in model.score(flight, horizon).items()}
    beside = idn.judge.compare_baseline({"own": model}, {}, flight, ("phi", "u"), horizon=10 * DT)
    (own,) = beside.predictions
    assert own.scores.ahead == {y: found.ahead[y] for y in ("phi", "u")}
    with pytest.raises(InputError, match="hold_p: a KinematicModel"):
        idn.scores(model, flight, hold_p=True)


@pytest.mark.parametrize("name", ["riv", "bj"])
def test_methods_that_simulate_lagged_outputs_are_refused(vehicle, flight, name):
    with pytest.raises(InputError, match="KinematicARX has none"):
        idn.fit(vehicle.kin, flight, method=name)


def test_predictions_from_an_angle_that_is_missing_are_unknown(vehicle, flight):
    guess = vehicle.model(flight).predict(missing(flight, [300], ["phi"]), 5)
    lost = np.flatnonzero(np.isnan(guess).any(axis=1))
    assert {*range(305, 305 + vehicle.kin.memory)} <= {*lost.tolist()}
    assert not np.isinf(guess).any()
