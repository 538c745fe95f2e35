"""Modes a hundred times slower than the samples: what noise does to them is foreseen, and where it
drowns them another rate is named.
"""

import numpy as np
import pytest
from known_systems import moving, structure
from scipy.signal import cont2discrete

import identification as idn
from symheli.errors import InputError
from symheli.records import FlightRecord

DT = 0.02


def phugoid(db, omega=0.4, damping=0.1, n=6000, seed=0):
    """A slow mode behind a fast one (6 rad/s), both states of the slow one measured `db` below
    their own variation, 50 Hz.
    """
    A = np.array([[0, 1, 0], [-(omega**2), -2 * damping * omega, 1.0], [0, 0, -6.0]])
    Ad, Bd, *_ = cont2discrete(
        (A, np.array([[0.0], [0.0], [6.0]]), np.eye(3), np.zeros((3, 1))), DT
    )
    rng = np.random.default_rng(seed)
    u, x = np.repeat(rng.choice([-1.0, 1.0], n // 25), 25), np.zeros((n, 3))
    for k in range(1, n):
        x[k] = Ad @ x[k - 1] + Bd[:, 0] * u[k - 1]
    y = x[:, :2] + 10 ** (-db / 20) * x[:, :2].std(axis=0) * rng.standard_normal((n, 2))
    return FlightRecord.from_arrays(
        DT * np.arange(n), dict.fromkeys("yvup", "1"), y=y[:, 0], v=y[:, 1], u=u, p=np.zeros(n)
    )


def found(record, delay):
    """The slow mode of a second-order model, and what is said."""
    model = idn.fit(
        idn.LPVARX(
            ("y", "v"), "u", "p", na=2, nb=2, delay=delay, basis=idn.Polynomial(0, -1.0, 1.0)
        ),
        record,
    )
    report = idn.judge.slow_modes(model, record, points=1)
    return min(report.modes, key=lambda m: abs(m.s)), report


def pole(omega, damping):
    return omega * (-damping + 1j * np.sqrt(1 - damping**2))


@pytest.mark.parametrize(
    ("omega", "damping", "n"),
    [(0.4, 0.1, 6000), (0.15, 0.3, 6000), (0.3, -0.1, 3000), (1.5, 0.3, 6000)],
)
def test_a_mode_that_noise_moves_by_half_its_damping_is_never_called_known(omega, damping, n):
    true = pole(omega, damping)
    for db in (80, 60, 50, 40, 30, 20):
        mode, _ = found(phugoid(db, omega, damping, n), delay=1)
        if not mode.lost:
            assert abs(mode.s - true) < 0.5 * abs(true.real)
        if db == 80:
            assert not mode.lost


@pytest.mark.parametrize("damping", [0.1, 0.3])
def test_the_rate_that_is_named_finds_the_mode(damping):
    record = phugoid(40, 0.4, damping)
    lost, report = found(record, delay=1)
    assert (
        abs(lost.s - pole(0.4, damping)) > 0.4 * damping * 0.4
    )  # the decay is wrong by 40 % and more
    together = round(lost.period / DT)
    assert "NOT known at 50 Hz" in str(report)
    assert f"means of {together} samples, delay 0" in str(report)
    slower = record.decimate(together - 1)  # just slow still, so that it is looked at
    mode, report = found(slower, delay=0)
    assert not report.lost
    assert abs(mode.s - pole(0.4, damping)) < 0.15 * damping * 0.4


def test_the_error_that_is_foreseen_is_the_error_there_is_within_a_factor():
    """Over seeds: the shift by noise that is half undone against the shift itself."""
    foreseen, there = [], []
    for seed in range(8):
        mode, _ = found(phugoid(60, seed=seed), delay=1)
        foreseen.append(mode.shift)
        there.append(abs(mode.s - pole(0.4, 0.1)))
    assert 0.5 < np.median(foreseen) / np.median(there) < 2


def test_the_standard_error_of_a_pole_is_its_scatter():
    """Noise in the equations, white: least squares is unbiased, and its poles scatter as the
    covariance says.
    """
    arx = idn.LPVARX(("y",), ("u",), "p", na=2, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 13.0))
    poles, errors = [], []
    for seed in range(40):
        rng, p = np.random.default_rng(seed), moving(2000)
        u, y = rng.standard_normal(2000), np.zeros(2000)
        for k in range(2, 2000):
            y[k] = (
                (1.985 + 0.0004 * (p[k - 1] - 6.5)) * y[k - 1]
                - 0.99 * y[k - 2]
                + u[k - 1]
                + 0.5 * rng.standard_normal()
            )
        record = FlightRecord.from_arrays(
            0.1 * np.arange(2000), dict.fromkeys("yup", "1"), y=y, u=u, p=p
        )
        model = idn.fit(arx, record)
        mode = max(
            idn.judge.slow_modes(model, record, points=1).modes,
            key=lambda m: abs(m.s),
            default=None,
        )
        if mode is not None:
            poles.append(mode.s)
            errors.append(mode.standard_error)
    assert len(poles) > 35
    assert np.std(poles) == pytest.approx(
        np.median(errors), rel=0.35
    )  # 40 draws, and the tapered correlation


def test_fast_modes_are_none_and_other_estimators_are_refused():
    truth = structure()
    rng, p = np.random.default_rng(0), moving(600)
    u, y = rng.standard_normal(600), np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.5 * y[k - 1] + u[k - 1] + 0.1 * rng.standard_normal()
    record = FlightRecord.from_arrays(
        0.1 * np.arange(600), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    assert str(idn.judge.slow_modes(idn.fit(truth, record), record)) == "slow modes: none"
    with pytest.raises(InputError, match="least squares"):
        idn.judge.slow_modes(idn.fit(truth, record, method="ridge"), record)
