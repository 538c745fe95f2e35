"""State-space models by the closest free run, p measured or their own output."""

import numpy as np
import pytest

import identification as idn
from identification.model.state_space_run import StateSpaceRun
from symheli import FlightRecord
from symheli.errors import InputError

A0, A1 = np.array([[0.9, 0.3], [-0.25, 0.7]]), np.array([[0.03, 0.0], [-0.05, 0.1]])
B = np.array([0.1, 0.5])


def record(own, seed, n=250, noise=0.0):
    """y of x+ = (A0 + p A1) x + B u, p given or the output."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, n // 2), 2)
    p, x, y = np.sin(0.07 * np.arange(n)), np.zeros(2), np.zeros(n)
    for k in range(n):
        y[k] = x[0]
        x = (A0 + (y[k] if own else p[k]) * A1) @ x + B * u[k]
    y += noise * y.std() * rng.normal(size=n)
    return FlightRecord.from_arrays(
        0.1 * np.arange(n), {"y": "m", "u": "1", "p": "1"}, y=y, u=u, p=p
    )


def structure(own, **options):
    basis = idn.Polynomial(1, -8.0, 8.0)
    return idn.StateSpace(
        "y", "u", "y" if own else "p", order=2, basis=basis, own_scheduling=own, **options
    )


@pytest.mark.slow
@pytest.mark.parametrize("own", [False, True])
def test_a_system_of_the_structure_is_recovered_exactly(own):
    """The states may have any basis: poles and the free run on another record are compared."""
    found = idn.fit(structure(own), record(own, 1), idn.methods.OutputError(tolerance=1e-13))
    # the search ends where the squares of residuals no longer change: 1e-13, so that errors of the
    # response are below the square root of that
    assert found.score(record(own, 2))["y"] == pytest.approx(100.0, abs=1e-3)
    for p in (-1.0, 0.5):
        poles = np.sort_complex(found.state_space.at(p).poles())
        np.testing.assert_allclose(
            poles, np.sort_complex(np.linalg.eigvals(A0 + p * A1)), atol=1e-3
        )


@pytest.mark.parametrize("own", [False, True])
def test_sensitivities_are_the_derivatives_of_the_free_run(own):
    rng = np.random.default_rng(0)
    two = idn.StateSpace(
        ("y", "z"),
        ("u", "v"),
        "y" if own else "p",
        order=3,
        basis=idn.Polynomial(2, -6.0, 6.0),
        own_scheduling=own,
        feedthrough=True,
    )
    run = StateSpaceRun(two)
    at = np.append(0.15 * rng.normal(size=run.size), rng.normal(size=3))
    u, p, h = rng.normal(size=(15, 2)), rng.uniform(-1, 1, 15), 1e-6

    def response(z):
        return run.outputs(z[: run.size], z[run.size :], u, p)

    differences = np.stack(
        [(response(at + h * e) - response(at - h * e)) / (2 * h) for e in np.eye(len(at))], axis=-1
    )
    exact = run.sensitivities(at[: run.size], at[run.size :], u, p)
    # central differences: h^2 and 1e-16 / h
    np.testing.assert_allclose(exact, differences, atol=1e-8 * np.abs(exact).max())


@pytest.mark.slow
def test_its_own_schedule_is_what_a_free_run_is_judged_on():
    """With p measured a free run contains the outputs. What the search over the own p makes least
    is what is left where the model runs on its own: the other one leaves more.
    """
    noisy = record(True, 1, n=150, noise=0.2)
    measured = structure(False)
    measured = idn.StateSpace("y", "u", "y", order=2, basis=measured.basis)
    own, other = idn.fit(structure(True), noisy), idn.fit(measured, noisy)
    alone = idn.model.StateSpaceModel(
        structure=structure(True),
        unknowns=other.unknowns,
        state_space=other.state_space,
        residual_covariance=other.residual_covariance,
    )
    assert own.score(noisy)["y"] > alone.score(noisy)["y"]


def test_a_missing_output_is_bridged_and_a_missing_input_cuts_the_run():
    whole = record(False, 1, n=100)
    columns = {
        "y": np.where(np.arange(100) == 30, np.nan, whole["y"]),
        "u": np.where(np.arange(100) == 70, np.nan, whole["u"]),
    }
    holed = whole.with_signals({"y": "m", "u": "1"}, **columns)
    found = idn.fit(structure(False), holed, idn.methods.OutputError(evaluations=300))
    run = found.simulate(holed)
    assert np.isfinite(run[30]).all()
    assert np.isnan(run[70]).all()
    assert found.score(whole)["y"] > 99.9


def test_what_does_not_fit_is_refused():
    with pytest.raises(InputError, match="must be one of the outputs"):
        idn.StateSpace(
            "y", "u", "p", order=1, basis=idn.Polynomial(1, 0.0, 1.0), own_scheduling=True
        )
    with pytest.raises(InputError, match="order"):
        idn.StateSpace("y", "u", order=0)
    with pytest.raises(InputError, match="closest free run"):
        idn.fit(structure(False), record(False, 1), "ls")
