"""A certificate says what was done: the solver's settings that were used, and no verdict that was
not reached.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import constant, lag, spring

from symheli import LPVStateSpace, Scheduling
from symheli.errors import CertificateError, InputError
from synthesis import Solver, decay_rate, l2_gain, lft_gain, stability
from synthesis.analysis import Status, energy_to_peak, lft_stability
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares
from synthesis.numerics.program import cone_program

COARSE = Spline(segments=2, degree=2)
SOS = {"form": Spline(degree=1, segments=1), "impose": SumOfSquares()}


@pytest.mark.parametrize("name", ["CLARABEL", "SCS", "CVXOPT", "MOSEK", "SDPA", "COPT"])
def test_every_setting_reaches_the_solver_or_is_refused(name, monkeypatch):
    monkeypatch.setattr(cone_program, "installed_solvers", lambda: tuple(cone_program._PACKAGES))
    usual = Solver(name)
    # SCS is a first-order method
    assert usual.tolerance == (1e-5 if name == "SCS" else 1e-8)
    own = Solver(name, tolerance=1e-4, iterations=17)
    assert set(own.options.values()) >= {1e-4, 17}
    # a limit in seconds is the user's own: without one nothing depends on the machine
    assert usual.time_limit is None
    assert usual.options.keys() == own.options.keys()
    if name in ("CVXOPT", "SDPA"):
        with pytest.raises(InputError, match=f"{name} has no option for time_limit"):
            Solver(name, time_limit=3.0)
    else:
        (limit,) = Solver(name, time_limit=3.0).options.keys() - usual.options.keys()
        assert Solver(name, time_limit=3.0).options[limit] == 3.0
    for wrong in (
        {"tolerance": 0.0},
        {"tolerance": 1.0},
        {"iterations": 0},
        {"tolerance": float("nan")},
    ):
        with pytest.raises(InputError, match="expected 0 < tolerance < 1"):
            Solver(name, **wrong)


def test_what_is_printed_is_what_the_solver_was_given(monkeypatch):
    scs = pytest.importorskip("scs")
    given, genuine = {}, scs.SCS

    def spy(data, cone, **options):
        given.update(options)
        return genuine(data, cone, **options)

    monkeypatch.setattr(scs, "SCS", spy)
    assert (
        "tolerance 1e-05, at most 20000 iterations, no time limit"
        in l2_gain(lag(), form=COARSE, solver="SCS", search=None).solver
    )
    assert given == {
        "verbose": False,
        "eps_abs": 1e-5,
        "eps_rel": 1e-5,
        "max_iters": 20000,
    }
    sharp = l2_gain(
        lag(), form=COARSE, solver=Solver("SCS", tolerance=1e-7, iterations=300), search=None
    )
    assert "tolerance 1e-07, at most 300 iterations" in sharp.details
    assert (given["eps_abs"], given["eps_rel"], given["max_iters"]) == (1e-7, 1e-7, 300)


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("CLARABEL", "MaxTime"),
        ("SCS", "reached time_limit_secs"),
        ("LYAPUNOV", "out of time after 0 iterations"),
    ],
)
def test_a_solve_that_a_limit_of_the_user_ended_says_so(name, word):
    if name == "SCS":
        pytest.importorskip("scs")
    cut = l2_gain(lag(), form=COARSE, solver=Solver(name, time_limit=1e-6), search=None)
    assert all(word in str(attempt) for attempt in cut.attempts)
    assert word in cut.details
    assert "1e-06 s" in cut.solver
    assert cut.verified == (cut.status is Status.PROVEN)
    assert word not in l2_gain(lag(), form=COARSE, solver=name, search=None).details


@pytest.mark.parametrize("analysis", [l2_gain, stability, energy_to_peak, decay_rate])
def test_what_was_never_tried_has_not_failed(analysis, monkeypatch):
    monkeypatch.setattr(cone_program, "MAX_BYTES", 1.0)
    for options in ({"form": COARSE}, SOS):
        cert = analysis(spring(damping=0.4), 0.1, **options, search=None)
        assert cert.status is Status.UNTRIED
        assert "not tried: the programs of this form are too large" in cert.details
        assert "solver failed" not in cert.details
        assert not cert.verify()


def test_an_lft_program_that_was_never_tried_has_not_failed(monkeypatch):
    monkeypatch.setattr(cone_program, "MAX_BYTES", 1.0)
    for analysis in (lft_gain, lft_stability):
        assert analysis(spring(damping=0.4).to_lft().reduce(), search=None).status is Status.UNTRIED


def chain(pole, n=6, coupling=1.0):
    """n equal poles in a row: eigenvalues are wrong by the n-th root of the rounding."""
    rng = np.random.default_rng(0)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0]
    A = T @ (pole * np.eye(n) + coupling * np.eye(n, k=1)) @ T.T
    return constant(A, T[:, -1:], T[:, :1].T, [[0.0]])


def test_the_rounding_of_an_eigenvalue_makes_no_plant_unstable():
    lpv = chain(-1e-5, n=4)
    # the computed eigenvalues say so; the poles are at -1e-5
    assert np.linalg.eigvals(lpv.matrices(0.5).A).real.max() > 0
    certs = [
        l2_gain(lpv, form=COARSE, search=None),
        l2_gain(lpv, **SOS, search=None),
        stability(lpv, form=COARSE, search=None),
    ]
    certs += [
        stability(lpv, **SOS, search=None),
        lft_gain(lpv.to_lft().reduce(), search=None),
    ]
    certs += [
        energy_to_peak(lpv, **SOS, search=None),
        decay_rate(lpv, **SOS, search=None),
    ]
    assert all(cert.status is not Status.UNSTABLE for cert in certs), [
        cert.status for cert in certs
    ]
    # and by more than rounding it is
    assert l2_gain(chain(0.1), form=COARSE, search=None).status is Status.UNSTABLE
    assert stability(chain(0.1), **SOS, search=None).status is Status.UNSTABLE


def test_a_decay_that_is_growth_is_never_proven():
    # a frozen decay of 1e-3 and a rate at which x' = A(p) x grows
    A = [np.array([[-1e-3, 1.0], [-1.0, -1e-3]]), np.array([[0.0, 0.0], [-0.9, 0.0]])]
    lpv = LPVStateSpace.polynomial(
        A, [np.eye(2)], [np.eye(2)], [np.zeros((2, 2))], Scheduling("p", "1", -1.0, 1.0, 5.0)
    )
    cert = decay_rate(lpv, **SOS, search=None)
    assert not cert.verified
    assert -1 < cert.alpha < 0  # it says how fast it may grow, and proves no decay
    assert cert.status is Status.GROWTH
    good = decay_rate(lag(), **SOS, search=None)
    with pytest.raises(CertificateError, match="is growth"):
        replace(good, alpha=-0.1)
