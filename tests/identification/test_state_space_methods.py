"""State-space models by subspace, output error and innovations, beside a simulation that shares no
code with them.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import identification as idn
import synthesis
from identification.estimators.subspace import Piece, subspace_start
from identification.model.state_space_run import StateSpaceRun
from identification.model.time_varying import states_of
from symheli import FlightRecord, TableController
from symheli.errors import ConvergenceWarning, ExcitationError, InputError

OMEGA = np.linspace(0.5, 30.0, 25)
POINTS = (-0.7, 0.0, 0.6)


@dataclass(frozen=True)
class System:
    """Modes of radius .6 to .88 that p moves: contracting, so that every p(k) keeps it bounded."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    K: np.ndarray
    basis: idn.Polynomial

    @classmethod
    def drawn(cls, order, nu, ny, degree, seed):
        rng = np.random.default_rng(seed)
        A0 = np.zeros((order, order))
        for i in range(0, order - 1, 2):
            r, angle = rng.uniform(0.6, 0.88), rng.uniform(0.2, 2.5)
            turn = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            A0[i : i + 2, i : i + 2] = r * np.array(turn)
        if order % 2:
            A0[-1, -1] = rng.uniform(-0.8, 0.8)
        moving = rng.normal(size=(degree, order, order))
        moving *= 0.1 / degree / np.linalg.norm(moving, 2, (1, 2))[:, None, None]
        B = rng.normal(size=(degree + 1, order, nu))
        B[1:] *= 0.3
        C, K = rng.normal(size=(ny, order)), rng.normal(size=(degree + 1, order, ny))
        K *= 0.3 / np.linalg.norm(K) / np.linalg.norm(C)
        A = np.concatenate([A0[None], moving])
        return cls(A, B, C, K, idn.Polynomial(degree, -1.0, 1.0))

    @property
    def structure(self):
        ny, nu = len(self.C), self.B.shape[2]
        names = [f"y{i}" for i in range(ny)], [f"u{i}" for i in range(nu)]
        return idn.StateSpace(*names, "p", order=self.A.shape[1], basis=self.basis)

    def record(self, n, seed, noise=0.0, gain=0.0, offset=None):
        """With innovations of deviation `noise`, in a loop with `gain` from the first output."""
        rng = np.random.default_rng(seed)
        p = np.sin(0.05 * np.arange(n) + seed) * np.cos(0.013 * np.arange(n))
        f, (order, nu), ny = self.basis(p), self.B.shape[1:], len(self.C)
        r, e = rng.normal(size=(n, nu)), noise * rng.normal(size=(n, ny))
        x, y, u = np.zeros(order), np.zeros((n, ny)), np.zeros((n, nu))
        for k in range(n):
            y[k] = self.C @ x + e[k]
            u[k] = r[k] - gain * y[k, 0]
            A, B, K = (np.tensordot(f[k], M, 1) for M in (self.A, self.B, self.K))
            x = A @ x + B @ u[k] + K @ e[k]
            if offset is not None:
                x = x + f[k] @ offset
        columns = {f"y{i}": y[:, i] for i in range(ny)} | {f"u{i}": u[:, i] for i in range(nu)}
        columns |= {"p": p, **{f"r{i}": r[:, i] for i in range(nu)}}
        units = dict.fromkeys(columns, "1")
        return FlightRecord.from_arrays(0.1 * np.arange(n), units, **columns)

    def responses(self):
        """(points, frequencies, ny, nu)"""
        out = []
        for f in self.basis(np.array(POINTS)):
            A, B = np.tensordot(f, self.A, 1), np.tensordot(f, self.B, 1)
            z = np.exp(0.1j * OMEGA)[:, None, None] * np.eye(len(A))
            out.append(self.C @ np.linalg.solve(z - A, np.tile(B, (len(OMEGA), 1, 1))))
        return np.array(out)

    def error(self, model):
        """Largest error of the frozen responses, as a share of the largest response."""
        exact = self.responses()
        found = np.array([model.at(p).frequency_response(OMEGA) for p in POINTS])
        return np.abs(found - exact).max() / np.abs(exact).max()


CASES = [(2, 1, 1, 1), (3, 1, 2, 2), (4, 2, 1, 1), (5, 3, 2, 1), (6, 2, 2, 2), (8, 3, 2, 1)]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["oe", "innovations"])
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("case", CASES)
def test_systems_without_noise_are_recovered_exactly(case, seed, method):
    system = System.drawn(*case, seed)
    kind = {"oe": idn.methods.OutputError, "innovations": idn.methods.Innovations}[method]
    record = system.record(1200, seed)
    found = idn.fit(system.structure, record, kind(tolerance=1e-13, evaluations=400))
    assert system.error(found) < 1e-6
    assert found.predict(record, 1).shape == (1200, case[2])


