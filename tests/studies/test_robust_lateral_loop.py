"""The lateral loop that identified models are judged by."""

import numpy as np

import symheli
from studies.loops.lateral import HOLD, STATES
from studies.loops.robust_lateral import INPUTS, OUTPUTS, SIZES, margin
from symheli.lpv import stability_margin


def test_the_loop_has_a_margin_at_every_airspeed_and_the_attitude_hold_has_none_in_hover(ideal):
    family = symheli.sweep(ideal, np.linspace(0.0, 13.0, 14), inputs=INPUTS)
    models = family.select(STATES, INPUTS).discretize(0.02).models
    assert min(margin(model) for model in models) > 0.3
    hover = models[0].select(outputs=OUTPUTS)
    scales = {
        "input_scale": [SIZES[u] for u in INPUTS],
        "output_scale": [SIZES[y] for y in OUTPUTS],
    }
    assert stability_margin(hover, {("d_lat", "phi"): HOLD}, **scales) < 0.05
