"""No solver, scaling or option makes an unstable plant stable, and no certificate survives
tampering.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from models import forged, lag, random_stable, searched, spring

import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, SolverError
from synthesis import Solver, l2_gain, stability
from synthesis.analysis import Status, installed_solvers
from synthesis.certify.statement.spline import SplineLyapunov
from synthesis.forms import Spline

COARSE = Spline(segments=2, degree=2)
EVERY = (*installed_solvers(), "LYAPUNOV")
NAMED = {"LYAPUNOV": "interior-point method for Lyapunov inequalities"}
"""In certificates, where not as it is asked for."""


def unstable(excess, scale, dt=None):
    """A pole at `excess` in the middle of the range only (p = 0.5), stable at its ends; states
    scaled.
    """
    A0 = np.array([[excess - 0.25, 1.0], [0.0, -1.0]])
    A1, A2 = np.diag([1.0, 0.0]), np.diag([-1.0, 0.0])
    T = np.diag([scale, 1.0])
    A = [T @ M @ np.linalg.inv(T) for M in (A0, A1, A2)]
    if dt is not None:
        A = [np.eye(2) + dt * A[0], dt * A[1], dt * A[2]]
    B, C = T @ np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]) @ np.linalg.inv(T)
    return LPVStateSpace.polynomial(
        A, [B], [C], [np.zeros((1, 1))], Scheduling("p", "1", 0.0, 1.0, 0.1), dt=dt
    )


SCALES, EXCESSES = (1e-4, 1.0, 1e4), (1e-1, 1e-4, 1e-8)


@pytest.mark.slow(but="0.0001-0.1-CLARABEL")
@pytest.mark.parametrize("solver", EVERY)
@pytest.mark.parametrize(("scale", "excess"), zip(SCALES, EXCESSES, strict=True))
def test_an_unstable_plant_is_never_called_stable(solver, scale, excess):
    quick = Solver(solver, iterations=100 if solver == "SCS" else None)
    for dt in (None, 0.1):
        lpv = unstable(excess, scale, dt)
        for cert in (
            stability(lpv, form=COARSE, solver=quick),
            l2_gain(lpv, form=COARSE, solver=quick, search=None),
        ):
            assert not cert.verified
            assert cert.status is Status.UNSTABLE
            assert not cert.verify()
            assert not cert.verify(rigorous=True)
        # and without the look at the frozen poles, the solver and the verification alone
        for kind in ("stability", "l2 gain"):
            for rate in (0.0, 0.1):
                assert searched(lpv, rate, kind, COARSE, solver=quick).proof is None


@pytest.mark.slow(but="CLARABEL")
@pytest.mark.parametrize("solver", EVERY)
def test_a_stable_plant_is_called_stable_by_every_solver(solver):
    for dt in (None, 0.1):
        cert = stability(unstable(-0.05, 10.0, dt), 0.05, form=COARSE, solver=solver)
        assert cert.verified, cert
        assert cert.verify(rigorous=True)
        assert cert.solver.startswith(NAMED.get(solver, solver))


@pytest.mark.slow
def test_solvers_agree_on_the_gain():
    quick = [Solver(name, iterations=2000 if name == "SCS" else None) for name in EVERY]
    gains = [
        l2_gain(random_stable(1), form=COARSE, solver=solver, search=None).gamma for solver in quick
    ]
    # SCS, a first-order method, stops early and comes close from above: gamma is what its P proves
    assert max(gains) <= min(gains) * (1 + 1e-2)


@pytest.mark.slow(but="None")
@pytest.mark.parametrize("dt", [None, 0.1])
def test_exact_arithmetic_confirms_a_good_certificate_and_rejects_a_tampered_one(dt):
    cert = l2_gain(random_stable(2, dt=dt), form=Spline(segments=3, degree=2), search=None)
    assert cert.verify()
    assert cert.verify(rigorous=True)
    P = cert.lyapunov
    assert P is not None
    # at the optimum half a percent is too much to ask; 0.999 of a coefficient breaks a block that
    # binds
    lower = replace(cert, gamma=0.995 * cert.gamma, frozen=0.0, lower=0.0)
    worse = forged(cert, lyapunov=SplineLyapunov(P.knots, P.degree, 0.5 * P.coefficients))
    negative = P.coefficients.copy()
    negative[-1] = -negative[-1]
    for bad in (lower, worse, forged(cert, lyapunov=SplineLyapunov(P.knots, P.degree, negative))):
        assert not bad.verify()
        assert not bad.verify(rigorous=True)


def test_the_fractions_of_the_standard_library_prove_the_same(monkeypatch):
    from fractions import Fraction

    import synthesis.certify.proof.one_parameter

    cert = l2_gain(lag(), form=COARSE, search=None)
    monkeypatch.setattr(synthesis.certify.proof.one_parameter, "rational", lambda: Fraction)
    assert cert.verify(rigorous=True)
    assert not replace(cert, gamma=0.9, frozen=0.0, lower=0.0).verify(rigorous=True)


@pytest.mark.slow
def test_an_infeasible_problem_says_so_and_promises_nothing():
    cert = l2_gain(spring(), math.inf, search=None)
    assert cert.status is Status.INFEASIBLE
    assert math.isinf(cert.gamma)
    assert cert.lyapunov is None
    assert "may still be stable" in cert.details


@pytest.mark.slow
def test_a_certificate_reads_like_a_statement():
    cert = l2_gain(spring(), 0.02, form=COARSE, search=None)
    text = cert.details
    for part in (
        "proven on the whole interval",
        "exogenous",
        "CLARABEL",
        "degree 2 on 2 segment",
        "0.02 per second",
    ):
        assert part in text


def test_wrong_input_gets_a_sentence():
    with pytest.raises(InputError, match="or an LFT, got ndarray"):
        l2_gain(np.eye(2))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rate must be >= 0"):
        l2_gain(lag(), -1.0)
    with pytest.raises(InputError, match="rate must be >= 0"):
        l2_gain(lag(), math.nan)
    with pytest.raises(InputError, match="needs inputs and outputs"):
        l2_gain(replace(lag(), B=lag().B[:, :, :0], D=lag().D[:, :, :0], inputs=()))
    with pytest.raises(SolverError, match="installed here: CLARABEL"):
        l2_gain(lag(), solver="GUROBI")
    with pytest.raises(InputError, match="degree of P"):
        Spline(degree=7)
    with pytest.raises(InputError, match="expected 0 < tolerance"):
        Solver(tolerance=2.0)


def test_importing_loads_no_solver_and_every_name_is_documented():
    import inspect
    import subprocess
    import sys

    code = (
        "import sys, synthesis; print([m for m in ('cvxpy', 'clarabel', 'scs', 'flint', 'casadi',"
        " 'matplotlib') if m in sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )
    for name in synthesis.__all__:
        assert inspect.getdoc(getattr(synthesis, name)), name


@pytest.mark.slow(but="None")
@pytest.mark.parametrize("dt", [None, 0.2])
def test_a_varying_p_of_v_proves_nothing_when_p_may_jump(dt):
    cert = l2_gain(
        spring() if dt is None else spring().discretize(dt), 0.02, form=COARSE, search=None
    )
    assert cert.verify()
    evidence = cert.proof.evidence
    jumping = forged(cert, evidence=evidence._replace(rate=math.inf))
    assert not jumping.verify()
    assert not jumping.verify(rigorous=True)


@pytest.mark.slow
def test_a_model_without_response_has_no_gain():
    cert = l2_gain(replace(lag(), C=0 * lag().C), 1.0, form=COARSE)
    assert cert.frozen == 0.0
    # zero is approached: gamma is what the solver's gap leaves, in units of the input
    assert cert.gamma < 1e-2