def test_the_subspace_start_alone_is_exact_where_nothing_moves():
    system = System.drawn(4, 2, 2, 1, 0)
    system = replace(system, A=system.A[:1], B=system.B[:1], K=system.K[:1])
    system = replace(system, basis=idn.Polynomial(0, -1.0, 1.0))
    found = idn.fit(system.structure, system.record(800, 0), "subspace")
    # eigenvalues of products: half the digits
    assert system.error(found) < 1e-6
    values = found.details["singular_values"]
    assert values[3] > 1e-2
    assert values[4] < 1e-5


@pytest.mark.slow
def test_in_closed_loop_innovations_are_consistent_and_least_squares_is_not():
    """Noise of the system's own colour in a loop: 9 times the samples divide the error of
    innovations by 3, and that of least squares by nothing.
    """
    system = System.drawn(2, 1, 1, 1, 5)
    arx = system.structure.regression
    errors = {"innovations": [], "ls": []}
    for n in (500, 4500):
        records = [system.record(n, seed, noise=1.0, gain=0.15) for seed in range(5)]
        for method, structure in (("innovations", system.structure), ("ls", arx)):
            found = [system.error(idn.fit(structure, record, method)) for record in records]
            errors[method].append(np.mean(found))
    # five seeds: the mean of an error scatters by a third
    assert 1.8 < errors["innovations"][0] / errors["innovations"][1] < 5.0
    assert errors["ls"][0] / errors["ls"][1] < 1.6
    assert errors["innovations"][1] < 0.2 * errors["ls"][1]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["subspace", "innovations"])
def test_an_unstable_plant_is_found_in_its_loop(method):
    """Poles 1.02 to 1.06 and .7, which a free run cannot follow."""
    rng, n = np.random.default_rng(0), 3000
    p, x, y, u = np.sin(0.02 * np.arange(n)), np.zeros(2), np.zeros(n), np.zeros(n)
    for k in range(n):
        e = 0.1 * rng.normal()
        y[k] = x[0] + e
        u[k] = rng.choice([-1.0, 1.0]) - 1.2 * y[k]
        A = np.array([[1.04 + 0.02 * p[k], 0.2], [0.0, 0.7]])
        x = A @ x + np.array([0.1, 0.3]) * u[k] + np.array([0.3, 0.1]) * e
    record = FlightRecord.from_arrays(0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p)
    structure = idn.StateSpace("y", "u", "p", order=2, basis=idn.Polynomial(1, -1.0, 1.0))
    found = idn.fit(structure, record, method)
    for point in (-1.0, 1.0):
        poles = np.sort(np.abs(found.at(point).poles()))
        # 3000 samples: a standard error of .005 of the unstable pole
        assert poles[1] == pytest.approx(1.04 + 0.02 * point, abs=0.02)
        assert poles[0] == pytest.approx(0.7, abs=0.1)


@pytest.mark.slow
def test_regions_of_responses_hold_the_truth_as_often_as_they_say():
    system, held = System.drawn(2, 1, 1, 1, 5), []
    exact = system.responses()[:, ::6]
    for seed in range(20):
        found = idn.fit(system.structure, system.record(800, seed, noise=0.5), "innovations")
        regions = idn.judge.response_regions(found, POINTS, OMEGA[::6])
        held.append(regions.contains(exact).mean())
    # 20 records of about 6 independent responses each: a standard error of 2 %
    assert 0.89 < np.mean(held) < 0.99


@pytest.mark.slow
def test_the_covariance_does_not_depend_on_the_states():
    """Other coordinates of the states: the unknowns and their covariance turn, regions do not."""
    system = System.drawn(2, 1, 1, 1, 5)
    found = idn.fit(system.structure, system.record(400, 0, noise=0.5), "innovations")
    T = np.array([[2.0, 0.3], [-0.4, 0.5]])

    def turned(z):
        A, B, C, D, K = found.run.matrices(z)
        inverse = np.linalg.inv(T)
        return found.run.unknowns(T @ A @ inverse, T @ B, C @ inverse, D, T @ K)

    by = np.array([turned(e) for e in np.eye(found.run.size)]).T
    covariance = by @ found.covariance[0, :, 0] @ by.T
    other = replace(
        found.with_theta(turned(found.unknowns)[:, None]),
        covariance=covariance[None, :, None, :],
    )
    mine, theirs = (
        idn.judge.response_regions(m, POINTS, OMEGA[::6], draws=1000) for m in (found, other)
    )
    np.testing.assert_allclose(theirs.centre, mine.centre, rtol=1e-8)
    # 1000 draws: a standard error of 2 % each
    np.testing.assert_allclose(theirs.width, mine.width, rtol=0.15)


