"""How many times its uncertainty a loop bears: published, in closed form, and by brute force."""

import control
import numpy as np
import pytest

from symheli import InputError, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.lpv import connect
from synthesis import robust_margin


def page():
    """18/(s^2 + 1.8 s + k) (1 + 0.5 delta) behind pid(2.3, 3, 0.38, 0.001), k = 10 within 40 %:
    MATLAB's example of robstab, which prints [1.5960, 1.5993].
    """
    k = Scheduling("k", "1", low=6.0, high=14.0)
    plant = LPVStateSpace.from_expressions(
        [[0, 1], [-k.symbol, -1.8]],
        [[0], [18]],
        [[1, 0]],
        [[0]],
        k,
        inputs=["pushed"],
        outputs=["y"],
    )
    s = control.tf("s")
    pid = 2.3 + 3 / s + 0.38 * s / (1 + 0.001 * s)
    loop = connect(
        plant,
        {("error", "v"): pid},
        inputs=["r", "d"],
        outputs=["y", "v"],
        sums={"error": {"r": 1, "y": -1}, "pushed": {"v": 1, "d": 1}},
    )
    return UncertainStateSpace(loop, ["d"], ["v"], 0.5, 1.0, "the page of robstab")


@pytest.fixture(scope="module")
def found():
    return robust_margin(page())


@pytest.mark.slow
def test_the_page_of_robstab_is_met_by_one_call(found):
    assert 1.5960 <= found.upper <= 1.5993
    assert 0.99 * found.upper <= found.lower < found.upper


@pytest.mark.slow
def test_the_upper_bound_is_where_brute_force_loses_the_loop(found):
    """|M_k(j omega)| 0.5 r = 1 for the worst k within r 40 % of 10, over grids of both."""
    omega = np.geomspace(1.0, 100.0, 20001)
    s = 1j * omega
    C = 2.3 + 3 / s + 0.38 * s / (1 + 0.001 * s)

    def lost(r):
        k = np.linspace(10 - 4 * r, 10 + 4 * r, 41)[:, None]
        G = 18 / (s**2 + 1.8 * s + k)
        return np.abs(C * G / (1 + C * G)).max() * 0.5 * r >= 1

    assert lost(1.0005 * found.upper)  # both grids are fine
    assert not lost(0.9995 * found.upper)


def test_the_closed_form_of_one_state():
    """x' = -(1 - delta) x - k x, |delta| <= 1/2, k = 1 within 1/2: lost where 2 = r/2 + r/2."""
    k = Scheduling("k", "1", low=0.5, high=1.5)
    model = LPVStateSpace.from_expressions(
        [[-1 - k.symbol]], [[1]], [[1]], [[0]], k, inputs=["d"], outputs=["v"]
    )
    margin = robust_margin(UncertainStateSpace(model, ["d"], ["v"], 0.5, 1.0, "an example"))
    assert margin.upper == pytest.approx(2.0, rel=1e-5)
    assert 1.99 < margin.lower < margin.upper
    assert margin.p == pytest.approx(0.0, abs=1e-5)


def test_what_is_never_lost_and_what_always_is():
    k = Scheduling("k", "1", low=0.5, high=1.5)
    for pole, bounds in ((-100.0, (2.0, np.inf)), (3.0, (0.0, 1e-6))):
        model = LPVStateSpace.from_expressions(
            [[pole - k.symbol]], [[1]], [[1]], [[0]], k, inputs=["d"], outputs=["v"]
        )
        unc = UncertainStateSpace(model, ["d"], ["v"], 0.5, 1.0, "an example")
        found = robust_margin(unc, largest=2.0)
        assert (found.lower, found.upper) == bounds


def test_what_cannot_be_grown_is_refused():
    with pytest.raises(InputError, match="expected an LFT"):
        robust_margin(page().model.at(10.0))
    with pytest.raises(InputError, match="bound > 0"):
        robust_margin(UncertainStateSpace(page().model, ["d"], ["v"], 0.0, 1.0, "nothing"))
