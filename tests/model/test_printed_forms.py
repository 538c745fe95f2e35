"""Every decision has its printed form as a named option, which changes what it says and nothing
else.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import symheli
from symheli.airframe.printed_forms import PRINTED
from symheli.values.kinematics import GRAVITY

OFF_TRIM = {
    "u": 6.0,
    "v": 1.0,
    "w": 0.5,
    "p": 0.2,
    "q": -0.1,
    "r": 0.3,
    "phi": 0.1,
    "theta": -0.05,
    "a1": 0.01,
    "b1": -0.02,
    "Om": 165.0,
    "om_i": 14.0,
}


def load(*printed, governor="pi"):
    return symheli.Helicopter.load("xcell60", governor=governor, printed=printed)


def state(heli, **changes):
    values = {**OFF_TRIM, **changes}
    return np.array([values[str(s)] for s in heli.states])


def derivative(heli, controls=(0.01, -0.01, 0.09, 0.2), **changes):
    return dict(
        zip(
            map(str, heli.states),
            np.array(heli.rhs(state(heli, **changes), controls, np.zeros(3))).ravel(),
            strict=True,
        )
    )


def changed(option, **at):
    """Names of the state derivatives that the option moves."""
    before, after = derivative(load(), **at), derivative(load(option), **at)
    return {
        name for name in before if abs(before[name] - after[name]) > 1e-12 * (1 + abs(before[name]))
    }


@pytest.mark.parametrize(
    ("option", "rows"),
    [
        ("lateral_flapping", {"b1"}),
        (
            "flapping_sign",
            {"a1"},
        ),  # in forward flight by sideslip alone, which makes mu larger than mu_x
        ("fuselage_downwash", {"u", "v", "w"}),
        ("rotor_reaction", {"Om"}),
        ("horizontal_tail_lift", {"w", "q"}),
        ("tail_advance_ratio", {"v", "p", "r", "Om"}),
        ("tail_rotor_linear", {"v", "p", "r", "Om"}),
        ("ideal_inflow", {"u", "v", "w", "p", "q", "r", "a1", "b1", "Om"}),
        ("thrust_limit", set()),  # far from the limit
        ("relaxed_inflow", set()),  # the same root
    ],
)
def test_each_form_moves_the_equations_it_names_and_no_other(option, rows):
    assert changed(option) == rows
    assert option in PRINTED


def test_every_form_is_tried_above():
    marks = test_each_form_moves_the_equations_it_names_and_no_other.pytestmark[0].args[1]
    assert {option for option, _ in marks} == set(PRINTED)


def test_flapping_sign_makes_rearward_flight_flap_as_forward_flight():
    """mu^2 sign(mu) with mu >= 0 cannot tell the two apart: the term of a1' in mu_z keeps its sign
    when u turns.
    """
    printed, decided = load("flapping_sign"), load()
    forward, rearward = (
        [derivative(h, u=u, v=0.0)["a1"] for h in (printed, decided)] for u in (6.0, -6.0)
    )
    assert forward[0] == pytest.approx(forward[1], rel=1e-12)
    assert (
        rearward[0] > rearward[1] + 1e-4
    )  # w > 0: the printed term tilts the disc aft, the decided one forward


def test_downwash_pushes_the_fuselage_down_and_as_printed_lifts_it():
    """In hover, against the rotor alone, whose weight the collective then carries or not: 0.0999
    and 0.0967 rad.
    """
    collective = [
        symheli.trim(load(*o, governor="ideal"), 0.0).u["d_col"]
        for o in ((), ("fuselage_downwash",))
    ]
    assert collective == [pytest.approx(0.0999, abs=5e-5), pytest.approx(0.0967, abs=5e-5)]
    assert collective[1] < 0.0985 < collective[0]  # 0.0985: thrust equal to the weight


def test_thrust_limit_of_the_text_is_two_and_a_half_times_the_weight():
    """At full collective and full speed of the blades the rotor stalls: 2.5 m g against the 2.65 of
    the table.
    """
    for option, expected in (
        ((), 0.0055 * 1.225 * (167 * 0.775) ** 2 * math.pi * 0.775**2),
        (("thrust_limit",), 2.5 * 8.2 * GRAVITY),
    ):
        heli = load(*option, governor="ideal")
        d = heli.diagnostics(x=np.zeros(10), u=[0, 0, 0.5, 0.2], wind=0)
        assert float(d["T_mr"]) == pytest.approx(expected, rel=1e-12)


def test_ideal_inflow_gives_the_printed_hover_torque():
    from scipy.optimize import brentq

    heli = load("ideal_inflow", governor="ideal")

    def hover(d_col):
        return heli.diagnostics(x=np.zeros(10), u=[0, 0, d_col, 0.25], wind=0)

    d_col = brentq(lambda c: float(hover(c)["T_mr"]) - 8.2 * GRAVITY, 0.02, 0.17, xtol=1e-14)
    assert float(hover(d_col)["Q_mr"]) == pytest.approx(
        6.298, abs=5e-4
    )  # the last digit of the closed form


def test_relaxed_inflow_finds_the_same_root_on_both_branches():
    from symheli.physics import inflow

    pitch, mu, mu_z = (
        grid.ravel()
        for grid in np.meshgrid([-0.1, 0.03, 0.1, 0.3], [0.0, 0.01, 0.1], [-0.03, 0.0, 0.01])
    )
    c0, c1 = inflow.thrust_line(pitch, mu**2, mu_z, 5.5, 0.0476)
    arguments = c0, c1, 0.0055, mu**2, mu_z, 0.9
    hover = np.sqrt(np.abs(np.clip(c0 - c1 * inflow.solve(*arguments), -0.0055, 0.0055)) / 1.8)
    promised = inflow.vortex_ring(hover, mu**2, np.sign(c0) * mu_z) <= 0
    assert promised.sum() > 20
    # relaxation gains a factor 0.4 a step, 1e-16 in forty; near zero thrust the slope is small and
    # rounding counts
    np.testing.assert_allclose(
        inflow.relaxed(*arguments)[promised],
        inflow.solve(*arguments)[promised],
        rtol=1e-9,
        atol=1e-12,
    )


def test_linear_tail_rotor_touches_the_full_one_at_its_trim_pitch():
    """Same slopes at the trim pitch: the miss of the linear form is of second order there, and its
    slopes are those printed.
    """
    full, linear = load(governor="ideal"), load("tail_rotor_linear", governor="ideal")
    x = np.zeros(10)

    def thrust(heli, pitch, v):
        x[1] = v
        return -float(heli.diagnostics(x=x, u=[0, 0, 0.1, pitch], wind=0)["Y_tr"])

    step = 1e-5
    for slope in (
        lambda h: (thrust(h, 0.1 + step, 0.0) - thrust(h, 0.1 - step, 0.0)) / (2 * step),
        lambda h: (thrust(h, 0.1, step) - thrust(h, 0.1, -step)) / (2 * step),
    ):
        assert slope(linear) == pytest.approx(
            slope(full), rel=1e-7
        )  # central differences of a smooth function
    # a line through the origin with that slope: its own value at the trim pitch is not that of the
    # curve
    assert thrust(linear, 0.1, 0.0) > 1.2 * thrust(full, 0.1, 0.0)


def test_linear_tail_rotor_asks_for_the_trim_pitch(tmp_path):
    from importlib import resources

    text = (resources.files("symheli.airframe.vehicles") / "xcell60.toml").read_text(
        encoding="utf-8"
    )
    path = tmp_path / "without.toml"
    path.write_text(
        "\n".join(line for line in text.splitlines() if not line.startswith("trim_pitch")),
        encoding="utf-8",
    )
    assert symheli.trim(symheli.Helicopter.load(path), 3.0).success
    with pytest.raises(symheli.errors.InputError, match="trim_pitch"):
        _ = symheli.Helicopter.load(path, printed=["tail_rotor_linear"]).rhs


def test_printed_tail_sign_pitches_down_further_in_fast_flight():
    """The text states about -10 deg at 14.5 m/s: with the printed sign -10.0, with the stabilising
    one -8.6.
    """
    pitch = [
        math.degrees(symheli.trim(load(*o, governor="ideal"), 14.5).x["theta"])
        for o in ((), ("horizontal_tail_lift",))
    ]
    assert pitch == [pytest.approx(-8.56, abs=0.01), pytest.approx(-10.02, abs=0.01)]
    models = [load(*o, governor="ideal") for o in ((), ("horizontal_tail_lift",))]
    slopes = [
        symheli.linearize(h, symheli.trim(h, 14.5)).A[h.states.index("q"), h.states.index("w")]
        for h in models
    ]
    assert slopes[0] < slopes[1]  # M_w: the tail as decided turns the nose into the flow


def test_unknown_form_names_the_nearest():
    with pytest.raises(symheli.errors.UnknownNameError, match="lateral_flapping"):
        load("lateral_flaping")
