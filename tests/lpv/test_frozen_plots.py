"""What a picture over the parameter shows is what the frozen models are."""

import control
import matplotlib as mpl
import numpy as np
import pytest
from families import random_lpv

from symheli import LinearFamily, lpv
from symheli.errors import InputError, UnknownNameError

mpl.use("Agg")
MODEL, _ = random_lpv(2, nx=3, nu=2, ny=2)
SAMPLED = MODEL.discretize(0.05)


@pytest.fixture(autouse=True)
def _closed():
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.mark.parametrize("model", [MODEL, MODEL.to_lft(), SAMPLED])
def test_a_bode_plot_is_that_of_python_control(model):
    upper, lower = lpv.bode(model, "u2", "y1", [0.0, 13.0], omega=[0.1, 1.0, 7.0])
    for curve, phase, p in zip(upper.lines, lower.lines, (0.0, 13.0), strict=True):
        theirs = model.at(p).to_control()
        size, angle, _ = control.frequency_response(theirs[0, 1], [0.1, 1.0, 7.0])
        np.testing.assert_allclose(curve.get_ydata(), 20 * np.log10(np.squeeze(size)), rtol=1e-9)
        turns = (np.radians(phase.get_ydata()) - np.squeeze(angle)) / (2 * np.pi)
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert [text.get_text() for text in upper.get_legend().get_texts()] == [
        "airspeed 0 m/s",
        "airspeed 13 m/s",
    ]


def test_singular_values_poles_and_nyquist_are_those_of_the_frozen_models():
    (line, other) = lpv.sigma(MODEL, [5.0], omega=[0.3, 2.0]).lines
    expected = np.linalg.svd(MODEL.at(5.0).frequency_response([0.3, 2.0]), compute_uv=False)
    for k, one in enumerate((line, other)):
        np.testing.assert_allclose(one.get_ydata(), 20 * np.log10(expected[:, k]))
    drawn = lpv.tools.nyquist(MODEL, "u1", "y2", [5.0], omega=[0.3, 2.0]).lines[0]
    G = MODEL.at(5.0).frequency_response([0.3, 2.0])[:, 1, 0]
    np.testing.assert_allclose(drawn.get_xdata() + 1j * drawn.get_ydata(), G)
    ax = lpv.tools.pole_map(MODEL)
    shown = np.concatenate(
        [x.get_xdata() + 1j * x.get_ydata() for x in ax.lines if x.get_marker() == "x"]
    )
    values = np.linspace(0.0, 13.0, 7)
    found = np.concatenate([MODEL.at(p).poles() for p in values])
    np.testing.assert_allclose(np.sort_complex(shown), np.sort_complex(found.astype(complex)))


@pytest.mark.parametrize("model", [MODEL, SAMPLED])
def test_damping_is_that_of_python_control(model):
    table = lpv.tools.damping(model, [2.0, 9.0])
    for p in (2.0, 9.0):
        frequency, ratio, poles = control.damp(model.at(p).to_control(), doprint=False)
        upper = np.imag(poles) >= 0 if model.dt is None else np.imag(np.log(poles + 0j)) >= 0
        rows = [row for row in table.rows if row[0] == (p,)]
        np.testing.assert_allclose(sorted(r[2] for r in rows), sorted(frequency[upper]), rtol=1e-9)
        np.testing.assert_allclose(
            sorted(r[3] for r in rows), sorted(ratio[upper]), rtol=1e-9, atol=1e-12
        )
    assert str(table).count("\n") == len(table.rows)
    assert list(table.to_frame().columns) == [
        *("real part", "imaginary part", "frequency", "damping ratio"),
    ]


def test_a_step_along_a_history_that_stands_is_the_frozen_one():
    ax = lpv.step(MODEL, "u1", "y1", [4.0], duration=5.0, along=np.full(501, 4.0))
    frozen, moving, _ = ax.lines
    np.testing.assert_allclose(frozen.get_ydata(), moving.get_ydata(), atol=1e-9)
    assert frozen.get_xdata()[-1] == pytest.approx(5.0)


def test_families_and_linear_models_are_shown_and_other_things_refused():
    models = [MODEL.at(p) for p in (0.0, 6.0, 13.0)]
    family = LinearFamily.from_models([0.0, 6.0, 13.0], models)
    assert len(lpv.bode(family, "u1", "y1")[0].lines) == 3
    assert len(lpv.bode(models[0], "u1", "y1")[0].lines) == 1
    with pytest.raises(InputError, match="leave p out"):
        lpv.sigma(models[0], [1.0])
    with pytest.raises(InputError, match="got str"):
        lpv.tools.pole_map("roll")
    with pytest.raises(UnknownNameError, match="did you mean 'u1'"):
        lpv.bode(MODEL, "u11", "y1")
    with pytest.raises(InputError, match="not on the grid"):
        lpv.sigma(family, [5.0])
    with pytest.raises(InputError, match="whose parameter can move"):
        lpv.step(family, "u1", "y1", along=[0.0, 1.0])
