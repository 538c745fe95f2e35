"""The curve of gain against permitted acceleration, and the table of it."""

import math

import pytest

from studies.setup.bounds import LFT_TESTS
from studies.transition import gain_tables, guarantees
from symheli import LPVStateSpace, Scheduling
from synthesis.analysis import LowerBoundSearch
from synthesis.certify.questions.gain_curve import GainCurve
from synthesis.forms import Spline

NOTHING = {"constant P": math.inf, "LFT D/G": math.inf}
STEEP = GainCurve(
    "steep",
    "1",
    1.0,
    {0.0: 1.0, 1.0: 2.0, 3.0: 5.0, 7.0: math.inf, math.inf: math.inf},
    {"P(p, lag)": {3.0: 6.0}, "P(p)": {0.0: 1.0, 1.0: 7.0, 3.0: 8.0, 7.0: math.inf}},
    NOTHING,
)
FLAT = GainCurve(
    "flat",
    "1",
    1.0,
    {0.0: 1.0, math.inf: 1.0},
    {"P(p)": {0.0: 1.0, 3.0: 1.0}},
    {"LFT D/G": 1.0, "LFT D": 1.7},
)


def test_a_proof_for_a_larger_acceleration_counts_for_a_smaller_one():
    assert STEEP.best == {0.0: 1.0, 1.0: 6.0, 3.0: 6.0}
    assert STEEP.fastest == (3.0, 6.0)


def test_the_words_say_what_is_proven_and_what_grows():
    assert STEEP.growing == 7.0
    assert "none can" in STEEP.verdict()
    assert "at 7 m/s^2 a computed history of airspeed makes the state grow" in STEEP.verdict()
    assert FLAT.verdict().startswith("LFT D/G proves 1 for an airspeed that jumps")


def test_the_open_region_is_shaded_only_where_no_test_proves_a_gain():
    plt = pytest.importorskip("matplotlib.pyplot")
    for curve, words in ((STEEP, {"open", "grows"}), (FLAT, set())):
        ax = curve.plot(plt.figure().add_subplot())
        assert {text.get_text() for text in ax.texts} & {"open", "grows"} == words
        plt.close(ax.figure)


@pytest.mark.slow
def test_the_table_shows_every_form_and_what_a_jumping_airspeed_costs():
    lpv = LPVStateSpace.polynomial(
        [[[-2.0]], [[1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
    )
    quick = LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1, samples=100)
    form = Spline(segments=(2,))
    asked = guarantees.bounds("baseline", "gust", lpv, (0.0, 1.0, math.inf), form, quick)
    found = guarantees.answered([*asked, *guarantees.lft_bounds("baseline", "gust", lpv)])
    table = gain_tables.guarantee(found, "gust")
    assert table.columns[5:] == ["P(p)", "constant P", *LFT_TESTS]
    # a first-order lag with pole -1 at the worst: gain 1 whatever p does, and every test finds it
    # or more
    assert [row[5:7] for row in table.rows] == [["1", "1"], ["1", "1"], ["", "1"]]
    assert {row[2] for row in table.rows} == {"proven"}
    curve = guarantees.gain_curve(found, "baseline", "gust", "lag")
    assert curve.jumping["LFT D/G"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_a_proof_of_a_model_that_the_exact_one_exceeds_is_said_not_to_hold_for_the_helicopter():
    def lag(gain):
        return LPVStateSpace.polynomial(
            [[[-2.0]], [[1.0]]], [[[gain]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
        )

    def bounds(model, gain):
        return guarantees.answered(
            guarantees.bounds(
                model,
                "gust",
                lag(gain),
                (1.0,),
                Spline(segments=(2,)),
                LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1),
            )
        )

    (sentence,) = gain_tables.not_about_the_helicopter(
        [*bounds("baseline", 1.0), *bounds("exact", 2.0)]
    )
    assert sentence.startswith(
        "Gust channel, 1 m/s^2: 1 is proven of the baseline model, and computed airspeed"
        " histories of the exact models reach 2"
    )
    assert not gain_tables.not_about_the_helicopter(
        [*bounds("baseline", 2.1), *bounds("exact", 2.0)]
    )
    assert not gain_tables.not_about_the_helicopter(
        [*bounds("baseline", 2.0), *bounds("exact", 2.0001)]
    )
