"""The gain over the permitted rate, and the pictures of what is proven."""

import math

import numpy as np
import pytest

import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

QUICK = LowerBoundSearch(levels=3, dwells=2, starts=1, nodes=10, evaluations=2, samples=2000)
FORM = Spline(segments=(4,))


@pytest.fixture(scope="module")
def loop():
    """A spring of stiffness 1 to 4 with little damping: pumped fast enough, its state grows."""
    return LPVStateSpace.polynomial(
        A=[[[0, 1.0], [-1.0, -0.4]], [[0, 0], [-3.0, 0]]],
        B=[[[0.0], [1.0]]],
        C=[[[1.0, 0.0]]],
        D=[[[0.0]]],
        scheduling=Scheduling("stiffness", "1", 0.0, 1.0),
        inputs=["force"],
        outputs=["place"],
    )


@pytest.fixture(scope="module")
def curve(loop):
    return synthesis.analysis.gain_against_rate(
        loop, [1.0, 0.0, math.inf, 0.2], lft=["DG"], form=FORM, search=QUICK, title="a spring"
    )


@pytest.mark.slow
def test_the_curve_is_that_of_the_single_gains(loop, curve):
    assert sorted(curve.lower) == [0.0, 0.2, 1.0, math.inf]
    for rate in (0.0, 0.2, 1.0):
        alone = synthesis.l2_gain(loop, rate, form=FORM, search=QUICK)
        assert curve.bounds["P(p)"][rate] == alone.gamma
        assert curve.lower[rate] == alone.lower
        assert curve.certificates["P(p)", rate].verified == alone.verified
    # p frozen at 0: 1/(s^2 + 0.4 s + 1) peaks at 1/(0.4 sqrt(1 - 0.04)); stiffer is lower
    assert curve.frozen == pytest.approx(1 / (0.4 * math.sqrt(0.96)), rel=1e-6)
    assert set(curve.jumping) == {"constant P", "LFT DG"}


def test_bounds_are_in_order_and_grow_with_the_rate(curve):
    proven = [curve.best[rate] for rate in sorted(curve.best)]
    assert proven == sorted(proven)
    for rate, gain in curve.best.items():
        assert curve.frozen <= curve.lower[rate] * (1 + 1e-9) <= gain * (1 + 1e-6)


def test_a_rate_at_which_the_state_grows_has_no_proof(curve):
    assert curve.growing == 1.0
    assert math.isinf(curve.bounds["P(p)"][1.0])
    assert curve.fastest[0] == 0.2
    assert "at 1 1/s a computed history of stiffness makes the state grow" in curve.verdict()


def test_the_frame_holds_every_form(curve, pd):
    frame = curve.to_frame()
    assert list(frame.columns) == ["lower", "proven", "P(p)", "constant P", "LFT DG"]
    assert frame.index.name == "rate"
    assert frame.attrs["units"]["rate"] == "1/s"
    assert frame.attrs["frozen"] == curve.frozen
    assert frame.loc[0.2, "P(p)"] == curve.bounds["P(p)"][0.2]
    assert math.isnan(frame.loc[0.2, "LFT DG"])


def test_the_words_are_about_this_parameter(curve):
    assert curve.parameter == "stiffness"
    assert "airspeed" not in curve.verdict()
    assert "1/s" in curve.verdict()


def test_proofs_of_a_curve_travel(curve, tmp_path):
    cert = curve.certificates["P(p)", 0.2]
    back = synthesis.Certificate.load(cert.save(tmp_path / "proof.json"))
    assert back.verify(rigorous=True)
    assert back.gamma == curve.bounds["P(p)"][0.2]


@pytest.mark.parametrize("rates", [[], [-1.0], [0.5, 0.5], [math.nan]])
def test_rates_that_are_none_are_refused(loop, rates):
    with pytest.raises(InputError, match="rates: expected different numbers >= 0"):
        synthesis.analysis.gain_against_rate(loop, rates)


def test_several_parameters_are_refused(loop):
    two = loop.with_parameter(Scheduling("other", "1", 0.0, 1.0))
    with pytest.raises(InputError, match="a model of one parameter"):
        synthesis.analysis.gain_against_rate(two, [0.0])


# --- pictures -------------------------------------------------------------------------------------


@pytest.fixture
def ax():
    from matplotlib.figure import Figure

    return Figure().subplots()


def test_the_curve_is_drawn_on_the_axes_given(curve, ax):
    assert curve.plot(ax) is ax
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in ax.lines}
    np.testing.assert_array_equal(
        lines["proven, P(p)"], [curve.bounds["P(p)"][r] for r in (0.0, 0.2)]
    )
    assert "worst trajectory of the linear model" in lines  # no flight
    assert "stiffness" in ax.get_xlabel()
    assert {"open", "grows"} & {text.get_text() for text in ax.texts} == {"open", "grows"}
    assert ax.get_title() == "a spring"


def test_a_certificate_draws_its_bracket(curve, ax):
    cert = curve.certificates["P(p)", 0.2]
    assert cert.plot(ax) is ax
    points = [float(line.get_ydata()[0]) for line in ax.lines if len(line.get_ydata()) == 1]
    assert points == [cert.frozen, cert.lower, cert.gamma]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["frozen", "attained", "proven"]


def test_a_certificate_without_a_proof_says_so(curve, ax):
    curve.certificates["P(p)", 1.0].plot(ax)
    assert {"grows", "nothing proven"} <= {text.get_text() for text in ax.texts}


def test_stability_has_nothing_to_draw(loop, ax):
    cert = synthesis.stability(loop, 0.1, search=None)
    with pytest.raises(InputError, match="no bounds to draw"):
        cert.plot(ax)