def test_sensitivities_of_the_filter_are_its_derivatives():
    rng = np.random.default_rng(0)
    structure = idn.StateSpace(
        ("y", "z"), ("u", "v"), "p", order=3, basis=idn.Polynomial(2, -1.0, 1.0), offset=True
    )
    run = StateSpaceRun(replace(structure, feedthrough=True), innovations=True)
    at = np.append(0.15 * rng.normal(size=run.size), rng.normal(size=3))
    u, y, p, h = rng.normal(size=(15, 2)), rng.normal(size=(15, 2)), rng.uniform(-1, 1, 15), 1e-6
    y[4], y[7, 1] = np.nan, np.nan

    def response(z):
        return run.outputs(z[: run.size], z[run.size :], u, p, y)

    differences = np.stack(
        [(response(at + h * e) - response(at - h * e)) / (2 * h) for e in np.eye(len(at))], axis=-1
    )
    exact = run.sensitivities(at[: run.size], at[run.size :], u, p, y)
    # central differences: h^2 and 1e-16 / h
    np.testing.assert_allclose(exact, differences, atol=1e-8 * np.abs(exact).max())


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 3), (37, 1), (100, 2), (20, 400)])
def test_blocks_of_a_recursion_are_the_recursion(n, m):
    rng = np.random.default_rng(n)
    A, F, X = rng.normal(size=(n, 3, 3)) / 2, rng.normal(size=(n, 3, m)), rng.normal(size=(3, m))
    found = states_of(A, F, X)
    for k in range(n):
        np.testing.assert_allclose(found[k], X, rtol=1e-9, atol=1e-9)
        X = A[k] @ X + F[k]
    np.testing.assert_allclose(found[n], X, rtol=1e-9, atol=1e-9)


def test_gaps_in_outputs_are_run_through_and_records_are_joined():
    """A quarter of the outputs is missing in blocks, one channel for longer: recovered still, and
    in a gap the predictions are the free run of the innovation filter.
    """
    system = System.drawn(3, 1, 2, 1, 1)
    records = [system.record(600, seed) for seed in (0, 1)]
    holed = []
    for record in records:
        y0, y1 = record["y0"].copy(), record["y1"].copy()
        for first in range(40, 600, 80):
            y0[first : first + 20] = np.nan
        y1[200:260] = np.nan
        holed.append(record.with_signals({"y0": "1", "y1": "1"}, y0=y0, y1=y1))
    found = idn.fit(system.structure, holed, idn.methods.Innovations(tolerance=1e-13))
    assert system.error(found) < 1e-6
    ahead = found.predict(holed[0], 1)
    assert np.isfinite(ahead).all()
    np.testing.assert_allclose(ahead[240:260], records[0].columns(["y0", "y1"])[240:260], atol=1e-5)


def test_a_slow_sensor_leaves_a_gap_each_time():
    system = System.drawn(3, 1, 2, 1, 1)
    record = system.record(900, 0)
    slow = np.where(np.arange(900) % 4 == 0, record["y1"], np.nan)
    found = idn.fit(
        system.structure,
        record.with_signals({"y1": "1"}, y1=slow),
        idn.methods.OutputError(tolerance=1e-13),
    )
    assert system.error(found) < 1e-6


def test_predictions_h_steps_ahead_use_nothing_later():
    system = System.drawn(2, 1, 1, 1, 3)
    record = system.record(300, 0, noise=0.3)
    found = idn.fit(system.structure, record, "innovations")
    ahead = found.predict(record, 5)
    later = record["y0"].copy()
    later[200:] += 10.0
    moved = found.predict(record.with_signals({"y0": "1"}, y0=later), 5)
    # the start, which all of y determines, has decayed by then
    np.testing.assert_allclose(moved[60:205], ahead[60:205], atol=1e-6)
    assert np.abs(moved[205] - ahead[205]).max() > 0.1
    assert found.score(record, 1)["y0"] >= found.score(record, 5)["y0"] - 1e-9


def test_a_trim_that_moves_with_p_is_an_offset():
    system = System.drawn(3, 1, 2, 1, 2)
    record = system.record(1000, 0, offset=np.array([[0.5, -1.0, 0.3], [0.4, 0.2, -0.6]]))
    structure = replace(system.structure, offset=True)
    found = idn.fit(structure, record, idn.methods.OutputError(tolerance=1e-13))
    assert system.error(found) < 1e-6
    assert system.error(idn.fit(system.structure, record, "subspace")) > 1e-3


