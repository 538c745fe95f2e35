"""Sliders in a notebook: a picture of the model at their values."""

import importlib.util

import numpy as np
import pytest

from symheli import LinearFamily, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import bode
from symheli.lpv.tools import LinearModels, damping, slider
from symheli.values import Signal

P = Scheduling("p", "m/s", low=0.0, high=2.0)
Q = Scheduling("q", "1", low=-1.0, high=1.0)
MODEL = LPVStateSpace.from_expressions(
    [[-1 - P.symbol, Q.symbol], [0, -2]], [[0], [1]], [[1, 0]], [[0]], [P, Q]
)
INSTALLED = importlib.util.find_spec("ipywidgets") is not None


@pytest.mark.skipif(not INSTALLED, reason="ipywidgets is not installed")
def test_the_picture_is_drawn_anew_where_a_slider_goes():
    seen = []
    found = slider(lambda model, channel, p: seen.append((channel, p)), MODEL, "y1")
    first, second = found.children[:2]
    assert (first.min, first.max, first.value, first.description) == (0.0, 2.0, 1.0, "p (m/s)")
    found.update()
    second.value = 0.5
    assert seen[0] == ("y1", [[1.0, 0.0]])
    assert seen[-1] == ("y1", [[1.0, 0.5]])


@pytest.mark.skipif(not INSTALLED, reason="ipywidgets is not installed")
def test_axes_tables_and_families_are_shown(capsys):
    models = LinearModels.of([MODEL.at(p, 0.0) for p in (0.0, 1.0)])
    family = LinearFamily((Signal("p", "m/s"),), ([0.0, 1.0],), models)
    for model in (MODEL, family):
        slider(damping, model).update()
        assert "frequency (rad/s)" in capsys.readouterr().out
    assert slider(damping, family).children[0].options == (0.0, 1.0)
    slider(bode, MODEL, "u1", "y1").update()
    assert "Figure" in capsys.readouterr().out


@pytest.mark.skipif(INSTALLED, reason="ipywidgets is installed")
def test_without_ipywidgets_the_message_says_how_to_have_it():
    with pytest.raises(InputError, match=r"a slider needs .*symheli\[notebook\]"):
        slider(bode, MODEL, "u1", "y1")


def test_a_model_without_parameters_has_no_slider():
    with pytest.raises(InputError, match="expected an LPVStateSpace"):
        slider(bode, MODEL.at(*np.zeros(2)), "u1", "y1")
