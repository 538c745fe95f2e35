"""The lateral loop that identified models are judged by."""

import numpy as np

import symheli
from studies.loops.lateral import HOLD
from studies.loops.robust_lateral import SIZES, margin
from studies.setup.axes import LATERAL
from symheli.lpv import stability_margin


def test_the_loop_has_a_margin_at_every_airspeed_and_the_attitude_hold_has_none_in_hover(ideal):
    family = symheli.sweep(ideal, np.linspace(0.0, 13.0, 14), inputs=LATERAL.inputs)
    models = family.select(LATERAL.states, LATERAL.inputs).discretize(0.02).models
    assert min(margin(model) for model in models) > 0.3
    hover = models[0].select(outputs=LATERAL.outputs)
    scales = {
        "input_scale": [SIZES[u] for u in LATERAL.inputs],
        "output_scale": [SIZES[y] for y in LATERAL.outputs],
    }
    assert stability_margin(hover, {("d_lat", "phi"): HOLD}, **scales) < 0.05