@pytest.mark.slow
def test_the_order_scan_finds_order_and_degree():
    system = System.drawn(3, 2, 1, 1, 4)
    records = [system.record(900, seed, noise=0.3) for seed in (0, 1)]
    scan = idn.order_scan(
        system.structure, *records, orders=(1, 2, 3), degrees=(0, 1), horizon=5, method="oe"
    )
    assert (scan.best("free_run").na, scan.best("free_run").degree) == (3, 1)
    assert "free run" in str(scan)


@pytest.mark.slow
def test_a_model_is_judged_fit_and_its_loop_is_proven():
    system = System.drawn(2, 1, 1, 1, 5)
    record = system.record(3000, 0, noise=0.3)
    found = idn.fit(system.structure, record, "innovations")
    judged = idn.fit_for_control(
        found,
        record,
        {("u0", "y0"): -0.05},
        scales={"y0": 2.0, "u0": 2.0},
        points=list(POINTS),
        window=8.0,
        horizon=1.0,
        draws=50,
    )
    assert judged.verdict == "fit"
    assert judged["nu-gap over margin"].value < 1 / 3
    assert idn.judge.frozen_stability(found, POINTS, draws=50).calls == ("stable",) * 3
    plant = synthesis.Plant(
        found.state_space,
        disturbances=[],
        performance=["y0", "u0"],
        controls=["u0"],
        measurements=["y0"],
    )
    plant = plant.with_input_disturbance().with_noise({"y0": 0.1})
    design = synthesis.output_feedback(plant, X=0, Y=0)
    table = TableController.of(design, 5)
    proof = synthesis.certify_sampled(table, plant, np.inf, promised=design.promised, search=None)
    # the table is straight between its nodes
    assert 0.5 * design.promised < proof.gamma < 1.05 * design.promised


def test_a_filter_is_stable_in_corners_that_the_record_does_not_visit():
    """p stays within a third of its range: what K would be at the ends is drawn in."""
    system = System.drawn(2, 1, 1, 1, 5)
    record = system.record(300, 2, noise=0.5)
    structure = replace(system.structure, basis=idn.Polynomial(1, -3.0, 3.0))
    found = idn.fit(structure, record, "innovations")
    A, _, C, _, K = found.run.matrices(found.unknowns)
    for p in (-3.0, 0.0, 3.0):
        at = np.tensordot(structure.basis(p), A - K @ C, 1)
        assert np.abs(np.linalg.eigvals(at)).max() < 1.0


@pytest.mark.parametrize(
    ("what", "error", "says"),
    [
        (lambda s, r: idn.fit(s, r, "ls"), InputError, "closest free run"),
        (lambda s, r: idn.fit(s, r, "bj"), InputError, "closest free run"),
        (lambda s, r: idn.fit(s.regression, r, "subspace"), InputError, "finds states"),
        (lambda s, r: idn.fit(s.regression, r, "innovations"), InputError, "armax"),
        (
            lambda s, r: idn.fit(s, r, idn.methods.OutputError("u0")),
            InputError,
            "of difference equations",
        ),
        (
            lambda s, r: idn.fit(s, r, idn.methods.OutputError(initial="measured")),
            InputError,
            "estimated start",
        ),
        (lambda s, r: idn.methods.Subspace(past=0), InputError, "past"),
        (lambda s, r: idn.methods.Innovations(evaluations=0), InputError, "evaluations"),
        (
            lambda s, r: idn.fit(replace(s, order=4), r, idn.methods.Subspace(past=1)),
            InputError,
            "at least 4 samples",
        ),
        (
            lambda s, r: idn.fit(s, r, idn.methods.Subspace(past=600)),
            ExcitationError,
            "windows of 602 samples",
        ),
        (
            lambda s, r: idn.fit(s, r.with_signals({"u0": "1"}, u0=0.0 * r["u0"])),
            ExcitationError,
            "u0",
        ),
        (
            lambda s, r: idn.fit(
                replace(s, scheduling="y0", own_scheduling=True), r, "innovations"
            ),
            InputError,
            "own free run",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_words(what, error, says):
    system = System.drawn(2, 1, 1, 1, 3)
    with pytest.raises(error, match=says):
        what(system.structure, system.record(500, 0, noise=0.1))


def test_a_search_that_ends_early_warns():
    system = System.drawn(4, 1, 1, 1, 3)
    with pytest.warns(ConvergenceWarning, match="did not settle"):
        idn.fit(system.structure, system.record(500, 0), idn.methods.OutputError(evaluations=1))


def test_singular_values_fall_behind_the_order():
    system = System.drawn(3, 1, 1, 1, 7)
    record = system.record(2000, 0, noise=0.05)
    structure = system.structure
    piece = Piece(record.columns(["y0"]), record.columns(["u0"]), record["p"])
    values = subspace_start(structure, [piece], 10).singular_values
    assert values[2] > 2.0 * values[3]
