"""How many times its uncertainty a loop bears: published, in closed form, and by brute force."""

import control
import numpy as np
import pytest

from symheli import LFT, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv import connect
from synthesis.robust import DynamicBlock, intervals, robust_margin, upper_bound, worst_case_gain
from synthesis.robust.structure import loop_of


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


NEARLY_CANCELLING = """
-224.99578709313852 -11245.492615055136 -6488.216015509232 13861.193246370403
-9284.399028775573 22.45330976956955 1041.305390317753 384.8069066183451 -958.7991367772862
569.2733835820038 352.4090757970665 17394.411194362514 9141.563129325334 -20095.073669403897
13156.753619559233 96.63151184489091 4681.438814878496 2338.701090944046 -5225.723355405891
3378.020285499704 -123.04473479366254 -6205.2833536653925 -3565.6228115598396 7626.319777823549
-5102.677810455258 5.5638964387418253e-08 1.4712833457484655e-07 -2.144027769349402e-08
-1.212958538871086e-07 -1.3077687187422428e-07 -2.6967186834603532e-08 -7.131040864666338e-08
1.0391709851396546e-08 5.8789878461075516e-08 6.338515420453639e-08 1.2815098459606938e-07
3.388747642112862e-07 -4.9382527634819196e-08 -2.7937585241196495e-07 -3.012130990861082e-07
-3.474084222302832e-08 -9.186659590589914e-08 1.338726039868608e-08 7.57368539942206e-08
8.165677996032221e-08 2.5513843018671014e-08 6.746727357833423e-08 -9.831668963849731e-09
-5.562151289054477e-08 -5.996913523117853e-08 0.3461889402977906 -0.8127150457416082
0.14119745368983486 0.21908904012866637 0.6166655164838166 -1.4616139992960122
-0.7671973995542191 1.7292031089250024 -0.39295132164796354 -0.08392595905586166
-0.398384370787091 -1.4967206562960262 -1.0757201510474208 0.37070350619982256
-0.6720832622356478 2.0271350129053607 -1.4981827767010785 -1.9423529397853903
-0.39196739702232375 -1.2095503085223722
"""
"""A0, A1 (5, 5), B (5, 2) and C (2, 5): entries of 1e4 that nearly cancel, a slow pole, and a
parameter whose effect is 1e-12 of the entries.
"""


def nearly_cancelling(kind):
    """The model, and its dynamic block; lost at 5.948 times the ranges, by mpmath of A0 + p A1 at
    the peak of its lightly damped mode.
    """
    M = np.split(np.array(NEARLY_CANCELLING.split(), float), [25, 50, 60])
    A0, A1, B, C = (m.reshape(s) for m, s in zip(M, ((5, 5), (5, 5), (5, 2), (2, 5)), strict=True))
    p = Scheduling("p", "1", low=-0.003928317488908174, high=0.003928317488908174)
    A = [
        [float(a) + float(b) * p.symbol for a, b in zip(*r, strict=True)]
        for r in zip(A0, A1, strict=True)
    ]
    names = {"inputs": ["u", "d"], "outputs": ["y", "v"]}
    block = DynamicBlock(["d"], ["v"], 9.460778425564997e-10)
    return kind.from_expressions(A, B.tolist(), C.tolist(), [[0, 0], [0, 0]], p, **names), [block]


@pytest.mark.parametrize("kind", [LFT, LPVStateSpace])
def test_a_parameter_of_little_effect_is_not_dropped(kind):
    """Its effect was taken for rounding, and the margin said 9.27; rounding of a thousandth of the
    entries of A1, as of the constant part, made it 5.898.
    """
    margin = robust_margin(*nearly_cancelling(kind))
    assert margin.upper == pytest.approx(5.9481, rel=1e-4)
    assert 0.998 * margin.upper <= margin.lower <= margin.upper
    assert margin.verify(rigorous=True)


@pytest.mark.guard
@pytest.mark.parametrize("question", [robust_margin, worst_case_gain])
def test_an_lft_without_copies_of_a_parameter_is_refused(question):
    model, blocks = nearly_cancelling(LPVStateSpace)
    assert model.to_lft().reduce().sizes == (1,)
    lossy = model.to_lft().reduce(1e-12)
    assert lossy.sizes == (0,)
    with pytest.raises(InputError, match=r"no copies of p.*before reduce"):
        question(lossy, blocks)


@pytest.mark.guard
def test_scalings_of_a_solver_that_lies_about_their_sign_prove_nothing(monkeypatch):
    """1/(s + 1) with |delta| <= 1/2: the level is 1/2; with d < 0 where |M| is large it was .1."""
    p = Scheduling("p", "1", low=-1.0, high=1.0)
    one = {"inputs": ["d"], "outputs": ["v"]}
    lag = LPVStateSpace.polynomial([[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p, **one)

    def liar(M, loop, level, performance):
        d = np.full((1, 1), 1.0 if np.linalg.norm(M) < level else -1.0, complex)
        return intervals.Scalings(d, d, 0 * d)

    loop = loop_of(lag, [DynamicBlock(["d"], ["v"], 0.5)])
    monkeypatch.setattr(upper_bound, "scalings_at", liar)
    assert upper_bound.proven_level(loop, 0.1, performance=False).level >= 0.5


@pytest.mark.parametrize("small", [0.0, 1e-9])
def test_a_gain_that_comes_through_the_block_alone(small):
    """y = (small + delta/(s + 1)) u with |delta| <= .7; it was said to be infinite."""
    p = Scheduling("p", "1", low=0.0, high=1.0)
    model = LPVStateSpace.polynomial(
        [[[-1.0]]],
        [[[1.0, 0.0]]],
        [[[0.0], [1.0]]],
        [[[small, 1.0], [0.0, 0.0]]],
        p,
        inputs=["u", "d"],
        outputs=["y", "v"],
    )
    found = worst_case_gain(model, [DynamicBlock(["d"], ["v"], 0.7)])
    assert found.lower == pytest.approx(0.7, rel=1e-4)
    assert 0.7 <= found.upper < 0.71
