"""Panels side by side."""

import math

from evidence.figures import save
from synthesis.certify.questions.gain_curve import GainCurve

CURVE = GainCurve(
    "loop",
    "1",
    1.0,
    {0.0: 1.0, 1.0: 2.0, math.inf: math.inf},
    {"P(p)": {0.0: 1.0, 1.0: 2.5}},
    {"constant P": math.inf},
)


def test_the_figure_is_wider_by_a_panel(tmp_path):
    for count in (1, 2):
        save([CURVE.plot] * count, tmp_path / f"{count}.png")
    one, two = ((tmp_path / f"{count}.png").stat().st_size for count in (1, 2))
    assert 10_000 < one < two
